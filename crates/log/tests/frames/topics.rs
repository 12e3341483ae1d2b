//! Topics of a wrong kind or in other encodings, and disparities in place of depth.

use super::*;

/// Writes a log of a stereo camera, with `depth` on its topic of disparities, and without
/// transforms between its frames.
fn stereo_log<T: Message + serde::Serialize>(topic: &str, disparities: &T) -> LogWriter {
    let mut log = LogWriter::plain();
    let left = camera(16, 12, 14.0);
    log.info("/stereo/left/camera_info", "colour", &left);
    let mut right = info_of("colour", &left);
    right.p[3] = -14.0 * 0.1;
    log.message("/stereo/right/camera_info", at(0.0), &right);
    log.fixed("base_link", "colour", &level_pose());
    log.message(topic, at(0.1), disparities);
    log
}

/// Returns an image of 16 columns and 12 rows whose first pixel has no disparity.
fn disparities<'a>(encoding: &str, data: &'a [u8]) -> Image<'a> {
    Image::packed(Header::new(at(0.1), "colour"), encoding, 16, 12, data)
}

#[test]
fn a_disparity_image_is_depth_with_its_own_geometry() {
    let data: Vec<u8> = (0..192_u16).flat_map(|i| f32::from(i.min(4)).to_le_bytes()).collect();
    let message = DisparityImage {
        header: Header::new(at(0.1), "colour"),
        image: disparities("32FC1", &data),
        f: 14.0,
        t: 0.1,
        min_disparity: 1.5,
        max_disparity: 15.0,
        ..DisparityImage::default()
    };
    let log = stereo_log("/stereo/disparity", &message);
    let (source, found) = first_depth(log, &InputSettings::default()).unwrap();
    let depth = found.frame.depth().unwrap();
    let [first, second, third] = [0, 1, 4].map(|x| depth.get(x, 0).unwrap());
    assert!(first.is_nan() && second.is_nan() && (third - 1.4 / 4.0).abs() < 1e-6, "{third}");
    assert_eq!(
        (count(&source, "disparity_pixels"), count(&source, "disparity_pixels_invalid")),
        (192, 2)
    );
    // Its calibration is that of the left camera.
    assert_eq!(source.facts().calibration_topic.as_deref(), Some("/stereo/left/camera_info"));
}

#[test]
fn plain_disparities_take_their_geometry_from_the_calibrations_or_the_settings() {
    let data: Vec<u8> = (0..192).collect();
    let disparity = Some(DisparitySettings::default());
    let input = InputSettings { disparity, ..InputSettings::default() };
    let halves = DisparitySettings { unit_px: Some(0.5), baseline_m: Some(0.2) };
    let told = InputSettings { disparity: Some(halves), ..input.clone() };
    let named = InputSettings { depth_topic: Some("/stereo/disparity".into()), ..input.clone() };
    // The settings find the topic by its name, which is otherwise one of grey images.
    for (input, expected) in [(&input, 1.4 / 7.0), (&told, 2.8 / 3.5), (&named, 1.4 / 7.0)] {
        let log = stereo_log("/stereo/disparity", &disparities("mono8", &data));
        let (_, found) = first_depth(log, input).unwrap();
        let depth = found.frame.depth().unwrap().get(7, 0).unwrap();
        assert!((depth - expected).abs() < 1e-6, "{depth} m");
    }
    // Without a right camera nothing tells the baseline.
    let mut alone = LogWriter::plain();
    alone.info("/stereo/camera_info", "colour", &camera(16, 12, 14.0));
    alone.message("/stereo/disparity", at(0.1), &disparities("mono8", &data));
    let error = first_depth(alone, &input).err().unwrap();
    assert!(error.contains("disparity.baseline_m"), "{error}");
}

/// Writes a log with depth, and with an image in `encoding`.
fn log_with(topic: &str, encoding: &str) -> LogWriter {
    let mut log = started();
    log.depth(at(0.1), "colour", 2.0);
    let data = [0; 16 * 12 * 6];
    log.message(topic, at(0.1), &disparities(encoding, &data));
    log
}

