use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use crate::{HALF_HEAD_M, HEAD_BELOW_TOP_M, UPPER_BODY_SIDE_M};

/// Ratio of height to width from which a box is that of a whole person.
const WHOLE_ASPECT: f64 = 1.5;

/// An upright rectangle in an image, in pixels. `x`, `y` is the upper left corner, which may lie
/// outside the image.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Rect {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width, never negative.
    pub width: f64,
    /// Height, never negative.
    pub height: f64,
}

impl Rect {
    /// Creates a rectangle from its upper left corner and its size.
    pub const fn new(x: f64, y: f64, width: f64, height: f64) -> Self {
        Self { x, y, width, height }
    }

    /// Returns the right edge.
    pub fn right(&self) -> f64 {
        self.x + self.width
    }

    /// Returns the lower edge.
    pub fn bottom(&self) -> f64 {
        self.y + self.height
    }

    /// Returns the area in square pixels.
    pub fn area(&self) -> f64 {
        self.width * self.height
    }

    /// Returns the middle of the rectangle.
    pub fn centre(&self) -> Point2<f64> {
        Point2::new(self.x + 0.5 * self.width, self.y + 0.5 * self.height)
    }

    /// Returns true if the point lies inside (right and lower edge excluded).
    pub fn contains(&self, point: Point2<f64>) -> bool {
        self.x <= point.x && point.x < self.right() && self.y <= point.y && point.y < self.bottom()
    }

    /// Returns the intersection; its size is zero if there is none.
    pub fn intersection(&self, other: &Self) -> Self {
        let x = self.x.max(other.x);
        let y = self.y.max(other.y);
        let width = (self.right().min(other.right()) - x).max(0.0);
        let height = (self.bottom().min(other.bottom()) - y).max(0.0);
        Self { x, y, width, height }
    }

    /// Returns the intersection over union, 0 to 1; 0 when both are empty.
    ///
    /// ```
    /// use tagalong_geometry::Rect;
    /// let a = Rect::new(0.0, 0.0, 2.0, 2.0);
    /// assert_eq!(a.iou(&a), 1.0);
    /// assert_eq!(a.iou(&Rect::new(1.0, 0.0, 2.0, 2.0)), 2.0 / 6.0);
    /// ```
    pub fn iou(&self, other: &Self) -> f64 {
        let common = self.intersection(other).area();
        // Most pairs do not overlap, and this test is cheaper than the sum.
        if common == 0.0 {
            return 0.0;
        }
        let union = self.area() + other.area() - common;
        if union > 0.0 { common / union } else { 0.0 }
    }

    /// Returns the part inside an image of the given size.
    pub fn clipped(&self, width: usize, height: usize) -> Self {
        self.intersection(&Self::new(0.0, 0.0, width as f64, height as f64))
    }

    /// Returns the rectangle with each side longer by the fraction `by`, about the same centre.
    pub fn inflated(&self, by: f64) -> Self {
        let dx = self.width * by;
        let dy = self.height * by;
        Self::new(self.x - 0.5 * dx, self.y - 0.5 * dy, self.width + dx, self.height + dy)
    }

    /// Returns the upper-body square of a standing person of the given height, m, if this rectangle
    /// encloses the whole body: for detectors and data sets that have boxes of whole bodies only.
    pub fn upper_body_of_standing(&self, height_m: f64) -> Self {
        let px_per_m = self.height / height_m;
        let side = UPPER_BODY_SIDE_M * px_per_m;
        let above = (HEAD_BELOW_TOP_M - HALF_HEAD_M) * px_per_m;
        Self::new(self.centre().x - 0.5 * side, self.y - above, side, side)
    }

    /// Returns the box of a whole standing person of the given height, m, if this rectangle is the
    /// upper-body square. The box is half as wide as high, like the images on which people are
    /// recognised.
    pub fn standing_of_upper_body(&self, height_m: f64) -> Self {
        let px_per_m = self.height / UPPER_BODY_SIDE_M;
        let above = (HEAD_BELOW_TOP_M - HALF_HEAD_M) * px_per_m;
        let height = height_m * px_per_m;
        Self::new(self.centre().x - 0.25 * height, self.y + above, 0.5 * height, height)
    }

    /// Returns true if the shape is that of the box of a whole person; that of an upper body is a
    /// square.
    pub fn is_whole_body(&self) -> bool {
        self.height > WHOLE_ASPECT * self.width
    }

    /// Returns true if all four numbers are finite and the size is not negative.
    pub fn is_sane(&self) -> bool {
        [self.x, self.y, self.width, self.height].iter().all(|v| v.is_finite())
            && self.width >= 0.0
            && self.height >= 0.0
    }
}

/// Part of a person that a box encloses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Extent {
    /// Head and shoulders: the square of [`crate::Camera::upper_body`].
    UpperBody,
    /// The whole person, from head to feet.
    FullBody,
}

