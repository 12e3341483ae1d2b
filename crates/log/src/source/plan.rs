//! Decisions before the first frame.

use std::collections::BTreeMap;
use std::sync::Arc;

use tagalong_core::DepthImage;
use tagalong_geometry::{Camera, ConicalMirror, Lens};
use tagalong_vision::ground::{Ground, GroundSettings, ground_of_depth};

use super::assembly::{Assembly, Messages};
use super::mount::{Mount, robot_frame};
use crate::camera_info::{CalibrationError, Intrinsics, Mirrored, check_size, intrinsics};
use crate::images::StereoGeometry;
use crate::obstacles::{PlannedSource, planned_sources};
use crate::scan::{Scan, Topic, Type};
use crate::tally::Tally;
use crate::topics::{Chosen, choose, missing, unreadable};
use crate::{Input, InputSettings, Inputs, Limits, LogError, MountSettings};

/// Function that starts another pass over the same messages.
pub(super) type Reread<'a> = &'a dyn Fn() -> Result<Box<dyn Messages + 'a>, LogError>;

/// All decisions about a log that are made before its first frame.
pub(super) struct Plan {
    pub(super) scan: Arc<Scan>,
    pub(super) chosen: Chosen,
    pub(super) input: InputSettings,
    pub(super) limits: Limits,
    pub(super) inputs: Inputs,
    pub(super) mount: Mount,
    pub(super) lens: Option<Intrinsics>,
    depth_lens: Option<Intrinsics>,
    pub(super) baseline_m: Option<f64>,
    /// Geometry of depth images that are disparities without one of their own.
    pub(super) disparity: Option<StereoGeometry>,
    /// Source of the odometry. `None`: no odometry. `Some(None)`: its topic. Else the two frames of
    /// tf.
    pub(super) odom_frames: Option<Option<(String, String)>>,
    /// Further sources of obstacles.
    pub(super) sources: Vec<PlannedSource>,
}

impl Plan {
    /// Returns the topic of the images that make the frames.
    pub(super) fn primary(&self) -> &str {
        primary(&self.chosen)
    }

    /// Returns true for a topic whose messages are used.
    pub(super) fn reads(&self, topic: &str) -> bool {
        self.chosen.has(topic) || self.sources.iter().any(|source| source.topic.topic == topic)
    }

    /// Returns the topics of the further sources of obstacles, by the names of the sources.
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

    /// Returns true if depth comes beside another image.
    pub(super) fn has_second_depth(&self) -> bool {
        self.chosen.colour.is_some() && self.chosen.depth.is_some()
    }

