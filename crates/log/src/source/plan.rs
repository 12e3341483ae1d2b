//! Decisions that are made before the first frame.

use std::collections::BTreeMap;
use std::sync::Arc;

use tagalong_core::DepthImage;
use tagalong_geometry::{Camera, ConicalMirror, Lens};
use tagalong_vision::ground::{
    Ground, GroundSettings, PLAUSIBLE_FACTORS, factor_of_depth, ground_of_depth, written_unit_m,
};

use super::assembly::{Assembly, Messages};
use super::mount::{Mount, robot_frame};
use crate::camera_info::{CalibrationError, Intrinsics, Mirrored, check_size, intrinsics};
use crate::images::StereoGeometry;
use crate::input::StampSource;
use crate::msgs::CameraInfo;
use crate::obstacles::{PlannedSource, planned_sources};
use crate::scan::{Scan, Topic, Type};
use crate::tally::Tally;
use crate::topics::{
    Chosen, InputAccount, Problem, TopicUse, choose, decide, exchanged_frames, intrinsics_of,
    kind_of, missing, told_unit, transform_odometry_problem, transform_problem, unreadable,
};
use crate::{Input, InputSettings, Inputs, Limits, LogError, MountSettings};

/// Function that starts another pass over the same messages.
pub(super) type Reread<'a> = &'a dyn Fn() -> Result<Box<dyn Messages + 'a>, LogError>;

/// All decisions about a log that are made before its first frame.
pub(super) struct Plan {
    pub(super) scan: Arc<Scan>,
    pub(super) chosen: Chosen,
    /// Use of each topic, with reasons.
    pub(super) account: InputAccount,
    /// True if messages have recording times in place of their stamps.
    pub(super) has_recording_times: bool,
    /// Metres per unit of the depth images, if it differs from the convention.
    pub(super) depth_unit_m: Option<f64>,
    pub(super) input: InputSettings,
    pub(super) limits: Limits,
    pub(super) inputs: Inputs,
    pub(super) mount: Mount,
    pub(super) lens: Option<Intrinsics>,
    depth_lens: Option<Intrinsics>,
    pub(super) baseline_m: Option<f64>,
    /// Geometry for disparity images that do not contain it.
    pub(super) disparity: Option<StereoGeometry>,
    /// Source of the odometry. `None`: no odometry. `Some(None)`: its topic. Otherwise the two
    /// frames of tf.
    pub(super) odom_frames: Option<Option<(String, String)>>,
    /// Further obstacle sources.
    pub(super) sources: Vec<PlannedSource>,
}

impl Plan {
    /// Returns the topic of the images from which the frames are made.
    pub(super) fn primary(&self) -> &str {
        self.chosen.primary()
    }

    /// Returns true for a topic whose messages are used.
    pub(super) fn reads(&self, topic: &str) -> bool {
        self.chosen.has(topic) || self.sources.iter().any(|source| source.has(topic))
    }

    /// Returns the topics of the further obstacle sources, keyed by the names of the sources.
    pub(super) fn obstacle_topics(&self) -> BTreeMap<String, String> {
        let topics = self.sources.iter().map(|source| &source.topic);
        topics.map(|source| (source.name.clone(), source.topic.clone())).collect()
    }

    /// Returns the error for a calibration that does not fit the images.
    pub(super) fn misfit(&self, source: CalibrationError) -> LogError {
        let topic = self.chosen.colour_info.clone().unwrap_or_default();
        LogError::Calibration { path: self.scan.path.clone(), topic, source }
    }

    /// Returns the topic of the calibration of the frames.
    pub(super) fn calibration_topic(&self) -> Option<&String> {
        self.lens?;
        let own = if self.chosen.colour.is_some() { &self.chosen.colour_info } else { &None };
        own.as_ref().or(self.chosen.depth_info.as_ref())
    }

    /// Returns the reason why tf has no pose of the sensor from which the frames are made: its
    /// clock.
    pub(super) fn mount_problem(&self) -> Option<Problem> {
        match &self.mount {
            Mount::Tf { base, camera } => {
                transform_problem(&self.scan, self.primary(), base, camera)
            }
            Mount::Fixed { .. } => None,
        }
    }

