//! Events of a run: people appear, are lost, and come back.

use std::collections::{BTreeMap, BTreeSet};

use crate::page::data::EventData;
use crate::page::moment::Moment;

/// Time without evidence after which a person counts as lost, s.
const LOST_AFTER_S: f64 = 0.5;

/// Time after which the same cause of a stop or of a lower speed is a new event, s.
const SAME_CAUSE_S: f64 = 2.0;

/// History of one person so far.
#[derive(Clone, Copy, Debug)]
struct Course {
    /// Index and time of the last frame with evidence.
    seen: (usize, f64),
    /// Index of the first frame without evidence since then.
    unseen_since: Option<usize>,
    /// Index of the last frame with the track.
    present: usize,
    is_lost: bool,
    has_ended: bool,
}

impl Course {
    /// Starts the history of a track at an index and time of the page.
    fn begun(at: usize, t_s: f64) -> Self {
        Self { seen: (at, t_s), unseen_since: None, present: at, is_lost: false, has_ended: false }
    }
}

/// Lists the events of a run. `times` are those of all frames of the page, and `moments` their
/// frames in the run.
pub fn of_run(times: &[f64], moments: &[Option<&Moment>]) -> Vec<EventData> {
    let mut watch = Watch::default();
    for (at, moment) in moments.iter().enumerate() {
        if let Some(moment) = moment {
            watch.take(at, times[at], moment);
        }
    }
    watch.events.sort_by_key(|event| event.i);
    watch.events
}

/// Detection of events in a run, frame by frame.
#[derive(Default)]
pub struct Watch {
    events: Vec<EventData>,
    courses: BTreeMap<u32, Course>,
    target: Option<u32>,
    lock: Option<String>,
    /// Tracks that may have been swapped with others.
    doubtful: BTreeSet<u32>,
    /// Last time at which each cause of a stop or of a lower speed held, s.
    causes: BTreeMap<String, f64>,
    /// True if the robot has stopped and not driven since then.
    stood: bool,
}

impl Watch {
    /// Returns the events since the last call. An event that is detected late has the index of the
    /// frame in which it began.
    pub fn drain(&mut self) -> Vec<EventData> {
        std::mem::take(&mut self.events)
    }

    /// Adds a frame at an index and time of the page.
    pub fn take(&mut self, at: usize, t_s: f64, moment: &Moment) {
        for track in moment.tracks.iter().filter(|track| track.confirmed) {
            if track.seen { self.see(at, t_s, track.id) } else { self.miss(at, t_s, track.id) }
        }
        self.end_absent(at, moment);
        if moment.target != self.target {
            self.target = moment.target;
            let text = match moment.target {
                Some(id) => format!("track {id} is followed from now on"),
                None => "the target is lost".to_owned(),
            };
            self.tell(at, "target", moment.target, text);
        }
        self.compare_doubts(at, moment);
        self.compare_lock(at, moment);
        self.compare_motion(at, t_s, moment);
    }

    /// Reports which tracks may have been swapped, once while that lasts, and which of them were.
    fn compare_doubts(&mut self, at: usize, moment: &Moment) {
        let doubts = &moment.notes.doubts;
        let before = std::mem::take(&mut self.doubtful);
        self.doubtful = doubts.iter().map(|doubt| doubt.id).collect();
        for doubt in doubts.iter().filter(|doubt| !before.contains(&doubt.id)) {
            let others: Vec<String> = doubt.others.iter().map(u32::to_string).collect();
            let text = format!("track {} may be track {}", doubt.id, others.join(" or "));
            self.tell(at, "doubt", Some(doubt.id), text);
        }
        for correction in &moment.notes.corrections {
            let [id, other] = correction.ids;
            let since = correction.since;
            let text = format!("{id} and {other} were the wrong way round from frame {since} on");
            self.tell(at, "corrected", Some(other), text);
        }
    }

    /// Reports a change of the state of the target lock, with its cause.
    fn compare_lock(&mut self, at: usize, moment: &Moment) {
        let Some(drive) = &moment.notes.drive else { return };
        let before = self.lock.replace(drive.lock.clone());
        if before.is_some_and(|before| before != drive.lock) {
            let text = format!("{}: {}; {}", drive.lock, drive.lock_about, drive.why);
            self.tell(at, "lock", moment.target, text);
        }
    }