fn refusal(log: LogWriter, input: &InputSettings, inputs: Inputs) -> LogError {
    log.save().open(input, inputs).err().unwrap()
}

#[test]
fn images_in_an_encoding_that_is_not_read_are_named_with_the_remedy() {
    let input = InputSettings::default();
    let colour = Inputs::ANY.require(Input::Colour);
    for (encoding, remedy) in [
        ("rgb16", "let the driver publish 8 bits"),
        ("bayer_rggb12", "encoding `bayer_rggb12` is not known: let the driver publish rgb8"),
        ("h264", "image_transport republish"),
    ] {
        let error = refusal(log_with("/cam/image_raw", encoding), &input, colour).to_string();
        let named = format!("/cam/image_raw (sensor_msgs/msg/Image, {encoding}) cannot be read: ");
        assert!(error.contains(&named) && error.contains(remedy), "{error}");
        // A pipeline that can do without makes its frames of depth, and hears of the images.
        let (source, _saved) = open(log_with("/cam/image_raw", encoding), Inputs::ANY);
        assert_eq!(count(&source, "messages_not_read"), 1);
        let told = source.notes().iter().find(|note| note.contains("/cam/image_raw")).unwrap();
        assert!(told.contains(remedy), "{told}");
    }
    let mut log = started();
    log.foreign("/video", "foxglove_msgs/msg/CompressedVideo", "cdr", at(0.1), &[0, 1, 0, 0]);
    assert!(refusal(log, &input, colour).to_string().contains("image_transport republish"));
    // Some drivers publish video as compressed images of any format.
    for (format, first, codec, remedy) in [
        ("jpeg", 0x67, "h264", "no key picture with its parameters"),
        ("", 0x40, "h265", "image_transport republish"),
        ("h264", 0x65, "h264", "no key picture with its parameters"),
    ] {
        let mut log = started();
        let data = [0, 0, 0, 1, first, 1, 2, 3];
        let header = Header::new(at(0.1), "camera");
        let image = CompressedImage { header, format: format.into(), data: &data };
        log.message("/cam/compressed", at(0.1), &image);
        let error = refusal(log, &input, colour).to_string();
        let named =
            format!("/cam/compressed (sensor_msgs/msg/CompressedImage, {codec}) cannot be read");
        assert!(error.contains(&named) && error.contains(remedy), "{error}");
    }
    let mut log = started();
    log.foreign("/image", "foxglove.CompressedImage", "protobuf", at(0.1), &[8, 1]);
    let error = refusal(log, &input, colour).to_string();
    assert!(error.contains("/image (foxglove.CompressedImage, protobuf)"), "{error}");
    assert!(error.contains("its messages are in `protobuf`"), "{error}");
}

#[test]
fn pictures_of_depth_are_neither_depth_nor_colour() {
    let depth_topic = "/camera/depth/image_raw/compressed";
    let mut log = started();
    log.foreign(depth_topic, "foxglove_msgs/msg/CompressedVideo", "cdr", at(0.1), &[0, 1, 0, 0]);
    let error = refusal(log, &InputSettings::default(), Inputs::ANY.require(Input::Colour));
    assert!(!error.to_string().contains("colour_topic"), "{error}");
    for encoding in ["8UC3", "rgb8"] {
        let mut log = log_with("/camera/depth/image_colored", encoding);
        log.message("/camera/color/image_raw", at(0.1), &disparities("rgb8", &[0; 16 * 12 * 3]));
        let (source, _saved) = open(log, Inputs::ANY);
        let account = source.account();
        assert_eq!(account.used_as("colour").unwrap().topic, "/camera/color/image_raw");
        let entry = account
            .topics
            .iter()
            .find(|topic| topic.topic == "/camera/depth/image_colored")
            .unwrap();
        assert!(entry.problem.as_ref().unwrap().starts_with("its name says depth"), "{entry}");
        assert_eq!(
            entry.remedy.as_deref(),
            Some("record the raw topic, or its compressedDepth"),
            "{entry}"
        );
    }
}

