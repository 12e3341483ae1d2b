use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Counters of read items, as opposed to lost ones.
const NO_LOSS: [&str; 6] = [
    "chunks_verified",
    "chunks_without_crc",
    "disparity_pixels",
    "frames",
    "messages",
    "messages_unpacked",
];

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
            .why("damaged parts are skipped, and people in them are missed");
    Some(finding.remedy(format!(
        "the notes of `tagalong inspect` say what it is: {}",
        inspection.notes.join("; ")
    )))
}
