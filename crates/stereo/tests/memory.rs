//! Memory does not grow from frame to frame.
#![allow(clippy::unwrap_used, reason = "a broken test may stop loudly")]

use std::sync::Arc;

use tagalong_core::{EgoMotion, Frame, Funnel, GreyImage, Images, RightImage, Stamp};
use tagalong_geometry::{Camera, Distortion, Pinhole};
use tagalong_stereo::{Method, StereoDepth, StereoSettings};

const SIZE: (usize, usize) = (96, 64);
/// Limit of the growth, bytes; leaked depth images, 25 kB each, would be four times as much.
const MOST_BYTES: i64 = 300_000;

/// Returns the resident memory of the process, bytes; `None` if the system does not report it.
fn resident_bytes() -> Option<i64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find(|line| line.starts_with("RssAnon:"))?;
    line.split_whitespace().nth(1)?.parse::<i64>().ok().map(|kib| kib * 1024)
}

/// Generates a pair with another texture in each frame.
fn frame(index: u64) -> Frame {
    let lens = Pinhole { fx: 215.0, fy: 215.0, cx: 48.0, cy: 32.0, distortion: Distortion::None };
    let camera = Arc::new(Camera::mounted(lens, SIZE.0, SIZE.1, 1.0, 0.0, 0.0));
    let shift = 6 + index as usize % 9;
    let left = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| pattern_at(index, x, y));
    let right = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| pattern_at(index, x + shift, y));
    let images = Images {
        grey: Some(Arc::new(left)),
        right: Some(Arc::new(RightImage { image: right, baseline_m: 0.12 })),
        ..Images::default()
    };
    Frame::new(index, Stamp::default(), camera, EgoMotion::at_rest(0.1), images)
}

/// Returns a pixel of the pattern that an image shows.
fn pattern_at(index: u64, x: usize, y: usize) -> u8 {
    let h = ((x / 3) as u32).wrapping_mul(0x9E37_79B1) ^ ((y / 3) as u32 + index as u32);
    (h.wrapping_mul(0x85EB_CA77) >> 25) as u8 + 60
}

#[test]
fn memory_is_flat() {
    if resident_bytes().is_none() {
        eprintln!("skipped: this system does not say how much memory a process has");
        return;
    }
    for method in [Method::Block, Method::SemiGlobal] {
        let settings = StereoSettings { method, threads: 1, ..StereoSettings::default() };
        let mut stereo = StereoDepth::new(settings).unwrap();
        let [early, late] = [0..12, 12..60].map(|frames| {
            for index in frames {
                stereo.depth(&frame(index), &mut Funnel::default()).unwrap();
            }
            resident_bytes().unwrap()
        });
        assert!(late - early < MOST_BYTES, "{method:?}: {early} to {late} bytes");
    }
}