#[test]
fn pictures_that_were_made_of_a_cameras_images_are_of_that_camera() {
    let mut log = started();
    for topic in ["/camera/color/image_annotated", "/camera/color/image_raw"] {
        log.message(topic, at(0.1), &disparities("rgb8", &[0; 16 * 12 * 3]));
    }
    let (source, _saved) = open(log, Inputs::ANY);
    let account = source.account();
    assert_eq!(account.used_as("colour").unwrap().topic, "/camera/color/image_raw");
    let copy = account.topics.iter().find(|topic| topic.topic.ends_with("annotated")).unwrap();
    assert_eq!(copy.problem.as_deref(), Some("/camera/color/image_raw is used"));
    assert!(!source.notes().iter().any(|note| note.contains("camera =")), "{:?}", source.notes());
}

#[test]
fn a_calibration_in_place_of_a_nearer_one_is_told_with_the_reason() {
    let mut log = LogWriter::plain();
    log.info("/cam/camera_info", "colour", &camera(50, 30, 40.0));
    log.info("/elsewhere/camera_info", "colour", &camera(16, 12, 14.0));
    log.fixed("base_link", "colour", &level_pose());
    log.message("/cam/image_raw", at(0.1), &disparities("rgb8", &[0; 16 * 12 * 3]));
    let (source, _saved) = open(log, Inputs::NONE.require(Input::Colour));
    let used = source.account().used_as("colour").unwrap();
    let calibration = used.calibration.as_deref().unwrap();
    let told = "/elsewhere/camera_info, 16x12, of the same frame, in place of /cam/camera_info is ";
    assert!(calibration.starts_with(told), "{calibration}");
}

#[test]
fn an_uncalibrated_camera_serves_a_pipeline_without_metres() {
    // Some drivers leave ones on the diagonal, or the middle of the image.
    for (last, middle) in [(0.0, 0.0), (1.0, 0.0), (1.0, 7.5)] {
        let mut info = info_of("colour", &camera(16, 12, 14.0));
        (info.k, info.p) = ([0.0; 9], [0.0; 12]);
        (info.k[8], info.k[2]) = (last, middle);
        let mut log = LogWriter::plain();
        log.message("/cam/camera_info", at(0.0), &info);
        log.fixed("base_link", "colour", &level_pose());
        log.message("/cam/image_raw", at(0.1), &disparities("rgb8", &[0; 16 * 12 * 3]));
        let (mut source, _saved) = open(log, Inputs::NONE.require(Input::Colour));
        assert_eq!(frames(&mut source).len(), 1);
        let told = "the calibration of the images is not used: ";
        assert!(source.notes().iter().any(|note| note.starts_with(told)), "{:?}", source.notes());
    }
}

/// Twelve pictures of video, of which each sixth is a key picture.
const WALK: &[u8] = include_bytes!("../data/walk.h264");

/// Returns the packets of the pictures; each begins with a delimiter.
fn packets() -> Vec<&'static [u8]> {
    let starts: Vec<usize> =
        (0..WALK.len()).filter(|at| WALK[*at..].starts_with(&[0, 0, 0, 1, 9])).collect();
    let ends = starts.iter().copied().skip(1).chain([WALK.len()]);
    starts.iter().zip(ends).map(|(start, end)| &WALK[*start..end]).collect()
}

/// Writes packets of video as one of the messages in which they are found.
fn with_video(kind: &str, packets: &[&[u8]]) -> LogWriter {
    let mut log = started();
    log.info("/cam/camera_info", "camera", &camera(160, 120, 140.0));
    for (index, data) in packets.iter().enumerate() {
        let stamp = at(0.1 * index as f64);
        let header = Header::new(stamp, "camera");
        match kind {
            "foxglove" => {
                let (timestamp, frame_id) = (header.stamp, header.frame_id);
                let video = CompressedVideo { timestamp, frame_id, data, format: "h264".into() };
                log.message("/cam/video", stamp, &video);
            }
            "ffmpeg" => {
                let encoding = "libx264".into();
                let video = FfmpegPacket { header, encoding, data, ..FfmpegPacket::default() };
                log.message("/cam/ffmpeg", stamp, &video);
            }
            _ => {
                let image = CompressedImage { header, format: "jpeg".into(), data };
                log.message("/cam/compressed", stamp, &image);
            }
        }
    }
    log
}

