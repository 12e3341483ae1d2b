//! Page data from recordings: one list of times for all runs.

use std::collections::{BTreeMap, BTreeSet};

use tagalong_app::frame_notes::{CandidateNote, FateNote, FrameNotes};
use tagalong_app::remedies;
use toml::Table;

use crate::events;
use crate::page_data::{CandidateData, DroppedData, FrameData, RunData, TestData, TrackData};
use crate::recording::{Moment, Recording, TrackState};

/// Part of a log, s since its first frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    /// First time; none for the beginning.
    pub from_s: Option<f64>,
    /// Last time; none for the end.
    pub to_s: Option<f64>,
}

/// Returns the stamps of all frames of all runs, in their order, within a span.
pub fn stamps(runs: &[Recording], span: Span) -> Vec<u64> {
    let all: BTreeSet<u64> = runs.iter().flat_map(|run| &run.moments).map(stamp_of).collect();
    let first = all.first().copied().unwrap_or(0);
    let is_within = |stamp: &u64| {
        let t_s = (stamp - first) as f64 * 1e-9;
        span.from_s.is_none_or(|from| t_s >= from) && span.to_s.is_none_or(|to| t_s <= to)
    };
    all.into_iter().filter(is_within).collect()
}

fn stamp_of(moment: &Moment) -> u64 {
    moment.notes.stamp_ns
}

/// Returns the times since the first frame, s.
pub fn times(stamps: &[u64]) -> Vec<f64> {
    let first = stamps.first().copied().unwrap_or(0);
    stamps.iter().map(|stamp| ((stamp - first) as f64 * 1e-6).round() * 1e-3).collect()
}

/// Returns a run on the times of the page.
pub fn run_data(run: &Recording, stamps: &[u64]) -> RunData {
    let by_stamp: BTreeMap<u64, &Moment> = run.moments.iter().map(|m| (stamp_of(m), m)).collect();
    let moments: Vec<Option<&Moment>> = stamps.iter().map(|s| by_stamp.get(s).copied()).collect();
    RunData {
        name: run.config_name(),
        frames: moments.iter().map(|moment| moment.map(frame_data)).collect(),
        events: events::of_run(&times(stamps), &moments),
        tests: tests(&moments, &run.config),
        hits: None,
    }
}

/// Returns all tests that dropped anything, with the settings that decide them.
fn tests(moments: &[Option<&Moment>], config: &Table) -> BTreeMap<String, TestData> {
    let notes = moments.iter().flatten().map(|moment| &moment.notes);
    let names: BTreeSet<&str> = notes.flat_map(dropping_tests).collect();
    let data = |name: &str| match remedies::of(name) {
        Some(remedy) => TestData { settings: remedy.lines(config), look: remedy.look },
        None => TestData::default(),
    };
    names.into_iter().map(|name| (name.to_owned(), data(name))).collect()
}

fn dropping_tests(notes: &FrameNotes) -> impl Iterator<Item = &str> {
    let of_funnel = notes.dropped.iter().map(|dropped| dropped.test.as_str());
    of_funnel.chain(notes.candidates.iter().filter_map(dropping_test))
}

fn dropping_test(candidate: &CandidateNote) -> Option<&str> {
    match &candidate.fate {
        FateNote::Dropped(test) => Some(test),
        _ => None,
    }
}

fn frame_data(moment: &Moment) -> FrameData {
    let notes = &moment.notes;
    FrameData {
        n: notes.frame,
        robot: notes.robot_odom,
        tracks: moment.tracks.iter().map(|track| track_data(track, notes.robot_odom[2])).collect(),
        found: notes.candidates.iter().map(candidate_data).collect(),
        dropped: dropped_data(notes),
        target: moment.target,
    }
}

fn track_data(track: &TrackState, heading: f64) -> TrackData {
    let (sin, cos) = heading.sin_cos();
    let [forward, left] = track.velocity_robot_mps;
    let [x, y, z] = track.head_odom_m;
    TrackData {
        id: track.id,
        state: match (track.confirmed, track.seen, track.occluded) {
            (false, _, _) => "tentative",
            (true, true, _) => "seen",
            (true, false, true) => "hidden",
            (true, false, false) => "unseen",
        },
        box_px: track.upper_body_px.map(|v| rounded(v, 10.0)),
        at: [x, y].map(|v| rounded(v, 1e3)),
        v: [cos * forward - sin * left, sin * forward + cos * left].map(|v| rounded(v, 1e2)),
        z: rounded(z, 1e2),
        d: rounded(track.head_robot_m[0].hypot(track.head_robot_m[1]), 1e2),
        p: rounded(track.probability, 1e2),
        trail: Vec::new(),
    }
}

