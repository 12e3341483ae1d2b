//! People around the robot in the plane, as a scanner with a full field of view could see them.

use nalgebra::{Isometry2, Point2, Vector2};

use super::Simulation;
use crate::behaviour::Walker;

/// Range of sight of a robot without a laser scanner, m.
const REACH_M: f64 = 5.0;
/// Lateral offsets from the middle of a body at which it may be seen, as fractions of its radius.
const ASIDE: [f64; 3] = [0.0, 0.8, -0.8];

/// The robot among people that react to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrowdView {
    /// Pose of the robot in the world, m and rad.
    pub world_from_robot: Isometry2<f64>,
    /// Gap between the robot, taken as a disc around its outline, and the first person, m; `None`
    /// while that person is not in the room.
    pub target_gap_m: Option<f64>,
    /// Gap to the nearest other person, m; infinite without one.
    pub others_gap_m: f64,
    /// True if the first person is within range of the laser scanner and not hidden.
    pub target_in_sight: bool,
    /// True if the first person has reached the end of the path.
    pub target_arrived: bool,
}

impl Simulation {
    /// Returns the state of the robot among people; `None` in a scene whose people do not react.
    pub fn crowd_view(&self) -> Option<CrowdView> {
        if !self.walkers.iter().any(Walker::reacts) {
            return None;
        }
        let robot = Point2::from(self.robot.pose.translation.vector);
        let people: Vec<(u16, Point2<f64>)> =
            self.present().map(|(walker, id)| (id, walker.stance.place)).collect();
        let places: Vec<Point2<f64>> = people.iter().map(|(_, place)| *place).collect();
        let bodies_m = self.circumradius_m() + self.scene.reacting.radius_m;
        let gaps_m: Vec<f64> =
            places.iter().map(|place| (place - robot).norm() - bodies_m).collect();
        let target = people.iter().position(|(id, _)| *id == 1);
        let others = people.iter().zip(&gaps_m).filter(|((id, _), _)| *id != 1);
        Some(CrowdView {
            world_from_robot: self.robot.pose,
            target_gap_m: target.map(|target| gaps_m[target]),
            others_gap_m: others.map(|(_, gap_m)| *gap_m).fold(f64::INFINITY, f64::min),
            target_in_sight: target.is_some_and(|who| self.is_in_sight(&robot, &places, who)),
            target_arrived: self.walkers.first().is_some_and(Walker::has_arrived),
        })
    }

    /// Returns which of the people at these positions in the world can be seen from a point: those
    /// within range of the laser scanner that are not completely hidden by another person, a block
    /// or furniture.
    pub fn in_sight(&self, from: &Point2<f64>, places: &[Point2<f64>]) -> Vec<bool> {
        (0..places.len()).map(|who| self.is_in_sight(from, places, who)).collect()
    }

    /// Returns true if one of the people at these positions can be seen from a point.
    fn is_in_sight(&self, from: &Point2<f64>, places: &[Point2<f64>], who: usize) -> bool {
        let reach_m = self.scene.laser.as_ref().map_or(REACH_M, |laser| laser.max_range_m);
        let radius_m = self.scene.reacting.radius_m;
        let way = places[who] - from;
        let Some(ahead) = way.try_normalize(1e-9) else { return true };
        let side = Vector2::new(-ahead.y, ahead.x) * radius_m;
        let is_near = way.norm() - radius_m <= reach_m;
        is_near
            && ASIDE.iter().any(|part| {
                let to = places[who] + side * *part;
                let bodies = places.iter().enumerate().filter(|(other, _)| *other != who);
                let mut discs = bodies
                    .map(|(_, at)| (*at, radius_m))
                    .chain(self.obstacles.iter().map(|thing| (thing.at, thing.radius_m)));
                !self.blocks.hides(from, &to) && !discs.any(|disc| is_between(disc, from, &to))
            })
    }
}

/// Returns true if a disc intersects the straight line between two points; one around an end does
/// not count.
fn is_between(
    (middle, radius_m): (Point2<f64>, f64),
    from: &Point2<f64>,
    to: &Point2<f64>,
) -> bool {
    let way = to - from;
    let part = (middle - from).dot(&way) / way.norm_squared().max(1e-12);
    (0.0..1.0).contains(&part)
        && (from + way * part - middle).norm() < radius_m
        && (to - middle).norm() > radius_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;

    fn simulation(more: &str) -> Simulation {
        let text = format!(
            "{more}\n[camera]\nwidth = 8\nheight = 8\n[room]\nsize_m = [20.0, 20.0]\n\
             [robot]\nstart = [5.0, 5.0]\n\
             [[people]]\nwalk = 'orca'\npath = [[8.0, 5.0]]\n[[people]]\npath = [[5.0, 6.2]]\n"
        );
        Simulation::new(&Scene::parse(&text).unwrap(), 1)
    }

    #[test]
    fn people_are_hidden_by_bodies_blocks_and_distance() {
        fn at(x: f64, y: f64) -> Point2<f64> {
            Point2::new(x, y)
        }

        let reach = "laser = { max_range_m = 2.0 }";
        let block = "blocks = [{ at = [6.5, 5.0], size_m = [0.2, 4.0] }]";
        let from = at(5.0, 5.0);
        for (more, places, in_sight, why) in [
            ("", vec![at(8.0, 5.0), at(7.0, 5.0)], vec![false, true], "behind another"),
            ("", vec![at(8.0, 5.0), at(7.0, 5.4)], vec![true, true], "partly behind"),
            (
                "",
                vec![at(10.2, 5.0), at(10.4, 5.0), at(2.0, 5.0)],
                vec![true, false, true],
                "beyond the reach",
            ),
            (
                reach,
                vec![at(8.0, 5.0), at(7.0, 5.0)],
                vec![false, true],
                "beyond the range of a scanner",
            ),
            (block, vec![at(8.0, 5.0), at(5.0, 8.0)], vec![false, true], "behind a block"),
        ] {
            assert_eq!(simulation(more).in_sight(&from, &places), in_sight, "{why}");
        }
    }

    #[test]
    fn gaps_are_those_between_the_bodies() {
        let view = simulation("").crowd_view().unwrap();
        // The robot is a disc of 0.25 m.
        assert!((view.target_gap_m.unwrap() - 2.45).abs() < 1e-9);
        assert!((view.others_gap_m - 0.65).abs() < 1e-9);
        assert!(view.target_in_sight && !view.target_arrived);
        let plain = Scene::parse("[[people]]\npath = [[8.0, 5.0]]\n").unwrap();
        assert_eq!(Simulation::new(&plain, 1).crowd_view(), None);
    }
}
