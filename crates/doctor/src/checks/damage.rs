use std::collections::BTreeMap;

use tagalong_log::{LOSSES, is_loss};
use tagalong_math::counted;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Sentences about losses that are shown.
const SENTENCES: usize = 3;

/// Checks that no part of the file was damaged or unusable.
pub fn damage(evidence: &Evidence) -> Option<Finding> {
    let counters = &evidence.inspection.counters;
    Some(if evidence.inspection.data_lost {
        lost(counters, &evidence.losses)
    } else {
        whole(counters)
    })
}

/// Returns the finding for a file without damage, as far as its checksums tell.
fn whole(counters: &BTreeMap<&'static str, u64>) -> Finding {
    let measured = match counters.get("chunks_without_crc") {
        Some(chunks) => {
            format!("no damage found; {} without a checksum", counted(*chunks, "chunk"))
        }
        None => "whole".to_owned(),
    };
    Finding::new("file", Severity::Ok, measured)
}

/// Returns the finding for lost data, with the counters and the sentences about them.
fn lost(counters: &BTreeMap<&'static str, u64>, sentences: &[String]) -> Finding {
    let losses = counters.iter().filter(|(name, _)| is_loss(name));
    let mut parts: Vec<String> = losses.map(|(name, count)| format!("{name} {count}")).collect();
    parts.extend(sentences.iter().take(SENTENCES).cloned());
    let finding =
        Finding::new("file", Severity::Warn, format!("data was lost: {}", parts.join("; ")))
            .why("lost parts are skipped, and people in them are missed");
    // The sentences about other losses end in their remedies.
    if counters.keys().any(|name| LOSSES.contains(name)) {
        return finding.remedy("copy the log again, if it is whole where it was recorded");
    }
    finding
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_data_is_told_with_its_sentences_and_without_what_is_no_loss() {
        let unpaired =
            "10 of 20 frames got no image of /depth: it ends 1.0 s before the last frame";
        let counters = [("chunks_without_crc", 2), ("colour_without_depth", 10), ("frames", 10)];
        let told = lost(&counters.into(), &[unpaired.to_owned()]);
        assert_eq!(told.measured, format!("data was lost: colour_without_depth 10; {unpaired}"));
        assert_eq!(told.remedy, None, "the file itself is whole");
        let told = lost(&[("truncated", 1)].into(), &["at byte 9: the file ends".to_owned()]);
        assert_eq!(told.measured, "data was lost: truncated 1; at byte 9: the file ends");
        assert!(told.remedy.unwrap().contains("copy the log again"));
    }

    #[test]
    fn a_file_without_checksums_is_not_called_whole() {
        let told = whole(&[("chunks_without_crc", 2)].into());
        assert_eq!(told.measured, "no damage found; 2 chunks without a checksum");
        assert_eq!(whole(&[("chunks_verified", 2)].into()).measured, "whole");
    }
}
