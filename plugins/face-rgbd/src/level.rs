//! An image at one scale: its pixels and their integral images.

use tagalong_core::GreyImage;

use crate::cascade::Part;
use crate::compiled::LANES;

/// A part of an image in another size, with the sums of its values and of their squares.
///
/// Rows of sums are as long as those of the largest image so far, so that the offsets of features
/// stay the same from size to size. Where windows begin at every second column, the sums of even
/// columns come first in a row and those of odd columns after them: the sums of neighbouring
/// windows are then adjacent in memory.
#[derive(Clone, Debug, Default)]
pub struct Level {
    width: usize,
    height: usize,
    stride: usize,
    step: usize,
    pixels: Vec<u8>,
    /// Upright sums, and after them the tilted ones, if a cascade has tilted features.
    sums: Vec<u32>,
    squares: Vec<u32>,
    /// Offset of the tilted sums.
    tilted_from: usize,
    /// Memory for three rows of tilted sums.
    tilted_rows: [Vec<u32>; 3],
    /// For each column: its first source column, and the share of the next one in 256ths.
    columns: Vec<(usize, u32)>,
    /// A row between two rows of the source, in 256ths.
    between: Vec<u32>,
}

impl Level {
    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the numbers on which offsets depend: sums in a row, columns from window to window,
    /// and the offset of the tilted sums.
    pub fn layout(&self) -> (usize, usize, usize) {
        (self.stride, self.step, self.tilted_from)
    }

    /// Returns the offset of the sum above and left of the upper left corner of pixel (x, y).
    /// Offsets of pixels in a window add up with that of its first pixel, where a window can begin.
    pub fn offset(&self, x: usize, y: usize) -> usize {
        let step = self.step.max(1);
        y * self.stride + x % step * (self.stride / step) + x / step
    }

    /// Returns the offset of a tilted sum: of all pixels above the two diagonals that go up from the
    /// upper left corner of pixel (x, y).
    pub fn tilted_offset(&self, x: usize, y: usize) -> usize {
        self.tilted_from + self.offset(x, y)
    }

    /// Returns the values, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels[..self.width * self.height]
    }

    /// Returns the sums above and left of each corner of the pixels, modulo 2^32.
    pub fn sums(&self) -> &[u32] {
        &self.sums
    }

    /// Returns the same sums of squares.
    pub fn squares(&self) -> &[u32] {
        &self.squares
    }

    /// Computes the level of a whole image, resampled to `width` by `height` pixels (see
    /// [`Level::fill_part`]).
    pub fn fill(&mut self, image: &GreyImage, (width, height): (usize, usize), step: usize) {
        let whole = Part { x: 0, y: 0, width, height };
        self.fill_part(image, (width, height), whole, step);
    }

    /// Computes the level of a part of an image resampled to `size`, interpolated between four of
    /// its pixels; skipped pixels are not averaged, because OpenCV's cascades were trained on
    /// windows of this kind. Windows begin at each pixel (`step` 1) or at every second one (2).
    pub fn fill_part(&mut self, image: &GreyImage, size: (usize, usize), part: Part, step: usize) {
        (self.width, self.height, self.step) = (part.width, part.height, step.clamp(1, 2));
        // Even, so that sums of even and of odd columns have equal room in a row.
        self.stride = (image.width().max(size.0) + 1).next_multiple_of(2);
        self.tilted_from = self.stride * (image.height().max(size.1) + 1) + LANES;
        self.pixels.resize((part.width * part.height).max(self.pixels.len()), 0);
        if part.width * part.height == 0 || image.width() * image.height() == 0 {
            (self.width, self.height) = (0, 0);
            return;
        }
        self.resample(image, size, part);
        self.sum_up();
    }

    /// Computes the tilted sums of the level: T(x, y) = T(x - 1, y - 1) + T(x + 1, y - 1)
    /// - T(x, y - 2) + the two pixels at (x - 1, y - 1) and (x - 1, y - 2).
    pub fn add_tilted(&mut self) {
        let width = self.width;
        let height = self.height;
        let length = self.tilted_from + self.stride * (height + 1) + LANES;
        self.sums.resize(length.max(self.sums.len()), 0);
        let [mut before, mut above, mut row] = std::mem::take(&mut self.tilted_rows);
        for sums in [&mut before, &mut above, &mut row] {
            sums.clear();
            sums.resize(width + 1, 0);
        }
        for y in 0..=height {
            for x in 0..=width {
                // Beside the image a diagonal meets what it meets at the border two rows above.
                let left = if x == 0 { before[0] } else { above[x - 1] };
                let right = if x == width { before[width] } else { above[x + 1] };
                let upper = left.wrapping_add(right).wrapping_sub(before[x]);
                let [first, second] = [1, 2].map(|up| pixel_above(&self.pixels, width, [x, y], up));
                row[x] = upper.wrapping_add(first).wrapping_add(second);
            }
            for (x, sum) in row.iter().enumerate() {
                let at = self.tilted_offset(x, y);
                self.sums[at] = *sum;
            }
            (before, above, row) = (above, row, before);
        }
        self.tilted_rows = [before, above, row];
    }

    fn resample(&mut self, image: &GreyImage, size: (usize, usize), part: Part) {
        let Self { width, pixels, columns, between, .. } = self;
        columns.clear();
        columns.extend((part.x..part.x + part.width).map(|x| place(x, size.0, image.width())));
        let first = columns[0].0;
        let last = columns[*width - 1].0;
        columns.iter_mut().for_each(|(x, _)| *x -= first);
        let end = (last + 2).min(image.width());
        between.resize(last + 2 - first, 0);
        for (y, row) in (part.y..).zip(pixels.chunks_exact_mut(*width).take(part.height)) {
            let (above, share) = place(y, size.1, image.height());
            let below = (above + 1).min(image.height() - 1);
            let rows = [above, below].map(|y| &image.row(y)[first..end]);
            blend_rows(rows, share, between);
            // The last column has no right neighbour, and is repeated.
            if end < last + 2 {
                between[end - first] = between[end - first - 1];
            }
            blend_columns(between, columns, row);
        }
    }

    fn sum_up(&mut self) {
        let Self { width, height, stride, step, pixels, sums, squares, .. } = self;
        // The last block of neighbouring windows may extend beyond the end.
        let length = *stride * (*height + 1) + LANES;
        for sums in [&mut *sums, &mut *squares] {
            sums.resize(length.max(sums.len()), 0);
            sums[..*stride].fill(0);
        }
        let add = if *step == 1 { add_row::<1> } else { add_row::<2> };
        for (y, row) in pixels.chunks_exact(*width).take(*height).enumerate() {
            add(row, *stride, &mut sums[y * *stride..], &mut squares[y * *stride..]);
        }
    }
}

