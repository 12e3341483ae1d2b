use tagalong_math::{ChaCha, RandomSource};

/// Seeded random numbers with the distributions of a particle filter.
#[derive(Clone, Debug)]
pub struct Random(ChaCha);

impl Random {
    /// Creates a generator for one purpose: the streams of a seed are independent of each other.
    pub fn new(seed: u64, stream: u64) -> Self {
        Self(ChaCha::new(seed, stream))
    }

    /// Returns a number that is uniform in (0, 1].
    pub fn uniform(&mut self) -> f64 {
        self.0.positive_uniform()
    }

    /// Returns a standard normal number.
    pub fn normal(&mut self) -> f64 {
        self.0.normal()
    }

    /// Returns a whole number below `end`, which must not be 0.
    pub fn below(&mut self, end: usize) -> usize {
        // `uniform` includes 1, which would give `end` itself.
        ((self.uniform() * end as f64) as usize).min(end.saturating_sub(1))
    }

    /// Brings `items` into random order (Fisher & Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_mean_zero_and_variance_one() {
        let mut random = Random::new(1, 2);
        let drawn: Vec<f64> = (0..20_000).map(|_| random.normal()).collect();
        let mean = drawn.iter().sum::<f64>() / 20_000.0;
        let variance = drawn.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }

    #[test]
    fn shuffling_keeps_all_and_repeats() {
        fn shuffled(seed: u64) -> Vec<u32> {
            let mut items: Vec<u32> = (0..50).collect();
            Random::new(seed, 0).shuffle(&mut items);
            items
        }

        let mut sorted = shuffled(3);
        assert_eq!(sorted, shuffled(3));
        assert_ne!(sorted, shuffled(4));
        sorted.sort_unstable();
        assert_eq!(sorted, (0..50).collect::<Vec<_>>());
    }
}