#[test]
fn video_makes_the_frames_like_any_other_images() {
    fn brightness(found: &LogFrame) -> u64 {
        let grey = found.frame.grey().unwrap();
        grey.pixels().iter().map(|v| u64::from(*v)).sum::<u64>() / (160 * 120)
    }

    let colour = Inputs::ANY.require(Input::Colour);
    for kind in ["foxglove", "ffmpeg", "compressed"] {
        let (mut source, _saved) = open(with_video(kind, &packets()), colour);
        let found = frames(&mut source);
        assert_eq!(found.len(), 12, "{kind}");
        let image = found[11].frame.colour().unwrap();
        assert_eq!((image.width(), image.height()), (160, 120));
        assert!(!source.data_lost(), "{kind}: {:?}", source.notes());
        assert!((60..200).contains(&brightness(&found[0])), "{}", brightness(&found[0]));
    }
}

#[test]
fn video_that_begins_in_the_middle_waits_for_a_key_picture_and_says_so() {
    let colour = Inputs::ANY.require(Input::Colour);
    let (mut source, _saved) = open(with_video("foxglove", &packets()[2..]), colour);
    assert_eq!(frames(&mut source).len(), 6);
    assert_eq!(count(&source, "video_without_key_picture"), 4);
    assert!(source.data_lost());
    let told = source.notes().iter().find(|note| note.contains("key picture")).unwrap();
    assert!(told.starts_with("/cam/video at 17000000"), "{told}");
    let error =
        refusal(with_video("foxglove", &packets()[1..6]), &InputSettings::default(), colour);
    assert!(error.to_string().contains("no key picture with its parameters"), "{error}");
}

/// Returns a packet with lengths in place of its start codes.
fn with_lengths(packet: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for unit in units(packet) {
        bytes.extend((unit.len() as u32).to_be_bytes());
        bytes.extend(unit);
    }
    bytes
}

/// Returns the units of a packet, which begin after start codes of three or four bytes.
fn units(packet: &[u8]) -> Vec<&[u8]> {
    let starts: Vec<usize> =
        (3..packet.len()).filter(|at| packet[at - 3..].starts_with(&[0, 0, 1])).collect();
    let mut units = Vec::new();
    for (index, start) in starts.iter().enumerate() {
        let end = starts.get(index + 1).map_or(packet.len(), |next| next - 3);
        let unit = &packet[*start..end];
        units.push(unit.strip_suffix(&[0]).unwrap_or(unit));
    }
    units
}

#[test]
fn video_with_lengths_is_read_where_its_parameters_are_in_the_packets() {
    let colour = Inputs::ANY.require(Input::Colour);
    let whole: Vec<Vec<u8>> = packets().into_iter().map(with_lengths).collect();
    let whole: Vec<&[u8]> = whole.iter().map(Vec::as_slice).collect();
    for kind in ["foxglove", "ffmpeg", "compressed"] {
        let (mut source, _saved) = open(with_video(kind, &whole), colour);
        assert_eq!(frames(&mut source).len(), 12, "{kind}");
        assert!(!source.data_lost(), "{kind}: {:?}", source.notes());
    }
    // Key pictures without parameters, as in a file whose header has them.
    let mut bare = Vec::new();
    for packet in packets() {
        let pictures: Vec<&[u8]> =
            units(packet).into_iter().filter(|unit| matches!(unit[0] & 0x1f, 1 | 5)).collect();
        bare.push(with_lengths(&[&[0, 0, 1], &pictures.join(&[0, 0, 1][..])[..]].concat()));
    }
    let bare: Vec<&[u8]> = bare.iter().map(Vec::as_slice).collect();
    let error = refusal(with_video("foxglove", &bare), &InputSettings::default(), colour);
    let error = error.to_string();
    assert!(error.contains("lengths in place of start codes (AVCC)"), "{error}");
    assert!(error.contains("annex B") && !error.contains("no key picture"), "{error}");
}

