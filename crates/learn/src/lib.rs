//! Shared parts of the trainers of plugins, so that their model cards can be compared: groups are
//! distributed over folds and never split ([`parts`]), held-out values give figures ([`area`],
//! [`accepted`]) and calibrated log-odds ([`platt`], [`isotonic`], [`logistic`]), and each picture
//! is augmented with variants ([`mirrored`], [`shifted`]). The crate also trains boosted trees
//! ([`boost`]), and runs experiments on all cores ([`side_by_side`]). Small convolutional networks
//! consist of the layers of [`conv`], with forward and backward passes, are trained with [`Adam`]
//! and written as a [`NetworkFile`], or as an ONNX file for other programs ([`onnx`]). Verifiers
//! calibrate the log-odds of their models with a [`ScoreCalibration`].
//!
//! The plugins define the features.
//!
//! # Outside libraries
//!
//! The table lists computations for which a library was considered, with the reason for the choice.
//! `faer` and `linfa` are only built with the feature `train`, so that programs that only run
//! models do not need them.
//!
//! | computed | by | reason |
//! |---|---|---|
//! | normal equations of least squares, ridge regression and Levenberg-Marquardt steps (`dense`), for `omni-appearance` | `faer` | matrices with dozens of columns, solved again for each penalty; the example `time_dense` compares its times with those of `nalgebra` |
//! | support vectors of `svm-patch` | `linfa-svm`, with its own Gram matrix | its `Fit` takes rows and not a computed kernel, so that `faer` cannot compute the kernel |
//! | Platt scaling ([`platt`]) | [`logistic`] | both classes have equal weight, and the version of `linfa` takes no weights; a test compares the two |
//! | area under the ROC curve ([`area`]) | here | ties count as half and the values are `f64`; a test compares it with that of `linfa` |
//! | logistic regression ([`logistic`]) | `nalgebra` | only a few features, whose number is a constant; targets are probabilities with weights |
//! | folds ([`parts`]) | here | the examples of a group stay together, and groups with and without people are distributed in turn |
//! | boosted trees ([`boost`]) | here | `linfa` has no gradient boosting; models are files that pipelines read without it |
//! | layers of networks ([`conv`]) | loops over registers | pipelines run the same code, without `train` and with the same bytes on each processor; numbers of channels are constants. The backward pass, which only trainers need, could be computed as products by `faer`; this was not measured |
//! | Gaussian process of `joint-particle` | `nalgebra` | it runs in the pipeline, with about 50 points: the rounding of `faer` depends on the vector instructions of the processor, whereas a pipeline gives the same bytes on each processor |

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
