//! Position of a person with a coloured hat, measured by fixed cameras: the external measurement
//! system of P5, section 3.
//!
//! Each camera sees the hat in a direction ([`find_hat`], [`Station::bearing`]). Two directions or
//! more meet in a place ([`Cameras::fix`]). Where the cameras hang and look is
//! found from places that are known ([`calibrate`]).
//!
//! The paper takes the bearing to be linear in the image column, averages the places of all pairs
//! of cameras, and calibrates by the distances of these from the known places. Here the bearing is
//! that of a lens, all directions are met at once by weighted least squares, and the cameras are
//! calibrated by their bearings, each for itself, with a loss that forgives mistakes.

mod calibration;
mod hat;
mod place;
mod station;

pub use calibration::{Calibrated, Known, calibrate};
pub use hat::{HatColour, find_hat};
pub use place::{Cameras, Fix, Sight};
pub use station::Station;
