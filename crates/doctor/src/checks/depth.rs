use std::sync::Arc;

use tagalong_core::DepthImage;
use tagalong_geometry::Camera;
use tagalong_math::median;
use tagalong_vision::ground::{GroundSettings, factor_of_depth, ground_of_depth, written_unit_m};
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
    let far = is_far(&quality, measured_factor);
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
                better_unit(evidence, quality.median_m, measured_factor)
            })
    } else {
        finding
            .why("people in holes, or between coarse steps, have no shape")
            .remedy("dark or shiny surfaces, sunlight, the camera's own range: look at the pictures; a stereo config may do better")
    })
}

/// Returns true if the readings, or the floor in them, tell that the unit is wrong.
fn is_far(quality: &DepthQuality, measured_factor: Option<f64>) -> bool {
    let is_off = measured_factor.is_some_and(|factor| !PLAUSIBLE_FACTORS.contains(&factor));
    !PLAUSIBLE_M.contains(&quality.median_m) || is_off
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

/// Returns the setting of the unit by which the floor lies where it is. Where the height of the camera
/// is not known, it is the unit for a camera of usual height; where no floor is seen, that by which the
/// median would be some metres.
fn better_unit(evidence: &Evidence, median_m: f64, measured_factor: Option<f64>) -> String {
    let usual = if is_float(evidence) { 1.0 } else { 0.001 };
    let unit = evidence.input.depth_unit_m.unwrap_or(usual);
    if let Some(factor) = measured_factor {
        return format!("[input] depth_unit_m = {}", written_unit_m(unit * factor));
    }
    let camera = evidence.samples.camera.as_deref();
    let by_floor = camera
        .and_then(|camera| factor_for_usual_height(&evidence.samples.depths, camera, median_m));
    if let Some(factor) = by_floor {
        return format!(
            "[input] depth_unit_m = {}\nfor a camera {USUAL_HEIGHT_M} m above the floor; that of a \
             camera of half the height is half of it",
            written_unit_m(unit * factor)
        );
    }
    let tens = (USUAL_MEDIAN_M / median_m).log10().round();
    let better = unit * 10f64.powf(tens);
    // In the short form: 0.001, not 0.0010000000000000002.
    let better = format!("{better:.9}").parse().unwrap_or(better);
    format!("[input] depth_unit_m = {better}")
}

/// Returns true for depth in floating-point numbers, which are metres by convention.
fn is_float(evidence: &Evidence) -> bool {
    let topic = evidence.inspection.facts.depth_topic.as_ref();
    let image = topic.and_then(|t| evidence.inspection.topic(t)).and_then(|t| t.image.as_ref());
    image.is_some_and(|image| image.pixels.contains("32FC1"))
}

/// Height of a camera on a robot where nothing tells it, m.
const USUAL_HEIGHT_M: f64 = 1.2;
/// Median of the depth readings of a robot's camera, m.
const USUAL_MEDIAN_M: f64 = 3.0;
/// Number of depth images by which the floor is measured.
const FLOOR_IMAGES: usize = 3;

/// Returns the factor by which depth has to be multiplied for the floor to lie as far below the camera
/// as usual; `None` if no floor is seen.
fn factor_for_usual_height(
    depths: &[Arc<DepthImage>],
    camera: &Camera,
    median_m: f64,
) -> Option<f64> {
    // The fit has tolerances in metres, and needs readings of usual size.
    let scale = USUAL_MEDIAN_M / median_m;
    let mut heights_m = Vec::new();
    for depth in depths.iter().take(FLOOR_IMAGES) {
        let scaled = DepthImage::from_fn(depth.width(), depth.height(), |x, y| {
            depth.row(y)[x] * scale as f32
        });
        let floor = ground_of_depth(&scaled, camera, &GroundSettings::default());
        heights_m.extend(floor.map(|floor| floor.height_m));
    }
    let height_m = median(heights_m)?;
    Some(scale * USUAL_HEIGHT_M / height_m)
}

/// Heights of the cameras of robots, m.
const USUAL_HEIGHTS_M: std::ops::RangeInclusive<f64> = 0.2..=2.0;

/// Returns true if the unit of depth may be wrong: the readings tell it, or nobody is found and no floor
/// lies where that of a robot does, with a camera whose height nothing else tells.
pub(super) fn is_unit_in_doubt(evidence: &Evidence) -> bool {
    let samples = &evidence.samples;
    let quality = DepthQuality::of(samples.depths.iter().map(AsRef::as_ref));
    let factor = if is_disparity(evidence) { None } else { measured_factor(evidence) };
    if quality.is_some_and(|quality| is_far(&quality, factor)) {
        return true;
    }
    let source = &evidence.inspection.facts.camera_source;
    let is_known = !evidence.is_pose_assumed() && !source.starts_with("the floor");
    let is_told = evidence.input.depth_unit_m.is_some() || is_float(evidence);
    let is_judged = is_known || is_told || is_disparity(evidence);
    if is_judged || samples.depths.is_empty() || evidence.coverage.frames_with_people > 0 {
        return false;
    }
    let is_seen = 2 * samples.floors.len() >= samples.count;
    let height_m = median(samples.floors.iter().map(|(floor, _)| floor.height_m));
    !is_seen || height_m.is_none_or(|height_m| !USUAL_HEIGHTS_M.contains(&height_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenery::testing::Room;

    #[test]
    fn the_unit_is_measured_by_a_floor_of_any_scale() {
        let item = Room::default().frame(0, 0.0);
        let camera = &item.frame.camera;
        let seen = item.frame.depth().unwrap();
        for scale in [1.0_f32, 4.0, 5.0, 8.0, 10.0, 0.1] {
            let scaled =
                DepthImage::from_fn(seen.width(), seen.height(), |x, y| seen.row(y)[x] * scale);
            let quality = DepthQuality::of([&scaled]).unwrap();
            let images = [Arc::new(scaled)];
            let factor = factor_for_usual_height(&images, camera, quality.median_m).unwrap();
            let expected = USUAL_HEIGHT_M / camera.height_m() / f64::from(scale);
            assert!((factor / expected - 1.0).abs() < 0.03, "{scale}: {factor}, not {expected}");
        }
    }
}
