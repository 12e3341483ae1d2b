//! Cause why a person has no reported track in a frame. The page of `view`, the report of `bench`
//! and `doctor` all use this rule, and show the same sentence.
//!
//! A [`Witness`] records the results of a run for each frame; [`find_missed`] uses them for each
//! person that a comparison with the truth misses, and [`Witness::cause_at`] for any other
//! position.

mod depths;
mod witness;

use std::collections::{BTreeMap, BTreeSet};

use tagalong_eval::{Match, Prepared, Role, Sequence};
use tagalong_geometry::Rect;
use toml::Table;

use crate::frame_notes::MeasuredValue;
use crate::remedies::{Remedies, number, sections};

use witness::{DroppedPlace, EndedTrack, OF_SCORE};

pub use depths::Depths;
pub use witness::{SightedTrack, TrackStage, Witness};

/// Test that a detection near a known person fails if that person has a better one. It gives no
/// information about other people there.
const NOT_BEST: &str = "not the best detection";

/// Test that a track fails while its manager has not confirmed it.
const NOT_CONFIRMED: &str = "track: not confirmed";

/// End of the sentence about a track that is seen at a person that the comparison misses.
const BESIDE: &str = "is seen here, but too far from the annotated person to count as found";

/// Time after which the previous track of a person is no longer mentioned, ns.
const RECENT_NS: i64 = 2_000_000_000;

/// Returns true for a test that gives information about the person where it dropped a candidate.
pub fn is_telling(test: &str) -> bool {
    test != NOT_BEST
}

/// Config of a run, and the settings of the tests.
#[derive(Clone, Copy, Debug)]
pub struct Rules<'a> {
    /// Settings of the tests.
    pub remedies: &'a Remedies,
    /// Resolved config of the run.
    pub config: &'a Table,
}

/// Position of a person, as far as it is known.
#[derive(Clone, Copy, Debug, Default)]
pub struct PersonAt {
    /// Box of head and shoulders, pixels.
    pub rect: Option<Rect>,
    /// Position on the floor, odometry frame, m.
    pub floor_m: Option<[f64; 2]>,
}

/// Previous track of a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Former {
    id: i64,
    stamp_ns: i64,
}

/// Cause why a person has no reported track.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cause {
    /// Test that dropped the candidate at the person; `None` for other causes.
    pub test: Option<String>,
    /// Name of the cause in a table: the test, or a few words.
    pub name: String,
    /// Box of that candidate, pixels: left, top, width, height.
    pub box_px: Option<[f64; 4]>,
    /// Cause as a sentence, without the tracks and the candidate's value: the same for all people
    /// whose cause has the same name.
    pub why: String,
    /// The whole sentence, with the value that was measured for this candidate.
    pub text: String,
}

/// Person without a reported track in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Missed {
    /// Index of the frame in the sequence.
    pub at: usize,
    /// ID of the person in the truth.
    pub person: i64,
    /// The cause.
    pub cause: Cause,
}

/// Returns the people that count and have no track, frame by frame, each with the cause. The
/// witness has the frames of the sequence by number, from 1.
pub fn find_missed(
    sequence: &Sequence,
    prepared: &Prepared,
    matches: &[Vec<Match>],
    witness: &Witness,
    rules: Rules<'_>,
) -> Vec<Missed> {
    let mut all = Vec::new();
    let mut former: BTreeMap<i64, Former> = BTreeMap::new();
    let frames = sequence.frames.iter().zip(&prepared.frames).zip(matches).enumerate();
    for (at, ((frame, compared), matches)) in frames {
        let mut found = BTreeSet::new();
        let mut taken = BTreeSet::new();
        for pair in matches {
            let person = prepared.truth_ids[compared.truths[pair.row as usize] as usize];
            let id = prepared.track_ids[compared.tracks[pair.col as usize] as usize];
            former.insert(person, Former { id, stamp_ns: frame.stamp_ns });
            found.insert(person);
            taken.insert(id);
        }
        for truth in frame.truths.iter().filter(|truth| truth.role == Role::Counts) {
            let is_compared =
                compared.truths.iter().any(|row| prepared.truth_ids[*row as usize] == truth.id);
            if found.contains(&truth.id) || !is_compared {
                continue;
            }
            let number = at as u64 + 1;
            let place = PersonAt {
                rect: truth.region.map(|r| Rect::new(r.x, r.y, r.width, r.height)),
                floor_m: truth.floor_m.and_then(|floor| witness.in_odom(number, floor)),
            };
            let last = former.get(&truth.id).copied();
            let last = last.filter(|last| frame.stamp_ns - last.stamp_ns <= RECENT_NS);
            let cause = witness.explain(number, &place, &taken, last, rules);
            all.push(Missed { at, person: truth.id, cause });
        }
    }
    all
}

