use nalgebra::{Isometry2, Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use tagalong_core::{Camera, Rect, Stamp, Track, TrackId, WheelSpeeds};

/// `[output]` of a config: what is written of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OutputSettings {
    /// Confirmed tracks stay in `tracks.csv` until they were unseen for this
    /// long, s. 0 writes a track only in frames where the person was seen.
    #[schemars(range(min = 0.0))]
    pub report_unseen_s: f64,
}

impl Default for OutputSettings {
    fn default() -> Self {
        Self { report_unseen_s: 0.0 }
    }
}

/// What the files of a run say about one frame.
#[derive(Clone, Copy)]
pub struct FrameRecord<'a> {
    /// 1-based index of the colour image in the log.
    pub index: u64,
    /// When the image was captured.
    pub stamp: Stamp,
    /// The camera, for the size of the image.
    pub camera: &'a Camera,
    /// Pose of the robot in the odometry frame.
    pub odom_from_robot: &'a Isometry2<f64>,
    /// All tracks, confirmed or not.
    pub tracks: &'a [Track],
    /// The person that is followed.
    pub target: Option<TrackId>,
    /// The commanded wheel speeds, if there is a controller.
    pub command: Option<WheelSpeeds>,
}

impl FrameRecord<'_> {
    /// Confirmed tracks, seen or not.
    pub(super) fn confirmed(&self) -> impl Iterator<Item = &Track> {
        self.tracks.iter().filter(|track| track.confirmed)
    }

    /// The robot's pose in the odometry frame, with the floor as Z = 0.
    pub(super) fn odom_from_robot(&self) -> Isometry3<f64> {
        let at = self.odom_from_robot.translation;
        let turn = UnitQuaternion::from_axis_angle(
            &Vector3::z_axis(),
            self.odom_from_robot.rotation.angle(),
        );
        Isometry3::from_parts(Translation3::new(at.x, at.y, 0.0), turn)
    }

    /// The head of a track in the odometry frame, m.
    pub(super) fn head_in_odom(&self, track: &Track) -> Point3<f64> {
        self.odom_from_robot() * track.estimate.person.position
    }

    /// The upper-body box of a track inside the image; `None` if nothing of it
    /// is there.
    pub(super) fn visible_region(&self, track: &Track) -> Option<Rect> {
        let clipped = track.estimate.region.clipped(self.camera.width, self.camera.height);
        (clipped.area() > 0.0).then_some(clipped)
    }
}

/// Log-odds as a probability.
pub(super) fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}
