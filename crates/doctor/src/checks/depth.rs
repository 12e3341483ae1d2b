use std::sync::Arc;

use tagalong_core::DepthImage;
use tagalong_geometry::Camera;
use tagalong_math::median;
use tagalong_vision::ground::{
    Ground, GroundSettings, ROBOT_HEIGHTS_M, factor_of_depth, ground_of_depth, written_unit_m,
};
use tagalong_vision::quality::DepthQuality;

use super::super::depth_unit::{JudgedDepth, Unit};
use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Usual range of the median of the depth readings of a robot's camera, m.
const PLAUSIBLE_M: std::ops::RangeInclusive<f64> = 0.6..=15.0;
/// Plausible range of the median of the depth readings of a camera in any room, or in front of any
/// object, m.
const POSSIBLE_M: std::ops::RangeInclusive<f64> = 0.1..=60.0;

/// Checks the unit, scale, holes and steps of depth.
pub fn depth(evidence: &Evidence) -> Option<Finding> {
    evidence.inspection.facts.depth_topic.as_ref()?;
    let images = &evidence.samples.depths;
    if images.is_empty() {
        return None;
    }
    let Some(JudgedDepth { quality, measured_factor, unit }) = judged(evidence) else {
        let finding = Finding::new("depth", Severity::Bad, "no pixel has a reading")
            .why("without depth people have no position");
        return Some(finding.remedy(
            "check that the depth camera is on, and name its topic: [input] depth_topic = \"...\"",
        ));
    };
    let is_disparity = is_disparity(evidence);
    let step = quality.step_m.unwrap_or(0.0);
    // The steps of stereo depth grow with the square of the distance.
    let coarse = step / quality.median_m.powi(2).max(0.1);
    let severity = unit
        .severity()
        .max(Severity::beyond(quality.without, 0.6, 0.9))
        .max(Severity::beyond(coarse, 0.02, 0.1));
    let by_floor = match (measured_factor, unit) {
        (Some(factor), _) => format!(
            ", the floor at {:.2} of the distance that follows from the height of the camera",
            1.0 / factor
        ),
        (None, Unit::OffFloor(floor) | Unit::NearFloor(floor)) => {
            let height_m = floor.height_m;
            format!(", the floor {height_m:.2} m below the camera by these readings")
        }
        (None, _) => String::new(),
    };
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
    Some(match *unit {
        Unit::Plausible | Unit::NearFloor(_) => finding
            .why("people have no shape where readings are missing or their steps are coarse")
            .remedy("dark or shiny surfaces, sunlight, the camera's own range: look at the pictures; a stereo config may do better"),
        Unit::Unusual | Unit::OffMedian if is_disparity => finding
            .why("people are looked for between half a metre and some metres: the unit may be wrong")
            .remedy(better_geometry(quality.median_m)),
        Unit::Measured(factor) => finding
            .why("the floor contradicts the height of the camera: the unit is wrong")
            .remedy(format!(
                "[input] depth_unit_m = {}",
                written_unit_m(taken_unit_m(evidence) * factor)
            )),
        Unit::OffFloor(floor) => finding
            .why("no robot has its camera this far above the floor: the unit is wrong")
            .remedy(units_by_height(taken_unit_m(evidence), &floor)),
        Unit::OffMedian => finding
            .why("no room has its surfaces this near or this far: the unit is wrong")
            .remedy(unit_by_median(taken_unit_m(evidence), quality.median_m)),
        Unit::Unusual => finding
            .why("people are looked for between half a metre and some metres: the unit may be wrong")
            .remedy(UNIT_BY_THING),
    })
}

/// Returns the assessment of depth; `None` if no pixel has a reading. It is made once, because
/// several checks need it and its fits of the floor are slow.
fn judged(evidence: &Evidence) -> Option<&JudgedDepth> {
    evidence.depth.get_or_init(|| judge(evidence)).as_ref()
}

/// Returns the reason for which depth without outlines and shapes tells nothing; `None` where it is used, in
/// a unit that nothing speaks against.
pub fn doubt(evidence: &Evidence) -> Option<&'static str> {
    if evidence.samples.depths.is_empty() {
        return Some("not known: the depth is not used");
    }
    let Some(judged) = judged(evidence) else { return Some("not known: depth has no reading") };
    let is_doubtful = judged.unit.severity() >= Severity::Warn;
    is_doubtful.then_some("not known: the unit of depth is in doubt")
}

