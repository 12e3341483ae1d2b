//! The choice of inputs and the account of it, on small invented logs of many kinds.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

#[path = "common/mod.rs"]
mod common;

use common::{LogWriter, SavedLog, at, camera, level_pose, sweep};
use nalgebra::{Isometry3, Vector3};
use tagalong_core::Stamp;
use tagalong_log::msgs::{CompressedImage, Float32Msg, Header, Image, LaserScan, Pose, encode};
use tagalong_log::{
    CameraSettings, FrameSource, Input, InputSettings, Inputs, LogError, StampSource, TopicUse,
};

const DEPTH: Inputs = Inputs::ANY.require(Input::Colour).require(Input::Depth);

/// Stream of images in an invented log.
struct Stream<'a> {
    topic: &'a str,
    frame: &'a str,
    encoding: &'a str,
    size: (u32, u32),
    count: u32,
}

impl Default for Stream<'_> {
    fn default() -> Self {
        Self { topic: "", frame: "optical", encoding: "rgb8", size: (16, 12), count: 4 }
    }
}

impl Stream<'_> {
    fn write(&self, log: &mut LogWriter, stamp_of: impl Fn(u32) -> Stamp) {
        let bytes = match self.encoding {
            "rgb8" => 3,
            "mono8" => 1,
            "32FC1" => 4,
            _ => 2,
        };
        for index in 0..self.count {
            let values = (0..self.size.0 * self.size.1).flat_map(|_| match self.encoding {
                "32FC1" => 2.0_f32.to_le_bytes().to_vec(),
                "16UC1" | "mono16" => 2000_u16.to_le_bytes().to_vec(),
                _ => vec![index as u8; bytes],
            });
            let data: Vec<u8> = values.collect();
            let header = Header::new(stamp_of(index), self.frame);
            let image = Image::packed(header, self.encoding, self.size.0, self.size.1, &data);
            log.bytes::<Image<'_>>(self.topic, recorded(index), &encode(&image));
        }
    }
}

fn recorded(index: u32) -> Stamp {
    at(0.1 * f64::from(index))
}

fn colour<'a>(topic: &'a str, frame: &'a str) -> Stream<'a> {
    Stream { topic, frame, ..Stream::default() }
}

fn depth<'a>(topic: &'a str, frame: &'a str) -> Stream<'a> {
    Stream { topic, frame, encoding: "16UC1", ..Stream::default() }
}

fn info(log: &mut LogWriter, topic: &str, frame: &str, size: (u32, u32)) {
    let camera = camera(size.0 as usize, size.1 as usize, 0.9 * f64::from(size.0));
    log.info(topic, frame, &camera);
}

/// Starts a log with a fixed camera and its calibration.
fn log_of_camera(info_topic: &str, size: (u32, u32)) -> LogWriter {
    let mut log = LogWriter::plain();
    log.fixed("base_link", "optical", &level_pose());
    info(&mut log, info_topic, "optical", size);
    log
}

fn open_with(
    log: LogWriter,
    input: &InputSettings,
    inputs: Inputs,
) -> Result<(FrameSource, SavedLog), LogError> {
    let saved = log.save();
    Ok((saved.open(input, inputs)?, saved))
}

fn open(log: LogWriter, inputs: Inputs) -> (FrameSource, SavedLog) {
    open_with(log, &InputSettings::default(), inputs).unwrap()
}

fn used(source: &FrameSource, input: &str) -> String {
    source.account().used_as(input).map(|entry| entry.topic.clone()).unwrap_or_default()
}

fn entry<'a>(source: &'a FrameSource, topic: &str) -> &'a TopicUse {
    let found = source.account().topics.iter().find(|entry| entry.topic == topic);
    found.unwrap_or_else(|| panic!("{topic} is not in the account"))
}

fn count_frames(source: &mut FrameSource) -> usize {
    std::iter::from_fn(|| source.next_frame()).count()
}

