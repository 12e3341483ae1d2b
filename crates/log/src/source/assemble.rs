//! Assembly of frames from images that belong together.

use std::sync::Arc;

use nalgebra::{Isometry2, Isometry3};
use tagalong_core::{
    DepthImage, EgoMotion, Frame, Images, Input, MAX_CAMERA_POSE_AGE_S, MAX_ODOMETRY_GAP_S,
    ObstacleReadings, RightImage, Sensors, Stamp, planar_pose,
};
use tagalong_geometry::{Camera, ConicalMirror, Lens, Panorama, Pinhole};
use tagalong_vision::Unwrapping;

use super::LogFrame;
use super::align::{DepthAligner, DepthMoment};
use super::intake::Intake;
use super::mount::robot_frame;
use super::plan::Plan;
use crate::camera_info::{CalibrationError, Intrinsics, Mirrored, check_size};
use crate::images::{
    CloudAxes, DepthFromDisparity, ImageError, Pixels, decode_cloud, decode_compressed,
    decode_compressed_disparity, decode_disparity, decode_plain_disparity, decode_raw,
    size_of_cloud, size_of_compressed, size_of_raw,
};
use crate::msgs::{CompressedImage, DisparityImage, Image, LaserScan, PointCloud2, decode};
use crate::obstacles::DepthFormat;
use crate::odometry::PoseAt;
use crate::pairing::Payload;
use crate::scan::Type;
use crate::sensors::Moment;
use crate::sensors::laser::{lose_scan, scan_fault, seen_from};
use crate::sensors::points::cloud_in_robot;
use crate::sensors::sweep::note_impossible_times;
use crate::tally::Tally;
use crate::topics::Problem;

/// State that is carried from frame to frame.
#[derive(Default)]
pub(super) struct Assembler {
    index: u64,
    camera: Option<Arc<Camera>>,
    /// True once it was reported that a pose of the camera is held.
    is_hold_told: bool,
    aligner: DepthAligner,
    unwrapping: Unwrapping,
    previous: Option<(Stamp, PoseAt)>,
    /// First calibration that did not fit its images.
    pub(super) misfit: Option<CalibrationError>,
}

impl Assembler {
    /// Returns the number of messages from which frames were to be made.
    pub(super) fn count(&self) -> u64 {
        self.index
    }

    /// Returns the camera of the last frame.
    pub(super) fn camera(&self) -> Option<&Arc<Camera>> {
        self.camera.as_ref()
    }

    /// Makes a frame from an image and its partners; `None` if a required part is missing or
    /// damaged, which is counted.
    pub(super) fn assemble(
        &mut self,
        plan: &Plan,
        image: &Payload,
        next: Option<Stamp>,
        intake: &mut Intake,
        tally: &mut Tally,
    ) -> Option<LogFrame> {
        // Incremented before anything can fail, so that the index does not depend on the inputs.
        self.index += 1;
        let tolerance_s = plan.input.pair_tolerance_s;
        intake.pair_sensors(image.stamp, next, tolerance_s);
        watch_frame(plan, Some(plan.primary()), image, image.stamp, intake, tally);
        if plan.is_of_points() {
            return self.assemble_points(plan, image, intake, tally);
        }
        if plan.is_of_scans() {
            return self.assemble_scan(plan, image, intake, tally);
        }
        let depth = intake.depth.take(image.stamp, next, tolerance_s);
        let right = intake.right.take(image.stamp, next, tolerance_s);
        if plan.has_second_depth() && depth.is_none() {
            tally.count("colour_without_depth");
        }
        if plan.chosen.right.is_some() && right.is_none() {
            tally.count("left_without_right");
        }
        for (topic, partner) in [(&plan.chosen.depth, &depth), (&plan.chosen.right, &right)] {
            if let Some(partner) = partner {
                watch_frame(plan, topic.as_deref(), partner, image.stamp, intake, tally);
            }
        }
        let requires_depth = plan.inputs.requires(Input::Depth);
        let requires_right = plan.inputs.requires(Input::Right);
        // Tested before decoding, which is the expensive part.
        let lacks_depth = requires_depth && plan.has_second_depth() && depth.is_none();
        if lacks_depth || requires_right && right.is_none() {
            return None;
        }
        let (mut images, size) = self.primary(plan, image, tally)?;
        let camera = self.camera_at(plan, image, size, intake, tally)?;
        if let (Some(depth), Some(topic)) = (depth, &plan.chosen.depth) {
            let seen = pixels(plan, topic, &depth, tally);
            if let Some(Pixels::Depth(seen)) = seen {
                let moment = DepthMoment { image, depth: &depth, camera: &camera, tf: &intake.tf };
                images.depth = self.aligner.align(plan, &moment, seen, tally);
            }
        }
        if let Some(right) = right {
            images.right = right_image(plan, &right, size, tally).map(Arc::new);
        }
        let lacks =
            requires_depth && images.depth.is_none() || requires_right && images.right.is_none();
        if lacks {
            return None;
        }
        let sensors = images.taken_by(&camera);
        Some(self.finish(plan, image.stamp, camera, sensors, intake, tally))
    }