fn judge(evidence: &Evidence) -> Option<JudgedDepth> {
    let quality = DepthQuality::of(evidence.samples.depths.iter().map(AsRef::as_ref))?;
    let factor = if is_disparity(evidence) { None } else { measured_factor(evidence) };
    let unit = unit_by(evidence, &quality, factor);
    Some(JudgedDepth { quality, measured_factor: factor, unit })
}

/// Assesses the unit by the floor, or by the median of the readings if no floor is visible.
fn unit_by(evidence: &Evidence, quality: &DepthQuality, measured_factor: Option<f64>) -> Unit {
    if let Some(factor) = measured_factor {
        return Unit::by_factor(factor);
    }
    if PLAUSIBLE_M.contains(&quality.median_m) {
        return Unit::Plausible;
    }
    let camera = evidence.samples.camera.as_deref().filter(|_| !is_disparity(evidence));
    let floor =
        camera.and_then(|camera| floor_of(&evidence.samples.depths, camera, quality.median_m));
    match (floor, camera) {
        (Some(floor), Some(camera)) if is_height_known(evidence) && floor.has_tilt_of(camera) => {
            Unit::by_factor(camera.height_m() / floor.height_m)
        }
        (Some(floor), _) if ROBOT_HEIGHTS_M.contains(&floor.height_m) => Unit::NearFloor(floor),
        (Some(floor), _) => Unit::OffFloor(floor),
        (None, _) if POSSIBLE_M.contains(&quality.median_m) => Unit::Unusual,
        (None, _) => Unit::OffMedian,
    }
}

/// Returns true if depth is computed from disparities.
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

/// Returns true if the height of the camera is known without depth, and is plausible for a robot.
fn is_height_known(evidence: &Evidence) -> bool {
    let source = &evidence.inspection.facts.camera_source;
    let camera = evidence.samples.camera.as_ref();
    !evidence.is_pose_assumed()
        && !source.starts_with("the floor")
        && camera.is_some_and(|camera| ROBOT_HEIGHTS_M.contains(&camera.height_m()))
}

/// Returns the factor by which depth has to be multiplied so that the distance of the floor below
/// the camera agrees with its mount; `None` if the mount is unknown, or too little floor is
/// visible.
fn measured_factor(evidence: &Evidence) -> Option<f64> {
    if !is_height_known(evidence) {
        return None;
    }
    let camera = evidence.samples.camera.as_ref()?;
    let factors = evidence.samples.depths.iter().filter_map(|depth| factor_of_depth(depth, camera));
    let mut factors: Vec<f64> = factors.collect();
    factors.sort_by(f64::total_cmp);
    factors.get(factors.len() / 2).copied()
}

/// Returns the unit in use, m.
fn taken_unit_m(evidence: &Evidence) -> f64 {
    let usual = if is_float(evidence) { 1.0 } else { 0.001 };
    evidence.input.depth_unit_m.unwrap_or(usual)
}

/// Units of depth cameras, m.
const USUAL_UNITS_M: [f64; 8] = [1.0, 0.01, 0.001, 0.0005, 0.00025, 0.0002, 0.000125, 0.0001];

/// Returns the remedy for a distance of the floor with the unit in use, m, if the height of the
/// camera is unknown: each possible unit with the height that follows from it.
fn units_by_height(taken_m: f64, floor: &Ground) -> String {
    let height_m = floor.height_m;
    let mut follows: Vec<String> = Vec::new();
    for unit_m in USUAL_UNITS_M {
        let camera_m = height_m * unit_m / taken_m;
        if ROBOT_HEIGHTS_M.contains(&camera_m) {
            follows.push(format!("{unit_m} for a camera {camera_m:.2} m above the floor"));
        }
    }
    if follows.is_empty() {
        let metre = written_unit_m(taken_m / height_m);
        follows.push(format!("{metre} for each metre of its height above the floor"));
    }
    format!(
        "give the height of the camera, so that the unit follows from the floor:\n[input.camera]\n\
         height_m = ...  # measure it\npitch_down_deg = {:.1}\nroll_deg = {:.1}\n\
         or the unit, [input] depth_unit_m = {}",
        floor.pitch_down_rad().to_degrees(),
        floor.roll_rad().to_degrees(),
        follows.join(", ")
    )
}

/// Returns the remedy for implausible readings without a visible floor: the power of ten with which
/// they become a few metres.
fn unit_by_median(taken_m: f64, median_m: f64) -> String {
    let tens = (USUAL_MEDIAN_M / median_m).log10().round();
    let better = written_unit_m(taken_m * 10f64.powf(tens));
    format!(
        "[input] depth_unit_m = {better}\nwhich puts half of the readings within {:.1} m; no floor is \
         visible from which the unit would follow more exactly",
        median_m * 10f64.powf(tens)
    )
}

