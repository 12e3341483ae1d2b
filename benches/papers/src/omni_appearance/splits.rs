//! Training and test samples of one room.

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

use tagalong_learn::mix;
use tagalong_omni_appearance::train::Sample;

/// Part of the samples, or of the sectors, that is used for training (P5, section 4.4).
const TRAINING_PART: f64 = 0.3;
/// Number of sectors around the robot. Each has near and far samples, so that the split holds out
/// sectors and no range of distances.
const SECTORS: u64 = 12;

/// Method of dividing the samples of one room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Split {
    /// At random, as in the paper: most images of the test have a neighbour in the training, a
    /// third of a second away.
    Random,
    /// By the sector of the person.
    Place,
    /// By sector and person.
    PlaceAndPerson,
}

impl Split {
    /// Returns samples for training, and for testing.
    pub(super) fn divide(self, samples: &[Sample], seed: u64) -> [Vec<Sample>; 2] {
        let places = match self {
            Self::Random => BTreeSet::new(),
            Self::Place => chosen(0..SECTORS, TRAINING_PART, seed),
            // With one person of two, half of the sectors give about as many samples as the other
            // splits.
            Self::PlaceAndPerson => chosen(0..SECTORS, 0.5, seed),
        };
        let numbers = chosen(0..samples.len() as u64, TRAINING_PART, seed);
        let people: BTreeSet<u64> = samples.iter().map(|sample| sample.person).collect();
        let who = people.iter().nth((seed % people.len().max(1) as u64) as usize);
        let [mut training, mut test] = [const { Vec::new() }; 2];
        for (number, sample) in (0..).zip(samples) {
            let is_place = places.contains(&sector(sample));
            let (is_training, is_test) = match self {
                Self::Random => (numbers.contains(&number), !numbers.contains(&number)),
                Self::Place => (is_place, !is_place),
                Self::PlaceAndPerson => {
                    let is_who = Some(&sample.person) == who;
                    (is_place && is_who, !is_place && !is_who)
                }
            };
            if is_training {
                training.push(*sample);
            } else if is_test {
                test.push(*sample);
            }
        }
        [training, test]
    }
}

/// Returns the sector of the person in a sample.
fn sector(sample: &Sample) -> u64 {
    let turn = (sample.true_bearing_rad + PI) / TAU;
    // A bearing of exactly pi would give one sector too many.
    ((turn * SECTORS as f64) as u64).min(SECTORS - 1)
}

/// Returns a random part of some keys.
fn chosen(keys: std::ops::Range<u64>, part: f64, seed: u64) -> BTreeSet<u64> {
    let count = (part * (keys.end - keys.start) as f64).round() as usize;
    // The keys are small, so that the shifted seed does not overlap them.
    // A shuffle by seed: the keys are sorted by a hash of key and seed.
    let mut order: Vec<(u64, u64)> = keys.map(|key| (mix(key ^ (seed << 40)), key)).collect();
    order.sort_unstable();
    order.into_iter().take(count).map(|(_, key)| key).collect()
}

#[cfg(test)]
mod tests {
    use tagalong_omni_appearance::Features;

    use super::*;

    /// Samples of two people that go round the robot, one after the other.
    fn samples() -> Vec<Sample> {
        let features = Features {
            width: 9.0,
            bottom: 9.0,
            pixels: 99.0,
            top: 9.0,
            middle: 9.0,
            core: 9.0,
            low: 9.0,
        };
        let mut samples = Vec::new();
        for frame in 0..240 {
            let bearing_rad = 0.07 * frame as f64 - PI * (frame as f64 * 0.07 / PI).floor() * 2.0;
            let (sine, cosine) = bearing_rad.sin_cos();
            samples.push(Sample {
                features,
                floor_m: 2.0,
                looks: [0.0; 4],
                distance_m: 2.0,
                bearing_rad: 0.0,
                true_bearing_rad: sine.atan2(cosine),
                person: frame / 120,
                frame,
            });
        }
        samples
    }

    #[test]
    fn training_and_test_share_what_the_split_says_and_no_more() {
        let all = samples();
        for seed in 0..6 {
            for split in [Split::Random, Split::Place, Split::PlaceAndPerson] {
                let [training, test] = split.divide(&all, seed);
                let keys: [fn(&Sample) -> u64; 3] =
                    [sector, |sample| sample.person, |sample| sample.frame];
                let [places, people, frames] = keys.map(|key| {
                    let [training, test] = [&training, &test]
                        .map(|part| part.iter().map(key).collect::<BTreeSet<u64>>());
                    training.intersection(&test).count()
                });
                let shared = match split {
                    Split::Random => places > 8 && people == 2,
                    Split::Place => places == 0 && people == 2,
                    Split::PlaceAndPerson => places == 0 && people == 0,
                };
                assert!(shared, "{split:?}: {places} places, {people} people");
                assert_eq!(frames, 0);
                assert!(training.len() > 40 && test.len() > 40, "{split:?}");
                assert_eq!(split.divide(&all, seed), [training, test]);
            }
        }
        for split in [Split::Random, Split::Place] {
            assert_eq!(split.divide(&all, 1).concat().len(), 240);
        }
        assert_eq!(Split::Random.divide(&all, 1)[0].len(), 72);
    }

    #[test]
    fn repeats_differ() {
        let all = samples();
        assert_ne!(Split::Place.divide(&all, 0), Split::Place.divide(&all, 1));
        let [one, other] = [0, 1].map(|seed| Split::PlaceAndPerson.divide(&all, seed)[0][0].person);
        assert_ne!(one, other);
    }
}
