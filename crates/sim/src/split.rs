//! Separation of training, validation and test.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use serde::Serialize;
use tagalong_config::{ConfigError, nearest};

/// Number of seeds of one split.
const SEEDS: u64 = 1_000_000_000;
/// Number of people in the pool of one split.
pub const SUBJECTS: u64 = 500;
/// Number of slices into which a range is divided; each split gets every third.
const SLICES: u64 = 15;

/// Purpose of a simulated log. A seed belongs to exactly one split, and everything random comes
/// from the seed: noise, paths, clutter. People come from a pool of 500 for each split, and
/// settings that a scene file varies `apart` take different values in each.
///
/// ```
/// use tagalong_sim::Split;
/// assert_eq!(Split::Test.seed(7).unwrap(), 2_000_000_007);
/// assert_eq!(Split::of(2_000_000_007), Split::Test);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// For training: seeds from 0.
    Train,
    /// For choosing settings: seeds from 1 000 000 000.
    Validation,
    /// For reported figures: seeds from 2 000 000 000.
    Test,
}

impl Split {
    /// All splits.
    pub const ALL: [Self; 3] = [Self::Train, Self::Validation, Self::Test];
    /// The first number that is not a seed.
    pub const SEEDS_END: u64 = 3 * SEEDS;

    /// Returns the split to which a seed belongs.
    pub fn of(seed: u64) -> Self {
        Self::ALL[(seed / SEEDS).min(2) as usize]
    }

    /// Returns the name used in commands.
    pub fn name(self) -> &'static str {
        ["train", "validation", "test"][self.index() as usize]
    }

    /// Returns the seed with this index within the split; a seed of the split is returned
    /// unchanged.
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
        let name = self.name();
        let first = self.index() * SEEDS;
        let message = format!(
            "seed {number} does not belong to the split {name}: count from 0, or from {first}"
        );
        Err(ConfigError::new(message))
    }

    /// Returns `count` seeds of the split, starting with index `first`.
    ///
    /// # Errors
    /// Seeds outside of the split.
    pub fn seeds(self, first: u64, count: u64) -> Result<Seeds, ConfigError> {
        let first = Self::number(self.seed(first)?);
        if first.saturating_add(count) <= SEEDS {
            return Ok(Seeds { split: self, first, count });
        }
        let name = self.name();
        let last = SEEDS - 1;
        let message = format!(
            "{count} seeds from {first} on leave the split {name}, whose last one is {last}: \
             begin earlier or take fewer"
        );
        Err(ConfigError::new(message))
    }

    /// Returns the index of a seed within its split.
    pub(crate) fn number(seed: u64) -> u64 {
        seed % SEEDS
    }

    /// Returns a number for a person of the pool that no other split has.
    pub(crate) fn subject(self, number: u64) -> u64 {
        self.index() * SUBJECTS + number % SUBJECTS
    }

    /// Maps a uniform number to the part of a range that the split uses, both from 0 to 1.
    pub(crate) fn share(self, uniform: f64) -> f64 {
        let of_split = (SLICES / 3) as f64 * uniform.clamp(0.0, 1.0 - f64::EPSILON);
        let slice = 3.0 * of_split.floor() + self.index() as f64;
        (slice + of_split.fract()) / SLICES as f64
    }

    /// Returns true if the split gets this entry of a list.
    pub(crate) fn has_entry(self, index: usize) -> bool {
        index as u64 % 3 == self.index()
    }

    fn index(self) -> u64 {
        self as u64
    }
}

/// Consecutive seeds of a split. Together with the scene and its changed settings they determine
/// the simulation, so that others can repeat it.
///
/// ```
/// use tagalong_sim::Split;
/// let seeds = Split::Test.seeds(50, 10).unwrap();
/// assert_eq!(seeds.numbers(), 2_000_000_050..2_000_000_060);
/// assert_eq!(seeds.to_string(), "10 seeds of the split test from 50 on");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Seeds {
    split: Split,
    first: u64,
    count: u64,
}

impl Seeds {
    /// Returns the seeds as numbers for a [`Variant`](crate::Variant).
    pub fn numbers(self) -> Range<u64> {
        let start = self.split.index() * SEEDS + self.first;
        start..start + self.count
    }
}

impl fmt::Display for Seeds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { split, first, count } = self;
        let seeds = if *count == 1 { "seed" } else { "seeds" };
        write!(f, "{count} {seeds} of the split {} from {first} on", split.name())
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

    #[test]
    fn ranges_of_seeds_stay_in_the_split() {
        let last = SEEDS - 1;
        assert_eq!(Split::Train.seeds(last, 1).unwrap().numbers(), last..SEEDS);
        let absolute = Split::Test.seeds(2_000_000_007, 2).unwrap();
        assert_eq!(absolute, Split::Test.seeds(7, 2).unwrap());
        for split in Split::ALL {
            let error = split.seeds(last, 2).unwrap_err().to_string();
            assert!(error.contains(split.name()) && error.contains("999999999"), "{error}");
            assert!(split.seeds(1, u64::MAX).is_err());
        }
        assert!(Split::Validation.seeds(2_000_000_000, 1).is_err());
    }

    #[test]
    fn seeds_are_named_for_programs() {
        let seeds = toml::to_string(&Split::Validation.seeds(3, 1).unwrap()).unwrap();
        assert_eq!(seeds, "split = \"validation\"\nfirst = 3\ncount = 1\n");
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
