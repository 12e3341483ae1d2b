mod clock;
pub(crate) mod doubles;
mod faults;
mod stereo;
mod tracking;
