use nalgebra::Point2;
use tagalong_core::TrackId;
use tagalong_geometry::Rect;

/// Visualisation of a filter's state, as [`tagalong_core::Filter::visualise`] may return it, to be
/// drawn over the image.
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

/// Visualisation of a likelihood, as [`tagalong_core::Likelihood::visualise`] may return it: for
/// each person of a scene, the runs of pixels that are compared with the depth of the person, with
/// nearer people in front of farther ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ComparedPixels(pub Vec<Vec<Rect>>);
