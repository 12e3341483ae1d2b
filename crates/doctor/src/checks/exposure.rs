use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Share of black or of white pixels above which an image is useless.
const BLIND: f64 = 0.9;

/// Checks the exposure.
pub fn exposure(evidence: &Evidence) -> Option<Finding> {
    let all = &evidence.samples.exposures;
    if all.is_empty() {
        return None;
    }
    let count = all.len() as f64;
    let blind = all.iter().filter(|e| e.black.max(e.white) > BLIND || e.contrast < 3.0).count();
    let black = all.iter().map(|e| e.black).sum::<f64>() / count;
    let white = all.iter().map(|e| e.white).sum::<f64>() / count;
    let severity = Severity::beyond(blind as f64 / count, 0.05, 0.5)
        .max(Severity::beyond(black, 0.5, 0.8))
        .max(Severity::beyond(white, 0.25, 0.6));
    let measured = format!(
        "{:.0} % black, {:.0} % saturated; {blind} of {} images show nothing",
        100.0 * black,
        100.0 * white,
        all.len()
    );
    let finding = Finding::new("exposure", severity, measured)
        .figure("black", black)
        .figure("saturated", white)
        .figure("blind_images", blind as f64)
        .why("people are invisible where an image is black or white");
    let remedy = if black >= white {
        "expose longer: check lens cap, driver and auto exposure"
    } else {
        "expose shorter, or turn away from the light"
    };
    Some(finding.remedy(remedy))
}