/// Parameters of video with 10 bits, as x264 writes them.
const TEN_BITS: [u8; 23] = [
    0x67, 0x6e, 0x00, 0x0a, 0xa6, 0xcb, 0x21, 0x2d, 0x08, 0x00, 0x00, 0x03, 0x00, 0x08, 0x00, 0x00,
    0x03, 0x00, 0xa0, 0x78, 0x91, 0x32, 0x40,
];

#[test]
fn depth_is_taken_alone_where_video_cannot_be_decoded() {
    let packet = [&[0, 0, 0, 1][..], &TEN_BITS, &[0, 0, 0, 1, 0x65, 0x88, 0x84]].concat();
    let mut log = with_video("foxglove", &[&packet[..]; 3]);
    log.info("/camera/depth/camera_info", "depth", &camera(16, 12, 14.0));
    log.fixed("base_link", "depth", &level_pose());
    (0..3).for_each(|i| log.depth(at(0.1 * f64::from(i)), "depth", 3.0));
    let (mut source, _saved) = open(log, Inputs::ANY.require(Input::Depth));
    let found = frames(&mut source);
    assert_eq!(found.len(), 3);
    assert!(found[0].frame.depth().is_ok() && found[0].frame.colour().is_err());
    let told = source.notes().iter().find(|note| note.contains("/cam/video")).unwrap();
    assert!(told.contains("10 bits and colours as 4:2:0"), "{told}");
    let log = with_video("foxglove", &[&packet[..]; 3]);
    let colour = Inputs::ANY.require(Input::Colour);
    let error = refusal(log, &InputSettings::default(), colour).to_string();
    assert!(error.contains("10 bits") && error.contains("record it with 8 bits"), "{error}");
}

/// A loss that follows from another one is not the cause.
#[test]
fn the_first_loss_is_told() {
    let colour = Inputs::ANY.require(Input::Colour);
    let mut bytes = Vec::new();
    for unit in units(packets()[0]).into_iter().filter(|unit| unit[0] & 0x1f != 8) {
        bytes.extend([&[0, 0, 0, 1], unit].concat());
    }
    let mut all = packets();
    all[0] = &bytes;
    let (mut source, _saved) = open(with_video("foxglove", &all), colour);
    let _ = frames(&mut source);
    let first = source.first_loss().unwrap();
    assert!(first.contains("a packet of H.264"), "{first}");
    assert!(source.notes().last().unwrap().contains("key picture"), "{:?}", source.notes());
}

#[test]
fn a_named_topic_of_a_wrong_kind_is_an_error_of_the_settings() {
    let named = InputSettings { depth_topic: Some("/cam".into()), ..InputSettings::default() };
    for (encoding, remedy) in [
        ("rgb8", "/camera/depth/image_raw (sensor_msgs/msg/Image, 32FC1) would fit"),
        ("mono8", "add [input.disparity]"),
        ("rgb16", "let the driver publish 8 bits"),
    ] {
        let error = refusal(log_with("/cam", encoding), &named, DEPTH);
        assert!(matches!(&error, LogError::WrongTopic { key, .. } if key == "depth_topic"));
        let told = error.to_string();
        let kind = format!("names /cam, which is sensor_msgs/msg/Image, {encoding}; ");
        assert!(told.contains(&kind) && told.contains(remedy), "{told}");
    }
    let input = InputSettings {
        laser_topic: Some("/cam".into()),
        colour_topic: Some("/tf_static".into()),
        ..InputSettings::default()
    };
    let laser = Inputs::NONE.require(Input::Laser);
    let told = refusal(log_with("/cam", "rgb8"), &input, laser).to_string();
    assert!(told.contains("`colour_topic` under [input] names /tf_static"), "{told}");
    let input = InputSettings { colour_topic: None, ..input };
    let told = refusal(log_with("/cam", "rgb8"), &input, laser).to_string();
    assert!(told.contains("`laser_topic`") && told.contains("leave the key out"), "{told}");
}