/// Computes the sums below a row, of values and of squares, from those above it.
fn add_row<const STEP: usize>(row: &[u8], stride: usize, sums: &mut [u32], squares: &mut [u32]) {
    let ((above, below), (squares_above, squares_below)) =
        (sums.split_at_mut(stride), squares.split_at_mut(stride));
    let mut sum = 0_u32;
    let mut square = 0_u32;
    (below[0], squares_below[0]) = (0, 0);
    for (index, values) in row.chunks(STEP).enumerate() {
        for (side, value) in values.iter().enumerate() {
            let x = side + 1;
            let at = x % STEP * (stride / STEP) + x / STEP + index;
            sum = sum.wrapping_add(u32::from(*value));
            square = square.wrapping_add(u32::from(*value).pow(2));
            below[at] = above[at].wrapping_add(sum);
            squares_below[at] = squares_above[at].wrapping_add(square);
        }
    }
}

/// Returns the position of pixel `x` of `count` among `of` pixels: the pixel before it, and the
/// share of the next in 256ths.
fn place(x: usize, count: usize, of: usize) -> (usize, u32) {
    // Positions refer to pixel centres, so half a pixel is added and removed.
    let at = (x as f64 + 0.5) * of as f64 / count as f64 - 0.5;
    let at = at.clamp(0.0, (of - 1) as f64);
    let before = (at as usize).min(of.saturating_sub(2));
    (before, ((at - before as f64) * 256.0).round() as u32)
}

/// Interpolates a row between two rows, in 256ths.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn blend_rows([above, below]: [&[u8]; 2], share: u32, out: &mut [u32]) {
    for ((out, above), below) in out.iter_mut().zip(above).zip(below) {
        *out = u32::from(*above) * (256 - share) + u32::from(*below) * share;
    }
}

/// Interpolates pixels between the columns of a row.
fn blend_columns(row: &[u32], columns: &[(usize, u32)], out: &mut [u8]) {
    for (pixel, &(x, right)) in out.iter_mut().zip(columns) {
        // Half of the divisor rounds to the nearest value.
        *pixel = ((row[x] * (256 - right) + row[x + 1] * right + 32768) >> 16) as u8;
    }
}

/// Returns the pixel left of a corner and this many rows above it, 0 outside the image.
#[inline]
fn pixel_above(pixels: &[u8], width: usize, [x, y]: [usize; 2], up: usize) -> u32 {
    match (x.checked_sub(1), y.checked_sub(up)) {
        (Some(x), Some(y)) => u32::from(pixels[y * width + x]),
        _ => 0,
    }
}
