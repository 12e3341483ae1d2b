use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Checks that no unused topic would give the pipeline an input that it lacks.
pub fn topics(evidence: &Evidence) -> Option<Finding> {
    let account = &evidence.inspection.inputs;
    let mut curable = account.curable();
    let Some(topic) = curable.next() else {
        let used = account.usable().join(", ");
        let measured = format!("used: {}", if used.is_empty() { "none" } else { &used });
        return Some(Finding::new("topics", Severity::Ok, measured));
    };
    let input = topic.could_be.unwrap_or_default();
    let problem = topic.problem.as_deref().unwrap_or_default();
    let measured = format!("{input} of {} ({}) cannot be used: {problem}", topic.topic, topic.kind);
    let finding = Finding::new("topics", Severity::Warn, measured)
        .why("the pipeline works without an input that the log seems to have");
    let remedy = topic.remedy.clone().unwrap_or_else(|| "record it again".to_owned());
    Some(finding.remedy(remedy))
}
