//! Signed rectangles: the sparse random projection of P2, eqs 1 to 3.

use tagalong_core::GreyImage;
use tagalong_math::{ChaCha, RandomSource};
use tagalong_vision::Integral;

/// A rectangle in a box of size 1 by 1, with its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Left edge, 0 to 1.
    pub left: f64,
    /// Upper edge, 0 to 1.
    pub top: f64,
    /// Width, above 0.
    pub width: f64,
    /// Height, above 0.
    pub height: f64,
    /// Weight of its mean grey value.
    pub weight: f64,
}

/// Lists of rectangles; a list is one row of the projection matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Features(Vec<Vec<Rectangle>>);

impl Features {
    /// Draws `count` lists of 2 to `most` rectangles. A row of the matrix has
    /// four entries other than 0 on average, of either sign; they are scaled by
    /// the root of their number, so that all lists vary alike.
    pub fn draw(count: usize, most: usize, seed: u64) -> Self {
        let mut random = ChaCha::new(seed, 0);
        let mut lists = Vec::with_capacity(count);
        for _ in 0..count {
            let rectangles = 2 + below(&mut random, most.max(2) - 1);
            let weight = 1.0 / (rectangles as f64).sqrt();
            lists.push((0..rectangles).map(|_| rectangle(&mut random, weight)).collect());
        }
        Self(lists)
    }

    /// Returns the number of features of a box.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// True without any.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The rectangles of each number.
    pub fn lists(&self) -> &[Vec<Rectangle>] {
        &self.0
    }

    /// Puts them on boxes of `width` by `height` pixels in images whose integral
    /// has the given stride.
    pub fn scaled(&self, width: usize, height: usize, stride: usize) -> Scaled {
        let mut scaled = Scaled { width, height, stride, corners: Vec::new(), ends: Vec::new() };
        for list in &self.0 {
            for rectangle in list {
                let [left, top, right, bottom] = rectangle.pixels(width, height);
                scaled.corners.push(Corners {
                    at: [[left, top], [right, top], [left, bottom], [right, bottom]]
                        .map(|[x, y]| y * stride + x),
                    weight: (rectangle.weight / ((right - left) * (bottom - top)) as f64) as f32,
                });
            }
            scaled.ends.push(scaled.corners.len());
        }
        scaled
    }
}

impl Rectangle {
    /// Left, top, right, bottom in a box of so many pixels; at least one pixel.
    pub fn pixels(&self, width: usize, height: usize) -> [usize; 4] {
        fn span(from: f64, length: f64, size: usize) -> (usize, usize) {
            let start = ((from * size as f64).round() as usize).min(size.saturating_sub(1));
            let end = ((from + length) * size as f64).round() as usize;
            (start, end.clamp(start + 1, size.max(start + 1)))
        }

        let (left, right) = span(self.left, self.width, width);
        let (top, bottom) = span(self.top, self.height, height);
        [left, top, right, bottom]
    }

    /// Its part of a number, pixel by pixel: the reference of [`Scaled::measure`].
    pub fn of_pixels(&self, image: &GreyImage, x: usize, y: usize, size: (usize, usize)) -> f64 {
        let [left, top, right, bottom] = self.pixels(size.0, size.1);
        let mut sum = 0.0;
        for row in y + top..y + bottom {
            for grey in &image.row(row)[x + left..x + right] {
                sum += f64::from(*grey);
            }
        }
        self.weight * sum / ((right - left) * (bottom - top)) as f64
    }
}

fn rectangle(random: &mut ChaCha, weight: f64) -> Rectangle {
    let width = 0.05 + 0.45 * random.uniform();
    let height = 0.05 + 0.45 * random.uniform();
    Rectangle {
        left: random.uniform() * (1.0 - width),
        top: random.uniform() * (1.0 - height),
        width,
        height,
        weight: if below(random, 2) == 0 { weight } else { -weight },
    }
}

fn below(random: &mut ChaCha, end: usize) -> usize {
    // Rounding can give `end` itself.
    ((random.uniform() * end as f64) as usize).min(end - 1)
}

/// The rectangles for boxes of one size, as places in an integral image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scaled {
    width: usize,
    height: usize,
    stride: usize,
    corners: Vec<Corners>,
    /// Where the list of each number ends in `corners`.
    ends: Vec<usize>,
}

/// The four corners of a rectangle, from that of its box.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Corners {
    at: [usize; 4],
    weight: f32,
}

impl Scaled {
    /// Columns and rows of the boxes.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Stride of the integral images that it fits.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// True if the box with this upper left corner lies in the image.
    pub fn fits(&self, integral: &Integral, x: i64, y: i64) -> bool {
        fn inside(from: i64, size: usize, whole: usize) -> bool {
            from >= 0 && size > 0 && from as usize + size <= whole
        }

        integral.stride() == self.stride
            && inside(x, self.width, integral.width())
            && inside(y, self.height, integral.height())
    }

    /// The numbers that describe the box with this upper left corner, which must
    /// fit: weighted means of grey values.
    pub fn measure(&self, integral: &Integral, x: usize, y: usize, numbers: &mut [f32]) {
        let sums = &integral.sums()[y * self.stride + x..];
        let mut start = 0;
        for (number, end) in numbers.iter_mut().zip(&self.ends) {
            *number = self.corners[start..*end].iter().map(|c| c.weight * c.sum(sums)).sum();
            start = *end;
        }
    }
}

impl Corners {
    fn sum(&self, sums: &[u32]) -> f32 {
        let [a, b, c, d] = self.at.map(|at| sums[at]);
        d.wrapping_sub(c).wrapping_sub(b).wrapping_add(a) as f32
    }
}