    /// Returns true if depth comes in addition to another image.
    pub(super) fn has_second_depth(&self) -> bool {
        self.chosen.colour.is_some() && self.chosen.depth.is_some()
    }

    /// Returns the inputs of obstacle sensors that are read besides what the frames are made of.
    pub(super) fn expected(&self) -> Inputs {
        let mut expected = Inputs::NONE;
        if self.has_second_depth() {
            expected = expected.accept(Input::Depth);
        }
        if self.chosen.sensor(Input::Laser).is_some() {
            expected = expected.accept(Input::Laser);
        }
        expected
    }

    /// Returns true if the pixels of the images from which the frames are made are used, and not
    /// only their stamps and size.
    pub(super) fn reads_primary(&self) -> bool {
        self.inputs.uses(self.primary_input())
    }

    /// Returns true if a frame is useless unless its image can be decoded.
    pub(super) fn requires_primary(&self) -> bool {
        self.inputs.requires(self.primary_input())
    }

    fn primary_input(&self) -> Input {
        match (&self.chosen.colour, &self.chosen.depth) {
            (Some(_), _) => Input::Colour,
            (None, Some(_)) => Input::Depth,
            (None, None) if self.chosen.sensor(Input::Laser).is_some() => Input::Laser,
            (None, None) => Input::POINTS,
        }
    }

    /// Returns true if the frames are made from laser scans or lidar points, because the log has no
    /// images.
    pub(super) fn is_of_scans(&self) -> bool {
        [Input::Laser, Input::POINTS].contains(&self.primary_input())
    }

    /// Returns true if the frames are made from lidar points.
    pub(super) fn is_of_points(&self) -> bool {
        self.primary_input() == Input::POINTS
    }

    /// Returns the mirror if its images are still circular.
    pub(super) fn raw_mirror(&self) -> Option<ConicalMirror> {
        match self.lens?.mirror? {
            Mirrored::Raw(mirror) => Some(mirror),
            Mirrored::Unwrapped(_) => None,
        }
    }

    /// Returns true unless both calibrations are known and differ.
    pub(super) fn same_lens(&self) -> bool {
        let (Some(colour), Some(depth)) = (self.lens, self.depth_lens) else { return true };
        let a = colour.lens;
        let b = depth.lens;
        // Calibrations of the same camera may differ slightly: by 1 % in focal length, 2 px in the
        // centre.
        (a.fx - b.fx).abs() <= 0.01 * a.fx
            && (a.fy - b.fy).abs() <= 0.01 * a.fy
            && (a.cx - b.cx).abs() <= 2.0
            && (a.cy - b.cy).abs() <= 2.0
    }

    /// Returns the camera that took a depth image, without its pose; `None` without a calibration
    /// for images of that size.
    pub(super) fn depth_camera(&self, depth: &DepthImage) -> Option<Camera> {
        let known = self.depth_lens?;
        check_size(&known, depth.width(), depth.height()).ok()?;
        Some(Camera {
            lens: Lens::Pinhole(known.lens),
            width: depth.width(),
            height: depth.height(),
            robot_from_camera: nalgebra::Isometry3::identity(),
        })
    }
}

/// Returns the counters and remarks of the first pass.
pub(super) fn tally_of(scan: &Scan) -> Tally {
    let mut tally =
        Tally { counters: scan.counters.clone(), lost: scan.data_lost, ..Tally::default() };
    scan.notes.iter().for_each(|note| tally.note_loss(note.clone()));
    if scan.counters.contains_key("chunks_without_crc") {
        tally.note("crc: absent; damage inside the chunks of this file may go unnoticed");
    }
    tally
}