    /// Makes a frame from a laser scan alone; `None` if it is damaged or its pose is unknown, which
    /// is counted.
    fn assemble_scan(
        &mut self,
        plan: &Plan,
        scan: &Payload,
        intake: &mut Intake,
        tally: &mut Tally,
    ) -> Option<LogFrame> {
        let sweep = match decode::<LaserScan>(&scan.data) {
            Ok(sweep) => sweep,
            Err(error) => {
                lose_scan(plan.primary(), &error.to_string(), tally);
                return None;
            }
        };
        if let Some(why) = scan_fault(&sweep) {
            lose_scan(plan.primary(), &why, tally);
            return None;
        }
        let Some(pose) = plan.mount.at(&intake.tf, scan.stamp) else {
            count_without_pose(plan, "laser_scans_without_pose", tally);
            return None;
        };
        note_impossible_times(&sweep, plan.primary(), tally);
        let seen =
            seen_from(&sweep, &pose, |then| self.robot_between(plan, scan.stamp, then, intake));
        let sensors = Sensors::default().with(seen);
        let camera = self.blind_camera(pose);
        Some(self.finish(plan, scan.stamp, camera, sensors, intake, tally))
    }

    /// Makes a frame from the points of a lidar alone; `None` if they are damaged or their pose is
    /// unknown, which is counted.
    fn assemble_points(
        &mut self,
        plan: &Plan,
        cloud: &Payload,
        intake: &mut Intake,
        tally: &mut Tally,
    ) -> Option<LogFrame> {
        let Some(pose) = plan.mount.at(&intake.tf, cloud.stamp) else {
            count_without_pose(plan, "clouds_without_pose", tally);
            return None;
        };
        let seen = cloud_in_robot(cloud, plan.primary(), &pose, &Isometry2::identity(), tally)?;
        let sensors = Sensors::default().with(seen);
        let camera = self.blind_camera(pose);
        Some(self.finish(plan, cloud.stamp, camera, sensors, intake, tally))
    }

    /// Returns the camera of a frame without images; it is the same object as long as the pose of
    /// the sensor is unchanged.
    fn blind_camera(&mut self, pose: Isometry3<f64>) -> Arc<Camera> {
        let camera = Camera::blind(pose);
        match &self.camera {
            Some(known) if **known == camera => Arc::clone(known),
            _ => Arc::clone(self.camera.insert(Arc::new(camera))),
        }
    }

    /// Decodes the image from which the frame is made, if it is used; returns it with the size of
    /// the frame.
    fn primary(
        &mut self,
        plan: &Plan,
        image: &Payload,
        tally: &mut Tally,
    ) -> Option<(Images, (usize, usize))> {
        let seen =
            if plan.reads_primary() { pixels(plan, plan.primary(), image, tally) } else { None };
        let size = match &seen {
            Some(pixels) => pixels.size(),
            None if plan.requires_primary() => return None,
            None => size_without_pixels(plan, image, tally)?,
        };
        self.check_calibration(plan, size, tally)?;
        let images = seen.map_or_else(Images::default, images_of);
        match plan.raw_mirror() {
            None => Some((images, size)),
            Some(mirror) => self.unwrap(plan, mirror, &images, tally),
        }
    }

    /// Checks that the image has the size of the calibration; `None` if not, which is counted.
    fn check_calibration(
        &mut self,
        plan: &Plan,
        size: (usize, usize),
        tally: &mut Tally,
    ) -> Option<()> {
        if let Some(Err(misfit)) = plan.lens.map(|lens| check_size(&lens, size.0, size.1)) {
            tally.lose("images_of_other_size", || format!("{}: {misfit}", plan.primary()));
            self.misfit.get_or_insert(misfit);
            return None;
        }
        Some(())
    }

