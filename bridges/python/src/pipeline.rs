//! Pipelines.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};

use nalgebra::Isometry2;
use pyo3::prelude::*;
use pyo3::types::PyString;
use tagalong_app::config_file::ConfigFile;
use tagalong_config::Registry;
use tagalong_core::{EgoMotion, Frame, Images, LaserScan, RightImage, Stamp, TrackId};
use tagalong_geometry::Camera;
use tagalong_log::odometry::{PoseBuffer, unknown_motion};
use tagalong_pipeline::{Choice, Enrollment, FrameReport, Pipeline, Sources};

use crate::arrays;
use crate::camera::{PyCamera, blind};
use crate::errors::{ConfigError, failed, raised, wrong};
use crate::frames::{PyFrame, PyFrames};
use crate::report::{PyCommand, PyReport, stamp};

/// A pipeline: detectors, verifiers, association, filter, and a controller where the config has one.
#[pyclass(name = "Pipeline", module = "tagalong", frozen)]
pub struct PyPipeline {
    config: ConfigFile,
    work: Mutex<Work>,
}

/// Pipeline with the motion of the robot so far.
struct Work {
    pipeline: Pipeline,
    poses: PoseBuffer,
    /// Stamp and pose of the last processed frame.
    previous: Option<(Stamp, Isometry2<f64>)>,
    /// Standard deviation of odometry as a fraction of the travel.
    odometry_sigma: f64,
    frames: u64,
}

/// Data of one moment.
struct Moment {
    index: Option<u64>,
    stamp: Stamp,
    camera: Arc<Camera>,
    pose: Option<Isometry2<f64>>,
    images: Images,
    scan: Option<LaserScan>,
    odometry_age_s: f64,
}

#[pymethods]
impl PyPipeline {
    /// Builds a pipeline.
    ///
    /// source: the path of a TOML file, the name of a built-in config ("depth-verified"), or the
    /// text of a config itself: a str with a line break or a `=`. folder: base of relative paths in
    /// a text. seed: instead of the config's.
    ///
    /// Raises ConfigError with line and remedy.
    #[staticmethod]
    #[pyo3(signature = (source, *, folder=None, seed=None))]
    fn from_toml(
        py: Python<'_>,
        source: &Bound<'_, PyAny>,
        folder: Option<PathBuf>,
        seed: Option<u64>,
    ) -> PyResult<Self> {
        let config = config(source, folder.as_deref())?;
        let built = py.detach(|| config.pipeline(&registry(), seed).map(|(pipeline, _)| pipeline));
        let pipeline = built.map_err(raised)?;
        let odometry_sigma = config.outer().map_err(raised)?.input.odometry_sigma;
        let (poses, previous, frames) = (PoseBuffer::default(), None, 0);
        let work = Mutex::new(Work { pipeline, poses, previous, odometry_sigma, frames });
        Ok(Self { config, work })
    }