/// Chooses topics, calibration and the source of the camera's pose.
///
/// # Errors
/// A calibration that cannot be used, and an input or topic that `inputs` or `input` requires but
/// the scan lacks.
pub(super) fn plan(
    scan: Arc<Scan>,
    input: &InputSettings,
    limits: &Limits,
    inputs: Inputs,
    tally: &mut Tally,
    reread: Reread<'_>,
) -> Result<Plan, LogError> {
    let (scan, has_recording_times) = timed(scan, input, inputs, tally)?;
    let decision = decide(&scan, input, inputs)?;
    let chosen = decision.chosen;
    let account = decision.account;
    let depth_lens = match lens_of(
        &scan,
        chosen.depth.as_deref(),
        chosen.depth_info.as_deref(),
        input.disparity.is_some(),
    ) {
        // Depth that is registered to colour needs no calibration of its own.
        Err(why) if chosen.colour.is_some() && !inputs.requires(Input::Depth) => {
            tally.note(format!("the calibration of the depth images is not used: {why}"));
            None
        }
        found => found?,
    };
    let lens = match lens_of(&scan, chosen.colour.as_deref(), chosen.colour_info.as_deref(), false)
    {
        _ if chosen.colour.is_none() => depth_lens,
        // Treated as a missing calibration. On a robot a driver may be about to publish another
        // one.
        Err(why) if !is_metric(inputs) && is_uncalibrated(&why) && !scan.is_live() => {
            tally.note(format!("the calibration of the images is not used: {why}"));
            None
        }
        found => found?,
    };
    let right = lens_of(&scan, chosen.right.as_deref(), chosen.right_info.as_deref(), false)?;
    let sources = if inputs.uses(Input::OBSTACLES) {
        planned_sources(&scan, input, tally)?
    } else {
        Vec::new()
    };
    let mut plan = Plan {
        mount: Mount::assumed(),
        lens: lens.or_else(|| depth_lens.filter(|_| same_frame(&scan, &chosen))),
        depth_lens,
        baseline_m: right.and_then(|right| right.baseline_m),
        disparity: None,
        odom_frames: odom_frames(&chosen),
        depth_unit_m: depth_unit_m(&scan, &chosen, input, tally),
        has_recording_times,
        scan,
        chosen,
        account,
        input: input.clone(),
        limits: limits.clone(),
        inputs,
        sources,
    };
    check_calibration(&plan, tally)?;
    plan.disparity = stereo_geometry(&plan)?;
    plan.mount = find_mount(&plan, reread)?;
    let sensor = if plan.is_of_points() {
        "lidar"
    } else if plan.is_of_scans() {
        "scanner"
    } else {
        "camera"
    };
    tally.note(format!("the pose of the {sensor} comes from {}", plan.mount.source()));
    if let Some(unit_m) = measured_unit_m(&plan, reread)? {
        take_measured_unit(&mut plan, unit_m, tally);
    }
    note_unread_images(&plan, tally);
    note_choices(&plan, tally);
    if plan.odom_frames.is_none() {
        tally.note(no_odometry(&plan));
    }
    Ok(plan)
}

/// Returns the contents with the times that are used, and true if these are recording times:
/// because the settings ask for them, or because the stamps of the frames never change.
fn timed(
    scan: Arc<Scan>,
    input: &InputSettings,
    inputs: Inputs,
    tally: &mut Tally,
) -> Result<(Arc<Scan>, bool), LogError> {
    // Live messages have no recording times.
    if input.stamps == StampSource::Header || scan.is_live() {
        return Ok((scan, false));
    }
    if input.stamps == StampSource::Auto {
        let primary = choose(&scan, input, inputs)?.primary().to_owned();
        let topic = scan.topics.get(&primary);
        let Some(topic) = topic.filter(|topic| topic.has_constant_stamps()) else {
            return Ok((scan, false));
        };
        let stamp = topic.stamps.first().copied().unwrap_or_default();
        tally.count("logs_without_stamps");
        tally.note(format!(
            "the stamps of {primary} are not set: all are {stamp}; the times of recording are used \
             instead of all stamps (`stamps = \"recording\"` under [input])"
        ));
    } else {
        tally.note("the times of recording are used instead of all stamps");
    }
    Ok((Arc::new(scan.with_recording_times()), true))
}

