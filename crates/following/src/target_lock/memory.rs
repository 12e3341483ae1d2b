use tagalong_vision::{Appearance, Gallery};

use super::settings::LooksSettings;

/// Number of first appearances that are never forgotten: they are certain.
const KEPT: usize = 8;

/// Memory of the appearance of the person, and of others.
#[derive(Clone, Debug, Default)]
pub struct AppearanceMemory {
    own: Gallery,
    others: Gallery,
    /// Sum of the heights of the head, m, and their number.
    heights: (f64, f64),
}

impl AppearanceMemory {
    /// Learns an appearance of the person.
    pub fn learn(&mut self, looks: Appearance) {
        self.heights = (self.heights.0 + looks.height_m, self.heights.1 + 1.0);
        self.own.add(looks, KEPT);
    }

    /// Learns an appearance of another person.
    pub fn learn_other(&mut self, looks: Appearance) {
        self.others.add(looks, 0);
    }

    /// Returns the differences of an appearance from the person's; `None` without a memory.
    pub fn differences(&self, looks: &Appearance) -> Option<Differences> {
        let own = self.own.nearest(looks)?;
        let other = self.others.nearest(looks);
        let height_m = self.heights.0 / self.heights.1;
        Some(Differences {
            torso: own.torso,
            legs: own.legs,
            texture: own.texture,
            vector: own.vector,
            height_m: (looks.height_m - height_m).abs(),
            rivals: other.and_then(|other| Some(other.mean()? - own.mean()?)),
        })
    }
}

/// Differences of an appearance from the remembered person: Hellinger distances, 0 to 1, of the
/// visible parts, or the distance of vectors, and the height of the head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Differences {
    /// Colours of the upper body.
    pub torso: Option<f64>,
    /// Colours of the legs.
    pub legs: Option<f64>,
    /// Directions of edges on the upper body.
    pub texture: Option<f64>,
    /// Vectors of a network: 1 minus the cosine, in place of the three above.
    pub vector: Option<f64>,
    /// Height of the head, m.
    pub height_m: f64,
    /// Excess of the distance to the others' appearance over that to the person's.
    pub rivals: Option<f64>,
}

impl Differences {
    /// Returns the log-odds that it is the person; an unknown difference adds nothing.
    pub fn log_odds(&self, settings: &LooksSettings) -> f64 {
        fn say(difference: Option<f64>, [even, weight]: [f64; 2]) -> f64 {
            difference.map_or(0.0, |difference| weight * (even - difference))
        }

        say(self.torso, settings.torso)
            + say(self.legs, settings.legs)
            + say(self.texture, settings.texture)
            + say(self.vector, settings.vector)
            + say(Some(self.height_m), settings.height)
            + settings.rivals * self.rivals.unwrap_or(0.0)
    }
}

/// Converts log-odds to a probability.
pub(crate) fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

/// Converts a probability to log-odds.
pub(crate) fn logit(probability: f64) -> f64 {
    (probability / (1.0 - probability)).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An appearance with a height, and a shirt of this colour.
    fn looks(height_m: f64, colour: Option<usize>) -> Appearance {
        Appearance::in_one_colour(height_m, colour)
    }

    #[test]
    fn without_a_memory_there_is_nothing_to_differ_from() {
        let mut memory = AppearanceMemory::default();
        memory.learn_other(looks(1.6, Some(1)));
        assert_eq!(memory.differences(&looks(1.6, Some(1))), None);
    }

    #[test]
    fn the_most_like_of_what_is_remembered_counts_and_the_mean_height() {
        let mut memory = AppearanceMemory::default();
        memory.learn(looks(1.5, Some(1)));
        memory.learn(looks(1.6, Some(2)));
        let found = memory.differences(&looks(1.75, Some(2))).unwrap();
        assert!((found.height_m - 0.2).abs() < 1e-12, "{found:?}");
        assert_eq!((found.torso, found.legs, found.rivals), (Some(0.0), None, None));
        let other = memory.differences(&looks(1.35, Some(3))).unwrap();
        assert!((other.height_m - 0.2).abs() < 1e-12, "lower is as different as higher");
        assert_eq!(other.torso, Some(1.0));
    }

    #[test]
    fn looks_are_held_against_those_of_others() {
        let mut memory = AppearanceMemory::default();
        memory.learn(looks(1.6, Some(1)));
        memory.learn_other(looks(1.6, Some(2)));
        assert_eq!(
            [1, 2, 3].map(|colour| memory.differences(&looks(1.6, Some(colour))).unwrap().rivals),
            [Some(1.0), Some(-1.0), Some(0.0)]
        );
    }

    #[test]
    fn each_difference_speaks_for_or_against_by_its_weight() {
        let settings = LooksSettings {
            torso: [0.2, 10.0],
            legs: [0.3, 4.0],
            texture: [0.4, 2.0],
            vector: [0.3, 8.0],
            height: [0.1, 20.0],
            rivals: 3.0,
            calibration: Vec::new(),
        };
        let none = Differences {
            torso: None,
            legs: None,
            texture: None,
            vector: None,
            height_m: 0.1,
            rivals: None,
        };
        for (differences, log_odds) in [
            (none, 0.0),
            (Differences { torso: Some(0.5), ..none }, -3.0),
            (Differences { legs: Some(0.05), ..none }, 1.0),
            (Differences { texture: Some(0.9), ..none }, -1.0),
            (Differences { vector: Some(0.05), ..none }, 2.0),
            (Differences { height_m: 0.15, ..none }, -1.0),
            (Differences { rivals: Some(0.5), ..none }, 1.5),
            (Differences { torso: Some(0.1), legs: Some(0.8), ..none }, -1.0),
        ] {
            let found = differences.log_odds(&settings);
            assert!((found - log_odds).abs() < 1e-12, "{differences:?}: {found}");
        }
    }
}
