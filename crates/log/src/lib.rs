//! Input and output of logs: MCAP files with ROS 2 messages.
//!
//! A log is read twice. The first pass decodes no image: it finds the topics, the calibrations and
//! the static transforms of the whole log, counts damage and hashes the file, so that every missing
//! input is known before the first frame. The second pass is the [`FrameSource`]: it puts images in
//! order, pairs them, looks up the poses of camera and robot, and returns one [`LogFrame`] after
//! the other. Memory holds a few frames, however long the log is.
//!
//! Messages that arrive live, over a network, take the same way: [`Listening`] is the first pass,
//! [`LiveSource`] the second.
//!
//! The contents of a file are not trusted: see [`mcap_walk`] for the container, [`msgs`] for
//! messages, [`images`] for pictures and [`Limits`] for sizes. Intact data is used; lost data is
//! counted under a name.

pub mod camera_info;
mod error;
pub mod images;
mod input;
mod inspect;
mod limits;
mod log_files;
pub mod mcap_walk;
pub mod msgs;
pub mod odometry;
pub mod register;
mod scan;
mod source;
pub mod tf;
mod timing;
mod topics;
mod truth;
pub mod write;

pub use error::LogError;
pub use input::{InputSettings, MountSettings};
pub use inspect::{Examination, ImageFacts, Inspection, TopicFacts, examine, inspect};
pub use limits::Limits;
pub use log_files::LogFiles;
pub use source::{FrameSource, Listening, LiveSource, LogFacts, LogFrame};
pub use tagalong_core::{Input, Inputs, Usage};
pub use timing::{Skew, Timing};
pub use truth::{TRUTH_SCHEMA, TRUTH_TOPIC, TruthFrame, TruthPerson, read_truth, read_truth_lines};
