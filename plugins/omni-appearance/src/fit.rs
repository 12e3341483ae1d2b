//! Fits networks by the Levenberg-Marquardt method: the normal equations of all samples, damped as
//! far as necessary for the cost to fall.
//!
//! P5 uses gradient descent. Its networks have a few dozen weights and a few hundred samples, for
//! which a second-order method costs little, needs no learning rate, and converges. The cost is the
//! sum of the squared errors and, weighted by `decay`, of the squared weights: without these the
//! network overfits single samples.
//!
//! The gradient descent of the paper is available for comparison. The paper states its learning
//! rate, 0.3, but neither the scaling of inputs and target nor the end of the training. Both are
//! scaled to mean 0 and standard deviation 1, because on pixels and metres such steps overshoot at
//! once; each step follows the mean gradient of all samples, and all steps are taken.

use nalgebra::{DMatrix, DVector};
use tagalong_learn::dense::{NormalEquations, transposed_product};
use tagalong_learn::mix;

use crate::Network;
use crate::network::split;

/// Shape of a network and settings of its fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Number of hidden units.
    pub hidden: usize,
    /// Weight of the mean square of the weights relative to the mean square error, in units of the
    /// variance of the target.
    pub decay: f64,
    /// Number of fits from different random weights; the best one is kept.
    pub restarts: u64,
    /// Most steps of a fit.
    pub steps: usize,
    /// Method of the steps.
    pub descent: Descent,
}

/// Method by which the cost is reduced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Descent {
    /// Damped normal equations, until a step gains little.
    Marquardt,
    /// Gradient steps, by back-propagation (P5, section 4.4).
    BackPropagation {
        /// Step as a part of the mean gradient.
        rate: f64,
    },
}

/// Relative gain of a step below which the fit ends.
const ENOUGH: f64 = 1e-5;
/// Initial damping.
const DAMPING: f64 = 1e-2;
/// Factor by which the damping falls after a good step and grows after a bad one.
const CHANGE: f64 = 4.0;
/// Most attempts at one step.
const TRIES: usize = 10;

impl Fit {
    /// Fits a network that maps inputs to targets; the same seed gives the same network.
    pub(crate) fn network(&self, inputs: &[Vec<f64>], targets: &[f64], seed: u64) -> Network {
        let fits = (0..self.restarts.max(1)).map(|restart| {
            let start = self.random(inputs, targets, mix(seed ^ (restart << 32)));
            self.descend(start, inputs, targets)
        });
        let best = fits.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(|| self.random(inputs, targets, mix(seed)), |(_, network)| network)
    }

    /// Returns a network with small random weights.
    fn random(&self, inputs: &[Vec<f64>], targets: &[f64], seed: u64) -> Network {
        let count = inputs.first().map_or(0, Vec::len);
        let (mean, scale) =
            (0..count).map(|i| mean_and_scale(inputs.iter().map(move |x| x[i]))).unzip();
        let (target, deviation) = mean_and_scale(targets.iter().copied());
        let mut state = seed;
        // Sums of this size keep the units in the steep part of tanh, where the gradient does
        // not vanish.
        let reach = 1.0 / (count as f64 + 1.0).sqrt();
        let hidden = (0..self.hidden)
            .map(|_| (0..=count).map(|_| random_weight(&mut state, reach)).collect())
            .collect();
        let output = (0..=self.hidden).map(|_| random_weight(&mut state, 0.5)).collect();
        Network { mean, scale, target: [target, deviation], hidden, output }
    }

    /// Reduces the cost from a starting network; returns the reached cost and network.
    fn descend(&self, start: Network, inputs: &[Vec<f64>], targets: &[f64]) -> (f64, Network) {
        let [mean, scale] = start.target;
        let inputs: Vec<Vec<f64>> =
            inputs.iter().map(|x| (0..x.len()).map(|i| start.scaled(x, i)).collect()).collect();
        let targets: Vec<f64> = targets.iter().map(|t| (t - mean) / scale).collect();
        let weights = weights_of(&start).len();
        let decay = self.decay * targets.len() as f64 / weights as f64;
        let scaled = Scaled { inputs, targets, decay };
        match self.descent {
            Descent::Marquardt => self.by_marquardt(start, &scaled),
            Descent::BackPropagation { rate } => self.by_gradient(start, &scaled, rate),
        }
    }

    fn by_gradient(&self, start: Network, samples: &Scaled, rate: f64) -> (f64, Network) {
        let mut network = start.clone();
        let mut weights = weights_of(&start);
        let part = rate / samples.targets.len().max(1) as f64;
        for _ in 0..self.steps {
            let (jacobian, errors) = linearised(&network, &samples.inputs, &samples.targets);
            weights -= part * (transposed_product(&jacobian, &errors) + samples.decay * &weights);
            network = with_weights(&network, &weights);
        }
        (samples.cost(&network, &weights), network)
    }

