//! Prints the time of a patch, in microseconds, with the sum of the decision values of all, for
//! numbers of support vectors and patches that are named. Both are numbers that look random.
//! `benches/peers/kernels.py` compares them with OpenCV's machine.
//!
//! ```sh
//! cargo run --release -p tagalong-svm-patch --example time_patches -- 100 1000
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use std::hint::black_box;
use std::time::Instant;

use tagalong_math::number_at;
use tagalong_svm_patch::{Model, PIXELS, Patch, Sampler, Scaling};

/// Width of the kernel: vectors have length 1.
const GAMMA: f64 = 0.5;
const CALLS: usize = 30;

fn main() -> Result<(), std::num::ParseIntError> {
    let mut counts = std::env::args().skip(1).map(|text| text.parse());
    let vectors: usize = counts.next().unwrap_or(Ok(100))?;
    let patches: usize = counts.next().unwrap_or(Ok(1000))?;
    let support = patches_from(0, vectors);
    let weights = (0..vectors).map(|k| if k % 2 == 0 { 1.5 } else { -0.5 });
    let sampler = Sampler { grow: 0.0, scaling: Scaling::Unit };
    let model = Model::new(sampler, GAMMA, 0.0, support.iter().zip(weights));
    let patches = patches_from(vectors, patches);
    let all = || patches.iter().map(|patch| model.decision(patch)).sum();
    let (us, sum) = fastest(all);
    println!("{:.3} {sum:.6}", us / patches.len() as f64);
    Ok(())
}

/// Returns patches of length 1, the first of them with the given number.
fn patches_from(first: usize, count: usize) -> Vec<Patch> {
    let patch = |k: usize| {
        let mut patch: Patch = std::array::from_fn(|i| {
            let number = number_at(1, (k * PIXELS + i) as u64);
            (number >> 11) as f32 / (1_u64 << 53) as f32 - 0.5
        });
        let length = patch.iter().map(|v| v * v).sum::<f32>().sqrt();
        patch.iter_mut().for_each(|v| *v /= length);
        patch
    };
    (first..first + count).map(patch).collect()
}

/// Returns the time of the fastest call, us, and its answer.
fn fastest(call: impl Fn() -> f64) -> (f64, f64) {
    let timed = |_| {
        let start = Instant::now();
        let answer = black_box(call());
        (1e6 * start.elapsed().as_secs_f64(), answer)
    };
    (0..CALLS)
        .map(timed)
        .fold((f64::INFINITY, 0.0), |best, now| if now.0 < best.0 { now } else { best })
}
