use tagalong_geometry::{HEAD_BELOW_TOP_M, Rect, UPPER_BODY_SIDE_M};

/// Samples per side of a region at which its depth is read.
const TAPS: usize = 5;
/// Least number of readings for a region to have a depth.
const LEAST_READINGS: usize = 8;
/// Half the side of the square of the face in which depth is read, m.
const HALF_FACE_M: f64 = 0.07;
/// Fewest readings from which the depth of a face is computed.
const LEAST_OF_FACE: usize = 4;

/// A dense image, row by row, without padding.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Image<P> {
    width: usize,
    height: usize,
    pixels: Vec<P>,
}

/// Colour: red, green, blue.
pub type RgbImage = Image<[u8; 3]>;
/// Intensity.
pub type GreyImage = Image<u8>;
/// Depth along the optical axis in metres; NaN is "no reading".
pub type DepthImage = Image<f32>;

impl<P: Copy> Image<P> {
    /// Creates an image of one value.
    pub fn filled(width: usize, height: usize, value: P) -> Self {
        Self { width, height, pixels: vec![value; width * height] }
    }

    /// Wraps pixels in row order; `None` unless there are `width * height`.
    pub fn from_pixels(width: usize, height: usize, pixels: Vec<P>) -> Option<Self> {
        (width.checked_mul(height)? == pixels.len()).then_some(Self { width, height, pixels })
    }

    /// Computes every pixel from its column and row.
    pub fn from_fn(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> P) -> Self {
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            pixels.extend((0..width).map(|x| pixel(x, y)));
        }
        Self { width, height, pixels }
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns all pixels in row order.
    pub fn pixels(&self) -> &[P] {
        &self.pixels
    }

    /// Returns all pixels in row order, mutably.
    pub fn pixels_mut(&mut self) -> &mut [P] {
        &mut self.pixels
    }

    /// Returns one row.
    ///
    /// # Panics
    /// If `y` is not below the height.
    pub fn row(&self, y: usize) -> &[P] {
        &self.pixels[y * self.width..(y + 1) * self.width]
    }

    /// Returns the pixel at column `x`, row `y`, or `None` outside.
    pub fn get(&self, x: i64, y: i64) -> Option<P> {
        let x = usize::try_from(x).ok()?;
        let y = usize::try_from(y).ok()?;
        (x < self.width && y < self.height).then(|| self.pixels[y * self.width + x])
    }

    /// Returns the image with `change` applied to every pixel.
    pub fn map<Q>(&self, change: impl FnMut(P) -> Q) -> Image<Q> {
        let pixels = self.pixels.iter().copied().map(change).collect();
        Image { width: self.width, height: self.height, pixels }
    }
}

impl RgbImage {
    /// Converts to luma by the weights of ITU-R BT.601, rounded.
    pub fn to_grey(&self) -> GreyImage {
        self.map(|[r, g, b]| {
            ((299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b) + 500) / 1000) as u8
        })
    }
}

impl DepthImage {
    /// Converts millimetres in row order, as depth cameras give them, to metres; 0 and 65535 are "no
    /// reading". `None` unless there are `width * height`.
    ///
    /// ```
    /// use tagalong_core::DepthImage;
    /// let depth = DepthImage::from_millimetres(2, 1, &[2000, 0]).expect("two pixels");
    /// assert_eq!(depth.get(0, 0), Some(2.0));
    /// assert!(depth.get(1, 0).is_some_and(f32::is_nan));
    /// ```
    pub fn from_millimetres(width: usize, height: usize, pixels: &[u16]) -> Option<Self> {
        let metres = pixels.iter().copied().map(metres_of).collect();
        Self::from_pixels(width, height, metres)
    }

    /// Returns true for a depth that was measured: a number above 0.
    pub fn is_reading(metres: f32) -> bool {
        // `&` instead of `&&` avoids a branch per reading.
        (metres > 0.0) & (metres < f32::INFINITY)
    }

