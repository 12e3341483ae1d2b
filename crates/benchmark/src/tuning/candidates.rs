use std::collections::BTreeSet;

use serde::Serialize;
use tagalong_math::{ChaCha, RandomSource};
use tagalong_pipeline::Tunable;

/// One value for each tunable setting, in their order.
pub type Candidate = Vec<toml::Value>;

/// Maximum number of new attempts to find a candidate that is not in the list yet.
const ROUNDS: usize = 64;

/// Returns the settings of the config.
pub fn shipped(tunables: &[Tunable]) -> Candidate {
    tunables.iter().map(|tunable| tunable.now.clone()).collect()
}

/// Ways to search for settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "tried")]
pub enum Search {
    /// Only those of the config.
    #[default]
    Shipped,
    /// All combinations, which do not depend on a seed.
    Grid,
    /// A sample of the combinations, which depends on a seed.
    Sample {
        /// Number of all combinations.
        of: usize,
    },
}

impl Search {
    /// Returns the way in which [`candidates`] searches.
    pub fn of(tunables: &[Tunable], budget: usize) -> Self {
        let sizes = tunables.iter().map(|tunable| tunable.values.len());
        let of = sizes.fold(1_usize, usize::saturating_mul);
        match budget {
            0 | 1 => Self::Shipped,
            _ if of <= budget => Self::Grid,
            _ => Self::Sample { of },
        }
    }

    /// Returns the number of different samples for this number of seeds.
    pub fn samples(self, wanted: u8) -> u8 {
        match self {
            Self::Shipped | Self::Grid => 1,
            Self::Sample { .. } => wanted,
        }
    }

    /// Describes which settings were tried, `tried` in all.
    pub fn words(self, tried: usize, seed: u64) -> String {
        match self {
            Self::Shipped => "the settings of the config alone".to_owned(),
            Self::Grid => {
                format!("every setting of the grid, {tried} in all, so that no seed has a say")
            }
            Self::Sample { of } => {
                format!("a sample of {tried} of the {of} settings of the grid (seed {seed})")
            }
        }
    }
}

/// Returns the settings to be tried, at most `budget`: all combinations if they are few enough;
/// otherwise a sample of them in which each value of a setting is equally frequent (like a Latin
/// hypercube: McKay, Beckman and Conover, Technometrics 1979). The same seed gives the same sample.
///
/// The settings of the config are among them only by chance, because figures of all rooms may have
/// been used to choose them. With a budget of 1 there is no choice, and only they are returned.
pub fn candidates(tunables: &[Tunable], budget: usize, seed: u64) -> Vec<Candidate> {
    if budget <= 1 {
        return vec![shipped(tunables)];
    }
    match grid(tunables, budget) {
        Some(all) => all,
        None => sample(tunables, budget, seed),
    }
}

/// Returns all combinations, unless they are more than `most`.
fn grid(tunables: &[Tunable], most: usize) -> Option<Vec<Candidate>> {
    let mut all: Vec<Candidate> = vec![Vec::new()];
    for Tunable { values, .. } in tunables {
        if all.len() * values.len() > most {
            return None;
        }
        let mut longer = Vec::new();
        for begun in &all {
            for value in values {
                longer.push([begun.as_slice(), std::slice::from_ref(value)].concat());
            }
        }
        all = longer;
    }
    Some(all)
}

/// Returns settings that are drawn in blocks, so that a larger budget adds to those of a smaller
/// one.
fn sample(tunables: &[Tunable], count: usize, seed: u64) -> Vec<Candidate> {
    let mut random = ChaCha::new(seed, 0);
    let mut seen = BTreeSet::new();
    let mut chosen = Vec::new();
    let block = tunables.iter().map(|tunable| tunable.values.len()).max().unwrap_or(0);
    for _ in 0..ROUNDS * count {
        let columns: Vec<Candidate> =
            tunables.iter().map(|tunable| dealt(&tunable.values, block, &mut random)).collect();
        for row in 0..block {
            let candidate: Candidate = columns.iter().map(|column| column[row].clone()).collect();
            if chosen.len() < count && seen.insert(shown(&candidate)) {
                chosen.push(candidate);
            }
        }
    }
    chosen
}

/// Returns this number of values in random order, each as often as the others, or once more.
fn dealt(values: &[toml::Value], count: usize, random: &mut ChaCha) -> Candidate {
    let order = shuffled(values.to_vec(), random);
    shuffled(order.into_iter().cycle().take(count).collect(), random)
}

