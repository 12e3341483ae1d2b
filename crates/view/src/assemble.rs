//! Page data from recordings, with one list of times for all runs.

use std::collections::{BTreeMap, BTreeSet};

use crate::page::data::{EventData, RunData};
use crate::page::events;
use crate::page::frame::{frame_data, tests};
use crate::page::moment::{Moment, TrackState};
use crate::page::robot::robot_data;
use tagalong_app::missed::{Depths, Witness};
use tagalong_app::remedies::Remedies;

use crate::recording::{FaultFacts, Recording};

/// Returns the stamps of all frames of all runs, in order.
pub fn stamps(runs: &[Recording]) -> Vec<u64> {
    let all: BTreeSet<u64> = runs.iter().flat_map(|run| &run.moments).map(stamp_of).collect();
    all.into_iter().collect()
}

fn stamp_of(moment: &Moment) -> u64 {
    moment.notes.stamp_ns
}

/// Returns the times since the first frame, s.
pub fn times(stamps: &[u64]) -> Vec<f64> {
    let first = stamps.first().copied().unwrap_or(0);
    stamps.iter().map(|stamp| ((stamp - first) as f64 * 1e-6).round() * 1e-3).collect()
}

/// Returns the data of a run for each frame of the page, numbered from 1.
pub fn witness(run: &Recording, stamps: &[u64], depths: &[Option<Depths>]) -> Witness {
    let by_stamp: BTreeMap<u64, &Moment> = run.moments.iter().map(|m| (stamp_of(m), m)).collect();
    let mut witness = Witness::default();
    for (at, stamp) in stamps.iter().enumerate() {
        if let Some(moment) = by_stamp.get(stamp) {
            let tracks = moment.tracks.iter().map(TrackState::sighted).collect();
            let depths = depths.get(at).cloned().flatten();
            witness.add(at as u64 + 1, &moment.notes, tracks, depths);
        }
    }
    witness
}

/// Returns a run, aligned with the times of the page.
pub fn run_data(run: &Recording, stamps: &[u64], remedies: &Remedies) -> RunData {
    let by_stamp: BTreeMap<u64, &Moment> = run.moments.iter().map(|m| (stamp_of(m), m)).collect();
    let moments: Vec<Option<&Moment>> = stamps.iter().map(|s| by_stamp.get(s).copied()).collect();
    let times = times(stamps);
    let mut events = events::of_run(&times, &moments);
    events.extend(fault_events(&run.report.faults, &times));
    // A fault comes before its consequences in the same frame.
    events.sort_by_key(|event| (event.i, event.kind != FAULT));
    RunData {
        name: run.config_name(),
        frames: moments.iter().map(|moment| moment.map(frame_data)).collect(),
        events,
        tests: tests(moments.iter().flatten().map(|moment| &moment.notes), &run.config, remedies),
        hits: None,
        causes: Vec::new(),
        missed: BTreeMap::new(),
        robot: robot_data(&run.config),
    }
}

/// Kind of the events of injected faults.
const FAULT: &str = "fault";

/// Returns the start and the end of each injected fault within the times of the page.
fn fault_events(faults: &[FaultFacts], times: &[f64]) -> Vec<EventData> {
    let mut events = Vec::new();
    for fault in faults {
        let ends = fault.to_s.map(|to_s| (to_s, "ends"));
        for (at_s, verb) in std::iter::once((fault.from_s, "begins")).chain(ends) {
            // The first frame that the fault may change.
            if let Some(i) = times.iter().position(|t_s| *t_s >= at_s) {
                let text = format!("The injected fault {} {verb}.", fault.kind);
                events.push(EventData { i, kind: FAULT, text, ..EventData::default() });
            }
        }
    }
    events
}

#[cfg(test)]
mod tests_of_times {
    use super::*;

    #[test]
    fn an_injected_fault_is_an_event_where_it_begins_and_ends() {
        fn fault(from_s: f64, to_s: Option<f64>) -> FaultFacts {
            FaultFacts { kind: "freeze-depth".into(), from_s, to_s }
        }

        let faults = [fault(0.15, Some(0.3)), fault(0.2, None), fault(9.0, Some(12.0))];
        let events = fault_events(&faults, &[0.0, 0.1, 0.2, 0.3]);
        let told: Vec<_> = events.iter().map(|event| (event.i, event.text.as_str())).collect();
        let begins = "The injected fault freeze-depth begins.";
        assert_eq!(told, [(2, begins), (3, "The injected fault freeze-depth ends."), (2, begins)]);
        assert_eq!(faults[1].in_words(), "freeze-depth from 0.2 s to the end");
    }

    use tagalong_app::frame_notes::FrameNotes;

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
        let all = stamps(&runs);
        assert_eq!(times(&all), [0.0, 1.0, 2.0]);
        let frames = run_data(&runs[0], &all, &Remedies::default()).frames;
        let is_there: Vec<bool> = frames.iter().map(Option::is_some).collect();
        assert_eq!(is_there, [true, false, true]);
    }
}
