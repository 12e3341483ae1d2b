//! Times the normal equations of trainers, by `faer`, beside those that stood there before, by
//! `nalgebra`.
//!
//! ```sh
//! cargo run --release -p tagalong-learn --features train --example time_dense
//! ```

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Cholesky, DMatrix, DVector};
use tagalong_learn::dense::NormalEquations;
use tagalong_learn::mix;

/// Samples and columns: the ridge and the two networks of `omni-appearance`, and larger ones.
const SHAPES: [[usize; 2]; 5] = [[400, 6], [400, 21], [400, 97], [2000, 97], [2000, 400]];
/// Repetitions, of which the fastest counts.
const REPETITIONS: usize = 20;

fn number(seed: usize) -> f64 {
    mix(seed as u64) as f64 / u64::MAX as f64 * 2.0 - 1.0
}

fn by_nalgebra(rows: &DMatrix<f64>, targets: &DVector<f64>) -> Option<DVector<f64>> {
    let mut normal = rows.transpose() * rows;
    for i in 0..rows.ncols() {
        normal[(i, i)] += 0.1;
    }
    Some(Cholesky::new(normal)?.solve(&rows.tr_mul(targets)))
}

fn by_faer(rows: &DMatrix<f64>, targets: &DVector<f64>) -> Option<DVector<f64>> {
    let equations = NormalEquations::new(rows, targets);
    equations.solve(&vec![0.1; rows.ncols()], equations.right_side())
}

/// A way to solve the equations.
type Solver = fn(&DMatrix<f64>, &DVector<f64>) -> Option<DVector<f64>>;

fn microseconds(solve: Solver, rows: &DMatrix<f64>, targets: &DVector<f64>) -> f64 {
    let mut fastest = f64::INFINITY;
    for _ in 0..REPETITIONS {
        let start = Instant::now();
        black_box(solve(black_box(rows), black_box(targets)));
        fastest = fastest.min(start.elapsed().as_secs_f64());
    }
    1e6 * fastest
}

#[allow(clippy::print_stdout)]
fn main() {
    println!("| samples x columns | faer [us] | nalgebra [us] | ratio |\n|---|---|---|---|");
    for [samples, columns] in SHAPES {
        let rows = DMatrix::from_fn(samples, columns, |i, j| number(i * columns + j));
        let targets = DVector::from_fn(samples, |i, _| number(1 << 40 | i));
        let faer = microseconds(by_faer, &rows, &targets);
        let nalgebra = microseconds(by_nalgebra, &rows, &targets);
        println!("| {samples} x {columns} | {faer:.0} | {nalgebra:.0} | {:.2} |", faer / nalgebra);
    }
}
