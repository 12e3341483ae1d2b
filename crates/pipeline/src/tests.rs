mod clock;
mod commands;
pub(crate) mod doubles;
mod faults;
mod stereo;
mod target;
mod tracking;
