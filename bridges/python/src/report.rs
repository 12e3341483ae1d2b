//! Results of a frame.

use std::collections::BTreeMap;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, ToPyArray as _};
use pyo3::prelude::*;
use tagalong::core::{Command, Joints, Stamp, Track, TrackId};
use tagalong::geometry::Camera;
use tagalong::pipeline::{FrameReport, Outcome};

/// A tracked person in one frame. Lengths are metres in the robot's frame: x forward, y left, z up.
#[pyclass(name = "Track", module = "tagalong", frozen)]
pub struct PyTrack {
    track: Track,
    image_box: Option<(f64, f64, f64, f64)>,
    joints: Option<Arc<Joints>>,
}

impl PyTrack {
    fn of(track: &Track, camera: &Camera, joints: &[(TrackId, Arc<Joints>)]) -> Self {
        let seen = track.estimate.region.clipped(camera.width, camera.height);
        let image_box = (seen.area() > 0.0).then_some((seen.x, seen.y, seen.width, seen.height));
        let joints = joints.iter().find(|(id, _)| *id == track.id);
        let joints = joints.map(|(_, joints)| Arc::clone(joints));
        Self { track: track.clone(), image_box, joints }
    }
}

#[pymethods]
impl PyTrack {
    /// ID of the track, never used twice.
    #[getter]
    fn id(&self) -> u32 {
        self.track.id.0
    }

    /// Centre of the head, (x, y, z), m.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.track.estimate.person.position.coords.as_slice().to_pyarray(py)
    }

    /// Velocity over ground in robot axes, (vx, vy), m/s.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.track.estimate.person.velocity.as_slice().to_pyarray(py)
    }

    /// Covariance of (x, y, z, vx, vy), 5 x 5.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let covariance = &self.track.estimate.covariance;
        let array = numpy::ndarray::Array2::from_shape_fn((5, 5), |at| covariance[at]);
        PyArray2::from_owned_array(py, array)
    }

    /// Upper-body square, clipped to the image: (x, y, width, height), pixels with (0, 0) at the
    /// upper left corner; None outside.
    #[getter]
    fn r#box(&self) -> Option<(f64, f64, f64, f64)> {
        self.image_box
    }

    /// Joints in the image by their names in COCO (`left_wrist`), each (x, y, score), pixels and 0 to 1;
    /// None unless a detector of this frame found them.
    #[getter]
    fn joints(&self) -> Option<BTreeMap<&'static str, (f64, f64, f64)>> {
        let joints = self.joints.as_ref()?.iter();
        Some(
            joints
                .map(|(name, joint)| (name.name(), (joint.at.x, joint.at.y, joint.score)))
                .collect(),
        )
    }

    /// Direction in which the body is turned, rad from the x axis of the robot frame to the left;
    /// None if the joints do not show it.
    #[getter]
    fn body_direction(&self) -> Option<f64> {
        let at = self.track.estimate.person.position;
        self.joints.as_ref()?.body_direction_rad(at.y.atan2(at.x))
    }

    /// True if a hand is held above the head; None without joints.
    #[getter]
    fn raised_hand(&self) -> Option<bool> {
        Some(self.joints.as_ref()?.has_raised_hand())
    }

    /// Probability that this is a person, smoothed over the track; `score` in Rust is its log-odds.
    #[getter]
    fn score(&self) -> f64 {
        1.0 / (1.0 + (-self.track.score).exp())
    }

    /// True if the track has evidence in this frame; otherwise it is predicted, with growing
    /// uncertainty, even outside of the view.
    #[getter]
    fn seen(&self) -> bool {
        self.track.seen
    }

    /// True once the track is reported.
    #[getter]
    fn confirmed(&self) -> bool {
        self.track.confirmed
    }

    /// True if a nearer tracked person hides this one.
    #[getter]
    fn occluded(&self) -> bool {
        self.track.occluded
    }

    /// Number of frames since the track started.
    #[getter]
    fn age(&self) -> u32 {
        self.track.age
    }

    /// Time since the track last had evidence, s.
    #[getter]
    fn unseen_s(&self) -> f64 {
        self.track.unseen_s
    }

    fn __repr__(&self) -> String {
        let at = self.track.estimate.person.position;
        let seen = if self.track.seen { "seen" } else { "predicted" };
        format!("Track(id={}, x={:.2}, y={:.2}, z={:.2}, {seen})", self.track.id, at.x, at.y, at.z)
    }
}

/// A velocity for the robot, with its reason and the time until which it is valid.
#[pyclass(name = "Command", module = "tagalong", frozen)]
pub struct PyCommand(pub Command);

#[pymethods]
impl PyCommand {
    /// Forward speed, m/s.
    #[getter]
    fn linear_mps(&self) -> f64 {
        self.0.twist.linear_mps
    }

    /// Speed to the left, m/s.
    #[getter]
    fn lateral_mps(&self) -> f64 {
        self.0.twist.lateral_mps
    }

    /// Turn rate, rad/s, positive to the left.
    #[getter]
    fn angular_rps(&self) -> f64 {
        self.0.twist.angular_rps
    }

    /// Speeds of the wheels of a differential drive, (left, right), m/s.
    #[getter]
    fn wheels_mps(&self) -> (f64, f64) {
        (self.0.wheels.left, self.0.wheels.right)
    }

    /// Capture time of the frame to which it responds, ns.
    #[getter]
    fn stamp_ns(&self) -> u64 {
        self.0.stamp.nanos()
    }

    /// Time at which the wheels stop unless a newer command has arrived, ns.
    #[getter]
    fn valid_until_ns(&self) -> u64 {
        self.0.valid_until.nanos()
    }

