use std::collections::VecDeque;

use crate::{Appearance, AppearanceDifference};

/// Maximum number of stored appearances.
const MOST: usize = 24;
/// Mean difference from the known appearances below which a new one is not stored.
const NEWS: f64 = 0.06;

/// Stored appearances of one person, or of several.
#[derive(Clone, Debug, Default)]
pub struct Gallery {
    all: VecDeque<Appearance>,
}

impl Gallery {
    /// Returns true if no appearance is stored.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Adds an appearance if it is new. If the gallery is full, it replaces the oldest one that is
    /// not among the first `kept`.
    pub fn add(&mut self, appearance: Appearance, kept: usize) {
        for known in &self.all {
            let is_new = appearance.difference(known).mean().is_some_and(|d| d > NEWS);
            if !is_new {
                return;
            }
        }
        if self.all.len() == MOST {
            self.all.remove(kept);
        }
        self.all.push_back(appearance);
    }

    /// Returns the difference from the most similar stored appearance; `None` without one.
    pub fn nearest(&self, appearance: &Appearance) -> Option<AppearanceDifference> {
        fn mean(d: &AppearanceDifference) -> f64 {
            d.mean().unwrap_or(0.0)
        }

        let differences = self.all.iter().map(|known| appearance.difference(known));
        differences.min_by(|a, b| mean(a).total_cmp(&mean(b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEPT: usize = 8;

    #[test]
    fn only_new_appearances_are_remembered_and_the_first_ones_are_never_forgotten() {
        fn in_colour(colour: usize) -> Appearance {
            Appearance::in_one_colour(1.6, Some(colour))
        }

        let mut gallery = Gallery::default();
        for colour in [1, 1, 2, 1, 2] {
            gallery.add(in_colour(colour), KEPT);
        }
        assert_eq!(gallery.all.len(), 2);
        let mut gallery = Gallery::default();
        (0..26).for_each(|colour| gallery.add(in_colour(colour), KEPT));
        assert_eq!(gallery.all.len(), MOST);
        for colour in 0..26 {
            let is_known = gallery.all.contains(&in_colour(colour));
            assert_eq!(is_known, !(8..10).contains(&colour), "{colour}");
        }
    }
}