    /// Unwraps the circular image of a mirror, if there is one; returns the panorama and its size.
    fn unwrap(
        &mut self,
        plan: &Plan,
        mirror: ConicalMirror,
        raw: &Images,
        tally: &mut Tally,
    ) -> Option<(Images, (usize, usize))> {
        let [columns, rows] = plan.input.panorama;
        if raw.colour.is_none() && raw.grey.is_none() {
            return Some((Images::default(), (columns, rows)));
        }
        let panorama = Panorama { mirror, columns, rows };
        let unwrapped = self.unwrapping.apply(&panorama, raw);
        let unwrapped =
            unwrapped.map_err(|error| tally.lose("images_not_unwrapped", || error.to_string()));
        Some((unwrapped.ok()?, (columns, rows)))
    }

    /// Returns the camera at the time of an image; the same object as before if it is unchanged.
    fn camera_at(
        &mut self,
        plan: &Plan,
        image: &Payload,
        (width, height): (usize, usize),
        intake: &Intake,
        tally: &mut Tally,
    ) -> Option<Arc<Camera>> {
        let found = plan.mount.at(&intake.tf, image.stamp);
        // The last known pose bridges a gap in tf.
        let known = found.or_else(|| self.camera.as_ref().map(|last| last.robot_from_camera));
        if found.is_none() {
            tally.count("frames_without_camera_pose");
            if known.is_some() && !self.is_hold_told {
                self.is_hold_told = true;
                tally.note(format!(
                    "{} has no pose of the camera at some frames, which get the last known one, \
                     and after {MAX_CAMERA_POSE_AGE_S} s a robot that is steered stands: publish it on /tf_static if the camera does not move on the robot, otherwise \
                     throughout the log",
                    plan.mount.source()
                ));
            }
        }
        let Some(robot_from_camera) = known else {
            tally.lose("frames_before_camera_pose", || {
                let source = plan.mount.source();
                match plan.mount_problem() {
                    Some(Problem { why, remedy }) => {
                        format!("no camera pose in {source}: {why}; {remedy}")
                    }
                    None => format!("no camera pose in {source} at the first images"),
                }
            });
            return None;
        };
        let lens = plan.lens.map_or_else(
            || Lens::Pinhole(assumed_lens(width, height)),
            |known| lens_of(&known, width, height),
        );
        let camera = Camera { lens, width, height, robot_from_camera };
        // A new object only after a change, so that frames share it.
        if self.camera.as_deref() != Some(&camera) {
            self.camera = Some(Arc::new(camera));
        }
        self.camera.clone()
    }

    /// Returns the sensors of a frame with those other than cameras added.
    fn sense(
        &self,
        plan: &Plan,
        stamp: Stamp,
        camera: &Arc<Camera>,
        sensors: Sensors,
        intake: &Intake,
        tally: &mut Tally,
    ) -> Sensors {
        let robot_frame = robot_frame(&plan.scan, &plan.input);
        intake.sensors.iter().fold(sensors, |all, (topic, sensor)| {
            let moment = Moment {
                topic,
                stamp,
                camera,
                robot_frame,
                tf: &intake.tf,
                odom_from_robot: &|stamp| self.pose_at(plan, stamp, intake).pose,
            };
            sensor.add_to(all, &moment, tally)
        })
    }

    /// Returns the sensors of a frame with the readings of the further obstacle sources added, if
    /// there are any sources.
    fn sense_obstacles(
        &self,
        plan: &Plan,
        stamp: Stamp,
        camera: &Arc<Camera>,
        sensors: Sensors,
        intake: &mut Intake,
        tally: &mut Tally,
    ) -> Sensors {
        if !plan.inputs.uses(Input::OBSTACLES) || plan.input.sources.is_empty() {
            return sensors;
        }
        // Taken out of the intake, which provides the poses in the meantime.
        let mut readers = std::mem::take(&mut intake.obstacles);
        let format = DepthFormat { unit_m: plan.input.depth_unit_m, limits: &plan.limits };
        let mut readings = Vec::new();
        for reader in &mut readers {
            let topic = reader.topic().to_owned();
            let moment = Moment {
                topic: &topic,
                stamp,
                camera,
                robot_frame: robot_frame(&plan.scan, &plan.input),
                tf: &intake.tf,
                odom_from_robot: &|stamp| self.pose_at(plan, stamp, intake).pose,
            };
            readings.extend(reader.reading(&moment, format, tally));
        }
        intake.obstacles = readers;
        sensors.with(ObstacleReadings(readings.into()))
    }

