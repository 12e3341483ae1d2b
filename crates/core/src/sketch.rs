use nalgebra::Point2;

use crate::{Rect, TrackId};

/// What a plugin shows of its inner workings. It is made for pictures alone, and
/// only where somebody asks for it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sketch {
    /// Single places in the image: particles.
    pub points: Vec<SketchPoint>,
    /// Bodies as they are imagined, as far as nobody nearer hides them.
    pub silhouettes: Vec<Silhouette>,
    /// Maps that are no part of the image.
    pub maps: Vec<SketchMap>,
}

/// A place in the image at which somebody may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SketchPoint {
    /// Who.
    pub id: TrackId,
    /// Where, pixels.
    pub pixel: Point2<f64>,
    /// How much it counts beside the others, 0 to 1.
    pub weight: f64,
}

/// Somebody's imagined body.
#[derive(Clone, Debug, PartialEq)]
pub struct Silhouette {
    /// Who.
    pub id: TrackId,
    /// The body as runs of rows, pixels.
    pub runs: Vec<Rect>,
}

/// A map in shades, row after row.
#[derive(Clone, Debug, PartialEq)]
pub struct SketchMap {
    /// What it shows.
    pub title: String,
    /// Values of a row.
    pub columns: usize,
    /// Values, 0 (dark) to 1 (bright).
    pub values: Vec<f64>,
}
