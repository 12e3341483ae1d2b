use tagalong_math::counted;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};
use super::depth::is_unit_in_doubt;

/// Way below which a robot stands, m: noise of the odometry adds up.
const STANDS_M: f64 = 0.3;

/// Share of points that come and go beyond which the camera itself moves.
const ALL_MOVES: f64 = 0.5;

/// Checks that the robot's motion is known.
pub fn odometry(evidence: &Evidence) -> Option<Finding> {
    let counters = &evidence.inspection.counters;
    let [gaps, jumps] = ["odometry_gap_frames", "odometry_jump_frames"]
        .map(|name| counters.get(name).copied().unwrap_or(0));
    let metres = evidence.driven.metres;
    let stands = metres < STANDS_M;
    let all_moves = stands && evidence.changed.is_some_and(|share| share > ALL_MOVES);
    let way = if stands {
        "the robot stands still".to_owned()
    } else {
        format!(
            "{metres:.1} m driven, {:.0} degrees turned",
            evidence.driven.turned_rad.to_degrees()
        )
    };
    let source = evidence.inspection.facts.odometry_topic.as_deref();
    let (severity, measured) = match (source, gaps + jumps) {
        (_, 1..) => (Severity::Warn, unsteady(gaps, jumps, &way, stands)),
        // Readings in a wrong unit are beyond the walls, or between floor and ceiling at random.
        _ if all_moves && is_unit_in_doubt(evidence) => {
            let measured =
                "not known: motion of the camera is measured from depth, whose unit is in doubt";
            (Severity::Unknown, measured.to_owned())
        }
        _ if all_moves => {
            let share = 100.0 * evidence.changed.unwrap_or(0.0);
            let told = if source.is_some() { "the robot stands still" } else { "there is none" };
            (Severity::Bad, format!("{told}, but {share:.0} % of all points come and go"))
        }
        (Some(topic), _) => (Severity::Ok, format!("{topic}: {way}")),
        (None, _) if !stands => (Severity::Ok, format!("from tf: {way}")),
        (None, _) if evidence.driven.moves_camera() => {
            let driven = &evidence.driven;
            let turned = driven.camera_turned_rad.to_degrees();
            let moved = driven.camera_moved_m;
            (
                Severity::Ok,
                format!(
                    "none; by tf the robot stands still and moves its camera, by up to {moved:.2} m and \
                     {turned:.0} degrees"
                ),
            )
        }
        (None, _) => match evidence.changed {
            Some(_) => (Severity::Ok, "none, and the camera stands still".to_owned()),
            // A scanner alone cannot tell, so nothing is said about how right that is.
            None => (
                Severity::Unknown,
                "none: the robot is assumed to stand still; if it drives, record its odometry"
                    .to_owned(),
            ),
        },
    };
    let finding = Finding::new("odometry", severity, measured)
        .figure("driven_m", metres)
        .figure("turned_deg", evidence.driven.turned_rad.to_degrees())
        .why("if the odometry lacks a motion of the robot, people seem to move instead");
    let name = "name it:\n[input] odometry_topic = \"/odom\"";
    Some(finding.remedy(if jumps > gaps {
        format!(
            "check that it is in metres, from one publisher and without resets; otherwise record \
             another one, and {name}"
        )
    } else {
        format!("record the odometry throughout, and {name}")
    }))
}

/// Returns the words for odometry with gaps and jumps. Over these the way is not known, so that nothing
/// is said of a robot that seems to stand.
fn unsteady(gaps: u64, jumps: u64, way: &str, stands: bool) -> String {
    let mut parts = Vec::new();
    if gaps > 0 {
        parts.push(format!("silent at {}", counted(gaps, "frame")));
    }
    if jumps > 0 {
        parts.push(format!("jumps by more than a metre at {}", counted(jumps, "frame")));
    }
    let way = if stands { "the motion between them is not known" } else { way };
    format!("{}; {way}", parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_whose_odometry_jumps_is_not_said_to_stand() {
        let jumps = unsteady(0, 19, "the robot stands still", true);
        assert_eq!(
            jumps,
            "jumps by more than a metre at 19 frames; the motion between them is not known"
        );
        let both = unsteady(3, 1, "1.8 m driven, 0 degrees turned", false);
        assert!(both.starts_with("silent at 3 frames, jumps by"), "{both}");
        assert!(both.ends_with("; 1.8 m driven, 0 degrees turned"), "{both}");
    }
}
