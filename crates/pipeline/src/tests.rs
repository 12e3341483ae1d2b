mod clock;
mod commands;
pub(crate) mod doubles;
mod faults;
mod odometry;
mod stereo;
mod target;
mod tracking;
