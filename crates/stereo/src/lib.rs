//! From a rectified stereo pair to disparity, and from there to depth.
//!
//! [`StereoDepth`] gives a frame with a right image its depth; [`Matcher`] finds
//! the disparities.
//!
//! # One pass, a row at a time
//!
//! Both methods compare census strings, which do not mind that two cameras
//! differ in exposure; the semi-global one adds how brightness and its slope
//! differ. Both sum up the costs of all disparities of one row before
//! they go on to the next. A volume of costs, 12 million of them for a small
//! image, would not fit in a cache; a row does. That is why semi-global matching
//! has no paths from below. All costs are bytes, many of which fit in a vector
//! register, and the loops over the disparities of a pixel are of fixed length,
//! so that the compiler turns them into vector instructions; which ones is
//! decided when the program runs.
//!
//! # Threads
//!
//! An image is cut into strips of rows that are worked on independently. Where
//! the cuts are does not depend on the number of threads, and so neither do the
//! disparities.

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

/// Pixels without a disparity, by the reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Its match would lie outside of the right image.
    pub outside: u64,
    /// Another match is nearly as good: no texture, or a repeated one.
    pub not_unique: u64,
    /// The right image disagrees: mostly what only one camera sees.
    pub left_right: u64,
    /// It is smooth, and nothing beside it has its disparity.
    pub unsupported: u64,
    /// It belongs to a patch that is too small.
    pub speckle: u64,
    /// It was dropped, and then filled from both sides.
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
