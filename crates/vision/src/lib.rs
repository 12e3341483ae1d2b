//! Image arithmetic that several plugins share.
//!
//! Each fast kernel has a slow, obvious reference in its tests.

pub mod ground;
mod integral;
mod islands;
mod panorama;
pub mod quality;
pub mod registration;
mod row_sums;
mod upright;

pub use integral::Integral;
pub use islands::islands;
pub use panorama::{Blend, Unwrapper, Unwrapping};
pub use row_sums::{RowSums, Sums};
pub use upright::{Upright, UprightGrey};
