//! Pipelines.

use std::ffi::CString;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nalgebra::Isometry2;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::{PyInt, PyString};
use tagalong::core::{ExternalDetection, Images, Input, LaserScan, RightImage, Stamp, TrackId};
use tagalong::geometry::Camera;
use tagalong::pipeline::{Choice, Enrollment, StepError};
use tagalong::{ConfigSource, FrameMaker, FrameReport, LogSettings, Pipeline};

use crate::arrays;
use crate::camera::PyCamera;
use crate::doubts::Doubts;
use crate::errors::{ConfigError, failed, raised, wrong};
use crate::frames::{PyFrame, PyFrames};
use crate::report::{PyCommand, PyReport, stamp};

/// A pipeline: detectors, verifiers, association, filter, and a controller if the config has one.
#[pyclass(name = "Pipeline", module = "tagalong", frozen)]
pub struct PyPipeline {
    work: Mutex<Work>,
    doubts: Mutex<Doubts>,
}

/// Pipeline together with the maker of its frames.
struct Work {
    pipeline: Pipeline,
    maker: FrameMaker,
    /// True before the first frame from arrays, when the sources of a controller are checked.
    is_new: bool,
    /// True once a frame from arrays had detections.
    is_told: bool,
}

/// Data of one moment.
struct Data {
    index: Option<u64>,
    stamp: Stamp,
    camera: Option<PyCamera>,
    pose: Option<Isometry2<f64>>,
    images: Images,
    scan: Option<LaserScan>,
    detections: Option<Vec<ExternalDetection>>,
    odometry_age_s: Option<f64>,
}

#[pymethods]
impl PyPipeline {
    /// Builds a pipeline.
    ///
    /// source: the path of a TOML file, the name of a built-in config ("depth-verified"), or the
    /// text of a config: a str that contains a line break or a `=`. folder: base folder of relative
    /// paths in such a text. seed: replaces the seed of the config.
    ///
    /// Raises ConfigError, with the line and the remedy.
    #[staticmethod]
    #[pyo3(signature = (source, *, folder=None, seed=None))]
    fn from_toml(
        py: Python<'_>,
        source: &Bound<'_, PyAny>,
        folder: Option<PathBuf>,
        seed: Option<u64>,
    ) -> PyResult<Self> {
        let source = config(source, folder.as_deref())?;
        py.detach(|| Self::build(&source, seed)).map_err(raised)
    }

