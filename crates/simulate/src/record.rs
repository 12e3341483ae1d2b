use std::io;
use std::path::Path;
use std::sync::Arc;

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use nalgebra::{Isometry2, Isometry3};
use serde::Serialize;
use tagalong_core::{DepthImage, GreyImage, RangeReading, RgbImage, Stamp, spatial_pose};
use tagalong_geometry::{Camera, ConicalMirror, Lens, Panorama, Rect};
use tagalong_log::camera_info::{CONICAL_MIRROR, mirror_coefficients};
use tagalong_log::msgs::{
    BoolMsg, CameraInfo, CompressedImage, Header, Image, JointState, LaserScan, Odometry,
    PointCloud2, PoseStamped, Range, StringMsg, TFMessage, TransformStamped, TwistStamped,
};
use tagalong_log::write::{MessageLog, WriteError};
use tagalong_log::{TruthFrame, TruthJoint, TruthPerson};
use tagalong_sim::{
    Event, Joint, LaserSettings, OdometryReading, RangeKind, Scene, SensorData, SensorReading,
    Shot, Simulation, Truth, WebcamShot,
};

/// Start time of every simulated log.
const EPOCH: Stamp = Stamp::from_nanos(1_700_000_000_000_000_000);
const LASER_FRAME: &str = "laser";
const LIDAR_FRAME: &str = "lidar";
/// Frame of the camera.
pub const CAMERA_FRAME: &str = "camera_color_optical_frame";
/// Joints of the wheel encoders, left and right.
const WHEEL_JOINTS: [&str; 2] = ["left_wheel_joint", "right_wheel_joint"];
/// JPEG quality that cameras of robots use.
const JPEG_QUALITY: u8 = 85;
/// Topic of the scene itself.
const SCENE_TOPIC: &str = "/simulation/scene";
/// Topic of a driving pipeline's reports, one per image.
const PURSUIT_TOPIC: &str = "/follow/frames";
/// Topic of the robot's true pose in the room. Topics under `/truth` are not for trackers.
const TRUE_ROBOT_TOPIC: &str = "/truth/robot";
/// Topic of the webcams' true poses in the room; `tagalong-papers triangulate` measures them.
const TRUE_WEBCAMS_TOPIC: &str = "/truth/tf_static";
/// Frame of the room's coordinates.
const WORLD_FRAME: &str = "world";

/// Writer of the recordings of a simulated robot, with the topics that robots use.
pub struct Recorder {
    log: MessageLog,
    camera: Camera,
    mirror: Option<ConicalMirror>,
    laser: Option<LaserSettings>,
    webcams: Vec<Camera>,
}

