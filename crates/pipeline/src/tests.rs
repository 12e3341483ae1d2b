mod clock;
pub(crate) mod doubles;
mod faults;
mod tracking;
