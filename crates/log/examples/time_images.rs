//! Prints the time of decoding each of some compressed images as a log has them, PNG or JPEG: the
//! fastest of some calls, in milliseconds. `benches/peers/kernels.py` compares it with OpenCV.
//!
//! ```text
//! cargo run --release -p tagalong-log --example time_images -- depth.png colour.jpg
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use tagalong_core::Stamp;
use tagalong_log::Limits;
use tagalong_log::images::decode_compressed;
use tagalong_log::msgs::{CompressedImage, Header};

/// Calls, of which the fastest counts.
const CALLS: usize = 30;

fn main() -> Result<(), Box<dyn Error>> {
    let limits = Limits::default();
    for path in std::env::args().skip(1) {
        let data = std::fs::read(&path)?;
        let header = Header::new(Stamp::default(), "camera");
        let image = CompressedImage { header, format: String::new(), data: &data };
        let mut best = f64::INFINITY;
        for _ in 0..CALLS {
            let start = Instant::now();
            black_box(decode_compressed(&image, None, &limits)?);
            best = best.min(1e3 * start.elapsed().as_secs_f64());
        }
        println!("{best:.4}");
    }
    Ok(())
}
