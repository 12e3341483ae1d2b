use tagalong_math::counted;

use super::super::coverage::STILL_S;
use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};
use super::super::present::BY_EVIDENCE;
use super::{Alternative, better};

/// Number of boxes below which shares are not significant.
const FEW_BOXES: usize = 5;

/// Shares of idle boxes that are a warning and a serious problem: more than one seated person among
/// others would cause.
const IDLE: (f64, f64) = (0.1, 0.65);

/// Checks that tracks are not those of objects: they move at some time, or something moves at their
/// position.
pub fn still(evidence: &Evidence) -> Option<Finding> {
    let coverage = &evidence.coverage;
    if coverage.boxes == 0 {
        return None;
    }
    let tracks = coverage.moving + coverage.still + coverage.unclear;
    let still_share = coverage.still_boxes as f64 / coverage.boxes as f64;
    let idle_share = coverage.idle();
    let mut severity = Severity::beyond(idle_share, IDLE.0, IDLE.1);
    // Tracks that are too short to be judged prove nothing.
    let are_judged = coverage.moving + coverage.still > 0;
    if coverage.boxes < FEW_BOXES || !are_judged {
        severity = severity.min(Severity::Warn);
    }
    let mut measured = match coverage.still {
        0 => {
            let tracks = counted(tracks, "track");
            format!("each of {tracks} moved, or lasted less than {STILL_S:.0} s")
        }
        still => format!(
            "{still} of {} never moved; they fill {:.0} % of the boxes",
            counted(tracks, "track"),
            100.0 * still_share
        ),
    };
    if coverage.has_depth {
        measured +=
            &format!("; in {:.0} % of the boxes nothing ever comes or goes", 100.0 * idle_share);
    }
    let finding = Finding::new("still", severity, measured)
        .figure("tracks", tracks as f64)
        .figure("still_tracks", coverage.still as f64)
        .figure("still_boxes_share", still_share)
        .figure("idle_boxes_share", idle_share)
        .why("people move at some time: these are objects, or people who sit or stand throughout");
    Some(finding.remedy(remedy(evidence)))
}

/// Returns the change that helped most on this log, or else general advice.
fn remedy(evidence: &Evidence) -> String {
    let now = &evidence.coverage;
    match better(evidence, |other| other.idle_boxes < now.idle_boxes) {
        Some(Alternative { change, coverage }) => format!(
            "look at the pictures (-o DIR); tried on this log, nothing moves in {:.0} % of the boxes \
             with\n{change}",
            100.0 * coverage.idle()
        ),
        None => format!(
            "look at the pictures (-o DIR){}\n[manager] plugin = \"manage-sprt\"",
            other_config(evidence)
        ),
    }
}

/// Returns the advice to use another config, unless it is already in use or cannot be used.
fn other_config(evidence: &Evidence) -> String {
    let usable = &evidence.inspection.usable;
    let fits =
        usable.contains(&"colour") && usable.contains(&"depth") && evidence.config != VERIFIED;
    if fits {
        format!("; where they are things, take {VERIFIED}, or")
    } else {
        BY_EVIDENCE.to_owned()
    }
}

/// Config whose verifiers drop objects.
const VERIFIED: &str = "depth-verified";
