//! One size of an image: its pixels and their sums.

use tagalong_core::GreyImage;

/// An image in another size, with the sums of its values and of their squares.
/// Rows of sums are as long as those of the largest image so far, so that the
/// offsets of features stay what they are from size to size.
#[derive(Clone, Debug, Default)]
pub struct Level {
    width: usize,
    height: usize,
    stride: usize,
    pixels: Vec<u8>,
    sums: Vec<u32>,
    squares: Vec<u32>,
    /// For each column: where it begins in the source, and the share of the next
    /// pixel in 256ths.
    columns: Vec<(usize, u32)>,
}

impl Level {
    /// Columns of the image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of the image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Sums in a row.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// The values, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels[..self.width * self.height]
    }

    /// Sums of what is above and left of each corner of the pixels, modulo 2^32.
    pub fn sums(&self) -> &[u32] {
        &self.sums
    }

    /// The same of squares.
    pub fn squares(&self) -> &[u32] {
        &self.squares
    }

    /// Takes the place of another size: `width` by `height` pixels of an image,
    /// interpolated between four of its pixels; no mean over what is skipped, so
    /// that windows look as those did that OpenCV's cascades were made for.
    pub fn fill(&mut self, image: &GreyImage, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.stride = image.width().max(width) + 1;
        self.pixels.resize((width * height).max(self.pixels.len()), 0);
        if width * height == 0 || image.width() * image.height() == 0 {
            (self.width, self.height) = (0, 0);
            return;
        }
        self.resample(image);
        self.sum_up();
    }

    fn resample(&mut self, image: &GreyImage) {
        let Self { width, height, pixels, columns, .. } = self;
        columns.clear();
        columns.extend((0..*width).map(|x| place(x, *width, image.width())));
        for (y, row) in pixels.chunks_exact_mut(*width).take(*height).enumerate() {
            let (above, share) = place(y, *height, image.height());
            let below = (above + 1).min(image.height() - 1);
            blend(image.row(above), image.row(below), share, columns, row);
        }
    }

    fn sum_up(&mut self) {
        let (width, stride) = (self.width, self.stride);
        let length = stride * (self.height + 1);
        self.sums.resize(length.max(self.sums.len()), 0);
        self.squares.resize(length.max(self.squares.len()), 0);
        self.sums[..stride].fill(0);
        self.squares[..stride].fill(0);
        for (y, row) in self.pixels.chunks_exact(width).take(self.height).enumerate() {
            add_row(row, &mut self.sums[y * stride..], stride, u32::from);
            add_row(row, &mut self.squares[y * stride..], stride, |v| u32::from(v).pow(2));
        }
    }
}

/// The sums below a row from those above it.
fn add_row(row: &[u8], sums: &mut [u32], stride: usize, value: impl Fn(u8) -> u32) {
    let (above, below) = sums.split_at_mut(stride);
    let mut in_row = 0_u32;
    below[0] = 0;
    for ((below, above), pixel) in below[1..].iter_mut().zip(&above[1..]).zip(row) {
        in_row = in_row.wrapping_add(value(*pixel));
        *below = above.wrapping_add(in_row);
    }
}

/// Where pixel `x` of `count` lies among `of` pixels: the one before it, and the
/// share of the next in 256ths.
fn place(x: usize, count: usize, of: usize) -> (usize, u32) {
    let at = (x as f64 + 0.5) * of as f64 / count as f64 - 0.5;
    let at = at.clamp(0.0, (of - 1) as f64);
    let before = (at as usize).min(of.saturating_sub(2));
    (before, ((at - before as f64) * 256.0).round() as u32)
}

/// A row between two rows.
fn blend(above: &[u8], below: &[u8], share: u32, columns: &[(usize, u32)], out: &mut [u8]) {
    let last = above.len() - 1;
    for (pixel, &(x, right)) in out.iter_mut().zip(columns) {
        let next = (x + 1).min(last);
        let across = |row: &[u8]| u32::from(row[x]) * (256 - right) + u32::from(row[next]) * right;
        *pixel = ((across(above) * (256 - share) + across(below) * share + 32768) >> 16) as u8;
    }
}
