//! Disparity and depth of a rectified stereo pair.
//!
//! [`StereoDepth`] computes the depth of a frame with a right image; [`Matcher`] computes the
//! disparities.
//!
//! ```
//! use std::sync::Arc;
//!
//! use tagalong_core::{EgoMotion, Frame, Funnel, GreyImage, Images, RightImage, Stamp};
//! use tagalong_geometry::{Camera, Pinhole};
//! use tagalong_stereo::{StereoDepth, StereoSettings};
//!
//! /// Brightness of a wall with a random pattern.
//! fn wall(column: usize, row: usize) -> u8 {
//!     let mut mixed = ((column as u64) << 32 | row as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
//!     mixed = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
//!     (mixed >> 40) as u8
//! }
//!
//! // The right camera, 0.1 m beside the left one, sees the wall 10 pixels farther to the left.
//! let left = GreyImage::from_fn(160, 120, wall);
//! let right = GreyImage::from_fn(160, 120, |column, row| wall(column + 10, row));
//! let camera = Camera::mounted(Pinhole::centred(200.0, 160, 120), 160, 120, 1.0, 0.0, 0.0);
//! let images = Images {
//!     grey: Some(Arc::new(left)),
//!     right: Some(Arc::new(RightImage { image: right, baseline_m: 0.1 })),
//!     ..Images::default()
//! };
//! let motion = EgoMotion::at_rest(0.0);
//! let frame = Frame::new(1, Stamp::default(), Arc::new(camera), motion, images);
//! let mut stereo = StereoDepth::new(StereoSettings::default())?;
//! let depth = stereo.depth(&frame, &mut Funnel::default())?;
//! let middle_m = depth.get(100, 60).expect("within the image");
//! assert!((middle_m - 200.0 * 0.1 / 10.0).abs() < 0.05, "{middle_m}");
//! # Ok::<(), tagalong_core::Error>(())
//! ```
//!
//! # One pass, a row at a time
//!
//! Both methods compare census strings, which tolerate cameras that differ in exposure; the
//! semi-global one adds the differences in brightness and in its slope. Both sum up the costs of
//! all disparities of one row before they go on to the next. A cost volume, 12 million values for a
//! small image, would not fit in a cache; a row does. That is why semi-global matching has no paths
//! from below. All costs are bytes, many of which fit in a vector register, and the loops over the
//! disparities of a pixel are of fixed length, so that the compiler turns them into vector
//! instructions; the instruction set is chosen at run time.
//!
//! # Threads
//!
//! An image is cut into strips of rows that are processed independently. The cuts do not depend on
//! the number of threads, and so neither do the disparities.

mod census;
mod cost;
mod depth;
mod fill;
mod level;
mod matcher;
mod paths;
mod rectification;
mod reduce;
mod refine;
mod rows;
mod settings;
mod share;
mod speckle;
mod strip;
mod texture;
mod window;
mod winner;

#[cfg(test)]
mod tests;

pub use depth::StereoDepth;
pub use matcher::{Disparities, Matcher};
pub use rectification::Rectification;
pub use settings::{MAX_DISPARITIES, Method, StereoSettings};

/// Number of pixels without a disparity, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// The match would lie outside of the right image.
    pub outside: u64,
    /// Another match is nearly as good: no texture, or a repeated one.
    pub not_unique: u64,
    /// The match from right to left differs: mostly areas that only one camera sees.
    pub left_right: u64,
    /// The pixel is smooth, and its disparity is not that of its textured neighbours.
    pub unsupported: u64,
    /// The disparity belongs to a patch that is too small.
    pub speckle: u64,
    /// The pixel had no disparity and was then filled from both sides.
    pub filled: u64,
}

impl Dropped {
    fn add(&mut self, other: &Self) {
        self.outside += other.outside;
        self.not_unique += other.not_unique;
        self.left_right += other.left_right;
        self.unsupported += other.unsupported;
        self.speckle += other.speckle;
        self.filled += other.filled;
    }
}