    fn finish(
        &mut self,
        plan: &Plan,
        stamp: Stamp,
        camera: Arc<Camera>,
        sensors: Sensors,
        intake: &mut Intake,
        tally: &mut Tally,
    ) -> LogFrame {
        // Called before `previous` is set to this frame, because without odometry `previous` gives
        // the pose.
        let sensors = self.sense(plan, stamp, &camera, sensors, intake, tally);
        let sensors = self.sense_obstacles(plan, stamp, &camera, sensors, intake, tally);
        let here = self.pose_at(plan, stamp, intake);
        note_odometry_ahead(plan, stamp, intake, tally);
        let odom_jumped = self.has_jumped(plan, stamp, intake, tally);
        let (motion, known) = self.motion(plan, stamp, here, odom_jumped, tally);
        self.previous = Some((stamp, here));
        tally.count("frames");
        LogFrame {
            frame: Frame::of_sensors(self.index, stamp, camera, motion, sensors)
                .with_changed_calibration(intake.watch.has_changed(stamp))
                .with_odometry_age(odometry_age_s(plan, stamp, intake))
                .with_odometry_jump(odom_jumped)
                .with_camera_pose_age(plan.mount.age_s(&intake.tf, stamp))
                .with_expected(plan.expected()),
            odom_from_robot: here.pose,
            odom_stale: here.stale || !known,
        }
    }

    fn pose_at(&self, plan: &Plan, stamp: Stamp, intake: &Intake) -> PoseAt {
        let found = match &plan.odom_frames {
            None => return PoseAt { pose: Isometry2::identity(), stale: false },
            Some(None) => intake.poses.at(stamp),
            Some(Some((odom, robot))) => intake.tf.lookup(odom, robot, stamp).map(|pose| {
                let age_s = intake.tf.age_s(odom, robot, stamp);
                // Static transforms alone have no age.
                let stale = age_s.is_finite() && age_s > MAX_ODOMETRY_GAP_S;
                PoseAt { pose: planar_pose(&pose), stale }
            }),
        };
        // Without odometry the robot stays at its last pose, which is marked as stale.
        let last = self.previous.map_or_else(Isometry2::identity, |(_, last)| last.pose);
        found.unwrap_or(PoseAt { pose: last, stale: true })
    }

    /// Returns the pose of the robot at one time in the robot frame of another.
    fn robot_between(
        &self,
        plan: &Plan,
        now: Stamp,
        then: Stamp,
        intake: &Intake,
    ) -> Isometry2<f64> {
        if now == then {
            return Isometry2::identity();
        }
        self.pose_at(plan, now, intake).pose.inverse() * self.pose_at(plan, then, intake).pose
    }

    /// Returns true if the odometry jumps between the previous frame and this one.
    fn has_jumped(&self, plan: &Plan, stamp: Stamp, intake: &Intake, tally: &mut Tally) -> bool {
        let from_topic = matches!(plan.odom_frames, Some(None));
        let jumped = from_topic
            && self.previous.is_some_and(|(then, _)| intake.poses.jumped_between(then, stamp));
        if jumped {
            tally.count("odometry_jump_frames");
            tally.note("odometry jumps by more than a metre, or a quarter turn, at some frames");
        }
        jumped
    }

    /// Returns the motion since the previous frame, and true if it is known.
    fn motion(
        &self,
        plan: &Plan,
        stamp: Stamp,
        here: PoseAt,
        jumped: bool,
        tally: &mut Tally,
    ) -> (EgoMotion, bool) {
        if here.stale {
            tally.count("odometry_gap_frames");
            tally.note("odometry is silent for more than half a second at some frames");
        }
        // After a jump of the clock there is no previous frame to measure from.
        let Some((then, before)) = self.previous.filter(|(then, _)| *then < stamp) else {
            return (EgoMotion::at_rest(0.0), true);
        };
        let dt = stamp.seconds_since(then);
        if here.stale || before.stale || jumped {
            return (EgoMotion::unknown(dt), false);
        }
        (EgoMotion::between(&before.pose, &here.pose, dt, plan.input.odometry_sigma), true)
    }
}

