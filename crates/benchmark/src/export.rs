//! Export of results as the folder tree of TrackEval.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use tagalong_app::outcome::Failure;
use tagalong_eval::formats::mot::SequenceInfo;
use tagalong_eval::formats::trackeval;
use tagalong_eval::{Frame, Sequence};

use super::store::{Recording, Store, put};

/// Name of the benchmark in the tree.
const BENCHMARK: &str = "Tagalong";

/// Writes the tree, in which a tracker is a pipeline with a seed. Returns the numbers of trackers
/// and sequences.
///
/// # Errors
/// If there is no result with boxes, or the disk fails.
pub fn export(store: &Store, folder: &Path) -> Result<(usize, usize), Failure> {
    let trackers = trackers(store)?;
    let sequences: BTreeSet<String> = trackers
        .values()
        .flat_map(|recordings| recordings.iter().map(|(info, _)| info.name.clone()))
        .collect();
    for (tracker, recordings) in &trackers {
        for (path, text) in trackeval::write(BENCHMARK, tracker, recordings) {
            put(&folder.join(path), text.as_bytes())?;
        }
    }
    let map: String = sequences.iter().map(|name| format!("{name}\n")).collect();
    let path = format!("gt/mot_challenge/seqmaps/{BENCHMARK}-train.txt");
    put(&folder.join(path), format!("name\n{map}").as_bytes())?;
    Ok((trackers.len(), sequences.len()))
}

type Recordings = Vec<(SequenceInfo, Sequence)>;

fn trackers(store: &Store) -> Result<BTreeMap<String, Recordings>, Failure> {
    let mut trackers: BTreeMap<String, Recordings> = BTreeMap::new();
    for task in store.plan()? {
        let Some(recording) = store.result(&task).and_then(|stored| stored.recording) else {
            continue;
        };
        // TrackEval has no seeds: each one becomes a tracker.
        let name = format!("{}-seed{}", task.pipeline, task.seed);
        trackers.entry(name).or_default().push(entry(&task.log_name, recording));
    }
    if trackers.is_empty() {
        return Err(Failure::failed("no result to export; run `tagalong bench run` first"));
    }
    Ok(trackers)
}

fn entry(name: &str, recording: Recording) -> (SequenceInfo, Sequence) {
    let Recording { mut sequence, rate_hz, width, height } = recording;
    sequence.frames.iter_mut().for_each(boxes_only);
    let length = sequence.frames.len() as u32;
    (SequenceInfo { name: name.to_owned(), rate_hz, length, width, height }, sequence)
}

/// Removes entries without a box, because TrackEval compares only boxes.
fn boxes_only(frame: &mut Frame) {
    frame.truths.retain(|truth| truth.region.is_some());
    frame.reports.retain(|report| report.region.is_some());
}
