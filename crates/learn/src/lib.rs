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
//!
//! # Libraries of others
//!
//! Jobs for which a library was considered, with the reason of the choice. `faer` and `linfa` are built
//! with the feature `train` alone, so that programs that only run models do without them.
//!
//! | computed | by | reason |
//! |---|---|---|
//! | normal equations of least squares, of ridge regression and of Levenberg and Marquardt's steps (`dense`), which `omni-appearance` fits with | `faer` | samples by dozens of columns, solved again for each penalty; the example `time_dense` prints its times beside `nalgebra`'s |
//! | support vectors of `svm-patch` | `linfa-svm`, with its own Gram matrix | its `Fit` takes rows, no finished kernel, so that `faer` cannot compute the kernel for it |
//! | line of Platt ([`platt`]) | [`logistic`] | both classes have equal weight, and `linfa`'s takes no weights; the two are compared in a test |
//! | area under the ROC curve ([`area`]) | here | ties count as half and the values are `f64`; compared with `linfa`'s in a test |
//! | logistic regression ([`logistic`]) | `nalgebra` | two to a few features, known to the compiler; targets are probabilities with weights |
//! | folds ([`parts`]) | here | the examples of a group stay together, those with and without people are dealt out in turn |
//! | boosted trees ([`boost`]) | here | `linfa` has no gradient boosting; models are files that pipelines read without it |
//! | layers of networks ([`conv`]) | loops over registers | pipelines run the same code, without `train` and with the same bytes on each processor; channels are known to the compiler. Steps backwards, which trainers alone take, could be products by `faer`: not measured |
//! | Gaussian process of `joint-particle` | `nalgebra` | it runs in the pipeline, of some 50 points: `faer` rounds by the vector instructions of the processor, and a pipeline has the same bytes on each |

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