/// Names of the colour and the depth topic of two devices, as drivers give them.
const DEVICES: [[(&str, &str); 2]; 8] = [
    [
        ("/front_camera/color/image_raw", "/front_camera/aligned_depth_to_color/image_raw"),
        ("/back_camera/color/image_raw", "/back_camera/aligned_depth_to_color/image_raw"),
    ],
    [
        ("/camera_1/rgb/image_raw", "/camera_1/depth_registered/image_raw"),
        ("/camera_2/rgb/image_raw", "/camera_2/depth_registered/image_raw"),
    ],
    [("/color/front", "/depth/front"), ("/color/rear", "/depth/rear")],
    [
        ("/left_cam/color/image_raw", "/left_cam/depth/image_raw"),
        ("/right_cam/color/image_raw", "/right_cam/depth/image_raw"),
    ],
    [
        ("/zed_a/zed_node/rgb/image_rect_color", "/zed_a/zed_node/depth/depth_registered"),
        ("/zed_b/zed_node/rgb/image_rect_color", "/zed_b/zed_node/depth/depth_registered"),
    ],
    [
        ("/device_0/sensor_1/Color_0/image/data", "/device_0/sensor_0/Depth_0/image/data"),
        ("/device_1/sensor_1/Color_0/image/data", "/device_1/sensor_0/Depth_0/image/data"),
    ],
    [
        ("/spot/camera/frontleft/image", "/spot/depth_registered/frontleft/image"),
        ("/spot/camera/back/image", "/spot/depth_registered/back/image"),
    ],
    [
        ("/robot/cam0/image_color", "/robot/cam0/image_depth"),
        ("/robot/cam1/image_color", "/robot/cam1/image_depth"),
    ],
];

/// Writes a log of two devices; the depth of the second one has a message more.
fn two_devices(devices: &[(&str, &str); 2]) -> LogWriter {
    let mut log = LogWriter::plain();
    for (place, (of_colour, of_depth)) in devices.iter().enumerate() {
        let frame = format!("optical_{place}");
        let yaw = Vector3::new(0.0, 0.0, 3.0 * place as f64);
        log.fixed("base_link", &frame, &(Isometry3::new(Vector3::zeros(), yaw) * level_pose()));
        for topic in [of_colour, of_depth] {
            let folder = topic.rsplit_once('/').unwrap().0;
            info(&mut log, &format!("{folder}/camera_info_{place}"), &frame, (16, 12));
        }
        colour(of_colour, &frame).write(&mut log, recorded);
        let count = 4 + place as u32;
        Stream { count, ..depth(of_depth, &frame) }.write(&mut log, recorded);
    }
    log
}

#[test]
fn all_images_are_of_one_device() {
    for devices in &DEVICES {
        let (source, _saved) = open(two_devices(devices), DEPTH);
        let of_colour = used(&source, "colour");
        let of_depth = used(&source, "depth");
        let is_pair = devices.contains(&(&of_colour, &of_depth));
        assert!(is_pair, "{of_colour} with {of_depth}");
        let other = devices.iter().find(|device| device.0 != of_colour).unwrap();
        let why = entry(&source, other.1);
        assert_eq!(why.problem.as_deref(), Some("it is of another camera"), "{why}");
        // The remedy works.
        let camera = why.camera.clone().unwrap();
        assert!(why.remedy.as_ref().unwrap().contains(&camera), "{why}");
        let input = InputSettings {
            camera: Some(CameraSettings::Named(camera)),
            ..InputSettings::default()
        };
        let (source, _saved) = open_with(two_devices(devices), &input, DEPTH).unwrap();
        let chosen = (used(&source, "colour"), used(&source, "depth"));
        assert_eq!((&*chosen.0, &*chosen.1), *other, "by name");
    }
}

#[test]
fn a_camera_that_is_not_there_is_refused_with_those_that_are() {
    let input = InputSettings {
        camera: Some(CameraSettings::Named("/side".into())),
        ..InputSettings::default()
    };
    let error = open_with(two_devices(&DEVICES[0]), &input, DEPTH).err().unwrap().to_string();
    assert!(error.contains("`/side`") && error.contains("/back_camera, /front_camera"), "{error}");
}