    /// Reason for the speeds: "follow", "obstacle", "no-target" and others.
    #[getter]
    fn reason(&self) -> &'static str {
        self.0.reason.name()
    }

    fn __repr__(&self) -> String {
        let Command { twist, reason, .. } = &self.0;
        format!("Command({:.3} m/s, {:.3} rad/s, {reason})", twist.linear_mps, twist.angular_rps)
    }
}

/// Result of a frame.
#[pyclass(name = "Report", module = "tagalong", frozen)]
pub struct PyReport {
    report: FrameReport,
    tracks: Vec<Py<PyTrack>>,
}

impl PyReport {
    /// Returns the report with its tracks as objects.
    ///
    /// # Errors
    /// If the interpreter has no memory.
    pub fn new(py: Python<'_>, report: FrameReport, camera: &Camera) -> PyResult<Self> {
        let joints = report.joints();
        let each = report.tracks.iter();
        let tracks = each.map(|track| Py::new(py, PyTrack::of(track, camera, &joints)));
        Ok(Self { tracks: tracks.collect::<PyResult<_>>()?, report })
    }

    fn those(&self, py: Python<'_>, confirmed: bool) -> Vec<Py<PyTrack>> {
        let wanted = self.tracks.iter().filter(|track| track.get().track.confirmed == confirmed);
        wanted.map(|track| track.clone_ref(py)).collect()
    }
}

#[pymethods]
impl PyReport {
    /// Index of the frame, from 1.
    #[getter]
    fn index(&self) -> u64 {
        self.report.index
    }

    /// Capture time, ns.
    #[getter]
    fn stamp_ns(&self) -> u64 {
        self.report.stamp.nanos()
    }

    /// "processed", or another outcome because of its stamp: for "duplicate" (the stamp of the
    /// previous frame) and "out-of-order" (slightly older) the frame was left out; for
    /// "reset-backward" and "reset-forward" (the clock was set back, or jumped ahead) all tracks
    /// ended before the frame was processed.
    #[getter]
    fn outcome(&self) -> &'static str {
        outcome(&self.report.outcome).0
    }

    /// The confirmed tracks, nearest first, including predicted ones; see `Track.seen`.
    #[getter]
    fn tracks(&self, py: Python<'_>) -> Vec<Py<PyTrack>> {
        self.those(py, true)
    }

    /// Tracks that are not confirmed yet.
    #[getter]
    fn tentative(&self, py: Python<'_>) -> Vec<Py<PyTrack>> {
        self.those(py, false)
    }

    /// IDs of the tracks that ended in this frame.
    #[getter]
    fn ended(&self) -> Vec<u32> {
        self.report.ended.iter().map(|id| id.0).collect()
    }

    /// Command for the wheels; None without a controller.
    #[getter]
    fn command(&self) -> Option<PyCommand> {
        self.report.command.map(PyCommand)
    }

    /// ID of the track of the person to follow.
    #[getter]
    fn target(&self) -> Option<u32> {
        self.report.target.map(|id| id.0)
    }

    /// Number of candidates that each test dropped.
    #[getter]
    fn dropped(&self) -> BTreeMap<String, u64> {
        let entries = self.report.funnel.entries().iter();
        entries.map(|entry| (entry.test.to_owned(), entry.count)).collect()
    }

    /// Time of each stage, ms.
    #[getter]
    fn timings_ms(&self) -> BTreeMap<&'static str, f64> {
        self.report.timings.iter().copied().collect()
    }

    fn __repr__(&self) -> String {
        let confirmed = self.report.tracks.iter().filter(|track| track.confirmed).count();
        let (name, words) = outcome(&self.report.outcome);
        let odd = if words.is_empty() { String::new() } else { format!(", {name}: {words}") };
        format!("Report(frame {}, {confirmed} tracks{odd})", self.report.index)
    }
}

/// Returns the name of an outcome and, unless the frame was just processed, a description.
fn outcome(outcome: &Outcome) -> (&'static str, &'static str) {
    match outcome {
        Outcome::Duplicate => ("duplicate", "left out, its stamp is that of the frame before"),
        Outcome::OutOfOrder => {
            ("out-of-order", "left out, its stamp is before that of the last frame")
        }
        Outcome::ResetBackward { .. } => {
            ("reset-backward", "the clock was set back, all tracks ended")
        }
        Outcome::ResetForward { .. } => {
            ("reset-forward", "the clock jumped ahead, all tracks ended")
        }
        _ => ("processed", ""),
    }
}

/// Integers from 1 up to this are probably seconds or a count, and not nanoseconds.
const FEW_NS: u64 = 1_000_000;

/// Returns a time: integer nanoseconds, or seconds as a float.
///
/// # Errors
/// `TypeError` for another type, `ValueError` for a time that is negative, not finite, or above
/// zero but within the first millisecond.
pub fn stamp(given: &Bound<'_, PyAny>) -> PyResult<Stamp> {
    if let Ok(nanos) = given.extract::<u64>() {
        if (1..FEW_NS).contains(&nanos) {
            return Err(crate::errors::wrong(format!(
                "stamp is {nanos}: an int is nanoseconds; give seconds as a float"
            )));
        }
        return Ok(Stamp::from_nanos(nanos));
    }
    let seconds: f64 = given.extract()?;
    if (0.0..1e10).contains(&seconds) {
        Ok(Stamp::from_nanos((seconds * 1e9).round() as u64))
    } else {
        Err(crate::errors::wrong(format!(
            "stamp is {seconds} s; give nanoseconds as an int, or seconds, at least 0, as a float"
        )))
    }
}
