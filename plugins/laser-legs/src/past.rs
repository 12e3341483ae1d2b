//! Scans of the last seconds: whether a position was free or occupied.

use std::collections::VecDeque;

use nalgebra::{Isometry2, Point2, Vector2};
use tagalong_core::EgoMotion;

use crate::Beams;

/// Past scans older than this say nothing about a place, s.
const OLDEST_S: f64 = 2.0;
/// Past scans younger than this show the person at the same place still, s.
const YOUNGEST_S: f64 = 0.35;
/// Most scans that are kept.
const KEPT: usize = 64;
/// A reflection so near to a place occupied it, m.
const NEAR_M: f64 = 0.25;
/// Fewest scans that must have seen a place.
const FEWEST: f64 = 2.0;

/// Past scan with the pose of its scanner.
struct PastScan {
    age_s: f64,
    /// Pose of the axes at the scanner in the present robot frame.
    now_from_then: Isometry2<f64>,
    /// Directions and ranges of the reflections, by direction, rad and m.
    bearings: Vec<(f64, f64)>,
    step_rad: f64,
}

/// Scans of the last seconds.
#[derive(Default)]
pub(crate) struct PastScans {
    scans: VecDeque<PastScan>,
}

impl PastScans {
    /// Moves all scans into the robot's new frame.
    pub(crate) fn predict(&mut self, motion: &EgoMotion) {
        for scan in &mut self.scans {
            let at = Point2::from(scan.now_from_then.translation.vector);
            let ahead = scan.now_from_then * Point2::new(1.0, 0.0);
            let at = motion.apply_to_point(at);
            let ahead = motion.apply_to_point(ahead);
            // The heading from two points, because the motion maps points.
            let ahead = ahead - at;
            scan.now_from_then = Isometry2::new(at.coords, ahead.y.atan2(ahead.x));
            scan.age_s += motion.dt;
        }
        self.scans.retain(|scan| scan.age_s <= OLDEST_S);
    }

    /// Adds the present scan; `scanner` is the place of the scanner in the robot frame.
    pub(crate) fn add(&mut self, beams: &Beams, scanner: Vector2<f64>) {
        let both = beams
            .points
            .iter()
            .map(|point| point.y.atan2(point.x))
            .zip(beams.ranges.iter().copied());
        let mut bearings: Vec<(f64, f64)> = both.collect();
        // Sorted once, so that each question is a binary search.
        bearings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let now_from_then = Isometry2::new(scanner, 0.0);
        let step_rad = beams.step_rad;
        self.scans.push_back(PastScan { age_s: 0.0, now_from_then, bearings, step_rad });
        // A scanner of 40 Hz would keep more than the memory needs.
        if self.scans.len() > KEPT {
            self.scans.pop_front();
        }
    }

    /// Returns in how far a place in the robot frame was free, 1, or occupied, -1, and 0 where that
    /// is not known.
    pub(crate) fn was_free(&self, place: &Point2<f64>) -> f64 {
        let old = self.scans.iter().filter(|scan| scan.age_s >= YOUNGEST_S);
        let mut sum = 0.0;
        let mut count = 0.0;
        for vote in old.filter_map(|scan| scan.was_free(place)) {
            sum += if vote { 1.0 } else { -1.0 };
            count += 1.0;
        }
        if count < FEWEST { 0.0 } else { sum / count }
    }
}

impl PastScan {
    /// Returns whether a place was free; `None` if it was hidden.
    fn was_free(&self, place: &Point2<f64>) -> Option<bool> {
        let then = self.now_from_then.inverse_transform_point(place);
        let range = then.coords.norm();
        let bearing = then.y.atan2(then.x);
        // A thing of the size of a leg may have stood between two rays.
        let half = (NEAR_M / range.max(NEAR_M)).max(1.5 * self.step_rad);
        let first = self.bearings.partition_point(|(other, _)| *other < bearing - half);
        let window =
            self.bearings[first..].iter().take_while(|(other, _)| *other <= bearing + half);
        let mut is_occupied = false;
        let mut nearer = 0.0;
        let mut rays = 0.0;
        for (other, there) in window {
            let across = range * (other - bearing).abs();
            is_occupied |= across.hypot(there - range) < NEAR_M;
            nearer += f64::from(*there < range - NEAR_M);
            rays += 1.0;
        }
        let all = 2.0 * half / self.step_rad.max(1e-6);
        match (is_occupied, nearer > 0.3 * all) {
            (true, _) => Some(false),
            (false, true) => None,
            // Rays without a reflection met nothing there, unless the place was out of view.
            (false, false) => (rays > 0.0 || self.is_in_view(bearing)).then_some(true),
        }
    }