#[test]
fn streams_whose_names_have_nothing_in_common_are_one_device_unless_they_look_apart() {
    let [near, apart] = [0.1, 3.0].map(|yaw_rad| {
        let mut log = LogWriter::plain();
        log.fixed("base_link", "a", &level_pose());
        let turned = Isometry3::new(Vector3::zeros(), Vector3::new(0.0, 0.0, yaw_rad));
        log.fixed("base_link", "b", &(turned * level_pose()));
        for (topic, frame) in [("/usb_cam/camera_info", "a"), ("/kinect/camera_info", "b")] {
            info(&mut log, topic, frame, (16, 12));
        }
        colour("/usb_cam/image_raw", "a").write(&mut log, recorded);
        depth("/kinect/image", "b").write(&mut log, recorded);
        log.save()
    });
    let source = near.open(&InputSettings::default(), Inputs::ANY).unwrap();
    assert_eq!(used(&source, "depth"), "/kinect/image");
    let source = apart.open(&InputSettings::default(), Inputs::ANY).unwrap();
    assert!(used(&source, "colour").is_empty() || used(&source, "depth").is_empty());
    // Both are used if the settings name both.
    let input = InputSettings {
        colour_topic: Some("/usb_cam/image_raw".into()),
        depth_topic: Some("/kinect/image".into()),
        ..InputSettings::default()
    };
    let source = apart.open(&input, DEPTH).unwrap();
    assert_eq!(used(&source, "depth"), "/kinect/image");
}

#[test]
fn calibrations_are_found_in_other_folders() {
    for (image, other, wanted) in [
        (
            "/d/s1/Color_0/image/data",
            "/d/s0/Depth_0/info/camera_info",
            "/d/s1/Color_0/info/camera_info",
        ),
        ("/cam/color/image_raw", "/cam/depth/camera_info", "/cam/color/meta/camera_info"),
        ("/cam/rgb/image/compressed", "/cam/ir/camera_info", "/cam/info/rgb"),
        ("/left/image_raw", "/right/camera_info", "/calibration/left"),
        ("/front/color/image", "/rear/color/camera_info", "/info/front/color"),
    ] {
        let mut log = LogWriter::plain();
        log.fixed("base_link", "optical", &level_pose());
        info(&mut log, other, "other", (32, 24));
        info(&mut log, wanted, "optical", (16, 12));
        colour(image, "optical").write(&mut log, recorded);
        let (source, _saved) = open(log, Inputs::ANY);
        assert_eq!(source.facts().calibration_topic.as_deref(), Some(wanted), "{image}");
        assert!(entry(&source, image).calibration.as_ref().unwrap().starts_with(wanted));
        let told = source.notes().iter().any(|note| note.contains(wanted));
        assert!(told, "{:?}", source.notes());
    }
}

#[test]
fn calibrations_of_other_sizes_are_scaled_or_told() {
    for (calibrated, is_scaled) in
        [((16, 12), true), ((32, 24), true), ((64, 48), true), ((8, 6), true), ((20, 15), false)]
    {
        let mut log = log_of_camera("/cam/camera_info", calibrated);
        colour("/cam/image_raw", "optical").write(&mut log, recorded);
        let found = open_with(log, &InputSettings::default(), Inputs::ANY);
        assert_eq!(found.is_ok(), is_scaled, "{calibrated:?}");
        if let Ok((source, _saved)) = found {
            assert!((source.facts().focal_px - 0.9 * 16.0).abs() < 1e-9, "{calibrated:?}");
        }
    }
}

#[test]
fn depth_that_cannot_be_registered_names_the_topic_and_the_cause() {
    for (size, info_of_depth, has_tf, cause) in [
        ((24, 18), Some((16, 12)), true, "calibrated for 16x12, but the images are 24x18"),
        ((24, 18), Some((20, 12)), true, "calibrated for 20x12, but the images are 24x18"),
        ((24, 18), None, true, "no calibration (sensor_msgs/CameraInfo) belongs to it"),
        ((24, 18), Some((24, 18)), false, "tf does not connect its frame `depth_optical`"),
        (
            (10, 10),
            Some((30, 20)),
            true,
            "its images are 10x10, those of /cam/color/image_raw 16x12",
        ),
    ] {
        let mut log = LogWriter::plain();
        log.fixed("base_link", "optical", &level_pose());
        if has_tf {
            log.fixed("base_link", "depth_optical", &level_pose());
        }
        info(&mut log, "/cam/color/camera_info", "optical", (16, 12));
        if let Some(calibrated) = info_of_depth {
            info(&mut log, "/cam/depth/camera_info", "depth_optical", calibrated);
        }
        colour("/cam/color/image_raw", "optical").write(&mut log, recorded);
        let stream = Stream { size, ..depth("/cam/depth/image_rect_raw", "depth_optical") };
        stream.write(&mut log, recorded);
        let (source, _saved) = open(log, Inputs::ANY);
        let told = entry(&source, "/cam/depth/image_rect_raw");
        assert!(told.problem.as_ref().unwrap().contains(cause), "{cause}: {told}");
        assert_eq!(told.could_be, Some("depth"));
        assert!(!source.account().usable().contains(&"depth"), "{told}");
    }
}

