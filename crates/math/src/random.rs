use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Increment of SplitMix64: the golden ratio in 64 bits, made odd.
const GAMMA: u64 = 0x9E37_79B9_7F4A_7C15;

/// Number of doubles between 0 and 1 that a random number can become: `f64` has a precision of 53
/// bits.
const STEPS: f64 = (1_u64 << 53) as f64;

/// Source of random bits, with distributions that are computed from them. The distributions are
/// implemented here, because those of general libraries change between versions.
pub trait RandomSource {
    /// Returns the next 64 random bits.
    fn next_u64(&mut self) -> u64;

    /// Returns a number that is uniform in [0, 1).
    fn uniform(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 / STEPS
    }

    /// Returns a number that is uniform in (0, 1].
    fn positive_uniform(&mut self) -> f64 {
        ((self.next_u64() >> 11) + 1) as f64 / STEPS
    }

    /// Returns a number that is uniform in [`low`, `high`).
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Returns a standard normal number (Box and Muller, Ann. Math. Stat. 1958).
    fn normal(&mut self) -> f64 {
        // `uniform` could return 0, whose logarithm is infinite.
        let radius = (-2.0 * self.positive_uniform().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.positive_uniform()).cos()
    }

    /// Returns an integer below `end`, the remainder of 64 random bits. `end` must not be 0.
    fn below(&mut self, end: u64) -> u64 {
        self.next_u64() % end
    }

    /// Returns one element of a list, which must not be empty.
    fn pick<T: Copy>(&mut self, all: &[T]) -> T
    where
        Self: Sized,
    {
        all[self.below(all.len() as u64) as usize]
    }

    /// Shuffles `items` (Fisher and Yates).
    fn shuffle<T>(&mut self, items: &mut [T])
    where
        Self: Sized,
    {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last as u64 + 1) as usize);
        }
    }
}

/// SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): a small seeded generator with the same numbers
/// on every machine.
///
/// ```
/// use tagalong_math::{RandomSource, SplitMix64};
/// assert_eq!(SplitMix64::new(1_234_567).next_u64(), 6_457_827_717_110_365_317);
/// ```
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// Creates a generator from a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }
}

impl RandomSource for SplitMix64 {
    fn next_u64(&mut self) -> u64 {
        let number = mix(self.0);
        self.0 = self.0.wrapping_add(GAMMA);
        number
    }
}

/// ChaCha with 8 rounds, for long sequences of independent numbers.
#[derive(Clone, Debug)]
pub struct ChaCha(ChaCha8Rng);

impl ChaCha {
    /// Creates a generator for one purpose. Streams of the same seed are independent of each other.
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self(generator)
    }
}

impl RandomSource for ChaCha {
    fn next_u64(&mut self) -> u64 {
        self.0.next_u64()
    }
}

/// Xorshift with 64 bits (Marsaglia, J. of Statistical Software 2003): the fastest generator, for
/// choices where the quality of the numbers does not matter.
#[derive(Clone, Debug)]
pub struct XorShift64(u64);

impl XorShift64 {
    /// Creates a generator from a seed; 0 would give zeros only, and is replaced by 1.
    pub fn new(seed: u64) -> Self {
        Self(seed.max(1))
    }
}

impl RandomSource for XorShift64 {
    fn next_u64(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
}

/// Returns a hash of some bytes (FNV-1a of Fowler, Noll and Vo). It is the same on every machine.
///
/// ```
/// use tagalong_math::fingerprint;
/// assert_eq!(fingerprint(*b"foobar"), 0x8594_4171_f739_67e8);
/// ```
pub fn fingerprint(bytes: impl IntoIterator<Item = u8>) -> u64 {
    const PRIME: u64 = 0x0100_0000_01b3;
    bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME))
}

/// Returns the first number of [`SplitMix64`] for this seed, a hash of the seed: different seeds
/// give different numbers.
#[inline]
pub fn mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(GAMMA);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Returns the number of [`SplitMix64`] at an index, counted from 0, without computing those before
/// it: for noise and textures that threads compute in any order.
#[inline]
pub fn number_at(seed: u64, index: u64) -> u64 {
    mix(seed.wrapping_add(index.wrapping_mul(GAMMA)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mean_and_deviation;

    #[test]
    fn split_mix_gives_the_published_stream() {
        // The reference values of the authors' C implementation for this seed.
        let published = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        let mut random = SplitMix64::new(1_234_567);
        for (index, number) in published.into_iter().enumerate() {
            assert_eq!(random.next_u64(), number);
            assert_eq!(number_at(1_234_567, index as u64), number);
        }
        assert_eq!((mix(0), mix(GAMMA)), (0xE220_A839_7B1D_CDAF, 0x6E78_9E6A_A1B9_65F4));
    }

    #[test]
    fn xorshift_gives_its_known_values() {
        let mut random = XorShift64::new(1);
        // 1 -> 1 ^ 1 << 13 = 0x2001 -> ^ >> 7 = 0x2041 -> ^ << 17 = 0x40822041.
        assert_eq!(random.next_u64(), 0x4082_2041);
        assert_ne!(XorShift64::new(0).next_u64(), 0);
    }

    #[test]
    fn streams_of_a_seed_differ_and_repeat() {
        fn first(stream: u64) -> u64 {
            ChaCha::new(3, stream).next_u64()
        }

        assert_eq!(first(1), first(1));
        assert_ne!(first(1), first(2));
    }

    fn check_moments(mut random: impl RandomSource) {
        let normal: Vec<f64> = (0..20_000).map(|_| random.normal()).collect();
        let (mean, deviation) = mean_and_deviation(&normal).unwrap();
        assert!(mean.abs() < 0.03 && (deviation - 1.0).abs() < 0.03, "{mean} {deviation}");
        let uniform: Vec<f64> = (0..20_000).map(|_| random.uniform()).collect();
        let (mean, deviation) = mean_and_deviation(&uniform).unwrap();
        let expected = 1.0 / 12_f64.sqrt();
        assert!((mean - 0.5).abs() < 0.01 && (deviation - expected).abs() < 0.01, "{mean}");
    }

    #[test]
    fn distributions_have_their_moments() {
        check_moments(SplitMix64::new(1));
        check_moments(ChaCha::new(1, 2));
    }

    #[test]
    fn uniform_numbers_stay_in_their_intervals() {
        /// Source of the same bits again and again.
        struct Constant(u64);
        impl RandomSource for Constant {
            fn next_u64(&mut self) -> u64 {
                self.0
            }
        }
        let mut least = Constant(0);
        let mut most = Constant(u64::MAX);
        assert_eq!((least.uniform(), most.positive_uniform()), (0.0, 1.0));
        assert!(most.uniform() < 1.0 && least.positive_uniform() > 0.0);
        assert!(least.normal().is_finite() && most.normal().is_finite());
        assert_eq!((least.between(-2.0, 3.0), most.below(1 << 20)), (-2.0, (1 << 20) - 1));
    }

    #[test]
    fn shuffling_keeps_all_and_repeats() {
        fn shuffled(seed: u64) -> Vec<u32> {
            let mut items: Vec<u32> = (0..50).collect();
            SplitMix64::new(seed).shuffle(&mut items);
            items
        }

        let mut items = shuffled(3);
        assert_eq!(items, shuffled(3));
        assert_ne!(items, shuffled(4));
        items.sort_unstable();
        assert_eq!(items, (0..50).collect::<Vec<_>>());
    }
}
