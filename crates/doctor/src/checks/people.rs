use tagalong_math::counted;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Number of frames below which an empty result is not significant.
const FEW_FRAMES: u64 = 10;

/// Checks that people are found.
pub fn people(evidence: &Evidence) -> Option<Finding> {
    let trial = &evidence.trial;
    if let Some(why) = &trial.failure {
        let finding = Finding::new("people", Severity::Bad, format!("the pipeline failed: {why}"))
            .why("a plugin stops at a frame that it cannot use");
        return Some(finding.remedy(
            "see the findings above; if none explains it, this is a defect of the plugin",
        ));
    }
    if evidence.refusal.is_some() {
        let finding = Finding::new("people", Severity::Bad, "the pipeline did not run")
            .why("an input that it requires is missing");
        return Some(finding.remedy("see the findings above"));
    }
    let coverage = &evidence.coverage;
    let tracks = coverage.moving + coverage.still + coverage.unclear;
    let frames = trial.frames;
    let with = coverage.frames_with_people;
    let mut measured =
        format!("{}, seen in {with} of {}", counted(tracks, "track"), counted(frames, "frame"));
    let warnings = trial.lacking.warnings();
    for warning in &warnings {
        measured += &format!("; {warning}");
    }
    let severity = match (frames, with) {
        (0, _) => Severity::Bad,
        (_, 1..) if warnings.is_empty() => Severity::Ok,
        (_, 1..) => Severity::Warn,
        (..FEW_FRAMES, 0) => Severity::Unknown,
        _ => Severity::Warn,
    };
    let remedy = match frames {
        0 => "see the findings above",
        _ if with > 0 => {
            "record every input throughout, or take a config without the one that is lacking"
        }
        _ => {
            "see the findings above; then the funnel below, from the top: -o DIR draws what each \
             test dropped, and --frames N takes more frames"
        }
    };
    let why = match (frames, with) {
        (0, _) => "no frame can be made",
        (_, 0) => "nobody is detected",
        _ => "a frame without a required input is left out",
    };
    let finding = Finding::new("people", severity, measured)
        .figure("people", tracks as f64)
        .figure("frames_with_people", with as f64)
        .why(why);
    Some(finding.remedy(remedy))
}