/// Returns a message that there is no odometry, and in which frame of tf the robot nevertheless
/// moves.
fn no_odometry(plan: &Plan) -> String {
    let at_rest = "no odometry: the robot is assumed to be at rest".to_owned();
    let tf = &plan.scan.tf;
    let robot = robot_frame(&plan.scan, &plan.input);
    let root = tf.root_of(robot);
    let moves = !tf.moving_frames(root, robot).is_empty();
    let problem = transform_odometry_problem(&plan.scan, plan.primary(), root, robot);
    if tf.knows(&plan.input.odom_frame) || !moves || problem.is_some() {
        return at_rest;
    }
    format!(
        "{at_rest}, although tf has its poses in `{root}`: `odom_frame = \"{root}\"` under [input] \
         takes them"
    )
}

/// Returns the unit of depth, if it differs from the convention: that of the settings, otherwise
/// the one that the camera publishes in the log, otherwise millimetres for grey images of 16 bits.
fn depth_unit_m(
    scan: &Scan,
    chosen: &Chosen,
    input: &InputSettings,
    tally: &mut Tally,
) -> Option<f64> {
    let name = chosen.depth.as_ref()?;
    let topic = scan.topics.get(name)?;
    let is_float = topic.pixels.as_deref().is_some_and(|pixels| pixels.starts_with("32FC1"));
    if input.depth_unit_m.is_some() || is_float || is_disparity_image(topic) {
        return input.depth_unit_m;
    }
    if topic.kind == Type::PointCloud {
        return None;
    }
    let told = told_unit(scan, name);
    if topic.is_deep_grey {
        let kind = kind_of(topic);
        let unit = match told {
            Some((from, unit_m)) => format!("{unit_m} m by {from}"),
            None => "a millimetre unless the floor shows another one, because no message states \
                     it: `depth_unit_m` under [input] sets it"
                .to_owned(),
        };
        tally.note(format!("{name} ({kind}) is taken for depth, in units of {unit}"));
    }
    told.map(|(_, unit_m)| unit_m).or(topic.is_deep_grey.then_some(MILLIMETRE))
}

/// Unit of depth by convention, m.
const MILLIMETRE: f64 = 0.001;

/// Notes which images could not be used and why, and which calibrations were found on other topics.
fn note_choices(plan: &Plan, tally: &mut Tally) {
    for entry in &plan.account.topics {
        if entry.used_as.is_some() && (entry.problem.is_some() || has_far_calibration(plan, entry))
        {
            tally.note(entry.to_string());
        }
    }
    let other = plan.account.topics.iter().find(|entry| {
        entry.used_as.is_none() && entry.camera.is_some() && entry.camera != plan.chosen.camera
    });
    if let (Some(other), Some(used)) = (other, &plan.chosen.camera) {
        let camera = other.camera.as_deref().unwrap_or_default();
        tally.note(format!(
            "the images of the camera {used} are used, those of {camera} are not: `camera = \
             \"{camera}\"` under [input] takes them"
        ));
    }
    let odometry = plan.chosen.odometry.as_deref();
    if let Some(why) = odometry.and_then(|it| exchanged_frames(&plan.scan, &plan.input, it)) {
        tally.count("odometry_with_exchanged_frames");
        tally.note(why);
    }
    for (odometry, problem) in &plan.chosen.unused_odometry {
        tally.count("odometry_not_used");
        tally.note(format!("{odometry} is not used: {}; {}", problem.why, problem.remedy));
    }
}

/// Returns true if the calibration of a topic is on another topic than usual, or of another size.
fn has_far_calibration(plan: &Plan, entry: &TopicUse) -> bool {
    let found = plan.chosen.calibrations.get(&entry.topic).map(|found| &found.topic);
    entry.calibration.as_ref() != found
}

/// Counts the images that cannot be read, if the log has no others of their kind.
fn note_unread_images(plan: &Plan, tally: &mut Tally) {
    if plan.chosen.colour.is_some() || !plan.inputs.uses(Input::Colour) {
        return;
    }
    for (name, topic) in &plan.scan.topics {
        // The pipeline would not use lidar points in place of colour.
        if topic.kind != Type::PointCloud
            && !plan.chosen.has(name)
            && let Some(why) = unreadable(topic)
        {
            tally.add("messages_not_read", topic.count);
            tally.note(format!("{name} is not read: {why}"));
        }
    }
}

