mod clock;
mod commands;
pub(crate) mod doubles;
mod faults;
mod memo;
mod odometry;
mod stereo;
mod target;
mod tracking;
