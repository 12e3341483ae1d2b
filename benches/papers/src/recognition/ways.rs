//! Ways of telling a person from others: the fixed weights of the lock, and two that learn.

use nalgebra::{DMatrix, DVector};
use tagalong_following::{AppearanceMemory, LooksSettings};
use tagalong_vision::Appearance;

use super::sightings::Sighting;

/// Most remembered appearances of the long memory, as in the lock.
const LONG: usize = 24;
/// Number of first appearances of the person that are never forgotten, as in the lock.
const KEPT: usize = 8;
/// Appearances of the short memory.
const SHORT: usize = 8;
/// Mean difference below which an appearance is no news, as in the lock.
const NEWS: f64 = 0.06;
/// Time between two appearances of a person from which on their difference tells how much the person
/// changes, s.
const APART_S: f64 = 1.0;
/// Least standard deviation of a difference, of height in m: a few sightings of a person at rest hardly
/// vary.
const LEAST_DEVIATION: f64 = 0.03;
/// Difference in height at which the kernel has fallen to 0.6, m.
const HEIGHT_M: f64 = 0.05;
/// Squared distance of appearances without a part in common.
const UNKNOWN: f64 = 0.5;

/// Weighing of the appearance of somebody against what is remembered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Way {
    /// The lock: its weights are the same for everybody.
    Fixed,
    /// Ridge regression with the appearances of the person as +1 and those of others as -1, added to the
    /// lock. The kernel falls with the mean squared Hellinger distance and with the difference in height.
    Ridge {
        /// Decay of the kernel with the mean squared distance.
        decay: f64,
        /// Penalty.
        lambda: f64,
        /// Log-odds of +1.
        weight: f64,
    },
    /// The lock with neutral differences and weights by the spread of this person's differences and of
    /// those to others.
    Metric {
        /// Number of appearances that the fixed weights count as.
        prior: f64,
    },
}

/// Memory of one person and of all others, until a moment.
pub(super) struct Known {
    /// The person.
    pub(super) person: i64,
    memory: AppearanceMemory,
    /// Appearances of both memories, those of the person first.
    kept: Vec<Appearance>,
    /// Number of those.
    own: usize,
    /// Their distances from each other.
    distances: DMatrix<Distance>,
    /// Differences of the person's appearances from what the memory would have without them, and those
    /// of others.
    spread: [Vec<[Option<f64>; PARTS]>; 2],
}

/// Torso, legs, texture and height.
const PARTS: usize = 4;

/// Mean squared Hellinger distance of the known parts, and the difference in height, m.
type Distance = (f64, f64);

impl Known {
    /// Remembers a person and all others among sightings, in the order of time.
    pub(super) fn new(person: i64, seen: &[Sighting]) -> Self {
        let mut memory = AppearanceMemory::default();
        let mut of_person = Vec::new();
        let mut of_others = Vec::new();
        for sighting in seen {
            if sighting.person == person {
                memory.learn(sighting.looks.clone());
                of_person.push(sighting);
            } else {
                memory.learn_other(sighting.looks.clone());
                of_others.push(sighting);
            }
        }
        let mut kept = remembered(&of_person, KEPT);
        let own = kept.len();
        kept.extend(remembered(&of_others, 0));
        let distances =
            DMatrix::from_fn(kept.len(), kept.len(), |i, j| distance(&kept[i], &kept[j]));
        let spread = [&of_person, &of_others].map(|of| spread(of, &of_person));
        Self { person, memory, kept, own, distances, spread }
    }

    /// Returns the log-odds that each of the candidates is the person.
    pub(super) fn log_odds(&self, way: Way, candidates: &[&Appearance]) -> Vec<f64> {
        let fixed = self.by_settings(&LooksSettings::default(), candidates);
        match way {
            Way::Fixed => fixed,
            Way::Metric { prior } => self.by_settings(&self.metric(prior), candidates),
            Way::Ridge { decay, lambda, weight } => {
                let Some(alpha) = self.ridge(decay, lambda) else { return fixed };
                let learnt = candidates.iter().map(|looks| self.response(&alpha, decay, looks));
                fixed.iter().zip(learnt).map(|(fixed, learnt)| fixed + weight * learnt).collect()
            }
        }
    }