fn same_frame(scan: &Scan, chosen: &Chosen) -> bool {
    let [colour, depth] =
        [&chosen.colour, &chosen.depth].map(|topic| scan.frame_of(topic.as_deref()?));
    colour.is_some() && colour == depth
}

/// Returns the calibration of an image topic, if there is one.
fn lens_of(
    scan: &Scan,
    image: Option<&str>,
    info: Option<&str>,
    is_disparity: bool,
) -> Result<Option<Intrinsics>, LogError> {
    let (Some(image), Some(topic)) = (image, info) else { return Ok(None) };
    if !scan.infos.contains_key(topic) {
        return Ok(None);
    }
    let lens = intrinsics_of(scan, image, topic, is_disparity);
    lens.map(Some).map_err(|source| LogError::Calibration {
        path: scan.path.clone(),
        topic: topic.to_owned(),
        source,
    })
}

/// Returns true for a pipeline whose positions in metres need a calibration.
fn is_metric(inputs: Inputs) -> bool {
    inputs.requires(Input::Depth) || inputs.requires(Input::Right)
}

/// Returns true for a camera without a calibration, as opposed to one with a wrong calibration.
fn is_uncalibrated(error: &LogError) -> bool {
    matches!(error, LogError::Calibration { source: CalibrationError::Uncalibrated, .. })
}

/// Returns true for disparity images, which belong to the rectified left camera.
fn is_disparity_image(topic: &Topic) -> bool {
    topic.kind == Type::DisparityImage
}

/// Returns the geometry for disparities without their own; `None` for all other depth.
///
/// # Errors
/// A log without the calibration that is needed for it.
fn stereo_geometry(plan: &Plan) -> Result<Option<StereoGeometry>, LogError> {
    let (Some(settings), Some(depth)) = (plan.input.disparity, &plan.chosen.depth) else {
        return Ok(None);
    };
    if plan.scan.topics.get(depth).is_some_and(is_disparity_image) {
        return Ok(None);
    }
    let Some(lens) = plan.depth_lens.or(plan.lens) else {
        let hint = "; name it as `depth_info_topic` under [input]".to_owned();
        return Err(missing(&plan.scan, format!("calibration of the disparities {depth}"), hint));
    };
    let Some(baseline_m) = settings.baseline_m.or_else(|| right_baseline_m(plan)) else {
        let hint = "; set `disparity.baseline_m` under [input], or name the right camera's \
                    camera_info as `right_info_topic`";
        let wanted = format!("baseline of the disparities {depth}");
        return Err(missing(&plan.scan, wanted, hint.to_owned()));
    };
    Ok(Some(StereoGeometry { focal_px: lens.lens.fx, baseline_m }))
}

/// Returns the baseline of the right camera that the settings name, or otherwise of the only one.
fn right_baseline_m(plan: &Plan) -> Option<f64> {
    if let Some(named) = &plan.chosen.right_info {
        return positive_baseline_m(plan.scan.infos.get(named)?);
    }
    let mut all = plan.scan.infos.values().filter_map(positive_baseline_m);
    all.next().filter(|_| all.next().is_none())
}

fn positive_baseline_m(info: &CameraInfo) -> Option<f64> {
    intrinsics(info, true).ok()?.baseline_m.filter(|baseline_m| *baseline_m > 0.0)
}

/// Checks that there is a calibration if positions in metres need it; a monocular pipeline works
/// without.
fn check_calibration(plan: &Plan, tally: &mut Tally) -> Result<(), LogError> {
    if plan.inputs.requires(Input::Right) && plan.baseline_m.is_none_or(|baseline| baseline <= 0.0)
    {
        let wanted = "calibration of the right camera with a positive baseline (P[3] = -fx B)";
        return Err(missing(&plan.scan, wanted.into(), baseline_hint(plan)));
    }
    if plan.inputs.requires(Input::Right)
        && let Some(baseline_m) = plan.baseline_m.filter(|it| *it > LARGEST_BASELINE_M)
    {
        let topic = plan.chosen.right_info.as_deref().unwrap_or_default();
        let wanted = "calibration of the right camera with a baseline in metres".to_owned();
        let hint = format!(
            ": by {topic} it is {baseline_m} m (P[3] = -fx B); calibrate the pair with a board that is \
             measured in metres"
        );
        return Err(missing(&plan.scan, wanted, hint));
    }
    if plan.lens.is_none() && is_metric(plan.inputs) {
        let wanted = format!("calibration (sensor_msgs/CameraInfo) of {}", plan.primary());
        let hint = if plan.scan.infos.is_empty() {
            "; record its topic with the images"
        } else {
            "; name it as `colour_info_topic` under [input]"
        };
        return Err(missing(&plan.scan, wanted, hint.to_owned()));
    }
    if plan.lens.is_none() && !plan.is_of_scans() {
        tally.note("no calibration: a lens with a field of view of 53 degrees is assumed");
    }
    Ok(())
}

