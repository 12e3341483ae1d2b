//! A point of an image, found again in the next one.

use nalgebra::{Matrix2, Point2, Vector2};
use tagalong_core::GreyImage;

use crate::patch::Patch;

/// Most steps at each size of the images.
const STEPS: usize = 15;
/// A step smaller than this ends the search, px.
const STILL_PX: f64 = 0.01;
/// Largest difference of the brightness of a patch that was found: the noise of a camera, grey
/// levels, ...
const NOISE_GREY: f64 = 5.0;
/// ... and a part of the contrast of the patch, for what the transform bends.
const BENT: f64 = 0.5;

/// Returns the position of a point of one image in another, pixels, from coarse to fine (B. Lucas and
/// T. Kanade, *An iterative image registration technique*, IJCAI 1981; J.-Y. Bouguet, *Pyramidal
/// implementation of the Lucas Kanade feature tracker*, 2000). `None` where it left the image, or
/// nothing there looks like it.
pub(super) fn track(from: &[GreyImage], to: &[GreyImage], at: Point2<f64>) -> Option<Point2<f64>> {
    let mut shift = Vector2::zeros();
    for level in (1..from.len().min(to.len())).rev() {
        let size = f64::from(1_u32 << level);
        // A coarse image that shows too little of the point leaves the search to the next one.
        if let Some((finer, _)) = refined(&from[level], &to[level], at / size, shift / size) {
            shift = finer * size;
        }
    }
    let (shift, difference) = refined(from.first()?, to.first()?, at, shift)?;
    (difference <= 1.0).then(|| at + shift)
}

/// Returns the shift of a patch and the square of the difference that is left, over that of the
/// largest difference that passes, from a guess of the shift; `None` where an image ends or shows no corner.
fn refined(
    from: &GreyImage,
    to: &GreyImage,
    at: Point2<f64>,
    guess: Vector2<f64>,
) -> Option<(Vector2<f64>, f64)> {
    // Every pixel of the patch is moved alike, so that the pixel next to the point stands for it.
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
    use crate::image::levels;

    fn waves(x: f64, y: f64) -> f64 {
        let sum = (0.23 * x + 0.11 * y).sin() + (0.17 * y - 0.13 * x).sin() + (0.05 * x).cos();
        128.0 + 40.0 * sum
    }

    fn image(dx: f64, dy: f64) -> GreyImage {
        GreyImage::from_fn(320, 240, |x, y| waves(x as f64 - dx, y as f64 - dy).round() as u8)
    }

    #[test]
    fn a_point_is_found_between_pixels_and_far_away() {
        let before = levels(&image(0.0, 0.0));
        for (dx, dy) in [(0.0, 0.0), (0.4, -0.3), (6.25, 3.5), (-9.0, 2.2)] {
            let after = levels(&image(dx, dy));
            let at = Point2::new(140.0, 96.0);
            let found = track(&before, &after, at).unwrap();
            let off = found - at - Vector2::new(dx, dy);
            assert!(off.norm() < 0.1, "{dx} {dy}: {off}");
        }
    }

    #[test]
    fn a_point_that_is_gone_is_not_found() {
        let before = levels(&image(0.0, 0.0));
        let covered = levels(&image(0.0, 0.0).map(|grey| grey / 8));
        assert_eq!(track(&before, &covered, Point2::new(140.0, 96.0)), None);
        assert_eq!(track(&before, &before, Point2::new(1.0, 96.0)), None, "at the border");
    }
}