    /// Reports why the robot stops or slows down, and that it drives again after a stop. A cause
    /// that comes and goes from frame to frame is reported once.
    fn compare_motion(&mut self, at: usize, t_s: f64, moment: &Moment) {
        let Some(drive) = &moment.notes.drive else { return };
        // To stop at the distance to keep, or at the start, is not an event.
        let is_as_asked = matches!(drive.reason.as_str(), "follow" | "limited");
        let kind = match drive.motion.as_str() {
            "stands" if is_as_asked => return,
            "stands" => "stands",
            "slower" => "slower",
            "drives" if std::mem::take(&mut self.stood) => {
                return self.tell(at, "drives", None, "the robot drives again".to_owned());
            }
            _ => return,
        };
        let is_new_stop = kind == "stands" && !std::mem::replace(&mut self.stood, true);
        let before = self.causes.insert(drive.reason.clone(), t_s);
        if is_new_stop || before.is_none_or(|before_s| t_s - before_s > SAME_CAUSE_S) {
            let cause = if drive.cause.is_empty() { "" } else { ": " };
            self.tell(at, kind, None, format!("{}{cause}{}", drive.reason_about, drive.cause));
        }
    }

    fn see(&mut self, at: usize, t_s: f64, id: u32) {
        match self.courses.insert(id, Course::begun(at, t_s)) {
            None => self.tell(at, "started", Some(id), format!("track {id} begins")),
            Some(before) if before.has_ended => {
                let text = format!("track {id} is recognised after {:.1} s", t_s - before.seen.1);
                self.tell(at, "recognised", Some(id), text);
            }
            Some(before) if before.is_lost => {
                let text = format!("track {id} is seen again after {:.1} s", t_s - before.seen.1);
                self.tell(at, "found", Some(id), text);
            }
            Some(_) => {}
        }
    }

    fn miss(&mut self, at: usize, t_s: f64, id: u32) {
        let is_new = !self.courses.contains_key(&id);
        let course = self.courses.entry(id).or_insert_with(|| Course::begun(at, t_s));
        course.present = at;
        let since = *course.unseen_since.get_or_insert(at);
        // A single frame without evidence is not an event.
        let is_lost = t_s - course.seen.1 >= LOST_AFTER_S;
        let newly_lost = is_lost && !std::mem::replace(&mut course.is_lost, is_lost);
        if is_new {
            self.tell(at, "started", Some(id), format!("track {id} begins"));
        }
        if newly_lost {
            self.tell(since, "lost", Some(id), format!("track {id} is not seen any more"));
        }
    }

    /// Ends the histories of tracks that have ended.
    fn end_absent(&mut self, at: usize, moment: &Moment) {
        let mut gone = Vec::new();
        for (id, course) in &mut self.courses {
            let is_there = moment.tracks.iter().any(|track| track.id == *id && track.confirmed);
            if !is_there && !course.has_ended {
                course.has_ended = true;
                gone.push(*id);
            }
        }
        for id in gone {
            self.tell(at, "ended", Some(id), format!("track {id} ends"));
        }
    }

    fn tell(&mut self, i: usize, kind: &'static str, track: Option<u32>, text: String) {
        self.events.push(EventData { i, kind, track, person: None, text });
    }
}

#[cfg(test)]
mod tests {
    use tagalong_app::frame_notes::{CorrectionNote, DoubtNote, DriveNote};

    use super::*;
    use crate::page::moment::TrackState;

    fn moment(tracks: &[(u32, bool)]) -> Moment {
        Moment {
            tracks: tracks
                .iter()
                .map(|&(id, seen)| TrackState {
                    id,
                    seen,
                    confirmed: true,
                    ..TrackState::default()
                })
                .collect(),
            ..Moment::default()
        }
    }

    fn kinds(frames: &[&[(u32, bool)]]) -> Vec<(usize, &'static str)> {
        let moments: Vec<Moment> = frames.iter().map(|tracks| moment(tracks)).collect();
        let times: Vec<f64> = (0..frames.len()).map(|i| 0.3 * i as f64).collect();
        let all: Vec<Option<&Moment>> = moments.iter().map(Some).collect();
        of_run(&times, &all).into_iter().map(|event| (event.i, event.kind)).collect()
    }

    #[test]
    fn a_person_who_stays_unseen_is_lost_where_that_began() {
        let events = kinds(&[&[(1, true)], &[(1, false)], &[(1, false)], &[(1, true)]]);
        assert_eq!(events, [(0, "started"), (1, "lost"), (3, "found")]);
    }

    #[test]
    fn a_single_frame_without_evidence_is_no_event() {
        assert_eq!(kinds(&[&[(1, true)], &[(1, false)], &[(1, true)]]), [(0, "started")]);
    }