    /// Runs the pipeline on one frame and returns a Report.
    ///
    /// Raises ValueError for a frame that cannot be used, such as one without depth for a pipeline
    /// that needs it: no command follows from this frame, and the next one is processed as usual.
    ///
    /// colour: uint8, rows x columns x 3 (red, green, blue) or rows x columns. depth: float32 in
    /// metres or uint16 in millimetres, registered to colour. camera: a Camera with the size of the
    /// images. pose: pose of the robot in the odometry frame, (x, y, heading) or 4 x 4; None
    /// without odometry. stamp: capture time, ns as an int or seconds as a float. scan: float64,
    /// rows of x, y or x, y, z of a laser scan in the robot frame. scan_stamp: time of the scan,
    /// given like stamp, if the scanner is slower than the images and its last scan is passed again
    /// [default: stamp]. right, baseline_m: the right image of a rectified stereo pair, and its
    /// baseline, m. index: index of the frame [default: number of frames so far]. odometry_age_s:
    /// age of the odometry that the pose comes from, at the time of the stamp; a robot is not
    /// steered by old odometry [default: 0, and infinite without a pose]. detections: the output of
    /// your own detector, for a config with the plugin `recorded-detections` ("recorded"): rows of
    /// x, y, width, height, score, in pixels of the camera's image, or of x, y, z, score, with the
    /// centre of the head in the robot frame, m; [] if it found no person, None if it did not run.
    #[pyo3(signature = (colour, depth, camera, pose, stamp, *, scan=None, scan_stamp=None, right=None,
        baseline_m=None, index=None, odometry_age_s=None, detections=None))]
    #[allow(clippy::too_many_arguments, reason = "they are the keywords of a Python method")]
    fn step(
        &self,
        py: Python<'_>,
        colour: Option<&Bound<'_, PyAny>>,
        depth: Option<&Bound<'_, PyAny>>,
        camera: Option<PyCamera>,
        pose: Option<&Bound<'_, PyAny>>,
        stamp: &Bound<'_, PyAny>,
        scan: Option<&Bound<'_, PyAny>>,
        scan_stamp: Option<&Bound<'_, PyAny>>,
        right: Option<&Bound<'_, PyAny>>,
        baseline_m: Option<f64>,
        index: Option<u64>,
        odometry_age_s: Option<f64>,
        detections: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyReport> {
        let mut images = Images::default();
        colour.map(|array| arrays::add_colour(&mut images, array)).transpose()?;
        images.depth = depth.map(arrays::depth).transpose()?.map(Arc::new);
        images.right = right.map(|array| right_image(array, baseline_m)).transpose()?.map(Arc::new);
        let scan = scan.map(arrays::points).transpose()?.map(LaserScan::of_points);
        let scan_stamp = scan_stamp.map(self::stamp).transpose()?;
        let scan = match (scan, scan_stamp) {
            (Some(scan), Some(stamp)) => Some(scan.with_stamp(stamp)),
            (scan, _) => scan,
        };
        let pose = pose.map(arrays::pose).transpose()?;
        let detections = detections.map(arrays::detections).transpose()?;
        let is_whole = stamp.is_instance_of::<PyInt>();
        let stamp = self::stamp(stamp)?;
        self.doubt(py, &images, is_whole.then_some(stamp))?;
        let data = Data { index, stamp, camera, pose, images, scan, detections, odometry_age_s };
        let (report, camera) = py.detach(|| self.work()?.step(data))?;
        PyReport::new(py, report, &camera)
    }

    /// Runs the pipeline on a frame of `frames`, as the program does.
    fn step_frame(&self, py: Python<'_>, frame: &PyFrame) -> PyResult<PyReport> {
        let frame = &frame.0;
        let report = py.detach(|| {
            let step = self.work()?.pipeline.step(&**frame);
            step.map_err(told)
        })?;
        PyReport::new(py, report, &frame.frame.camera)
    }

    /// Opens a log (.mcap, .db3, .bag, or the folder of a recording) for this pipeline, with the
    /// `[input]` of its config, and returns its frames.
    fn frames(&self, py: Python<'_>, log: PathBuf) -> PyResult<PyFrames> {
        py.detach(|| PyFrames::open(&log, &self.work()?.pipeline).map_err(raised))
    }

    /// The command in force at a time (given like `stamp` of `step`): the last one until it
    /// expires, then zero; None without a controller.
    fn command_at(&self, stamp: &Bound<'_, PyAny>) -> PyResult<Option<PyCommand>> {
        let now = self::stamp(stamp)?;
        Ok(self.work()?.pipeline.command_at(now).map(PyCommand))
    }

    /// Follows the person of this track. Raises ValueError without a controller, or if the last
    /// frame has no such track.
    fn choose_target(&self, track: u32) -> PyResult<()> {
        let person = Enrollment::of(Choice::Track(TrackId(track)));
        self.work()?.pipeline.enroll(&person).map_err(wrong)
    }

    /// Stops the robot until `arm`.
    fn disarm(&self) -> PyResult<()> {
        self.work()?.pipeline.disarm("stopped by the program");
        Ok(())
    }

    /// Sets whether the base executes the commands from now on. Only then are they compared with
    /// the odometry: a base that does something else, or responds too late, is a fault.
    fn set_driving(&self, is_driving: bool) -> PyResult<()> {
        self.work()?.pipeline.set_driving(is_driving);
        Ok(())
    }

    /// Lets the robot move again after a fault that a person has checked.
    fn arm(&self) -> PyResult<()> {
        self.work()?.pipeline.arm();
        Ok(())
    }

    /// The fault that stops the robot until `arm`; None without one.
    #[getter]
    fn fault(&self) -> PyResult<Option<&'static str>> {
        Ok(self.work()?.pipeline.fault())
    }

    /// True if the config has a controller.
    #[getter]
    fn has_controller(&self) -> PyResult<bool> {
        Ok(self.work()?.pipeline.has_controller())
    }

    /// The config with every default filled in, as TOML.
    #[getter]
    fn resolved(&self) -> PyResult<String> {
        Ok(self.work()?.pipeline.config().to_toml().to_owned())
    }
}

