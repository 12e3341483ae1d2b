//! People of one frame as shapes for viewers: an upright cylinder with the ID and the distance
//! above it, an arrow to the predicted position in one second and the trail on the floor, and boxes
//! in the image.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use tagalong_core::{Stamp, Track};
use tagalong_geometry::{HALF_HEAD_M, Lens};

use super::colours::track_colour;
use super::messages::{MIN_HEADING_SPEED_MPS, odom_from_person};
use super::record::{BoxedPart, FrameRecord};
use super::trails::Trails;
use crate::msgs::{
    ArrowPrimitive, CameraInfo, Color, ColorRgba, CylinderPrimitive, Header, ImageAnnotations,
    LinePrimitive, Marker, MarkerArray, Pixel, Point, PointsAnnotation, Pose, SceneEntity,
    SceneEntityDeletion, SceneUpdate, TextAnnotation, TextPrimitive, Time,
};

/// Diameter of a person, m.
const PERSON_WIDTH_M: f64 = 0.5;

/// Height of the label, and of its centre above the top of the head, m.
const TEXT_M: f64 = 0.25;

/// Width of the arrow, m.
const ARROW_WIDTH_M: f64 = 0.06;

/// Width of the trail, and its height above the floor, m.
const TRAIL_M: f64 = 0.03;

/// Time after which shapes disappear: a viewer that misses the last message must not show people
/// that are gone.
const LIFETIME: Time = Time { sec: 1, nanosec: 0 };

/// Opacity of a person that is seen, and of one that is only predicted.
const OPACITY: (f64, f64) = (0.8, 0.3);

/// Shapes of one person, in the odometry frame.
struct Figure {
    id: u32,
    /// Centre of the upright cylinder.
    middle: Isometry3<f64>,
    height_m: f64,
    /// Position of the label.
    top: Isometry3<f64>,
    /// Pose of the arrow's tail along the direction of walking, and its length; `None` at rest.
    arrow: Option<(Isometry3<f64>, f64)>,
    /// Ends of the lines of the trail, in pairs; empty while the person is not seen.
    trail: Vec<Point>,
    /// ID and distance.
    label: String,
    colour: Color,
}

impl Figure {
    fn of(record: &FrameRecord<'_>, track: &Track, trails: &Trails) -> Self {
        let head = odom_from_person(record, track);
        let at = head.translation.vector;
        // A head far too low must not give a cylinder of negative height.
        let height_m = (at.z + HALF_HEAD_M).max(0.1);
        let [middle, top] = [0.5 * height_m, height_m + TEXT_M].map(|z| {
            Isometry3::from_parts(Vector3::new(at.x, at.y, z).into(), UnitQuaternion::identity())
        });
        let speed = track.estimate.person.velocity.norm();
        let walks = speed >= MIN_HEADING_SPEED_MPS;
        let tail = Isometry3::from_parts(middle.translation, head.rotation);
        Self {
            id: track.id.0,
            middle,
            height_m,
            top,
            arrow: walks.then_some((tail, speed)),
            trail: if track.seen { trail_lines(trails, track) } else { Vec::new() },
            label: label(track),
            colour: colour_of(track),
        }
    }

    fn size(&self) -> Point {
        Point { x: PERSON_WIDTH_M, y: PERSON_WIDTH_M, z: self.height_m }
    }
}

fn colour_of(track: &Track) -> Color {
    let [r, g, b] = track_colour(track.id).map(|v| f64::from(v) / 255.0);
    Color { r, g, b, a: if track.seen { OPACITY.0 } else { OPACITY.1 } }
}

/// Returns the ID of a track and its distance from the robot.
fn label(track: &Track) -> String {
    format!("{} {}", track.id, track.estimate.distance_text())
}

/// Returns the ends of the lines of a trail on the floor, in pairs.
fn trail_lines(trails: &Trails, track: &Track) -> Vec<Point> {
    let pieces = trails.pieces(track.id);
    let lines = pieces.iter().flat_map(|piece| piece.windows(2)).flatten();
    lines.map(|place| point(&Point3::new(place.x, place.y, TRAIL_M))).collect()
}

