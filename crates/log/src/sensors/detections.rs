//! Detections of other programs that were recorded in a log.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, Vector3};
use tagalong_core::{ExternalDetection, ExternalDetections, Input, Sensors, Stamp};
use tagalong_geometry::{HALF_HEAD_M, Rect};

use super::box_layout::BoxLayout;
use super::{Moment, SensorReader, SensorType, is_type};
use crate::InputSettings;
use crate::camera_frames::CameraFrames;
use crate::msgs::{
    CdrError, Definition, Detection2DArray, Detection3DArray, Header, Time, Value, decode,
};
use crate::pairing::{Payload, Waiting};
use crate::tally::{Tally, is_unusual};
use crate::walk::{Channel, Message};

const BOXES: &str = "vision_msgs/Detection2DArray";
const SPACE: &str = "vision_msgs/Detection3DArray";
const YOLO: [&str; 2] = ["yolo_msgs/DetectionArray", "yolov8_msgs/DetectionArray"];

/// Entry of recorded detections. They are read only if the settings name their topic, because
/// Tagalong's own output has the same type.
pub(super) const ENTRY: SensorType = SensorType {
    input: Input::Detections,
    messages: &[BOXES, SPACE, YOLO[0], YOLO[1]],
    wanted: "recorded detections that `detections_topic` under [input] names",
    rank: None,
    header: header_of,
    fault: |_| None,
    reader: |schema, input| Box::new(Recorded::new(schema, input)),
};

/// Class names of people.
const PEOPLE: [&str; 12] = [
    "person",
    "persons",
    "people",
    "pedestrian",
    "pedestrians",
    "human",
    "humans",
    "man",
    "woman",
    "child",
    "upper-body",
    "0",
];
/// Maximum number of other classes that are listed.
const NAMED_CLASSES: usize = 12;

/// Messages that wait for their frame.
#[derive(Default)]
struct Recorded {
    in_space: bool,
    /// Classes that are people; empty: [`PEOPLE`].
    classes: Vec<String>,
    layouts: Vec<Definition>,
    cameras: CameraFrames,
    waiting: Waiting,
    /// Message for the frame that is being made.
    paired: Option<Payload>,
    boxes: BoxLayout,
    /// Number of messages that were read, and of those that were matched with a frame.
    read: u64,
    used: u64,
    /// Number of frames.
    frames: u64,
}

impl Recorded {
    fn new(schema: &str, input: &InputSettings) -> Self {
        Self {
            in_space: is_type(schema, SPACE),
            classes: input.detection_classes.clone(),
            ..Self::default()
        }
    }
}

impl SensorReader for Recorded {
    fn take(&mut self, message: &Message<'_>, tally: &mut Tally) -> Result<(), CdrError> {
        if self.layouts.is_empty() {
            self.layouts = layouts(message.channel);
        }
        let mut payload = Payload::of_headed(message)?;
        if payload.stamp == Stamp::default() {
            payload.stamp = stamp_of_first(&self.layouts, message.data).unwrap_or_default();
        }
        self.read += 1;
        if !self.in_space && self.cameras.is_other(&payload.frame_id) {
            self.leave_out(&message.channel.topic, &payload.frame_id, tally);
            return Ok(());
        }
        if !self.in_space && self.cameras.is_unknown(&payload.frame_id) {
            tally.note(format!(
                "{}: the detections have the frame_id `{}`, which is in no other message, and are \
                 taken to be of the images with `{}`",
                message.channel.topic, payload.frame_id, self.cameras.own
            ));
        }
        self.waiting.push(payload);
        Ok(())
    }

    fn pair(&mut self, stamp: Stamp, next: Option<Stamp>, tolerance_s: f64) {
        self.frames += 1;
        self.paired = self.waiting.take(stamp, next, tolerance_s);
        self.used += u64::from(self.paired.is_some());
    }

    fn add_to(&self, sensors: Sensors, moment: &Moment<'_>, tally: &mut Tally) -> Sensors {
        // Without a message nothing is known, unlike with a message without detections.
        let Some(message) = &self.paired else {
            tally.count("frames_without_detections");
            return sensors;
        };
        let Some(detections) = self.detections(message, moment, tally) else { return sensors };
        sensors.with(ExternalDetections::new(detections, Arc::clone(moment.camera)))
    }

