//! The second reading of a log: frames.

mod assemble;
mod intake;
mod mount;
mod pairing;
mod recorded;
mod tally;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use assemble::Assembler;
use intake::Intake;
use mount::{Mount, robot_frame};
use nalgebra::Isometry2;
use serde::Serialize;
use tagalong_core::{Camera, ConicalMirror, DepthImage, Frame, Lens};
use tagalong_vision::ground::{Ground, GroundSettings, ground_of_depth};
use tally::Tally;

use crate::camera_info::{Intrinsics, Mirrored, check_size, intrinsics};
use crate::mcap_walk::Walker;
use crate::scan::{Scan, open_file};
use crate::topics::{Chosen, choose, missing};
use crate::{InputSettings, Limits, LogError, MountSettings, Needs};

/// A frame, and where the robot was.
pub struct LogFrame {
    /// The frame. Its index counts the colour images of the log in the order of
    /// their stamps from 1, skipped ones included.
    pub frame: Frame,
    /// The robot's pose in the odometry frame; the identity without odometry.
    pub odom_from_robot: Isometry2<f64>,
    /// The pose is a guess: odometry was silent for long, or has jumped.
    pub odom_stale: bool,
}

/// What was found out about a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LogFacts {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Topic of the colour or left images.
    pub colour_topic: Option<String>,
    /// Topic of the depth images.
    pub depth_topic: Option<String>,
    /// Topic of the right images.
    pub right_topic: Option<String>,
    /// Topic of the odometry.
    pub odometry_topic: Option<String>,
    /// Topic of the calibration that the frames have.
    pub calibration_topic: Option<String>,
    /// Frame id of the images.
    pub camera_frame: Option<String>,
    /// The robot's frame in tf.
    pub robot_frame: String,
    /// Columns of the images.
    pub width: usize,
    /// Rows of the images.
    pub height: usize,
    /// Focal length along columns, pixels.
    pub focal_px: f64,
    /// Distance of the right camera from the left one, m.
    pub baseline_m: Option<f64>,
    /// Height of the camera above the floor at the first frame, m.
    pub camera_height_m: f64,
    /// How far it looks down, degrees.
    pub camera_pitch_down_deg: f64,
    /// How far its right side is raised, degrees.
    pub camera_roll_deg: f64,
    /// Where these three come from.
    pub camera_source: String,
}

/// Everything about a log that is settled before its first frame.
pub(crate) struct Plan {
    pub(crate) scan: Arc<Scan>,
    pub(crate) chosen: Chosen,
    pub(crate) input: InputSettings,
    pub(crate) limits: Limits,
    pub(crate) needs: Needs,
    mount: Mount,
    lens: Option<Intrinsics>,
    depth_lens: Option<Intrinsics>,
    baseline_m: Option<f64>,
    /// `None`: no odometry. `Some(None)`: from its topic. Else the two frames of tf.
    odom_frames: Option<Option<(String, String)>>,
}

impl Plan {
    /// The topic whose images make the frames.
    fn primary(&self) -> &str {
        primary(&self.chosen)
    }

    /// The topic of the calibration that the frames have.
    fn calibration_topic(&self) -> Option<&String> {
        self.lens?;
        let own = if self.chosen.colour.is_some() { &self.chosen.colour_info } else { &None };
        own.as_ref().or(self.chosen.depth_info.as_ref())
    }

    /// True if depth comes beside another image.
    fn has_second_depth(&self) -> bool {
        self.chosen.colour.is_some() && self.chosen.depth.is_some()
    }

    /// The mirror whose images are still circular.
    fn raw_mirror(&self) -> Option<ConicalMirror> {
        match self.lens?.mirror? {
            Mirrored::Raw(mirror) => Some(mirror),
            Mirrored::Unwrapped(_) => None,
        }
    }

