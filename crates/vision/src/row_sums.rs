use tagalong_core::DepthImage;

use crate::speckle::despeckle;

/// Running sums of a row, up to but excluding one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Number of valid pixels.
    pub count: u32,
    /// Sum of their values.
    pub sum: u32,
    /// Sum of their squares.
    pub squares: u64,
}

impl Sums {
    /// Returns the sum over the pixels of `(value - t)²`.
    #[inline]
    pub fn squared_error(&self, t: f64) -> f64 {
        let n = f64::from(self.count);
        // Rounding can make the expanded square slightly negative.
        (n * t * t - 2.0 * t * f64::from(self.sum) + self.squares as f64).max(0.0)
    }

    /// Returns the mean value; 0 if there is no valid pixel.
    #[inline]
    pub fn mean(&self) -> f64 {
        f64::from(self.sum) / f64::from(self.count.max(1))
    }
}

/// Inverse-depth image, reduced by an integer factor, with running sums along each row.
///
/// A template that is constant along runs of a row is then matched exactly in a few operations per
/// row instead of a few per pixel, at any size. Inverse depth is the quantity that stereo and
/// structured light measure: its noise is the same at every range, and a far background is a small
/// number instead of a large one.
#[derive(Clone, Debug)]
pub struct RowSums {
    width: usize,
    height: usize,
    scale: usize,
    values: Vec<u16>,
    sums: Vec<Sums>,
}

impl RowSums {
    /// Value of a point at 1 m; a point at depth `z` has `UNITS / z`.
    pub const UNITS: f64 = 2000.0;
    /// Minimum depth that is represented, m; nearer readings count as invalid.
    pub const MIN_DEPTH_M: f64 = 0.25;

    /// Reduces `depth` by `scale` (at least 1) and computes the sums. Each reduced pixel is the
    /// first valid one of its block, so that small holes close.
    pub fn new(depth: &DepthImage, scale: usize) -> Self {
        Self::of(reduced(depth, scale.max(1)), depth.width() / scale.max(1), scale.max(1))
    }

    /// As [`RowSums::new`], but removes noise in single pixels: readings that are not near any of
    /// their neighbours are dropped, and holes of one pixel within a surface are closed.
    pub fn despeckled(depth: &DepthImage, scale: usize) -> Self {
        let (scale, mut values) = (scale.max(1), reduced(depth, scale.max(1)));
        let width = depth.width() / scale;
        despeckle(&mut values, width);
        Self::of(values, width, scale)
    }

    fn of(values: Vec<u16>, width: usize, scale: usize) -> Self {
        let height = values.len().checked_div(width).unwrap_or(0);
        let mut sums = Vec::with_capacity((width + 1) * height);
        for y in 0..height {
            let mut running = Sums::default();
            sums.push(running);
            sums.extend(values[y * width..(y + 1) * width].iter().map(|value| {
                let value = u32::from(*value);
                // Rows are too short for an overflow, and the check for one takes time.
                running.count = running.count.wrapping_add(u32::from(value != 0));
                running.sum = running.sum.wrapping_add(value);
                running.squares =
                    running.squares.wrapping_add(u64::from(value.wrapping_mul(value)));
                running
            }));
        }
        Self { width, height, scale, values, sums }
    }

    /// Returns the number of reduced columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of reduced rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the number of pixels of the depth image per reduced pixel, along each axis.
    pub fn scale(&self) -> usize {
        self.scale
    }

    /// Returns the value at a reduced pixel: `None` outside, `Some(0)` without a reading.
    #[inline]
    pub fn value(&self, x: i64, y: i64) -> Option<u16> {
        let x = usize::try_from(x).ok()?;
        let y = usize::try_from(y).ok()?;
        (x < self.width && y < self.height).then(|| self.values[y * self.width + x])
    }

    /// Returns the values of row `y`; 0 means no reading.
    ///
    /// # Panics
    /// If `y` is not below the height.
    #[inline]
    pub fn values(&self, y: usize) -> &[u16] {
        &self.values[y * self.width..(y + 1) * self.width]
    }

    /// Returns the depth at a reduced pixel, m; `None` outside and without a reading.
    #[inline]
    pub fn depth_m(&self, x: i64, y: i64) -> Option<f64> {
        self.value(x, y).filter(|v| *v > 0).map(|v| Self::UNITS / f64::from(v))
    }

    /// Returns the sums over the pixels `from..to` of row `y`.
    ///
    /// # Panics
    /// If the run is not inside the row.
    #[expect(clippy::inline_always, reason = "asked three times a row of each silhouette")]
    #[inline(always)]
    pub fn run(&self, y: usize, from: usize, to: usize) -> Sums {
        let row = &self.sums[y * (self.width + 1)..(y + 1) * (self.width + 1)];
        let a = row[from];
        let b = row[to];
        Sums { count: b.count - a.count, sum: b.sum - a.sum, squares: b.squares - a.squares }
    }
}

