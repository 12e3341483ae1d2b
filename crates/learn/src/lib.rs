//! What trainers of plugins share, so that their cards can be compared: groups
//! are dealt out to folds and never split ([`parts`]), held-out values become
//! figures ([`area`], [`accepted`]), and log-odds ([`platt`]). Boosted trees are
//! grown here, too ([`boost`]).
//!
//! What machines look at is the business of the plugins.

pub mod boost;
mod calibrate;
mod folds;
mod held_out;

pub use calibrate::{Line, platt};
pub use folds::{Use, mix, parts, use_of};
pub use held_out::{accepted, area};
