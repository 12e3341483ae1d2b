//! Checks of the pipeline's inputs and of its results.

use tagalong_log::{Inputs, LogError, Usage};

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Checks that the log has the inputs that the config needs.
pub fn needs(evidence: &Evidence) -> Option<Finding> {
    let usable = evidence.inspection.usable.join(", ");
    let Some(LogError::Missing { wanted, hint, .. }) = &evidence.refusal else {
        let measured = format!("the config needs {}; the log has {usable}", words(evidence.inputs));
        return Some(Finding::new("needs", Severity::Ok, measured));
    };
    let hint = hint.trim_start_matches("; ");
    let other = match &evidence.fitting[..] {
        [] => "take another config, see the column `needs` in configs/README.md".to_owned(),
        fitting => format!("take a config that fits this log: {}", fitting.join(", ")),
    };
    let remedy = if hint.is_empty() { other } else { format!("{hint};\nor {other}") };
    let measured = format!(
        "the log has no {wanted}; it has {}",
        if usable.is_empty() { "nothing usable" } else { &usable }
    );
    let finding = Finding::new("needs", Severity::Bad, measured).remedy(remedy);
    Some(finding.why("the pipeline cannot run on this log at all"))
}

fn words(inputs: Inputs) -> String {
    let names: Vec<&str> = inputs.of(Usage::Required).map(|input| input.name()).collect();
    if names.is_empty() { "any image".into() } else { names.join(", ") }
}

/// Counters of read items, as opposed to lost ones.
const NO_LOSS: [&str; 3] = ["chunks_verified", "frames", "messages"];

/// Checks that no part of the file was damaged or unusable.
pub fn damage(evidence: &Evidence) -> Option<Finding> {
    let inspection = &evidence.inspection;
    if !inspection.data_lost {
        return Some(Finding::new("file", Severity::Ok, "whole"));
    }
    let counters = inspection.counters.iter().filter(|(name, _)| !NO_LOSS.contains(name));
    let lost: Vec<String> = counters.map(|(name, count)| format!("{name} {count}")).collect();
    let finding =
        Finding::new("file", Severity::Warn, format!("data was lost: {}", lost.join(", ")))
            .why("what is damaged is skipped, and people in it are missed");
    Some(finding.remedy(format!(
        "the notes of `tagalong inspect` say what it is: {}",
        inspection.notes.join("; ")
    )))
}

/// Number of frames below which an empty result means little.
const FEW_FRAMES: u64 = 10;

/// Checks that people are found.
pub fn people(evidence: &Evidence) -> Option<Finding> {
    let trial = &evidence.trial;
    if let Some(why) = &trial.failure {
        let finding = Finding::new("people", Severity::Bad, format!("the pipeline failed: {why}"))
            .why("a plugin does not go on after a frame that it cannot use");
        return Some(finding.remedy("see the findings above; else this is a defect of the plugin"));
    }
    if evidence.refusal.is_some() {
        let finding = Finding::new("people", Severity::Bad, "the pipeline did not run")
            .why("an input that it requires is missing");
        return Some(finding.remedy("see the findings above"));
    }
    let coverage = &evidence.coverage;
    let tracks = coverage.moving + coverage.still + coverage.unclear;
    let (frames, with) = (trial.frames, coverage.frames_with_people);
    let measured = format!("{tracks} tracks, seen in {with} of {frames} frames");
    let severity = match (frames, with) {
        (0, _) => Severity::Bad,
        (_, 1..) => Severity::Ok,
        (..FEW_FRAMES, 0) => Severity::Unknown,
        _ => Severity::Warn,
    };
    let remedy = match frames {
        0 => "see the findings above",
        _ => {
            "see the findings above; then the funnel below, from the top: -o DIR shows what each \
              test dropped; a longer look: --frames N"
        }
    };
    let finding = Finding::new("people", severity, measured)
        .figure("people", tracks as f64)
        .figure("frames_with_people", with as f64)
        .why(if frames == 0 { "no frame can be made" } else { "nobody is detected" });
    Some(finding.remedy(remedy))
}
