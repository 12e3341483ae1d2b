use nalgebra::{Point2, Vector2};
use tagalong_core::GreyImage;
use tagalong_geometry::Rect;

/// Number of cells of a side of a window.
pub const SIDE: usize = 64;
/// Number of cells of a window.
pub(crate) const CELLS: usize = SIDE * SIDE;
/// Width of a window, upper-body squares: as much again as the person is searched.
pub(crate) const WINDOW: f64 = 2.0;

/// Turn and growth of a window about its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Change {
    pub(crate) turn_rad: f64,
    pub(crate) growth: f64,
}

impl Change {
    pub(crate) const NONE: Self = Self { turn_rad: 0.0, growth: 1.0 };
}

/// Window around an upper-body square, sampled at [`SIDE`] by [`SIDE`] cells: logarithms of the
/// intensities, of mean 0 and deviation 1, which fade to 0 towards the border.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch(pub(crate) Vec<f32>);

impl Patch {
    /// Samples the window around a square. Outside of the image its border is continued.
    pub fn new(image: &GreyImage, square: &Rect) -> Self {
        Self::changed(image, square, Change::NONE)
    }

    /// Samples the window, turned and grown about its middle.
    pub(crate) fn changed(image: &GreyImage, square: &Rect, change: Change) -> Self {
        let (sine, cosine) = change.turn_rad.sin_cos();
        let step =
            Vector2::new(square.width, square.height) * (WINDOW * change.growth / SIDE as f64);
        let mut cells = Vec::with_capacity(CELLS);
        for (row, column) in (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column))) {
            let (x, y) = (offset(column) * step.x, offset(row) * step.y);
            let turned = Vector2::new(cosine * x - sine * y, sine * x + cosine * y);
            cells.push(intensity(image, square.centre() + turned).ln_1p());
        }
        normalise(&mut cells);
        Self(cells)
    }
}

/// Returns the offset of a cell from the middle cell, cells.
fn offset(cell: usize) -> f64 {
    cell as f64 - (SIDE / 2) as f64
}

/// Returns the intensity at a place, interpolated between the four pixels around it.
fn intensity(image: &GreyImage, at: Point2<f64>) -> f32 {
    let (x, y) = (at.x - 0.5, at.y - 0.5);
    let (across, down) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
    let pixel = |dx: i64, dy: i64| {
        let column = (x.floor() as i64 + dx).clamp(0, image.width() as i64 - 1);
        let row = (y.floor() as i64 + dy).clamp(0, image.height() as i64 - 1);
        image.get(column, row).map_or(0.0, f32::from)
    };
    let upper = pixel(0, 0) + across * (pixel(1, 0) - pixel(0, 0));
    let lower = pixel(0, 1) + across * (pixel(1, 1) - pixel(0, 1));
    upper + down * (lower - upper)
}

/// Brings cells to mean 0 and deviation 1, and lets them fade towards the border: a transform takes
/// the window for a tile of an endless floor, whose seams must not count.
fn normalise(cells: &mut [f32]) {
    let mean = cells.iter().sum::<f32>() / CELLS as f32;
    let variance = cells.iter().map(|value| (value - mean).powi(2)).sum::<f32>() / CELLS as f32;
    // An even window has no deviation to divide by.
    let scale = 1.0 / (variance.sqrt() + 1e-3);
    for (number, value) in cells.iter_mut().enumerate() {
        *value = (*value - mean) * scale * fade(number / SIDE) * fade(number % SIDE);
    }
}

/// Returns the weight of a row or column: a half wave of a sine.
fn fade(cell: usize) -> f32 {
    (std::f32::consts::PI * cell as f32 / SIDE as f32).sin()
}
