use nalgebra::Point2;

use crate::TrackId;
use tagalong_geometry::Rect;

/// Visualisation of a plugin's inner state. It is made on request only.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sketch {
    /// Points in the image: particles.
    pub points: Vec<SketchPoint>,
    /// Hypothetical bodies, without the parts that nearer bodies occlude.
    pub silhouettes: Vec<Silhouette>,
    /// Maps that are not part of the image.
    pub maps: Vec<SketchMap>,
}

/// Possible position of a person in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SketchPoint {
    /// Track of the person.
    pub id: TrackId,
    /// Position, pixels.
    pub pixel: Point2<f64>,
    /// Weight relative to the other points, 0 to 1.
    pub weight: f64,
}

/// Silhouette of a hypothetical body.
#[derive(Clone, Debug, PartialEq)]
pub struct Silhouette {
    /// Track of the person.
    pub id: TrackId,
    /// Body as horizontal runs, pixels.
    pub runs: Vec<Rect>,
}

/// A map in shades of grey, row after row.
#[derive(Clone, Debug, PartialEq)]
pub struct SketchMap {
    /// Title of the map.
    pub title: String,
    /// Number of values per row.
    pub columns: usize,
    /// Values, 0 (dark) to 1 (bright).
    pub values: Vec<f64>,
}
