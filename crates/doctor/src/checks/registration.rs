use tagalong_vision::registration::Offset;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};
use super::depth::doubt;

/// Number of columns of the image to which the limits on offsets refer.
const USUAL_COLUMNS: f64 = 640.0;

/// Greatest error of an offset that is reported, as a fraction of the offset.
const SURE: f64 = 0.125;

/// Checks the registration of depth to colour.
pub fn registration(evidence: &Evidence) -> Option<Finding> {
    let camera = evidence.samples.camera.as_ref()?;
    let facts = &evidence.inspection.facts;
    if facts.depth_topic.is_none() || facts.colour_topic.is_none() || camera.panorama().is_some() {
        return None;
    }
    let Some(offset) = evidence.samples.overlap.offset() else {
        let why = doubt(evidence).unwrap_or("no outlines in depth to compare with colour");
        return Some(Finding::new("registration", Severity::Unknown, why));
    };
    let [dx, dy] = offset.px;
    let error = offset.error_px[0].hypot(offset.error_px[1]);
    let off = f64::from(dx).hypot(f64::from(dy));
    let scale = (camera.width as f64 / USUAL_COLUMNS).clamp(0.5, 2.0);
    // An offset near its own error is not evidence of a misregistration: with a camera near the
    // floor, outlines of the floor may have any offset along them.
    if offset.contrast < 0.25 || error > SURE * off.max(16.0 * scale) {
        let measured = format!(
            "not measurable from the outlines in depth and colour ({dx:+}, {dy:+} px, give or \
             take {error:.1})"
        );
        let finding = Finding::new("registration", Severity::Unknown, measured);
        return Some(with_figures(finding, &offset));
    }
    let limits = [3.0, 5.0].map(|px| px * scale);
    // An offset without a gain in overlap is ignored.
    let deviation = if offset.gain < 0.05 { 0.0 } else { off };
    let measured = format!(
        "depth has to be moved by {dx:+}, {dy:+} px (give or take {error:.1}) to lie on colour; {:.0} % more edges there",
        100.0 * offset.gain
    );
    let severity = Severity::beyond(deviation, limits[0], limits[1]);
    let finding = Finding::new("registration", severity, measured);
    let finding = with_figures(finding, &offset).why(
        "people get the depth of what is beside them: their boxes are shifted, and narrow objects \
         vanish",
    );
    let [x, y] = evidence.input.depth_offset_px;
    Some(finding.remedy(format!(
        "calibrate depth to colour, or\n[input] depth_offset_px = [{}, {}]",
        x + dx,
        y + dy
    )))
}

fn with_figures(finding: Finding, offset: &Offset) -> Finding {
    let [dx, dy] = offset.px;
    finding
        .figure("offset_x_px", f64::from(dx))
        .figure("offset_y_px", f64::from(dy))
        .figure("error_px", offset.error_px[0].hypot(offset.error_px[1]))
        .figure("gain", offset.gain)
        .figure("contrast", offset.contrast)
}
