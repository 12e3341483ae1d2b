mod clock;
mod commands;
pub(crate) mod doubles;
mod faults;
mod inputs;
mod odometry;
mod stereo;
mod target;
mod tracking;
