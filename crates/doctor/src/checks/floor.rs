use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Checks that the floor is visible.
pub fn floor(evidence: &Evidence) -> Option<Finding> {
    let found = evidence.samples.floors.len();
    let tried = evidence.samples.depths.len();
    let camera = evidence.samples.camera.as_ref()?;
    if tried == 0 || camera.panorama().is_some() {
        return None;
    }
    let share = found as f64 / evidence.samples.count as f64;
    let severity = if share > 0.3 { Severity::Ok } else { Severity::Unknown };
    let measured = format!("found in {found} of {} frames", evidence.samples.count);
    Some(Finding::new("floor", severity, measured).figure("share", share))
}
