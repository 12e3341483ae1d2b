//! Fits networks, by the method of Levenberg and Marquardt: the normal equations
//! of all samples, damped as far as is needed for the cost to fall.
//!
//! P5 takes steps along the gradient. Its networks have a few dozen weights and a
//! few hundred samples; there the second order costs nothing, needs no rate, and
//! ends. What is fitted are squares of errors and, weighted by `decay`, of weights:
//! without these the network follows single samples.

use nalgebra::{DMatrix, DVector};
use tagalong_learn::mix;

use crate::Network;
use crate::network::split;

/// The shape of a network and how it is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Hidden units.
    pub hidden: usize,
    /// Weight of the mean square of the weights beside the mean square error, whose
    /// unit is the variance of the target.
    pub decay: f64,
    /// Fits from other random weights; the best one is kept.
    pub restarts: u64,
    /// Most steps of a fit.
    pub steps: usize,
}

/// A step that gains less than this part of the cost is the last one.
const ENOUGH: f64 = 1e-5;
/// The damping at first, how it changes, and how often a step is tried again.
const DAMPING: f64 = 1e-2;
const CHANGE: f64 = 4.0;
const TRIES: usize = 10;

impl Fit {
    /// The network that tells targets from inputs; the same seed makes the same one.
    pub(crate) fn network(&self, inputs: &[Vec<f64>], targets: &[f64], seed: u64) -> Network {
        let start = |restart: u64| self.random(inputs, targets, mix(seed ^ (restart << 32)));
        let fits =
            (0..self.restarts.max(1)).map(|restart| self.descend(start(restart), inputs, targets));
        let best = fits.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(|| start(0), |(_, network)| network)
    }

    /// Small random weights.
    fn random(&self, inputs: &[Vec<f64>], targets: &[f64], seed: u64) -> Network {
        let count = inputs.first().map_or(0, Vec::len);
        let (mean, scale) =
            (0..count).map(|i| mean_and_scale(inputs.iter().map(move |x| x[i]))).unzip();
        let (target, deviation) = mean_and_scale(targets.iter().copied());
        let mut state = seed;
        let mut weight = |reach: f64| {
            state = mix(state);
            reach * (state as f64 / u64::MAX as f64 * 2.0 - 1.0)
        };
        let reach = 1.0 / (count as f64 + 1.0).sqrt();
        let hidden =
            (0..self.hidden).map(|_| (0..=count).map(|_| weight(reach)).collect()).collect();
        let output = (0..=self.hidden).map(|_| weight(0.5)).collect();
        Network { mean, scale, target: [target, deviation], hidden, output }
    }

    /// The end of the way down from a network, and its cost.
    fn descend(&self, start: Network, inputs: &[Vec<f64>], targets: &[f64]) -> (f64, Network) {
        let [mean, scale] = start.target;
        let scaled = |x: &Vec<f64>| (0..x.len()).map(|i| start.scaled(x, i)).collect();
        let inputs: Vec<Vec<f64>> = inputs.iter().map(scaled).collect();
        let targets: Vec<f64> = targets.iter().map(|t| (t - mean) / scale).collect();
        let (mut network, mut damping) = (start, DAMPING);
        let mut weights = weights_of(&network);
        let decay = self.decay * targets.len() as f64 / weights.len() as f64;
        let cost = |network: &Network, weights: &DVector<f64>| {
            let error = |(x, t): (&Vec<f64>, &f64)| (network.forward(|i| x[i]) - t).powi(2);
            inputs.iter().zip(&targets).map(error).sum::<f64>() + decay * weights.norm_squared()
        };
        let mut lowest = cost(&network, &weights);
        for _ in 0..self.steps {
            let (jacobian, errors) = linearised(&network, &inputs, &targets);
            let normal = jacobian.tr_mul(&jacobian);
            let gradient = jacobian.tr_mul(&errors) + decay * &weights;
            let before = lowest;
            for _ in 0..TRIES {
                let mut damped = normal.clone();
                (0..weights.len()).for_each(|i| damped[(i, i)] += decay + damping);
                let Some(step) = damped.cholesky().map(|c| c.solve(&gradient)) else { break };
                let next = &weights - step;
                let tried = with_weights(&network, &next);
                let reached = cost(&tried, &next);
                if reached < lowest {
                    (network, weights, lowest) = (tried, next, reached);
                    damping = (damping / CHANGE).max(1e-9);
                    break;
                }
                damping *= CHANGE;
            }
            if before - lowest <= ENOUGH * before {
                break;
            }
        }
        (lowest, network)
    }
}