#[test]
fn depth_at_other_times_is_told_with_the_offset() {
    for (offset_s, remedy) in [
        (0.2, "`pair_tolerance_s = 0."),
        (-0.05, "`pair_tolerance_s = 0."),
        (3600.0, "`--stamps recording`"),
        (-1.6e9, "`--stamps recording`"),
        (40.0, "`--stamps recording`"),
    ] {
        let mut log = log_of_camera("/cam/camera_info", (16, 12));
        Stream { count: 1, ..colour("/cam/color", "optical") }.write(&mut log, recorded);
        Stream { count: 1, ..depth("/cam/depth", "optical") }
            .write(&mut log, |index| recorded(index).plus_seconds(offset_s));
        let saved = log.save();
        let source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        let told = entry(&source, "/cam/depth");
        assert!(told.remedy.as_ref().unwrap().contains(remedy), "{offset_s}: {told}");
        let input = InputSettings { stamps: StampSource::Recording, ..InputSettings::default() };
        let source = saved.open(&input, Inputs::ANY).unwrap();
        assert!(source.account().usable().contains(&"depth"), "{offset_s}");
    }
}

#[test]
fn the_times_of_recording_are_no_remedy_where_they_are_taken() {
    for (late_s, remedy) in [(0.05, "`pair_tolerance_s = 0.07`"), (60.0, "record it together")] {
        let mut log = log_of_camera("/cam/camera_info", (16, 12));
        Stream { count: 1, ..colour("/cam/color", "optical") }.write(&mut log, recorded);
        let header = Header::new(recorded(0), "optical");
        let image = Image::packed(header, "16UC1", 16, 12, &[1; 16 * 12 * 2]);
        log.bytes::<Image<'_>>("/cam/depth", at(late_s), &encode(&image));
        let input = InputSettings { stamps: StampSource::Recording, ..InputSettings::default() };
        let (source, _saved) = open_with(log, &input, Inputs::ANY).unwrap();
        let told = entry(&source, "/cam/depth");
        assert!(told.remedy.as_ref().unwrap().contains(remedy), "{late_s}: {told}");
        assert!(!told.to_string().contains("--stamps"), "{late_s}: {told}");
    }
}

#[test]
fn stamps_that_are_never_set_are_replaced_by_the_times_of_recording() {
    for stamp in [0.0, 1.0, 1e-9, 1.7e9, 2e9] {
        let stamp = Stamp::default().plus_seconds(stamp);
        let mut log = log_of_camera("/cam/camera_info", (16, 12));
        // Depth first, because an image does not wait for it until the end of the log.
        depth("/cam/depth", "optical").write(&mut log, |_| stamp);
        colour("/cam/color", "optical").write(&mut log, |_| stamp);
        let saved = log.save();
        let mut source = saved.open(&InputSettings::default(), DEPTH).unwrap();
        assert!(source.notes().iter().any(|note| note.contains("are not set: all are")));
        assert_eq!(count_frames(&mut source), 4);
        assert!(!source.data_lost(), "{:?}", source.notes());
        // If the settings insist on the stamps, images are lost, and reported as lost.
        let input = InputSettings { stamps: StampSource::Header, ..InputSettings::default() };
        let mut source = saved.open(&input, DEPTH).unwrap();
        assert_eq!(count_frames(&mut source), 1);
        assert!(source.data_lost() && source.counters()["frames_of_same_stamp"] == 3);
    }
}

