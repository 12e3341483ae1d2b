//! Checks of the lens and of the camera's pose.

use std::collections::BTreeSet;

use tagalong_config::nearest;
use tagalong_geometry::{Camera, Lens};
use tagalong_log::LogError;
use tagalong_log::camera_info::CalibrationError;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Checks that the intrinsics belong to the images.
pub fn intrinsics(evidence: &Evidence) -> Option<Finding> {
    let finding = |severity, measured: String| {
        Finding::new("intrinsics", severity, measured)
            .why("sizes and places in metres follow from the focal length")
    };
    if let Some(LogError::Calibration { topic, source, .. }) = &evidence.refusal {
        let remedy = match source {
            CalibrationError::Size { .. } => {
                "record the camera_info of this resolution, and name it:\n[input] colour_info_topic = \"...\""
            }
            _ => "record a camera_info of this camera, calibrated as in REP 104",
        };
        return Some(finding(Severity::Bad, format!("{topic}: {source}")).remedy(remedy));
    }
    let camera = evidence.samples.camera.as_ref()?;
    let Lens::Pinhole(lens) = &camera.lens else { return None };
    if evidence.inspection.facts.calibration_topic.is_none() {
        let remedy = "record its camera_info, and name it:\n[input] colour_info_topic = \"...\"";
        let measured = "none in the log: a view of 53 degrees is assumed".to_owned();
        return Some(finding(Severity::Warn, measured).remedy(remedy));
    }
    let (width, height) = (camera.width as f64, camera.height as f64);
    let view = (2.0 * (0.5 * width / lens.fx).atan()).to_degrees();
    // Half a pixel: centres of pixels have whole coordinates.
    let off = ((lens.cx + 0.5) / width - 0.5).abs().max(((lens.cy + 0.5) / height - 0.5).abs());
    let narrow = if (30.0..=130.0).contains(&view) { 0.0 } else { 1.0 };
    let severity =
        Severity::beyond(off, 0.12, 0.2).max(Severity::beyond(narrow, 1.0, f64::INFINITY));
    let measured = format!(
        "{}x{}, a view of {view:.0} degrees, centre off by {:.0} %",
        camera.width,
        camera.height,
        100.0 * off
    );
    let finding = finding(severity, measured).figure("view_deg", view).figure("centre_off", off);
    Some(finding.remedy(
        "is the camera_info of this resolution? A centre at a quarter of the image is that of half \
         the size:\n[input] colour_info_topic = \"...\"",
    ))
}

/// Checks that the frames of tf are connected, and that the camera's is an optical one.
pub fn frames(evidence: &Evidence) -> Option<Finding> {
    let (facts, tf) = (&evidence.inspection.facts, &evidence.inspection.transforms);
    let camera = evidence.samples.camera.as_ref()?;
    let name = facts.camera_frame.clone().unwrap_or_default();
    let ok = |measured: String| Some(Finding::new("frames", Severity::Ok, measured));
    if evidence.input.camera.is_some() {
        return ok("the pose of the camera comes from [input.camera]".into());
    }
    if tf.is_empty() {
        let sensor = if camera.is_blind() { "scanner" } else { "camera" };
        return ok(format!("no tf; the pose of the {sensor} comes from {}", facts.camera_source));
    }
    if !facts.camera_source.starts_with("tf") {
        return Some(cut(evidence, &name));
    }
    let (pitch, roll) = (camera.pitch_down_rad().to_degrees(), camera.roll_rad().to_degrees());
    // A body frame in place of the optical one turns the camera by 90 degrees, far beyond these
    // limits.
    let upright = pitch.abs() <= 65.0 && roll.abs() <= 45.0;
    if upright || camera.panorama().is_some() {
        return ok(format!("{} hangs below {}", name, facts.robot_frame));
    }
    let measured =
        format!("by tf the frame {name} looks {pitch:.0} degrees down, rolled by {roll:.0}");
    let finding = Finding::new("frames", Severity::Bad, measured)
        .figure("pitch_down_deg", pitch)
        .figure("roll_deg", roll)
        .why("images belong to an optical frame (REP 103: z forward, x right); this one is a body frame, or a rotation is missing");
    Some(finding.remedy(format!(
        "publish the images in the *_optical_frame, or give the pose:\n{}",
        mount_lines(evidence)
    )))
}

