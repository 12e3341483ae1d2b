//! Tracks of one frame as ROS 2 messages.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, SMatrix, UnitQuaternion, Vector3};
use serde::Serialize;
use tagalong_core::{Joints, Track, WheelSpeeds};
use tagalong_geometry::HALF_HEAD_M;

use super::mcap_tracks::FrameNames;
use super::record::{FrameRecord, probability};
use crate::msgs::{
    BoundingBox3D, Detection3D, Detection3DArray, Header, ObjectHypothesis,
    ObjectHypothesisWithPose, People, PersonMsg, Point, Pose, PoseStamped, PoseWithCovariance,
    TFMessage, TransformStamped,
};

/// Variance of unknown quantities: above 99,999, by the convention of `spencer_tracking_msgs`.
const UNKNOWN_VARIANCE: f64 = 1e6;

/// Speed over ground below which a person has no heading, m/s.
pub(super) const MIN_HEADING_SPEED_MPS: f64 = 0.2;

/// Width and depth of the box around a person, m.
const PERSON_WIDTH_M: f64 = 0.6;

/// Returns the confirmed tracks in the robot frame, most certain first, as
/// `vision_msgs/Detection3DArray` requires.
pub fn detections(record: &FrameRecord<'_>, base_frame: &str) -> Detection3DArray {
    let header = Header::new(record.stamp, base_frame);
    let mut tracks: Vec<&Track> = record.confirmed().collect();
    // Tracks with equal scores are sorted by ID, so that the order is always the same.
    tracks.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.id.cmp(&b.id)));
    let detections = tracks.into_iter().map(|track| detection(track, &header)).collect();
    Detection3DArray { header, detections }
}

fn detection(track: &Track, header: &Header) -> Detection3D {
    let head = track.estimate.person.position;
    let pose = PoseWithCovariance {
        pose: Pose::from(&Isometry3::from(head)),
        covariance: pose_covariance(&track.estimate.covariance),
    };
    let hypothesis =
        ObjectHypothesis { class_id: "person".into(), score: probability(track.score) };
    Detection3D {
        header: header.clone(),
        results: vec![ObjectHypothesisWithPose { hypothesis, pose }],
        bbox: standing_box(&head),
        id: track.id.to_string(),
    }
}

/// Returns the box from the floor to the top of the head.
fn standing_box(head: &Point3<f64>) -> BoundingBox3D {
    // A head far too low must not give a box of negative height.
    let height = (head.z + HALF_HEAD_M).max(0.1);
    let centre = Point3::new(head.x, head.y, 0.5 * height);
    BoundingBox3D {
        center: Pose::from(&Isometry3::from(centre)),
        size: Point { x: PERSON_WIDTH_M, y: PERSON_WIDTH_M, z: height },
    }
}

/// Returns the position covariance; the rotation is unknown.
fn pose_covariance(state: &SMatrix<f64, 5, 5>) -> [[f64; 6]; 6] {
    let mut covariance = [[0.0; 6]; 6];
    for (row, line) in covariance.iter_mut().enumerate() {
        for (column, value) in line.iter_mut().enumerate() {
            *value = match (row < 3 && column < 3, row == column) {
                (true, _) => state[(row, column)],
                (false, true) => UNKNOWN_VARIANCE,
                (false, false) => 0.0,
            };
        }
    }
    covariance
}

/// Returns the pose of a person in the odometry frame, facing the direction of walking.
pub fn pose(record: &FrameRecord<'_>, track: &Track, odom_frame: &str) -> PoseStamped {
    PoseStamped {
        header: Header::new(record.stamp, odom_frame),
        pose: Pose::from(&odom_from_person(record, track)),
    }
}

pub(super) fn odom_from_person(record: &FrameRecord<'_>, track: &Track) -> Isometry3<f64> {
    let velocity = track.estimate.person.velocity;
    let walks = velocity.norm() >= MIN_HEADING_SPEED_MPS;
    // A person at rest is given the heading of the robot.
    let heading = if walks { velocity.y.atan2(velocity.x) } else { 0.0 };
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
    let head = track.estimate.person.position.coords;
    record.odom_from_robot() * Isometry3::from_parts(head.into(), turn)
}

/// Returns the transforms of the robot and all confirmed people in the odometry frame, and of the
/// camera in the robot frame.
pub(super) fn transforms(record: &FrameRecord<'_>, frames: &FrameNames) -> TFMessage {
    let mut transforms = vec![TransformStamped {
        header: Header::new(record.stamp, frames.odom.as_str()),
        child_frame_id: frames.base.clone(),
        transform: (&record.odom_from_robot()).into(),
    }];
    if !record.camera.is_blind() {
        transforms.push(TransformStamped {
            header: Header::new(record.stamp, frames.base.as_str()),
            child_frame_id: frames.camera.clone(),
            transform: (&record.camera.robot_from_camera).into(),
        });
    }
    transforms.extend(person_transforms(record, &frames.odom).transforms);
    TFMessage { transforms }
}