    #[test]
    fn a_number_that_comes_back_was_recognised() {
        let events = kinds(&[&[(4, true)], &[], &[(4, true)], &[(4, true)]]);
        assert_eq!(events, [(0, "started"), (1, "ended"), (2, "recognised")]);
    }

    #[test]
    fn a_new_target_is_an_event() {
        let mut a = moment(&[(1, true)]);
        let b = moment(&[(1, true)]);
        a.target = Some(1);
        let events = of_run(&[0.0, 0.1], &[Some(&a), Some(&b)]);
        let texts: Vec<&str> = events.iter().map(|event| event.text.as_str()).collect();
        let expected = ["track 1 begins", "track 1 is followed from now on", "the target is lost"];
        assert_eq!(texts, expected);
    }

    #[test]
    fn the_causes_of_stops_and_slow_downs_are_told_once_each() {
        fn of(motion: &str, reason: &str) -> Moment {
            let mut moment = moment(&[]);
            let drive =
                DriveNote { motion: motion.into(), reason: reason.into(), ..DriveNote::default() };
            moment.notes.drive = Some(drive);
            moment
        }

        let moments = [
            of("drives", "follow"),
            of("slower", "near"),
            of("drives", "limited"),
            of("slower", "near"),
            of("stands", "blocked"),
            of("stands", "too-close"),
            of("drives", "follow"),
        ];
        let all: Vec<Option<&Moment>> = moments.iter().map(Some).collect();
        let told = of_run(&[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6], &all);
        let kinds: Vec<_> = told.iter().map(|event| (event.i, event.kind)).collect();
        assert_eq!(kinds, [(1, "slower"), (4, "stands"), (5, "stands"), (6, "drives")]);
    }

    #[test]
    fn a_stop_is_told_with_its_cause_and_a_robot_that_arrived_is_none() {
        fn of(reason: &str, cause: &str) -> Moment {
            let mut moment = moment(&[]);
            moment.notes.drive = Some(DriveNote {
                motion: "stands".into(),
                reason: reason.into(),
                reason_about: "stands: why".into(),
                cause: cause.into(),
                ..DriveNote::default()
            });
            moment
        }

        let moments = [of("follow", ""), of("near", "person 3, 0.84 m"), of("fault", "")];
        let all: Vec<Option<&Moment>> = moments.iter().map(Some).collect();
        let told = of_run(&[0.0, 0.1, 0.2], &all);
        let texts: Vec<_> = told.iter().map(|event| event.text.as_str()).collect();
        assert_eq!(texts, ["stands: why: person 3, 0.84 m", "stands: why"]);
    }

    #[test]
    fn a_doubt_is_told_once_while_it_lasts_and_a_correction_with_it() {
        fn of(in_doubt: bool) -> Moment {
            let mut moment = moment(&[]);
            let doubt = DoubtNote { id: 3, others: vec![4, 7] };
            moment.notes.doubts = if in_doubt { vec![doubt] } else { Vec::new() };
            moment
        }

        let mut last = of(false);
        last.notes.corrections = vec![CorrectionNote { since: 9, ids: [3, 4] }];
        let moments = [of(true), of(true), of(false), of(true), last];
        let all: Vec<Option<&Moment>> = moments.iter().map(Some).collect();
        let told = of_run(&[0.0, 0.1, 0.2, 0.3, 0.4], &all);
        let told: Vec<_> =
            told.iter().map(|event| (event.i, event.kind, event.text.as_str())).collect();
        let doubt = "track 3 may be track 4 or 7";
        let corrected = "3 and 4 were the wrong way round from frame 9 on";
        assert_eq!(told, [(0, "doubt", doubt), (3, "doubt", doubt), (4, "corrected", corrected)]);
    }

    #[test]
    fn a_change_of_the_lock_is_told_with_its_cause() {
        fn of(lock: &str) -> Moment {
            let mut moment = moment(&[]);
            let lock = lock.to_owned();
            let why = "out of sight".to_owned();
            moment.notes.drive = Some(DriveNote { lock, why, ..DriveNote::default() });
            moment
        }

        let mut watch = Watch::default();
        for (at, state) in ["locked", "locked", "lost"].into_iter().enumerate() {
            watch.take(at, 0.1 * at as f64, &of(state));
        }
        let events = watch.drain();
        let [event] = &events[..] else { panic!("{events:?}") };
        assert_eq!((event.i, event.kind), (2, "lock"));
        assert!(event.text.contains("lost") && event.text.contains("out of sight"));
        assert!(watch.drain().is_empty(), "told once");
    }
}