/// Reports that the camera's frame is not connected to the robot's.
fn cut(evidence: &Evidence, camera: &str) -> Finding {
    let (facts, tf) = (&evidence.inspection.facts, &evidence.inspection.transforms);
    let names: BTreeSet<&str> = tf.iter().flat_map(|(a, b)| [a.as_str(), b.as_str()]).collect();
    let roots: Vec<&str> = names.iter().copied().filter(|name| !tf.contains_key(*name)).collect();
    let robot = facts.robot_frame.as_str();
    let lost = if names.contains(camera) { robot } else { camera };
    let hint = nearest(lost, names.iter().copied()).filter(|near| *near != lost);
    let hint = hint.map(|near| format!(" (did you mean `{near}`?)")).unwrap_or_default();
    let measured = if names.contains(lost) {
        format!("tf falls apart into {} trees, below {}", roots.len(), roots.join(", "))
    } else {
        format!("tf does not know the frame `{lost}`{hint}; its roots are {}", roots.join(", "))
    };
    let stands_in = facts.camera_source.starts_with("the floor");
    let severity = if stands_in { Severity::Warn } else { Severity::Bad };
    let base =
        if lost == robot && names.contains(camera) { root_of(evidence, camera) } else { None };
    let remedy = match base {
        Some(root) => format!(
            "[input] base_frame = \"{root}\", if that frame is on the floor; else\n{}",
            mount_lines(evidence)
        ),
        None => format!("publish the missing transform, or\n{}", mount_lines(evidence)),
    };
    Finding::new("frames", severity, format!("{measured}; {} stands in", facts.camera_source))
        .figure("trees", roots.len() as f64)
        .why("without the transform nobody knows how high the camera is, and how it is tilted")
        .remedy(remedy)
}

/// Returns the topmost frame above one.
fn root_of(evidence: &Evidence, frame: &str) -> Option<String> {
    let tf = &evidence.inspection.transforms;
    let mut at = frame;
    // Bounded by the number of frames, because a broken tf may have a cycle.
    for _ in 0..tf.len() {
        let Some(parent) = tf.get(at) else { break };
        at = parent;
    }
    (at != frame).then(|| at.to_owned())
}

/// Returns height, pitch and roll by the floor, each the median over the frames.
fn by_floor(evidence: &Evidence) -> Option<[f64; 3]> {
    let floors = &evidence.samples.floors;
    let median = |value: &dyn Fn(usize) -> f64| {
        let mut values: Vec<f64> = (0..floors.len()).map(value).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    Some([
        median(&|i| floors[i].0.height_m)?,
        median(&|i| floors[i].0.pitch_down_rad().to_degrees())?,
        median(&|i| floors[i].0.roll_rad().to_degrees())?,
    ])
}

/// Returns the settings for the camera's pose, by the floor where it is visible.
fn mount_lines(evidence: &Evidence) -> String {
    match by_floor(evidence) {
        Some([height, pitch, roll]) => format!(
            "[input.camera]\nheight_m = {height:.2}\npitch_down_deg = {pitch:.1}\nroll_deg = {roll:.1}"
        ),
        None => "[input.camera]\nheight_m = 1.2  # measure it\npitch_down_deg = 0.0".into(),
    }
}

/// Checks that the floor is visible.
pub fn floor(evidence: &Evidence) -> Option<Finding> {
    let (found, tried) = (evidence.samples.floors.len(), evidence.samples.depths.len());
    let camera = evidence.samples.camera.as_ref()?;
    if tried == 0 || camera.panorama().is_some() {
        return None;
    }
    let share = found as f64 / evidence.samples.count as f64;
    let severity = if share > 0.3 { Severity::Ok } else { Severity::Unknown };
    let measured = format!("found in {found} of {} frames", evidence.samples.count);
    Some(Finding::new("floor", severity, measured).figure("share", share))
}

/// Checks that height and tilt of the camera agree with the visible floor.
pub fn mount(evidence: &Evidence) -> Option<Finding> {
    let floors = &evidence.samples.floors;
    // A pose that comes from the floor itself would always agree with it.
    if evidence.inspection.facts.camera_source.starts_with("the floor")
        || floors.len() < 3.min(evidence.samples.count)
    {
        return None;
    }
    let median = |value: &dyn Fn(&Camera, usize) -> f64| {
        let mut values: Vec<f64> =
            floors.iter().enumerate().map(|(i, (_, c))| value(c, i)).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    let height = median(&|camera, i| floors[i].0.height_m - camera.height_m())?;
    let pitch =
        median(&|camera, i| (floors[i].0.pitch_down_rad() - camera.pitch_down_rad()).to_degrees())?;
    let roll = median(&|camera, i| (floors[i].0.roll_rad() - camera.roll_rad()).to_degrees())?;
    let [seen, ..] = by_floor(evidence)?;
    let told = seen - height;
    let severity = Severity::beyond(height.abs(), 0.12, 0.3)
        .max(Severity::beyond(pitch.abs(), 3.0, 6.0))
        .max(Severity::beyond(roll.abs(), 3.0, 6.0));
    let measured = format!(
        "{told:.2} m high by {}; by the floor {height:+.2} m, {pitch:+.1} degrees further down, {roll:+.1} of roll",
        evidence.inspection.facts.camera_source
    );
    let finding = Finding::new("mount", severity, measured)
        .figure("height_off_m", height)
        .figure("pitch_off_deg", pitch)
        .figure("roll_off_deg", roll)
        .why("heads are looked for at the height of heads above the floor");
    // A wrong unit of depth scales the height and leaves the angles as they are.
    let scaled = pitch.abs() < 3.0 && roll.abs() < 3.0 && !(0.7..1.4).contains(&(seen / told));
    Some(finding.remedy(if scaled {
        format!(
            "the tilt agrees and the height does not: depth may be in another unit, {:.3} of what is \
             taken:\n[input] depth_unit_m = ...\nelse\n{}",
            told / seen,
            mount_lines(evidence)
        )
    } else {
        mount_lines(evidence)
    }))
}
