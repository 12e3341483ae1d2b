//! Prints the time of a prediction and an update of one person, in microseconds: the median of
//! many. `benches/peers/kernels.py` compares it with OpenCV's and filterpy's filters.
//!
//! ```sh
//! cargo run --release -p tagalong-benches --example time_filter
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use std::sync::Arc;

use nalgebra::{Matrix3, Point3};
use tagalong_benches::timing::median_us;
use tagalong_core::{
    Detection, EgoMotion, Evidence, Filter, Frame, Images, Matched, PerPerson, Result, Stamp,
    TrackId,
};
use tagalong_filters::ekf::{Config, Ekf};
use tagalong_geometry::{Camera, Pinhole};

fn main() -> Result<()> {
    let camera =
        Arc::new(Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0));
    let motion = EgoMotion::at_rest(0.1);
    let frame = Frame::new(1, Stamp::default(), Arc::clone(&camera), motion, Images::default());
    let seen =
        Detection::new("example", Point3::new(3.0, 0.0, 1.6), Matrix3::identity() * 0.01, 1.0);
    let mut filter = PerPerson::new(Ekf::new(Config::default())?);
    filter.start(TrackId(1), &seen, &camera);
    let matched = [Matched::certain(TrackId(1), &seen)];
    let evidence = Evidence::new(&frame, &matched);
    filter.update(&evidence)?;
    let us = median_us(|| {
        filter.predict(&motion, &camera);
        filter.update(&evidence).is_ok()
    });
    println!("{us:.4}");
    Ok(())
}