fn candidate_data(note: &CandidateNote) -> CandidateData {
    let [x, y, _] = note.head_odom_m;
    let (track, starts) = match note.fate {
        FateNote::Matched(id) => (Some(id), false),
        FateNote::Started(id) => (Some(id), true),
        FateNote::Dropped(_) => (None, false),
    };
    CandidateData {
        box_px: note.box_px,
        at: [x, y],
        score: rounded(note.score, 1e2),
        by: note.source.clone(),
        test: dropping_test(note).map(str::to_owned),
        track,
        starts,
    }
}

/// Returns the funnel; the places of candidates are left to the candidates, which say more.
fn dropped_data(notes: &FrameNotes) -> Vec<DroppedData> {
    let of_candidates: BTreeSet<&str> = notes.candidates.iter().filter_map(dropping_test).collect();
    let data = |dropped: &tagalong_app::frame_notes::DroppedNote| {
        let is_known = of_candidates.contains(dropped.test.as_str());
        DroppedData {
            test: dropped.test.clone(),
            n: dropped.count,
            boxes: if is_known { Vec::new() } else { dropped.boxes_px.clone() },
        }
    };
    notes.dropped.iter().map(data).collect()
}

fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts + 0.0
}

#[cfg(test)]
mod tests_of_data {
    use super::*;
    use tagalong_app::frame_notes::DroppedNote;

    fn moment(stamp_ns: u64) -> Moment {
        let notes = FrameNotes { frame: 1, stamp_ns, ..FrameNotes::default() };
        Moment { notes, ..Moment::default() }
    }

    fn recording(stamps: &[u64]) -> Recording {
        let moments = stamps.iter().map(|stamp| moment(*stamp)).collect();
        Recording { moments, ..Recording::default() }
    }

    #[test]
    fn runs_with_different_frames_share_one_list_of_times() {
        let runs = [recording(&[1_000_000_000, 3_000_000_000]), recording(&[2_000_000_000])];
        let all = stamps(&runs, Span::default());
        assert_eq!(times(&all), [0.0, 1.0, 2.0]);
        let frames = run_data(&runs[0], &all).frames;
        let is_there: Vec<bool> = frames.iter().map(Option::is_some).collect();
        assert_eq!(is_there, [true, false, true]);
        let part = stamps(&runs, Span { from_s: Some(0.5), to_s: Some(1.5) });
        assert_eq!(part, [2_000_000_000]);
    }

    #[test]
    fn a_test_comes_with_the_setting_that_decides_it() {
        let mut moment = moment(1);
        moment.notes.dropped =
            vec![DroppedNote { test: "head width".into(), count: 3, ..DroppedNote::default() }];
        let config = toml::from_str(
            "[[detectors]]\nplugin = 'depth-template'\n[detectors.config]\nmin_head_width_m = 0.1\n",
        )
        .unwrap();
        let tests = tests(&[Some(&moment)], &config);
        let lines = &tests["head width"].settings;
        assert!(lines.iter().any(|line| line.contains("min_head_width_m = 0.1")), "{lines:?}");
        assert!(!tests["head width"].look.is_empty());
    }

    #[test]
    fn velocities_are_turned_into_the_odometry_frame() {
        let track = TrackState {
            confirmed: true,
            velocity_robot_mps: [1.0, 0.0],
            head_robot_m: [3.0, 4.0, 1.6],
            ..TrackState::default()
        };
        let data = track_data(&track, std::f64::consts::FRAC_PI_2);
        assert_eq!((data.v, data.d, data.state), ([0.0, 1.0], 5.0, "unseen"));
    }

    #[test]
    fn places_of_candidates_are_not_shown_twice() {
        let mut notes = FrameNotes::default();
        let fate = FateNote::Dropped("verifier".into());
        notes.candidates = vec![CandidateNote { fate, ..CandidateNote::default() }];
        let note = |test: &str| DroppedNote {
            test: test.into(),
            count: 1,
            boxes_px: vec![[1.0, 2.0, 3.0, 4.0]],
        };
        notes.dropped = vec![note("verifier"), note("head width")];
        let boxes: Vec<usize> = dropped_data(&notes).iter().map(|d| d.boxes.len()).collect();
        assert_eq!(boxes, [0, 1]);
    }
}