impl Recorder {
    /// Starts a log with the scene and the mount of its cameras.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn create(path: &Path, scene: &Scene, simulation: &Simulation) -> Result<Self, WriteError> {
        let mut log = MessageLog::create(path)?;
        let text = toml::to_string(scene).map_err(|why| WriteError::Io {
            path: path.to_owned(),
            source: io::Error::other(format!("the scene as TOML: {why}")),
        })?;
        log.send(SCENE_TOPIC, EPOCH, &StringMsg { data: text })?;
        let camera = simulation.camera().clone();
        log.send(
            "/tf_static",
            EPOCH,
            &mount("base_link", [(CAMERA_FRAME.into(), camera.robot_from_camera)]),
        )?;
        if let Some(laser) = simulation.laser() {
            let above = Isometry3::translation(0.0, 0.0, laser.height_m);
            log.send("/tf_static", EPOCH, &mount("base_link", [(LASER_FRAME.into(), above)]))?;
        }
        if let Some(lidar) = &scene.lidar {
            let above = Isometry3::translation(0.0, 0.0, lidar.height_m);
            log.send("/tf_static", EPOCH, &mount("base_link", [(LIDAR_FRAME.into(), above)]))?;
        }
        let scanners = scene.lasers.iter().map(|s| (s.name.clone(), s.robot_from_scanner()));
        let ranges = scene.ranges.iter().map(|s| (s.name.clone(), s.robot_from_sensor()));
        let sensors: Vec<(String, Isometry3<f64>)> = scanners.chain(ranges).collect();
        if !sensors.is_empty() {
            log.send("/tf_static", EPOCH, &mount("base_link", sensors))?;
        }
        let webcams: Vec<Camera> = simulation.webcams().cloned().collect();
        if !webcams.is_empty() {
            let poses = webcams.iter().map(|camera| camera.robot_from_camera);
            let named = poses.enumerate().map(|(i, pose)| (webcam_frame(i), pose));
            log.send(TRUE_WEBCAMS_TOPIC, EPOCH, &mount(WORLD_FRAME, named))?;
        }
        let mirror = simulation.panorama().map(|panorama: &Panorama| panorama.mirror);
        Ok(Self { log, camera, mirror, laser: simulation.laser().cloned(), webcams })
    }

    /// Writes one event.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn write(&mut self, event: &Event) -> Result<(), WriteError> {
        match event {
            Event::Odometry(reading) => self.odometry(reading),
            Event::NoOdometry { .. } => Ok(()),
            Event::Sensor(reading) => self.sensor(reading),
            Event::Shot(shot) => self.shot(shot),
            Event::Webcam(shot) => self.webcam(shot),
        }
    }

    /// Writes the report of a pipeline on an image, with the command, at the capture time since the
    /// start.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn pursuit<T: Serialize>(
        &mut self,
        captured_ns: u64,
        report: &T,
    ) -> Result<(), WriteError> {
        self.log.send_json(PURSUIT_TOPIC, log_stamp(captured_ns), report)
    }

    /// Completes the file.
    ///
    /// # Errors
    /// [`WriteError`] if the file cannot be written.
    pub fn finish(self) -> Result<(), WriteError> {
        self.log.finish()
    }

    fn odometry(&mut self, reading: &OdometryReading) -> Result<(), WriteError> {
        let at = log_stamp(reading.at_ns);
        self.log.send("/cmd_vel", at, &command(reading))?;
        self.log.send("/joint_states", at, &wheels(reading))?;
        self.log.send("/odom", at, &odometry(reading))
    }

    fn shot(&mut self, shot: &Shot) -> Result<(), WriteError> {
        let captured = log_stamp(shot.stamp_ns);
        let recorded = log_stamp(shot.recorded_ns);
        let header = Header::new(captured, CAMERA_FRAME);
        self.describe(recorded, &shot.camera)?;
        let images = &shot.images;
        if let Some((laser, ranges)) = self.laser.as_ref().zip(shot.laser.as_ref()) {
            let header = Header::new(captured, LASER_FRAME);
            self.log.send("/scan", recorded, &scan(header, laser, ranges))?;
        }
        if let Some(points) = &shot.lidar {
            let cloud = PointCloud2::of_points(Header::new(captured, LIDAR_FRAME), points);
            self.log.send("/points", recorded, &cloud)?;
        }
        if let Some(colour) = &images.colour {
            self.info("color", recorded, &header, 0.0)?;
            self.colour("/camera/color", recorded, &header, colour)?;
        }
        if let Some(depth) = &images.depth {
            // Depth has its own capture time, and cannot be recorded before it.
            let offset_ns = shot.depth_ns.saturating_sub(shot.stamp_ns);
            let recorded = recorded.max(log_stamp(shot.captured_ns + offset_ns));
            let header = Header::new(log_stamp(shot.depth_ns), CAMERA_FRAME);
            self.info("aligned_depth_to_color", recorded, &header, 0.0)?;
            self.depth(recorded, &header, depth)?;
        }
        let left = images.grey.as_deref().map(|image| ("left", image, 0.0));
        let right = images.right.as_deref().map(|right| ("right", &right.image, right.baseline_m));
        for (side, image, aside_m) in left.into_iter().chain(right) {
            self.info(side, recorded, &header, aside_m)?;
            self.grey(side, recorded, &header, image)?;
        }
        self.log.send(TRUE_ROBOT_TOPIC, recorded, &true_robot(captured, &shot.world_from_robot))?;
        self.log.send_truth(recorded, &truth(captured, &shot.truth))
    }

    /// Writes a reading of a further obstacle sensor, on the topic of its kind and name.
    fn sensor(&mut self, reading: &SensorReading) -> Result<(), WriteError> {
        let name: &str = &reading.name;
        let at = log_stamp(reading.at_ns);
        let stamp = log_stamp(reading.stamp_ns);
        match &reading.data {
            SensorData::Scan { scanner, ranges } => {
                let message = scan(Header::new(stamp, name), &scanner.laser(), ranges);
                self.log.send(&format!("/scan/{name}"), at, &message)
            }
            SensorData::Range { sensor, reading } => {
                let message = range(Header::new(stamp, name), sensor.kind, reading);
                self.log.send(&format!("/range/{name}"), at, &message)
            }
            SensorData::Bumper(is_pressed) => {
                self.log.send(&format!("/bumper/{name}"), at, &BoolMsg { data: *is_pressed })
            }
        }
    }

    /// Sets the camera of the next images; the transform of a mount that has moved is written once.
    fn describe(&mut self, at: Stamp, camera: &Arc<Camera>) -> Result<(), WriteError> {
        let pose = camera.robot_from_camera;
        if pose != self.camera.robot_from_camera {
            self.log.send("/tf_static", at, &mount("base_link", [(CAMERA_FRAME.into(), pose)]))?;
        }
        self.camera = Camera::clone(camera);
        Ok(())
    }

    fn webcam(&mut self, shot: &WebcamShot) -> Result<(), WriteError> {
        let Some(camera) = self.webcams.get(shot.webcam) else { return Ok(()) };
        let at = log_stamp(shot.captured_ns);
        let header = Header::new(at, webcam_frame(shot.webcam));
        let topic = format!("/webcam_{}", shot.webcam + 1);
        if let Some(info) = info(camera, &header, 0.0) {
            self.log.send(&format!("{topic}/camera_info"), at, &info)?;
        }
        self.colour(&topic, at, &header, &shot.image)
    }

    fn colour(
        &mut self,
        camera: &str,
        at: Stamp,
        header: &Header,
        image: &RgbImage,
    ) -> Result<(), WriteError> {
        let data = jpeg(image);
        let format = "rgb8; jpeg compressed bgr8".into();
        let message = CompressedImage { header: header.clone(), format, data: &data };
        self.log.send(&format!("{camera}/image_raw/compressed"), at, &message)
    }

    fn depth(&mut self, at: Stamp, header: &Header, depth: &DepthImage) -> Result<(), WriteError> {
        let mut data = vec![0; 2 * depth.pixels().len()];
        for (to, metres) in data.as_chunks_mut::<2>().0.iter_mut().zip(depth.pixels()) {
            *to = millimetres(*metres).to_le_bytes();
        }
        let message = self.raw(header, "16UC1", 2, &data);
        self.log.send("/camera/aligned_depth_to_color/image_raw", at, &message)
    }

    fn grey(
        &mut self,
        side: &str,
        at: Stamp,
        header: &Header,
        image: &GreyImage,
    ) -> Result<(), WriteError> {
        let message = self.raw(header, "mono8", 1, image.pixels());
        self.log.send(&format!("/camera/{side}/image_rect"), at, &message)
    }

    fn raw<'a>(&self, header: &Header, encoding: &str, bytes: u32, data: &'a [u8]) -> Image<'a> {
        let width = self.camera.width as u32;
        let height = self.camera.height as u32;
        let encoding = encoding.into();
        let step = bytes * width;
        Image { header: header.clone(), height, width, encoding, is_bigendian: 0, step, data }
    }

    /// Writes the calibration of a camera that stands `aside_m` to the right.
    fn info(
        &mut self,
        name: &str,
        at: Stamp,
        header: &Header,
        aside_m: f64,
    ) -> Result<(), WriteError> {
        let Some(mut info) = info(&self.camera, header, aside_m) else { return Ok(()) };
        if let Some(mirror) = &self.mirror {
            info.distortion_model = CONICAL_MIRROR.into();
            info.d = mirror_coefficients(mirror).to_vec();
        }
        self.log.send(&format!("/camera/{name}/camera_info"), at, &info)
    }
}

