use std::sync::Arc;

use nalgebra::{Isometry2, Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use tagalong_core::{Joints, Stamp, Track, TrackId, WheelSpeeds, settings};
use tagalong_geometry::{Camera, Rect};

settings! {
    /// Settings of the output, `[output]` of a config.
    #[non_exhaustive]
    pub struct OutputSettings {
        /// Time for which confirmed tracks are still written to `tracks.csv` while they are not
        /// seen, s. With 0 a track is written only in frames in which the person was seen.
        #[schemars(range(min = 0.0))]
        pub report_unseen_s: f64 = 0.0,
        /// Part of a person that boxes in `tracks.csv` and in the images of `tracks.mcap` enclose:
        /// `upper`, head and shoulders, as they are tracked; `full`, the whole person, with the
        /// feet on the floor below the head.
        pub boxes: BoxedPart = BoxedPart::Upper,
    }
}

/// Part of a person that reported boxes enclose.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum BoxedPart {
    /// Head and shoulders, or the whole person if that is the tracked box.
    #[default]
    Upper,
    /// The whole person.
    Full,
}

/// Data of one frame for the files of a run.
#[derive(Clone, Copy)]
pub struct FrameRecord<'a> {
    /// 1-based index of the frame in the log.
    pub index: u64,
    /// Time of capture of the image.
    pub stamp: Stamp,
    /// Camera, for the size of the image.
    pub camera: &'a Camera,
    /// Pose of the robot in the odometry frame.
    pub odom_from_robot: &'a Isometry2<f64>,
    /// False if there is odometry but it cannot be used, so that no position in its frame is known.
    pub is_odom_known: bool,
    /// All tracks, confirmed or not.
    pub tracks: &'a [Track],
    /// Joints of tracks in the image, if a detector found them.
    pub joints: &'a [(TrackId, Arc<Joints>)],
    /// Track of the followed person.
    pub target: Option<TrackId>,
    /// Commanded wheel speeds, if there is a controller.
    pub command: Option<WheelSpeeds>,
}

impl FrameRecord<'_> {
    /// Returns the joints of a track in the image, if a detector found them.
    pub(super) fn joints_of(&self, track: &Track) -> Option<&Joints> {
        let found = self.joints.iter().find(|(id, _)| *id == track.id);
        found.map(|(_, joints)| joints.as_ref())
    }

    /// Returns the heading of the body of a track, rad in the robot frame, if its joints show it.
    pub(super) fn body_direction_rad(&self, track: &Track) -> Option<f64> {
        let at = track.estimate.person.position;
        self.joints_of(track)?.body_direction_rad(at.y.atan2(at.x))
    }

    /// Returns the confirmed tracks, seen or not.
    pub(super) fn confirmed(&self) -> impl Iterator<Item = &Track> {
        self.tracks.iter().filter(|track| track.confirmed)
    }

    /// Returns the robot's pose in the odometry frame, with the floor as Z = 0.
    pub(super) fn odom_from_robot(&self) -> Isometry3<f64> {
        let at = self.odom_from_robot.translation;
        let turn = UnitQuaternion::from_axis_angle(
            &Vector3::z_axis(),
            self.odom_from_robot.rotation.angle(),
        );
        Isometry3::from_parts(Translation3::new(at.x, at.y, 0.0), turn)
    }

    /// Returns the head of a track in the odometry frame, m.
    pub(super) fn head_in_odom(&self, track: &Track) -> Point3<f64> {
        self.odom_from_robot() * track.estimate.person.position
    }

    /// Returns the box of a part of a track's person, clipped to the image; `None` if it lies
    /// outside.
    pub(super) fn visible_region(&self, track: &Track, part: BoxedPart) -> Option<Rect> {
        let region = match part {
            BoxedPart::Upper => track.estimate.region,
            BoxedPart::Full => {
                self.camera.whole_body(&track.estimate.region, &track.estimate.person.position)
            }
        };
        let clipped = region.clipped(self.camera.width, self.camera.height);
        (clipped.area() > 0.0).then_some(clipped)
    }
}

/// Converts log-odds to a probability.
pub(super) fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}
