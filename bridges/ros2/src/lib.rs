//! Tagalong on a robot that speaks ROS 2, without ROS on the machine that builds
//! or runs it: images, calibrations, transforms and odometry come in over DDS;
//! tracks, the pose of the person to follow and commands for the wheels go out.
//!
//! What makes frames of messages is [`tagalong_log::Listening`] and
//! [`tagalong_log::LiveSource`], the same code that reads logs: images are paired
//! by the stamps in their headers, topics are found by type, and a config that ran
//! on a recorded log runs live.
//!
//! # Three threads that must not wait for each other
//!
//! * One per topic takes messages from DDS into the [`inbox`], which drops the
//!   oldest and counts them.
//! * The one that calls [`run`] makes frames and takes them through the pipeline,
//!   always the newest.
//! * One drives the [`wheels`]: it tells them something at least twenty times a
//!   second, from a copy of what the pipeline last ordered, and zero once that has
//!   expired. So a pipeline that is stuck in a frame stops the robot too.
//!
//! Whatever ends [`run`], an error, a signal or a panic, drops the last thread's
//! owner, and with it the last command on the wire is zero.
//!
//! This is no safety function. See the README.

mod bridge;
pub mod inbox;
mod messages;
mod network;
mod options;
mod stamps;
pub mod wheels;

pub use bridge::{Summary, run};
pub use options::Options;
pub use stamps::ClockSource;

/// Why the bridge could not start, or had to end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BridgeError {
    /// A mistake in the config or on the command line.
    #[error("{0}")]
    Config(String),
    /// DDS refuses.
    #[error("ROS 2: {0}")]
    Network(String),
    /// What the pipeline needs did not arrive, or cannot be used.
    #[error(transparent)]
    Input(#[from] tagalong_log::LogError),
    /// A plugin failed; the robot was told to stop.
    #[error(transparent)]
    Pipeline(#[from] tagalong_pipeline::StepError),
}

impl BridgeError {
    /// The exit code of a program that ends so: 2 for wrong usage, else 1.
    pub fn exit_code(&self) -> u8 {
        if matches!(self, Self::Config(_)) { 2 } else { 1 }
    }
}