    /// True unless both calibrations are known and differ.
    fn same_lens(&self) -> bool {
        let (Some(colour), Some(depth)) = (self.lens, self.depth_lens) else { return true };
        let (a, b) = (colour.lens, depth.lens);
        let close = |a: f64, b: f64, off: f64| (a - b).abs() <= off;
        close(a.fx, b.fx, 0.01 * a.fx)
            && close(a.fy, b.fy, 0.01 * a.fy)
            && close(a.cx, b.cx, 2.0)
            && close(a.cy, b.cy, 2.0)
    }

    /// The camera that took a depth image, without its pose; `None` without a
    /// calibration for images of that size.
    fn depth_camera(&self, depth: &DepthImage) -> Option<Camera> {
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
    chosen.colour.as_ref().or(chosen.depth.as_ref()).map_or("", String::as_str)
}

/// The frames of a log, one after the other.
pub struct FrameSource {
    plan: Plan,
    walker: Walker<File>,
    intake: Intake,
    assembler: Assembler,
    tally: Tally,
    facts: LogFacts,
    first: Option<LogFrame>,
    ended: bool,
}

impl FrameSource {
    /// Opens a log: reads it once without decoding images, chooses topics and
    /// settles where the camera is.
    ///
    /// # Errors
    /// [`LogError`]: the file cannot be read, a calibration cannot be used, or
    /// the log lacks something that `needs` or `input` name.
    pub fn open(
        path: &Path,
        input: &InputSettings,
        limits: &Limits,
        needs: Needs,
    ) -> Result<Self, LogError> {
        input.check()?;
        let scan = Arc::new(Scan::read(path, input.depth_unit_m, limits)?);
        Self::of_scan(scan, input, limits, needs)
    }

    /// Like [`FrameSource::open`], of a log that was scanned already.
    pub(crate) fn of_scan(
        scan: Arc<Scan>,
        input: &InputSettings,
        limits: &Limits,
        needs: Needs,
    ) -> Result<Self, LogError> {
        let mut tally = tally_of(&scan);
        let plan = plan(scan, input, limits, needs, &mut tally)?;
        let mut source = Self::start(plan, tally)?;
        source.first = source.advance();
        if let (None, Some(misfit)) = (&source.first, source.assembler.misfit.clone()) {
            let topic = source.plan.chosen.colour_info.clone().unwrap_or_default();
            let path = source.plan.scan.path.clone();
            return Err(LogError::Calibration { path, topic, source: misfit });
        }
        source.facts = source.gather_facts();
        Ok(source)
    }

    fn start(plan: Plan, tally: Tally) -> Result<Self, LogError> {
        let path = &plan.scan.path;
        let walker = Walker::new(open_file(path)?, &plan.limits)
            .map_err(|source| LogError::NotMcap { path: path.clone(), source })?
            .knowing(plan.scan.channels.iter().cloned());
        Ok(Self {
            intake: Intake::new(&plan.scan, &plan.chosen, plan.primary(), &plan.input),
            walker,
            assembler: Assembler::new(),
            tally,
            facts: LogFacts::default(),
            first: None,
            ended: false,
            plan,
        })
    }

    /// The next frame in the order of stamps; `None` at the end.
    pub fn next_frame(&mut self) -> Option<LogFrame> {
        self.first.take().or_else(|| self.advance())
    }

    fn advance(&mut self) -> Option<LogFrame> {
        loop {
            while let Some((image, next)) = self.intake.frames.pop(self.ended) {
                let frame = self.assembler.assemble(
                    &self.plan,
                    &image,
                    next,
                    &mut self.intake,
                    &mut self.tally,
                );
                self.intake.settle();
                if frame.is_some() {
                    return frame;
                }
            }
            if self.ended {
                self.tally.add("depth_without_colour", self.intake.depth.leave());
                self.tally.add("right_without_left", self.intake.right.leave());
                return None;
            }
            self.read_on();
        }
    }

    /// Takes in one message.
    fn read_on(&mut self) {
        match self.walker.next() {
            Some(message) => self.intake.take(&message, &mut self.tally),
            None => self.end(),
        }
    }

