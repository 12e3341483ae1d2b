use std::collections::{BTreeMap, VecDeque};

use nalgebra::Point3;
use tagalong_core::{Stamp, TrackId};

use super::data::OverlayData;

/// Time that a trail reaches back, s.
const LENGTH_S: f64 = 2.0;

/// Longest time without a sighting that a line of a trail bridges, s.
const GAP_S: f64 = 0.5;

/// Head of a person that was seen, in the odometry frame.
struct Place {
    at: Stamp,
    head: Point3<f64>,
}

/// Heads of confirmed people in the last seconds, in the odometry frame.
#[derive(Default)]
pub struct Trails {
    places: BTreeMap<TrackId, VecDeque<Place>>,
    first: Option<Stamp>,
}

impl Trails {
    /// Adds the present positions and forgets tracks that ended.
    pub fn follow(&mut self, scene: &OverlayData) {
        let now = scene.report.stamp;
        self.first.get_or_insert(now);
        let tracks = &scene.report.tracks;
        self.places.retain(|id, _| tracks.iter().any(|track| track.id == *id));
        // A predicted position is no place at which the person was.
        for track in tracks.iter().filter(|track| track.confirmed && track.seen) {
            let trail = self.places.entry(track.id).or_default();
            let head = track.estimate.person.position;
            // Kept in the odometry frame, because the robot frame moves under the trail.
            let floor = scene.odom_from_robot * head.xy();
            trail.push_back(Place { at: now, head: Point3::new(floor.x, floor.y, head.z) });
        }
        for trail in self.places.values_mut() {
            trail.retain(|place| (0.0..=LENGTH_S).contains(&now.seconds_since(place.at)));
        }
    }

    /// Returns the time since the first frame, s.
    pub fn elapsed_s(&self, now: Stamp) -> f64 {
        self.first.map_or(0.0, |first| now.seconds_since(first))
    }

    /// Returns the trails of the tracks that are seen now, in the present robot frame, in pieces
    /// without gaps.
    pub fn in_robot(&self, scene: &OverlayData) -> Vec<(TrackId, Vec<Point3<f64>>)> {
        let mut pieces = Vec::new();
        for track in scene.report.tracks.iter().filter(|track| track.seen) {
            let mut piece = Vec::new();
            let mut before = None;
            for place in self.places.get(&track.id).into_iter().flatten() {
                if before.is_some_and(|before| place.at.seconds_since(before) > GAP_S) {
                    pieces.push((track.id, std::mem::take(&mut piece)));
                }
                before = Some(place.at);
                let floor = scene.odom_from_robot.inverse_transform_point(&place.head.xy());
                piece.push(Point3::new(floor.x, floor.y, place.head.z));
            }
            pieces.push((track.id, piece));
        }
        pieces
    }
}
