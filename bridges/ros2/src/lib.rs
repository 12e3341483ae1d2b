//! Bridge between Tagalong and a robot with ROS 2, without ROS on the machine that builds or runs
//! it: images, calibrations, transforms and odometry come in over DDS; tracks, the pose of the
//! target and commands for the wheels go out.
//!
//! Frames are made from messages by [`tagalong::log::Listening`] and [`tagalong::log::LiveSource`],
//! the same code that reads logs: images are paired by the stamps in their headers, topics are
//! found by type, and a config that works on a recorded log also works live.
//!
//! # Threads that must not wait for each other
//!
//! * One thread per topic takes messages from DDS into the [`inbox`], which drops the oldest ones
//!   and counts them.
//! * The thread that calls [`run`] makes frames and runs the pipeline on them, always on the
//!   newest.
//! * One thread drives the [`wheels`]: it sends a command at least twenty times a second, from a
//!   copy of the last orders of the pipeline, and zero once those have expired. A pipeline that is
//!   stuck in a frame therefore stops the robot as well. The topics that enable and stop reach this
//!   thread directly.
//!
//! * With `--follow-object`, one thread gives Nav2's following server its goal, and cancels it.
//! * The threads of the services of a managed node stop the robot before the node leaves the active
//!   state.
//! * One thread publishes diagnostics every second, even while a frame takes long.
//! * With `--serve`, some threads serve the newest frame to browsers; no frame waits for them.
//!
//! If [`run`] ends with an error, a signal or a panic, the owner of the wheel thread is dropped, so
//! that the last command that is sent is zero.
//!
//! This is no safety function. See the README.

mod bridge;
mod diagnostics;
mod forecast;
mod http;
pub mod inbox;
mod lifecycle;
mod listen;
mod messages;
mod nav2;
mod network;
mod options;
mod publishers;
mod raw;
mod run;
mod services;
mod skill;
mod stamps;
mod summary;
mod threads;
pub mod wheels;

pub use forecast::ForecastFrame;
pub use options::{CommandType, Options};
pub use run::{run, run_with};
pub use services::Middleware;
pub use stamps::ClockSource;
pub use summary::Summary;

/// Failure to start or to continue the bridge.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BridgeError {
    /// An error in the config or on the command line.
    #[error("{0}")]
    Config(String),
    /// DDS reported an error.
    #[error("ROS 2: {0}")]
    Network(String),
    /// The live page cannot be served.
    #[error("cannot serve on {0}: {1}; name another port with --serve=PORT")]
    Serve(std::net::SocketAddr, std::io::Error),
    /// No further thread can be started.
    #[error(
        "no thread for {0} can be started: {1}; raise the limit of threads (the pids limit of a container, \
         `TasksMax` of a systemd unit, `ulimit -u`)"
    )]
    Thread(&'static str, std::io::Error),
    /// An input of the pipeline did not arrive, or cannot be used.
    #[error(transparent)]
    Input(Box<tagalong::log::LogError>),
    /// The controller lacks a source that its config requires.
    #[error(transparent)]
    Sources(#[from] tagalong::pipeline::MissingSource),
    /// The camera's calibration changed while the robot was steered with the previous one.
    #[error(
        "the calibration of the camera changed (topic {0}): the robot was told to stop; restart the \
         bridge to take the new one"
    )]
    Calibration(String),
    /// A plugin failed; the robot was told to stop.
    #[error(transparent)]
    Pipeline(#[from] tagalong::pipeline::StepError),
}

impl From<tagalong::log::LogError> for BridgeError {
    fn from(error: tagalong::log::LogError) -> Self {
        Self::Input(Box::new(error))
    }
}

impl From<tagalong::pipeline::BuildError> for BridgeError {
    fn from(error: tagalong::pipeline::BuildError) -> Self {
        Self::Config(error.to_string())
    }
}

impl From<tagalong::Error> for BridgeError {
    /// Converts the error of the settings of a config.
    fn from(error: tagalong::Error) -> Self {
        Self::Config(error.to_string())
    }
}

impl BridgeError {
    /// Returns the exit code of a program that ends with this error: 2 for wrong usage, otherwise
    /// 1.
    pub fn exit_code(&self) -> u8 {
        if matches!(self, Self::Config(_) | Self::Serve(..)) { 2 } else { 1 }
    }
}
