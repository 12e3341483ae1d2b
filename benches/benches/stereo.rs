//! Disparities of a pair of 512x384 pixels, of 64 disparities, on one thread.
#![allow(clippy::expect_used, missing_docs, reason = "a broken test or bench may stop loudly")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_core::GreyImage;
use tagalong_stereo::{Matcher, Method, StereoSettings};

const SIZE: (usize, usize) = (512, 384);

/// Smooth noise: each pixel the mean of hashes around it.
fn pattern(x: usize, y: usize) -> u8 {
    let hash = |x: usize, y: usize| {
        let h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
        ((h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D) >> 24) as usize
    };
    let sum: usize = (0..9).map(|i| hash(x + i % 3, y + i / 3)).sum();
    (sum / 9) as u8
}

/// A wall at 8 px, and in front of it a box at 30 px.
fn pair() -> (GreyImage, GreyImage) {
    let boxed = |x: usize, y: usize| (180..330).contains(&x) && y > 100;
    let left = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        if boxed(x, y) { pattern(x + 1000, y) } else { pattern(x, y) }
    });
    let right = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        if boxed(x + 30, y) { pattern(x + 1030, y) } else { pattern(x + 8, y) }
    });
    (left, right)
}

fn matchers(criterion: &mut Criterion) {
    let (left, right) = pair();
    for (name, method) in [("block", Method::Block), ("semi-global", Method::SemiGlobal)] {
        let settings = StereoSettings { method, threads: 1, ..StereoSettings::default() };
        let mut matcher = Matcher::new(settings).expect("valid settings");
        criterion.bench_function(&format!("stereo {name} 512x384, 64 disparities"), |bencher| {
            bencher.iter(|| {
                let found = matcher.disparities(black_box(&left), &right, 63).expect("one size");
                found.values[SIZE.0 * 200 + 250]
            });
        });
    }
}

criterion_group!(benches, matchers);
criterion_main!(benches);
