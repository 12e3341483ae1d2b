//! Weights and resampling of particles.

use crate::random::Random;

/// Scales `weights` to sum 1; makes them equal if the sum is not usable.
pub fn normalise(weights: &mut [f64]) {
    let sum: f64 = weights.iter().sum();
    let even = 1.0 / weights.len().max(1) as f64;
    let usable = sum.is_finite() && sum > 0.0;
    weights.iter_mut().for_each(|w| *w = if usable { *w / sum } else { even });
}

/// Converts log-weights that are known up to a constant to weights of sum 1.
pub fn from_logs(logs: &mut [f64]) {
    // Relative to the largest one, no exponential overflows, and the largest does not underflow.
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    logs.iter_mut().for_each(|l| *l = if most.is_finite() { (*l - most).exp() } else { 1.0 });
    normalise(logs);
}

/// Returns the number of equal particles with the same information (Kong, Liu & Wong 1994).
pub fn effective_size(weights: &[f64]) -> f64 {
    1.0 / weights.iter().map(|w| w * w).sum::<f64>().max(f64::MIN_POSITIVE)
}

/// Resamples systematically (Kitagawa 1996): returns `count` indices, each in proportion to its
/// weight, up to one, at evenly spaced points with a random offset.
pub fn systematic(weights: &[f64], count: usize, random: &mut Random) -> Vec<usize> {
    let offset = 1.0 - random.uniform();
    pick(weights, (0..count).map(|i| (i as f64 + offset) / count as f64))
}

/// Returns for each of the ascending points in 0..1 the first index with a cumulated weight above
/// it.
fn pick(weights: &[f64], points: impl Iterator<Item = f64>) -> Vec<usize> {
    let mut index = 0;
    let mut sum = weights.first().copied().unwrap_or_default();
    points
        .map(|point| {
            while sum <= point && index + 1 < weights.len() {
                index += 1;
                sum += weights[index];
            }
            index
        })
        .collect()
}

/// Returns the heaviest `count` indices, heaviest first.
pub fn heaviest(weights: &[f64], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..weights.len()).collect();
    order.sort_by(|a, b| weights[*b].total_cmp(&weights[*a]).then(a.cmp(b)));
    order.truncate(count);
    order
}

/// Returns the number of particles that keeps the error of a histogram with `bins` occupied bins
/// below `error` (Kullback-Leibler divergence), with the probability of the normal quantile `z`
/// (Fox 2003, equation 12).
pub fn kld_size(bins: usize, error: f64, z: f64) -> usize {
    if bins < 2 {
        return 1;
    }
    let k = bins as f64 - 1.0;
    let part = 2.0 / (9.0 * k);
    (k / (2.0 * error) * (1.0 - part + part.sqrt() * z).powi(3)).ceil() as usize
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_index_is_drawn_as_often_as_its_weight_says(
            mut weights in prop::collection::vec(0.0..1.0f64, 1..40), count in 1usize..200, seed in 0u64..50,
        ) {
            normalise(&mut weights);
            let drawn = systematic(&weights, count, &mut Random::new(seed, 0));
            prop_assert_eq!(drawn.len(), count);
            for (index, weight) in weights.iter().enumerate() {
                let times = drawn.iter().filter(|d| **d == index).count() as f64;
                prop_assert!((times - weight * count as f64).abs() < 1.0 + 1e-9);
            }
        }

        #[test]
        fn weights_are_those_of_the_exponentials(logs in prop::collection::vec(-30.0..30.0f64, 1..30)) {
            let sum: f64 = logs.iter().map(|l| l.exp()).sum();
            let mut fast = logs.clone();
            from_logs(&mut fast);
            for (log, weight) in logs.iter().zip(&fast) {
                prop_assert!((log.exp() / sum - weight).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn with_a_random_offset_no_index_is_preferred() {
        let weights = [0.1, 0.1, 0.4, 0.4];
        let mut counts = [0u32; 4];
        for seed in 0..2000 {
            let drawn = systematic(&weights, 4, &mut Random::new(seed, 0));
            drawn.into_iter().for_each(|index| counts[index] += 1);
        }
        for (count, weight) in counts.iter().zip(weights) {
            let share = f64::from(*count) / 8000.0;
            assert!((share - weight).abs() < 0.015, "{counts:?}");
        }
    }

    #[test]
    fn useless_weights_become_even() {
        let mut logs = [f64::NAN, f64::NEG_INFINITY];
        from_logs(&mut logs);
        assert_eq!(logs, [0.5, 0.5]);
        assert_eq!(effective_size(&logs), 2.0);
    }

    #[test]
    fn the_quantile_is_of_the_normal_distribution() {
        assert_eq!(kld_size(20, 0.05, 2.33), 363);
        assert_eq!(kld_size(20, 0.05, 0.99), 250);
        assert_eq!(kld_size(1, 0.05, 2.33), 1);
    }

    #[test]
    fn the_heaviest_come_first() {
        assert_eq!(heaviest(&[0.1, 0.5, 0.4], 2), [1, 2]);
    }
}
