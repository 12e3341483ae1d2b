#![doc = include_str!("../README.md")]

mod error;
mod frame_maker;
#[cfg(feature = "logs")]
pub mod logs;
pub mod prelude;

pub use error::{Error, Result};
pub use frame_maker::{FrameMaker, Moment};
#[cfg(feature = "logs")]
pub use logs::{Frames, Log, LogSettings};
/// Vectors, matrices and poses of the public types.
pub use nalgebra;
pub use tagalong_config as config;
pub use tagalong_core as core;
pub use tagalong_geometry as geometry;
#[cfg(feature = "logs")]
pub use tagalong_log as log;
pub use tagalong_pipeline as pipeline;
pub use tagalong_tracking as tracking;
pub use tagalong_vision as vision;

#[cfg(feature = "plugins")]
pub use pipeline::builtin_registry;
pub use pipeline::{ConfigSource, FrameReport, Pipeline, PipelineBuilder, ResolvedConfig};
