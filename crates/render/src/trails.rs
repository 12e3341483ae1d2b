//! Trails in pictures. Their length is that of [`tagalong_log::write::Trails`].

use nalgebra::Point3;
use tagalong_core::{Stamp, TrackId};
use tagalong_log::write;

use super::data::OverlayData;

/// Trails of the people in the pictures, with the time of the first picture.
#[derive(Default)]
pub struct Trails {
    trails: write::Trails,
    first: Option<Stamp>,
}

impl Trails {
    /// Adds the present positions and removes tracks that have ended.
    pub fn follow(&mut self, scene: &OverlayData) {
        let now = scene.report.stamp;
        self.first.get_or_insert(now);
        self.trails.follow(now, &scene.report.tracks, &scene.odom_from_robot);
    }

    /// Returns the time since the first frame, s.
    pub fn elapsed_s(&self, now: Stamp) -> f64 {
        self.first.map_or(0.0, |first| now.seconds_since(first))
    }

    /// Returns the trails of the tracks that are seen in the present frame, in the robot frame, in
    /// pieces without gaps; none in a frozen image.
    pub fn in_robot(&self, scene: &OverlayData) -> Vec<(TrackId, Vec<Point3<f64>>)> {
        let mut pieces = Vec::new();
        if scene.shows_past() {
            return pieces;
        }
        for track in scene.report.tracks.iter().filter(|track| track.seen) {
            for mut piece in self.trails.pieces(track.id) {
                for place in &mut piece {
                    let floor = scene.odom_from_robot.inverse_transform_point(&place.xy());
                    *place = Point3::new(floor.x, floor.y, place.z);
                }
                pieces.push((track.id, piece));
            }
        }
        pieces
    }
}