/// Maximum plausible baseline of a stereo pair on a robot, m; a larger one is in another unit.
const LARGEST_BASELINE_M: f64 = 5.0;

/// Returns the remedy for a right camera whose calibration has no positive baseline.
fn baseline_hint(plan: &Plan) -> String {
    let topic = plan.chosen.right_info.as_ref();
    let info = topic.and_then(|topic| Some((topic, plan.scan.infos.get(topic)?)));
    let Some((topic, info)) = info else {
        return "; record its camera_info with the images, or name it as `right_info_topic` under \
                [input]"
            .to_owned();
    };
    let offset = info.p[3];
    format!(
        ": {topic} has P[3] = {offset}; calibrate the two cameras as a pair, the left one first"
    )
}

/// Returns the source of the odometry: its topic, or otherwise the tf frames.
fn odom_frames(chosen: &Chosen) -> Option<Option<(String, String)>> {
    if chosen.odometry.is_some() {
        return Some(None);
    }
    chosen.odom_frames.clone().map(Some)
}

/// Returns the mount from tf, from the settings, or from the floor in the first depth images.
fn find_mount(plan: &Plan, reread: Reread<'_>) -> Result<Mount, LogError> {
    let camera = plan.scan.frame_of(plan.primary());
    if plan.is_of_points() {
        // The pose in [input.camera] is that of a camera, whose axes differ.
        return Mount::of_tf(&plan.scan, camera, &plan.input).ok_or_else(|| {
            let wanted = "pose of the lidar: tf does not connect it with the robot".to_owned();
            missing(&plan.scan, wanted, "; record /tf_static with its mount".to_owned())
        });
    }
    let mirror = plan.lens.is_some_and(|lens| lens.mirror.is_some());
    if let Some(mount) = Mount::find(&plan.scan, camera, &plan.input, mirror) {
        return Ok(mount);
    }
    if plan.is_of_scans() {
        return Ok(Mount::scanner_at_origin());
    }
    match floor(plan, reread)? {
        Some(mount) => Ok(mount),
        None if plan.inputs.requires(Input::Depth) => {
            let wanted = "camera pose: tf does not connect the camera with the robot, and no \
                          floor is visible in the first depth images";
            let hint = "; give height and tilt in [input.camera]".to_owned();
            Err(missing(&plan.scan, wanted.into(), hint))
        }
        None => Ok(Mount::assumed()),
    }
}

/// Number of depth images from which the unit of depth is measured.
const UNIT_FRAMES: usize = 3;
/// Maximum ratio between the factors from different images.
const SAME_FACTOR: f64 = 1.1;