fn ros1_text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn ros1_words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

#[test]
fn messages_of_ros_1_in_an_mcap_file_are_read() {
    let image = [
        ros1_words(&[7, 1_700_000_000, 100_000_000]),
        ros1_text("colour"),
        ros1_words(&[2, 3]),
        ros1_text("mono8"),
        vec![0],
        ros1_words(&[3, 6]),
        vec![1, 2, 3, 4, 5, 6],
    ]
    .concat();
    let mut log = LogWriter::plain();
    log.foreign("/camera/image_raw", "sensor_msgs/Image", "ros1", at(0.1), &image);
    let (mut source, _saved) = open(log, Inputs::ANY.require(Input::Colour));
    let found = frames(&mut source);
    assert_eq!(stamps(&found), [0.1]);
    assert_eq!(found[0].frame.grey().unwrap().pixels(), [1, 2, 3, 4, 5, 6]);
    assert!(!source.data_lost(), "{:?}", source.notes());
}

/// Writes what a log has of the way from its depth images to its colour images.
type Geometry = fn(&mut LogWriter);

fn calibrated(log: &mut LogWriter) {
    log.info("/camera/depth/camera_info", "depth", &camera(16, 12, 14.0));
}

fn connected(log: &mut LogWriter) {
    log.fixed("colour", "depth", &Isometry3::identity());
}

fn connected_later(log: &mut LogWriter) {
    calibrated(log);
    log.moving("colour", "depth", at(9.5), &Isometry3::identity());
}

#[test]
fn depth_that_is_taken_to_be_registered_is_told_with_the_measured_cause() {
    let cases: [(&str, Geometry, &str, &str); 4] = [
        ("depth", calibrated, "tf does not connect its frame `depth` with `colour`", "/tf_static"),
        ("depth", connected, "no calibration (sensor_msgs/CameraInfo)", "`depth_info_topic`"),
        ("depth", connected_later, "but at other times", "record /tf from before"),
        ("", calibrated, "the frame_id of /camera/depth/image_raw is empty", "set the frame_id"),
    ];
    for (frame, geometry, cause, remedy) in cases {
        let mut log = started();
        geometry(&mut log);
        for t in [0.1, 9.5] {
            log.colour(at(t));
            log.depth(at(t), frame, 2.0);
        }
        let (source, found) = first_depth(log, &InputSettings::default()).unwrap();
        assert!(found.frame.depth().is_ok(), "{cause}");
        let notes = source.notes();
        let told = notes.iter().find(|note| note.contains("taken to be registered")).unwrap();
        assert!(told.starts_with("/camera/depth/image_raw ") && told.contains(cause), "{told}");
        assert!(told.contains(remedy) && !source.data_lost(), "{told}");
    }
}

#[test]
fn a_baseline_in_millimetres_is_refused() {
    for (baseline_m, is_refused) in [(0.1, false), (100.0, true)] {
        let mut log = LogWriter::plain();
        let left = camera(16, 12, 14.0);
        log.info("/stereo/left/camera_info", "colour", &left);
        let mut right = info_of("colour", &left);
        right.p[3] = -14.0 * baseline_m;
        log.message("/stereo/right/camera_info", at(0.0), &right);
        log.fixed("base_link", "colour", &level_pose());
        for side in ["left", "right"] {
            let image = disparities("mono8", &[0; 16 * 12]);
            log.message(&format!("/stereo/{side}/image_rect"), at(0.1), &image);
        }
        let inputs = Inputs::NONE.require(Input::Colour).require(Input::Right);
        let found = log.save().open(&InputSettings::default(), inputs);
        assert_eq!(found.is_err(), is_refused, "{baseline_m}");
        if let Err(error) = found {
            let told = "by /stereo/right/camera_info it is 100 m";
            assert!(error.to_string().contains(told), "{error}");
        }
    }
}
