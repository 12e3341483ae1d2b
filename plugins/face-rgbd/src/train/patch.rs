//! Windows cut out of pictures.

use tagalong_core::GreyImage;
use tagalong_geometry::Rect;

use crate::compiled::Compiled;
use crate::{Cascade, Level, PassedWindow};

/// A window as its sums, and the reciprocal of its contrast.
#[derive(Clone)]
pub(super) struct Patch {
    pub(super) level: Level,
    pub(super) contrast: f32,
}

impl Patch {
    /// Creates a patch; `None` for a window without contrast.
    pub(super) fn new(pixels: &GreyImage, side: usize) -> Option<Self> {
        let mut level = Level::default();
        level.fill(pixels, (side, side), 1);
        let area = ((side - 2) * (side - 2)) as f64;
        let mut sum = 0.0;
        let mut squares = 0.0;
        for y in 1..side - 1 {
            for value in &pixels.row(y)[1..side - 1] {
                sum += f64::from(*value);
                squares += f64::from(*value) * f64::from(*value);
            }
        }
        let root = (area * squares - sum * sum).max(0.0).sqrt();
        (root > 10.0 * area).then(|| Self { level, contrast: (1.0 / root) as f32 })
    }

    /// Cuts out a window that a scan took for a face.
    pub(super) fn of(seen: &PassedWindow<'_>, side: usize) -> Option<Self> {
        let pixels = seen.level.pixels();
        let width = seen.level.width();
        let cut = GreyImage::from_fn(side, side, |x, y| pixels[(seen.y + y) * width + seen.x + x]);
        Self::new(&cut, side)
    }

    /// Returns true if the patch passes the last stage of the cascade.
    pub(super) fn passes_last(&self, cascade: &Cascade) -> bool {
        let last = cascade.stages.last().into_iter().cloned().collect();
        let only = Cascade { stages: last, features: cascade.features.clone(), ..*cascade };
        let compiled = Compiled::new(&only, &self.level);
        compiled.passes(0, &compiled.start(&self.level, (0, 0)), 0)
    }
}

/// Cuts out a window and resamples it to `side` pixels as a scan does: interpolated, without
/// averaging over skipped pixels. Outside the picture its border is continued. The window is turned
/// clockwise about its middle by `tilt`, rad.
pub(super) fn window(grey: &GreyImage, region: &Rect, tilt: f64, side: usize) -> GreyImage {
    let scale = region.width / side as f64;
    let middle = region.centre();
    let (sin, cos) = tilt.sin_cos();
    GreyImage::from_fn(side, side, |i, j| {
        let [right, down] = [i, j].map(|at| (at as f64 + 0.5 - 0.5 * side as f64) * scale);
        let x = middle.x + right * cos - down * sin - 0.5;
        let y = middle.y + right * sin + down * cos - 0.5;
        let left = x.floor();
        let top = y.floor();
        let right = x - left;
        let down = y - top;
        let left = left as i64;
        let top = top as i64;
        let [upper, lower] = [top, top + 1].map(|y| {
            clamped_pixel(grey, left, y) * (1.0 - right) + clamped_pixel(grey, left + 1, y) * right
        });
        (upper * (1.0 - down) + lower * down).round() as u8
    })
}

/// Returns a pixel; outside the picture its border is continued.
fn clamped_pixel(grey: &GreyImage, x: i64, y: i64) -> f64 {
    let [x, y] = [(x, grey.width()), (y, grey.height())]
        .map(|(v, length)| v.clamp(0, length.max(1) as i64 - 1));
    f64::from(grey.get(x, y).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_turned_window_sees_a_plane_turned(
            x in 30.0..50.0f64, y in 30.0..50.0f64, width in 10.0..40.0f64, tilt in -0.5..0.5f64,
        ) {
            let picture = GreyImage::from_fn(120, 120, |x, y| (x + y / 2) as u8);
            let region = Rect::new(x, y, width, width);
            let found = window(&picture, &region, tilt, 12);
            let middle = region.centre() - nalgebra::Point2::new(0.5, 0.5);
            let turn = nalgebra::Rotation2::new(tilt);
            for (index, value) in found.pixels().iter().enumerate() {
                let i = (index % 12) as f64 - 5.5;
                let j = (index / 12) as f64 - 5.5;
                let at = middle + turn * nalgebra::Vector2::new(i, j) * width / 12.0;
                prop_assert!((f64::from(*value) - at.x - 0.5 * at.y).abs() < 1.5, "{value} {at}");
            }
        }
    }

    /// The contrast is that of the window without its border: 324 times the deviation.
    #[test]
    fn a_patch_has_contrast_or_is_none() {
        fn chequers(bright: u8) -> GreyImage {
            GreyImage::from_fn(20, 20, |x, y| if (x + y).is_multiple_of(2) { 100 } else { bright })
        }
        let contrast = Patch::new(&chequers(140), 20).unwrap().contrast;
        assert!((contrast * 324.0 * 20.0 - 1.0).abs() < 1e-4, "{contrast}");
        assert!(
            Patch::new(&chequers(122), 20).is_some() && Patch::new(&chequers(118), 20).is_none()
        );
    }
}
