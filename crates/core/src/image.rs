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
    /// An image of one value.
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

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels in row order.
    pub fn pixels(&self) -> &[P] {
        &self.pixels
    }

    /// All pixels in row order, to write.
    pub fn pixels_mut(&mut self) -> &mut [P] {
        &mut self.pixels
    }

    /// One row.
    ///
    /// # Panics
    /// If `y` is not below the height.
    pub fn row(&self, y: usize) -> &[P] {
        &self.pixels[y * self.width..(y + 1) * self.width]
    }

    /// The pixel at column `x`, row `y`, or `None` outside.
    pub fn get(&self, x: i64, y: i64) -> Option<P> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        (x < self.width && y < self.height).then(|| self.pixels[y * self.width + x])
    }

    /// Every pixel changed by `change`.
    pub fn map<Q>(&self, change: impl FnMut(P) -> Q) -> Image<Q> {
        let pixels = self.pixels.iter().copied().map(change).collect();
        Image { width: self.width, height: self.height, pixels }
    }
}

impl RgbImage {
    /// Luma by the weights of ITU-R BT.601, rounded.
    pub fn to_grey(&self) -> GreyImage {
        self.map(|[r, g, b]| {
            ((299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b) + 500) / 1000) as u8
        })
    }
}