fn figures(record: &FrameRecord<'_>, trails: &Trails) -> Vec<Figure> {
    record.confirmed().map(|track| Figure::of(record, track, trails)).collect()
}

/// Returns the confirmed people as markers in the odometry frame; those of the previous frame are
/// removed first, and all disappear after a second without a new message.
pub fn markers(record: &FrameRecord<'_>, trails: &Trails, odom_frame: &str) -> MarkerArray {
    let header = Header::new(record.stamp, odom_frame);
    let mut markers = vec![clear_marker(&header)];
    for figure in figures(record, trails) {
        markers.extend(figure_markers(&figure, &header));
    }
    MarkerArray { markers }
}

/// Returns the markers that remove all people from a viewer.
pub fn no_markers(at: Stamp, odom_frame: &str) -> MarkerArray {
    MarkerArray { markers: vec![clear_marker(&Header::new(at, odom_frame))] }
}

fn clear_marker(header: &Header) -> Marker {
    Marker { header: header.clone(), action: Marker::DELETE_ALL, ..Marker::default() }
}

fn figure_markers(figure: &Figure, header: &Header) -> Vec<Marker> {
    let Color { r, g, b, a } = figure.colour;
    let opaque = Marker {
        header: header.clone(),
        // IDs repeat beyond 2^31, which no run reaches.
        id: figure.id as i32,
        action: Marker::ADD,
        pose: (&Isometry3::identity()).into(),
        color: ColorRgba { r: r as f32, g: g as f32, b: b as f32, a: 1.0 },
        lifetime: LIFETIME,
        ..Marker::default()
    };
    let body = Marker {
        ns: "people".into(),
        shape: Marker::CYLINDER,
        scale: figure.size(),
        pose: (&figure.middle).into(),
        color: ColorRgba { a: a as f32, ..opaque.color },
        ..opaque.clone()
    };
    let text = Marker {
        ns: "numbers".into(),
        shape: Marker::TEXT,
        scale: Point { z: TEXT_M, ..Point::default() },
        pose: (&figure.top).into(),
        text: figure.label.clone(),
        ..opaque.clone()
    };
    let arrow = figure.arrow.map(|(tail, length)| Marker {
        points: vec![point(&tail.translation.vector.into()), tip(&tail, length)],
        // The widths of shaft and tip; the length follows from the points.
        scale: Point { x: ARROW_WIDTH_M, y: 2.0 * ARROW_WIDTH_M, z: 0.0 },
        ns: "velocities".into(),
        shape: Marker::ARROW,
        ..opaque.clone()
    });
    // Viewers report an error for lines without points.
    let trail = (!figure.trail.is_empty()).then(|| Marker {
        points: figure.trail.clone(),
        // The width of the lines.
        scale: Point { x: TRAIL_M, ..Point::default() },
        ns: "trails".into(),
        shape: Marker::LINE_LIST,
        ..opaque.clone()
    });
    [Some(body), Some(text), arrow, trail].into_iter().flatten().collect()
}

fn tip(tail: &Isometry3<f64>, length: f64) -> Point {
    point(&(tail * Point3::new(length, 0.0, 0.0)))
}

/// Returns a point, rounded to a micrometre because the rotation by a heading is not exact.
fn point(at: &Point3<f64>) -> Point {
    let [x, y, z] = [at.x, at.y, at.z].map(|v| (v * 1e6).round() / 1e6);
    Point { x, y, z }
}