#[test]
fn odometry_of_another_clock_gives_no_places() {
    for offset_s in [-1.7e9, 3600.0, -30.0, 5.0, 1e5] {
        let mut log = log_of_camera("/cam/camera_info", (16, 12));
        colour("/cam/color", "optical").write(&mut log, recorded);
        for index in 0..4 {
            let pose = Pose::from(&Isometry3::translation(f64::from(index), 0.0, 0.0));
            let stamp = recorded(index).plus_seconds(offset_s);
            log.odometry_of(recorded(index), stamp, pose);
        }
        let saved = log.save();
        let source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        assert!(source.lacks_usable_odometry() && !source.has_odometry(), "{offset_s}");
        let told = entry(&source, "/odom");
        let offset = format!("begins {:.1} s", offset_s.abs());
        assert!(told.problem.as_ref().unwrap().contains(&offset), "{told}");
        let input = InputSettings { stamps: StampSource::Recording, ..InputSettings::default() };
        let mut source = saved.open(&input, Inputs::ANY).unwrap();
        let last = std::iter::from_fn(|| source.next_frame()).last().unwrap();
        assert!((last.odom_from_robot.translation.x - 3.0).abs() < 1e-6, "{offset_s}");
    }
}

/// Writes a log with colour, and compressed images on another topic.
fn log_with_compressed(topic: &str, format: &str, data: &[u8]) -> LogWriter {
    let mut log = log_of_camera("/cam/color/camera_info", (16, 12));
    colour("/cam/color/image_raw", "optical").write(&mut log, recorded);
    for index in 0..4 {
        let header = Header::new(recorded(index), "optical");
        let image = CompressedImage { header, format: format.into(), data };
        log.message(topic, recorded(index), &image);
    }
    log
}

#[test]
fn depth_as_jpeg_is_told_to_be_none() {
    let jpeg = include_bytes!("data/gradient-grey.jpg");
    for (topic, format) in [
        ("/cam/depth/image_raw/compressed", "16UC1; jpeg compressed "),
        ("/cam/depth/image_raw/compressed", "32FC1; jpeg compressed mono8"),
        ("/cam/aligned_depth_to_color/image/compressed", "jpeg"),
        ("/cam/depth_registered/compressed", "mono16; jpeg compressed mono8"),
        ("/anything", "16UC1; jpeg"),
    ] {
        let (source, _saved) = open(log_with_compressed(topic, format, jpeg), Inputs::ANY);
        let told = entry(&source, topic);
        assert!(told.problem.as_ref().unwrap().contains("JPEG keeps 8 of"), "{told}");
        assert_eq!((told.used_as.as_ref(), told.could_be), (None, Some("depth")), "{told}");
        let input = InputSettings { depth_topic: Some(topic.into()), ..InputSettings::default() };
        let log = log_with_compressed(topic, format, jpeg);
        let error = open_with(log, &input, DEPTH).err().unwrap().to_string();
        assert!(error.contains("JPEG keeps") && error.contains(topic), "{error}");
    }
}

/// Returns a PNG of 16 columns and 12 rows with one grey value of 16 bits.
fn deep_png(value: u16) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, 16, 12);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = (0..16 * 12).flat_map(|_| value.to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    out
}

#[test]
fn sixteen_bits_of_grey_are_depth_by_content_if_their_name_says_so_or_the_user() {
    let png = deep_png(2500);
    for (topic, format, is_named) in [
        ("/cam/depth/image/compressed", "png", true),
        ("/cam/aligned_depth_to_color/compressed", "mono16; png compressed mono16", true),
        ("/cam/depth_registered", "PNG", true),
        ("/cam/image/compressed", "png", false),
        ("/cam/deep", "", false),
    ] {
        let saved = log_with_compressed(topic, format, &png).save();
        let named = InputSettings { depth_topic: Some(topic.into()), ..InputSettings::default() };
        let unit = InputSettings { depth_unit_m: Some(0.01), ..named.clone() };
        let mut expected = vec![(named, 2.5), (unit, 25.0)];
        if is_named {
            expected.push((InputSettings::default(), 2.5));
        }
        for (input, metres) in expected {
            let found = saved.open(&input, DEPTH).unwrap().next_frame().unwrap();
            let depth = found.frame.depth().unwrap().get(3, 3).unwrap();
            assert!((depth - metres).abs() < 1e-4, "{topic}: {depth} m");
        }
        if is_named {
            continue;
        }
        let source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        let told = entry(&source, topic);
        assert!(told.to_string().contains("could be depth"), "{told}");
        assert!(told.remedy.as_ref().unwrap().contains("`depth_topic`"), "{told}");
    }
}