    /// Returns the depth of the surface in the middle of a region, m: the median of 5x5 samples in
    /// its central half, of which at least 8 must be readings.
    pub fn surface_m(&self, of: &Rect) -> Option<f64> {
        let columns = taps(of.x, of.width);
        let rows = taps(of.y, of.height);
        // An array instead of a vector saves an allocation per region.
        let mut sorted = [f32::INFINITY; TAPS * TAPS];
        let readings = rows.into_iter().flat_map(|y| self.readings(&columns, y));
        let readings = readings.filter(|metres| Self::is_reading(*metres));
        let mut count = 0;
        for (to, metres) in sorted.iter_mut().zip(readings) {
            *to = metres;
            count += 1;
        }
        let shown = (count >= LEAST_READINGS).then_some(&mut sorted[..count])?;
        let (_, median, _) = shown.select_nth_unstable_by(count / 2, f32::total_cmp);
        Some(f64::from(*median))
    }

    /// Returns the depth of the face in a square around head and shoulders, m: the median of the
    /// readings around the middle of the head, of which there must be some. It is what
    /// [`tagalong_geometry::FaceDepth::or_measured`] takes.
    ///
    /// ```
    /// use tagalong_core::DepthImage;
    /// use tagalong_geometry::Rect;
    /// // A head before a chest.
    /// let depth = DepthImage::from_fn(100, 100, |_, y| if y < 50 { 2.0 } else { 2.2 });
    /// let square = Rect::new(10.0, 10.0, 80.0, 80.0);
    /// assert_eq!(depth.face_m(&square), Some(2.0));
    /// ```
    pub fn face_m(&self, upper_body: &Rect) -> Option<f64> {
        let px_per_m = upper_body.width / UPPER_BODY_SIDE_M;
        let half = HALF_FACE_M * px_per_m;
        let x = upper_body.centre().x;
        let y = upper_body.y + HEAD_BELOW_TOP_M * px_per_m;
        let face = Rect::new(x - half, y - half, 2.0 * half, 2.0 * half);
        let face = face.clipped(self.width(), self.height());
        let left = face.x as usize;
        let right = face.right() as usize;
        let rows = face.y as usize..face.bottom() as usize;
        let mut readings: Vec<f32> = rows
            // A face on the right of the image starts beyond the row.
            .flat_map(|y| self.row(y).get(left..right).unwrap_or_default().iter().copied())
            .filter(|metres| Self::is_reading(*metres))
            .collect();
        // The median ignores the background that shows beside a narrow face.
        readings.sort_by(f32::total_cmp);
        let enough = readings.len() >= LEAST_OF_FACE;
        enough.then(|| f64::from(readings[readings.len() / 2]))
    }

    /// Returns the depths of a row at the given columns; NaN outside of the image.
    fn readings(&self, columns: &[usize; TAPS], y: usize) -> [f32; TAPS] {
        let row = if y < self.height { self.row(y) } else { &[] };
        columns.map(|x| row.get(x).copied().unwrap_or(f32::NAN))
    }
}

/// Returns the sample coordinates in the central half of the interval that begins at `from`;
/// negative ones become larger than any image.
fn taps(from: f64, size: f64) -> [usize; TAPS] {
    std::array::from_fn(|i| (from + size * (2 + i) as f64 / 8.0) as i64 as usize)
}