/// Returns the confirmed people as a scene; those of the previous frame are removed first.
pub(super) fn scene(record: &FrameRecord<'_>, trails: &Trails, odom_frame: &str) -> SceneUpdate {
    let timestamp = record.stamp.into();
    let clear =
        SceneEntityDeletion { timestamp, extent: SceneEntityDeletion::ALL, id: String::new() };
    let entities = figures(record, trails).into_iter().map(|figure| SceneEntity {
        timestamp,
        frame_id: odom_frame.to_owned(),
        id: format!("person_{}", figure.id),
        lifetime: LIFETIME,
        arrows: figure.arrow.iter().map(|(tail, length)| arrow(tail, *length, &figure)).collect(),
        cylinders: vec![CylinderPrimitive {
            pose: (&figure.middle).into(),
            size: figure.size(),
            bottom_scale: 1.0,
            top_scale: 1.0,
            color: figure.colour,
        }],
        texts: vec![TextPrimitive {
            pose: Pose::from(&figure.top),
            billboard: true,
            font_size: TEXT_M,
            scale_invariant: false,
            color: Color { a: 1.0, ..figure.colour },
            text: figure.label.clone(),
        }],
        lines: trail(&figure).into_iter().collect(),
        ..SceneEntity::default()
    });
    SceneUpdate { deletions: vec![clear], entities: entities.collect() }
}

fn arrow(tail: &Isometry3<f64>, length: f64, figure: &Figure) -> ArrowPrimitive {
    // The tip is part of the whole length, which is the distance walked in one second.
    let head_length = (0.3 * length).min(0.2);
    ArrowPrimitive {
        pose: tail.into(),
        shaft_length: length - head_length,
        shaft_diameter: ARROW_WIDTH_M,
        head_length,
        head_diameter: 2.0 * ARROW_WIDTH_M,
        color: Color { a: 1.0, ..figure.colour },
    }
}

/// Returns the trail of a figure; `None` without one.
fn trail(figure: &Figure) -> Option<LinePrimitive> {
    if figure.trail.is_empty() {
        return None;
    }
    Some(LinePrimitive {
        shape: LinePrimitive::LINE_LIST,
        pose: Pose::from(&Isometry3::identity()),
        thickness: TRAIL_M,
        points: figure.trail.clone(),
        color: Color { a: 1.0, ..figure.colour },
        ..LinePrimitive::default()
    })
}

/// Returns the boxes of the confirmed people as annotations of the image.
pub(super) fn annotations(record: &FrameRecord<'_>, part: BoxedPart) -> ImageAnnotations {
    let timestamp = record.stamp.into();
    let mut out = ImageAnnotations::default();
    for track in record.confirmed() {
        let Some(region) = record.visible_region(track, part) else { continue };
        let colour = Color { a: 1.0, ..colour_of(track) };
        let left = region.x;
        let top = region.y;
        let right = region.right();
        let bottom = region.bottom();
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        out.points.push(PointsAnnotation {
            timestamp,
            shape: PointsAnnotation::LINE_LOOP,
            points: corners.map(|(x, y)| Pixel { x, y }).to_vec(),
            outline_color: colour,
            thickness: if track.seen { 3.0 } else { 1.0 },
            ..PointsAnnotation::default()
        });
        if let Some(joints) = record.joints_of(track) {
            let ends = joints.bones().concat();
            out.points.push(PointsAnnotation {
                timestamp,
                shape: PointsAnnotation::LINE_LIST,
                points: ends.iter().map(|end| Pixel { x: end.x, y: end.y }).collect(),
                outline_color: colour,
                thickness: 2.0,
                ..PointsAnnotation::default()
            });
        }
        out.texts.push(TextAnnotation {
            timestamp,
            position: Pixel { x: left, y: top },
            text: label(track),
            font_size: 16.0,
            text_color: colour,
            background_color: Color { r: 0.0, g: 0.0, b: 0.0, a: 0.7 },
        });
    }
    out
}

/// Returns the calibration of the camera; `None` without a lens that the message can describe.
pub(super) fn camera_info(record: &FrameRecord<'_>, frame: &str) -> Option<CameraInfo> {
    let Lens::Pinhole(lens) = &record.camera.lens else { return None };
    let header = Header::new(record.stamp, frame);
    Some(CameraInfo::of_lens(&header, lens, (record.camera.width, record.camera.height), 0.0))
}
