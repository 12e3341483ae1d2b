//! Messages of another program's types, with the definition that a log has of them.

use std::path::Path;
use std::sync::Arc;

use tagalong_core::Stamp;
use tagalong_log::msgs::{self, Detection2DArray, Header, Message as _, Point2D, encode};
use tagalong_log::write::MessageLog;
use tagalong_log::{Channel, FrameSource, Input, InputSettings, Inputs, Limits, Message};

const IMAGES: &str = "/image";
const DETECTIONS: &str = "/detections";
const CAMERA: &str = "camera";
/// Line between a definition and a message of it.
const BETWEEN: &[u8] = b"\n---\n";
/// Types that are read by the definition in the log.
const TYPES: [&str; 2] = ["yolo_msgs/msg/DetectionArray", "vision_msgs/msg/Detection2DArray"];

const YOLO: &str = include_str!("../../log/msgs/DetectionArray-yolo.msg");
const FOXY: &str = include_str!("../../log/msgs/Detection2DArray-foxy.msg");

fn header() -> Header {
    Header::new(Stamp::from_nanos(1_000_000_000), CAMERA)
}

/// Returns definitions, each with a message.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let size = Point2D { x: 1.0, y: 2.0 };
    let place = (Point2D { x: 1.0, y: 1.0 }, 0.0_f64);
    let person = (0_i32, "person".to_owned(), 0.9_f64, "7".to_owned(), (place, size));
    let empty = Detection2DArray { header: header(), ..Detection2DArray::default() };
    let seeds = [
        (YOLO, encode(&(header(), vec![person]))),
        (FOXY, encode(&empty)),
        (Detection2DArray::DEFINITION, encode(&empty)),
    ];
    let joined =
        seeds.map(|(definition, message)| [definition.as_bytes(), BETWEEN, &message].concat());
    joined.to_vec()
}

/// Reads the frames of a log that has a message of each type by this definition.
pub(crate) fn frames_of_definition(bytes: &[u8], path: &Path) {
    let at = bytes.windows(BETWEEN.len()).position(|part| part == BETWEEN);
    let (definition, message) = match at {
        Some(at) => (&bytes[..at], &bytes[at + BETWEEN.len()..]),
        None => (bytes, &[][..]),
    };
    let definition = String::from_utf8_lossy(definition);
    for schema_name in TYPES {
        if write(path, schema_name, &definition, message).is_some() {
            count_people(path);
        }
    }
}

/// Writes a log of one image and one message.
fn write(path: &Path, schema_name: &str, definition: &str, message: &[u8]) -> Option<()> {
    let mut log = MessageLog::create(path).ok()?;
    let image = encode(&msgs::Image::packed(header(), "mono8", 2, 2, &[0; 4]));
    for (topic, name, definition, data) in [
        (DETECTIONS, schema_name, definition, message),
        (IMAGES, msgs::Image::TYPE, msgs::Image::DEFINITION, &image),
    ] {
        let channel = Arc::new(Channel {
            id: 0,
            topic: topic.to_owned(),
            schema_name: name.to_owned(),
            schema_encoding: "ros2msg".to_owned(),
            encoding: "cdr".to_owned(),
            definition: definition.into(),
        });
        let time = header().stamp().nanos();
        let sent =
            Message { channel: &channel, log_time: time, publish_time: time, sequence: 0, data };
        log.copy(&sent).ok()?;
    }
    log.finish().ok().map(drop)
}

/// Returns the number of recorded people in the frames of a log; `None` if it cannot be opened.
fn count_people(path: &Path) -> Option<usize> {
    let settings =
        InputSettings { detections_topic: Some(DETECTIONS.into()), ..InputSettings::default() };
    let inputs = Inputs::NONE.require(Input::Detections);
    let limits = Limits { record_bytes: 1 << 20, ..Limits::default() };
    let mut source = FrameSource::open(path, &settings, &limits, inputs).ok()?;
    let mut people = 0;
    while let Some(made) = source.next_frame() {
        people += made.frame.recorded().map_or(0, <[_]>::len);
    }
    Some(people)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_seeds_are_read_to_their_ends() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let seed = seeds().remove(0);
        let at = seed.windows(BETWEEN.len()).position(|part| part == BETWEEN).unwrap();
        let message = &seed[at + BETWEEN.len()..];
        assert!(write(&path, TYPES[0], YOLO, message).is_some());
        assert_eq!(count_people(&path), Some(1));
        assert!(write(&path, TYPES[0], "no definition", message).is_some());
        assert_eq!(count_people(&path), Some(0));
    }
}