/// Remedy if the unit cannot be determined.
const UNIT_BY_THING: &str = "is the scene really this near or this far? if not, set [input] \
     depth_unit_m, in metres per unit; no floor is visible from which it would follow";

/// Returns true for depth in floating-point numbers, which is in metres by convention.
fn is_float(evidence: &Evidence) -> bool {
    let topic = evidence.inspection.facts.depth_topic.as_ref();
    let image = topic.and_then(|t| evidence.inspection.topic(t)).and_then(|t| t.image.as_ref());
    image.is_some_and(|image| image.pixels.contains("32FC1"))
}

/// Median of the depth readings of a robot's camera, m.
const USUAL_MEDIAN_M: f64 = 3.0;
/// Number of depth images in which the floor is measured.
const FLOOR_IMAGES: usize = 3;

/// Returns the floor below the camera; `None` if none is visible.
fn floor_of(depths: &[Arc<DepthImage>], camera: &Camera, median_m: f64) -> Option<Ground> {
    // The fit has tolerances in metres, and needs readings of usual size.
    let scale = USUAL_MEDIAN_M / median_m;
    let mut floors = Vec::new();
    for depth in depths.iter().take(FLOOR_IMAGES) {
        let scaled = DepthImage::from_fn(depth.width(), depth.height(), |x, y| {
            depth.row(y)[x] * scale as f32
        });
        let floor = ground_of_depth(&scaled, camera, &GroundSettings::default());
        floors.extend(floor.map(|floor| Ground { height_m: floor.height_m / scale, ..floor }));
    }
    floors.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
    floors.get(floors.len() / 2).copied()
}

/// Returns true if the unit of depth may be wrong: either the readings indicate it, or no person is
/// found, the height of the camera is unknown, and no floor is at a plausible distance for a robot.
pub(super) fn is_unit_in_doubt(evidence: &Evidence) -> bool {
    let samples = &evidence.samples;
    if judged(evidence).is_some_and(|judged| judged.unit.severity() > Severity::Ok) {
        return true;
    }
    let is_told = evidence.input.depth_unit_m.is_some() || is_float(evidence);
    let is_judged = is_height_known(evidence) || is_told || is_disparity(evidence);
    if is_judged || samples.depths.is_empty() || evidence.coverage.frames_with_people > 0 {
        return false;
    }
    let is_seen = 2 * samples.floors.len() >= samples.count;
    let height_m = median(samples.floors.iter().map(|(floor, _)| floor.height_m));
    !is_seen || height_m.is_none_or(|height_m| !ROBOT_HEIGHTS_M.contains(&height_m))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

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
            let height_m = floor_of(&images, camera, quality.median_m).unwrap().height_m;
            let expected_m = camera.height_m() * f64::from(scale);
            assert!((height_m / expected_m - 1.0).abs() < 0.03, "{scale}: {height_m}");
        }
    }

    /// Returns the floor below a camera that looks down by 30 degrees.
    fn floor(height_m: f64) -> Ground {
        let up_in_camera = Vector3::new(0.0, -0.75_f64.sqrt(), -0.5);
        Ground { up_in_camera, height_m, inliers: 0.5 }
    }

    #[test]
    fn an_unknown_height_tells_which_unit_follows_from_which_height() {
        let told = units_by_height(0.001, &floor(12.0));
        assert!(told.contains("[input.camera]\nheight_m"), "{told}");
        assert!(told.contains("pitch_down_deg = 30.0\nroll_deg = 0.0"), "{told}");
        for follows in ["0.0001 for a camera 1.20 m above", "0.0002 for a camera 2.40 m above"] {
            assert!(told.contains(follows), "{told}");
        }
        assert!(!told.contains("0.001 for") && !told.contains("0.00025 for"), "{told}");
        let other = units_by_height(0.001, &floor(1e6));
        assert!(other.contains("0.000000001 for each metre"), "{other}");
    }

    #[test]
    fn a_unit_by_the_median_alone_is_a_power_of_ten() {
        let told = unit_by_median(0.001, 350.0);
        assert!(told.starts_with("[input] depth_unit_m = 0.00001\nwhich puts half"), "{told}");
        assert!(told.contains("within 3.5 m; no floor is visible"), "{told}");
    }
}