    fn is_ready(&self, stamp: Stamp, tolerance_s: f64) -> bool {
        self.waiting.has(stamp, tolerance_s)
    }

    fn set_aside(&mut self, newest: Stamp) {
        self.waiting.set_aside(newest);
    }

    fn restore(&mut self) {
        self.waiting.restore();
    }

    fn know_cameras(&mut self, cameras: &CameraFrames) {
        self.cameras = cameras.clone();
    }

    fn close(&mut self, topic: &str, tally: &mut Tally) {
        tally.add("detections_without_frame", self.waiting.leave());
        self.boxes.close(topic, tally);
        if self.read > 0 && self.used == 0 {
            let read = self.read;
            tally.lose("detections_lost", || {
                format!(
                    "{topic}: none of the {read} messages belongs to a frame, so no person is detected"
                )
            });
        }
        let Self { used, frames, .. } = self;
        if *used > 0 && is_unusual(*frames - *used, *frames) {
            tally.note(format!(
                "{topic} has messages for {used} of {frames} images: tracks are predicted in the others"
            ));
        }
    }
}

/// Returns the header of a message. Some drivers set only the stamps of the detections; the first
/// one is then that of the message.
fn header_of(message: &Message<'_>) -> Result<Option<Header>, CdrError> {
    let header: Header = decode(message.data)?;
    if header.stamp() != Stamp::default() {
        return Ok(Some(header));
    }
    let stamp = stamp_of_first(&layouts(message.channel), message.data).unwrap_or_default();
    Ok(Some(Header::new(stamp, header.frame_id)))
}

/// Returns the stamp of the first detection of a message; `None` without one.
fn stamp_of_first(layouts: &[Definition], data: &[u8]) -> Option<Stamp> {
    let value = read(layouts, data).ok()?;
    let first = value.list("detections").first()?;
    let seconds = first.number(&["header.stamp.sec"])?;
    let nanos = first.number(&["header.stamp.nanosec"])?;
    Some(Time { sec: seconds as i32, nanosec: nanos as u32 }.into())
}

/// Reads a message with the first of several layouts that fits.
fn read(layouts: &[Definition], data: &[u8]) -> Result<Value, String> {
    let mut first = None;
    for layout in layouts {
        match layout.read(data) {
            Ok(value) => return Ok(value),
            Err(why) => first = first.or(Some(why)),
        }
    }
    Err(first.unwrap_or_else(|| "the log does not define it".to_owned()))
}

/// Returns the possible layouts of the messages of a channel: the one that the log defines, or
/// otherwise all known ones, the newest first.
fn layouts(channel: &Channel) -> Vec<Definition> {
    let name = &channel.schema_name;
    let told = Definition::parse(name, &channel.definition);
    if let (Ok(told), false) = (told, channel.definition.is_empty()) {
        return vec![told];
    }
    let texts: &[&str] = if is_type(name, BOXES) {
        use crate::msgs::Message as _;
        &[Detection2DArray::DEFINITION, FOXY_BOXES, NOETIC_BOXES]
    } else if is_type(name, SPACE) {
        use crate::msgs::Message as _;
        &[Detection3DArray::DEFINITION, FOXY_SPACE]
    } else {
        &[]
    };
    texts.iter().filter_map(|text| Definition::parse(name, text).ok()).collect()
}

impl Recorded {
    /// Counts a message whose boxes are in the images of another camera.
    fn leave_out(&self, topic: &str, frame: &str, tally: &mut Tally) {
        let own = &self.cameras.own;
        tally.remark("detections_of_other_camera", || {
            format!(
                "{topic}: detections in images of another camera, whose frame is `{frame}`, are left \
                 out, because the images that are used have `{own}`: name the detections in those as \
                 `detections_topic` under [input]"
            )
        });
    }

