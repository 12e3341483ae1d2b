use nalgebra::{Isometry2, Point2, Vector2};
use tagalong_core::Twist;

use crate::clear_follow::config::Config;

/// The horizon is looked at in so many steps.
const STEPS: u32 = 6;
/// Factors on the speed.
const SPEEDS: [f64; 5] = [1.0, 0.75, 0.5, 0.25, 0.0];
/// Changes of the turn rate, rad/s, to the side to which it turns.
const TURNS: [f64; 9] = [0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6, 0.9, -0.9];
/// Radius of a person, m.
const PERSON_M: f64 = 0.25;
/// Distance from the line of sight within which another person hides the target, m.
const SIGHT_M: f64 = 0.35;

/// Returns the pose of the robot after some time at a twist.
fn pose_after(twist: Twist, seconds: f64) -> Isometry2<f64> {
    let turn = twist.angular_rps * seconds;
    let half = 0.5 * turn;
    // The chord of a short arc is its length; the quotient would be 0 / 0.
    let chord =
        twist.linear_mps * seconds * if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
    Isometry2::new(Vector2::new(half.cos(), half.sin()) * chord, turn)
}

/// Walking person, in the axes of the robot when the wheels answer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Walker {
    pub(crate) at: Point2<f64>,
    pub(crate) velocity: Vector2<f64>,
}

impl Walker {
    fn after(&self, seconds: f64) -> Point2<f64> {
        self.at + self.velocity * seconds
    }
}

/// Input of a plan, in the axes of the robot when the wheels answer.
pub(crate) struct PlanningInput<'a> {
    pub(crate) things: &'a [Point2<f64>],
    pub(crate) others: &'a [Walker],
    pub(crate) person: Walker,
    pub(crate) max_mps: f64,
}

/// The cheapest change of a twist.
pub(crate) fn plan(config: &Config, nominal: Twist, around: &PlanningInput<'_>) -> Twist {
    // Changes to the side of the turn come first, so that ties do not turn away from the person.
    let side = if nominal.angular_rps < 0.0 { -1.0 } else { 1.0 };
    let limit = config.max_turn_rate;
    let candidates = SPEEDS.iter().flat_map(|part| {
        TURNS.iter().map(move |change| {
            let turn = (nominal.angular_rps + side * change).clamp(-limit, limit);
            Twist::new(part * nominal.linear_mps, turn)
        })
    });
    let best = candidates.min_by(|a, b| {
        let [of_a, of_b] = [a, b].map(|twist| cost(config, nominal, *twist, around));
        of_a.total_cmp(&of_b)
    });
    best.unwrap_or(nominal)
}

fn cost(config: &Config, nominal: Twist, twist: Twist, around: &PlanningInput<'_>) -> f64 {
    let slower = (nominal.linear_mps - twist.linear_mps).abs() / around.max_mps;
    let turned = (nominal.angular_rps - twist.angular_rps).abs();
    let room = clearance(config, twist, around) / config.room_m;
    // The cost is bounded, so that all plans in a tight place stay comparable.
    let tight = (1.0 - room).clamp(0.0, 2.0);
    slower
        + config.turn_weight * turned
        + config.room_weight * tight * tight
        + config.sight_weight * hidden(config, twist, around)
}

/// The least room to things and people on the way, m. A robot that does not drive
/// comes nearer to nothing.
fn clearance(config: &Config, twist: Twist, around: &PlanningInput<'_>) -> f64 {
    // A standing robot comes nearer to nothing.
    if twist.linear_mps <= 0.0 {
        return f64::INFINITY;
    }
    let step_s = config.horizon_s / f64::from(STEPS);
    let mut least = f64::INFINITY;
    for step in 1..=STEPS {
        let seconds = step_s * f64::from(step);
        let robot = Point2::from(pose_after(twist, seconds).translation.vector);
        let things = around.things.iter().map(|at| (*at, 0.0));
        let people = around.others.iter().map(|other| (other.after(seconds), PERSON_M));
        for (at, its_m) in things.chain(people) {
            least = f64::min(least, (at - robot).norm() - its_m - config.radius_m);
        }
    }
    least
}