/// Compares the frame id of an image with that of the first image on its topic.
fn watch_frame(
    plan: &Plan,
    topic: Option<&str>,
    image: &Payload,
    frame_stamp: Stamp,
    intake: &mut Intake,
    tally: &mut Tally,
) {
    if let Some(topic) = topic {
        let first = plan.scan.frame_of(topic);
        intake.watch.watch_frame(topic, first, image, frame_stamp, tally);
    }
}

/// Counts a message without a pose, from which no frame can be made, and reports once if the clock
/// of tf is the reason.
fn count_without_pose(plan: &Plan, name: &'static str, tally: &mut Tally) {
    tally.count(name);
    if tally.counters.get(name) == Some(&1)
        && let Some(Problem { why, remedy }) = plan.mount_problem()
    {
        tally.note(format!("no pose in {}: {why}; {remedy}", plan.mount.source()));
    }
}

/// Returns the age of odometry at a frame, s; infinite without any.
fn odometry_age_s(plan: &Plan, stamp: Stamp, intake: &Intake) -> f64 {
    match &plan.odom_frames {
        None => f64::INFINITY,
        Some(None) => intake.poses.age_s(stamp),
        Some(Some((odom, robot))) => intake.tf.age_s(odom, robot, stamp),
    }
}

/// Counts a frame whose next odometry reading lies far in its future, and reports how far.
fn note_odometry_ahead(plan: &Plan, stamp: Stamp, intake: &Intake, tally: &mut Tally) {
    let ahead_s = match &plan.odom_frames {
        None => None,
        Some(None) => intake.poses.ahead_s(stamp),
        Some(Some((odom, robot))) => intake.tf.ahead_s(odom, robot, stamp),
    };
    if let Some(ahead_s) = ahead_s {
        tally.remark("odometry_ahead_frames", || {
            format!(
                "odometry is stamped {ahead_s:.1} s after the frame at {stamp} and is not used for \
                 it: compare the clocks of the odometry and of the sensor that makes the frames"
            )
        });
    }
}

fn images_of(pixels: Pixels) -> Images {
    let mut images = Images::default();
    match pixels {
        Pixels::Colour(colour) => images.colour = Some(Arc::new(colour)),
        Pixels::Grey(grey) => images.grey = Some(Arc::new(grey)),
        Pixels::Depth(depth) => images.depth = Some(Arc::new(depth)),
    }
    images
}

fn right_image(
    plan: &Plan,
    right: &Payload,
    size: (usize, usize),
    tally: &mut Tally,
) -> Option<RightImage> {
    let pixels = pixels(plan, plan.chosen.right.as_ref()?, right, tally)?;
    if pixels.size() != size {
        tally.lose("right_of_other_size", || "the right image has another size".into());
        return None;
    }
    let image = match pixels {
        Pixels::Colour(colour) => colour.to_grey(),
        Pixels::Grey(grey) => grey,
        Pixels::Depth(_) => return None,
    };
    Some(RightImage { image, baseline_m: plan.baseline_m? })
}

/// Returns the lens of the frames after unwrapping.
fn lens_of(known: &Intrinsics, width: usize, height: usize) -> Lens {
    let mirror = match known.mirror {
        None => return Lens::Pinhole(known.lens),
        Some(Mirrored::Raw(mirror)) => mirror,
        Some(Mirrored::Unwrapped(panorama)) => panorama.mirror,
    };
    Lens::Panorama(Panorama { mirror, columns: width, rows: height })
}

/// Decodes an image message; a failure is counted as lost.
fn pixels(plan: &Plan, topic: &str, image: &Payload, tally: &mut Tally) -> Option<Pixels> {
    if is_disparity(plan, topic) {
        return depth_of_disparity(plan, topic, image, tally).map(Pixels::Depth);
    }
    let is_depth = plan.chosen.depth.as_deref() == Some(topic);
    let unit = if is_depth { plan.depth_unit_m } else { plan.input.depth_unit_m };
    let limits = &plan.limits;
    let cloud = plan.scan.topics.get(topic).and_then(|topic| topic.cloud);
    let axes = cloud.map_or(CloudAxes::Optical, |camera| camera.axes);
    read(plan, topic, image, tally, |image: AnyImage<'_>| match image {
        AnyImage::Raw(image) => decode_raw(&image, unit, limits),
        AnyImage::Compressed(image) => decode_compressed(&image, unit, limits),
        AnyImage::Disparity(image) => Err(ImageError::Encoding(image.image.encoding)),
        AnyImage::Cloud(cloud) => decode_cloud(&cloud, axes, limits).map(Pixels::Depth),
    })
}

