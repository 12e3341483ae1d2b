//! Scores of the outputs: recall, false positives per frame, position error.

use super::Sample;
use super::targets::surfaces_m2;
use crate::{FloorMap, Pass, Peak, peaks};

/// Peaks from these log-odds on are counted.
const LEAST: f64 = -4.0;
/// A peak finds a person up to this distance on the floor, m.
const SAME_M: f64 = 0.4;
/// A peak this near to an annotated person is not false, m.
const NEAR_M: f64 = 0.6;
/// Two peaks are this far apart, m.
const SEPARATION_M: f64 = 0.4;
/// People up to this distance are counted, m ...
const COUNTED_M: f64 = 5.0;
/// ... with this visible surface, m² ...
const SEEN_M2: f64 = 0.03;
/// ... and this fraction of the upper body.
const VISIBLE: f64 = 0.5;
/// False people per frame at which the recall is given.
const FALSE_A_FRAME: f64 = 0.05;

/// Answers of a network to annotated frames.
#[derive(Clone, Debug, Default)]
pub struct Score {
    frames: usize,
    people: usize,
    /// Uncalibrated log-odds of each peak, whether it is a person, and how far off, m.
    found: Vec<(f64, bool, f64)>,
}

impl Score {
    /// Adds the answer to a sample.
    pub fn add(&mut self, map: &FloorMap, pass: &Pass, sample: &Sample) {
        let surfaces = surfaces_m2(&sample.people, &sample.camera, &sample.depth());
        let mut missing: Vec<usize> = (0..sample.people.len())
            .filter(|k| {
                let person = &sample.people[*k];
                let is_seen = surfaces[*k] > SEEN_M2 && person.visible >= VISIBLE;
                person.counts && is_seen && person.head.xy().coords.norm() < COUNTED_M
            })
            .collect();
        self.frames += 1;
        self.people += missing.len();
        for peak in peaks(map, pass, LEAST, SEPARATION_M) {
            let nearest = (0..missing.len())
                .map(|at| (at, peak.distance_m(&sample.people[missing[at]].head.xy())))
                .min_by(|(_, a), (_, b)| a.total_cmp(b));
            match nearest.filter(|(_, off_m)| *off_m < SAME_M) {
                Some((at, off_m)) => {
                    missing.swap_remove(at);
                    self.found.push((peak.logit, true, off_m));
                }
                None => self.add_false(&peak, sample),
            }
        }
    }

    fn add_false(&mut self, peak: &Peak, sample: &Sample) {
        let mut heads = sample.people.iter().map(|person| person.head.xy());
        if !heads.any(|head| peak.distance_m(&head) < NEAR_M) {
            self.found.push((peak.logit, false, 0.0));
        }
    }

    /// Returns the score of some peaks: log-odds, whether it is a person, and how far off, m.
    #[cfg(test)]
    pub(super) fn of(found: Vec<(f64, bool, f64)>) -> Self {
        Self { frames: 1, people: found.len(), found }
    }

    /// Joins the answers of several scores.
    pub fn all(scores: &[&Self]) -> Self {
        Self {
            frames: scores.iter().map(|score| score.frames).sum(),
            people: scores.iter().map(|score| score.people).sum(),
            found: scores.iter().flat_map(|score| score.found.iter().copied()).collect(),
        }
    }

    /// Returns uncalibrated log-odds, and whether they are of a person.
    pub fn answers(&self) -> Vec<(f64, bool)> {
        self.found.iter().map(|(logit, is_person, _)| (*logit, *is_person)).collect()
    }

    /// Returns recall and false people per frame of peaks with at least these log-odds.
    fn at(&self, least: f64) -> (f64, f64) {
        fn of(count: usize, all: usize) -> f64 {
            count as f64 / all.max(1) as f64
        }

        let [found, wrong] = [true, false].map(|is_person| {
            let of_kind = self.found.iter().filter(|(_, person, _)| *person == is_person);
            of_kind.filter(|(logit, ..)| *logit >= least).count()
        });
        (of(found, self.people), of(wrong, self.frames))
    }

    /// Returns the best recall with few false people.
    fn best_recall(&self) -> f64 {
        let tried = self.found.iter().map(|(logit, ..)| self.at(*logit));
        tried
            .filter(|(_, wrong)| *wrong <= FALSE_A_FRAME)
            .map(|(recall, _)| recall)
            .fold(0.0, f64::max)
    }

