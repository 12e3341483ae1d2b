use nalgebra::{SMatrix, SVector};

/// Maximum number of steps of Newton's method.
const STEPS: usize = 100;

/// Feature vector with the probability of the positive class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Example<const N: usize> {
    /// Features; a feature that is always 1 gives an offset.
    pub features: [f64; N],
    /// Probability of the positive class, 0 to 1.
    pub target: f64,
    /// Weight of the example in the loss.
    pub weight: f64,
}

/// Fits the weights of a linear log-odds model by logistic regression: Newton's method with
/// halved steps (Lin, Lin and Weng 2007). `ridge` times half the square of the weights is
/// added to the loss.
pub fn logistic<const N: usize>(examples: &[Example<N>], ridge: f64) -> [f64; N] {
    let mut weights = SVector::<f64, N>::zeros();
    for _ in 0..STEPS {
        let next = improved(&weights, examples, ridge);
        let moved = (next - weights).abs().sum();
        weights = next;
        if moved < 1e-9 {
            break;
        }
    }
    weights.into()
}

/// Takes one step of Newton's method, halved until the loss falls.
fn improved<const N: usize>(
    weights: &SVector<f64, N>,
    examples: &[Example<N>],
    ridge: f64,
) -> SVector<f64, N> {
    let mut slope = weights * ridge;
    let mut bend = SMatrix::<f64, N, N>::identity() * ridge;
    for Example { features, target, weight } in examples {
        let x = SVector::from(*features);
        let p = 1.0 / (1.0 + (-weights.dot(&x)).exp());
        slope += x * (weight * (p - target));
        bend += x * x.transpose() * (weight * p * (1.0 - p));
    }
    let Some(bend) = bend.cholesky() else { return *weights };
    let step = bend.solve(&slope);
    let before = loss(weights, examples, ridge);
    (0..30)
        .map(|halvings| weights - step * 0.5f64.powi(halvings))
        .find(|candidate| loss(candidate, examples, ridge) < before)
        .unwrap_or(*weights)
}

/// Returns the cross-entropy, in a form that cannot overflow, plus the ridge penalty.
fn loss<const N: usize>(weights: &SVector<f64, N>, examples: &[Example<N>], ridge: f64) -> f64 {
    let each = examples.iter().map(|Example { features, target, weight }| {
        let f = weights.dot(&SVector::from(*features));
        weight * (f.max(0.0) - f * target + (-f.abs()).exp().ln_1p())
    });
    each.sum::<f64>() + 0.5 * ridge * weights.norm_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_that_the_examples_were_drawn_from_are_found() {
        fn true_odds(a: f64, b: f64) -> f64 {
            3.0 * a - 2.0 * b + 0.5
        }

        let grid = (0..400).map(|k| (f64::from(k % 20) / 10.0 - 1.0, f64::from(k / 20) / 10.0));
        let examples: Vec<_> = grid
            .map(|(a, b)| {
                let target = 1.0 / (1.0 + (-true_odds(a, b)).exp());
                Example { features: [a, b, 1.0], target, weight: 1.0 }
            })
            .collect();
        let found = logistic(&examples, 1e-9);
        let off = found.iter().zip([3.0, -2.0, 0.5]).map(|(f, t)| (f - t).abs());
        assert!(off.sum::<f64>() < 1e-4, "{found:?}");
    }

    #[test]
    fn a_ridge_keeps_what_can_be_told_apart_without_error_finite() {
        fn of(x: f64) -> Example<1> {
            Example { features: [x], target: f64::from(x > 0.0), weight: 1.0 }
        }

        let [weight] = logistic(&[of(-1.0), of(1.0)], 0.01);
        assert!(weight > 1.0 && weight < 10.0, "{weight}");
    }
}
