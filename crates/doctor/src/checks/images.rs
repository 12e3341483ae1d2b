//! Checks of the light, the depth readings, and the registration of depth to colour.

use tagalong_vision::quality::DepthQuality;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Share of black, or of white, above which an image is useless.
const BLIND: f64 = 0.9;

/// Checks the exposure.
pub fn exposure(evidence: &Evidence) -> Option<Finding> {
    let all = &evidence.samples.exposures;
    if all.is_empty() {
        return None;
    }
    let count = all.len() as f64;
    let mean = |value: fn(&tagalong_vision::quality::Exposure) -> f64| {
        all.iter().map(value).sum::<f64>() / count
    };
    let blind = all.iter().filter(|e| e.black.max(e.white) > BLIND || e.contrast < 3.0).count();
    let (black, white) = (mean(|e| e.black), mean(|e| e.white));
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
        .why("nobody can be seen where an image is black or white");
    let remedy = if black >= white {
        "expose longer: lens cap, driver, auto exposure?"
    } else {
        "expose shorter, or turn away from the light"
    };
    Some(finding.remedy(remedy))
}

/// Plausible median of the depth readings of a robot's camera, m.
const PLAUSIBLE_M: std::ops::RangeInclusive<f64> = 0.6..=15.0;

/// Checks unit, scale, holes and steps of depth.
pub fn depth(evidence: &Evidence) -> Option<Finding> {
    evidence.inspection.facts.depth_topic.as_ref()?;
    let images = &evidence.samples.depths;
    if images.is_empty() {
        return None;
    }
    let Some(quality) = DepthQuality::of(images.iter().map(AsRef::as_ref)) else {
        let finding = Finding::new("depth", Severity::Bad, "not one pixel has a reading")
            .why("without depth nobody has a place");
        return Some(finding.remedy(
            "is the depth camera switched on? which topic is it? [input] depth_topic = \"...\"",
        ));
    };
    let far = !PLAUSIBLE_M.contains(&quality.median_m);
    let step = quality.step_m.unwrap_or(0.0);
    // The steps of stereo depth grow with the square of the distance.
    let coarse = step / quality.median_m.powi(2).max(0.1);
    let severity = Severity::beyond(if far { 1.0 } else { 0.0 }, 0.5, 0.5)
        .max(Severity::beyond(quality.without, 0.6, 0.9))
        .max(Severity::beyond(coarse, 0.02, 0.1));
    let measured = format!(
        "median {:.2} m, {:.0} % without a reading, steps of {:.1} mm",
        quality.median_m,
        100.0 * quality.without,
        1e3 * step
    );
    let finding = Finding::new("depth", severity, measured)
        .figure("median_m", quality.median_m)
        .figure("without", quality.without)
        .figure("step_m", step);
    Some(if far {
        finding
            .why("people are looked for between half a metre and some metres: the unit is wrong")
            .remedy(format!("[input] depth_unit_m = {}", better_unit(evidence, quality.median_m)))
    } else {
        finding
            .why("people in holes, or between coarse steps, have no shape")
            .remedy("dark or shiny surfaces, sunlight, the camera's own range: look at the pictures; a stereo config may do better")
    })
}

/// Returns the unit by which the median would be some metres: a power of ten times the present one.
fn better_unit(evidence: &Evidence, median_m: f64) -> f64 {
    let topic = evidence.inspection.facts.depth_topic.as_ref();
    let image = topic.and_then(|t| evidence.inspection.topic(t)).and_then(|t| t.image.as_ref());
    let usual = if image.is_some_and(|image| image.pixels.contains("32FC1")) { 1.0 } else { 0.001 };
    let unit = evidence.input.depth_unit_m.unwrap_or(usual);
    let tens = (3.0 / median_m).log10().round();
    let better = unit * 10f64.powf(tens);
    // In the short form: 0.001, not 0.0010000000000000002.
    format!("{better:.9}").parse().unwrap_or(better)
}

/// Columns of the image that the limits on offsets refer to.
const USUAL_COLUMNS: f64 = 640.0;

/// Checks the registration of depth to colour.
pub fn registration(evidence: &Evidence) -> Option<Finding> {
    let camera = evidence.samples.camera.as_ref()?;
    let facts = &evidence.inspection.facts;
    if facts.depth_topic.is_none() || facts.colour_topic.is_none() || camera.panorama().is_some() {
        return None;
    }
    let unknown = |why: &str| Some(Finding::new("registration", Severity::Unknown, why));
    let Some(offset) = evidence.samples.overlap.offset() else {
        return unknown("no outlines in depth to compare with colour");
    };
    let [dx, dy] = offset.px;
    let error = offset.error_px[0].hypot(offset.error_px[1]);
    let figures = |finding: Finding| {
        finding
            .figure("offset_x_px", f64::from(dx))
            .figure("offset_y_px", f64::from(dy))
            .figure("error_px", error)
            .figure("gain", offset.gain)
            .figure("contrast", offset.contrast)
    };
    let off = f64::from(dx).hypot(f64::from(dy));
    let scale = (camera.width as f64 / USUAL_COLUMNS).clamp(0.5, 2.0);
    // An offset within its own error is no evidence of a misregistration.
    if offset.contrast < 0.25 || error > 0.5 * off.max(4.0 * scale) {
        let measured = format!(
            "outlines in depth and colour do not tell ({dx:+}, {dy:+} px, give or take {error:.1})"
        );
        return unknown(&measured).map(figures);
    }
    let limits = [3.0, 5.0].map(|px| px * scale);
    // An offset without a gain in overlap is ignored.
    let deviation = if offset.gain < 0.05 { 0.0 } else { off };
    let measured = format!(
        "depth has to be moved by {dx:+}, {dy:+} px (give or take {error:.1}) to lie on colour; {:.0} % more edges there",
        100.0 * offset.gain
    );
    let severity = Severity::beyond(deviation, limits[0], limits[1]);
    let finding = figures(Finding::new("registration", severity, measured)).why(
        "people have the depth of what is beside them: their boxes slip, and narrow things vanish",
    );
    let [x, y] = evidence.input.depth_offset_px;
    Some(finding.remedy(format!(
        "calibrate depth to colour, or\n[input] depth_offset_px = [{}, {}]",
        x + dx,
        y + dy
    )))
}
