//! Prints the time of an assignment of as many tracks as detections, all pairs allowed, for each
//! size that is named: the median of calls, in microseconds. `benches/peers/kernels.py` compares it
//! with other solvers of the same costs.
//!
//! ```sh
//! cargo run --release -p tagalong-benches --example time_assignment -- 5 20 100
//! ```
#![allow(clippy::print_stdout, reason = "an example answers on the terminal")]

use tagalong_associators::assign;
use tagalong_benches::timing::median_us;

/// Cost of a track that gets no detection: more than any pair.
const MISS: f64 = 1.5;

fn main() {
    for size in std::env::args().skip(1).filter_map(|text| text.parse().ok()) {
        let (us, total) = time(size);
        println!("{size} {us:.3} {total:.9}");
    }
}

/// Returns the median time of a call, us, and the sum of the costs of its pairs.
fn time(size: usize) -> (f64, f64) {
    let costs: Vec<f64> = (0..size * size).map(|i| mixed(i as u64)).collect();
    let miss = vec![MISS; size];
    let us = median_us(|| assign(size, &miss, |row, col| Some(costs[row * size + col])));
    let assigned = assign(size, &miss, |row, col| Some(costs[row * size + col]));
    let paid = assigned.iter().enumerate();
    (us, paid.map(|(row, col)| col.map_or(MISS, |col| costs[row * size + col])).sum())
}

/// Returns a number in 0 to 1 that looks random.
fn mixed(i: u64) -> f64 {
    let mixed = (i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}
