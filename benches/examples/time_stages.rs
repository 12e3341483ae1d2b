//! Prints, in microseconds, the fastest call of stages that other programs have, too: 625 scenes of two
//! people weighed in one frame, 50 with depth held, and a person found and learnt by compressive
//! tracking. `benches/peers/kernels.py` compares them with numpy and OpenCV.
//!
//! ```sh
//! cargo run --release -p tagalong-benches --example time_stages
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use std::error::Error;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use tagalong_benches::{overlapping, square};
use tagalong_compressive::{Compressive, Config};
use tagalong_core::{Detector, Funnel, Likelihood, Query};
use tagalong_depth_template::{DepthTemplateConfig, Weigher};

const CALLS: u64 = 100;

fn main() -> Result<(), Box<dyn Error>> {
    println!("templates {:.3}", weighing(625, false)?);
    println!("held {:.3}", weighing(50, true)?);
    println!("compressive {:.3}", tracking()?);
    Ok(())
}

/// Weighs this many scenes in a frame whose image is reduced already: the detector does that.
fn weighing(count: usize, held: bool) -> Result<f64, Box<dyn Error>> {
    let camera = overlapping::camera();
    let depth = Arc::new(overlapping::depth(&camera));
    let weigher = Weigher::new(&DepthTemplateConfig::default());
    let people = overlapping::scenes(count, held);
    let mut best = f64::INFINITY;
    let mut out = Vec::new();
    for index in 1..=CALLS {
        let frame = overlapping::frame(index, &depth, &camera);
        weigher.log_likelihood(&frame, &[])?;
        let start = Instant::now();
        weigher.log_likelihoods(&frame, black_box(&people), 2, &mut out)?;
        best = best.min(1e6 * start.elapsed().as_secs_f64());
    }
    Ok(best)
}

fn tracking() -> Result<f64, Box<dyn Error>> {
    let camera = square::camera();
    let track = square::track(&camera, 0.1);
    let frame = square::frame(&camera, track.estimate.region, 1, 2.92);
    let mut detector = Compressive::new(Config::default(), 1)?;
    detector.learn(&frame, std::slice::from_ref(&track))?;
    let mut best = f64::INFINITY;
    for _ in 0..CALLS {
        let start = Instant::now();
        black_box(detector.detect(&frame, &Query::Track(&track), &mut Funnel::default())?);
        detector.learn(&frame, std::slice::from_ref(&track))?;
        best = best.min(1e6 * start.elapsed().as_secs_f64());
    }
    Ok(best)
}
