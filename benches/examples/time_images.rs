//! Prints the time of decoding each of some compressed images as a log has them, PNG or JPEG: the
//! median of some calls, in milliseconds. `benches/peers/kernels.py` compares it with OpenCV.
//!
//! ```text
//! cargo run --release -p tagalong-benches --example time_images -- depth.png colour.jpg
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use std::error::Error;

use tagalong_benches::timing::median_us;
use tagalong_core::Stamp;
use tagalong_log::Limits;
use tagalong_log::images::decode_compressed;
use tagalong_log::msgs::{CompressedImage, Header};

fn main() -> Result<(), Box<dyn Error>> {
    let limits = Limits::default();
    for path in std::env::args().skip(1) {
        let data = std::fs::read(&path)?;
        let header = Header::new(Stamp::default(), "camera");
        let image = CompressedImage { header, format: String::new(), data: &data };
        decode_compressed(&image, None, &limits)?;
        let us = median_us(|| decode_compressed(&image, None, &limits).is_ok());
        println!("{:.4}", 1e-3 * us);
    }
    Ok(())
}
