//! Events of a sequence that a report lists: losses, ID switches, false tracks.

use serde::{Deserialize, Serialize};

use crate::clear::Match;
use crate::prepare::{Prepared, PreparedFrame};

/// An event in a recording that deserves a closer look.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Event {
    /// 1-based index of the frame in which it begins.
    pub frame: usize,
    /// Stamp of that frame, in nanoseconds.
    pub stamp_ns: i64,
    /// Kind of the event.
    pub kind: EventKind,
}

/// Kinds of events. IDs are those of the truth and of the tracks.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "what")]
#[non_exhaustive]
pub enum EventKind {
    /// A person is no longer matched.
    Miss {
        /// The person.
        person: i64,
        /// The track they had before, if any.
        track: Option<i64>,
    },
    /// A missed person is matched again, or for the first time.
    Found {
        /// The person.
        person: i64,
        /// The track.
        track: i64,
    },
    /// The track of a person changes.
    Switch {
        /// The person.
        person: i64,
        /// The track before.
        from: i64,
        /// The new track.
        to: i64,
    },
    /// A track is matched with another person than its first one.
    WrongPerson {
        /// The track.
        track: i64,
        /// Its first person.
        began_with: i64,
        /// Its present person.
        person: i64,
    },
    /// A track begins where there is no person.
    FalseTrack {
        /// The track.
        track: i64,
    },
}

/// Lists the events in chronological order, from the matches of CLEAR MOT.
pub fn events(prepared: &Prepared, matches: &[Vec<Match>]) -> Vec<Event> {
    let mut watch = Watch {
        prepared,
        last_track: vec![None; prepared.truth_ids.len()],
        missing: vec![false; prepared.truth_ids.len()],
        began_with: vec![None; prepared.track_ids.len()],
        on: vec![Whereabouts::NotYet; prepared.track_ids.len()],
    };
    let mut all = Vec::new();
    for (index, (frame, matches)) in prepared.frames.iter().zip(matches).enumerate() {
        let mut happened = Vec::new();
        watch.people(frame, matches, &mut happened);
        watch.tracks(frame, matches, &mut happened);
        for kind in happened {
            all.push(Event { frame: index + 1, stamp_ns: frame.stamp_ns, kind });
        }
    }
    all
}

/// The match of a track.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Whereabouts {
    NotYet,
    OnNobody,
    On(u32),
}

struct Watch<'a> {
    prepared: &'a Prepared,
    last_track: Vec<Option<u32>>,
    missing: Vec<bool>,
    began_with: Vec<Option<u32>>,
    on: Vec<Whereabouts>,
}

impl Watch<'_> {
    fn person_id(&self, truth: u32) -> i64 {
        self.prepared.truth_ids[truth as usize]
    }

    fn track_id(&self, track: u32) -> i64 {
        self.prepared.track_ids[track as usize]
    }

    fn people(&mut self, frame: &PreparedFrame, matches: &[Match], out: &mut Vec<EventKind>) {
        let mut partner = vec![None; frame.truths.len()];
        for m in matches {
            partner[m.row as usize] = Some(frame.tracks[m.col as usize]);
        }
        for (&truth, partner) in frame.truths.iter().zip(partner) {
            let person = self.person_id(truth);
            let last = self.last_track[truth as usize];
            let missing = &mut self.missing[truth as usize];
            // A miss is reported once, when it begins.
            let was_missing = std::mem::replace(missing, partner.is_none());
            match partner {
                None if !was_missing => {
                    out.push(EventKind::Miss { person, track: last.map(|t| self.track_id(t)) });
                }
                None => {}
                Some(track) => {
                    self.last_track[truth as usize] = Some(track);
                    let to = self.track_id(track);
                    if was_missing {
                        out.push(EventKind::Found { person, track: to });
                    }
                    if let Some(from) = last.filter(|&from| from != track) {
                        out.push(EventKind::Switch { person, from: self.track_id(from), to });
                    }
                }
            }
        }
    }

    fn tracks(&mut self, frame: &PreparedFrame, matches: &[Match], out: &mut Vec<EventKind>) {
        let mut place = vec![Whereabouts::OnNobody; frame.tracks.len()];
        for m in matches {
            place[m.col as usize] = Whereabouts::On(frame.truths[m.row as usize]);
        }
        for (&index, place) in frame.tracks.iter().zip(place) {
            let track = self.track_id(index);
            let before = std::mem::replace(&mut self.on[index as usize], place);
            match place {
                _ if place == before => {}
                Whereabouts::On(truth) => {
                    // The first person of a track is its own; only later ones are wrong.
                    let first = *self.began_with[index as usize].get_or_insert(truth);
                    if first != truth {
                        let began_with = self.person_id(first);
                        let person = self.person_id(truth);
                        out.push(EventKind::WrongPerson { track, began_with, person });
                    }
                }
                _ => out.push(EventKind::FalseTrack { track }),
            }
        }
    }
}