/// Mean, and standard deviation that is never 0.
pub(crate) fn mean_and_scale(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    (mean, variance.sqrt().max(1e-9))
}

/// All weights: those of each hidden unit with its bias, then those of the output.
fn weights_of(network: &Network) -> DVector<f64> {
    let all = network.hidden.iter().flatten().chain(&network.output);
    DVector::from_vec(all.copied().collect())
}

fn with_weights(network: &Network, weights: &DVector<f64>) -> Network {
    let mut changed = network.clone();
    let all = changed.hidden.iter_mut().flatten().chain(&mut changed.output);
    all.zip(weights.iter()).for_each(|(to, from)| *to = *from);
    changed
}

/// The derivative of each answer by all weights, a row a sample, and the errors.
fn linearised(
    network: &Network,
    inputs: &[Vec<f64>],
    targets: &[f64],
) -> (DMatrix<f64>, DVector<f64>) {
    let (output, bias) = split(&network.output);
    let weights = network.hidden.iter().map(Vec::len).sum::<usize>() + network.output.len();
    let mut jacobian = DMatrix::zeros(inputs.len(), weights);
    let mut errors = DVector::zeros(inputs.len());
    for (row, (x, target)) in inputs.iter().zip(targets).enumerate() {
        let (mut column, mut answer) = (0, bias);
        let behind = weights - network.output.len();
        for (unit, (hidden, weight)) in network.hidden.iter().zip(output).enumerate() {
            let (hidden, bias) = split(hidden);
            let sum = hidden.iter().zip(x).map(|(w, x)| w * x).sum::<f64>() + bias;
            let value = sum.tanh();
            let slope = weight * (1.0 - value * value);
            for x in x.iter().chain(&[1.0]) {
                jacobian[(row, column)] = slope * x;
                column += 1;
            }
            jacobian[(row, behind + unit)] = value;
            answer += weight * value;
        }
        jacobian[(row, weights - 1)] = 1.0;
        errors[row] = answer - target;
    }
    (jacobian, errors)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIT: Fit = Fit { hidden: 4, decay: 1e-4, restarts: 3, steps: 100 };

    fn samples(count: usize) -> (Vec<Vec<f64>>, Vec<f64>) {
        let x = |i: usize| vec![(i as f64 * 0.37) % 3.0, (i as f64 * 0.61) % 2.0];
        let inputs: Vec<Vec<f64>> = (0..count).map(x).collect();
        let targets = inputs.iter().map(|x| 2.0 + x[0].sin() + 0.5 * x[0] * x[1]).collect();
        (inputs, targets)
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        let (inputs, targets) = samples(7);
        let network = FIT.random(&inputs, &targets, 5);
        let (jacobian, errors) = linearised(&network, &inputs, &targets);
        let weights = weights_of(&network);
        for column in 0..weights.len() {
            let at = |step: f64| {
                let mut moved = weights.clone();
                moved[column] += step;
                linearised(&with_weights(&network, &moved), &inputs, &targets).1
            };
            let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((slope - jacobian.column(column)).norm() < 1e-8, "{column}");
        }
        assert!((errors[3] - (network.forward(|i| inputs[3][i]) - targets[3])).abs() < 1e-12);
    }

    #[test]
    fn a_smooth_function_is_learned_and_the_same_seed_learns_the_same() {
        let (inputs, targets) = samples(150);
        let (half, known) = (inputs[..100].to_vec(), &targets[..100]);
        let network = FIT.network(&half, known, 3);
        assert_eq!(network, FIT.network(&half, known, 3));
        let off = |i: usize| (network.answer(&inputs[i]) - targets[i]).abs();
        let mean = (100..150).map(off).sum::<f64>() / 50.0;
        assert!(mean < 0.03, "{mean}");
    }

    #[test]
    fn decay_keeps_weights_small() {
        let (inputs, targets) = samples(60);
        let size = |decay| weights_of(&Fit { decay, ..FIT }.network(&inputs, &targets, 3)).norm();
        assert!(size(1.0) < 0.5 * size(1e-4));
    }
}