/// Returns the transforms of all confirmed people in the odometry frame: `person_12` is at the head
/// of the person with this ID, X along the direction of walking.
pub fn person_transforms(record: &FrameRecord<'_>, odom_frame: &str) -> TFMessage {
    let header = Header::new(record.stamp, odom_frame);
    let transforms = record.confirmed().map(|track| TransformStamped {
        header: header.clone(),
        child_frame_id: format!("person_{}", track.id),
        transform: (&odom_from_person(record, track)).into(),
    });
    TFMessage { transforms: transforms.collect() }
}

/// Returns the confirmed people on the floor of the odometry frame, in the format of planners with
/// a social costmap. The name is the ID of the track, the reliability the probability that it is a
/// person.
pub fn people(record: &FrameRecord<'_>, odom_frame: &str) -> People {
    let odom_from_robot = record.odom_from_robot();
    let people = record.confirmed().map(|track| {
        let head = record.head_in_odom(track);
        let speed = track.estimate.person.velocity;
        let velocity = odom_from_robot * Vector3::new(speed.x, speed.y, 0.0);
        PersonMsg {
            name: track.id.to_string(),
            position: Point { x: head.x, y: head.y, z: 0.0 },
            velocity: Point { x: velocity.x, y: velocity.y, z: 0.0 },
            reliability: probability(track.score),
            ..PersonMsg::default()
        }
    });
    People { header: Header::new(record.stamp, odom_frame), people: people.collect() }
}

/// Data for which the standard messages have no field, one object per frame.
#[derive(Serialize)]
struct FrameJson {
    stamp_ns: u64,
    frame: u64,
    target: Option<u32>,
    wheel_speeds_mps: Option<[f64; 2]>,
    tracks: Vec<TrackJson>,
}

#[derive(Serialize)]
struct TrackJson {
    id: u32,
    confirmed: bool,
    seen: bool,
    occluded: bool,
    age_frames: u32,
    unseen_s: f64,
    probability: f64,
    head_robot_m: [f64; 3],
    head_odom_m: [f64; 3],
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    distance_is_guessed: bool,
    velocity_robot_mps: [f64; 2],
    upper_body_px: [f64; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    joints: Option<BTreeMap<&'static str, [f64; 3]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    body_direction_rad: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    raised_hand: Option<bool>,
}

/// Returns all tracks of a frame as JSON, including tentative ones, with velocity, age and
/// occlusion.
///
/// # Errors
/// Not expected: the message contains no maps.
pub(super) fn json(record: &FrameRecord<'_>) -> serde_json::Result<String> {
    let frame = FrameJson {
        stamp_ns: record.stamp.nanos(),
        frame: record.index,
        target: record.target.map(|id| id.0),
        wheel_speeds_mps: record.command.map(|WheelSpeeds { left, right }| [left, right]),
        tracks: record.tracks.iter().map(|track| track_json(record, track)).collect(),
    };
    serde_json::to_string(&frame)
}

fn track_json(record: &FrameRecord<'_>, track: &Track) -> TrackJson {
    let person = &track.estimate.person;
    let region = track.estimate.region;
    let joints = record.joints_of(track);
    TrackJson {
        id: track.id.0,
        confirmed: track.confirmed,
        seen: track.seen,
        occluded: track.occluded,
        age_frames: track.age,
        unseen_s: rounded(track.unseen_s),
        probability: rounded(probability(track.score)),
        head_robot_m: person.position.coords.map(rounded).into(),
        head_odom_m: record.head_in_odom(track).coords.map(rounded).into(),
        distance_is_guessed: track.estimate.is_distance_guessed(),
        velocity_robot_mps: person.velocity.map(rounded).into(),
        upper_body_px: [region.x, region.y, region.width, region.height].map(rounded),
        joints: joints.map(joints_json),
        body_direction_rad: record.body_direction_rad(track).map(rounded),
        raised_hand: joints.map(Joints::has_raised_hand),
    }
}

/// Returns column and row, pixels, and score of each joint by its name.
fn joints_json(joints: &Joints) -> BTreeMap<&'static str, [f64; 3]> {
    let mut places = BTreeMap::new();
    for (name, joint) in joints.iter() {
        places.insert(name.name(), [joint.at.x, joint.at.y, joint.score].map(rounded));
    }
    places
}

/// Rounds to six decimals, a micrometre, which is short enough to read.
fn rounded(value: f64) -> f64 {
    // Adding 0 turns a negative zero into a positive one.
    (value * 1e6).round() / 1e6 + 0.0
}
