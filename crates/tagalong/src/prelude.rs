//! Names that nearly every program needs: `use tagalong::prelude::*;`.
//!
//! [`Result`] is the one of this crate. Plugins return the `Result` of [`crate::core`], which is
//! called [`PluginResult`] here.

#[cfg(feature = "logs")]
pub use crate::logs::{Frames, Log};
#[cfg(feature = "plugins")]
pub use crate::pipeline::builtin_registry;
pub use crate::{Error, FrameMaker, Moment, Result};

pub use tagalong_config::{Context, NoSettings, Registry};
pub use tagalong_core::Result as PluginResult;
pub use tagalong_core::{
    Associator, Capabilities, Command, Controller, DepthImage, Detection, Detector, EgoMotion,
    Estimate, Filter, Frame, Funnel, GreyImage, Images, Input, Inputs, LaserScan, PerPerson,
    PersonFilter, Query, Reason, RgbImage, Scene, Sensor, Stamp, Track, TrackId, TrackManager,
    Twist, Verifier,
};
pub use tagalong_geometry::{Camera, Distortion, ImageBox, Pinhole, Rect};
pub use tagalong_pipeline::{Choice, Enrollment, FrameReport, Outcome, Pipeline};
