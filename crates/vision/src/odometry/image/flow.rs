//! Tracking of a point from one image to the next.

use nalgebra::{Matrix2, Point2, Vector2};
use tagalong_core::GreyImage;

use crate::odometry::patch::Patch;

/// Maximum number of steps at each size of the images.
const STEPS: usize = 15;
/// A step smaller than this ends the search, px.
const STILL_PX: f64 = 0.01;
/// Maximum shift of a whole image, as a fraction of its sides.
const REACH: f64 = 0.2;
/// Maximum difference of the brightness of a matching patch: the noise of a camera, grey levels,
/// ...
const NOISE_GREY: f64 = 5.0;
/// ... and a fraction of the contrast of the patch, for the distortion by the motion.
const BENT: f64 = 0.5;

/// Returns the position of a point of one image in another, pixels, searched from coarse to fine
/// and from a guess of its shift (B. Lucas and T. Kanade, *An iterative image registration
/// technique*, IJCAI 1981; J.-Y. Bouguet, *Pyramidal implementation of the Lucas Kanade feature
/// tracker*, 2000). `None` if the point left the image, or nothing there looks like it.
pub(super) fn track(
    from: &[GreyImage],
    to: &[GreyImage],
    at: Point2<f64>,
    guess: Vector2<f64>,
) -> Option<Point2<f64>> {
    let mut shift = guess;
    for level in (1..from.len().min(to.len())).rev() {
        let size = f64::from(1_u32 << level);
        // If a coarse image shows too little of the point, the search goes on in the next finer
        // one.
        if let Some((finer, _)) = refined(&from[level], &to[level], at / size, shift / size) {
            shift = finer * size;
        }
    }
    let (shift, difference) = refined(from.first()?, to.first()?, at, shift)?;
    (difference <= 1.0).then(|| at + shift)
}

/// Returns the shift of a whole image relative to another, pixels of its full size, to the accuracy
/// of a pixel of the coarsest image: for a camera that jerks by more than the width of a patch.
pub(super) fn whole_shift(from: &[GreyImage], to: &[GreyImage]) -> Vector2<f64> {
    fn reach(side: usize) -> i64 {
        (REACH * side as f64) as i64
    }

    let level = from.len().min(to.len()).saturating_sub(1);
    let (Some(from), Some(to)) = (from.get(level), to.get(level)) else { return Vector2::zeros() };
    let columns = reach(from.width());
    let rows = reach(from.height());
    let mut best = (misfit(from, to, (0, 0)), (0, 0));
    for dy in -rows..=rows {
        for dx in -columns..=columns {
            let found = misfit(from, to, (dx, dy));
            // Of shifts that fit equally well the first one is kept, which is no shift at all.
            if found < best.0 {
                best = (found, (dx, dy));
            }
        }
    }
    let (dx, dy) = best.1;
    Vector2::new(dx as f64, dy as f64) * f64::from(1_u32 << level)
}

/// Returns the mean difference of the brightness of two images, of which the second is shifted,
/// over the part that both show.
fn misfit(from: &GreyImage, to: &GreyImage, (dx, dy): (i64, i64)) -> f64 {
    fn both(shift: i64, side: usize) -> std::ops::Range<usize> {
        let side = side as i64;
        ((-shift).max(0) as usize)..((side - shift.max(0)).max(0) as usize)
    }
    let columns = both(dx, from.width().min(to.width()));
    let there = (columns.start as i64 + dx) as usize..(columns.end as i64 + dx) as usize;
    let rows = both(dy, from.height().min(to.height()));
    let pixels = (columns.len() * rows.len()).max(1);
    let sum: u64 = rows
        .map(|y| {
            let here = &from.row(y)[columns.clone()];
            let there = &to.row((y as i64 + dy) as usize)[there.clone()];
            let pairs = here.iter().zip(there);
            pairs.map(|(here, there)| u64::from(here.abs_diff(*there))).sum::<u64>()
        })
        .sum();
    sum as f64 / pixels as f64
}

