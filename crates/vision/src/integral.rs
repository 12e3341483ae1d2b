use tagalong_core::{Derived, Frame, GreyImage, Result};

/// Integral image: sums of grey values over upright rectangles by four look-ups each.
///
/// The sums are kept modulo 2³²: the sum over a rectangle of up to 16 million pixels is right for
/// images of any size.
#[derive(Clone, Debug, PartialEq)]
pub struct Integral {
    width: usize,
    height: usize,
    /// Sums with one row and one column more than the image; the first ones are 0.
    sums: Vec<u32>,
}

impl Integral {
    /// Computes the sums of an image.
    pub fn new(image: &GreyImage) -> Self {
        let width = image.width();
        let height = image.height();
        let stride = width + 1;
        let mut sums = vec![0_u32; stride * (height + 1)];
        for y in 0..height {
            let (above, below) = sums.split_at_mut(stride * (y + 1));
            let above = &above[stride * y..];
            let mut in_row = 0_u32;
            for ((sum, above), grey) in
                below[1..stride].iter_mut().zip(&above[1..]).zip(image.row(y))
            {
                in_row = in_row.wrapping_add(u32::from(*grey));
                *sum = above.wrapping_add(in_row);
            }
        }
        Self { width, height, sums }
    }

    /// Returns the number of columns of the image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows of the image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the sums above and to the left of each pixel corner, row by row, with
    /// [`Integral::stride`] values per row.
    pub fn sums(&self) -> &[u32] {
        &self.sums
    }

    /// Returns the length of a row of [`Integral::sums`]: the number of columns plus one.
    pub fn stride(&self) -> usize {
        self.width + 1
    }

    /// Returns the sum over columns `left..right` and rows `top..bottom`, cut to the image.
    pub fn sum(&self, left: usize, top: usize, right: usize, bottom: usize) -> u32 {
        if right <= left || bottom <= top {
            return 0;
        }
        // The intermediate differences may be negative, but modulo 2³² the result is right.
        self.sum_before(right, bottom)
            .wrapping_sub(self.sum_before(left, bottom))
            .wrapping_sub(self.sum_before(right, top))
            .wrapping_add(self.sum_before(left, top))
    }

    /// Returns the sum above and to the left of a corner.
    #[inline]
    fn sum_before(&self, x: usize, y: usize) -> u32 {
        self.sums[y.min(self.height) * self.stride() + x.min(self.width)]
    }
}

impl Derived for Integral {
    fn derive(frame: &Frame) -> Result<Self> {
        Ok(Self::new(frame.grey()?))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_sum_is_that_of_the_pixels(
            pixels in prop::collection::vec(any::<u8>(), 12 * 9),
            x in 0..14usize, y in 0..11usize, w in 0..14usize, h in 0..11usize,
        ) {
            fn inside(to: usize, most: usize) -> usize {
                to.min(most)
            }

            let Some(image) = GreyImage::from_pixels(12, 9, pixels) else {
                return Err(TestCaseError::fail("108 pixels are 12 by 9"));
            };
            let rows = inside(y, 9)..inside(y + h, 9);
            let columns = inside(x, 12)..inside(x + w, 12);
            let slow: u32 = rows
                .flat_map(|y| image.row(y)[columns.clone()].iter())
                .map(|grey| u32::from(*grey))
                .sum();
            prop_assert_eq!(Integral::new(&image).sum(x, y, x + w, y + h), slow);
        }
    }

    #[test]
    fn the_sums_have_the_size_of_the_image_and_one_more() {
        let sums = Integral::new(&GreyImage::filled(12, 9, 1));
        assert_eq!((sums.width(), sums.height(), sums.stride()), (12, 9, 13));
    }

    #[test]
    fn an_image_without_pixels_has_no_sums() {
        let empty = Integral::new(&GreyImage::filled(0, 0, 9));
        assert_eq!((empty.sum(0, 0, 5, 5), empty.stride()), (0, 1));
    }
}