#[test]
fn grey_images_of_16_bits_are_depth_by_their_name() {
    for (topic, is_depth) in [
        ("/cam/depth/image_raw", true),
        ("/cam/aligned_depth_to_color/image_raw", true),
        ("/device_0/sensor_0/Depth_0/image/data", true),
        ("/cam/depth/ir/image", false),
        ("/cam/infra1/image", false),
    ] {
        let mut log = log_of_camera("/cam/color/camera_info", (16, 12));
        colour("/cam/color/image_raw", "optical").write(&mut log, recorded);
        Stream { encoding: "mono16", ..depth(topic, "optical") }.write(&mut log, recorded);
        let (source, _saved) = open(log, Inputs::ANY);
        assert_eq!(used(&source, "depth") == topic, is_depth, "{topic}");
        if !is_depth {
            assert!(entry(&source, topic).problem.as_ref().unwrap().contains("could be depth"));
        }
    }
}

#[test]
fn images_of_other_streams_are_depth_only_if_they_are_named() {
    for (topic, encoding) in [
        ("/cam/ir/image_raw", "16UC1"),
        ("/cam/infra1/image_rect_raw", "16UC1"),
        ("/zed/confidence/confidence_map", "32FC1"),
    ] {
        let mut log = log_of_camera("/cam/color/camera_info", (16, 12));
        colour("/cam/color/image_raw", "optical").write(&mut log, recorded);
        Stream { encoding, ..depth(topic, "optical") }.write(&mut log, recorded);
        let saved = log.save();
        let source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        assert_eq!(used(&source, "depth"), "", "{topic}");
        let told = entry(&source, topic);
        assert!(told.to_string().contains("its name says infrared or confidence"), "{told}");
        assert!(told.remedy.as_ref().unwrap().contains("`depth_topic`"), "{told}");
        assert_eq!(told.could_be, Some("depth"));
        let error = saved.open(&InputSettings::default(), DEPTH).err().unwrap().to_string();
        assert!(error.contains(&format!("if {topic} (")) && error.contains("is meant"), "{error}");
        let input = InputSettings { depth_topic: Some(topic.into()), ..InputSettings::default() };
        let found = saved.open(&input, DEPTH).unwrap().next_frame().unwrap();
        assert!((found.frame.depth().unwrap().get(3, 3).unwrap() - 2.0).abs() < 1e-4, "{topic}");
    }
}

#[test]
fn depth_in_the_frame_of_colour_comes_before_any_name() {
    for (registered, other) in [
        ("/depth_to_rgb/image_raw", "/depth/image_raw"),
        ("/cam/depth_to_rgb/image_raw", "/cam/depth/image_raw"),
        ("/cam/depth/image", "/cam/aligned_depth/image"),
    ] {
        let mut log = log_of_camera("/rgb/camera_info", (16, 12));
        colour("/rgb/image_raw", "optical").write(&mut log, recorded);
        depth(other, "depth_camera_link").write(&mut log, recorded);
        depth(registered, "optical").write(&mut log, recorded);
        let (source, _saved) = open(log, DEPTH);
        assert_eq!(used(&source, "depth"), registered);
    }
}

#[test]
fn the_unit_of_depth_is_that_of_its_own_camera() {
    const SECOND: [&str; 2] =
        ["/device_1/sensor_1/Color_0/image/data", "/device_1/sensor_0/Depth_0/image/data"];
    for (units, expected_m) in [
        (&[("/device_0/sensor_0/option/Depth_Units/value", 0.002)][..], 2.0),
        (
            &[
                ("/device_0/sensor_0/option/Depth_Units/value", 0.002),
                ("/device_1/sensor_0/option/Depth_Units/value", 0.0001),
            ],
            0.2,
        ),
        (&[("/depth_units", 0.0001)], 0.2),
        (&[("/other/depth_units", 0.0001)], 2.0),
        (&[("/device_1/a/depth_units", 0.0001), ("/device_1/b/depth_units", 0.002)], 2.0),
    ] {
        let mut log = log_of_camera("/device_1/sensor_1/Color_0/info/camera_info", (16, 12));
        for (topic, unit_m) in units {
            log.message(topic, recorded(0), &Float32Msg { data: *unit_m });
        }
        colour(SECOND[0], "optical").write(&mut log, recorded);
        depth(SECOND[1], "optical").write(&mut log, recorded);
        let (mut source, _saved) = open(log, DEPTH);
        let found = source.next_frame().unwrap();
        let depth_m = found.frame.depth().unwrap().get(3, 3).unwrap();
        assert!((depth_m - expected_m).abs() < 1e-4, "{units:?}: {depth_m} m");
    }
}

