//! Frame of a run as the page needs it, read from a file or converted from the report of a
//! pipeline.

use nalgebra::Isometry2;
use serde::Deserialize;
use tagalong_app::frame_notes::FrameNotes;
use tagalong_app::missed::{SightedTrack, TrackStage};
use tagalong_core::Track;
use tagalong_geometry::Camera;
use tagalong_pipeline::FrameReport;

/// Frame of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moment {
    /// Candidates, funnel and pose.
    pub notes: FrameNotes,
    /// All tracks.
    pub tracks: Vec<TrackState>,
    /// Track of the person to follow.
    pub target: Option<u32>,
}

/// Track in one frame.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct TrackState {
    /// Number of the track.
    pub id: u32,
    /// True once the track is confirmed.
    pub confirmed: bool,
    /// True if there is evidence for it in this frame.
    pub seen: bool,
    /// True if a nearer tracked person hides it.
    pub occluded: bool,
    /// Time since the last evidence for it, s.
    pub unseen_s: f64,
    /// Probability that it is a person.
    pub probability: f64,
    /// Centre of the head in the robot frame, m.
    pub head_robot_m: [f64; 3],
    /// Centre of the head in the odometry frame, m.
    pub head_odom_m: [f64; 3],
    /// True if the distance from the robot is a guess.
    #[serde(default)]
    pub distance_is_guessed: bool,
    /// Velocity along the axes of the robot frame, m/s.
    pub velocity_robot_mps: [f64; 2],
    /// Upper-body square, pixels.
    pub upper_body_px: [f64; 4],
}

impl Moment {
    /// Converts the report of a pipeline.
    pub fn of(report: &FrameReport, camera: &Camera, odom_from_robot: &Isometry2<f64>) -> Self {
        Self {
            notes: FrameNotes::of(report, camera, odom_from_robot),
            tracks: report.tracks.iter().map(|t| TrackState::of(t, odom_from_robot)).collect(),
            target: report.target.map(|id| id.0),
        }
    }
}

impl TrackState {
    /// Returns the track in the form for the search for the cause of a miss.
    pub fn sighted(&self) -> SightedTrack {
        SightedTrack {
            id: self.id,
            stage: TrackStage::of(self.confirmed, self.seen),
            box_px: self.upper_body_px.map(|v| v as f32),
            floor_m: [self.head_odom_m[0] as f32, self.head_odom_m[1] as f32],
        }
    }

    fn of(track: &Track, odom_from_robot: &Isometry2<f64>) -> Self {
        let person = &track.estimate.person;
        let head = person.position;
        let region = track.estimate.region;
        let floor = odom_from_robot * head.xy();
        Self {
            id: track.id.0,
            confirmed: track.confirmed,
            seen: track.seen,
            occluded: track.occluded,
            unseen_s: track.unseen_s,
            probability: 1.0 / (1.0 + (-track.score).exp()),
            head_robot_m: head.coords.into(),
            head_odom_m: [floor.x, floor.y, head.z],
            distance_is_guessed: track.estimate.is_distance_guessed(),
            velocity_robot_mps: person.velocity.into(),
            upper_body_px: [region.x, region.y, region.width, region.height],
        }
    }
}