    /// Returns the people in a message; `None` if it cannot be read, which is counted.
    fn detections(
        &self,
        message: &Payload,
        moment: &Moment<'_>,
        tally: &mut Tally,
    ) -> Option<Vec<ExternalDetection>> {
        let value = match read(&self.layouts, &message.data) {
            Ok(value) => value,
            Err(why) => {
                let topic = moment.topic;
                tally.lose("messages_undecodable", || {
                    format!("{topic}: a message of detections does not match its type: {why}")
                });
                return None;
            }
        };
        let people = self.people(value.list("detections"), moment.topic, tally);
        if self.in_space {
            Some(in_space(&people, message, moment, tally))
        } else {
            Some(self.in_image(&people, moment, tally))
        }
    }

    /// Returns the detections of people with their scores; others are counted, and their classes
    /// reported.
    fn people<'a>(
        &self,
        all: &'a [Value],
        topic: &str,
        tally: &mut Tally,
    ) -> Vec<(&'a Value, f64)> {
        let mut people = Vec::new();
        for detection in all {
            let (class, score) = best_hypothesis(detection);
            if self.is_person(&class) {
                people.push((detection, score));
                continue;
            }
            tally.count("detections_of_other_classes");
            let names: Vec<String> = if self.classes.is_empty() {
                vec!["people by the usual names".into()]
            } else {
                self.classes.clone()
            };
            if tally.notes.iter().filter(|note| note.contains(OTHER_CLASS)).count() < NAMED_CLASSES
            {
                tally.note(format!(
                    "{topic}: {OTHER_CLASS} `{class}` are left out; taken are {}: \
                     `detection_classes` under [input] names others",
                    names.join(", ")
                ));
            }
        }
        people
    }

    /// Returns the people in an image. Invalid boxes are counted as lost.
    fn in_image(
        &self,
        people: &[(&Value, f64)],
        moment: &Moment<'_>,
        tally: &mut Tally,
    ) -> Vec<ExternalDetection> {
        let topic = moment.topic;
        let mut found = Vec::new();
        for (detection, score) in people {
            let Some(region) = region_of(detection) else {
                lose_box(topic, tally);
                continue;
            };
            if is_fraction(&region) {
                tally.lose("detections_as_fractions", || {
                    format!(
                        "{topic}: a box of {:.3} x {:.3} is a fraction of the image: let the detector \
                         write boxes in pixels",
                        region.width, region.height
                    )
                });
                continue;
            }
            self.boxes.take(&region, *score, moment.camera);
            found.push(ExternalDetection::in_image(region, *score));
        }
        found
    }

    /// Returns true for the class of people. A detection without a class is assumed to come from a
    /// people detector.
    fn is_person(&self, class: &str) -> bool {
        let class = class.trim().to_lowercase().replace(['_', ' '], "-");
        if self.classes.is_empty() {
            return class.is_empty() || PEOPLE.contains(&class.as_str());
        }
        self.classes
            .iter()
            .any(|wanted| wanted.trim().to_lowercase().replace(['_', ' '], "-") == class)
    }
}

/// Beginning of the note about other classes.
const OTHER_CLASS: &str = "detections of the class";

/// Returns class and score of the best hypothesis: an empty class and 1 for a detection without one.
fn best_hypothesis(detection: &Value) -> (String, f64) {
    let mut best: Option<(String, f64)> = None;
    let own = std::slice::from_ref(detection);
    let hypotheses = match detection.list("results") {
        [] if detection.get("score").is_some() => own,
        results => results,
    };
    for hypothesis in hypotheses {
        let score = hypothesis.number(&["hypothesis.score", "score"]);
        let score = score.filter(|score| score.is_finite()).unwrap_or(1.0);
        let class = class_of(hypothesis);
        if best.as_ref().is_none_or(|(_, highest)| score > *highest) {
            best = Some((class, score));
        }
    }
    best.unwrap_or_else(|| (String::new(), 1.0))
}

/// Names of the class field, in order of preference.
const CLASS_FIELDS: [&str; 5] =
    ["hypothesis.class_id", "hypothesis.id", "class_name", "class_id", "id"];