    /// Takes one frame through the pipeline and returns a Report.
    ///
    /// colour: uint8, rows x columns x 3 (red, green, blue) or rows x columns. depth: float32 in
    /// metres or uint16 in millimetres, registered to colour. camera: a Camera, of the size of the
    /// images. pose: of the robot in the odometry frame, (x, y, heading) or 4 x 4; None without
    /// odometry. stamp: capture time, ns as an int or seconds as a float. scan: float64, rows of
    /// x, y or x, y, z of a laser scan in the robot frame. scan_stamp: time of the scan, as stamp, where
    /// the scanner is slower than the images and its last scan is given again [default: stamp]. right, baseline_m: the right image of a
    /// rectified stereo pair. index: number of the frame [default: frames so far]. odometry_age_s: age of
    /// the reading of odometry from which the pose is, at the time of the stamp; a robot is not
    /// steered by an old one [default: 0, and infinite without a pose].
    #[pyo3(signature = (colour, depth, camera, pose, stamp, *, scan=None, scan_stamp=None, right=None,
        baseline_m=None, index=None, odometry_age_s=None))]
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
    ) -> PyResult<PyReport> {
        let mut images = Images::default();
        colour.map(|array| arrays::add_colour(&mut images, array)).transpose()?;
        images.depth = depth.map(arrays::depth).transpose()?.map(Arc::new);
        images.right = right.map(|array| right_image(array, baseline_m)).transpose()?.map(Arc::new);
        let camera = fitting(camera, &images)?;
        let scan = scan.map(arrays::points).transpose()?.map(LaserScan::of_points);
        let scan_stamp = scan_stamp.map(self::stamp).transpose()?;
        let scan = match (scan, scan_stamp) {
            (Some(scan), Some(stamp)) => Some(scan.with_stamp(stamp)),
            (scan, _) => scan,
        };
        let pose = pose.map(arrays::pose).transpose()?;
        let stamp = self::stamp(stamp)?;
        let odometry_age_s = age_of(pose.is_some(), odometry_age_s)?;
        let camera_of = Arc::clone(&camera);
        let moment = Moment { index, stamp, camera: camera_of, pose, images, scan, odometry_age_s };
        let report = py.detach(|| self.work()?.step(moment))?;
        PyReport::new(py, report, &camera)
    }

    /// Takes a frame of `frames` through the pipeline, as the program does.
    fn step_frame(&self, py: Python<'_>, frame: &PyFrame) -> PyResult<PyReport> {
        let frame = &frame.0;
        let report = py.detach(|| {
            let mut work = self.work()?;
            if frame.odom_jumped {
                work.pipeline.disarm("odometry jumped");
            }
            work.pipeline.step(&frame.frame).map_err(failed)
        })?;
        PyReport::new(py, report, &frame.frame.camera)
    }

    /// Opens a log (.mcap, .db3, .bag, or the folder of a recording) for this pipeline, with the
    /// `[input]` of its config, and returns its frames.
    fn frames(&self, py: Python<'_>, log: PathBuf) -> PyResult<PyFrames> {
        let (inputs, outer) = {
            let work = self.work()?;
            let outer = self.config.outer_for(&work.pipeline).map_err(raised)?;
            (work.pipeline.inputs(), outer)
        };
        PyFrames::open(py, &log, &self.config, &outer, inputs)
    }

    /// The command in force at a time (as `stamp` of `step`): the last one until it expires, zero
    /// after that; None without a controller.
    fn command_at(&self, stamp: &Bound<'_, PyAny>) -> PyResult<Option<PyCommand>> {
        let now = self::stamp(stamp)?;
        Ok(self.work()?.pipeline.command_at(now).map(PyCommand))
    }

    /// Follows the person of this track; `ValueError` without a controller, or without such a track in
    /// the last frame.
    fn choose_target(&self, track: u32) -> PyResult<()> {
        let person = Enrollment::of(Choice::Track(TrackId(track)));
        self.work()?.pipeline.enroll(&person).map_err(wrong)
    }

    /// Stops the robot until `arm`.
    fn disarm(&self) -> PyResult<()> {
        self.work()?.pipeline.disarm("stopped by the program");
        Ok(())
    }

    /// Tells whether the base executes the commands from now on. Only then are they compared with the
    /// odometry: a base that does something else, or responds too late, is a fault.
    fn set_driving(&self, is_driving: bool) -> PyResult<()> {
        self.work()?.pipeline.set_driving(is_driving);
        Ok(())
    }

    /// Lets the robot move again after a fault that a person has checked.
    fn arm(&self) -> PyResult<()> {
        self.work()?.pipeline.arm();
        Ok(())
    }

    /// The fault that holds the robot until `arm`; None without one.
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
        Ok(self.work()?.pipeline.resolved())
    }
}

impl PyPipeline {
    fn work(&self) -> PyResult<MutexGuard<'_, Work>> {
        self.work
            .lock()
            .map_err(|_| failed("the pipeline failed at an earlier frame; build it anew"))
    }
}

impl Work {
    fn step(&mut self, moment: Moment) -> PyResult<FrameReport> {
        if self.frames == 0 {
            self.pipeline
                .check_sources(moment.sources())
                .map_err(|why| ConfigError::new_err(why.to_string()))?;
        }
        let stamp = moment.stamp;
        let here = moment.pose.unwrap_or_else(Isometry2::identity);
        let motion = self.motion(stamp, here, moment.pose.is_some());
        self.frames += 1;
        let report = self.pipeline.step(&moment.frame(motion, self.frames)).map_err(failed)?;
        if report.outcome.is_processed() {
            self.previous = Some((stamp, here));
        }
        Ok(report)
    }

