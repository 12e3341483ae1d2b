//! Matches a pair of image files several times and prints the median processor time of a
//! run, ms, of all threads and of the thread that asks, which does its share of the work and all that
//! is not shared. Used by `benches/peers/stereo_opencv.py` and `benches/peers/kernels.py`.
//!
//! `cargo run --release -p tagalong-benches --example time_pair METHOD LEFT RIGHT DISPARITIES RUNS THREADS`

#![allow(clippy::print_stdout, reason = "its output is what it is for")]

use std::error::Error;

use cpu_time::{ProcessTime, ThreadTime};
use tagalong_benches::timing::statistic_us;
use tagalong_core::GreyImage;
use tagalong_stereo::{Matcher, Method, StereoSettings};

fn grey(path: &str) -> Result<GreyImage, Box<dyn Error>> {
    let image = image::open(path)?.to_luma8();
    let width = image.width() as usize;
    let height = image.height() as usize;
    GreyImage::from_pixels(width, height, image.into_raw()).ok_or_else(|| "an empty image".into())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [method, left, right, disparities, runs, threads] = arguments.as_slice() else {
        return Err("expected: METHOD LEFT RIGHT DISPARITIES RUNS THREADS".into());
    };
    let method = match method.as_str() {
        "block" => Method::Block,
        "semi-global" => Method::SemiGlobal,
        other => return Err(format!("no method `{other}`: block or semi-global").into()),
    };
    let left = grey(left)?;
    let right = grey(right)?;
    let (disparities, runs): (usize, usize) = (disparities.parse()?, runs.parse()?);
    let threads = threads.parse()?;
    let settings = StereoSettings { method, threads, ..StereoSettings::default() };
    let mut matcher = Matcher::new(settings)?;
    let mut all = Vec::new();
    let mut own = Vec::new();
    for _ in 0..runs {
        let start = ProcessTime::now();
        let own_start = ThreadTime::now();
        matcher.disparities(&left, &right, disparities.saturating_sub(1))?;
        all.push(1e3 * start.elapsed().as_secs_f64());
        own.push(1e3 * own_start.elapsed().as_secs_f64());
    }
    println!("{:.3} {:.3}", statistic_us(&all), statistic_us(&own));
    Ok(())
}
