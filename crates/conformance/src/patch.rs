//! Minimal input of a verifier: one candidate in one grey image that shows head and shoulders, or
//! bars.

use std::sync::Arc;

use nalgebra::{Matrix3, Point3};
use tagalong_core::{Detection, EgoMotion, Frame, GreyImage, Images, Stamp};
use tagalong_geometry::{Camera, Distortion, ImageBox, Pinhole, Rect};

/// Renders a dark head above dark shoulders in front of a bright wall, or bars: 64x64 pixels, with
/// noise from a seed.
pub fn picture(is_person: bool, seed: u32) -> GreyImage {
    let mut state = seed.wrapping_mul(2_654_435_761) | 1;
    GreyImage::from_fn(64, 64, |x, y| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let dx = x as f64 - 32.0;
        let dy = y as f64 - 22.0;
        let dark = if is_person {
            dx.hypot(dy) < 9.0 || (dy > 10.0 && dx.abs() < 20.0)
        } else {
            (x / 8 + seed as usize).is_multiple_of(2)
        };
        // The upper bits, because the lower bits of a linear congruential generator have short
        // periods.
        (if dark { 60 } else { 150 }) + (state >> 27) as u8
    })
}

/// Returns a frame with that picture, from a camera 1 m above the floor that looks forward.
pub fn frame(grey: GreyImage) -> Frame {
    let lens = Pinhole { fx: 60.0, fy: 60.0, cx: 32.0, cy: 32.0, distortion: Distortion::None };
    let camera = Arc::new(Camera::mounted(lens, grey.width(), grey.height(), 1.0, 0.0, 0.0));
    let images = Images { grey: Some(Arc::new(grey)), ..Images::default() };
    Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), images)
}

/// Returns the candidate in that picture: 2 m ahead, with score 1.
pub fn candidate() -> Detection {
    Detection::new("test", Point3::new(2.0, 0.0, 1.6), Matrix3::identity(), 1.0)
        .with_image(ImageBox::upper_body(Rect::new(8.0, 8.0, 48.0, 48.0)))
}