/// Returns the sentences of causes, each once, and for each cause the index of its sentence.
pub fn sentences_of(missed: &[Missed]) -> (Vec<String>, Vec<usize>) {
    let mut sentences: Vec<String> = Vec::new();
    let mut known: BTreeMap<&str, usize> = BTreeMap::new();
    let mut places = Vec::new();
    for Missed { cause, .. } in missed {
        let place = *known.entry(&cause.text).or_insert(sentences.len());
        if place == sentences.len() {
            sentences.push(cause.text.clone());
        }
        places.push(place);
    }
    (sentences, places)
}

impl Witness {
    /// Returns the cause why no person is reported at a position. Tracks that are seen at other
    /// positions and overlap it in the image are other people.
    pub fn cause_at(&self, number: u64, place: &PersonAt, rules: Rules<'_>) -> Cause {
        let seen = self.tracks(number).iter().filter(|track| track.stage == TrackStage::Seen);
        let taken = seen.map(|track| i64::from(track.id)).collect();
        self.explain(number, place, &taken, None, rules)
    }

    fn explain(
        &self,
        number: u64,
        place: &PersonAt,
        taken: &BTreeSet<i64>,
        former: Option<Former>,
        rules: Rules<'_>,
    ) -> Cause {
        let here = self.track_at(number, place, taken);
        if let Some(track) = here {
            let id = track.id;
            if track.stage == TrackStage::Seen {
                return Cause {
                    name: "beside the person".to_owned(),
                    why: format!("a track {BESIDE}"),
                    text: format!("Track {id} {BESIDE}."),
                    ..Cause::default()
                };
            }
            if track.stage == TrackStage::Tentative {
                return Cause::of_unconfirmed(id, rules);
            }
        }
        if here.is_none()
            && let Some(ended) = self.ended_at(number, place)
        {
            return Cause::of_ended(ended, rules);
        }
        let (cause, why) = self.dropped_or_measured(number, place, taken, rules);
        let lead = match (here, former) {
            (Some(track), _) => format!(
                "Track {} is only predicted here, and a predicted track does not count as reported",
                track.id
            ),
            (None, Some(Former { id, .. })) => {
                let mut tracks = self.tracks(number).iter();
                let is_elsewhere = tracks.any(|track| i64::from(track.id) == id);
                let course = if is_elsewhere { "was here and is elsewhere now" } else { "ended" };
                format!("Track {id} {course}, and no new one began")
            }
            (None, None) => "No track began here".to_owned(),
        };
        let end = if why.ends_with('?') { "" } else { "." };
        let text = format!("{lead}: {why}{end}");
        Cause { text, ..cause }
    }

    /// Returns the test that dropped the best candidate, or otherwise the values at the position;
    /// and the sentence for this person alone.
    fn dropped_or_measured(
        &self,
        number: u64,
        place: &PersonAt,
        taken: &BTreeSet<i64>,
        rules: Rules<'_>,
    ) -> (Cause, String) {
        let Some((test, dropped)) = self.best_dropped(number, place, taken, rules) else {
            let depths = self.depths(number).zip(place.rect);
            let measured = depths.and_then(|(depths, rect)| depths.cause(&rect, rules));
            let (name, why) = measured.unwrap_or_else(|| {
                ("no candidate", "no detector proposed a candidate here".to_owned())
            });
            return (Cause { name: name.to_owned(), why: why.clone(), ..Cause::default() }, why);
        };
        let why = rules.remedies.sentence(test, rules.config);
        let own = self
            .value_of(number, test, dropped, rules)
            .map(|value| rules.remedies.sentence_measured(test, &value, rules.config));
        let cause = Cause {
            test: Some(test.to_owned()),
            name: test.to_owned(),
            box_px: Some(dropped.box_px.map(|v| (f64::from(v) * 10.0).round() / 10.0)),
            why: why.clone(),
            ..Cause::default()
        };
        (cause, own.unwrap_or(why))
    }