/// Returns the values in random order.
fn shuffled(mut values: Candidate, random: &mut ChaCha) -> Candidate {
    random.shuffle(&mut values);
    values
}

fn shown(candidate: &Candidate) -> String {
    format!("{candidate:?}")
}

/// Formats a value without the excess digits that come from dividing a range.
pub fn shown_value(value: &toml::Value) -> String {
    match value {
        toml::Value::Float(number) => format!("{:?}", (number * 1e9).round() / 1e9),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use toml::Value;

    use super::*;

    fn tunable(key: &str, now: i64, values: &[i64]) -> Tunable {
        let values = values.iter().copied().map(Value::Integer).collect();
        Tunable { key: key.into(), now: Value::Integer(now), values, places: Vec::new() }
    }

    fn three() -> [Tunable; 3] {
        three_with(2)
    }

    /// Three settings that are as in the config, each with four values.
    fn three_with(now: i64) -> [Tunable; 3] {
        ["a", "b", "c"].map(|key| tunable(key, now, &[1, 2, 3, 4]))
    }

    #[test]
    fn few_combinations_are_all_tried() {
        let tunables = [tunable("a", 2, &[1, 2]), tunable("b", 9, &[5, 6, 7])];
        let all = candidates(&tunables, 6, 1);
        let numbers: Vec<Vec<i64>> =
            all.iter().map(|c| c.iter().filter_map(Value::as_integer).collect()).collect();
        let expected = [[1, 5], [1, 6], [1, 7], [2, 5], [2, 6], [2, 7]];
        assert_eq!(numbers, expected);
        assert_eq!(candidates(&[], 9, 1), [Vec::<Value>::new()]);
    }

    /// All rooms chose the settings of a config, so that with them the truth of a room would have a
    /// say in what is chosen without it.
    #[test]
    fn the_settings_of_the_config_decide_nothing() {
        assert_eq!(candidates(&three_with(2), 64, 1), candidates(&three_with(9), 64, 1));
        assert_eq!(candidates(&three_with(2), 20, 1), candidates(&three_with(9), 20, 1));
        let sampled = candidates(&three_with(9), 20, 1);
        assert!(!sampled.contains(&shipped(&three_with(9))));
    }

    #[test]
    fn without_a_choice_there_are_the_settings_of_the_config() {
        assert_eq!(candidates(&three(), 1, 1), [vec![Value::Integer(2); 3]]);
    }

    #[test]
    fn of_many_a_balanced_sample_is_tried() {
        let all = candidates(&three(), 20, 1);
        assert_eq!(all.len(), 20);
        assert_eq!(all.iter().map(shown).collect::<BTreeSet<_>>().len(), 20, "none twice");
        for setting in 0..3 {
            for value in 1..=4 {
                let count = all.iter().filter(|c| c[setting] == Value::Integer(value)).count();
                assert!((3..=7).contains(&count), "{setting} is {value} in {count} of 20");
            }
        }
    }

    #[test]
    fn the_search_is_named_as_it_is_done() {
        for (budget, expected, words) in [
            (1, Search::Shipped, "the settings of the config alone"),
            (64, Search::Grid, "every setting of the grid, 64 in all, so that no seed has a say"),
            (
                63,
                Search::Sample { of: 64 },
                "a sample of 63 of the 64 settings of the grid (seed 5)",
            ),
        ] {
            let search = Search::of(&three(), budget);
            assert_eq!(search, expected, "{budget}");
            let tried = candidates(&three(), budget, 5);
            assert_eq!(search.words(tried.len(), 5), words);
            let other = candidates(&three(), budget, 6);
            let depends = matches!(search, Search::Sample { .. });
            assert_eq!(tried != other, depends, "{budget}");
        }
    }

    #[test]
    fn a_seed_says_which() {
        assert_eq!(candidates(&three(), 21, 1), candidates(&three(), 21, 1));
        assert_ne!(candidates(&three(), 21, 1), candidates(&three(), 21, 2));
    }

    #[test]
    fn a_larger_budget_adds_to_a_smaller_one() {
        assert_eq!(candidates(&three(), 9, 1), candidates(&three(), 30, 1)[..9]);
    }

    #[test]
    fn the_budget_is_kept() {
        for budget in 1..=70 {
            let count = candidates(&three(), budget, 1).len();
            assert!(count <= budget.min(64) && count + 1 >= budget.min(64), "{count} of {budget}");
        }
    }
}