/// Refines the shift of a patch from a guess. Returns the shift and the square of the remaining
/// difference, relative to the largest accepted one; `None` beyond the border of an image, or if
/// the patch has no corner.
fn refined(
    from: &GreyImage,
    to: &GreyImage,
    at: Point2<f64>,
    guess: Vector2<f64>,
) -> Option<(Vector2<f64>, f64)> {
    // Every pixel of the patch is moved by the same shift, so the pixel next to the point
    // represents it.
    let pixel = at.map(|v| v.max(0.0) as usize);
    let patch = Patch::new(from, pixel.x, pixel.y)?;
    let [xx, xy, yy] = patch.products;
    let inverse = Matrix2::new(xx, xy, xy, yy).try_inverse()?;
    let base = Vector2::new(pixel.x as f64, pixel.y as f64);
    let mut shift = guess;
    for _ in 0..STEPS {
        let step = inverse * Vector2::from(patch.compare(to, base + shift)?.along);
        shift -= step;
        if step.norm() < STILL_PX {
            break;
        }
    }
    let allowed = NOISE_GREY * NOISE_GREY + BENT * BENT * patch.variance();
    Some((shift, patch.compare(to, base + shift)?.mean_square / allowed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::odometry::image::levels;

    /// A pattern without a period: random brightness in squares of 16 pixels, and smooth between.
    fn pattern(x: f64, y: f64) -> f64 {
        fn knot(i: f64, j: f64) -> f64 {
            let at = (i + 1000.0) * 4000.0 + j + 1000.0;
            (tagalong_math::number_at(5, at as u64) >> 56) as f64
        }

        fn smooth(part: f64) -> f64 {
            part * part * (3.0 - 2.0 * part)
        }

        let i = (x / 16.0).floor();
        let j = (y / 16.0).floor();
        let across = smooth(x / 16.0 - i);
        let down = smooth(y / 16.0 - j);
        let [above, below] =
            [j, j + 1.0].map(|j| knot(i, j) + across * (knot(i + 1.0, j) - knot(i, j)));
        above + down * (below - above)
    }

    fn image(dx: f64, dy: f64) -> GreyImage {
        GreyImage::from_fn(320, 240, |x, y| pattern(x as f64 - dx, y as f64 - dy).round() as u8)
    }

    #[test]
    fn a_point_is_found_between_pixels_and_far_away() {
        let before = levels(&image(0.0, 0.0));
        for (dx, dy) in [(0.0, 0.0), (0.4, -0.3), (6.25, 3.5), (-9.0, 2.2), (41.0, -17.5)] {
            let after = levels(&image(dx, dy));
            let at = Point2::new(140.0, 96.0);
            let guess = whole_shift(&before, &after);
            let found = track(&before, &after, at, guess).unwrap();
            let off = found - at - Vector2::new(dx, dy);
            assert!(off.norm() < 0.1, "{dx} {dy}: {off}");
        }
    }

    #[test]
    fn a_whole_image_is_found_to_the_pixel_of_the_coarsest_one() {
        let before = levels(&image(0.0, 0.0));
        let step = f64::from(1_u32 << (before.len() - 1));
        for (dx, dy) in [(0.0, 0.0), (40.0, -16.0), (-24.0, 32.0), (3.0, -2.0)] {
            let found = whole_shift(&before, &levels(&image(dx, dy)));
            assert!((found - Vector2::new(dx, dy)).amax() <= 0.75 * step, "{dx} {dy}: {found}");
        }
        let bare = [GreyImage::filled(80, 60, 7)];
        assert_eq!(whole_shift(&bare, &bare), Vector2::zeros());
    }

    #[test]
    fn a_point_that_is_gone_is_not_found() {
        let before = levels(&image(0.0, 0.0));
        let covered = levels(&GreyImage::filled(320, 240, 90));
        assert_eq!(track(&before, &covered, Point2::new(148.0, 100.0), Vector2::zeros()), None);
        assert_eq!(
            track(&before, &before, Point2::new(1.0, 96.0), Vector2::zeros()),
            None,
            "at the border"
        );
    }
}
