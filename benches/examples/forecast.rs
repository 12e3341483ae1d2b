//! Learns the settings of the forecast from simulated walks of the split `train`, and prints how many
//! true places lie within its ellipses on walks of the split `test`.
//!
//! ```text
//! cargo run --release -p tagalong-benches --example forecast
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "an example")]

use tagalong_controllers::ForecastSettings;
use tagalong_sim::Split;

#[path = "../tests/walks/mod.rs"]
mod walks;

use walks::{AHEAD_S, SHARES, Sample, errors_m, held, samples};

/// Seeds of each scene.
const SEEDS: u64 = 4;
const DAMPINGS: [f64; 9] = [0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6];
const DENSITIES: [f64; 10] = [0.0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2];
const FILTER_PARTS: [f64; 7] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0];
const TAILS: [f64; 7] = [1.0, 2.0, 3.0, 4.0, 6.0, 10.0, 30.0];
/// Rounds over the settings, one after the other.
const ROUNDS: usize = 3;

fn main() {
    let train = samples(Split::Train, SEEDS);
    let test = samples(Split::Test, SEEDS);
    let learnt = learn(&train);
    println!("learnt from {} samples of {SEEDS} seeds of each scene:", train.len());
    println!("{learnt:?}; defaults: {:?}", ForecastSettings::default());
    let constant = ForecastSettings { damping_per_s: 0.0, ..learnt };
    for (name, settings) in
        [("learnt", learnt), ("defaults", ForecastSettings::default()), ("undamped", constant)]
    {
        println!("\n{name}, on {} samples of the split test", test.len());
        println!("| ahead s | error m | within 50 % | 90 % | 95 % |");
        println!("|---|---|---|---|---|");
        let shares = held(&test, &settings);
        let errors = errors_m(&test, &settings);
        for (row, seconds) in AHEAD_S.iter().enumerate() {
            let cells: Vec<String> =
                (0..SHARES.len()).map(|k| format!("{:.1}", 100.0 * shares[row][k])).collect();
            println!("| {seconds} | {:.2} | {} |", errors[row], cells.join(" | "));
        }
    }
}

/// Returns the settings with the largest likelihood of the true places, one setting after the other.
fn learn(samples: &[Sample]) -> ForecastSettings {
    let mut best = ForecastSettings::default();
    let mut least = cost(samples, &best);
    for _ in 0..ROUNDS {
        let dampings = DAMPINGS.map(|damping_per_s| ForecastSettings { damping_per_s, ..best });
        take_better(samples, &dampings, &mut best, &mut least);
        let unrests = DENSITIES.map(|unrest| ForecastSettings { unrest, ..best });
        take_better(samples, &unrests, &mut best, &mut least);
        let by_speed =
            DENSITIES.map(|unrest_by_speed| ForecastSettings { unrest_by_speed, ..best });
        take_better(samples, &by_speed, &mut best, &mut least);
        let parts = FILTER_PARTS.map(|filter_part| ForecastSettings { filter_part, ..best });
        take_better(samples, &parts, &mut best, &mut least);
        let tails = TAILS.map(|tail_dof| ForecastSettings { tail_dof, ..best });
        take_better(samples, &tails, &mut best, &mut least);
    }
    best
}

fn take_better(
    samples: &[Sample],
    candidates: &[ForecastSettings],
    best: &mut ForecastSettings,
    least: &mut f64,
) {
    for candidate in candidates {
        let found = cost(samples, candidate);
        if found < *least {
            *least = found;
            *best = *candidate;
        }
    }
}

/// Returns the mean negative log-likelihood of the true places, without its constant.
fn cost(samples: &[Sample], settings: &ForecastSettings) -> f64 {
    let mut sum = 0.0;
    let mut count = 0.0;
    for sample in samples {
        let forecast = sample.forecast(settings);
        for (_, seconds, truth) in sample.truths() {
            let covariance = forecast.covariance(seconds);
            let off = truth - forecast.place(seconds);
            let inverse = covariance.try_inverse().expect("an ellipse with an area");
            let dof = forecast.dof(seconds);
            // The density of Student's t in the plane; its constant is that of the degrees of freedom.
            let distance = off.dot(&(inverse * off));
            sum += 0.5 * covariance.determinant().ln()
                + 0.5 * (dof + 2.0) * (1.0 + distance / dof).ln();
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}