/// Returns the unit of depth with which the floor is at the distance below the camera that the
/// mount implies, if it clearly differs from the assumed unit; `None` also if the floor does not
/// determine it.
fn measured_unit_m(plan: &Plan, reread: Reread<'_>) -> Result<Option<f64>, LogError> {
    let is_set = plan.input.depth_unit_m.is_some() || plan.input.disparity.is_some();
    let topic = plan.chosen.depth.as_ref().and_then(|topic| plan.scan.topics.get(topic));
    let Some(topic) = topic else { return Ok(None) };
    if is_set || is_disparity_image(topic) || topic.kind == Type::PointCloud {
        return Ok(None);
    }
    // Every other source of the pose is measured from depth, or a guess.
    let is_known = match &plan.mount {
        Mount::Tf { .. } => true,
        Mount::Fixed { .. } => plan.input.mount().is_some(),
    };
    let has_lens = plan.lens.is_some_and(|lens| lens.mirror.is_none());
    if plan.scan.is_live() || !is_known || !has_lens || !plan.inputs.uses(Input::Depth) {
        return Ok(None);
    }
    let mut factors: Vec<f64> = Vec::new();
    let mut probe = Assembly::new(depth_probe(plan, plan.mount.clone()), Tally::default());
    let mut messages = reread()?;
    for _ in 0..UNIT_FRAMES {
        let Some(found) = probe.read(messages.as_mut()) else { break };
        let depth = found.frame.depth().ok();
        factors.extend(depth.and_then(|depth| factor_of_depth(depth, &found.frame.camera)));
    }
    factors.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (factors.first(), factors.last()) else { return Ok(None) };
    if PLAUSIBLE_FACTORS.contains(first) || last / first > SAME_FACTOR {
        return Ok(None);
    }
    let is_float = topic.pixels.as_deref().is_some_and(|pixels| pixels.starts_with("32FC1"));
    let unit_m = plan.depth_unit_m.unwrap_or(if is_float { 1.0 } else { MILLIMETRE });
    Ok(Some(written_unit_m(unit_m * factors[factors.len() / 2])))
}

/// Uses a measured unit if nothing else gives the unit. If the encoding implies another one by
/// convention, it only reports it, because only the user can overrule that.
fn take_measured_unit(plan: &mut Plan, unit_m: f64, tally: &mut Tally) {
    let name = plan.chosen.depth.clone().unwrap_or_default();
    let topic = plan.scan.topics.get(&name);
    let is_told = told_unit(&plan.scan, &name).is_some();
    let is_open = topic.is_some_and(|topic| topic.is_deep_grey) && !is_told;
    if is_open {
        plan.depth_unit_m = Some(unit_m);
        tally.note(format!(
            "the unit of {name} is assumed to be {unit_m} m, from the floor and the height of the \
             camera"
        ));
        return;
    }
    tally.count("depth_unit_doubtful");
    tally.note(format!(
        "according to the floor in {name} and the height of the camera ({}), its unit is {unit_m} \
         m: set `depth_unit_m = {unit_m}` under [input]",
        plan.mount.source()
    ));
}

/// Returns a plan that reads only depth.
fn depth_probe(plan: &Plan, mount: Mount) -> Plan {
    Plan {
        scan: Arc::clone(&plan.scan),
        chosen: plan.chosen.clone(),
        account: InputAccount::default(),
        input: plan.input.clone(),
        limits: plan.limits.clone(),
        // No other input than depth, so that nothing else is decoded.
        inputs: Inputs::NONE.require(Input::Depth),
        mount,
        odom_frames: None,
        sources: Vec::new(),
        ..*plan
    }
}

/// Number of depth images to which the floor is fitted.
const FLOOR_FRAMES: usize = 9;

/// Returns the pose of the camera above the floor: the median over the first images.
fn floor(plan: &Plan, reread: Reread<'_>) -> Result<Option<Mount>, LogError> {
    if plan.chosen.depth.is_none() || plan.lens.is_none() {
        return Ok(None);
    }
    let probe = depth_probe(plan, Mount::assumed());
    let mut probe = Assembly::new(probe, Tally::default());
    let mut messages = reread()?;
    let mut floors: Vec<Ground> = Vec::new();
    for _ in 0..FLOOR_FRAMES {
        let Some(found) = probe.read(messages.as_mut()) else { break };
        let depth = found.frame.depth().ok();
        let settings = GroundSettings::default();
        floors.extend(depth.and_then(|d| ground_of_depth(d, &found.frame.camera, &settings)));
    }
    floors.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
    Ok(floors.get(floors.len() / 2).map(|ground| {
        let mount = MountSettings {
            name: None,
            height_m: ground.height_m,
            pitch_down_deg: ground.pitch_down_rad().to_degrees(),
            roll_deg: ground.roll_rad().to_degrees(),
        };
        let source = format!("the floor fitted to the depth of {} images", floors.len());
        Mount::fixed(&mount, source)
    }))
}
