//! Input and output of logs: MCAP files with ROS 2 messages, and as input also ROS 1 bags.
//!
//! A log is read twice. The first pass decodes no images: it finds the topics, the calibrations and
//! the static transforms of the whole log, counts damage and hashes the file, so that every missing
//! input is known before the first frame. The second pass is the [`FrameSource`]: it puts images in
//! order, pairs them, looks up the poses of camera and robot, and returns one [`LogFrame`] after
//! the other. Only a few frames are in memory, however long the log is.
//!
//! Live messages from a network are processed in the same way: [`Listening`] is the first pass,
//! [`LiveSource`] the second.
//!
//! The contents of a file are not trusted: see [`LogWalker`] for the containers, [`msgs`] for
//! messages, [`images`] for images and [`Limits`] for sizes. Intact data is used; lost data is
//! counted by cause.

mod attachment;
mod bag;
mod camera_frames;
pub mod camera_info;
mod camera_settings;
mod clock;
mod database;
mod error;
mod hashing;
pub mod images;
mod input;
mod inspect;
mod leg_scans;
mod limits;
mod log_files;
mod mcap;
pub mod msgs;
mod obstacles;
pub mod odometry;
mod packed;
mod pairing;
pub mod register;
mod scan;
mod sensors;
mod source;
mod tally;
pub mod tf;
mod timing;
mod topics;
mod truth;
mod walk;
mod walker;
pub mod write;

pub use attachment::{COPY_OF, read_attachment};
pub use camera_settings::{CameraSettings, MountSettings};
pub use error::{LogError, NotMcap};
pub use input::{DisparitySettings, InputSettings, StampSource};
pub use inspect::{Examination, ImageFacts, Inspection, TopicFacts, examine, inspect};
pub use leg_scans::{LegScan, read_leg_scans};
pub use limits::Limits;
pub use log_files::{LogFiles, TRUTH_TOPIC};
pub use obstacles::{ObstacleKind, ObstacleTopic};
pub use packed::LogFile;
pub use source::{FrameSource, Listening, LiveSource, LogFacts, LogFrame};
pub use tagalong_core::{Input, Inputs, Usage};
pub use tally::is_loss;
pub use timing::{Skew, Timing};
pub use topics::{InputAccount, TopicUse};
pub use truth::{TRUTH_SCHEMA, TruthFrame, TruthJoint, TruthPerson, read_truth, read_truth_lines};
pub use walk::{Channel, Counters, LOSSES, Message};
pub use walker::LogWalker;
