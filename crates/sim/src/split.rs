//! What keeps training, validation and test apart.

use std::str::FromStr;

use tagalong_core::{ConfigError, nearest};

/// Seeds of one split.
const SEEDS: u64 = 1_000_000_000;
/// People in the pool of one split.
pub const SUBJECTS: u64 = 500;
/// Into how many slices a range is cut of which each split gets every third.
const SLICES: u64 = 15;

/// What a drawn log is for. A seed belongs to exactly one split, and all chance
/// comes from the seed: noise, ways, clutter. People come from a pool of
/// 500 for each split, and what a scene file varies `apart` takes
/// different values in each.
///
/// ```
/// use tagalong_sim::Split;
/// assert_eq!(Split::Test.seed(7).unwrap(), 2_000_000_007);
/// assert_eq!(Split::of(2_000_000_007), Split::Test);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// To learn from: seeds from 0.
    Train,
    /// To choose settings by: seeds from 1 000 000 000.
    Validation,
    /// To report: seeds from 2 000 000 000.
    Test,
}

impl Split {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Train, Self::Validation, Self::Test];
    /// The first number that is no seed.
    pub const SEEDS_END: u64 = 3 * SEEDS;

    /// The split that a seed belongs to.
    pub fn of(seed: u64) -> Self {
        Self::ALL[(seed / SEEDS).min(2) as usize]
    }

    /// What it is called in commands.
    pub fn name(self) -> &'static str {
        ["train", "validation", "test"][self.index() as usize]
    }

    /// The seed with a number within the split; seeds of the split stay.
    ///
    /// # Errors
    /// Seeds of another split.
    pub fn seed(self, number: u64) -> Result<u64, ConfigError> {
        if number < SEEDS {
            return Ok(self.index() * SEEDS + number);
        }
        if number < Self::SEEDS_END && Self::of(number) == self {
            return Ok(number);
        }
        let (name, first) = (self.name(), self.index() * SEEDS);
        let message = format!(
            "seed {number} does not belong to the split {name}: count from 0, or from {first}"
        );
        Err(ConfigError::new(message))
    }

    /// The number of a seed within its split.
    pub(crate) fn number(seed: u64) -> u64 {
        seed % SEEDS
    }

    /// Somebody of the pool as a number that no other split has.
    pub(crate) fn subject(self, number: u64) -> u64 {
        self.index() * SUBJECTS + number % SUBJECTS
    }

    /// The part of a range, both from 0 to 1, that a uniform number becomes.
    pub(crate) fn share(self, uniform: f64) -> f64 {
        let of_split = (SLICES / 3) as f64 * uniform.clamp(0.0, 1.0 - f64::EPSILON);
        let slice = 3.0 * of_split.floor() + self.index() as f64;
        (slice + of_split.fract()) / SLICES as f64
    }

    /// True if the split gets the entry of a list.
    pub(crate) fn has_entry(self, index: usize) -> bool {
        index as u64 % 3 == self.index()
    }

    fn index(self) -> u64 {
        self as u64
    }
}

impl FromStr for Split {
    type Err = ConfigError;

    fn from_str(name: &str) -> Result<Self, ConfigError> {
        Self::ALL.into_iter().find(|split| split.name() == name).ok_or_else(|| {
            let hint = nearest(name, Self::ALL.map(Self::name));
            let hint = hint.map_or(String::new(), |better| format!("did you mean `{better}`? "));
            let message =
                format!("unknown split `{name}`; {hint}there are train, validation and test");
            ConfigError::new(message)
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn seeds_of_another_split_are_refused() {
        assert!(Split::Train.seed(1_000_000_000).is_err());
        assert_eq!(Split::Validation.seed(1_000_000_003).unwrap(), 1_000_000_003);
        assert!(Split::Test.seed(Split::SEEDS_END).is_err());
        let error = "tests".parse::<Split>().unwrap_err().to_string();
        assert!(error.contains("did you mean `test`?"), "{error}");
    }

    proptest! {
        #[test]
        fn splits_share_no_seed_no_subject_and_no_part_of_a_range(
            a in 0..SEEDS, b in 0..SEEDS, u in 0.0..=1.0f64, v in 0.0..=1.0f64,
        ) {
            for (s, t) in [(Split::Train, Split::Validation), (Split::Validation, Split::Test),
                (Split::Train, Split::Test)] {
                prop_assert_ne!(s.seed(a).unwrap(), t.seed(b).unwrap());
                prop_assert_ne!(s.subject(a), t.subject(b));
                prop_assert_ne!(s.share(u), t.share(v));
                prop_assert_eq!(Split::of(s.seed(a).unwrap()), s);
            }
            let slice = (Split::Test.share(u) * SLICES as f64).floor() as u64;
            prop_assert_eq!(slice % 3, 2);
        }
    }
}
