//! Logs in and out: MCAP files with ROS 2 messages.

mod limits;
pub mod mcap_walk;
pub mod msgs;
pub mod write;

pub use limits::Limits;