/// Box of a person in an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageBox {
    /// The rectangle, pixels.
    pub rect: Rect,
    /// Part of the person that the rectangle encloses.
    pub extent: Extent,
}

impl ImageBox {
    /// Creates the box of head and shoulders.
    pub const fn upper_body(rect: Rect) -> Self {
        Self { rect, extent: Extent::UpperBody }
    }

    /// Creates the box of a whole person.
    pub const fn full_body(rect: Rect) -> Self {
        Self { rect, extent: Extent::FullBody }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn edges_area_and_centre_are_those_of_the_corners() {
        let rect = Rect::new(1.0, 2.0, 3.0, 5.0);
        assert_eq!((rect.right(), rect.bottom(), rect.area()), (4.0, 7.0, 15.0));
        assert_eq!(rect.centre(), Point2::new(2.5, 4.5));
    }

    #[test]
    fn the_left_and_upper_edge_are_inside_and_the_others_are_not() {
        let rect = Rect::new(1.0, 2.0, 3.0, 5.0);
        for (x, y) in [(1.0, 2.0), (3.9, 6.9)] {
            assert!(rect.contains(Point2::new(x, y)), "{x} {y}");
        }
        for (x, y) in [(0.9, 3.0), (4.0, 3.0), (2.0, 1.9), (2.0, 7.0)] {
            assert!(!rect.contains(Point2::new(x, y)), "{x} {y}");
        }
    }

    #[test]
    fn what_is_apart_has_nothing_in_common() {
        let a = Rect::new(0.0, 0.0, 4.0, 4.0);
        let b = Rect::new(3.0, 1.0, 4.0, 2.0);
        assert_eq!(a.intersection(&b), Rect::new(3.0, 1.0, 1.0, 2.0));
        let aside = a.intersection(&Rect::new(6.0, 1.0, 1.0, 1.0));
        let below = a.intersection(&Rect::new(1.0, 6.0, 1.0, 1.0));
        assert_eq!((aside.width, aside.area(), below.height, below.area()), (0.0, 0.0, 0.0, 0.0));
        assert_eq!(Rect::default().iou(&Rect::default()), 0.0);
    }

    #[test]
    fn an_image_cuts_off_what_is_outside() {
        let rect = Rect::new(-2.0, -3.0, 10.0, 20.0);
        assert_eq!(rect.clipped(6, 8), Rect::new(0.0, 0.0, 6.0, 8.0));
    }

    #[test]
    fn growing_keeps_the_centre() {
        let grown = Rect::new(1.0, 2.0, 4.0, 8.0).inflated(0.5);
        assert_eq!(grown, Rect::new(0.0, 0.0, 6.0, 12.0));
    }

    #[test]
    fn the_upper_body_of_a_whole_body_has_its_scale_and_middle() {
        let whole = Rect::new(100.0, 50.0, 60.0, 170.0);
        let upper = whole.upper_body_of_standing(1.7);
        assert!((upper.width - 57.0).abs() < 1e-9 && upper.width == upper.height, "{upper:?}");
        assert!((upper.centre().x - 130.0).abs() < 1e-9, "{upper:?}");
        assert!((upper.y - 47.5).abs() < 1e-9, "2.5 cm of air above the head: {upper:?}");
        let again = upper.standing_of_upper_body(1.7);
        let off = [again.y - whole.y, again.height - whole.height, again.width - 85.0];
        assert!(off.iter().all(|off| off.abs() < 1e-9), "{again:?}");
        assert_eq!(again.centre().x, whole.centre().x);
    }

    #[test]
    fn numbers_that_cannot_be_are_found() {
        assert!(Rect::new(-1.0, 0.0, 0.0, 0.0).is_sane());
        for odd in [f64::NAN, f64::INFINITY] {
            assert!(!Rect::new(odd, 0.0, 1.0, 1.0).is_sane());
            assert!(!Rect::new(0.0, 0.0, 1.0, odd).is_sane());
        }
        assert!(!Rect::new(0.0, 0.0, -1.0, 1.0).is_sane());
        assert!(!Rect::new(0.0, 0.0, 1.0, -1.0).is_sane());
    }

    proptest! {
        #[test]
        fn overlap_is_symmetric_and_a_share(
            x in -5.0..5.0f64, y in -5.0..5.0f64, width in 0.1..6.0f64, height in 0.1..6.0f64,
        ) {
            let a = Rect::new(0.0, 0.0, 3.0, 4.0);
            let b = Rect::new(x, y, width, height);
            let common = a.intersection(&b).area();
            let expected = common / (12.0 + width * height - common);
            prop_assert!((a.iou(&b) - expected).abs() < 1e-12);
            prop_assert!((a.iou(&b) - b.iou(&a)).abs() < 1e-12);
            prop_assert!((0.0..=1.0).contains(&a.iou(&b)));
        }
    }
}
