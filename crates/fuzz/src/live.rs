//! Messages as they arrive on a robot, up to the frames that are made of them.

use std::cell::RefCell;
use std::ops::Range;
use std::path::Path;

use tagalong_core::Stamp;
use tagalong_log::images::{CloudAxes, camera_of_cloud, decode_cloud, points_of_cloud};
use tagalong_log::msgs::{
    self, BoundingBox2D, CompressedVideo, Detection2D, Detection2DArray, Header, ObjectHypothesis,
    ObjectHypothesisWithPose, Point2D, PointCloud2, Pose2D, decode, encode,
};
use tagalong_log::{Input, InputSettings, Inputs, Limits, Listening, LiveSource, LogFrame};

const IMAGES: &str = "/image";
const DETECTIONS: &str = "/detections";
const CAMERA: &str = "camera";
/// Bytes of the stamp in a message, after the four that tell the encoding.
const STAMP: Range<usize> = 4..12;
/// Types of messages with detections whose layout is known without a definition.
const DETECTION_TYPES: [&str; 2] =
    ["vision_msgs/msg/Detection2DArray", "vision_msgs/msg/Detection3DArray"];

fn header() -> Header {
    Header::new(Stamp::from_nanos(1_000_000_000), CAMERA)
}

/// Returns messages of two detections.
pub(crate) fn detections() -> Vec<Vec<u8>> {
    fn detection(class: &str) -> Detection2D {
        Detection2D {
            header: header(),
            results: vec![ObjectHypothesisWithPose {
                hypothesis: ObjectHypothesis { class_id: class.to_owned(), score: 0.9 },
                pose: msgs::PoseWithCovariance::default(),
            }],
            bbox: BoundingBox2D {
                center: Pose2D { position: Point2D { x: 8.0, y: 6.0 }, theta: 0.0 },
                size_x: 4.0,
                size_y: 6.0,
            },
            id: String::new(),
        }
    }

    let flat = Detection2DArray {
        header: header(),
        detections: ["person", "chair"].map(detection).to_vec(),
    };
    vec![encode(&flat), encode(&msgs::Detection3DArray::default())]
}

/// Makes frames of images with the detections in some bytes, of each type.
pub(crate) fn frame_of_detections(bytes: &[u8], _: &Path) {
    FEEDS.with_borrow_mut(|feeds| {
        for feed in feeds {
            drop(feed.frame(bytes));
        }
    });
}

thread_local! {
    /// A feed for each type, kept over all files, because the choice of the inputs takes many times
    /// as long as a message.
    static FEEDS: RefCell<Vec<Feed>> =
        RefCell::new(DETECTION_TYPES.iter().filter_map(|kind| Feed::new(kind)).collect());
}

/// A robot with a camera and a detector.
struct Feed {
    source: LiveSource,
    stamp: Stamp,
}

impl Feed {
    fn new(kind: &str) -> Option<Self> {
        let settings =
            InputSettings { detections_topic: Some(DETECTIONS.into()), ..InputSettings::default() };
        let inputs = Inputs::NONE.require(Input::Detections);
        let mut listening = Listening::new("fuzz", &settings, &Limits::default(), inputs).ok()?;
        listening.announce(IMAGES, "sensor_msgs/msg/Image");
        listening.announce(DETECTIONS, kind);
        listening.take(IMAGES, &image(header()));
        listening.take(DETECTIONS, &encode(&Detection2DArray::default()));
        Some(Self { source: listening.start().ok()?, stamp: header().stamp() })
    }

    /// Returns the frame of the next image and a message, if there is one. The message has the stamp
    /// of the image unless it has another one than the seeds.
    fn frame(&mut self, detections: &[u8]) -> Option<LogFrame> {
        let mut detections = detections.to_vec();
        let now = Header::new(self.stamp, CAMERA);
        let [seed, stamp] = [&header(), &now].map(|header| encode(header)[STAMP].to_vec());
        if let Some(place) = detections.get_mut(STAMP).filter(|place| **place == *seed) {
            place.copy_from_slice(&stamp);
        }
        self.stamp = self.stamp.plus_seconds(0.1);
        self.source.take(IMAGES, &image(now));
        self.source.take(DETECTIONS, &detections);
        self.source.newest_frame()
    }
}

fn image(header: Header) -> Vec<u8> {
    encode(&msgs::Image::packed(header, "mono8", 2, 2, &[0; 4]))
}

/// Returns messages of points in one row, and in rows and columns.
pub(crate) fn clouds() -> Vec<Vec<u8>> {
    let points: Vec<[f32; 3]> =
        (0..120_u8).map(|k| [2.0, 0.1 * f32::from(k % 12), 0.1 * f32::from(k / 12)]).collect();
    let row = PointCloud2::of_points(header(), &points);
    let ordered = PointCloud2 { height: 10, width: 12, row_step: 12 * 12, ..row.clone() };
    vec![encode(&row), encode(&ordered)]
}

