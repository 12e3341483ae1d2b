use tagalong_vision::ground::{factor_of_depth, written_unit_m};
use tagalong_vision::quality::DepthQuality;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

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
    let is_disparity = is_disparity(evidence);
    let measured_factor = if is_disparity { None } else { measured_factor(evidence) };
    let is_off = measured_factor.is_some_and(|factor| !PLAUSIBLE_FACTORS.contains(&factor));
    let far = !PLAUSIBLE_M.contains(&quality.median_m) || is_off;
    let step = quality.step_m.unwrap_or(0.0);
    // The steps of stereo depth grow with the square of the distance.
    let coarse = step / quality.median_m.powi(2).max(0.1);
    let severity = Severity::beyond(if far { 1.0 } else { 0.0 }, 0.5, 0.5)
        .max(Severity::beyond(quality.without, 0.6, 0.9))
        .max(Severity::beyond(coarse, 0.02, 0.1));
    let by_floor = measured_factor.map_or_else(String::new, |factor| {
        format!(
            ", the floor at {:.2} of the distance that the height of the camera says",
            1.0 / factor
        )
    });
    let measured = format!(
        "median {:.2} m, {:.0} % without a reading, steps of {:.1} mm{by_floor}",
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
            .remedy(if is_disparity {
                better_geometry(quality.median_m)
            } else {
                format!(
                    "[input] depth_unit_m = {}",
                    better_unit(evidence, quality.median_m, measured_factor)
                )
            })
    } else {
        finding
            .why("people in holes, or between coarse steps, have no shape")
            .remedy("dark or shiny surfaces, sunlight, the camera's own range: look at the pictures; a stereo config may do better")
    })
}

/// Returns true if depth comes from disparities.
fn is_disparity(evidence: &Evidence) -> bool {
    evidence.inspection.counters.contains_key("disparity_pixels")
}

/// Returns the remedy for disparities in a wrong unit, or with a wrong baseline.
fn better_geometry(median_m: f64) -> String {
    let factor = median_m / 3.0;
    format!(
        "the unit of the disparities or the baseline is off by a factor of about {factor:.2}: \
         [input.disparity] unit_px (0.0625 for sixteenths), baseline_m; or correct f and T of the \
         messages"
    )
}

/// Factors of the unit that may come from a mount that is not quite right.
const PLAUSIBLE_FACTORS: std::ops::RangeInclusive<f64> = 0.6..=1.7;

/// Returns the factor by which depth has to be multiplied for the floor to lie as far below the camera
/// as its mount says; `None` where the mount is not known, or too little floor is seen.
fn measured_factor(evidence: &Evidence) -> Option<f64> {
    let source = &evidence.inspection.facts.camera_source;
    if evidence.is_pose_assumed() || source.starts_with("the floor") {
        return None;
    }
    let camera = evidence.samples.camera.as_ref()?;
    let factors = evidence.samples.depths.iter().filter_map(|depth| factor_of_depth(depth, camera));
    let mut factors: Vec<f64> = factors.collect();
    factors.sort_by(f64::total_cmp);
    factors.get(factors.len() / 2).copied()
}

/// Returns the unit by which the floor lies where it is. Where it is not seen, that by which the
/// median would be some metres: a power of ten times the present one.
fn better_unit(evidence: &Evidence, median_m: f64, measured_factor: Option<f64>) -> f64 {
    let topic = evidence.inspection.facts.depth_topic.as_ref();
    let image = topic.and_then(|t| evidence.inspection.topic(t)).and_then(|t| t.image.as_ref());
    let usual = if image.is_some_and(|image| image.pixels.contains("32FC1")) { 1.0 } else { 0.001 };
    let unit = evidence.input.depth_unit_m.unwrap_or(usual);
    if let Some(factor) = measured_factor {
        return written_unit_m(unit * factor);
    }
    let tens = (3.0 / median_m).log10().round();
    let better = unit * 10f64.powf(tens);
    // In the short form: 0.001, not 0.0010000000000000002.
    format!("{better:.9}").parse().unwrap_or(better)
}
