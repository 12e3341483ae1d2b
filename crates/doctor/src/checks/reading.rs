use tagalong_log::is_loss;
use tagalong_math::counted;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Checks that frames were made from the images of the log.
pub fn reading(evidence: &Evidence) -> Option<Finding> {
    let made = evidence.reading.made;
    let wanted = evidence.reading.wanted.max(evidence.reading.made);
    if wanted == 0 {
        let why = evidence.inspection.unusable.as_deref().unwrap_or("no image and no scan");
        let finding = Finding::new("frames-read", Severity::Bad, format!("no frame: {why}"))
            .why("without frames nothing was checked");
        return Some(finding.remedy("`tagalong inspect` lists the topics; name them in [input]"));
    }
    let lost = 1.0 - made as f64 / wanted as f64;
    let severity = match made {
        0 => Severity::Bad,
        _ => Severity::beyond(lost, 0.05, 0.5),
    };
    let is_of_scans = evidence.samples.camera.as_ref().is_some_and(|camera| camera.is_blind());
    let sources = counted(wanted, if is_of_scans { "scan" } else { "image" });
    let frames = counted(made, "frame");
    let in_log = evidence.reading.in_log;
    let measured = if wanted < in_log {
        let rest = format!("of the {in_log} in the log, see `--frames`");
        format!("{frames} of the first {sources} {rest}{}", reasons(evidence, lost))
    } else {
        format!("{frames} of {sources}{}", reasons(evidence, lost))
    };
    let finding = Finding::new("frames-read", severity, measured)
        .figure("frames", made as f64)
        .figure("wanted", wanted as f64)
        .why("no pipeline processes an image that makes no frame");
    let sentences = [&evidence.losses[..], &evidence.frameless[..]].concat();
    Some(if sentences.is_empty() { finding } else { finding.remedy(sentences.join("\n")) })
}

/// Returns the counters that explain missing frames.
fn reasons(evidence: &Evidence, lost: f64) -> String {
    if lost <= 0.0 {
        return String::new();
    }
    let counters = evidence.inspection.counters.iter();
    let telling = counters.filter(|(name, count)| is_loss(name) && **count > 0);
    let named: Vec<String> =
        telling.map(|(name, count)| format!("{} {count}", name.replace('_', " "))).collect();
    if named.is_empty() { String::new() } else { format!("; {}", named.join(", ")) }
}
