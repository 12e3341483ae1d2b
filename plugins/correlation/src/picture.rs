use nalgebra::Point2;
use tagalong_core::{DepthImage, GreyImage};
use tagalong_geometry::Rect;

use crate::strip::Lattice;

/// Cells a side of an upper-body square.
pub(crate) const SIDE: usize = 24;
/// Cells of a picture.
pub(crate) const CELLS: usize = SIDE * SIDE;

/// Grey values are counted from here: sums of squares stay small.
const MIDDLE: f32 = 128.0;

/// Appearance of an upper body, always in the same number of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Brightness, row by row.
    pub(crate) grey: [f32; CELLS],
    /// 1 where depth shows the body, 0 beside it.
    pub(crate) body: [f32; CELLS],
    /// Cells of the body.
    pub(crate) count: f32,
}

/// Something whose depth is to be compared.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Distance {
    /// Along the optical axis, m.
    pub(crate) ahead_m: f64,
    /// Difference of distance from which on a reading is of another object, m.
    pub(crate) tolerance_m: f64,
}

/// Meaning of the depth of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shows {
    /// Nothing is known.
    Nothing,
    /// The person may be there.
    Body,
    Nearer,
    Farther,
}

impl Distance {
    pub(crate) fn shows(&self, metres: f32) -> Shows {
        let metres = f64::from(metres);
        if !(metres > 0.0 && metres.is_finite()) {
            return Shows::Nothing;
        }
        match metres - self.ahead_m {
            off if off < -self.tolerance_m => Shows::Nearer,
            off if off > self.tolerance_m => Shows::Farther,
            _ => Shows::Body,
        }
    }
}

impl Picture {
    /// The picture of a person in an upper-body square, as far away along the optical axis
    /// as `distance`; `None` unless the image shows all of the square, depth the body in
    /// at least `min_body` of it, and nothing nearer.
    pub(crate) fn take(
        grey: &GreyImage,
        depth: &DepthImage,
        square: &Rect,
        distance: &Distance,
        min_body: f64,
    ) -> Option<Self> {
        let mut body = [0.0; CELLS];
        for (body, at) in body.iter_mut().zip(Lattice::around(square, 0, 0).middles()) {
            match distance.shows(nearest(depth, at)?) {
                Shows::Nearer => return None,
                shows => *body = f32::from(shows == Shows::Body),
            }
        }
        let count: f32 = body.iter().sum();
        if f64::from(count) < min_body * CELLS as f64 {
            return None;
        }
        let mut picture = Self { grey: [0.0; CELLS], body, count };
        for (cell, at) in picture.grey.iter_mut().zip(Lattice::around(square, 0, 0).middles()) {
            *cell = brightness(grey, at)?;
        }
        Some(picture)
    }

    /// Returns the fraction of the body, 0 to 1, in a square in which depth shows a person at this
    /// distance.
    pub(crate) fn part_known(&self, depth: &DepthImage, square: &Rect, distance: &Distance) -> f64 {
        let shown = Lattice::around(square, 0, 0).middles().zip(&self.body).filter(|(at, body)| {
            **body > 0.0 && nearest(depth, *at).is_some_and(|m| distance.shows(m) == Shows::Body)
        });
        shown.count() as f64 / f64::from(self.count)
    }
}

/// The depth at a place, m; `None` outside of the image.
pub(crate) fn nearest(depth: &DepthImage, at: Point2<f64>) -> Option<f32> {
    depth.get(at.x.floor() as i64, at.y.floor() as i64)
}

/// The brightness at a place, between the four pixels around it; `None` outside.
pub(crate) fn brightness(grey: &GreyImage, at: Point2<f64>) -> Option<f32> {
    let x = at.x - 0.5;
    let y = at.y - 0.5;
    let left = x.floor() as i64;
    let top = y.floor() as i64;
    let across = (x - x.floor()) as f32;
    let down = (y - y.floor()) as f32;
    let above = brightness_in_row(grey, [left, top], across)?;
    let below = brightness_in_row(grey, [left, top + 1], across)?;
    Some(above + down * (below - above) - MIDDLE)
}

/// Returns the brightness between a pixel and the one to its right.
#[inline]
fn brightness_in_row(grey: &GreyImage, [x, y]: [i64; 2], across: f32) -> Option<f32> {
    let here = f32::from(grey.get(x, y)?);
    let next = f32::from(grey.get(x + 1, y)?);
    Some(here + across * (next - here))
}
