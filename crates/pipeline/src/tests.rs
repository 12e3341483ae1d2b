mod clock;
mod commands;
mod faults;
mod stereo;
mod target;
mod tracking;
pub(crate) mod doubles;
