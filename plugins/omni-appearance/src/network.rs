use serde::{Deserialize, Serialize};

/// Network with one hidden layer of tanh and a linear output, for inputs and a target that are
/// scaled to mean 0 and deviation 1 (P5, section 4.4: three inputs, four hidden units, one output).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// Mean of each input.
    pub mean: Vec<f64>,
    /// Standard deviation of each input.
    pub scale: Vec<f64>,
    /// Mean and standard deviation of the target.
    pub target: [f64; 2],
    /// Weights of each hidden unit: one for each input, and the bias at the end.
    pub hidden: Vec<Vec<f64>>,
    /// Weights of the output: one for each hidden unit, and the bias at the end.
    pub output: Vec<f64>,
}

impl Network {
    /// Returns the output for some inputs; inputs beyond those of the network are ignored.
    pub fn answer(&self, inputs: &[f64]) -> f64 {
        let [mean, scale] = self.target;
        mean + scale * self.forward(|i| self.scaled(inputs, i))
    }

    /// Scales an input to mean 0 and deviation 1.
    pub fn scaled(&self, inputs: &[f64], i: usize) -> f64 {
        (inputs[i] - self.mean[i]) / self.scale[i]
    }

    /// Returns the scaled output for scaled inputs.
    pub(crate) fn forward(&self, input: impl Fn(usize) -> f64) -> f64 {
        let (weights, bias) = split(&self.output);
        let units = self.hidden.iter().zip(weights).map(|(unit, weight)| {
            let (weights, bias) = split(unit);
            let sum = weights.iter().enumerate().map(|(i, w)| w * input(i)).sum::<f64>() + bias;
            weight * sum.tanh()
        });
        units.sum::<f64>() + bias
    }

    /// Returns true if the shapes match, for at most `inputs` inputs, and all numbers are finite.
    pub fn is_sane(&self, inputs: usize) -> bool {
        let count = self.mean.len();
        let numbers = self.mean.iter().chain(&self.scale).chain(&self.target);
        let weights = self.hidden.iter().flatten().chain(&self.output);
        (1..=inputs).contains(&count)
            && self.scale.len() == count
            && self.scale.iter().all(|scale| *scale > 0.0)
            && self.hidden.iter().all(|unit| unit.len() == count + 1)
            && self.output.len() == self.hidden.len() + 1
            && numbers.chain(weights).all(|number| number.is_finite())
    }
}

/// Splits a row into its weights and the bias at the end.
pub(crate) fn split(weights: &[f64]) -> (&[f64], f64) {
    match weights.split_last() {
        Some((bias, weights)) => (weights, *bias),
        None => (&[], 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_is_that_of_the_formula() {
        let network = Network {
            mean: vec![1.0, 2.0],
            scale: vec![2.0, 4.0],
            target: [3.0, 0.5],
            hidden: vec![vec![0.5, -1.0, 0.25], vec![1.0, 1.0, 0.0]],
            output: vec![2.0, -1.0, 0.125],
        };
        assert!(network.is_sane(9));
        let a = (5.0 - 1.0) / 2.0;
        let b = (0.0 - 2.0) / 4.0;
        let units = [(0.5_f64 * a - b + 0.25).tanh(), (a + b).tanh()];
        let expected = 3.0 + 0.5 * (2.0 * units[0] - units[1] + 0.125);
        assert!((network.answer(&[5.0, 0.0, 77.0]) - expected).abs() < 1e-12);
        assert!(!network.is_sane(1));
        assert!(!Network { output: vec![1.0], ..network }.is_sane(9));
    }

    #[test]
    fn a_network_whose_parts_do_not_fit_is_insane() {
        let sane = Network {
            mean: vec![1.0, 2.0],
            scale: vec![2.0, 4.0],
            target: [3.0, 0.5],
            hidden: vec![vec![0.5, -1.0, 0.25]],
            output: vec![2.0, -1.0],
        };
        assert!(sane.is_sane(2));
        let broken: [fn(&mut Network); 8] = [
            |n| n.scale.push(1.0),
            |n| n.scale[1] = 0.0,
            |n| n.hidden[0].push(0.0),
            |n| n.output.push(0.0),
            |n| n.mean[0] = f64::NAN,
            |n| n.target[1] = f64::INFINITY,
            |n| n.hidden[0][1] = f64::NAN,
            |n| n.output[0] = f64::NAN,
        ];
        for (number, change) in broken.into_iter().enumerate() {
            let mut other = sane.clone();
            change(&mut other);
            assert!(!other.is_sane(2), "{number}");
        }
        let none = Network { mean: vec![], scale: vec![], hidden: vec![vec![0.1]], ..sane };
        assert!(!none.is_sane(2), "a network of no inputs tells nothing");
    }
}