    /// Returns true if a direction lies between the outermost reflections.
    fn is_in_view(&self, bearing: f64) -> bool {
        let ends = self.bearings.first().zip(self.bearings.last());
        ends.is_some_and(|(first, last)| (first.0..=last.0).contains(&bearing))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation2;
    use tagalong_core::LaserScan;

    use super::*;

    fn beams(places: &[[f64; 2]]) -> Beams {
        beams_of(0.01, places)
    }

    /// Beams of a scanner with this angle between its rays, rad.
    fn beams_of(increment_rad: f64, places: &[[f64; 2]]) -> Beams {
        let points: Vec<_> =
            places.iter().map(|at| nalgebra::Point3::new(at[0], at[1], 0.2)).collect();
        let mut scan = LaserScan::of_points(points);
        scan.increment_rad = increment_rad;
        Beams::new(&scan, 1)
    }

    fn motion(forward: f64) -> EgoMotion {
        EgoMotion { forward, ..EgoMotion::at_rest(0.2) }
    }

    /// A thing straight ahead and two walls, while the robot drives towards them.
    #[test]
    fn a_thing_that_stands_still_was_there_before() {
        let mut past = PastScans::default();
        for number in 0..5 {
            let x = 3.0 - 0.1 * f64::from(number);
            past.predict(&motion(0.1));
            past.add(&beams(&[[x, -2.0], [x, 0.0], [x, 2.0]]), Vector2::zeros());
        }
        past.predict(&motion(0.1));
        assert_eq!(past.was_free(&Point2::new(2.5, 0.0)), -1.0);
        assert_eq!(past.was_free(&Point2::new(2.0, 0.8)), 1.0, "nobody was here");
        assert_eq!(past.was_free(&Point2::new(3.3, 0.0)), 1.0, "one thin thing hides little");
    }

    #[test]
    fn what_a_wall_hid_and_what_was_out_of_view_is_not_known() {
        let wall: Vec<[f64; 2]> = (-40..=40).map(|k| [2.0, f64::from(k) * 0.02]).collect();
        let mut past = PastScans::default();
        for _ in 0..5 {
            past.predict(&motion(0.0));
            past.add(&beams(&wall), Vector2::zeros());
        }
        past.predict(&motion(0.0));
        assert_eq!(past.was_free(&Point2::new(3.0, 0.0)), 0.0);
        assert_eq!(past.was_free(&Point2::new(-1.0, 0.0)), 0.0);
        assert_eq!(past.was_free(&Point2::new(1.0, 0.0)), 1.0);
        // After a while nothing is known any more.
        (0..20).for_each(|_| past.predict(&motion(0.0)));
        assert_eq!(past.was_free(&Point2::new(1.0, 0.0)), 0.0);
    }

    /// The robot turns by 0.2 rad before each scan.
    #[test]
    fn past_scans_turn_with_the_robot() {
        /// Returns where three things are after so many turns of the robot.
        fn seen_after(turns: i32) -> [Point2<f64>; 3] {
            let things = [Point2::new(3.0, -2.0), Point2::new(3.0, 0.0), Point2::new(3.0, 2.0)];
            things.map(|at| Rotation2::new(-0.2 * f64::from(turns)) * at)
        }

        let turning = EgoMotion { turn: 0.2, ..EgoMotion::at_rest(0.2) };
        let mut past = PastScans::default();
        for turns in 1..=3 {
            past.predict(&turning);
            past.add(&beams(&seen_after(turns).map(|at| [at.x, at.y])), Vector2::zeros());
        }
        past.predict(&turning);
        past.predict(&turning);
        assert_eq!(past.was_free(&seen_after(5)[1]), -1.0);
    }

    #[test]
    fn the_scans_of_the_last_moment_do_not_count() {
        let mut past = PastScans::default();
        for number in 0..4 {
            let ahead_m = if number < 3 { 3.0 } else { 2.0 };
            past.predict(&motion(0.0));
            past.add(&beams(&[[3.0, -2.0], [ahead_m, 0.0], [3.0, 2.0]]), Vector2::zeros());
        }
        past.predict(&motion(0.0));
        assert_eq!(past.was_free(&Point2::new(2.0, 0.0)), 1.0, "it came 0.2 s ago");
    }

    /// A wall that few rays meet hides also what is between two of them.
    #[test]
    fn a_coarse_scanner_does_not_see_through_a_wall() {
        let wall: Vec<[f64; 2]> = (-4..=4)
            .map(|ray| 0.15 * f64::from(ray))
            .map(|angle: f64| [2.0 * angle.cos(), 2.0 * angle.sin()])
            .collect();
        let mut past = PastScans::default();
        for _ in 0..4 {
            past.predict(&motion(0.0));
            past.add(&beams_of(0.15, &wall), Vector2::zeros());
        }
        past.predict(&motion(0.0));
        let between = Rotation2::new(0.075) * Point2::new(3.9, 0.0);
        assert_eq!(past.was_free(&between), 0.0);
    }

    #[test]
    fn the_last_scans_are_kept() {
        let mut past = PastScans::default();
        for number in 1..=KEPT + 3 {
            past.add(&beams(&[[3.0, 0.0]]), Vector2::new(number as f64, 0.0));
            assert_eq!(past.scans.len(), number.min(KEPT));
        }
        let first = past.scans.front().map(|scan| scan.now_from_then.translation.x);
        assert_eq!(first, Some(4.0), "the oldest is left out");
    }
}
