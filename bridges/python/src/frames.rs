//! Frames of a log.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use tagalong::core::{DepthImage, GreyImage, Input, RgbImage};
use tagalong::log::{FrameSource, LogFrame};
use tagalong::{Frames, Log, Pipeline};

use crate::arrays;
use crate::camera::PyCamera;
use crate::errors::{failed, raised};

/// One moment of a log: images, camera, and the robot's pose.
#[pyclass(name = "Frame", module = "tagalong", frozen)]
pub struct PyFrame(pub Arc<LogFrame>);

#[pymethods]
impl PyFrame {
    /// Index of the image in the log, from 1.
    #[getter]
    fn index(&self) -> u64 {
        self.0.frame.index
    }

    /// Capture time, ns.
    #[getter]
    fn stamp_ns(&self) -> u64 {
        self.0.frame.stamp.nanos()
    }

    /// Colour image, rows x columns x 3, or grey image, rows x columns, uint8; None without one.
    #[getter]
    fn colour<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let images = self.0.frame.images();
        Ok(match (images.colour, images.grey) {
            (Some(colour), _) => Some(of_colour(py, &colour)?.into_any()),
            (None, Some(grey)) => Some(of_grey(py, &grey)?.into_any()),
            (None, None) => None,
        })
    }

    /// Depth along the optical axis, m, rows x columns, float32; NaN where there is no reading.
    /// None without a depth image.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let depth: Option<Arc<DepthImage>> = self.0.frame.images().depth;
        depth.map(|image| arrays::of_plane(py, &image)).transpose()
    }

    /// Points of the laser scan, rows of x, y, z, m, robot frame; None without a scan.
    #[getter]
    fn scan<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let points = &self.0.frame.laser()?.points;
        let shape = (points.len(), 3);
        let array =
            numpy::ndarray::Array2::from_shape_fn(shape, |(row, column)| points[row][column]);
        Some(PyArray2::from_owned_array(py, array))
    }

    /// The camera; None for a frame that has only a laser scan.
    #[getter]
    fn camera(&self) -> Option<PyCamera> {
        let camera = &self.0.frame.camera;
        (!camera.is_blind()).then(|| PyCamera(Arc::clone(camera)))
    }

    /// Pose of the robot in the odometry frame: x, y (m), heading (rad).
    #[getter]
    fn pose(&self) -> (f64, f64, f64) {
        let pose = &self.0.odom_from_robot;
        (pose.translation.x, pose.translation.y, pose.rotation.angle())
    }

    /// True if the pose is a guess, because odometry is silent or has jumped.
    #[getter]
    fn pose_is_stale(&self) -> bool {
        self.0.odom_stale
    }

    /// Age of the newest odometry at the time of the frame, s; infinite if there never was any.
    #[getter]
    fn odometry_age_s(&self) -> f64 {
        self.0.frame.odometry_age_s
    }

    fn __repr__(&self) -> String {
        format!("Frame({}, {} s)", self.0.frame.index, self.0.frame.stamp)
    }
}

fn of_colour<'py>(py: Python<'py>, image: &RgbImage) -> PyResult<Bound<'py, PyArray3<u8>>> {
    arrays::of_rgb(py, image)
}

fn of_grey<'py>(py: Python<'py>, image: &GreyImage) -> PyResult<Bound<'py, PyArray2<u8>>> {
    arrays::of_plane(py, image)
}

/// Frames of a log, one after the other.
#[pyclass(name = "Frames", module = "tagalong", frozen)]
pub struct PyFrames(Mutex<Frames>);

impl PyFrames {
    /// Opens a log for a pipeline.
    ///
    /// # Errors
    /// As `Log::frames_for`.
    pub fn open(log: &Path, pipeline: &Pipeline) -> tagalong::Result<Self> {
        // Colour is added for the caller, even if the pipeline does not use it.
        let inputs = pipeline.inputs().accept(Input::Colour);
        let frames = Log::open(log)?.frames_for(pipeline, inputs)?;
        // The counters show a loss, as in the program.
        Ok(Self(Mutex::new(frames.accept_loss())))
    }

    fn with<T>(&self, look: impl FnOnce(&FrameSource) -> T) -> T {
        look(self.0.lock().unwrap_or_else(PoisonError::into_inner).source())
    }
}

#[pymethods]
impl PyFrames {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<PyFrame>> {
        let next = py.detach(|| self.0.lock().map(|mut frames| frames.next()).ok());
        let next = next.ok_or_else(|| failed("the log reader failed at an earlier frame"))?;
        Ok(next.transpose().map_err(raised)?.map(|frame| PyFrame(Arc::new(frame))))
    }

    /// Counters so far: messages that were read, images that were skipped by reason, and damage.
    #[getter]
    fn counters(&self) -> BTreeMap<&'static str, u64> {
        self.with(|source| source.counters().clone())
    }

    /// Remarks about the log.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.with(|source| source.notes().to_vec())
    }

    /// True if part of the log could not be used because it is damaged.
    #[getter]
    fn data_lost(&self) -> bool {
        self.with(|source| source.data_lost())
    }
}
