//! The folder tree that TrackEval reads, so that TrackEval can score a benchmark:
//!
//! ```text
//! gt/mot_challenge/seqmaps/NAME-train.txt
//! gt/mot_challenge/NAME-train/SEQUENCE/seqinfo.ini
//! gt/mot_challenge/NAME-train/SEQUENCE/gt/gt.txt
//! trackers/mot_challenge/NAME-train/TRACKER/data/SEQUENCE.txt
//! ```
//!
//! To score it, run in the folder of TrackEval: `python scripts/run_mot_challenge.py --BENCHMARK
//! NAME --GT_FOLDER gt/mot_challenge --TRACKERS_FOLDER trackers/mot_challenge`. Ignored people are
//! exported as distractors, so that TrackEval leaves out the same reports as [`crate::Prepared`]
//! does. Ignore regions are not exported, because TrackEval has none.

use std::collections::BTreeMap;

use super::mot::{self, SequenceInfo};
use super::{FormatError, Timeline};
use crate::types::Sequence;

/// The files of a tree: paths with `/` between folders, and their content.
pub type Files = BTreeMap<String, String>;

/// Returns the sequences of a benchmark and the results of a tracker, in the image only.
///
/// `benchmark` is one word such as `Tagalong`; TrackEval applies the MOT17 rules
/// to any name but MOT15 and MOT20. People and reports without an image region
/// are left out.
pub fn write(benchmark: &str, tracker: &str, sequences: &[(SequenceInfo, Sequence)]) -> Files {
    let set = format!("{benchmark}-train");
    let mut files = Files::new();
    let mut map = String::from("name\n");
    for (info, sequence) in sequences {
        let name = &info.name;
        map += &format!("{name}\n");
        let truth = format!("gt/mot_challenge/{set}/{name}");
        let length = sequence.frames.len() as u32;
        let info = SequenceInfo { length, ..info.clone() };
        files.insert(format!("{truth}/seqinfo.ini"), text(|out| mot::write_info(out, &info)));
        files.insert(format!("{truth}/gt/gt.txt"), truth_text(sequence));
        let tracks = format!("trackers/mot_challenge/{set}/{tracker}/data/{name}.txt");
        files.insert(tracks, report_text(sequence));
    }
    files.insert(format!("gt/mot_challenge/seqmaps/{set}.txt"), map);
    files
}

/// Reads one tracker's results from such a tree; `rules` decide which truths count.
///
/// # Errors
///
/// When a file is missing, a line cannot be read, or a frame is beyond the length that
/// `seqinfo.ini` states.
pub fn read(
    files: &Files,
    benchmark: &str,
    tracker: &str,
    rules: mot::Rules,
) -> Result<Vec<(SequenceInfo, Sequence)>, FormatError> {
    let set = format!("{benchmark}-train");
    let (_, map) = file(files, format!("gt/mot_challenge/seqmaps/{set}.txt"))?;
    let names = map.lines().skip(1).map(str::trim).filter(|name| !name.is_empty());
    names.map(|name| read_sequence(files, &set, tracker, name, rules)).collect()
}

fn read_sequence(
    files: &Files,
    set: &str,
    tracker: &str,
    name: &str,
    rules: mot::Rules,
) -> Result<(SequenceInfo, Sequence), FormatError> {
    let truth = format!("gt/mot_challenge/{set}/{name}");
    let (path, text) = file(files, format!("{truth}/seqinfo.ini"))?;
    let info = mot::parse_info(text, path)?;
    let mut timeline = Timeline::new();
    let (path, text) = file(files, format!("{truth}/gt/gt.txt"))?;
    let rows = mot::parse_truth(text, path, rules)?;
    mot::check_length(&rows, path, info.length)?;
    timeline.add_truths(rows.iter().map(|row| row.truth(rules)));
    let (path, text) =
        file(files, format!("trackers/mot_challenge/{set}/{tracker}/data/{name}.txt"))?;
    let rows = mot::parse_tracks(text, path)?;
    mot::check_length(&rows, path, info.length)?;
    timeline.add_reports(rows.iter().map(mot::Row::report));
    let (sequence, _) = timeline.into_sequence(name, 1, info.length, info.rate_hz);
    Ok((info, sequence))
}

fn file(files: &Files, path: String) -> Result<(&str, &str), FormatError> {
    files
        .get_key_value(&path)
        .map(|(path, text)| (path.as_str(), text.as_str()))
        .ok_or_else(|| FormatError { file: path, line: 0, why: "is missing".to_owned() })
}

fn truth_text(sequence: &Sequence) -> String {
    text(|out| {
        for (number, frame) in (1..).zip(&sequence.frames) {
            for truth in &frame.truths {
                mot::write_truth(out, number, truth)?;
            }
        }
        Ok(())
    })
}

fn report_text(sequence: &Sequence) -> String {
    text(|out| {
        for (number, frame) in (1..).zip(&sequence.frames) {
            for report in &frame.reports {
                mot::write_report(out, number, report)?;
            }
        }
        Ok(())
    })
}

/// Returns the text that a writer produces; writing to memory cannot fail.
fn text(write: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> String {
    let mut bytes = Vec::new();
    let written = write(&mut bytes);
    debug_assert!(written.is_ok(), "memory takes every byte");
    String::from_utf8_lossy(&bytes).into_owned()
}