fn info(camera: &Camera, header: &Header, aside_m: f64) -> Option<CameraInfo> {
    let Lens::Pinhole(lens) = camera.lens else { return None };
    let size = (camera.width, camera.height);
    Some(CameraInfo::of_lens(header, &lens, size, aside_m))
}

fn webcam_frame(index: usize) -> String {
    format!("webcam_{}_optical_frame", index + 1)
}

/// Returns the stamp in a simulated log of a time since the start, ns.
pub fn log_stamp(start_ns: u64) -> Stamp {
    Stamp::from_nanos(EPOCH.nanos() + start_ns)
}

fn jpeg(image: &RgbImage) -> Vec<u8> {
    let mut out = Vec::new();
    let width = image.width() as u32;
    let height = image.height() as u32;
    let written = JpegEncoder::new_with_quality(&mut out, JPEG_QUALITY).encode(
        image.pixels().as_flattened(),
        width,
        height,
        ExtendedColorType::Rgb8,
    );
    debug_assert!(written.is_ok(), "scenes have at most 4096 columns and rows");
    out
}

/// Converts to millimetres, rounded and at most what 16 bits hold; 0 is "no reading", as in REP
/// 118. A call of a rounding function, or a cast that checks its range, would prevent the compiler
/// from vectorising the loop over an image.
#[inline]
fn millimetres(depth_m: f32) -> u16 {
    // From this power of two on, the last bits of the float are the integer itself.
    const WHOLE: f32 = 8_388_608.0;
    let is_reading = (depth_m > 0.0) & (depth_m < f32::INFINITY);
    let exact = if is_reading { 1000.0 * depth_m } else { 0.0 };
    let exact = if exact < 65_535.0 { exact } else { 65_535.0 };
    let near = exact + WHOLE - WHOLE;
    let below = if near > exact { near - 1.0 } else { near };
    let rounded = if exact - below >= 0.5 { below + 1.0 } else { below };
    (rounded + WHOLE).to_bits() as u16
}