/// Converts millimetres to metres. Cameras write 0 where they measure nothing, and some the largest
/// number.
fn metres_of(millimetres: u16) -> f32 {
    if matches!(millimetres, 0 | u16::MAX) { f32::NAN } else { f32::from(millimetres) * 0.001 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_face_outside_of_the_image_has_no_depth() {
        let depth = DepthImage::filled(40, 30, 2.0);
        for (x, y) in [(60.0, 0.0), (-60.0, 0.0), (0.0, 60.0), (0.0, -60.0), (60.0, 60.0)] {
            assert_eq!(depth.face_m(&Rect::new(x, y, 40.0, 40.0)), None, "{x}, {y}");
        }
        assert_eq!(depth.face_m(&Rect::new(0.0, 0.0, 40.0, 40.0)), Some(2.0));
    }

    #[test]
    fn a_face_of_zeros_or_infinities_has_no_depth_and_some_of_them_do_not_matter() {
        let square = Rect::new(0.0, 0.0, 40.0, 40.0);
        for hole in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(DepthImage::filled(40, 40, hole).face_m(&square), None, "{hole}");
            // Two of three pixels are holes, so that they would be the median.
            let holed = DepthImage::from_fn(40, 40, |x, _| if x % 3 == 0 { 2.0 } else { hole });
            assert_eq!(holed.face_m(&square), Some(2.0), "{hole}");
        }
    }

    #[test]
    fn millimetres_become_metres_and_what_cameras_write_for_nothing_is_no_reading() {
        let depth = DepthImage::from_millimetres(2, 2, &[0, 1, 2345, u16::MAX]).unwrap();
        let holes: Vec<bool> = depth.pixels().iter().map(|metres| metres.is_nan()).collect();
        assert_eq!(holes, [true, false, false, true]);
        assert_eq!(depth.pixels()[1..3], [0.001, 2.345]);
        assert_eq!(DepthImage::from_millimetres(2, 2, &[1; 3]), None);
    }

    /// Collects all readings and sorts them.
    fn slow_surface_m(depth: &DepthImage, of: &Rect) -> Option<f64> {
        let mut seen: Vec<f32> = Vec::new();
        for j in 2..7 {
            for i in 2..7 {
                let x = of.x + of.width * f64::from(i) / 8.0;
                let y = of.y + of.height * f64::from(j) / 8.0;
                seen.extend(depth.get(x as i64, y as i64).filter(|m| m.is_finite() && *m > 0.0));
            }
        }
        seen.sort_by(f32::total_cmp);
        (seen.len() >= 8).then(|| f64::from(seen[seen.len() / 2]))
    }

    proptest! {
        #[test]
        fn the_surface_is_the_median_of_what_the_middle_shows(
            x in -20.0..50.0f64, y in -20.0..40.0f64, width in 2.0..40.0f64, height in 2.0..40.0f64,
            holes in 2..9usize,
        ) {
            let depth = DepthImage::from_fn(48, 32, |x, y| match (x * 7 + y * 13) % holes {
                0 => f32::NAN,
                1 => 0.0,
                _ => ((x * 31 + y * 17) % 50) as f32 * 0.1,
            });
            let of = Rect::new(x, y, width, height);
            prop_assert_eq!(depth.surface_m(&of), slow_surface_m(&depth, &of));
        }
    }

    #[test]
    fn pixels_lie_row_by_row() {
        let mut image = GreyImage::from_fn(3, 2, |x, y| (10 * y + x) as u8);
        assert_eq!((image.width(), image.height()), (3, 2));
        assert_eq!(image.pixels(), [0, 1, 2, 10, 11, 12]);
        assert_eq!(image.row(1), [10, 11, 12]);
        let at = [(2, 1), (0, 0), (3, 0), (0, 2), (-1, 0), (0, -1)].map(|(x, y)| image.get(x, y));
        assert_eq!(at, [Some(12), Some(0), None, None, None, None]);
        image.pixels_mut()[5] = 7;
        assert_eq!(image.get(2, 1), Some(7));
        let doubled = image.map(|value| u16::from(value) * 2);
        assert_eq!(doubled.row(1), [20, 22, 14]);
    }

    #[test]
    fn pixels_that_do_not_fill_the_image_are_no_image() {
        assert!(GreyImage::from_pixels(3, 2, vec![0; 6]).is_some());
        assert!(GreyImage::from_pixels(3, 2, vec![0; 5]).is_none());
        assert!(GreyImage::from_pixels(usize::MAX, 2, vec![]).is_none());
        assert_eq!(GreyImage::filled(2, 3, 9).pixels(), [9; 6]);
    }

    #[test]
    fn grey_is_the_luma_of_the_colour_rounded() {
        let colours =
            vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3], [1, 1, 0], [10, 20, 30]];
        let grey = RgbImage::from_pixels(6, 1, colours).unwrap().to_grey();
        assert_eq!(grey.pixels(), [76, 150, 29, 255, 1, 18]);
    }
}
