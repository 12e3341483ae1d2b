//! Prints, in microseconds, the median time of stages that other programs have, too: 625 scenes of two
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

use cpu_time::ThreadTime;
use nalgebra::Point2;
use tagalong_benches::timing::statistic_us;
use tagalong_benches::{overlapping, square};
use tagalong_compressive::{Compressive, Config};
use tagalong_core::{Detector, Funnel, Likelihood, Query};
use tagalong_depth_template::{DepthTemplateConfig, Weigher};
use tagalong_geometry::Rect;

const CALLS: u64 = 101;
/// Steps of the square that is followed, and their length, px; those of `kernels.py`.
const STEPS: u64 = 20;
const STEP_PX: f64 = 2.0;
/// Distance from the square at which it counts as lost, px.
const LOST_PX: f64 = 10.0;

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
    let mut times = Vec::new();
    let mut out = Vec::new();
    for index in 1..=CALLS {
        let frame = overlapping::frame(index, &depth, &camera);
        weigher.log_likelihood(&frame, &[])?;
        let start = ThreadTime::now();
        weigher.log_likelihoods(&frame, black_box(&people), 2, &mut out)?;
        times.push(1e6 * start.elapsed().as_secs_f64());
    }
    Ok(statistic_us(&times))
}

/// Follows a square of 100 px through colour images, a new one in each frame: the grey image, its
/// integral image, the search and the learning count, as they do in the other programs.
fn tracking() -> Result<f64, Box<dyn Error>> {
    let camera = square::camera();
    let mut track = square::track(&camera, 0.1);
    let mut detector = Compressive::new(Config::default(), 1)?;
    let mut times = Vec::new();
    for index in 0..STEPS {
        let region = Rect::new(270.0 + STEP_PX * index as f64, 170.0, 100.0, 100.0);
        let frame = square::coloured_frame(&camera, region, index);
        let start = ThreadTime::now();
        if index > 0 {
            let found = detector.detect(&frame, &Query::Track(&track), &mut Funnel::default())?;
            let at: Option<Point2<f64>> =
                found.first().map(|found| found.rect_in(&camera).centre());
            let off_px = at.map(|at| (at - region.centre()).norm());
            if off_px.is_none_or(|off_px| off_px > LOST_PX) {
                return Err(format!("frame {index}: the square is {off_px:?} px off").into());
            }
        }
        track.estimate.region = region;
        detector.learn(&frame, std::slice::from_ref(&track))?;
        if index > 0 {
            times.push(1e6 * start.elapsed().as_secs_f64());
        }
    }
    Ok(statistic_us(&times))
}