/// Returns static transforms to sensors from the frame of their poses.
fn mount(parent: &str, sensors: impl IntoIterator<Item = (String, Isometry3<f64>)>) -> TFMessage {
    TFMessage {
        transforms: sensors
            .into_iter()
            .map(|(child_frame_id, pose)| TransformStamped {
                header: Header::new(EPOCH, parent),
                child_frame_id,
                transform: (&pose).into(),
            })
            .collect(),
    }
}

fn range(header: Header, kind: RangeKind, reading: &RangeReading) -> Range {
    Range {
        header,
        radiation_type: match kind {
            RangeKind::Sonar => Range::ULTRASOUND,
            RangeKind::Infrared => Range::INFRARED,
        },
        field_of_view: reading.field_of_view_rad as f32,
        min_range: reading.min_m as f32,
        max_range: reading.max_m as f32,
        range: reading.range_m as f32,
    }
}

fn scan(header: Header, laser: &LaserSettings, ranges: &[f32]) -> LaserScan {
    let first = laser.first_rad();
    let step = laser.step_rad();
    LaserScan {
        header,
        angle_min: first as f32,
        angle_max: (first + step * (laser.rays - 1) as f64) as f32,
        angle_increment: step as f32,
        range_min: laser.min_range_m as f32,
        range_max: laser.max_range_m as f32,
        ranges: ranges.to_vec(),
        ..LaserScan::default()
    }
}