    /// Returns the figures for a card.
    pub fn figures(&self) -> toml::Table {
        fn rounded(value: f64) -> toml::Value {
            toml::Value::from((value * 1e3).round() / 1e3)
        }
        let (recall, wrong) = self.at(0.0);
        let off: Vec<f64> =
            self.found.iter().filter(|(l, is, _)| *is && *l >= 0.0).map(|(.., off)| *off).collect();
        toml::Table::from_iter([
            ("frames".to_owned(), (self.frames as i64).into()),
            ("people".to_owned(), (self.people as i64).into()),
            ("recall".to_owned(), rounded(recall)),
            ("false_a_frame".to_owned(), rounded(wrong)),
            ("recall_at_false_0.05".to_owned(), rounded(self.best_recall())),
            ("off_m".to_owned(), rounded(off.iter().sum::<f64>() / off.len().max(1) as f64)),
        ])
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Point3;
    use tagalong_config::AnnotatedPerson;
    use tagalong_core::{DepthImage, EgoMotion, Frame, Images, Stamp};
    use tagalong_geometry::{Camera, Pinhole};

    use super::*;

    /// Returns a sample of a wall 3 m away with people; each is a place, whether it counts, and
    /// the visible part.
    fn sample(people: &[([f64; 2], bool, f64)]) -> Sample {
        fn person(([x, y], counts, visible): &([f64; 2], bool, f64)) -> AnnotatedPerson {
            AnnotatedPerson::new(Point3::new(*x, *y, 1.6))
                .with_counts(*counts)
                .with_visible(*visible)
        }

        let camera =
            Arc::new(Camera::mounted(Pinhole::centred(120.0, 320, 240), 320, 240, 1.1, 0.0, 0.0));
        let depth = Some(Arc::new(DepthImage::filled(320, 240, 3.0)));
        let images = Images { depth, ..Images::default() };
        let frame = Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), images);
        let people: Vec<AnnotatedPerson> = people.iter().map(person).collect();
        Sample::new(&frame, &people, None, 0).unwrap()
    }

    /// Returns the score of an answer with a peak of these log-odds at each place, and none
    /// elsewhere.
    fn score(sample: &Sample, found: &[([f64; 2], f32)]) -> Score {
        let map = FloorMap::new(&sample.camera, &sample.depth());
        let mut pass = Pass::default();
        pass.answer.values.as_chunks_mut::<4>().0.iter_mut().for_each(|cell| cell[0] = -9.0);
        for ([x, y], logit) in found {
            let [row, column] = [(x - 0.2) / 0.1, (y + 3.2) / 0.1].map(|at| at as usize);
            let centre = FloorMap::centre(row, column);
            let off = [(x - centre.x) as f32, (y - centre.y) as f32];
            *pass.answer.at_mut(row, column) = [*logit, off[0], off[1], 0.1];
        }
        let mut score = Score::default();
        score.add(&map, &pass, sample);
        score
    }

    const HERE: [f64; 2] = [3.0, 0.0];

    #[test]
    fn a_peak_finds_the_nearest_person_within_its_reach_once() {
        let people = sample(&[(HERE, true, 1.0), ([3.0, 0.7], true, 1.0)]);
        let found = score(&people, &[([3.0, 0.1], 2.0), ([3.0, 0.75], 1.0)]);
        assert_eq!((found.frames, found.people), (1, 2));
        let off: Vec<f64> = found.found.iter().map(|(.., off)| (off * 1e3).round()).collect();
        assert_eq!((off, found.at(0.0)), (vec![100.0, 50.0], (1.0, 0.0)));
        // Both peaks are near the first person, and each person is found once; the second peak is
        // too near to be false.
        let twice = score(&people, &[([3.2, -0.2], 2.0), ([2.7, -0.2], 1.0)]);
        assert_eq!(twice.at(0.0), (0.5, 0.0));
        assert_eq!(twice.answers(), [(2.0, true)]);
        // Half a metre away is neither found nor false.
        let beside = score(&people, &[([3.0, -0.5], 2.0)]);
        assert_eq!((beside.at(0.0), beside.found.len()), ((0.0, 0.0), 0));
        let wrong = score(&people, &[([3.0, -0.7], 2.0), ([3.0, -1.5], -3.0)]);
        assert_eq!((wrong.at(0.0), wrong.at(-4.0)), ((0.0, 1.0), (0.0, 2.0)));
        assert!(score(&people, &[([3.0, 0.0], -4.5)]).found.is_empty(), "too low to be counted");
    }

    #[test]
    fn people_count_if_they_are_near_and_seen() {
        fn counted(at: [f64; 2], counts: bool, visible: f64) -> usize {
            let sample = sample(&[(at, counts, visible)]);
            let found = score(&sample, &[(at, 2.0)]);
            // A peak at a person that does not count is neither found nor false.
            assert_eq!(found.found.len(), found.people, "{at:?}");
            found.people
        }

        assert_eq!(counted(HERE, true, 1.0), 1);
        assert_eq!(counted(HERE, true, VISIBLE), 1);
        assert_eq!(counted(HERE, true, VISIBLE - 0.01), 0, "hidden for the most part");
        assert_eq!(counted(HERE, false, 1.0), 0, "not to be counted");
        assert_eq!(counted([4.0, 0.0], true, 1.0), 0, "behind the wall");
        assert_eq!(counted([3.0, 3.0], true, 1.0), 1, "4.2 m away");
        let far = sample(&[([3.05, 4.1], true, 1.0)]);
        assert_eq!(score(&far, &[]).people, 0, "5.1 m away");
    }

    #[test]
    fn recall_and_false_people_depend_on_the_threshold() {
        let found = vec![(3.0, true, 0.1), (2.0, false, 0.0), (1.0, true, 0.3), (-1.0, true, 0.0)];
        let score = Score { frames: 10, people: 4, found };
        assert_eq!(score.at(0.0), (0.5, 0.1));
        assert_eq!(score.at(-2.0), (0.75, 0.1));
        // One false person in ten frames is too many.
        assert_eq!(score.best_recall(), 0.25);
        let figures = score.figures();
        assert_eq!(figures["recall"].as_float(), Some(0.5));
        assert_eq!(figures["off_m"].as_float(), Some(0.2));
        let empty = Score { frames: 10, people: 0, found: Vec::new() };
        let both = Score::all(&[&score, &empty]);
        assert_eq!((both.best_recall(), both.answers().len()), (0.75, 4));
    }
}