    fn by_marquardt(&self, start: Network, samples: &Scaled) -> (f64, Network) {
        let mut network = start;
        let mut damping = DAMPING;
        let mut weights = weights_of(&network);
        let decay = samples.decay;
        let mut lowest = samples.cost(&network, &weights);
        for _ in 0..self.steps {
            let (jacobian, errors) = linearised(&network, &samples.inputs, &samples.targets);
            let normal = NormalEquations::new(&jacobian, &errors);
            let gradient = normal.right_side() + decay * &weights;
            let before = lowest;
            for _ in 0..TRIES {
                let penalties = vec![decay + damping; weights.len()];
                let Some(step) = normal.solve(&penalties, &gradient) else { break };
                let next = &weights - step;
                let tried = with_weights(&network, &next);
                let reached = samples.cost(&tried, &next);
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

/// Scaled samples, and the weight of the squared weights.
struct Scaled {
    inputs: Vec<Vec<f64>>,
    targets: Vec<f64>,
    decay: f64,
}

impl Scaled {
    fn cost(&self, network: &Network, weights: &DVector<f64>) -> f64 {
        let errors = self
            .inputs
            .iter()
            .zip(&self.targets)
            .map(|(x, t)| (network.forward(|i| x[i]) - t).powi(2))
            .sum::<f64>();
        errors + self.decay * weights.norm_squared()
    }
}

/// Returns the mean, and the standard deviation, which is never 0.
pub(crate) fn mean_and_scale(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    // A constant input would otherwise be divided by 0.
    (mean, variance.sqrt().max(1e-9))
}

/// Returns all weights: those of each hidden unit with its bias, then those of the output.
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

/// Returns the derivatives of the outputs with respect to all weights, one row per sample, and the
/// errors.
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
        let mut column = 0;
        let mut answer = bias;
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

/// Draws a weight of at most this size from a state, which moves on.
fn random_weight(state: &mut u64, reach: f64) -> f64 {
    *state = mix(*state);
    reach * (*state as f64 / u64::MAX as f64 * 2.0 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIT: Fit =
        Fit { hidden: 4, decay: 1e-4, restarts: 3, steps: 100, descent: Descent::Marquardt };
    const DESCENT: Fit =
        Fit { decay: 0.0, steps: 2000, descent: Descent::BackPropagation { rate: 0.3 }, ..FIT };

    fn samples(count: usize) -> (Vec<Vec<f64>>, Vec<f64>) {
        fn x(i: usize) -> Vec<f64> {
            vec![(i as f64 * 0.37) % 3.0, (i as f64 * 0.61) % 2.0]
        }

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
            let [more, less] = [1e-5, -1e-5].map(|step| {
                let mut moved = weights.clone();
                moved[column] += step;
                linearised(&with_weights(&network, &moved), &inputs, &targets).1
            });
            let slope = (more - less) / 2e-5;
            assert!((slope - jacobian.column(column)).norm() < 1e-8, "{column}");
        }
        assert!((errors[3] - (network.forward(|i| inputs[3][i]) - targets[3])).abs() < 1e-12);
    }

    #[test]
    fn the_first_weights_are_small_and_of_both_signs() {
        let (inputs, targets) = samples(20);
        let network = Fit { hidden: 40, ..FIT }.random(&inputs, &targets, 3);
        let hidden: Vec<f64> = network.hidden.concat();
        // Two inputs and a bias.
        for (weights, reach) in [(&hidden, 1.0 / 3.0_f64.sqrt()), (&network.output, 0.5)] {
            assert!(weights.iter().all(|weight| weight.abs() <= reach), "{weights:?}");
            assert!(weights.iter().any(|weight| *weight > 0.5 * reach), "{weights:?}");
            assert!(weights.iter().any(|weight| *weight < -0.5 * reach), "{weights:?}");
        }
    }

    #[test]
    fn a_smooth_function_is_learned_and_the_same_seed_learns_the_same() {
        let (inputs, targets) = samples(150);
        let half = inputs[..100].to_vec();
        let known = &targets[..100];
        let network = FIT.network(&half, known, 3);
        assert_eq!(network, FIT.network(&half, known, 3));
        let mean =
            (100..150).map(|i| (network.answer(&inputs[i]) - targets[i]).abs()).sum::<f64>() / 50.0;
        assert!(mean < 0.03, "{mean}");
    }

    #[test]
    fn back_propagation_learns_more_slowly() {
        let (inputs, targets) = samples(150);
        let fits = [DESCENT, DESCENT, FIT, Fit { steps: 20, ..DESCENT }];
        let networks = fits.map(|fit| fit.network(&inputs[..100], &targets[..100], 3));
        assert_eq!(networks[0], networks[1]);
        let [slow, _, fast, short] = networks.map(|network| {
            (100..150).map(|i| (network.answer(&inputs[i]) - targets[i]).abs()).sum::<f64>() / 50.0
        });
        assert!(fast < 0.5 * slow && slow < 0.1, "{fast} {slow}");
        assert!(short > 2.0 * slow, "{short} {slow}");
    }

    /// Returns a network of one input and one hidden neuron, with this constant added to its output.
    fn small_network(constant: f64) -> Network {
        Network {
            mean: vec![0.0],
            scale: vec![1.0],
            target: [0.0, 1.0],
            hidden: vec![vec![0.5, -0.25]],
            output: vec![2.0, constant],
        }
    }

    /// One step computed by hand: along the mean gradient, times the rate.
    #[test]
    fn a_step_of_back_propagation_is_that_of_the_formula() {
        let network = small_network(0.125);
        let step = Fit { steps: 1, ..DESCENT };
        let (_, after) = step.descend(network, &[vec![1.0], vec![-2.0]], &[1.0, 0.5]);
        let mut slopes = [0.0; 4];
        for (x, target) in [(1.0, 1.0), (-2.0, 0.5)] {
            let value = (0.5_f64 * x - 0.25).tanh();
            let error = 2.0 * value + 0.125 - target;
            let inner = error * 2.0 * (1.0 - value * value);
            let slope = [inner * x, inner, error * value, error];
            slopes.iter_mut().zip(slope).for_each(|(sum, slope)| *sum += 0.5 * slope);
        }
        let before = [0.5, -0.25, 2.0, 0.125];
        for ((after, before), slope) in weights_of(&after).iter().zip(before).zip(slopes) {
            assert!((after - (before - 0.3 * slope)).abs() < 1e-12, "{after}");
        }
    }

    /// Two targets of one input leave an error of 1, of which the first step can take a millionth.
    #[test]
    fn after_a_step_that_gains_too_little_there_is_no_other() {
        let start = small_network(1e-3 - 2.0 * 0.25_f64.tanh());
        let [one, nine] = [1, 9].map(|steps| {
            let fit = Fit { decay: 0.0, steps, ..FIT };
            fit.descend(start.clone(), &[vec![1.0], vec![1.0]], &[1.0, -1.0]).1
        });
        assert!(one.answer(&[1.0]).abs() < 1e-4, "the step is made");
        assert_eq!(one, nine);
    }

    /// Without an error there is the decay alone: 0.8 for two samples and four weights.
    #[test]
    fn a_step_without_errors_makes_the_weights_smaller() {
        let network = small_network(0.125);
        let before = weights_of(&network);
        let inputs = [vec![1.0], vec![-2.0]];
        let answers = inputs.each_ref().map(|x| network.answer(x));
        for descent in [Descent::BackPropagation { rate: 0.25 }, Descent::Marquardt] {
            let step = Fit { decay: 0.8, steps: 1, descent, ..FIT };
            let (_, after) = step.descend(network.clone(), &inputs, &answers);
            let after = weights_of(&after);
            assert!(after.norm() < before.norm(), "{descent:?}: {after}");
            if let Descent::BackPropagation { rate } = descent {
                let expected = &before * (1.0 - rate * 0.8 / 4.0);
                assert!((after - expected).amax() < 1e-12, "one step along the decay");
            }
        }
    }

    #[test]
    fn numbers_of_pixels_must_be_scaled_for_back_propagation() {
        // An input of some hundred pixels, like the third feature.
        let pixels: Vec<Vec<f64>> = (0..50).map(|i| vec![300.0 + 20.0 * f64::from(i)]).collect();
        let metres: Vec<f64> = (0..50).map(|i| 5.0 - 0.08 * f64::from(i)).collect();
        let scaled = DESCENT.network(&pixels, &metres, 3);
        let start = DESCENT.random(&pixels, &metres, 3);
        let raw = Network { mean: vec![0.0], scale: vec![1.0], target: [0.0, 1.0], ..start };
        let (_, raw) = DESCENT.descend(raw, &pixels, &metres);
        let [scaled, raw] = [&scaled, &raw].map(|network| {
            let off = pixels.iter().zip(&metres).map(|(x, m)| (network.answer(x) - m).abs());
            off.fold(0.0, f64::max)
        });
        assert!(scaled < 0.1 && raw > 1.0, "{scaled} {raw}");
    }

    #[test]
    fn decay_keeps_weights_small() {
        let (inputs, targets) = samples(60);
        let [small, large] = [1.0, 1e-4]
            .map(|decay| weights_of(&Fit { decay, ..FIT }.network(&inputs, &targets, 3)).norm());
        assert!(small < 0.5 * large, "{small} {large}");
    }
}