/// Reads points as those of a camera and as those of a lidar.
pub(crate) fn points(bytes: &[u8], _: &Path) {
    let Ok(cloud) = decode::<PointCloud2<'_>>(bytes) else { return };
    let limits = Limits { image_bytes: 1 << 20, ..Limits::default() };
    drop(camera_of_cloud(&cloud, &limits));
    drop(decode_cloud(&cloud, CloudAxes::Optical, &limits));
    drop(points_of_cloud(&cloud, &limits));
}

const VIDEO: &str = "/video";
/// Streams of H.264: pictures of 48 x 32 pixels, and such of 32 x 32 with some between two others.
const STREAMS: [&[u8]; 2] = [
    include_bytes!("../../log/tests/data/small.h264"),
    include_bytes!("../../log/tests/data/between.h264"),
];

/// Returns streams of video.
pub(crate) fn streams() -> Vec<Vec<u8>> {
    STREAMS.map(<[u8]>::to_vec).to_vec()
}

thread_local! {
    /// A robot with a camera that publishes video, of which one key picture was heard.
    static WATCHING: Option<Listening> = watching();
}

fn watching() -> Option<Listening> {
    let inputs = Inputs::NONE.require(Input::Colour);
    let limits = Limits { image_side_px: 256, ..Limits::default() };
    let settings = InputSettings::default();
    let mut listening = Listening::new("fuzz", &settings, &limits, inputs).ok()?;
    listening.announce(VIDEO, "foxglove_msgs/msg/CompressedVideo");
    listening.take(VIDEO, &packet(header().stamp(), STREAMS[0]));
    Some(listening)
}

fn packet(stamp: Stamp, data: &[u8]) -> Vec<u8> {
    encode(&CompressedVideo {
        timestamp: stamp.into(),
        frame_id: CAMERA.into(),
        data,
        format: "h264".into(),
    })
}

/// Makes frames of a stream of video, a packet for each delimiter.
pub(crate) fn frames_of_video(bytes: &[u8], _: &Path) {
    WATCHING.with(|listening| frames_of_stream(listening.as_ref(), bytes));
}

/// Returns the number of frames that a stream gives.
fn frames_of_stream(listening: Option<&Listening>, stream: &[u8]) -> usize {
    let Some(mut source) = listening.and_then(|listening| listening.start().ok()) else { return 0 };
    let starts = (0..stream.len()).filter(|at| stream[*at..].starts_with(&[0, 0, 0, 1, 9]));
    let mut begin = 0;
    let mut frames = 0;
    let mut stamp = header().stamp();
    for end in starts.chain([stream.len()]) {
        source.take(VIDEO, &packet(stamp, &stream[begin..end]));
        frames += usize::from(source.newest_frame().is_some());
        begin = end;
        stamp = stamp.plus_seconds(0.1);
    }
    frames
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_become_frames() {
        let listening = watching();
        let frames = STREAMS.map(|stream| frames_of_stream(listening.as_ref(), stream));
        // Of the second one, pictures between others are left out.
        assert_eq!(frames, [4, 3]);
        assert_eq!(frames_of_stream(listening.as_ref(), b"no video"), 0);
    }

    #[test]
    fn the_seeds_are_read_to_the_end() {
        let seeds = clouds();
        let cloud: PointCloud2<'_> = decode(&seeds[0]).unwrap();
        assert_eq!(points_of_cloud(&cloud, &Limits::default()).unwrap().len(), 120);
        let mut feed = Feed::new(DETECTION_TYPES[0]).unwrap();
        for file in 0..3 {
            let made = feed.frame(&detections()[0]).unwrap();
            assert_eq!(made.frame.recorded().unwrap().len(), 1, "the chair is nobody: {file}");
        }
    }

    #[test]
    fn a_file_does_not_spoil_those_after_it() {
        let mut feed = Feed::new(DETECTION_TYPES[0]).unwrap();
        for broken in [&[0xff_u8; 8][..], &[0; 8], &[0xff, 0xff, 0xff, 0x7f, 0, 0, 0, 0]] {
            let mut message = detections().remove(0);
            message[STAMP].copy_from_slice(broken);
            for message in [&message[..], &message[..20], &[]] {
                drop(feed.frame(message));
                drop(feed.frame(message));
            }
            let made = feed.frame(&detections()[0]).unwrap();
            assert_eq!(made.frame.recorded().unwrap().len(), 1, "{broken:?}");
        }
    }
}