/// Returns true for the depth topic if its images are disparities.
fn is_disparity(plan: &Plan, topic: &str) -> bool {
    let kind = plan.scan.topics.get(topic).map(|topic| topic.kind);
    let is_depth = plan.chosen.depth.as_deref() == Some(topic);
    is_depth && (plan.disparity.is_some() || kind == Some(Type::DisparityImage))
}

/// Converts disparities to depth; invalid ones are counted.
fn depth_of_disparity(
    plan: &Plan,
    topic: &str,
    image: &Payload,
    tally: &mut Tally,
) -> Option<DepthImage> {
    let unit_px = plan.input.disparity.and_then(|settings| settings.unit_px);
    let unit_m = plan.input.depth_unit_m;
    let limits = &plan.limits;
    let stereo = plan.disparity.ok_or_else(|| ImageError::NoDisparity("an image".into()));
    let read = read(plan, topic, image, tally, |image| match image {
        AnyImage::Disparity(image) => decode_disparity(&image, unit_px, unit_m, limits),
        AnyImage::Raw(image) => decode_plain_disparity(&image, stereo.clone()?, unit_px, limits),
        AnyImage::Compressed(image) => {
            decode_compressed_disparity(&image, stereo.clone()?, unit_px, limits)
        }
        AnyImage::Cloud(_) => Err(ImageError::NoDisparity("points".into())),
    });
    let DepthFromDisparity { depth, invalid } = read?;
    tally.add("disparity_pixels", depth.pixels().len() as u64);
    tally.add("disparity_pixels_invalid", invalid as u64);
    Some(depth)
}

/// Returns the size of an image from which a frame is made, read from its header; a failure is
/// counted as lost.
fn size_without_pixels(plan: &Plan, image: &Payload, tally: &mut Tally) -> Option<(usize, usize)> {
    read(plan, plan.primary(), image, tally, |image: AnyImage<'_>| match image {
        AnyImage::Raw(image) => size_of_raw(&image, &plan.limits),
        AnyImage::Compressed(image) => size_of_compressed(&image, &plan.limits),
        AnyImage::Disparity(image) => size_of_raw(&image.image, &plan.limits),
        AnyImage::Cloud(cloud) => size_of_cloud(&cloud, &plan.limits),
    })
}

/// Image message of one of the types.
enum AnyImage<'a> {
    Raw(Image<'a>),
    Compressed(CompressedImage<'a>),
    Disparity(DisparityImage<'a>),
    Cloud(PointCloud2<'a>),
}

/// Reads an image message with `of`; a failure is counted as lost.
fn read<T>(
    plan: &Plan,
    topic: &str,
    image: &Payload,
    tally: &mut Tally,
    of: impl Fn(AnyImage<'_>) -> Result<T, ImageError>,
) -> Option<T> {
    let kind = plan.scan.topics.get(topic).map(|topic| topic.kind);
    let message = match kind {
        // Pictures of video have been decoded on arrival.
        Some(Type::Image | Type::Video) => decode(&image.data).map(AnyImage::Raw),
        Some(Type::DisparityImage) => decode(&image.data).map(AnyImage::Disparity),
        Some(Type::PointCloud) => decode(&image.data).map(AnyImage::Cloud),
        _ => decode(&image.data).map(AnyImage::Compressed),
    };
    message
        .map_err(|error| ImageError::Codec(error.to_string()))
        .and_then(of)
        .map_err(|error| {
            tally.lose(error.counter(), || format!("{topic} at {}: {error}", image.stamp));
        })
        .ok()
}

/// Returns a lens with a horizontal field of view of 53 degrees, for logs without a calibration.
fn assumed_lens(width: usize, height: usize) -> Pinhole {
    Pinhole::centred(width as f64, width, height)
}
