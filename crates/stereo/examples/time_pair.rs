//! Matches a pair of image files several times on one thread and prints the time of the fastest
//! run, ms. Used by `benches/peers/stereo_opencv.py`.
//!
//! `cargo run --release -p tagalong-stereo --example time_pair METHOD LEFT RIGHT DISPARITIES RUNS`

#![allow(clippy::print_stdout, reason = "its output is what it is for")]

use std::error::Error;
use std::time::{Duration, Instant};

use tagalong_core::GreyImage;
use tagalong_stereo::{Matcher, Method, StereoSettings};

fn grey(path: &str) -> Result<GreyImage, Box<dyn Error>> {
    let image = image::open(path)?.to_luma8();
    let (width, height) = (image.width() as usize, image.height() as usize);
    GreyImage::from_pixels(width, height, image.into_raw()).ok_or_else(|| "an empty image".into())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [method, left, right, disparities, runs] = arguments.as_slice() else {
        return Err("expected: METHOD LEFT RIGHT DISPARITIES RUNS".into());
    };
    let method = match method.as_str() {
        "block" => Method::Block,
        "semi-global" => Method::SemiGlobal,
        other => return Err(format!("no method `{other}`: block or semi-global").into()),
    };
    let (left, right) = (grey(left)?, grey(right)?);
    let (disparities, runs): (usize, usize) = (disparities.parse()?, runs.parse()?);
    let settings = StereoSettings { method, threads: 1, ..StereoSettings::default() };
    let mut matcher = Matcher::new(settings)?;
    let mut best = Duration::MAX;
    for _ in 0..runs {
        let start = Instant::now();
        matcher.disparities(&left, &right, disparities.saturating_sub(1))?;
        best = best.min(start.elapsed());
    }
    println!("{:.3}", best.as_secs_f64() * 1e3);
    Ok(())
}
