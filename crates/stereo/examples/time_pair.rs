//! Times both matchers on a pair of image files: milliseconds of the fastest of
//! so many runs, one line a method. Used by `benches/peers/stereo_opencv.py`.
//!
//! `cargo run --release -p tagalong-stereo --example time_pair LEFT RIGHT DISPARITIES RUNS THREADS`

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
    let [left, right, disparities, runs, threads] = arguments.as_slice() else {
        return Err("expected: LEFT RIGHT DISPARITIES RUNS THREADS".into());
    };
    let (left, right) = (grey(left)?, grey(right)?);
    let (disparities, runs): (usize, usize) = (disparities.parse()?, runs.parse()?);
    for (name, method) in [("block", Method::Block), ("semi-global", Method::SemiGlobal)] {
        let settings =
            StereoSettings { method, threads: threads.parse()?, ..StereoSettings::default() };
        let mut matcher = Matcher::new(settings)?;
        let mut best = Duration::MAX;
        for _ in 0..runs {
            let start = Instant::now();
            matcher.disparities(&left, &right, disparities.saturating_sub(1))?;
            best = best.min(start.elapsed());
        }
        println!("{name} {:.3}", best.as_secs_f64() * 1e3);
    }
    Ok(())
}
