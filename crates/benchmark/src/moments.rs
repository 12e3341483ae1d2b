//! Moments in which people were missed: one image each, and the boxes of all pipelines.

use std::collections::{BTreeMap, BTreeSet};

use tagalong_eval::{Region, Role};
use tagalong_report::{Moment, TaskResult};

use super::store::{Recording, Stored};

/// Number of frames within which two moments of a log count as the same.
const SAME_FRAMES: u64 = 5;

/// Maximum number of moments that are passed to the report, which shows as many as it has room for.
const MOST: usize = 60;

/// Result with the output of its pipeline for each frame.
struct Witness<'a> {
    result: &'a TaskResult,
    recording: &'a Recording,
    images: &'a BTreeMap<u64, String>,
}

/// Returns moments from all logs in turn, first those in which most pipelines miss a person.
pub fn gather(stored: &[Stored]) -> Vec<Moment> {
    let mut by_log: BTreeMap<&str, Vec<Witness<'_>>> = BTreeMap::new();
    for Stored { result, recording, images, .. } in stored {
        let Some(recording) = recording else { continue };
        by_log.entry(&result.log).or_default().push(Witness { result, recording, images });
    }
    let mut all: Vec<(usize, Moment)> = Vec::new();
    for witnesses in by_log.into_values() {
        all.extend(of_log(&witnesses).into_iter().enumerate());
    }
    // The sort is stable: within the same rank the logs stay sorted by name.
    all.sort_by_key(|(rank, _)| *rank);
    all.into_iter().map(|(_, moment)| moment).take(MOST).collect()
}

/// Returns the moments of a log, the worst first.
fn of_log(witnesses: &[Witness<'_>]) -> Vec<Moment> {
    let frames: BTreeSet<u64> = witnesses.iter().flat_map(|w| w.images.keys().copied()).collect();
    let mut ranked: Vec<u64> = frames.into_iter().collect();
    ranked.sort_by_cached_key(|frame| {
        let misses = witnesses.iter().filter(|w| w.result.missed.iter().any(|m| m.frame == *frame));
        (std::cmp::Reverse(misses.count()), *frame)
    });
    let mut kept: Vec<u64> = Vec::new();
    for frame in ranked {
        if kept.iter().all(|other| other.abs_diff(frame) > SAME_FRAMES) {
            kept.push(frame);
        }
    }
    kept.into_iter().filter_map(|frame| moment(witnesses, frame)).collect()
}

fn moment(witnesses: &[Witness<'_>], number: u64) -> Option<Moment> {
    let source = witnesses.iter().find(|witness| witness.images.contains_key(&number))?;
    let index = usize::try_from(number).ok()?.checked_sub(1)?;
    let frame = source.recording.sequence.frames.get(index)?;
    let people = frame.truths.iter().filter(|truth| truth.role == Role::Counts);
    let mut tracks = BTreeMap::new();
    for witness in witnesses {
        let boxes = witness.recording.sequence.frames.get(index).map(|frame| {
            let reports = frame.reports.iter();
            reports.filter_map(|r| Some((r.id, corners(&r.region?)))).collect::<Vec<_>>()
        });
        // If there are several seeds, the first represents its pipeline, as in the charts.
        tracks.entry(witness.result.pipeline.clone()).or_insert(boxes.unwrap_or_default());
    }
    Some(Moment {
        log: source.result.log.clone(),
        frame: number,
        t_s: frame.stamp_ns as f64 * 1e-9,
        size: [source.recording.width, source.recording.height],
        image_jpeg_base64: source.images.get(&number)?.clone(),
        people: people.filter_map(|p| Some((p.id, corners(&p.region?)))).collect(),
        tracks,
    })
}

fn corners(region: &Region) -> [f64; 4] {
    let Region { x, y, width, height } = *region;
    [x, y, width, height].map(|v| (v * 10.0).round() / 10.0)
}

#[cfg(test)]
mod tests {
    use tagalong_eval::{Frame, Report, Sequence, Truth};
    use tagalong_report::MissedPerson;

    use super::*;

    fn stored(pipeline: &str, log: &str, missed: &[u64], images: &[u64]) -> Stored {
        let region = Some(Region { x: 1.0, y: 2.0, width: 30.0, height: 30.0 });
        let frames = (1..=40).map(|number| Frame {
            stamp_ns: number * 100_000_000,
            truths: vec![Truth { id: 1, region, ..Truth::default() }],
            reports: vec![Report { id: 7, region, ..Report::default() }],
            ..Frame::default()
        });
        let frames = frames.collect();
        let missed = missed.iter().map(|frame| MissedPerson {
            frame: *frame,
            person: 1,
            ..MissedPerson::default()
        });
        Stored {
            result: TaskResult {
                pipeline: pipeline.into(),
                log: log.into(),
                missed: missed.collect(),
                ..TaskResult::default()
            },
            recording: Some(Recording {
                sequence: Sequence { name: log.into(), frames },
                width: 640,
                height: 480,
                ..Recording::default()
            }),
            images: images.iter().map(|frame| (*frame, format!("image {frame}"))).collect(),
            ..Stored::default()
        }
    }

    #[test]
    fn the_moments_that_most_pipelines_miss_come_first_and_logs_in_turn() {
        let all = [
            stored("a", "hall", &[10, 30], &[10, 30]),
            stored("b", "hall", &[30, 32], &[32]),
            stored("a", "lab", &[5], &[5]),
        ];
        let found = gather(&all);
        let places: Vec<(&str, u64)> = found.iter().map(|m| (m.log.as_str(), m.frame)).collect();
        // Frame 32 shows the same as 30.
        assert_eq!(places, [("hall", 30), ("lab", 5), ("hall", 10)]);
        assert_eq!((found[0].size, found[0].t_s), ([640, 480], 3.0));
        assert_eq!(found[0].tracks["b"], [(7, [1.0, 2.0, 30.0, 30.0])]);
        assert_eq!(found[0].people, [(1, [1.0, 2.0, 30.0, 30.0])]);
        assert_eq!(found[0].image_jpeg_base64, "image 30");
    }
}
