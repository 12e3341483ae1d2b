use tagalong_math::{ChaCha, RandomSource, number_at};

/// Seeded random numbers that are the same on every machine.
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

    /// Returns a number that is uniform between two others.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Returns a standard normal number.
    pub fn normal(&mut self) -> f64 {
        self.0.normal()
    }

    /// Returns true with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.uniform() <= probability
    }

    /// Returns one element of a list that is not empty.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        self.0.pick(of)
    }

    /// Returns an integer from 0 to below `end`, which must not be 0.
    pub fn below(&mut self, end: u64) -> u64 {
        self.0.below(end)
    }
}

// Without overflow checks, so that loops over pixels become vector instructions.

/// Returns a number that is uniform in [0, 1) and depends only on seed and key.
#[inline(always)]
pub(crate) fn uniform_at(seed: u64, key: u64) -> f64 {
    (number_at(seed, key) >> 11) as f64 / (1u64 << 53) as f64
}

/// Returns a nearly normal number with variance one (the sum of four uniform ones) that depends
/// only on seed and key: for the noise of pixels, which has short tails anyway.
#[inline(always)]
pub(crate) fn normal_at(seed: u64, key: u64) -> f64 {
    let bits = number_at(seed, key);
    let sum = (bits & 0xffff)
        .wrapping_add(bits >> 16 & 0xffff)
        .wrapping_add(bits >> 32 & 0xffff)
        .wrapping_add(bits >> 48 & 0xffff);
    // The sum has 18 bits, and 32-bit integers have vector instructions for the conversion.
    (f64::from(sum as i32) / 65_536.0 - 2.0) * SQRT_3
}

/// Factor that makes the variance of the sum of four uniform numbers one.
const SQRT_3: f64 = 1.732_050_807_568_877_2;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let mut random = Random::new(1, 2);
        let sequence: Vec<f64> = (0..20_000).map(|_| random.normal()).collect();
        let keyed: Vec<f64> = (0..20_000).map(|key| normal_at(7, key)).collect();
        for values in [sequence, keyed] {
            let (mean, deviation) = tagalong_math::mean_and_deviation(&values).unwrap();
            assert!(mean.abs() < 0.03 && (deviation - 1.0).abs() < 0.025, "{mean} {deviation}");
        }
    }

    #[test]
    fn streams_differ_and_repeat() {
        fn draw(stream: u64) -> f64 {
            Random::new(3, stream).uniform()
        }

        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
    }
}
