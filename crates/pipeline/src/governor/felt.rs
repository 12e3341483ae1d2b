use nalgebra::{Point2, Point3};
use tagalong_core::Motion;

use super::CorridorSettings;

/// What is this near to where something was is the same thing, m.
const SAME_M: f64 = 0.1;

/// What a laser scanner meets around the robot, and since when. It needs no memory of
/// what it does not meet any more: it looks to the sides and down to the robot itself.
#[derive(Default)]
pub(super) struct Felt {
    points: Vec<Point>,
}

/// Where a ray ended, robot frame, m.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    at: Point2<f64>,
    /// Where it ended at first: who walks slowly is soon away from there.
    first: Point2<f64>,
    /// How long ago that was, s.
    stood_s: f64,
}

impl Felt {
    /// The next scan; the robot moved by `motion` since the one before. Only what can
    /// be in the way is kept.
    pub(super) fn next(
        &self,
        settings: &CorridorSettings,
        scan: &[Point3<f64>],
        motion: &Motion,
    ) -> Self {
        let heights = settings.floor_m..settings.top_m;
        let reach_m = settings.range_m + settings.front_m;
        let met = scan.iter().filter(|point| heights.contains(&point.z));
        let near = met.map(Point3::xy).filter(|at| at.coords.norm() < reach_m);
        let before: Vec<Point> = self.points.iter().map(|point| point.after(motion)).collect();
        Self { points: near.map(|at| Point::again(at, &before)).collect() }
    }

    /// Where the rays end, robot frame, m, and for how long something has been there, s.
    pub(super) fn points(&self) -> impl Iterator<Item = (Point2<f64>, f64)> {
        self.points.iter().map(|point| (point.at, point.stood_s))
    }
}

impl Point {
    fn after(&self, motion: &Motion) -> Self {
        let first = motion.apply_to_point(self.first);
        Self { first, stood_s: self.stood_s + motion.dt, ..*self }
    }

    /// What was there before, if something was; else something new.
    fn again(at: Point2<f64>, before: &[Self]) -> Self {
        let same = before.iter().filter(|point| nalgebra::distance(&point.first, &at) < SAME_M);
        let oldest = same.max_by(|a, b| a.stood_s.total_cmp(&b.stood_s));
        oldest.map_or(Self { at, first: at, stood_s: 0.0 }, |oldest| Self { at, ..*oldest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How long the only point of each scan has stood at the last one, while the robot
    /// drives at 0.5 m/s and the point moves at so many m/s across the way.
    fn stood_s(aside_mps: f64, scans: u32) -> f64 {
        let motion = Motion { forward: 0.05, ..Motion::at_rest(0.1) };
        let felt = (0..scans).fold(Felt::default(), |felt, scan| {
            let t = 0.1 * f64::from(scan);
            let at = Point3::new(2.0 - 0.5 * t, 1.0 - aside_mps * t, 0.2);
            felt.next(&CorridorSettings::default(), &[at], &motion)
        });
        felt.points[0].stood_s
    }

    #[test]
    fn what_stands_is_told_from_what_walks_by_a_robot_that_drives() {
        assert!((stood_s(0.0, 11) - 1.0).abs() < 1e-9);
        assert_eq!(stood_s(1.2, 11), 0.0);
        assert!(stood_s(0.3, 11) < 0.5, "slowly");
    }

    #[test]
    fn what_cannot_be_in_the_way_is_left_out() {
        let settings = CorridorSettings::default();
        let points = [[1.0, 0.0, 0.02], [1.0, 0.0, 1.9], [9.0, 0.0, 0.2], [1.0, 0.0, 0.2]];
        let felt =
            Felt::default().next(&settings, &points.map(Point3::from), &Motion::at_rest(0.1));
        assert_eq!(felt.points().collect::<Vec<_>>(), [(Point2::new(1.0, 0.0), 0.0)]);
    }
}