/// Returns the class of a hypothesis: the first field that is not empty, for example the number
/// beside a name that the detector leaves empty.
fn class_of(hypothesis: &Value) -> String {
    for field in CLASS_FIELDS {
        match hypothesis.text(&[field]) {
            Some(class) if !class.is_empty() => return class,
            _ => {}
        }
    }
    String::new()
}

/// Returns the box of a detection; `None` if its numbers are not finite, or its size is missing.
fn region_of(detection: &Value) -> Option<Rect> {
    let width = detection.number(&["bbox.size_x", "bbox.size.x"])?;
    let height = detection.number(&["bbox.size_y", "bbox.size.y"])?;
    let x = detection.number(&["bbox.center.position.x", "bbox.center.x"])? - 0.5 * width;
    let y = detection.number(&["bbox.center.position.y", "bbox.center.y"])? - 0.5 * height;
    let region = Rect { x, y, width, height };
    let has_size = width > 0.0 && height > 0.0;
    (region.is_sane() && has_size).then_some(region)
}

/// Counts a person at an impossible position as lost.
fn lose_box(topic: &str, tally: &mut Tally) {
    tally.lose("detections_invalid", || {
        format!("{topic}: a box has no size, or a number that is not finite")
    });
}

/// Returns true for a box within the first pixel: its numbers are fractions of the image and not
/// pixels.
fn is_fraction(region: &Rect) -> bool {
    region.width <= 1.0
        && region.height <= 1.0
        && (-1.0..=1.0).contains(&region.x)
        && (-1.0..=1.0).contains(&region.y)
}

fn in_space(
    people: &[(&Value, f64)],
    message: &Payload,
    moment: &Moment<'_>,
    tally: &mut Tally,
) -> Vec<ExternalDetection> {
    let robot = moment.robot_frame;
    let pose = if message.frame_id == robot {
        Some(Isometry3::identity())
    } else {
        moment.tf.lookup(robot, &message.frame_id, message.stamp)
    };
    let Some(robot_from_message) = pose else {
        tally.count("detections_without_transform");
        return Vec::new();
    };
    let mut found = Vec::new();
    for (detection, score) in people {
        match head_of(detection, &robot_from_message) {
            Some(head) => {
                found.push(ExternalDetection::at(head, *score));
            }
            None => lose_box(moment.topic, tally),
        }
    }
    found
}

/// Returns the centre of the head of the person in a 3D box, below its upper face.
fn head_of(detection: &Value, robot_from_message: &Isometry3<f64>) -> Option<Point3<f64>> {
    let position = vector_of(detection.get("bbox.center.position")?)?;
    let turn = vector_of(detection.get("bbox.center.orientation")?)?;
    let w = detection.number(&["bbox.center.orientation.w"])?;
    let size = vector_of(detection.get("bbox.size")?)?;
    let turn = UnitQuaternion::try_new(Quaternion::new(w, turn.x, turn.y, turn.z), 1e-9)?;
    let pose = robot_from_message * Isometry3::from_parts(position.into(), turn);
    // Vertical extent of the rotated box.
    let up = pose.rotation.to_rotation_matrix().matrix().row(2).abs();
    let height = up[0] * size.x + up[1] * size.y + up[2] * size.z;
    let at = pose.translation.vector;
    let head = Point3::new(at.x, at.y, at.z + 0.5 * height - HALF_HEAD_M);
    head.iter().all(|v| v.is_finite()).then_some(head)
}

fn vector_of(value: &Value) -> Option<Vector3<f64>> {
    Some(Vector3::new(value.number(&["x"])?, value.number(&["y"])?, value.number(&["z"])?))
}

/// Definition of 2D boxes in ROS 2 Foxy and Galactic.
const FOXY_BOXES: &str = include_str!("../../msgs/Detection2DArray-foxy.msg");
/// Definition of 2D boxes in ROS 1 Noetic.
const NOETIC_BOXES: &str = include_str!("../../msgs/Detection2DArray-noetic.msg");
/// Definition of 3D detections in ROS 2 Foxy and Galactic.
const FOXY_SPACE: &str = include_str!("../../msgs/Detection3DArray-foxy.msg");