impl PyPipeline {
    /// Builds a pipeline. A mistake in a table for logs is an error of the config, so it is
    /// reported here.
    fn build(source: &ConfigSource, seed: Option<u64>) -> tagalong::Result<Self> {
        let registry = tagalong::builtin_registry();
        let builder = Pipeline::builder(&registry);
        let builder = match seed {
            Some(seed) => builder.seed(seed),
            None => builder,
        };
        let pipeline = builder.build(source)?;
        let sigma = LogSettings::of(&pipeline)?.input.odometry_sigma;
        let maker = FrameMaker::without_camera().with_odometry_sigma(sigma);
        let work = Work { pipeline, maker, is_new: true, is_told: false };
        Ok(Self { work: Mutex::new(work), doubts: Mutex::default() })
    }

    /// Warns of arrays and stamps that are probably not intended, once for each kind.
    fn doubt(&self, py: Python<'_>, images: &Images, stamp: Option<Stamp>) -> PyResult<()> {
        let said = self.doubts.lock().unwrap_or_else(PoisonError::into_inner).of(images, stamp);
        said.iter().try_for_each(|words| warn(py, words))
    }

    fn work(&self) -> PyResult<MutexGuard<'_, Work>> {
        self.work
            .lock()
            .map_err(|_| failed("the pipeline failed at an earlier frame; build it anew"))
    }
}

impl Work {
    fn step(&mut self, data: Data) -> PyResult<(FrameReport, Arc<Camera>)> {
        let mut moment = self.maker.at(data.stamp).images(data.images);
        if let Some(camera) = data.camera {
            moment = moment.camera(camera.0);
        }
        if let Some(index) = data.index {
            moment = moment.index(index);
        }
        if let Some(pose) = data.pose {
            moment = moment.pose(pose);
        }
        if let Some(scan) = data.scan {
            moment = moment.laser(scan);
        }
        if let Some(age_s) = data.odometry_age_s {
            moment = moment.odometry_age_s(age_s);
        }
        if self.is_new {
            let checked = self.pipeline.check_sources(moment.sources());
            checked.map_err(|why| ConfigError::new_err(why.to_string()))?;
        }
        let frame = moment.frame().map_err(wrong)?;
        let boxes = data.detections.iter().flatten().any(|found| found.region.is_some());
        if boxes && frame.camera.is_blind() {
            return Err(wrong("detections are boxes in the image: give its camera"));
        }
        self.is_told |= data.detections.is_some();
        if !self.is_told && self.pipeline.inputs().requires(Input::Detections) {
            return Err(wrong(
                "the pipeline tracks the people of another detector, and no frame had any: give \
                 detections=[(x, y, width, height, score), ...], and [] where there is nobody",
            ));
        }
        let frame = frame.with_recorded(data.detections);
        let report = self.pipeline.step(&frame).map_err(told)?;
        self.is_new = false;
        Ok((report, frame.camera))
    }
}

/// Returns the exception for a frame that failed: a frame that is rejected alone is an invalid
/// argument.
fn told(error: StepError) -> PyErr {
    match error {
        StepError::Lacks { .. } => wrong(error),
        _ => failed(error),
    }
}

/// Warns the caller of `step`.
fn warn(py: Python<'_>, words: &str) -> PyResult<()> {
    let words = CString::new(words).map_err(failed)?;
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &words, 1)
}

/// Returns the config for a path, a name or a text.
fn config(source: &Bound<'_, PyAny>, folder: Option<&Path>) -> PyResult<ConfigSource> {
    if let Ok(text) = source.cast::<PyString>() {
        let text = text.to_string();
        // The name of a config contains neither.
        if text.contains(['\n', '=']) {
            let source = ConfigSource::from_text(text, folder.unwrap_or(Path::new("")));
            return Ok(source.with_name("<text>"));
        }
    }
    ConfigSource::open(source.extract::<PathBuf>()?).map_err(raised)
}

fn right_image(array: &Bound<'_, PyAny>, baseline_m: Option<f64>) -> PyResult<RightImage> {
    let image = arrays::grey(array, "right")?;
    match baseline_m.filter(|baseline| *baseline > 0.0 && baseline.is_finite()) {
        Some(baseline_m) => Ok(RightImage { image, baseline_m }),
        None => Err(wrong("right needs baseline_m=, the distance of the cameras, above 0")),
    }
}
