//! Trails of people in pictures and in `tracks.mcap`: their positions in the last two seconds.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::{Isometry2, Point3};
use tagalong_core::{Stamp, Track, TrackId};

/// Duration that a trail covers, s.
const LENGTH_S: f64 = 2.0;

/// Maximum time without a detection that a line of a trail bridges, s.
const GAP_S: f64 = 0.5;

/// Head of a person that was seen, in the odometry frame.
#[derive(Clone, Copy, Debug)]
struct Place {
    at: Stamp,
    head: Point3<f64>,
}

/// Heads of confirmed people in the last two seconds, in the odometry frame.
#[derive(Clone, Debug, Default)]
pub struct Trails {
    places: BTreeMap<TrackId, VecDeque<Place>>,
}

impl Trails {
    /// Adds the positions of a frame and removes tracks that ended.
    pub fn follow(&mut self, now: Stamp, tracks: &[Track], odom_from_robot: &Isometry2<f64>) {
        self.places.retain(|id, _| tracks.iter().any(|track| track.id == *id));
        // A predicted position is not one where the person really was.
        for track in tracks.iter().filter(|track| track.confirmed && track.seen) {
            let trail = self.places.entry(track.id).or_default();
            let head = track.estimate.person.position;
            // Stored in the odometry frame, because the robot frame moves under the trail.
            let floor = odom_from_robot * head.xy();
            trail.push_back(Place { at: now, head: Point3::new(floor.x, floor.y, head.z) });
        }
        for trail in self.places.values_mut() {
            trail.retain(|place| (0.0..=LENGTH_S).contains(&now.seconds_since(place.at)));
        }
    }

    /// Returns the trail of a track as pieces without gaps; at least one, which may be empty.
    pub fn pieces(&self, id: TrackId) -> Vec<Vec<Point3<f64>>> {
        let mut pieces = Vec::new();
        let mut piece = Vec::new();
        let mut before: Option<Stamp> = None;
        for place in self.places.get(&id).into_iter().flatten() {
            if before.is_some_and(|before| place.at.seconds_since(before) > GAP_S) {
                pieces.push(std::mem::take(&mut piece));
            }
            before = Some(place.at);
            piece.push(place.head);
        }
        pieces.push(piece);
        pieces
    }
}