    /// Returns the motion since the last frame, as the log reader computes it. A jump of the
    /// odometry stops the robot.
    fn motion(&mut self, stamp: Stamp, here: Isometry2<f64>, is_known: bool) -> EgoMotion {
        if is_known {
            self.poses.push(stamp, here);
        }
        let Some((then, before)) = self.previous.filter(|(then, _)| *then < stamp) else {
            return EgoMotion::at_rest(0.0);
        };
        let dt = stamp.seconds_since(then);
        if self.poses.jumped_between(then, stamp) {
            self.pipeline.disarm("odometry jumped");
            return unknown_motion(dt);
        }
        EgoMotion::between(&before, &here, dt, self.odometry_sigma)
    }
}

impl Moment {
    fn sources(&self) -> Sources {
        Sources {
            depth: self.images.depth.is_some(),
            right: self.images.right.is_some(),
            laser: self.scan.is_some(),
            odometry: self.pose.is_some(),
        }
    }

    fn frame(self, motion: EgoMotion, count: u64) -> Frame {
        let index = self.index.unwrap_or(count);
        Frame::new(index, self.stamp, self.camera, motion, self.images)
            .with_laser(self.scan)
            .with_odometry_age(self.odometry_age_s)
    }
}

/// Returns the age of odometry, s: as given, else 0 with a pose and infinite without.
fn age_of(is_known: bool, given: Option<f64>) -> PyResult<f64> {
    match (is_known, given) {
        (true, None) => Ok(0.0),
        // Positive comparison, so that NaN is refused.
        (true, Some(age_s)) if age_s >= 0.0 => Ok(age_s),
        (true, Some(age_s)) => {
            Err(wrong(format!("odometry_age_s is {age_s}; it has to be 0 or more")))
        }
        (false, _) => Ok(f64::INFINITY),
    }
}

/// Returns the plugins of this workspace.
pub fn registry() -> Registry {
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    registry
}

/// Returns the config that a path, a name or a text stands for.
fn config(source: &Bound<'_, PyAny>, folder: Option<&Path>) -> PyResult<ConfigFile> {
    if let Ok(text) = source.cast::<PyString>() {
        let text = text.to_string();
        // No name of a config has either.
        if text.contains(['\n', '=']) {
            return Ok(ConfigFile::of_text(text, folder.unwrap_or(Path::new(""))));
        }
    }
    ConfigFile::read(&source.extract::<PathBuf>()?).map_err(raised)
}

fn right_image(array: &Bound<'_, PyAny>, baseline_m: Option<f64>) -> PyResult<RightImage> {
    let image = arrays::grey(array, "right")?;
    match baseline_m.filter(|baseline| *baseline > 0.0 && baseline.is_finite()) {
        Some(baseline_m) => Ok(RightImage { image, baseline_m }),
        None => Err(wrong("right needs baseline_m=, the distance of the cameras, above 0")),
    }
}

/// Returns the camera of the images, which have its size; a placeholder without images.
fn fitting(camera: Option<PyCamera>, images: &Images) -> PyResult<Arc<Camera>> {
    let sizes = [
        ("colour", images.colour.as_ref().map(|image| (image.width(), image.height()))),
        ("colour", images.grey.as_ref().map(|image| (image.width(), image.height()))),
        ("depth", images.depth.as_ref().map(|image| (image.width(), image.height()))),
        ("right", images.right.as_ref().map(|right| (right.image.width(), right.image.height()))),
    ];
    let mut given = sizes.into_iter().filter_map(|(name, size)| Some((name, size?)));
    let Some(camera) = camera.map(|camera| camera.0) else {
        return match given.next() {
            None => Ok(blind()),
            Some(_) => Err(wrong("camera is None, and there are images: give their Camera")),
        };
    };
    let wanted = (camera.width, camera.height);
    match given.find(|(_, size)| *size != wanted) {
        None => Ok(camera),
        Some((name, (width, height))) => Err(wrong(format!(
            "{name} has {width} x {height} pixels and the camera {} x {}; register depth to colour, \
             or give the camera of these images",
            wanted.0, wanted.1
        ))),
    }
}