/// Returns the inverse depths of an image, reduced by `scale`.
fn reduced(depth: &DepthImage, scale: usize) -> Vec<u16> {
    let width = depth.width() / scale;
    let height = depth.height() / scale;
    let mut values = vec![0u16; width * height];
    for y in 0..height {
        let row = &mut values[y * width..(y + 1) * width];
        for dy in 0..scale {
            fill_row(row, depth.row(y * scale + dy), scale);
        }
    }
    values
}

/// Fills the empty pixels of a reduced row from one row of its blocks.
fn fill_row(row: &mut [u16], depth: &[f32], scale: usize) {
    // Blocks of a known width become vector instructions; other widths are rare.
    match scale {
        1 => fill_from_blocks(row, depth.as_chunks::<1>().0),
        2 => fill_from_blocks(row, depth.as_chunks::<2>().0),
        3 => fill_from_blocks(row, depth.as_chunks::<3>().0),
        4 => fill_from_blocks(row, depth.as_chunks::<4>().0),
        _ => {
            for (out, block) in row.iter_mut().zip(depth.chunks_exact(scale)) {
                block.iter().for_each(|z| *out = filled(*out, *z));
            }
        }
    }
}

/// Fills the empty pixels of a reduced row from one row of its blocks.
fn fill_from_blocks<const SCALE: usize>(row: &mut [u16], depth: &[[f32; SCALE]]) {
    for column in 0..SCALE {
        for (out, block) in row.iter_mut().zip(depth) {
            *out = filled(*out, block[column]);
        }
    }
}

/// Returns the value of a reduced pixel after another depth of its block. The code has no branches,
/// so that loops become vector instructions.
#[inline]
fn filled(value: u16, depth_m: f32) -> u16 {
    let nearest = RowSums::MIN_DEPTH_M as f32;
    let seen = whole(RowSums::UNITS as f32 / depth_m.max(nearest) + 0.5);
    let is_wanted = (value == 0) & (depth_m >= nearest);
    if is_wanted { seen } else { value }
}

/// Returns the integer part of a number from 0 to below 2^16. A saturating cast would keep the loop
/// from becoming vector instructions.
fn whole(number: f32) -> u16 {
    // From this power of two on, the last bits of the float are the integer itself.
    const WHOLE: f32 = 8_388_608.0;
    let near = number + WHOLE - WHOLE;
    let below = if near > number { near - 1.0 } else { near };
    (below + WHOLE).to_bits() as u16
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn depth_image() -> impl Strategy<Value = DepthImage> {
        let pixel = prop_oneof![Just(f32::NAN), Just(0.1f32), 0.3f32..12.0];
        (1usize..12, 1usize..9).prop_flat_map(move |(w, h)| {
            prop::collection::vec(pixel.clone(), w * h)
                .prop_map(move |p| DepthImage::from_pixels(w, h, p).unwrap())
        })
    }

    proptest! {
        #[test]
        fn a_whole_part_is_that_of_a_cast(number in 0.0f32..65_535.9, half in 0u16..u16::MAX) {
            prop_assert_eq!(whole(number), number as u16);
            prop_assert_eq!(whole(f32::from(half) + 0.5), half);
            prop_assert_eq!(whole(f32::from(half)), half);
        }

        #[test]
        fn a_run_equals_its_pixels(depth in depth_image(), scale in 1usize..3, t in 0.0..9000.0f64) {
            let rows = RowSums::new(&depth, scale);
            for y in 0..rows.height() {
                for from in 0..=rows.width() {
                    for to in from..=rows.width() {
                        let pixels: Vec<f64> = (from..to)
                            .map(|x| f64::from(rows.value(x as i64, y as i64).unwrap()))
                            .filter(|v| *v > 0.0)
                            .collect();
                        let slow: f64 = pixels.iter().map(|v| (v - t) * (v - t)).sum();
                        let fast = rows.run(y, from, to);
                        prop_assert_eq!(fast.count as usize, pixels.len());
                        prop_assert!((fast.squared_error(t) - slow).abs() <= 1e-6 * slow.max(1.0));
                    }
                }
            }
        }

        #[test]
        fn a_reduced_pixel_is_the_first_valid_of_its_block(depth in depth_image(), scale in 1usize..4) {
            let rows = RowSums::new(&depth, scale);
            for y in 0..rows.height() {
                for x in 0..rows.width() {
                    let block = (0..scale).flat_map(|dy| (0..scale).map(move |dx| (dx, dy)));
                    let first = block
                        .filter_map(|(dx, dy)| depth.get((x * scale + dx) as i64, (y * scale + dy) as i64))
                        .find(|z| *z >= 0.25);
                    let shown = rows.depth_m(x as i64, y as i64);
                    prop_assert_eq!(first.is_some(), shown.is_some());
                    if let (Some(a), Some(b)) = (first, shown) {
                        let a = f64::from(a);
                        prop_assert!((a - b).abs() <= a * a / RowSums::UNITS);
                    }
                }
            }
        }
    }
}
