use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use crate::{HEAD_BELOW_TOP_M, UPPER_BODY_SIDE_M};

/// From the centre of a head to its top, m.
const HALF_HEAD_M: f64 = 0.115;

/// An upright rectangle in an image, in pixels. `x`, `y` is the upper left
/// corner; it may lie outside the image.
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
    /// A rectangle from its upper left corner and its size.
    pub const fn new(x: f64, y: f64, width: f64, height: f64) -> Self {
        Self { x, y, width, height }
    }

    /// Right edge.
    pub fn right(&self) -> f64 {
        self.x + self.width
    }

    /// Lower edge.
    pub fn bottom(&self) -> f64 {
        self.y + self.height
    }

    /// Area in square pixels.
    pub fn area(&self) -> f64 {
        self.width * self.height
    }

    /// Middle of the rectangle.
    pub fn centre(&self) -> Point2<f64> {
        Point2::new(self.x + 0.5 * self.width, self.y + 0.5 * self.height)
    }

    /// True if the point lies inside (right and lower edge excluded).
    pub fn contains(&self, point: Point2<f64>) -> bool {
        self.x <= point.x && point.x < self.right() && self.y <= point.y && point.y < self.bottom()
    }

    /// The common part; of zero size where there is none.
    pub fn intersection(&self, other: &Self) -> Self {
        let x = self.x.max(other.x);
        let y = self.y.max(other.y);
        let width = (self.right().min(other.right()) - x).max(0.0);
        let height = (self.bottom().min(other.bottom()) - y).max(0.0);
        Self { x, y, width, height }
    }

    /// Intersection over union, 0 to 1; 0 when both are empty.
    ///
    /// ```
    /// use tagalong_core::Rect;
    /// let a = Rect::new(0.0, 0.0, 2.0, 2.0);
    /// assert_eq!(a.iou(&a), 1.0);
    /// assert_eq!(a.iou(&Rect::new(1.0, 0.0, 2.0, 2.0)), 2.0 / 6.0);
    /// ```
    pub fn iou(&self, other: &Self) -> f64 {
        let common = self.intersection(other).area();
        let union = self.area() + other.area() - common;
        if union > 0.0 { common / union } else { 0.0 }
    }

    /// The part inside an image of the given size.
    pub fn clipped(&self, width: usize, height: usize) -> Self {
        self.intersection(&Self::new(0.0, 0.0, width as f64, height as f64))
    }

    /// Grown by the fraction `by` of each side, about the same centre.
    pub fn inflated(&self, by: f64) -> Self {
        let (dx, dy) = (self.width * by, self.height * by);
        Self::new(self.x - 0.5 * dx, self.y - 0.5 * dy, self.width + dx, self.height + dy)
    }

    /// The upper-body square of a standing person of this height, in metres,
    /// whose whole body fills this rectangle: for boxes of detectors and data
    /// sets that know whole bodies only.
    pub fn upper_body_of_standing(&self, height_m: f64) -> Self {
        let px_per_m = self.height / height_m;
        let side = UPPER_BODY_SIDE_M * px_per_m;
        let above = (HEAD_BELOW_TOP_M - HALF_HEAD_M) * px_per_m;
        Self::new(self.centre().x - 0.5 * side, self.y - above, side, side)
    }

    /// True if all four numbers are finite and the size is not negative.
    pub fn is_sane(&self) -> bool {
        [self.x, self.y, self.width, self.height].iter().all(|v| v.is_finite())
            && self.width >= 0.0
            && self.height >= 0.0
    }
}
