use tagalong_core::{DepthImage, GreyImage, Image, RgbImage};
use tagalong_geometry::Rect;

/// Cells along each side of the window.
pub const SIDE: usize = 32;
/// Rows of cells in depth, where the window goes on below the square: half a
/// square more shows whether anything carries the shoulders.
pub const ROWS: usize = 48;

/// The window is larger than the square by this fraction of its side.
const GROW: f64 = 0.1;

/// Something lies on the candidate if it is this near to it in depth, m.
const NEAR_M: f32 = 0.3;

/// A part of the window.
#[derive(Clone, Copy)]
pub struct Zone {
    /// First row and the one after the last.
    pub rows: [usize; 2],
    /// First column and the one after the last.
    pub columns: [usize; 2],
}

/// Where the head is in an upper-body square.
pub const HEAD: Zone = Zone { rows: [3, 14], columns: [11, 21] };
/// Where the chest and the shoulders are.
pub const TORSO: Zone = Zone { rows: [17, 32], columns: [6, 26] };

impl Zone {
    /// Indices into a grid of [`SIDE`] columns, row by row.
    pub fn cells(self) -> impl Iterator<Item = usize> {
        let [left, right] = self.columns;
        (self.rows[0]..self.rows[1]).flat_map(move |row| (left..right).map(move |c| row * SIDE + c))
    }
}

/// One value a cell, row by row.
pub type Grid<T> = [T; SIDE * SIDE];

/// The pixels of each cell of a window in an image.
pub struct Window {
    columns: [(usize, usize); SIDE],
    rows: [(usize, usize); SIDE],
}

impl Window {
    /// Creates the window of a square; outside of the image its border is continued. `None` in an
    /// image without pixels.
    pub fn new(image: &GreyImage, region: &Rect) -> Option<Self> {
        let width = image.width();
        let height = image.height();
        let around = region.inflated(GROW);
        (width > 0 && height > 0).then(|| Self {
            columns: cells(around.x, around.width, width),
            rows: cells(around.y, around.height, height),
        })
    }

    /// Mean intensity of each cell.
    pub fn grey(&self, image: &GreyImage) -> Grid<f32> {
        self.means(image, |grey| [u32::from(grey)]).map(|[grey]| grey)
    }

    /// Mean colour of each cell.
    pub fn colour(&self, image: &RgbImage) -> Grid<[f32; 3]> {
        self.means(image, |colour| colour.map(u32::from))
    }

    fn means<P: Copy, const N: usize>(
        &self,
        image: &Image<P>,
        channels: impl Fn(P) -> [u32; N],
    ) -> Grid<[f32; N]> {
        std::array::from_fn(|cell| {
            let ((top, bottom), (left, right)) =
                (self.rows[cell / SIDE], self.columns[cell % SIDE]);
            let mut sums = [0u32; N];
            for y in top..bottom {
                for pixel in &image.row(y)[left..right] {
                    let each = sums.iter_mut().zip(channels(*pixel));
                    each.for_each(|(sum, value)| *sum = sum.saturating_add(value));
                }
            }
            let count = ((bottom - top) * (right - left)) as f32;
            sums.map(|sum| sum as f32 / count)
        })
    }
}

/// The pixels of each cell along one axis, at least one a cell.
fn cells(start: f64, length: f64, size: usize) -> [(usize, usize); SIDE] {
    let edges: [f64; SIDE + 1] =
        std::array::from_fn(|k| (start + length * k as f64 / SIDE as f64).clamp(0.0, size as f64));
    std::array::from_fn(|k| {
        let first = (edges[k] as usize).min(size - 1);
        // At least one pixel for a cell, also in small squares.
        (first, (edges[k + 1] as usize).clamp(first + 1, size))
    })
}

/// Depth in the middle of each cell, relative to the head, m: positive is
/// farther, NaN is no reading.
pub struct Surface(pub [f32; SIDE * ROWS]);

