//! Points of an image that can be found again in the next one: corners, at most one per cell.

use nalgebra::Point2;
use tagalong_core::GreyImage;

use crate::odometry::OdometrySettings;
use crate::odometry::patch::{PIXELS, Patch};

/// Distance between candidates, px of the half image; a patch is twice as wide.
const STRIDE: usize = 4;

/// Mean slope of a patch, as a fraction of the slope of an edge in it.
const MEAN_SLOPE: f64 = 0.3;

/// Returns the corners of an image, pixels of its full size: the patches with the largest change of
/// brightness in the direction of the least change (J. Shi and C. Tomasi, *Good features to track*,
/// CVPR 1994).
pub(super) fn corners(levels: &[GreyImage], settings: &OdometrySettings) -> Vec<Point2<f64>> {
    // The image of half the size has a quarter of the candidates, and less noise.
    let (image, size) = match levels {
        [_, half, ..] => (half, 2),
        [full] => (full, 1),
        [] => return Vec::new(),
    };
    let cell = (settings.cell_px / size).max(STRIDE);
    let corners = (0..image.height())
        .step_by(cell)
        .flat_map(|top| (0..image.width()).step_by(cell).map(move |left| (left, top)))
        .filter_map(|corner| corner_of_cell(image, corner, cell, settings.min_slope));
    // The patch around a full pixel starts at an even one.
    corners.map(|(x, y)| Point2::new((size * x) as f64, (size * y) as f64)).collect()
}

/// Returns the best corner of a cell; `None` if none is good enough.
fn corner_of_cell(
    image: &GreyImage,
    (left, top): (usize, usize),
    cell: usize,
    min_slope: f64,
) -> Option<(usize, usize)> {
    // The mean over a patch is less than the slope of an edge in it.
    let mut most = PIXELS as f64 * (MEAN_SLOPE * min_slope).powi(2);
    let mut best = None;
    for y in (top..(top + cell).min(image.height())).step_by(STRIDE) {
        for x in (left..(left + cell).min(image.width())).step_by(STRIDE) {
            let Some(patch) = Patch::new(image, x, y) else { continue };
            let least = least_change(patch.products);
            if least > most {
                (best, most) = (Some((x, y)), least);
            }
        }
    }
    best
}

/// Returns the smaller eigenvalue of the matrix of slopes, from its entries xx, xy, yy.
fn least_change([xx, xy, yy]: [f64; 3]) -> f64 {
    let mean = 0.5 * (xx + yy);
    let half = 0.5 * (xx - yy);
    mean - half.hypot(xy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(pixel: impl Fn(usize, usize) -> u8) -> Vec<Point2<f64>> {
        let full = GreyImage::from_fn(192, 96, &pixel);
        let half = GreyImage::from_fn(96, 48, |x, y| pixel(2 * x, 2 * y));
        corners(&[full, half], &OdometrySettings::default())
    }

    #[test]
    fn the_corners_of_a_board_are_found_and_its_edges_are_not() {
        fn off(v: f64) -> f64 {
            (v / 48.0 - (v / 48.0).round()).abs() * 48.0
        }

        let board = found(|x, y| if (x / 48 + y / 48) % 2 == 0 { 30 } else { 220 });
        assert!(board.len() >= 3, "{board:?}");
        for at in &board {
            assert!(off(at.x) < 9.0 && off(at.y) < 9.0, "{at}");
        }
        let stripes = found(|x, _| if (x / 48) % 2 == 0 { 30 } else { 220 });
        assert_eq!(stripes, [], "a stripe may have moved along itself");
        assert_eq!(found(|_, _| 90), [], "a bare wall");
    }

    #[test]
    fn the_smaller_eigenvalue_is_that_of_the_matrix() {
        for [xx, xy, yy] in [[4.0, 0.0, 9.0], [5.0, 2.0, 3.0], [1.0, 1.0, 1.0]] {
            let matrix = nalgebra::Matrix2::new(xx, xy, xy, yy);
            let expected = matrix.symmetric_eigenvalues().min();
            assert!((least_change([xx, xy, yy]) - expected).abs() < 1e-12);
        }
    }
}