#[test]
fn all_scanners_of_the_robot_are_used_and_others_are_told() {
    for (first, second, frame_id, is_used) in [
        ("/scan_front", "/scan_rear", "rear", true),
        ("/scan", "/back/scan", "rear", true),
        ("/laser/left/scan", "/laser/right/scan", "rear", true),
        ("/scan", "/scan_filtered", "front", false),
        ("/scan", "/other/scan", "unknown", false),
    ] {
        let mut log = LogWriter::plain();
        log.fixed("base_link", "front", &Isometry3::translation(0.2, 0.0, 0.3));
        log.fixed("base_link", "rear", &Isometry3::translation(-0.2, 0.0, 0.3));
        for index in 0..4 {
            for (topic, frame) in [(first, "front"), (second, frame_id)] {
                log.message(topic, recorded(index), &sweep(recorded(index), frame));
            }
        }
        let (mut source, _saved) = open(log, Inputs::NONE.require(Input::Laser));
        let frame = source.next_frame().unwrap().frame;
        assert_eq!(frame.scans().count(), 1 + usize::from(is_used), "{second}");
        let told = entry(&source, second);
        assert_eq!(told.used_as.is_some() && told.problem.is_none(), is_used, "{told}");
        assert_eq!(told.problem.is_none(), is_used, "{told}");
        // A second topic of one scanner lacks nothing.
        let is_curable = frame_id == "unknown";
        assert_eq!(told.could_be, is_curable.then_some("laser"), "{told}");
    }
}

#[test]
fn a_further_scanner_that_falls_silent_or_reads_nothing_is_told() {
    for (last, range, told) in [
        (40, 2.0, None),
        (10, 2.0, Some("/scan_rear has scans within 0.25 s of 12 of 40 frames")),
        (40, f32::NAN, Some("/scan_rear: none of its 40 scans has a range between")),
        (40, f32::INFINITY, Some("/scan_rear: none of its 40 scans has a range between")),
    ] {
        let mut log = LogWriter::plain();
        log.fixed("base_link", "front", &Isometry3::translation(0.2, 0.0, 0.3));
        log.fixed("base_link", "rear", &Isometry3::translation(-0.2, 0.0, 0.3));
        for index in 0..40 {
            let stamp = at(0.1 * f64::from(index));
            log.message("/scan", stamp, &sweep(stamp, "front"));
            if index < last {
                let ranges = vec![range; 101];
                log.message("/scan_rear", stamp, &LaserScan { ranges, ..sweep(stamp, "rear") });
            }
        }
        let (mut source, _saved) = open(log, Inputs::NONE.require(Input::Laser));
        while source.next_frame().is_some() {}
        let note = source.notes().iter().find(|note| note.starts_with("/scan_rear"));
        assert_eq!(note.is_some(), told.is_some(), "{:?}", source.notes());
        assert!(note.is_none_or(|note| note.contains(told.unwrap())), "{note:?}");
    }
}

#[test]
fn a_further_scanner_that_cannot_be_could_be_one() {
    let mut log = LogWriter::plain();
    log.fixed("base_link", "front", &Isometry3::translation(0.2, 0.0, 0.3));
    log.fixed("base_link", "rear", &Isometry3::translation(-0.2, 0.0, 0.3));
    for index in 0..4 {
        log.message("/scan", recorded(index), &sweep(recorded(index), "front"));
        let still = LaserScan { angle_increment: 0.0, ..sweep(recorded(index), "rear") };
        log.message("/scan_rear", recorded(index), &still);
    }
    let saved = log.save();
    let source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
    let told = entry(&source, "/scan_rear");
    assert_eq!((told.used_as.as_ref(), told.could_be), (None, Some("laser")), "{told}");
    // Where the settings name one, the others are left out on purpose.
    let laser_topic = Some("/scan".to_owned());
    let named = InputSettings { laser_topic, ..InputSettings::default() };
    let source = saved.open(&named, Inputs::ANY).unwrap();
    assert_eq!(entry(&source, "/scan_rear").could_be, None);
}