fn true_robot(captured: Stamp, world_from_robot: &Isometry2<f64>) -> PoseStamped {
    let pose = (&spatial_pose(world_from_robot)).into();
    PoseStamped { header: Header::new(captured, WORLD_FRAME), pose }
}

fn odometry(reading: &OdometryReading) -> Odometry {
    let pose = spatial_pose(&reading.odom_from_robot);
    let stamp = log_stamp(reading.stamp_ns);
    let mut odometry = Odometry::of_pose(stamp, "odom", "base_link", &pose);
    odometry.twist.twist.linear.x = reading.speed_mps;
    odometry.twist.twist.angular.z = reading.turn_rate;
    odometry
}

fn wheels(reading: &OdometryReading) -> JointState {
    JointState {
        header: Header::new(log_stamp(reading.stamp_ns), "base_link"),
        name: WHEEL_JOINTS.map(String::from).to_vec(),
        position: reading.encoders.map(|encoder| encoder.angle_rad).to_vec(),
        velocity: reading.encoders.map(|encoder| encoder.rate_rad_s).to_vec(),
        effort: Vec::new(),
    }
}

fn command(reading: &OdometryReading) -> TwistStamped {
    let mut command = TwistStamped {
        header: Header::new(log_stamp(reading.at_ns), "base_link"),
        ..TwistStamped::default()
    };
    command.twist.linear.x = reading.commanded_mps;
    command.twist.angular.z = reading.commanded_turn_rate;
    command
}

fn truth(captured: Stamp, people: &[Truth]) -> TruthFrame {
    fn corners(rect: Rect) -> [f64; 4] {
        [rect.x, rect.y, rect.width, rect.height]
    }

    fn person(truth: &Truth) -> TruthPerson {
        TruthPerson {
            id: i64::from(truth.id),
            head_in_robot_m: Some(truth.head_in_robot.coords.into()),
            torso_in_robot_m: Some(truth.torso_in_robot.coords.into()),
            upper_body_px: truth.upper_body.map(corners),
            visible_px: truth.visible.map(corners),
            visible: truth.visible_fraction,
            occluder: truth.occluder.map(i64::from),
            ignore: truth.ignore,
            joints: truth.joints.iter().map(joint).collect(),
        }
    }

    TruthFrame { stamp_ns: captured.nanos(), people: people.iter().map(person).collect() }
}

fn joint(joint: &Joint) -> (String, TruthJoint) {
    // A tenth of a millimetre and of a pixel: all digits would be most of a log without colour.
    fn rounded(value: f64, parts: f64) -> f64 {
        (value * parts).round() / parts
    }

    let in_robot_m = <[f64; 3]>::from(joint.in_robot.coords).map(|m| rounded(m, 1e4));
    let px = joint.pixel.map(|pixel| [pixel.x, pixel.y].map(|px| rounded(px, 10.0)));
    (joint.name.into(), TruthJoint { in_robot_m, px, in_sight: joint.in_sight })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_depth_has_the_nearest_millimetre_and_none_is_zero() {
        for steps in 0..700_000_u32 {
            let depth_m = 1e-4 * steps as f32;
            assert_eq!(millimetres(depth_m), (1000.0 * depth_m).round() as u16, "{depth_m}");
        }
        // Halves, the number below one, and what has no place.
        let others = [0.0005, 0.0015, 0.000_499_999_97, 65.5345, 65.5355, 1e30, 0.0, -0.0, -2.0];
        for depth_m in others {
            assert_eq!(millimetres(depth_m), (1000.0 * depth_m).round() as u16, "{depth_m}");
        }
        assert_eq!([f32::NAN, f32::INFINITY].map(millimetres), [0; 2]);
    }
}
