//! Messages for visualisation: markers for RViz and Foxglove, scenes and image annotations for
//! Foxglove. Fields that are never filled have the type of an empty list.

use serde::{Deserialize, Serialize};

use super::{Header, Point, Pose, Time, Vector3, message};

/// Empty list of any type: CDR writes only its length.
pub type Empty = Vec<u8>;

/// `builtin_interfaces/Duration`, with the layout of a [`Time`].
pub type Duration = Time;

/// `std_msgs/ColorRGBA`, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColorRgba {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
    /// Opacity.
    pub a: f32,
}

/// `foxglove_msgs/Color`, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Color {
    /// Red.
    pub r: f64,
    /// Green.
    pub g: f64,
    /// Blue.
    pub b: f64,
    /// Opacity.
    pub a: f64,
}

/// `sensor_msgs/CompressedImage` without contents.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NoImage {
    /// Time and frame.
    pub header: Header,
    /// Format.
    pub format: String,
    /// Contents.
    pub data: Empty,
}

/// `visualization_msgs/Marker`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Time and frame.
    pub header: Header,
    /// Namespace of the id.
    pub ns: String,
    /// ID: a later marker replaces an earlier one.
    pub id: i32,
    /// Shape: [`Marker::ARROW`] and so on.
    pub shape: i32,
    /// [`Marker::ADD`] or [`Marker::DELETE_ALL`].
    pub action: i32,
    /// Pose of its centre.
    pub pose: Pose,
    /// Size along its axes, m.
    pub scale: Vector3,
    /// Colour.
    pub color: ColorRgba,
    /// Time after which the marker disappears; 0 for never.
    pub lifetime: Duration,
    /// True if the marker moves with its frame.
    pub frame_locked: bool,
    /// Tail and tip of an arrow, or the ends of lines.
    pub points: Vec<Point>,
    /// Colours of points.
    pub colors: Empty,
    /// Texture.
    pub texture_resource: String,
    /// Texture as an image.
    pub texture: NoImage,
    /// Coordinates in the texture.
    pub uv_coordinates: Empty,
    /// Text of a label.
    pub text: String,
    /// Mesh.
    pub mesh_resource: String,
    /// Name of the mesh's file.
    pub mesh_file_name: String,
    /// Contents of the mesh's file.
    pub mesh_file_data: Empty,
    /// Material of the mesh.
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    /// Arrow between two points.
    pub const ARROW: i32 = 0;
    /// Upright cylinder.
    pub const CYLINDER: i32 = 3;
    /// Lines between pairs of points.
    pub const LINE_LIST: i32 = 5;
    /// Text that faces the viewer.
    pub const TEXT: i32 = 9;
    /// Adds or replaces the marker.
    pub const ADD: i32 = 0;
    /// Removes all markers of the topic.
    pub const DELETE_ALL: i32 = 3;
}

/// `visualization_msgs/MarkerArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// Markers.
    pub markers: Vec<Marker>,
}

message!(MarkerArray, "visualization_msgs/msg/MarkerArray", "MarkerArray.msg");

/// `foxglove_msgs/SceneEntityDeletion`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneEntityDeletion {
    /// Entities before this time are removed.
    pub timestamp: Time,
    /// 0 removes the entity with the id, 1 all.
    pub extent: u8,
    /// ID of the entity.
    pub id: String,
}

impl SceneEntityDeletion {
    /// Extent of a deletion of all entities of the topic.
    pub const ALL: u8 = 1;
}

/// `foxglove_msgs/ArrowPrimitive`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ArrowPrimitive {
    /// Pose of the tail; the arrow points along X.
    pub pose: Pose,
    /// Length of the shaft, m.
    pub shaft_length: f64,
    /// Diameter of the shaft, m.
    pub shaft_diameter: f64,
    /// Length of the tip, m.
    pub head_length: f64,
    /// Diameter of the tip, m.
    pub head_diameter: f64,
    /// Colour.
    pub color: Color,
}

/// `foxglove_msgs/CylinderPrimitive`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CylinderPrimitive {
    /// Pose of the centre; the axis is Z.
    pub pose: Pose,
    /// Size of the box around it, m.
    pub size: Vector3,
    /// Part of the diameter at the bottom, 0 to 1.
    pub bottom_scale: f64,
    /// Part of the diameter at the top, 0 to 1.
    pub top_scale: f64,
    /// Colour.
    pub color: Color,
}