    /// Returns the value because of which a candidate was dropped, with its limits.
    fn value_of(
        &self,
        number: u64,
        test: &str,
        dropped: &DroppedPlace,
        rules: Rules<'_>,
    ) -> Option<MeasuredValue> {
        let mut value = self.measured(number, dropped)?.clone();
        if OF_SCORE.contains(&test) {
            value.limits = least_scores(value.value, rules.config);
        }
        // A verifier may change the score after the manager has judged it: it is below no limit then.
        (!value.limits.is_empty()).then_some(value)
    }

    /// Returns the candidate that came closest to a track. One of the person's size has priority
    /// over one that merely overlaps the person; then the order is by the test that it failed, the
    /// last test first, by how far its value is beyond the limit, and by the distance. Duplicate
    /// detections of other people are left out.
    fn best_dropped(
        &self,
        number: u64,
        place: &PersonAt,
        taken: &BTreeSet<i64>,
        rules: Rules<'_>,
    ) -> Option<(&str, &DroppedPlace)> {
        let near = self.dropped(number).filter_map(|(test, dropped)| {
            let (nearness, distance) = dropped.nearness(place)?;
            if self.is_of_another(number, dropped, place, taken) {
                return None;
            }
            let is_telling = is_telling(test);
            let stage = rules.remedies.stage(test, rules.config);
            let value = self.value_of(number, test, dropped, rules);
            let beyond = value.map_or(f64::INFINITY, |value| beyond(&value));
            Some(((is_telling, nearness, stage), beyond, distance, (test, dropped)))
        });
        let best =
            near.max_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(b.2.total_cmp(&a.2)));
        best.map(|(.., found)| found)
    }
}

/// Returns how far a value is beyond its limit.
fn beyond(value: &MeasuredValue) -> f64 {
    value.limits.first().map_or(f64::INFINITY, |(_, limit)| (value.value - limit).abs())
}

/// Returns the minimum score of a candidate that starts a track, with the name of its setting. If the
/// score is also below the one at which the manager ends tracks, that limit follows: the manager
/// refuses a config in which it is not the lower one.
fn least_scores(score: f64, config: &Table) -> Vec<(String, f64)> {
    let mut limits = Vec::new();
    let Some(manager) = sections(config).find(|section| section.name == "manager") else {
        return limits;
    };
    for key in ["start_log_odds", "start_score", "end_log_odds", "drop_score"] {
        let limit = manager.setting(key).and_then(number);
        limits.extend(limit.filter(|limit| score < *limit).map(|limit| (key.to_owned(), limit)));
    }
    limits
}

impl Cause {
    fn of_ended(ended: &EndedTrack, rules: Rules<'_>) -> Self {
        let id = ended.id;
        let (name, why) = match &ended.test {
            Some(test) => {
                let decided = rules.remedies.decided(test, rules.config);
                (test.as_str(), format!("the test \"{test}\" ended the track{decided}"))
            }
            None => ("track: ended", "the track manager ended the track".to_owned()),
        };
        Self {
            name: name.to_owned(),
            text: format!("Track {id} was seen here and ended in this frame: {why}."),
            why,
            ..Self::default()
        }
    }

    fn of_unconfirmed(id: u32, rules: Rules<'_>) -> Self {
        let decided = rules.remedies.decided(NOT_CONFIRMED, rules.config);
        let why = format!("the track manager has not confirmed the track yet{decided}");
        Self {
            name: NOT_CONFIRMED.to_owned(),
            text: format!("Track {id} is here and is not reported: {why}."),
            why,
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests;