    /// Returns true if the pixels of the images that make the frames are used, and not only their
    /// stamps and their size.
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
            (None, None) => Input::Laser,
        }
    }

    /// Returns true if laser scans make the frames, because the log has no images.
    pub(super) fn is_of_scans(&self) -> bool {
        self.primary_input() == Input::Laser
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
        let (a, b) = (colour.lens, depth.lens);
        let close = |a: f64, b: f64, off: f64| (a - b).abs() <= off;
        // Calibrations of one camera may differ slightly: by 1 % in focal length, 2 px in the
        // centre.
        close(a.fx, b.fx, 0.01 * a.fx)
            && close(a.fy, b.fy, 0.01 * a.fy)
            && close(a.cx, b.cx, 2.0)
            && close(a.cy, b.cy, 2.0)
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

fn primary(chosen: &Chosen) -> &str {
    let images = chosen.colour.as_ref().or(chosen.depth.as_ref());
    images.map(String::as_str).or(chosen.sensor(Input::Laser)).unwrap_or_default()
}

/// Returns the counters and remarks of the first pass.
pub(super) fn tally_of(scan: &Scan) -> Tally {
    let mut tally =
        Tally { counters: scan.counters.clone(), lost: scan.data_lost, ..Tally::default() };
    scan.notes.iter().for_each(|note| tally.note(note.clone()));
    if scan.counters.contains_key("chunks_without_crc") {
        tally.note("crc: absent; damage inside the chunks of this file may go unnoticed");
    }
    tally
}

/// Chooses topics, calibration and the source of the camera's pose.
///
/// # Errors
/// A calibration that cannot be used, and an input or topic that `inputs` or `input` name and the
/// scan lacks.
pub(super) fn plan(
    scan: Arc<Scan>,
    input: &InputSettings,
    limits: &Limits,
    inputs: Inputs,
    tally: &mut Tally,
    reread: Reread<'_>,
) -> Result<Plan, LogError> {
    let chosen = choose(&scan, input, inputs)?;
    let depth_lens = lens_of(
        &scan,
        chosen.depth.as_deref(),
        chosen.depth_info.as_deref(),
        input.disparity.is_some(),
    )?;
    let lens = match chosen.colour {
        Some(_) => lens_of(&scan, chosen.colour.as_deref(), chosen.colour_info.as_deref(), false)?,
        None => depth_lens,
    };
    let right = lens_of(&scan, chosen.right.as_deref(), chosen.right_info.as_deref(), false)?;
    let sources = match inputs.uses(Input::OBSTACLES) {
        true => planned_sources(&scan, input, tally)?,
        false => Vec::new(),
    };
    let mut plan = Plan {
        mount: Mount::assumed(),
        lens: lens.or_else(|| depth_lens.filter(|_| same_frame(&scan, &chosen))),
        depth_lens,
        baseline_m: right.and_then(|right| right.baseline_m),
        disparity: None,
        odom_frames: odom_frames(&scan, &chosen, input),
        scan,
        chosen,
        input: input.clone(),
        limits: limits.clone(),
        inputs,
        sources,
    };
    check_calibration(&plan, tally)?;
    plan.disparity = stereo_geometry(&plan)?;
    plan.mount = find_mount(&plan, reread)?;
    tally.note(format!("the pose of the camera comes from {}", plan.mount.source()));
    note_unread_images(&plan, tally);
    if plan.odom_frames.is_none() {
        tally.note("no odometry: the robot is taken to be at rest");
    }
    Ok(plan)
}

/// Counts the images that cannot be read, if the log has no others of their kind.
fn note_unread_images(plan: &Plan, tally: &mut Tally) {
    if plan.chosen.colour.is_some() || !plan.inputs.uses(Input::Colour) {
        return;
    }
    for (name, topic) in &plan.scan.topics {
        if let Some(why) = unreadable(topic) {
            tally.add("messages_not_read", topic.count);
            tally.note(format!("{name} is not read: {why}"));
        }
    }
}

fn same_frame(scan: &Scan, chosen: &Chosen) -> bool {
    let frame = |topic: &Option<String>| scan.frame_of(topic.as_deref()?);
    frame(&chosen.colour).is_some() && frame(&chosen.colour) == frame(&chosen.depth)
}

/// Returns the calibration of an image topic, if there is one.
fn lens_of(
    scan: &Scan,
    image: Option<&str>,
    info: Option<&str>,
    is_disparity: bool,
) -> Result<Option<Intrinsics>, LogError> {
    let (Some(image), Some(topic)) = (image, info) else { return Ok(None) };
    let Some(info) = scan.infos.get(topic) else { return Ok(None) };
    // Of other images, the name of the topic is the only sign that they are rectified.
    let is_disparity = is_disparity || scan.topics.get(image).is_some_and(is_disparity_image);
    let is_rectified = image.contains("rect") || is_disparity;
    intrinsics(info, is_rectified).map(Some).map_err(|source| LogError::Calibration {
        path: scan.path.clone(),
        topic: topic.to_owned(),
        source,
    })
}

/// Returns true for images of disparities, which are those of the rectified left camera.
fn is_disparity_image(topic: &Topic) -> bool {
    topic.kind == Type::DisparityImage
}

/// Returns the geometry of disparities that come without one; `None` for all other depth.
///
/// # Errors
/// A log that has no calibration for it.
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

/// Returns the baseline of the right camera that the settings name, else of the only one.
fn right_baseline_m(plan: &Plan) -> Option<f64> {
    let of = |info| intrinsics(info, true).ok()?.baseline_m.filter(|baseline| *baseline > 0.0);
    if let Some(named) = &plan.chosen.right_info {
        return of(plan.scan.infos.get(named)?);
    }
    let mut all = plan.scan.infos.values().filter_map(of);
    all.next().filter(|_| all.next().is_none())
}

/// Checks that there is a calibration if positions in metres need it; a monocular pipeline works
/// without.
fn check_calibration(plan: &Plan, tally: &mut Tally) -> Result<(), LogError> {
    let metric = plan.inputs.requires(Input::Depth) || plan.inputs.requires(Input::Right);
    if plan.inputs.requires(Input::Right) && plan.baseline_m.is_none_or(|baseline| baseline <= 0.0)
    {
        let wanted = "calibration of the right camera with a positive baseline (P[3] = -fx B)";
        let hint = "; name its camera_info as `right_info_topic` under [input]".to_owned();
        return Err(missing(&plan.scan, wanted.into(), hint));
    }
    if plan.lens.is_none() && metric {
        let wanted = format!("calibration (sensor_msgs/CameraInfo) of {}", plan.primary());
        let hint = "; name it as `colour_info_topic` under [input]".to_owned();
        return Err(missing(&plan.scan, wanted, hint));
    }
    if plan.lens.is_none() && !plan.is_of_scans() {
        tally.note("no calibration: a lens with a view of 53 degrees is assumed");
    }
    Ok(())
}

/// Returns the odometry topic, else the tf frames if they are connected.
fn odom_frames(
    scan: &Scan,
    chosen: &Chosen,
    input: &InputSettings,
) -> Option<Option<(String, String)>> {
    if chosen.odometry.is_some() {
        return Some(None);
    }
    let robot = robot_frame(scan, input);
    let connected = scan.tf.knows(&input.odom_frame) && scan.tf.connects(&input.odom_frame, robot);
    connected.then(|| Some((input.odom_frame.clone(), robot.to_owned())))
}

/// Returns the mount from tf, the settings, or the floor in the first depth images.
fn find_mount(plan: &Plan, reread: Reread<'_>) -> Result<Mount, LogError> {
    let camera = plan.scan.frame_of(plan.primary());
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

/// Number of depth images to which the floor is fitted.
const FLOOR_FRAMES: usize = 9;

/// Returns the pose of the camera above the floor: the median over the first images.
fn floor(plan: &Plan, reread: Reread<'_>) -> Result<Option<Mount>, LogError> {
    if plan.chosen.depth.is_none() || plan.lens.is_none() {
        return Ok(None);
    }
    let probe = Plan {
        scan: Arc::clone(&plan.scan),
        chosen: plan.chosen.clone(),
        input: plan.input.clone(),
        limits: plan.limits.clone(),
        // No other input than depth, so that nothing else is decoded.
        inputs: Inputs::NONE.require(Input::Depth),
        mount: Mount::assumed(),
        odom_frames: None,
        sources: Vec::new(),
        ..*plan
    };
    let (mut probe, mut messages) = (Assembly::new(probe, Tally::default()), reread()?);
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
            height_m: ground.height_m,
            pitch_down_deg: ground.pitch_down_rad().to_degrees(),
            roll_deg: ground.roll_rad().to_degrees(),
        };
        let source = format!("the floor fitted to the depth of {} images", floors.len());
        Mount::fixed(&mount, source)
    }))
}
