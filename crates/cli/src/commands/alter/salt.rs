//! Pixels that are wrong, as of a bad sensor or cable.

use std::sync::Arc;

use tagalong_core::{DepthImage, GreyImage, Images, RgbImage};
use tagalong_math::{RandomSource, SplitMix64};

/// Depths of wrong readings, m.
const WRONG_M: (f64, f64) = (0.4, 8.0);

/// Wrong pixels of one frame.
pub(super) struct Salt {
    share: f64,
    random: SplitMix64,
}

impl Salt {
    /// The wrong pixels of a frame: the same for the same seed.
    pub(super) fn of_frame(share: f64, seed: u64, index: u64) -> Self {
        Self { share, random: SplitMix64::new(seed.rotate_left(32) ^ index) }
    }

    /// Returns images with wrong pixels: black or white in colour, no reading or any depth.
    pub(super) fn on(mut self, images: &Images) -> Images {
        let colour = images.colour.as_deref().map(|image| Arc::new(self.colour(image)));
        let grey = images.grey.as_deref().map(|image| Arc::new(self.grey(image)));
        let depth = images.depth.as_deref().map(|image| Arc::new(self.depth(image)));
        Images { colour, grey, depth, right: None }
    }

    /// Returns true for a pixel that is wrong.
    fn is_wrong(&mut self) -> bool {
        self.random.uniform() < self.share
    }

    fn extreme(&mut self) -> u8 {
        if self.random.uniform() < 0.5 { 0 } else { 255 }
    }

    fn colour(&mut self, image: &RgbImage) -> RgbImage {
        image.map(|pixel| if self.is_wrong() { [self.extreme(); 3] } else { pixel })
    }

    fn grey(&mut self, image: &GreyImage) -> GreyImage {
        image.map(|pixel| if self.is_wrong() { self.extreme() } else { pixel })
    }

    fn depth(&mut self, image: &DepthImage) -> DepthImage {
        image.map(|metres| {
            if !self.is_wrong() {
                metres
            } else if self.random.uniform() < 0.5 {
                f32::NAN
            } else {
                self.random.between(WRONG_M.0, WRONG_M.1) as f32
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_pixels_are_wrong_and_the_same_ones_each_time() {
        let depth = Some(Arc::new(DepthImage::filled(200, 100, 9.0)));
        let grey = Some(Arc::new(GreyImage::filled(200, 100, 100)));
        let images = Images { depth, grey, ..Images::default() };
        let salted = Salt::of_frame(0.02, 1, 7).on(&images);
        let wrong = salted.depth.as_ref().unwrap().pixels().iter().filter(|m| **m != 9.0).count();
        assert!((300..500).contains(&wrong), "{wrong} of 20,000");
        let wrong = salted.grey.as_ref().unwrap().pixels().iter().filter(|v| [0, 255].contains(*v));
        assert!((300..500).contains(&wrong.count()));
        assert_eq!(Salt::of_frame(0.02, 1, 7).on(&images).grey, salted.grey);
        assert_ne!(Salt::of_frame(0.02, 1, 8).on(&images).grey, salted.grey);
    }
}