    fn by_settings(&self, settings: &LooksSettings, candidates: &[&Appearance]) -> Vec<f64> {
        let differences = candidates.iter().map(|looks| self.memory.differences(looks));
        differences.map(|found| found.map_or(0.0, |found| found.log_odds(settings))).collect()
    }

    /// Returns the coefficients of the ridge regression; `None` without others.
    fn ridge(&self, decay: f64, lambda: f64) -> Option<DVector<f64>> {
        let all = self.kept.len();
        let others = all - self.own;
        if others == 0 || self.own == 0 {
            return None;
        }
        let mut gram = self.distances.map(|distance| kernel(distance, decay));
        for i in 0..all {
            // Both classes count the same, however many appearances each has.
            let of_class = if i < self.own { self.own } else { others };
            gram[(i, i)] += lambda * 2.0 * of_class as f64 / all as f64;
        }
        let targets = DVector::from_fn(all, |i, _| if i < self.own { 1.0 } else { -1.0 });
        gram.lu().solve(&targets)
    }

    fn response(&self, alpha: &DVector<f64>, decay: f64, looks: &Appearance) -> f64 {
        let terms = self.kept.iter().zip(alpha.iter());
        terms.map(|(kept, weight)| weight * kernel(distance(kept, looks), decay)).sum()
    }

    /// Returns the settings of the lock, learnt from the differences seen so far.
    fn metric(&self, prior: f64) -> LooksSettings {
        let fixed = LooksSettings::default();
        LooksSettings {
            torso: self.term(0, fixed.torso, prior),
            legs: self.term(1, fixed.legs, prior),
            texture: self.term(2, fixed.texture, prior),
            height: self.term(3, fixed.height, prior),
            ..fixed
        }
    }

    /// Returns the neutral difference and the weight of a part: those of two normal distributions with
    /// one variance, drawn towards the fixed ones.
    fn term(&self, part: usize, fixed: [f64; 2], prior: f64) -> [f64; 2] {
        let [within, between] =
            [0, 1].map(|of| self.spread[of].iter().filter_map(|parts| parts[part]).collect());
        let (Some((near, near_variance)), Some((far, far_variance))) =
            (moments(within), moments(between))
        else {
            return fixed;
        };
        let variance = (0.5 * (near_variance + far_variance)).max(LEAST_DEVIATION.powi(2));
        let weight = ((far - near) / variance).max(0.0);
        let count = self.spread[0].len().min(self.spread[1].len()) as f64;
        let share = count / (count + prior);
        let learnt = [0.5 * (near + far), weight];
        [0, 1].map(|i| share * learnt[i] + (1.0 - share) * fixed[i])
    }
}

/// Returns mean and variance; `None` for less than three values.
fn moments(values: Vec<f64>) -> Option<(f64, f64)> {
    let (mean, deviation) = tagalong_math::mean_and_deviation(&values)?;
    (values.len() >= 3).then_some((mean, deviation * deviation))
}

/// Returns the long memory of sightings, and the short one after it.
fn remembered(seen: &[&Sighting], kept: usize) -> Vec<Appearance> {
    let mut all: Vec<Appearance> = Vec::new();
    for sighting in seen {
        let mut known = all.iter().map(|known| sighting.looks.difference(known).mean());
        if known.any(|difference| difference.is_none_or(|difference| difference <= NEWS)) {
            continue;
        }
        if all.len() == LONG {
            all.remove(kept);
        }
        all.push(sighting.looks.clone());
    }
    all.extend(seen.iter().rev().take(SHORT).map(|sighting| sighting.looks.clone()));
    all
}

/// Returns the distance of two appearances.
fn distance(a: &Appearance, b: &Appearance) -> Distance {
    let difference = a.difference(b);
    let parts = [difference.torso, difference.legs, difference.texture];
    let squares: Vec<f64> = parts.into_iter().flatten().map(|part| part * part).collect();
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    (if squares.is_empty() { UNKNOWN } else { mean }, a.height_m - b.height_m)
}

