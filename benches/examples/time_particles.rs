//! Prints, in microseconds, the time of a frame of one person with 625 particles and a likelihood
//! that takes none, and that of looking up 625 places in a map of two people that is a sum of 50
//! kernels, with the sum of the values. Places are numbers that look random.
//! `benches/peers/kernels.py` compares both with numpy and scipy.
//!
//! ```sh
//! cargo run --release -p tagalong-benches --example time_particles
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use std::hint::black_box;
use std::sync::Arc;

use nalgebra::{Matrix3, Point3};
use tagalong_benches::timing::median_us;
use tagalong_core::{
    Detection, EgoMotion, Evidence, Filter, Frame, Images, Likelihood, Person, Result, Stamp,
    TrackId,
};
use tagalong_geometry::{Camera, Pinhole};
use tagalong_joint_particle::{Config, JointParticle, LikelihoodMap, Method, PositionPair};
use tagalong_math::number_at;

fn main() -> Result<()> {
    println!("step {:.3}", step()?);
    let (us, sum) = look_up();
    println!("map {us:.3} {sum:.9}");
    Ok(())
}

/// The likelihood of a person one metre wide about 3 m ahead.
struct Wide;

impl Likelihood for Wide {
    fn log_likelihood(&self, _: &Frame, scene: &[Person]) -> Result<f64> {
        let middle = Point3::new(3.0, 0.0, 1.6);
        Ok(scene.iter().map(|person| -0.5 * (person.position - middle).norm_squared()).sum())
    }
}

/// Returns the median time of a frame, us: prediction, weighing, resampling where it is due, and the
/// estimate.
fn step() -> Result<f64> {
    let camera =
        Arc::new(Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0));
    let motion = EgoMotion::at_rest(0.1);
    let frame = Frame::new(1, Stamp::default(), Arc::clone(&camera), motion, Images::default());
    let config = Config { particles: 625, ..Config::default() };
    let mut filter = JointParticle::new(config, 1)?;
    let first =
        Detection::new("example", Point3::new(3.0, 0.0, 1.6), Matrix3::identity() * 0.01, 1.0);
    filter.start(TrackId(1), &first, &camera);
    let likelihood: Option<&dyn Likelihood> = Some(&Wide);
    let evidence = Evidence::new(&frame, &[]).with_likelihood(likelihood);
    filter.update(&evidence)?;
    Ok(median_us(|| {
        filter.predict(&motion, &camera);
        black_box(filter.update(&evidence).is_ok());
        filter.estimates(&camera)
    }))
}

/// Returns the median time of a call, us, and the sum of the values.
fn look_up() -> (f64, f64) {
    let known = (0..50).map(|k| 0.5 + uniform(2000 + k)).collect();
    let map = LikelihoodMap::new(Method::Kde, places(0, 50), known, &Config::default());
    let at = places(50, 625);
    (median_us(|| map.at_all(&at)), map.at_all(&at).iter().sum())
}

/// Returns places of two people within the reach of the filter's table.
fn places(first: u64, count: u64) -> Vec<PositionPair> {
    (first..first + count).map(|k| [0.6 * uniform(2 * k), 1.8 * uniform(2 * k + 1)]).collect()
}

/// Returns a number between -1/2 and 1/2.
fn uniform(at: u64) -> f64 {
    (number_at(1, at) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}
