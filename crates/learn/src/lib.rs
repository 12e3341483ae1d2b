//! Shared parts of the plugins' trainers, so that their model cards can be compared: groups are
//! dealt out to folds and never split ([`parts`]), held-out values become figures ([`area`],
//! [`accepted`]) and log-odds ([`platt`], [`isotonic`], [`logistic`]), and each picture yields variants
//! ([`mirrored`], [`shifted`]). Boosted trees are grown here, too ([`boost`]), and experiments run
//! on all cores ([`side_by_side`]). Small convolutional networks are made of the layers of [`conv`],
//! forwards and backwards, trained by the steps of [`Adam`] and written as a [`NetworkFile`], or as
//! an ONNX file for other programs ([`onnx`]).
//! Verifiers calibrate the log-odds of their models by a [`ScoreCalibration`].
//!
//! The features are defined by the plugins.

mod adam;
pub mod boost;
mod calibrate;
pub mod conv;
#[cfg(feature = "train")]
pub mod dense;
mod folds;
mod held_out;
mod logistic;
pub mod onnx;
mod parallel;
mod score;
mod variants;
mod weights;

pub use adam::{Adam, pace};
pub use calibrate::{Line, isotonic, platt};
pub use folds::{CALIBRATION, Use, parts, use_of};
pub use held_out::{accepted, area};
pub use logistic::{Example, logistic};
pub use parallel::side_by_side;
pub use score::ScoreCalibration;
pub use tagalong_math::{fingerprint, mix};
pub use variants::{mirrored, shifted};
pub use weights::NetworkFile;
