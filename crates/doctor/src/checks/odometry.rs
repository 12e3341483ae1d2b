use tagalong_math::counted;

use super::super::evidence::{Evidence, Scans};
use super::super::finding::{Finding, Severity};
use super::depth::is_unit_in_doubt;

/// Distance below which a robot counts as at rest, m, because noise of the odometry adds up.
const STANDS_M: f64 = 0.3;

/// Share of points, or of rays, that come and go beyond which the camera, or the scanner, itself moves.
const ALL_MOVES: f64 = 0.5;

/// Share of points, or of rays, up to which people explain them.
const FEW_MOVE: f64 = 0.1;

/// Checks that the motion of the robot is known.
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
        // Readings in a wrong unit are behind the walls, or anywhere between floor and ceiling.
        _ if all_moves && is_unit_in_doubt(evidence) => {
            let measured =
                "not known: motion of the camera is measured from depth, whose unit is in doubt";
            (Severity::Unknown, measured.to_owned())
        }
        (Some(_), _) if all_moves => {
            let share = 100.0 * evidence.changed.unwrap_or(0.0);
            let measured =
                format!("the robot stands still, but {share:.0} % of all points come and go");
            (Severity::Bad, measured)
        }
        _ if all_moves => at_rest(evidence),
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
        (None, _) => at_rest(evidence),
    };
    let finding = Finding::new("odometry", severity, measured)
        .figure("driven_m", metres)
        .figure("turned_deg", evidence.driven.turned_rad.to_degrees())
        .why("if the odometry lacks a motion of the robot, people seem to move instead");
    let name = "name it:\n[input] odometry_topic = \"/odom\"";
    Some(finding.remedy(if source.is_none() && unusable(evidence).is_some() {
        "see the finding topics".to_owned()
    } else if jumps > gaps {
        format!(
            "check that it is in metres, from one publisher and without resets; otherwise record \
             another one, and {name}"
        )
    } else {
        format!("record the odometry throughout, and {name}")
    }))
}

/// Motion of a robot that the log does not contain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// The log contains the motion, or hardly any point comes and goes.
    Told,
    /// More points come and go than a few people explain.
    Possible,
    /// The robot has odometry that cannot be used, or most points come and go.
    Likely,
}

/// Returns what the points that come and go say about a motion that the log does not contain.
pub(super) fn motion(evidence: &Evidence) -> Motion {
    let driven = &evidence.driven;
    let has_source = evidence.inspection.facts.odometry_topic.is_some();
    let is_told = has_source || driven.metres >= STANDS_M || driven.moves_camera();
    untold_motion(is_told, unusable(evidence).is_some(), evidence.changed)
}

/// As [`motion`], from what the log tells, a topic that cannot be used and the share of changed points.
fn untold_motion(is_told: bool, has_unusable: bool, changed: Option<f64>) -> Motion {
    match changed {
        Some(share) if !is_told && share > FEW_MOVE => {
            if has_unusable || share > ALL_MOVES {
                Motion::Likely
            } else {
                Motion::Possible
            }
        }
        _ => Motion::Told,
    }
}

/// Returns the topic that would give the odometry and cannot be used.
fn unusable(evidence: &Evidence) -> Option<&str> {
    let mut curable = evidence.inspection.inputs.curable();
    let topic = curable.find(|topic| topic.could_be == Some("odometry"))?;
    Some(&topic.topic)
}

/// Returns the finding for a log without odometry, whose robot is assumed to be at rest.
fn at_rest(evidence: &Evidence) -> (Severity, String) {
    let rays = evidence.samples.scans.first().and_then(Scans::changed);
    let moving = match (evidence.changed, rays) {
        (Some(share), _) => {
            Some((share, format!("{:.0} % of all points come and go", 100.0 * share)))
        }
        (None, Some(share)) => Some((
            share,
            format!("{:.0} % of the rays change by more than 0.2 m in a second", 100.0 * share),
        )),
        (None, None) => None,
    };
    assumed(unusable(evidence), moving)
}

/// Returns the finding from an unusable topic, and from the share of points or rays that change with its
/// words.
fn assumed(unusable: Option<&str>, moving: Option<(f64, String)>) -> (Severity, String) {
    let lack = unusable
        .map_or("none".to_owned(), |topic| format!("{topic} cannot be used (finding topics)"));
    match moving {
        Some((share, words)) if share > ALL_MOVES => {
            (Severity::Bad, format!("{lack}, and {words}: the robot moves"))
        }
        Some((share, words)) if share > FEW_MOVE => {
            let cure = if unusable.is_some() { "" } else { "; if it did, record its odometry" };
            (Severity::Unknown, format!("{lack}, and {words}: the robot may have moved{cure}"))
        }
        Some((_, words)) => {
            let severity = if unusable.is_some() { Severity::Unknown } else { Severity::Ok };
            (severity, format!("{lack}: the robot is assumed to be at rest; {words}"))
        }
        None => (
            Severity::Unknown,
            format!(
                "{lack}: the robot is assumed to be at rest, which nothing measures; if it drives, record \
                 its odometry"
            ),
        ),
    }
}

/// Returns the words for odometry with gaps and jumps. The distance driven during these is unknown,
/// so that there is no statement on whether the robot was at rest.
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

    #[test]
    fn a_robot_without_odometry_is_at_rest_only_where_little_changes() {
        let share =
            |share: f64| Some((share, format!("{:.0} % of the rays change", 100.0 * share)));
        for (unusable, moving, severity, words) in [
            (None, share(0.02), Severity::Ok, "none: the robot is assumed to be at rest; 2 % of"),
            (
                None,
                share(0.3),
                Severity::Unknown,
                "none, and 30 % of the rays change: the robot may",
            ),
            (
                None,
                share(0.85),
                Severity::Bad,
                "none, and 85 % of the rays change: the robot moves",
            ),
            (
                None,
                None,
                Severity::Unknown,
                "none: the robot is assumed to be at rest, which nothing",
            ),
            (
                Some("/odom"),
                share(0.02),
                Severity::Unknown,
                "/odom cannot be used (finding topics): ",
            ),
            (
                Some("/odom"),
                share(0.3),
                Severity::Unknown,
                "/odom cannot be used (finding topics), ",
            ),
        ] {
            let (found, measured) = assumed(unusable, moving);
            assert!(found == severity && measured.starts_with(words), "{measured}");
        }
    }

    #[test]
    fn missed_shapes_are_blamed_on_a_motion_that_the_log_lacks() {
        assert_eq!(untold_motion(true, false, Some(0.9)), Motion::Told);
        assert_eq!(untold_motion(false, true, Some(0.02)), Motion::Told);
        assert_eq!(untold_motion(false, false, None), Motion::Told);
        assert_eq!(untold_motion(false, false, Some(0.2)), Motion::Possible);
        assert_eq!(untold_motion(false, true, Some(0.2)), Motion::Likely);
        assert_eq!(untold_motion(false, false, Some(0.9)), Motion::Likely);
    }
}
