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
        (_, 1..) => (Severity::Warn, format!("silent at {gaps} frames, jumps at {jumps}; {way}")),
        // Readings in a wrong unit are beyond the walls, or between floor and ceiling at random.
        _ if all_moves && is_unit_in_doubt(evidence) => {
            let measured =
                "not known: the unit of depth is in doubt, by which a camera that moves is told";
            (Severity::Unknown, measured.to_owned())
        }
        _ if all_moves => {
            let share = 100.0 * evidence.changed.unwrap_or(0.0);
            let told = if source.is_some() { "the robot stands still" } else { "there is none" };
            (Severity::Bad, format!("{told}, but {share:.0} % of all points come and go"))
        }
        (Some(topic), _) => (Severity::Ok, format!("{topic}: {way}")),
        (None, _) if !stands => (Severity::Ok, format!("from tf: {way}")),
        (None, _) => match evidence.changed {
            Some(_) => (Severity::Ok, "none, and the camera stands still".to_owned()),
            // A scanner alone cannot tell, so nothing is said about how right that is.
            None => (
                Severity::Unknown,
                "none: the robot is taken to stand still; if it drives, record its odometry"
                    .to_owned(),
            ),
        },
    };
    let finding = Finding::new("odometry", severity, measured)
        .figure("driven_m", metres)
        .figure("turned_deg", evidence.driven.turned_rad.to_degrees())
        .why("while the robot moves and does not say so, people seem to move instead");
    Some(
        finding.remedy(
            "record the odometry throughout, and name it:\n[input] odometry_topic = \"/odom\"",
        ),
    )
}
