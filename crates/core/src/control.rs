use crate::{Frame, Track, Wheels};

/// Speeds over ground of the two driven wheels, m/s.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct WheelSpeeds {
    /// Left wheel.
    pub left: f64,
    /// Right wheel.
    pub right: f64,
}

impl WheelSpeeds {
    /// Standing still.
    pub const STOP: Self = Self { left: 0.0, right: 0.0 };
}

/// What a controller sees of one frame.
pub struct Scene<'a> {
    /// The frame; its depth image shows the obstacles.
    pub frame: &'a Frame,
    /// The person to follow, if the pipeline is sure of one.
    pub target: Option<&'a Track>,
    /// Everybody confirmed, the target included.
    pub tracks: &'a [Track],
    /// The drive.
    pub wheels: Wheels,
    /// The speed limit of a wheel, m/s.
    pub max_speed_mps: f64,
}

/// Steers after the target. It cannot fail: when unsure, it stops.
pub trait Controller: Send {
    /// The wheel speeds to command now.
    fn command(&mut self, scene: &Scene<'_>) -> WheelSpeeds;
}
