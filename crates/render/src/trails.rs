use std::collections::{BTreeMap, VecDeque};

use nalgebra::Point3;
use tagalong_core::TrackId;

use super::OverlayData;

/// Points kept of a trail.
const LENGTH: usize = 60;

/// Past head positions of confirmed people, in the odometry frame.
#[derive(Default)]
pub struct Trails {
    places: BTreeMap<TrackId, VecDeque<Point3<f64>>>,
}

impl Trails {
    /// Adds the present positions and forgets tracks that ended.
    pub fn follow(&mut self, scene: &OverlayData) {
        let tracks = &scene.report.tracks;
        self.places.retain(|id, _| tracks.iter().any(|track| track.id == *id));
        for track in tracks.iter().filter(|track| track.confirmed) {
            let trail = self.places.entry(track.id).or_default();
            let head = track.estimate.person.position;
            // Kept in the odometry frame, because the robot frame moves under the trail.
            let floor = scene.odom_from_robot * head.xy();
            trail.push_back(Point3::new(floor.x, floor.y, head.z));
            if trail.len() > LENGTH {
                trail.pop_front();
            }
        }
    }

    /// Returns the trails in the present robot frame.
    pub fn in_robot(&self, scene: &OverlayData) -> Vec<(TrackId, Vec<Point3<f64>>)> {
        let into_robot = |p: &Point3<f64>| {
            let floor = scene.odom_from_robot.inverse_transform_point(&p.xy());
            Point3::new(floor.x, floor.y, p.z)
        };
        self.places
            .iter()
            .map(|(id, trail)| (*id, trail.iter().map(into_robot).collect()))
            .collect()
    }
}