#[test]
fn detections_of_types_that_are_not_read_are_listed_with_those_that_are() {
    for kind in [
        "darknet_ros_msgs/msg/BoundingBoxes",
        "darknet_ros_msgs/BoundingBoxes",
        "depthai_ros_msgs/msg/SpatialDetectionArray",
        "people_msgs/msg/People",
        "my_msgs/msg/Detection2DArray",
    ] {
        let mut log = log_of_camera("/cam/camera_info", (16, 12));
        colour("/cam/color", "optical").write(&mut log, recorded);
        log.foreign("/found", kind, "cdr", recorded(0), &[0, 1, 0, 0]);
        let saved = log.save();
        let source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        let told = entry(&source, "/found");
        assert_eq!((told.used_as.as_ref(), told.could_be), (None, None), "{told}");
        assert!(told.kind == kind && told.to_string().contains("Detection3DArray"), "{told}");
        let detections_topic = Some("/found".to_owned());
        let input = InputSettings { detections_topic, ..InputSettings::default() };
        let inputs = Inputs::ANY.require(Input::Detections);
        let error = saved.open(&input, inputs).err().unwrap().to_string();
        assert!(error.contains(kind) && error.contains("vision_msgs/Detection2DArray"), "{error}");
        assert!(!error.contains("leave the key out"), "{error}");
    }
}

#[test]
fn a_scanner_of_another_clock_is_told_with_the_offset() {
    fn unset(_: u32) -> Stamp {
        Stamp::default()
    }

    fn simulated(index: u32) -> Stamp {
        Stamp::default().plus_seconds(12.0 + 0.1 * f64::from(index))
    }

    fn hour(index: u32) -> Stamp {
        recorded(index).plus_seconds(3600.0)
    }

    let clocks: [(&str, &dyn Fn(u32) -> Stamp); 3] = [
        ("its stamps are not set", &unset),
        ("s before it, by another clock", &simulated),
        ("3600.000 s after it", &hour),
    ];
    for (words, stamp_of) in clocks {
        let mut log = log_of_camera("/cam/camera_info", (16, 12));
        log.fixed("base_link", "front", &Isometry3::translation(0.2, 0.0, 0.3));
        log.fixed("base_link", "rear", &Isometry3::translation(-0.2, 0.0, 0.3));
        for index in 0..4 {
            log.message("/scan", recorded(index), &sweep(stamp_of(index), "front"));
            log.message("/scan_rear", recorded(index), &sweep(stamp_of(index), "rear"));
            log.message("/scan_side", recorded(index), &sweep(recorded(index), "base_link"));
        }
        colour("/cam/color", "optical").write(&mut log, recorded);
        let saved = log.save();
        let source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        // By name it would be another.
        assert_eq!(used(&source, "laser"), "/scan_side");
        for topic in ["/scan", "/scan_rear"] {
            let told = entry(&source, topic);
            assert!(told.used_as.is_none() && told.to_string().contains(words), "{told}");
            assert!(told.remedy.as_ref().unwrap().contains("`--stamps recording`"), "{told}");
        }
        // One that the settings name is told as well.
        let named = InputSettings { laser_topic: Some("/scan".into()), ..InputSettings::default() };
        let source = saved.open(&named, Inputs::ANY).unwrap();
        assert!(entry(&source, "/scan").to_string().contains(words));
        assert!(!source.account().usable().contains(&"laser"));
        let input = InputSettings { stamps: StampSource::Recording, ..InputSettings::default() };
        let mut source = saved.open(&input, Inputs::ANY).unwrap();
        let frame = source.next_frame().unwrap().frame;
        assert_eq!(frame.scans().count(), 3, "{words}");
    }
}
