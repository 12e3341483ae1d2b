use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};
use super::depth::doubt;
use super::odometry::{Motion, motion};
use super::{Alternative, better};

/// Number of blobs below which shares are not significant.
const FEW_BLOBS: usize = 3;

/// Checks that person-sized shapes that come and go have tracks.
pub fn missed(evidence: &Evidence) -> Option<Finding> {
    let coverage = &evidence.coverage;
    if !coverage.has_depth {
        return None;
    }
    // Without a run there is nothing to compare with.
    if evidence.trial.frames == 0 || evidence.trial.failure.is_some() {
        return None;
    }
    if coverage.blobs == 0 {
        let measured = match (doubt(evidence), evidence.changed) {
            (Some(doubt), _) => doubt,
            (None, Some(_)) => "no shape of a person's size comes or goes in depth",
            (None, None) => "not known: too few views of depth show the same places",
        };
        return Some(Finding::new("missed", Severity::Unknown, measured));
    }
    let share = coverage.unexplained as f64 / coverage.blobs as f64;
    let mut severity = Severity::beyond(share, 0.15, 0.5);
    if coverage.blobs < FEW_BLOBS {
        severity = severity.min(Severity::Warn);
    }
    let mut measured = format!(
        "{} of {} person-sized shapes that come and go have no track ({:.0} %), in {} of {} frames",
        coverage.unexplained,
        coverage.blobs,
        100.0 * share,
        coverage.frames_unexplained,
        coverage.frames
    );
    if let Some(example) = coverage.example {
        let side = if example.bearing_deg < 0.0 { "right" } else { "left" };
        measured += &format!(
            "; frame {}: {:.1} m away, {:.0} degrees to the {side}",
            example.frame,
            example.range_m,
            example.bearing_deg.abs()
        );
    }
    match (motion(evidence), evidence.causes.first()) {
        (Motion::Likely, _) => {
            measured +=
                "; things at rest come and go, too, where the robot moves (finding odometry)";
        }
        (doubt, Some((cause, count))) => {
            let lead =
                if doubt == Motion::Possible { "If the robot is at rest, cause" } else { "Cause" };
            measured += &format!(". {lead} in {count} of {}: {}", coverage.unexplained, cause.why);
        }
        (_, None) => {}
    }
    let finding = Finding::new("missed", severity, measured)
        .figure("blobs", coverage.blobs as f64)
        .figure("unexplained", coverage.unexplained as f64)
        .figure("share", share)
        .why("shapes 0.5 to 2.1 m above the floor, as wide as a person, that are not there all the time");
    Some(finding.remedy(remedy(evidence)))
}

/// Returns the change that helped most on this log, or else general advice.
fn remedy(evidence: &Evidence) -> String {
    if motion(evidence) == Motion::Likely {
        return "see the finding odometry first".to_owned();
    }
    let now = &evidence.coverage;
    match better(evidence, |other| other.unexplained < now.unexplained) {
        Some(Alternative { change, coverage }) => format!(
            "look at the pictures (-o DIR); tried on this log, {} of {} are left without a track \
             with\n{change}",
            coverage.unexplained, coverage.blobs
        ),
        None => {
            "look at the pictures (-o DIR), and see in the funnel below which test dropped them"
                .to_owned()
        }
    }
}