/// Returns the degree to which another person is before the target at the end of the horizon, 0 to
/// 1.
fn hidden(config: &Config, twist: Twist, around: &PlanningInput<'_>) -> f64 {
    let pose = pose_after(twist, config.horizon_s);
    let person = pose.inverse_transform_point(&around.person.after(config.horizon_s)).coords;
    let Some(sight) = person.try_normalize(1e-6) else { return 0.0 };
    around
        .others
        .iter()
        .map(|other| {
            let at = pose.inverse_transform_point(&other.after(config.horizon_s)).coords;
            let along = at.dot(&sight);
            let aside = at.perp(&sight).abs();
            // A person behind the target, or behind the robot, hides nothing.
            let between = along > 0.0 && along < person.norm() - PERSON_M;
            if between { (1.0 - aside / SIGHT_M).max(0.0) } else { 0.0 }
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    const AHEAD: Twist = Twist::new(0.8, 0.0);

    fn planned(things: &[Point2<f64>], others: &[Walker]) -> Twist {
        let person = Walker { at: Point2::new(3.0, 0.0), velocity: Vector2::new(0.8, 0.0) };
        plan(&Config::default(), AHEAD, &PlanningInput { things, others, person, max_mps: 0.9 })
    }

    #[test]
    fn a_walker_goes_on_at_its_velocity() {
        let walker = Walker { at: Point2::new(1.0, 2.0), velocity: Vector2::new(0.5, -1.0) };
        assert_eq!(walker.after(3.0), Point2::new(2.5, -1.0));
    }

    #[test]
    fn an_empty_room_changes_nothing() {
        assert_eq!(planned(&[], &[]), AHEAD);
        assert_eq!(planned(&[Point2::new(1.0, 1.5)], &[]), AHEAD);
    }

    #[test]
    fn it_goes_round_things_on_the_free_side() {
        let left = planned(&[Point2::new(1.1, -0.2)], &[]);
        assert!(left.angular_rps > 0.0 && left.linear_mps > 0.0, "{left:?}");
        let right = planned(&[Point2::new(1.1, 0.2)], &[]);
        assert!(right.angular_rps < 0.0 && right.linear_mps > 0.0, "{right:?}");
    }

    #[test]
    fn a_wall_stops_it() {
        let wall: Vec<_> = (-20..=20).map(|i| Point2::new(0.5, 0.1 * f64::from(i))).collect();
        assert_eq!(planned(&wall, &[]).linear_mps, 0.0);
    }

    #[test]
    fn it_minds_where_people_walk_to_and_not_where_they_are() {
        fn speed(walker: Walker) -> f64 {
            planned(&[], &[walker]).linear_mps
        }

        let leaves = Walker { at: Point2::new(1.0, 0.1), velocity: Vector2::new(0.0, 1.4) };
        let comes = Walker { at: Point2::new(0.9, -1.2), velocity: Vector2::new(0.0, 1.0) };
        let stays = Walker { velocity: Vector2::zeros(), ..leaves };
        assert_eq!(planned(&[], &[leaves]), AHEAD, "gone by then");
        assert!(speed(comes) < 0.8 || planned(&[], &[comes]).angular_rps != 0.0);
        assert!(speed(stays) < 0.8 || planned(&[], &[stays]).angular_rps != 0.0);
    }

    #[test]
    fn arcs_end_where_small_steps_lead() {
        let twist = Twist::new(0.7, -0.9);
        let step = pose_after(twist, 0.001);
        let steps = (0..1500).fold(Isometry2::identity(), |pose, _| pose * step);
        let whole = pose_after(twist, 1.5);
        assert!((steps.translation.vector - whole.translation.vector).norm() < 1e-6);
    }

    const STILL: Twist = Twist::new(0.0, 0.0);

    fn stands(x: f64, y: f64) -> Walker {
        Walker { at: Point2::new(x, y), velocity: Vector2::zeros() }
    }

    /// With the person 3 m ahead.
    fn around<'a>(things: &'a [Point2<f64>], others: &'a [Walker]) -> PlanningInput<'a> {
        PlanningInput { things, others, person: stands(3.0, 0.0), max_mps: 0.9 }
    }

    #[test]
    fn room_is_what_is_left_between_the_robot_and_things_on_its_way() {
        fn room_left(twist: Twist, things: &[Point2<f64>], others: &[Walker]) -> f64 {
            clearance(&Config::default(), twist, &around(things, others))
        }

        // In a second and a half it comes to 1.2 m, and looks at every 0.2 m.
        let beside = [Point2::new(0.8, 0.5)];
        let crosses = Walker { velocity: Vector2::new(0.0, 1.0), ..stands(0.8, -1.0) };
        for (things, others, expected, why) in [
            (&beside[..], &[][..], 0.25, "its own radius"),
            (&[Point2::new(2.0, 0.0)], &[], 0.55, "at the end of the way"),
            (&[], &[stands(0.8, -0.9)], 0.4, "and that of people"),
            (&beside, &[stands(0.8, -0.6)], 0.1, "the least"),
            (&[], &[crosses], -0.5, "they meet after a second"),
        ] {
            let found = room_left(AHEAD, things, others);
            assert!((found - expected).abs() < 1e-9, "{why}: {found}");
        }
        assert_eq!(room_left(STILL, &beside, &[]), f64::INFINITY);
        assert_eq!(room_left(AHEAD, &[], &[]), f64::INFINITY);
    }

    #[test]
    fn who_stands_before_the_person_hides_them_the_more_the_less_aside() {
        let config = Config::default();
        for (x, y, expected) in [
            (1.5, 0.0, 1.0),
            (1.5, 0.4, 0.0),
            (1.5, -0.4, 0.0),
            (2.74, 0.0, 1.0),
            (2.76, 0.0, 0.0),
            (-1.0, 0.0, 0.0),
        ] {
            let found = hidden(&config, STILL, &around(&[], &[stands(x, y)]));
            assert_eq!(found, expected, "{x} {y}");
        }
        for (y, expected) in [(0.175, 0.5), (-0.07, 0.8)] {
            let found = hidden(&config, STILL, &around(&[], &[stands(1.5, y)]));
            assert!((found - expected).abs() < 1e-9, "{y}: {found}");
        }
        let two = [stands(1.5, 0.175), stands(1.0, 0.07)];
        assert!((hidden(&config, STILL, &around(&[], &two)) - 0.8).abs() < 1e-9, "the worst");
        let leaves = Walker { velocity: Vector2::new(0.0, 1.0), ..stands(1.5, 0.0) };
        assert_eq!(hidden(&config, STILL, &around(&[], &[leaves])), 0.0, "gone by then");
        let turns = Twist::new(0.0, 1.0);
        let turned = hidden(&config, turns, &around(&[], &[stands(1.5, 0.0)]));
        assert!((turned - 1.0).abs() < 1e-9, "a turn in place changes nothing: {turned}");
    }

    #[test]
    fn each_change_has_its_price() {
        let slower = Twist { linear_mps: 0.35, ..AHEAD };
        let turned = Twist { angular_rps: -0.6, ..AHEAD };
        for (twist, things, others, expected) in [
            (AHEAD, &[][..], &[][..], 0.0),
            (slower, &[], &[], 0.5),
            (turned, &[], &[], 0.15),
            // 0.1 m of room where 0.2 m are wanted: half of it, squared, twice.
            (AHEAD, &[Point2::new(0.8, 0.35)], &[], 0.5),
            (AHEAD, &[Point2::new(0.8, 0.5)], &[], 0.0),
            (AHEAD, &[Point2::new(0.8, 0.0)], &[], 2.0 * 4.0),
            (STILL, &[], &[stands(1.5, 0.0)], 0.8 / 0.9 + 0.05),
        ] {
            let found = cost(&Config::default(), AHEAD, twist, &around(things, others));
            assert!((found - expected).abs() < 1e-9, "{twist:?}: {found}");
        }
    }

    /// A post that is passed as easily on either side.
    #[test]
    fn a_post_is_passed_on_the_side_to_which_the_robot_turns() {
        for side in [1.0, -1.0] {
            let nominal = Twist::new(0.8, 0.1 * side);
            let post = [Point2::new(1.5, 0.08 * side)];
            let planned = plan(&Config::default(), nominal, &around(&post, &[]));
            assert!((planned.angular_rps - 0.5 * side).abs() < 1e-9, "{planned:?}");
            assert_eq!(planned.linear_mps, 0.8);
        }
    }

    #[test]
    fn it_turns_on_rather_than_back_and_no_faster_than_it_may() {
        let config = Config::default();
        let wall: Vec<_> = (-9..=9).map(|i| Point2::new(0.7, 0.2 * f64::from(i))).collect();
        let person = stands(0.0, 3.0);
        for turn_rate in [1.0, -1.0] {
            let nominal = Twist::new(0.6, turn_rate);
            let scene = PlanningInput { things: &wall, others: &[], person, max_mps: 0.9 };
            let planned = plan(&config, nominal, &scene);
            assert!(planned.angular_rps.abs() <= 1.2 && planned != nominal, "{planned:?}");
            let mirrored = plan(&config, Twist { angular_rps: -turn_rate, ..nominal }, &scene);
            assert_eq!(planned.angular_rps, -mirrored.angular_rps);
        }
    }
}
