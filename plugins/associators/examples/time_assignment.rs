//! Prints the time of an assignment of as many tracks as detections, all pairs allowed, for each
//! size that is named: the fastest call, in microseconds. `benches/peers/kernels.py` compares it
//! with other solvers of the same costs.
//!
//! ```sh
//! cargo run --release -p tagalong-associators --example time_assignment -- 5 20 100
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use std::hint::black_box;
use std::time::Instant;

use tagalong_associators::assign;

/// Cost of a track that gets no detection: more than any pair.
const MISS: f64 = 1.5;

fn main() {
    for size in std::env::args().skip(1).filter_map(|text| text.parse().ok()) {
        let (us, total) = time(size);
        println!("{size} {us:.3} {total:.9}");
    }
}

/// Returns the time of the fastest call, and the sum of the costs of its pairs.
fn time(size: usize) -> (f64, f64) {
    let costs: Vec<f64> = (0..size * size).map(|i| mixed(i as u64)).collect();
    let miss = vec![MISS; size];
    let calls = (2_000_000 / (size * size).max(1)).clamp(10, 5000);
    let mut best = f64::INFINITY;
    let mut given = Vec::new();
    for _ in 0..calls {
        let start = Instant::now();
        given = black_box(assign(size, &miss, |row, col| Some(costs[row * size + col])));
        best = best.min(1e6 * start.elapsed().as_secs_f64());
    }
    let cost =
        |(row, col): (usize, &Option<usize>)| col.map_or(MISS, |col| costs[row * size + col]);
    (best, given.iter().enumerate().map(cost).sum())
}

/// Returns a number in 0 to 1 that looks random.
fn mixed(i: u64) -> f64 {
    let mixed = (i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}
