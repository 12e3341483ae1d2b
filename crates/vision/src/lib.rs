//! Image arithmetic that several plugins share, and the conversion of boxes of people to positions.
//!
//! Each fast kernel has a slow, obvious reference implementation in its tests.

mod appearance;
mod boxes;
mod describer;
mod gallery;
pub mod ground;
mod integral;
mod islands;
mod measured_body;
pub mod odometry;
mod panorama;
pub mod quality;
pub mod registration;
mod row_sums;
mod sketch;
mod speckle;
mod upright;
mod wrong_pixels;

pub use appearance::{Appearance, AppearanceDifference};
pub use boxes::{BoxSettings, BoxedBody, is_shown, log_odds_of};
pub use describer::{Describer, Embedder};
pub use gallery::Gallery;
pub use integral::Integral;
pub use islands::islands;
pub use panorama::{Blend, Unwrapper, Unwrapping};
pub use row_sums::{RowSums, Sums};
pub use sketch::{ComparedPixels, Silhouette, Sketch, SketchMap, SketchPoint};
pub use upright::{Upright, UprightGrey};
pub use wrong_pixels::Cleaned;
