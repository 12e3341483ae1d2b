//! Truth for the robot's images, from the measured places.

use std::str::FromStr;

use crate::triangulate::Fix;
use nalgebra::{Isometry2, Point2, Vector2};
use tagalong_app::outcome::Failure;
use tagalong_app::scoring::Shots;
use tagalong_app::serialize::to_json_line;
use tagalong_core::Stamp;
use tagalong_log::{InputSettings, Limits, TruthFrame, TruthPerson};

use super::TriangulateArgs;
use super::seen::CameraSightings;

/// Longest time between two places, s; in a longer one the person may have been anywhere, and
/// counts neither as missed nor as a false alarm.
const LONGEST_GAP_S: f64 = 1.0;
/// Number of the person with the hat.
const PERSON: i64 = 1;

/// Pose of the robot: `x,y,heading`, in metres and degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing(Isometry2<f64>);

impl FromStr for Standing {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[x, y, degrees]) if [x, y, degrees].iter().all(|v| v.is_finite()) => {
                Ok(Self(Isometry2::new(Vector2::new(x, y), degrees.to_radians())))
            }
            _ => Err("three numbers with commas between them, like 5,2.5,90".into()),
        }
    }
}

/// Returns the truth of each image of the robot. Before the first and after the last place there is
/// no person.
pub(super) fn frames(
    args: &TriangulateArgs,
    seen: &CameraSightings,
    fixes: &[(Stamp, Fix)],
) -> Result<Vec<TruthFrame>, Failure> {
    let shots = Shots::read(&args.log, &InputSettings::default(), &Limits::default())?;
    let frames = shots.iter().map(|shot| {
        let robot = match (args.robot, shots.first()) {
            // From the start on, odometry gives the robot's pose.
            (Some(Standing(start)), Some(first)) => {
                start * first.odom_from_robot.inverse() * shot.odom_from_robot
            }
            _ => *seen.robot.get(&shot.stamp_ns)?,
        };
        let person = at(Stamp::from_nanos(shot.stamp_ns), fixes);
        let person = person.map(|(place, ignore)| {
            let here = robot.inverse_transform_point(&place);
            let head = Some([here.x, here.y, args.head]);
            TruthPerson {
                id: PERSON,
                head_in_robot_m: head,
                ignore,
                visible: 1.0,
                ..TruthPerson::default()
            }
        });
        Some(TruthFrame { stamp_ns: shot.stamp_ns, people: person.into_iter().collect() })
    });
    let frames: Option<Vec<TruthFrame>> = frames.collect();
    frames.ok_or_else(|| {
        Failure::usage("nothing says where the robot stands in the room: say it with --robot")
    })
}

/// Returns the position of the person at a time, interpolated between the places before and after
/// it, and true if the gap is too long for that.
fn at(stamp: Stamp, fixes: &[(Stamp, Fix)]) -> Option<(Point2<f64>, bool)> {
    let after = fixes.partition_point(|(at, _)| *at < stamp);
    let (to_at, to) = fixes.get(after)?;
    if *to_at == stamp {
        return Some((to.place, false));
    }
    let (from_at, from) = fixes.get(after.checked_sub(1)?)?;
    let gap_s = to_at.seconds_since(*from_at);
    let part = stamp.seconds_since(*from_at) / gap_s;
    Some((from.place + part * (to.place - from.place), gap_s > LONGEST_GAP_S))
}

/// Returns one line of JSON for each image.
pub(super) fn lines(frames: &[TruthFrame]) -> Result<String, Failure> {
    frames.iter().map(|frame| to_json_line("the truth of an image", frame)).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;

    use super::*;

    fn fix(ms: u64, x: f64) -> (Stamp, Fix) {
        let place = Point2::new(x, 1.0);
        let fix = Fix { place, covariance: Matrix2::identity(), misfit_rad: 0.0, cameras: 2 };
        (Stamp::from_nanos(1_000_000 * ms), fix)
    }

    #[test]
    fn between_two_places_somebody_is_on_the_way() {
        let fixes = [fix(1000, 2.0), fix(1500, 3.0), fix(4500, 6.0)];
        for (ms, place, why) in [
            (999, None, "before the first place"),
            (1000, Some((2.0, false)), "at the first place"),
            (1250, Some((2.5, false)), "on the way"),
            (2500, Some((4.0, true)), "nobody saw them for three seconds"),
            (4500, Some((6.0, false)), "at the last place"),
            (4501, None, "after the last place"),
        ] {
            let found = at(Stamp::from_nanos(1_000_000 * ms), &fixes);
            assert_eq!(found.map(|(place, is_guess)| (place.x, is_guess)), place, "{why}");
        }
    }

    #[test]
    fn a_place_is_three_numbers() {
        let standing: Standing = "5, 2.5,90".parse().unwrap();
        let ahead = standing.0 * Point2::new(1.0, 0.0);
        assert!((ahead - Point2::new(5.0, 3.5)).norm() < 1e-12);
        for wrong in ["", "5,2", "5,2,north", "5,2,nan", "1,2,3,4"] {
            assert!(wrong.parse::<Standing>().is_err(), "{wrong}");
        }
    }
}
