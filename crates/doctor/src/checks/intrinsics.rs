use tagalong_geometry::Lens;
use tagalong_log::LogError;
use tagalong_log::camera_info::CalibrationError;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Checks that the intrinsics belong to the images.
pub fn intrinsics(evidence: &Evidence) -> Option<Finding> {
    if let Some(LogError::Calibration { topic, source, .. }) = &evidence.refusal {
        let remedy = match source {
            CalibrationError::Size { .. } => {
                "record the camera_info of this resolution, and name it:\n[input] colour_info_topic = \"...\""
            }
            _ => "record a camera_info of this camera, calibrated as in REP 104",
        };
        let measured = format!("{topic}: {source}");
        return Some(about_lens(Severity::Bad, measured).remedy(remedy));
    }
    let camera = evidence.samples.camera.as_ref()?;
    let Lens::Pinhole(lens) = &camera.lens else { return None };
    if evidence.is_lens_assumed() {
        let remedy = "record its camera_info, and name it:\n[input] colour_info_topic = \"...\"";
        let measured = "none in the log: a field of view of 53 degrees is assumed".to_owned();
        return Some(about_lens(Severity::Warn, measured).remedy(remedy));
    }
    let width = camera.width as f64;
    let height = camera.height as f64;
    let view = (2.0 * (0.5 * width / lens.fx).atan()).to_degrees();
    // Half a pixel: centres of pixels have whole coordinates.
    let off = ((lens.cx + 0.5) / width - 0.5).abs().max(((lens.cy + 0.5) / height - 0.5).abs());
    let narrow = if (30.0..=130.0).contains(&view) { 0.0 } else { 1.0 };
    let severity =
        Severity::beyond(off, 0.12, 0.2).max(Severity::beyond(narrow, 1.0, f64::INFINITY));
    let measured = format!(
        "{}x{}, a field of view of {view:.0} degrees, centre off by {:.0} %",
        camera.width,
        camera.height,
        100.0 * off
    );
    let finding = about_lens(severity, measured).figure("view_deg", view).figure("centre_off", off);
    Some(finding.remedy(
        "is the camera_info of this resolution? A centre at a quarter of the image is that of half \
         the size:\n[input] colour_info_topic = \"...\"",
    ))
}

/// Returns a finding on the intrinsics, with their effect.
fn about_lens(severity: Severity, measured: String) -> Finding {
    Finding::new("intrinsics", severity, measured)
        .why("sizes and positions in metres follow from the focal length")
}