/// `foxglove_msgs/LinePrimitive`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinePrimitive {
    /// 2 for lines between pairs of points.
    pub shape: u8,
    /// Pose of the origin of the points.
    pub pose: Pose,
    /// Width, m.
    pub thickness: f64,
    /// True if the width is in pixels of the screen.
    pub scale_invariant: bool,
    /// Ends of the lines.
    pub points: Vec<Point>,
    /// Colour.
    pub color: Color,
    /// Colours of points.
    pub colors: Empty,
    /// Order of the points.
    pub indices: Empty,
}

impl LinePrimitive {
    /// Shape of lines between pairs of points.
    pub const LINE_LIST: u8 = 2;
}

/// `foxglove_msgs/TextPrimitive`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TextPrimitive {
    /// Pose of the centre.
    pub pose: Pose,
    /// True if it faces the viewer.
    pub billboard: bool,
    /// Height of a line, m.
    pub font_size: f64,
    /// True if the size is in pixels of the screen.
    pub scale_invariant: bool,
    /// Colour.
    pub color: Color,
    /// The text.
    pub text: String,
}

/// `foxglove_msgs/SceneEntity`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneEntity {
    /// Time.
    pub timestamp: Time,
    /// Frame.
    pub frame_id: String,
    /// ID: a later entity replaces an earlier one.
    pub id: String,
    /// Time after which the entity disappears; 0 for never.
    pub lifetime: Duration,
    /// True if the entity moves with its frame.
    pub frame_locked: bool,
    /// Metadata.
    pub metadata: Empty,
    /// Arrows.
    pub arrows: Vec<ArrowPrimitive>,
    /// Boxes.
    pub cubes: Empty,
    /// Spheres.
    pub spheres: Empty,
    /// Cylinders.
    pub cylinders: Vec<CylinderPrimitive>,
    /// Lines.
    pub lines: Vec<LinePrimitive>,
    /// Triangles.
    pub triangles: Empty,
    /// Texts.
    pub texts: Vec<TextPrimitive>,
    /// Models.
    pub models: Empty,
}

/// `foxglove_msgs/SceneUpdate`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneUpdate {
    /// Entities to remove.
    pub deletions: Vec<SceneEntityDeletion>,
    /// Entities to add or replace.
    pub entities: Vec<SceneEntity>,
}

message!(SceneUpdate, "foxglove_msgs/msg/SceneUpdate", "SceneUpdate.msg");

/// `foxglove_msgs/Point2`, pixels from the upper left corner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pixel {
    /// Column.
    pub x: f64,
    /// Row.
    pub y: f64,
}

/// `foxglove_msgs/PointsAnnotation`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointsAnnotation {
    /// Time of the image.
    pub timestamp: Time,
    /// 2 connects the points to a closed line.
    pub shape: u8,
    /// Points.
    pub points: Vec<Pixel>,
    /// Colour of the line.
    pub outline_color: Color,
    /// Colours of its parts.
    pub outline_colors: Empty,
    /// Colour of the inside.
    pub fill_color: Color,
    /// Width of the line, pixels.
    pub thickness: f64,
}

impl PointsAnnotation {
    /// Shape of a closed line.
    pub const LINE_LOOP: u8 = 2;
    /// Shape of lines with two ends each.
    pub const LINE_LIST: u8 = 4;
}

/// `foxglove_msgs/TextAnnotation`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TextAnnotation {
    /// Time of the image.
    pub timestamp: Time,
    /// Lower left corner.
    pub position: Pixel,
    /// The text.
    pub text: String,
    /// Height of a line, pixels.
    pub font_size: f64,
    /// Colour of the letters.
    pub text_color: Color,
    /// Colour behind them.
    pub background_color: Color,
}

/// `foxglove_msgs/ImageAnnotations`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ImageAnnotations {
    /// Circles.
    pub circles: Empty,
    /// Lines.
    pub points: Vec<PointsAnnotation>,
    /// Texts.
    pub texts: Vec<TextAnnotation>,
}

message!(ImageAnnotations, "foxglove_msgs/msg/ImageAnnotations", "ImageAnnotations.msg");