fn kernel((square, height_m): Distance, decay: f64) -> f64 {
    (-decay * square - 0.5 * (height_m / HEIGHT_M).powi(2)).exp()
}

/// Returns the differences of sightings from the person's at other times: of the most alike one, and
/// from the mean height.
fn spread(of: &[&Sighting], of_person: &[&Sighting]) -> Vec<[Option<f64>; PARTS]> {
    let height_m = of_person.iter().map(|sighting| sighting.looks.height_m).sum::<f64>()
        / of_person.len() as f64;
    let each = of.iter().filter_map(|sighting| {
        let apart = of_person.iter().filter(|other| (other.at_s - sighting.at_s).abs() >= APART_S);
        let found = apart.filter_map(|other| {
            let difference = sighting.looks.difference(&other.looks);
            Some((difference.mean()?, difference))
        });
        let (_, nearest) = found.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let height_m = (sighting.looks.height_m - height_m).abs();
        Some([nearest.torso, nearest.legs, nearest.texture, Some(height_m)])
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sighting(frame: u64, person: i64, colour: usize) -> Sighting {
        let looks = Appearance::in_one_colour(1.6, Some(colour));
        Sighting { frame, at_s: frame as f64, person, looks }
    }

    fn known() -> Known {
        let seen: Vec<Sighting> =
            (0..6).flat_map(|frame| [sighting(frame, 1, 3), sighting(frame, 2, 7)]).collect();
        Known::new(1, &seen)
    }

    #[test]
    fn both_classifiers_speak_for_the_person_and_against_others() {
        let known = known();
        let [own, other] = [3, 7].map(|colour| Appearance::in_one_colour(1.6, Some(colour)));
        let fixed = known.log_odds(Way::Fixed, &[&own, &other]);
        for way in [Way::Ridge { decay: 6.0, lambda: 0.1, weight: 4.0 }, Way::Metric { prior: 2.0 }]
        {
            let learnt = known.log_odds(way, &[&own, &other]);
            assert!(learnt[0] > fixed[0] && learnt[1] < fixed[1], "{way:?}: {learnt:?}, {fixed:?}");
        }
    }

    #[test]
    fn a_ridge_of_disjoint_colours_answers_with_the_targets() {
        let known = known();
        let alpha = known.ridge(30.0, 0.001).expect("there are others");
        for (colour, target) in [(3, 1.0), (7, -1.0), (11, 0.0)] {
            let looks = Appearance::in_one_colour(1.6, Some(colour));
            assert!((known.response(&alpha, 30.0, &looks) - target).abs() < 1e-2, "{colour}");
        }
    }

    #[test]
    fn without_others_the_fixed_weights_decide() {
        let seen: Vec<Sighting> = (0..6).map(|frame| sighting(frame, 1, 3)).collect();
        let known = Known::new(1, &seen);
        let looks = Appearance::in_one_colour(1.7, Some(4));
        let fixed = known.log_odds(Way::Fixed, &[&looks]);
        assert!(fixed[0] < 0.0, "{fixed:?}");
        assert_eq!(
            known.log_odds(Way::Ridge { decay: 6.0, lambda: 1.0, weight: 8.0 }, &[&looks]),
            fixed
        );
    }

    #[test]
    fn a_metric_draws_weights_towards_what_it_saw() {
        let known = known();
        let fixed = LooksSettings::default();
        // Torsos never differ within the person, and wholly between people.
        let learnt = known.metric(0.0).torso;
        assert!((learnt[0] - 0.5).abs() < 1e-9 && learnt[1] > 100.0, "{learnt:?}");
        let half = known.metric(6.0).torso;
        assert!((half[0] - 0.5 * (0.5 + fixed.torso[0])).abs() < 1e-9, "{half:?}");
        assert_eq!(known.metric(6.0).legs, fixed.legs, "no legs were seen");
    }
}