    fn end(&mut self) {
        self.ended = true;
        if self.intake.frames.drop_suspect() {
            self.tally.count("late_frames");
        }
        if self.walker.data_lost() && !self.plan.scan.data_lost {
            let notes = self.walker.notes().join("; ");
            self.tally.lose("log_changed_while_read", || {
                format!("the file was whole when it was opened and is not any more: {notes}")
            });
        }
    }

    /// How much of the file has been read, 0 to 1.
    pub fn progress(&self) -> f64 {
        let bytes = self.plan.scan.bytes.max(1);
        if self.ended { 1.0 } else { (self.walker.position() as f64 / bytes as f64).min(1.0) }
    }

    /// What was counted so far: damage of the file, images skipped and why.
    pub fn counters(&self) -> &BTreeMap<&'static str, u64> {
        &self.tally.counters
    }

    /// What is to be said about the log, each thing once.
    pub fn notes(&self) -> &[String] {
        &self.tally.notes
    }

    /// True if anything in the log could not be used because it is damaged.
    pub fn data_lost(&self) -> bool {
        self.tally.lost
    }

    /// What was found out about the log.
    pub fn facts(&self) -> &LogFacts {
        &self.facts
    }

    fn gather_facts(&self) -> LogFacts {
        let (scan, chosen) = (&self.plan.scan, &self.plan.chosen);
        let camera = self.assembler.camera();
        let of_camera = |value: fn(&Camera) -> f64| camera.map_or(0.0, |camera| value(camera));
        LogFacts {
            path: scan.path.clone(),
            bytes: scan.bytes,
            sha256: scan.sha256.clone(),
            colour_topic: chosen.colour.clone(),
            depth_topic: chosen.depth.clone(),
            right_topic: chosen.right.clone(),
            odometry_topic: chosen.odometry.clone(),
            calibration_topic: self.plan.calibration_topic().cloned(),
            camera_frame: scan.frame_of(self.plan.primary()).map(str::to_owned),
            robot_frame: robot_frame(scan, &self.plan.input).to_owned(),
            width: camera.map_or(0, |camera| camera.width),
            height: camera.map_or(0, |camera| camera.height),
            focal_px: of_camera(Camera::focal_px),
            baseline_m: self.plan.baseline_m,
            camera_height_m: of_camera(Camera::height_m),
            camera_pitch_down_deg: of_camera(Camera::pitch_down_rad).to_degrees(),
            camera_roll_deg: of_camera(Camera::roll_rad).to_degrees(),
            camera_source: self.plan.mount.source(),
        }
    }
}

/// What the scan has to say, before anything else.
fn tally_of(scan: &Scan) -> Tally {
    let mut tally =
        Tally { counters: scan.counters.clone(), lost: scan.data_lost, ..Tally::default() };
    scan.notes.iter().for_each(|note| tally.note(note.clone()));
    if scan.counters.contains_key("chunks_without_crc") {
        tally.note("crc: absent; damage inside the chunks of this file may go unnoticed");
    }
    tally
}

fn plan(
    scan: Arc<Scan>,
    input: &InputSettings,
    limits: &Limits,
    needs: Needs,
    tally: &mut Tally,
) -> Result<Plan, LogError> {
    let chosen = choose(&scan, input, needs)?;
    let depth_lens = lens_of(&scan, chosen.depth.as_deref(), chosen.depth_info.as_deref())?;
    let lens = match chosen.colour {
        Some(_) => lens_of(&scan, chosen.colour.as_deref(), chosen.colour_info.as_deref())?,
        None => depth_lens,
    };
    let right = lens_of(&scan, chosen.right.as_deref(), chosen.right_info.as_deref())?;
    let mut plan = Plan {
        mount: Mount::assumed(),
        lens: lens.or_else(|| depth_lens.filter(|_| same_frame(&scan, &chosen))),
        depth_lens,
        baseline_m: right.and_then(|right| right.baseline_m),
        odom_frames: odom_frames(&scan, &chosen, input),
        scan,
        chosen,
        input: input.clone(),
        limits: limits.clone(),
        needs,
    };
    check_calibration(&plan, tally)?;
    plan.mount = find_mount(&plan)?;
    tally.note(format!("the pose of the camera comes from {}", plan.mount.source()));
    if plan.odom_frames.is_none() {
        tally.note("no odometry: the robot is taken to be at rest");
    }
    Ok(plan)
}

