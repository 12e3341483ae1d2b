//! Times until a person is confirmed or found again, and with the wrong person.

use serde::{Deserialize, Serialize};

use crate::clear::Match;
use crate::prepare::Prepared;

/// Durations, in seconds of the recording.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Times {
    /// For each person that was matched at all: from the first frame in which they count to the
    /// first match.
    pub confirm_s: Vec<f64>,
    /// People that were never matched.
    pub never_confirmed: u64,
    /// For each loss that ended: time from the first frame without a match (or the first frame back
    /// in view) to the next match.
    pub reacquire_s: Vec<f64>,
    /// Number of losses that did not end.
    pub never_reacquired: u64,
    /// Time that tracks spent on other people than the first one that they were matched with,
    /// summed over the tracks.
    pub wrong_person_s: f64,
    /// Length of the recording, for rates.
    pub duration_s: f64,
}

impl Times {
    /// Measures a sequence from the matches of CLEAR MOT.
    pub fn measure(prepared: &Prepared, matches: &[Vec<Match>]) -> Self {
        let lengths_s = frame_lengths_s(prepared);
        let mut times = Self { duration_s: lengths_s.iter().sum(), ..Self::default() };
        let mut people = vec![Watched::default(); prepared.truth_ids.len()];
        let mut owners = vec![None; prepared.track_ids.len()];
        for (index, (frame, matches)) in prepared.frames.iter().zip(matches).enumerate() {
            let mut found = vec![false; frame.truths.len()];
            for m in matches {
                found[m.row as usize] = true;
                let truth = frame.truths[m.row as usize];
                // A track belongs to the first person that it was matched with.
                let owner = owners[frame.tracks[m.col as usize] as usize].get_or_insert(truth);
                times.wrong_person_s += if *owner == truth { 0.0 } else { lengths_s[index] };
            }
            for (&truth, found) in frame.truths.iter().zip(found) {
                people[truth as usize].look(index, frame.stamp_ns, found, &mut times);
            }
        }
        times.never_confirmed = people.iter().filter(|p| !p.confirmed).count() as u64;
        times.never_reacquired =
            people.iter().filter(|p| p.confirmed && p.waiting_since_ns.is_some()).count() as u64;
        times
    }

    /// Combines the times of several sequences.
    pub fn combine<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        all.into_iter().fold(Self::default(), |mut sum, one| {
            sum.confirm_s.extend_from_slice(&one.confirm_s);
            sum.never_confirmed += one.never_confirmed;
            sum.reacquire_s.extend_from_slice(&one.reacquire_s);
            sum.never_reacquired += one.never_reacquired;
            sum.wrong_person_s += one.wrong_person_s;
            sum.duration_s += one.duration_s;
            sum
        })
    }
}

/// One person over time.
#[derive(Clone, Default)]
struct Watched {
    confirmed: bool,
    /// Time since which the person has been waiting for a match.
    waiting_since_ns: Option<i64>,
    last_in_view: Option<usize>,
}

impl Watched {
    fn look(&mut self, frame: usize, stamp_ns: i64, found: bool, times: &mut Times) {
        // A person that left the view and came back starts to wait again.
        let stayed = frame > 0 && self.last_in_view == Some(frame - 1);
        self.last_in_view = Some(frame);
        if !self.confirmed {
            let since = *self.waiting_since_ns.get_or_insert(stamp_ns);
            if found {
                times.confirm_s.push(seconds(stamp_ns - since));
                self.confirmed = true;
                self.waiting_since_ns = None;
            }
            return;
        }
        if !stayed {
            self.waiting_since_ns = Some(stamp_ns);
        }
        if !found {
            self.waiting_since_ns.get_or_insert(stamp_ns);
        } else if let Some(since) = self.waiting_since_ns.take() {
            times.reacquire_s.push(seconds(stamp_ns - since));
        }
    }
}

/// Result of following one person.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Following {
    /// Time during which the right person was followed.
    pub on_target_s: f64,
    /// Time during which another person was followed.
    pub wrong_person_s: f64,
    /// Time during which something that is no person (or an ignored one) was followed.
    pub nobody_s: f64,
    /// Time during which nothing was followed.
    pub idle_s: f64,
    /// Number of times that the target was lost after it had been followed.
    pub losses: u64,
}

impl Following {
    /// Scores which person a robot followed: `followed` has for each frame the ID of the track
    /// under the target lock, `target` is the ID of the right person in the truth.
    pub fn measure(
        prepared: &Prepared,
        matches: &[Vec<Match>],
        target: i64,
        followed: &[Option<i64>],
    ) -> Self {
        let mut following = Self::default();
        let lengths_s = frame_lengths_s(prepared);
        let mut was_on_target = false;
        for (index, &length_s) in lengths_s.iter().enumerate() {
            let frame = &prepared.frames[index];
            let track = followed.get(index).copied().flatten();
            let person = track.and_then(|track| {
                let mut matches = matches.get(index)?.iter();
                let m = matches
                    .find(|m| prepared.track_ids[frame.tracks[m.col as usize] as usize] == track)?;
                Some(prepared.truth_ids[frame.truths[m.row as usize] as usize])
            });
            let on_target = person == Some(target);
            following.losses += u64::from(was_on_target && !on_target);
            was_on_target = on_target;
            *following.account(track.is_some(), person, target) += length_s;
        }
        following
    }

    fn account(&mut self, follows: bool, person: Option<i64>, target: i64) -> &mut f64 {
        match person {
            Some(id) if id == target => &mut self.on_target_s,
            Some(_) => &mut self.wrong_person_s,
            None if follows => &mut self.nobody_s,
            None => &mut self.idle_s,
        }
    }
}

/// Returns the duration of each frame, up to the next one; the last one lasts as long as the one
/// before it.
fn frame_lengths_s(prepared: &Prepared) -> Vec<f64> {
    let frames = &prepared.frames;
    let mut lengths: Vec<f64> =
        frames.windows(2).map(|two| seconds(two[1].stamp_ns - two[0].stamp_ns)).collect();
    if !frames.is_empty() {
        // The last frame has no successor; a single frame has no duration.
        lengths.push(lengths.last().copied().unwrap_or(0.0));
    }
    lengths
}

fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}