impl Surface {
    /// The surface of a square; `None` where the head has no depth.
    pub fn new(depth: &DepthImage, region: &Rect) -> Option<Self> {
        fn step(length: f64) -> f64 {
            length / SIDE as f64
        }

        let around = region.inflated(GROW);
        let mut cells: [f32; SIDE * ROWS] = std::array::from_fn(|cell| {
            let x = around.x + step(around.width) * ((cell % SIDE) as f64 + 0.5);
            let y = around.y + step(around.height) * ((cell / SIDE) as f64 + 0.5);
            let reading = depth.get(x.floor() as i64, y.floor() as i64).unwrap_or(f32::NAN);
            if reading.is_finite() && reading > 0.0 { reading } else { f32::NAN }
        });
        let mut head: Vec<f32> = HEAD.cells().map(|c| cells[c]).filter(|d| !d.is_nan()).collect();
        head.sort_by(f32::total_cmp);
        let middle = *head.get(head.len() / 2)?;
        cells.iter_mut().for_each(|d| *d -= middle);
        Some(Self(cells))
    }

    /// Whether a cell lies on the candidate.
    pub fn is_on(&self, cell: usize) -> bool {
        self.0[cell].abs() <= NEAR_M
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn cells_are_means_of_their_pixels(seed: u32, x in 2usize..9, y in 2usize..9, block in 1usize..4) {
            let image = GreyImage::from_fn(160, 160, |x, y| {
                ((x as u32).wrapping_mul(73_856_093) ^ (y as u32).wrapping_mul(19_349_663) ^ seed).wrapping_mul(2_654_435_761).to_be_bytes()[0]
            });
            // A square of which the window has whole pixels in each cell.
            let side = (SIDE * block) as f64;
            let square = Rect::new(x as f64, y as f64, side, side).inflated(1.0 / 1.1 - 1.0);
            let shift = 1e-6;
            let square = Rect { x: square.x + shift, y: square.y + shift, ..square };
            let grid = Window::new(&image, &square).unwrap().grey(&image);
            for (cell, mean) in grid.iter().enumerate() {
                let left = x + cell % SIDE * block;
                let top = y + cell / SIDE * block;
                let pixels = (top..top + block).flat_map(|y| (left..left + block).map(move |x| (x, y)));
                let sum: f32 = pixels.map(|(x, y)| f32::from(image.row(y)[x])).sum();
                prop_assert!((mean - sum / (block * block) as f32).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn depth_is_relative_to_the_head() {
        let depth = DepthImage::from_fn(64, 64, |_, y| if y < 40 { 2.0 } else { 2.5 });
        let surface = Surface::new(&depth, &Rect::new(5.0, 5.0, 50.0, 50.0)).unwrap();
        assert_eq!((surface.0[10 * SIDE + 16], surface.0[30 * SIDE + 16]), (0.0, 0.5));
        assert!(surface.0[47 * SIDE + 16].is_nan(), "below the image there is no reading");
        let blind = DepthImage::filled(64, 64, f32::NAN);
        assert!(Surface::new(&blind, &Rect::new(5.0, 5.0, 50.0, 50.0)).is_none());
    }

    #[test]
    fn depth_is_that_of_the_middle_of_a_cell_and_zero_is_no_reading() {
        // The window of 64 pixels: two in a cell.
        let square = Rect::new(0.0, 0.0, 64.0, 64.0).inflated(1.0 / 1.1 - 1.0);
        let depth = DepthImage::from_fn(64, 96, |x, y| match (x, y) {
            (60.., 20..) => 0.0,
            (60.., _) => f32::INFINITY,
            _ => 2.0 + 0.02 * (x / 2) as f32,
        });
        let surface = Surface::new(&depth, &square).unwrap();
        let [a, b, c] = [(20, 4), (10, 4), (20, 40)].map(|(x, y)| surface.0[y * SIDE + x]);
        assert!((a - b - 0.2).abs() < 1e-5);
        assert_eq!(a, c);
        let [above, below] = [(31, 2), (31, 30)].map(|(x, y)| surface.0[y * SIDE + x]);
        assert!(above.is_nan() && below.is_nan());
    }
}