fn same_frame(scan: &Scan, chosen: &Chosen) -> bool {
    let frame = |topic: &Option<String>| scan.frame_of(topic.as_deref()?);
    frame(&chosen.colour).is_some() && frame(&chosen.colour) == frame(&chosen.depth)
}

/// The calibration of an image topic, if there is one.
fn lens_of(
    scan: &Scan,
    image: Option<&str>,
    info: Option<&str>,
) -> Result<Option<Intrinsics>, LogError> {
    let (Some(image), Some(topic)) = (image, info) else { return Ok(None) };
    let Some(info) = scan.infos.get(topic) else { return Ok(None) };
    intrinsics(info, image.contains("rect")).map(Some).map_err(|source| LogError::Calibration {
        path: scan.path.clone(),
        topic: topic.to_owned(),
        source,
    })
}

/// Positions in metres need a calibration; a mono pipeline may do without.
fn check_calibration(plan: &Plan, tally: &mut Tally) -> Result<(), LogError> {
    let metric = plan.needs.depth || plan.needs.right;
    if plan.needs.right && plan.baseline_m.is_none_or(|baseline| baseline <= 0.0) {
        let wanted = "calibration of the right camera with a positive baseline (P[3] = -fx B)";
        let hint = "; name its camera_info as `right_info_topic` under [input]".to_owned();
        return Err(missing(&plan.scan, wanted.into(), hint));
    }
    if plan.lens.is_none() && metric {
        let wanted = format!("calibration (sensor_msgs/CameraInfo) of {}", plan.primary());
        let hint = "; name it as `colour_info_topic` under [input]".to_owned();
        return Err(missing(&plan.scan, wanted, hint));
    }
    if plan.lens.is_none() {
        tally.note("no calibration: a lens with a view of 53 degrees is assumed");
    }
    Ok(())
}

/// From the odometry topic, else from tf if it connects the two frames.
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

/// From tf, the settings, or the floor in the first depth images.
fn find_mount(plan: &Plan) -> Result<Mount, LogError> {
    let camera = plan.scan.frame_of(plan.primary());
    let mirror = plan.lens.is_some_and(|lens| lens.mirror.is_some());
    if let Some(mount) = Mount::find(&plan.scan, camera, &plan.input, mirror) {
        return Ok(mount);
    }
    match floor(plan)? {
        Some(mount) => Ok(mount),
        None if plan.needs.depth => {
            let wanted = "camera pose: tf does not connect the camera with the robot, and no \
                          floor is visible in the first depth images";
            let hint = "; give height and tilt in [input.camera]".to_owned();
            Err(missing(&plan.scan, wanted.into(), hint))
        }
        None => Ok(Mount::assumed()),
    }
}

/// Depth images that are tried for a floor.
const FLOOR_FRAMES: usize = 9;

/// The pose of the camera above the floor: the median of the first images.
fn floor(plan: &Plan) -> Result<Option<Mount>, LogError> {
    if plan.chosen.depth.is_none() || plan.lens.is_none() {
        return Ok(None);
    }
    let probe = Plan {
        scan: Arc::clone(&plan.scan),
        chosen: plan.chosen.clone(),
        input: plan.input.clone(),
        limits: plan.limits.clone(),
        needs: Needs { depth: true, ..Needs::default() },
        mount: Mount::assumed(),
        odom_frames: None,
        ..*plan
    };
    let mut source = FrameSource::start(probe, Tally::default())?;
    let mut floors: Vec<Ground> = Vec::new();
    for _ in 0..FLOOR_FRAMES {
        let Some(found) = source.advance() else { break };
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
