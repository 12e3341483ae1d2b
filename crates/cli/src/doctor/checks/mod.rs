//! One small function for each thing that can be wrong. `None`: there is nothing
//! to look at, in a log without depth for example.

mod camera;
mod images;
mod people;
mod times;

use super::evidence::Evidence;
use super::finding::Finding;

/// A check.
pub type Check = fn(&Evidence) -> Option<Finding>;

/// All of them, causes before their consequences.
pub const ALL: &[Check] = &[
    people::needs,
    people::damage,
    camera::intrinsics,
    camera::frames,
    times::rate,
    times::stamps,
    times::skew,
    images::exposure,
    images::depth,
    images::registration,
    camera::floor,
    camera::mount,
    times::odometry,
    people::people,
];
