//! Prints the time of a patch, in microseconds, with the sum of the decision values of all, for
//! numbers of support vectors and patches that are named. Both are numbers that look random.
//! `benches/peers/kernels.py` compares them with OpenCV's machine.
//!
//! ```sh
//! cargo run --release -p tagalong-benches --example time_patches -- 100 1000
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use tagalong_benches::timing::median_us;
use tagalong_math::number_at;
use tagalong_svm_patch::{Model, PIXELS, Patch, Sampler, Scaling};

/// Width of the kernel: vectors have length 1.
const GAMMA: f64 = 0.5;

fn main() -> Result<(), std::num::ParseIntError> {
    let mut counts = std::env::args().skip(1).map(|text| text.parse());
    let vectors: usize = counts.next().unwrap_or(Ok(100))?;
    let patches: usize = counts.next().unwrap_or(Ok(1000))?;
    let support = patches_from(0, vectors);
    let weights = (0..vectors).map(|k| if k % 2 == 0 { 1.5 } else { -0.5 });
    let sampler = Sampler { grow: 0.0, scaling: Scaling::Unit };
    let model = Model::new(sampler, GAMMA, 0.0, support.iter().zip(weights));
    let patches = patches_from(vectors, patches);
    let us = median_us(|| patches.iter().map(|patch| model.decision(patch)).sum::<f64>());
    let sum: f64 = patches.iter().map(|patch| model.decision(patch)).sum();
    println!("{:.3} {sum:.6}", us / patches.len() as f64);
    Ok(())
}

/// Returns patches of length 1, the first of them with the given number.
fn patches_from(first: usize, count: usize) -> Vec<Patch> {
    let mut patches = Vec::with_capacity(count);
    for k in first..first + count {
        let mut patch: Patch = std::array::from_fn(|i| {
            let number = number_at(1, (k * PIXELS + i) as u64);
            (number >> 11) as f32 / (1_u64 << 53) as f32 - 0.5
        });
        let length = patch.iter().map(|v| v * v).sum::<f32>().sqrt();
        patch.iter_mut().for_each(|v| *v /= length);
        patches.push(patch);
    }
    patches
}
