//! One small function for each possible problem. `None`: the log lacks the data to check, for
//! example depth.

mod camera;
mod images;
mod people;
mod times;

use super::evidence::Evidence;
use super::finding::Finding;

/// Function that checks one aspect.
pub type Check = fn(&Evidence) -> Option<Finding>;

/// All checks, causes before their consequences.
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
