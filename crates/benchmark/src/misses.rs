//! People without a track, and the test that dropped the candidate there.

use std::collections::{BTreeMap, BTreeSet};

use tagalong_eval::{Match, Prepared, Region, Role, Sequence};
use tagalong_geometry::{Camera, Rect};
use tagalong_pipeline::{Fate, FrameReport};
use tagalong_report::MissedPerson;

/// Largest factor between the widths of a person's box and of a candidate for that person.
const SIMILAR: f64 = 2.0;

/// Place at which a candidate was dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
struct DroppedPlace {
    test: &'static str,
    /// Position of the test among those of the frame.
    rank: u16,
    /// Left, top, width, height; single precision halves the memory of a long log.
    box_px: [f32; 4],
}

/// Places at which candidates were dropped, by the number of the frame.
#[derive(Debug, Default)]
pub struct DroppedPlaces {
    frames: BTreeMap<u32, Vec<DroppedPlace>>,
}

impl DroppedPlaces {
    /// Adds those of a frame.
    pub fn take(&mut self, number: u32, report: &FrameReport, camera: &Camera) {
        let entries = report.funnel.entries();
        let candidates = report.candidates.iter().filter_map(|candidate| match candidate.fate {
            Fate::Dropped(test) => Some((test, candidate.detection.rect_in(camera))),
            _ => None,
        });
        let places = entries.iter().flat_map(|e| e.places.iter().map(move |rect| (e.test, *rect)));
        let all = candidates.chain(places).filter(|(_, rect)| rect.area() > 0.0);
        let all = all.map(|(test, rect)| {
            let rank = entries.iter().position(|entry| entry.test == test);
            let rank = u16::try_from(rank.unwrap_or(entries.len())).unwrap_or(u16::MAX);
            let box_px = [rect.x, rect.y, rect.width, rect.height].map(|v| v as f32);
            DroppedPlace { test, rank, box_px }
        });
        self.frames.entry(number).or_default().extend(all);
    }

    /// Returns the place that came nearest to becoming a track on a person: by the last test, and
    /// of several by the distance.
    fn at(&self, number: u32, person: &Region) -> Option<&DroppedPlace> {
        let places = self.frames.get(&number)?.iter();
        let near = places.filter_map(|place| Some((distance_px(place, person)?, place)));
        let best = near.min_by(|a, b| b.1.rank.cmp(&a.1.rank).then(a.0.total_cmp(&b.0)));
        best.map(|(_, place)| place)
    }
}

/// Returns the distance of the centres of a place and a person; `None` if it is of another thing.
fn distance_px(place: &DroppedPlace, person: &Region) -> Option<f64> {
    let [x, y, width, height] = place.box_px.map(f64::from);
    let centre = Rect::new(x, y, width, height).centre();
    let person = Rect::new(person.x, person.y, person.width, person.height);
    let ratio = width / person.width.max(1.0);
    let is_similar = (1.0 / SIMILAR..=SIMILAR).contains(&ratio);
    (is_similar && person.contains(centre)).then(|| (centre - person.centre()).norm())
}

/// Returns the people that count and have no track in a frame, with the tests that dropped them.
pub fn missed(
    sequence: &Sequence,
    prepared: &Prepared,
    matches: &[Vec<Match>],
    places: &DroppedPlaces,
) -> Vec<MissedPerson> {
    let mut all = Vec::new();
    for (((number, frame), compared), matches) in
        (1..).zip(&sequence.frames).zip(&prepared.frames).zip(matches)
    {
        let found: BTreeSet<i64> = matches
            .iter()
            .map(|m| prepared.truth_ids[compared.truths[m.row as usize] as usize])
            .collect();
        for truth in &compared.truths {
            let person = prepared.truth_ids[*truth as usize];
            let counts = frame.truths.iter().any(|t| t.id == person && t.role == Role::Counts);
            if found.contains(&person) || !counts {
                continue;
            }
            let truth = frame.truths.iter().find(|truth| truth.id == person);
            let place = truth.and_then(|t| t.region).and_then(|at| places.at(number, &at));
            all.push(MissedPerson {
                frame: u64::from(number),
                person,
                test: place.map(|place| place.test.to_owned()),
                box_px: place
                    .map(|place| place.box_px.map(|v| (f64::from(v) * 10.0).round() / 10.0)),
            });
        }
    }
    all
}

/// Most moments of one task that get an image.
const MOST_MOMENTS: usize = 3;

/// Returns the frames in the middle of the longest times in which a person is missed.
pub fn moments(missed: &[MissedPerson]) -> BTreeSet<u64> {
    let mut by_person: BTreeMap<i64, Vec<u64>> = BTreeMap::new();
    for one in missed {
        by_person.entry(one.person).or_default().push(one.frame);
    }
    let mut times: Vec<(usize, u64)> = Vec::new();
    for frames in by_person.values() {
        let runs = frames.chunk_by(|a, b| b - a == 1);
        times.extend(runs.map(|run| (run.len(), run[run.len() / 2])));
    }
    times.sort_by_key(|(length, frame)| (std::cmp::Reverse(*length), *frame));
    times.into_iter().take(MOST_MOMENTS).map(|(_, frame)| frame).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(test: &'static str, rank: u16, x: f32, side: f32) -> DroppedPlace {
        DroppedPlace { test, rank, box_px: [x, 10.0, side, side] }
    }

    fn person() -> Region {
        Region { x: 100.0, y: 10.0, width: 50.0, height: 50.0 }
    }

    #[test]
    fn the_last_test_at_the_person_is_the_reason() {
        let mut places = DroppedPlaces::default();
        places.frames.insert(
            3,
            vec![
                place("size", 0, 101.0, 50.0),
                place("verifier", 4, 112.0, 50.0),
                place("verifier", 4, 108.0, 50.0),
                // Elsewhere, and of another size.
                place("gate", 9, 160.0, 50.0),
                place("gate", 9, 110.0, 20.0),
            ],
        );
        let found = places.at(3, &person()).unwrap();
        assert_eq!((found.test, found.box_px[0]), ("verifier", 108.0));
        assert_eq!(places.at(4, &person()), None);
    }

    #[test]
    fn the_longest_misses_get_images() {
        let mut missed = Vec::new();
        for (person, frames) in [(1, 5..8), (1, 20..21), (2, 30..40), (2, 50..52), (3, 7..9)] {
            for frame in frames {
                missed.push(MissedPerson { frame, person, ..MissedPerson::default() });
            }
        }
        assert_eq!(moments(&missed).into_iter().collect::<Vec<_>>(), [6, 8, 35]);
        assert!(moments(&[]).is_empty());
    }
}
