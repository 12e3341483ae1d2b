//! Reads files of truth and tracks into a sequence that can be scored.

mod beside;
mod extents;
mod misread;
mod other_log;
mod shots;
mod tracks;
mod truth;

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use crate::outcome::Failure;
use crate::suggest::file_hint;
pub use beside::{annotated_file, files_of, is_of_whole_bodies, log_beside};
pub use extents::{as_upper_bodies, whole_bodies_in_truth};
pub use misread::misread_notes;
pub use other_log::{match_note, other_log_notes, truth_notes};
pub use shots::{Shot, Shots};
use tagalong_config::{FileLimit, read_text as read_bounded};
use tagalong_eval::formats::{OddLines, kitti};
use tagalong_eval::{Comparison, EvalError, Frame, Region, Report, Sequence, Similarity, Truth};
pub use tracks::Tracks;
pub use truth::{RulesChoice, TruthFile, TruthOptions};

/// Reports by the number of their frame, from 1.
pub type Reports = BTreeMap<u32, Vec<Report>>;

/// Frame rate for sequences without a log, Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate(pub f64);

/// Combines truth and reports of all frames.
///
/// Frames that the log has but did not deliver (for example because their depth was lost) are
/// included: the people in them were missed.
pub fn assemble(
    name: &str,
    truth: &TruthFile,
    shots: &Shots,
    mut reports: Reports,
    rate: Rate,
) -> Sequence {
    let last_report = reports.last_key_value().map_or(0, |(&number, _)| number);
    let length = truth.last(shots).max(shots.last()).max(last_report);
    let mut people = truth.frames(shots);
    let frames = (1..=length).map(|number| {
        let (truths, ignore_regions) = people.remove(&number).unwrap_or_default();
        Frame {
            stamp_ns: shots.stamp_ns(number, rate),
            truths,
            reports: reports.remove(&number).unwrap_or_default(),
            ignore_regions,
        }
    });
    Sequence { name: name.to_owned(), frames: frames.collect() }
}

/// Returns the part of a sequence that a similarity can compare: reports without the compared
/// quantity are left out, as are people without a box if boxes are compared. `None` if the truth
/// lacks positions, or has no boxes at all.
pub fn comparable(sequence: &Sequence, similarity: Similarity) -> Option<Sequence> {
    let mut truths = sequence.frames.iter().flat_map(|frame| &frame.truths);
    let is_comparable = match similarity {
        // Without people in the truth every report is a false positive, which can still be
        // compared.
        Similarity::Iou => {
            truths.clone().next().is_none() || truths.any(|truth| has_place(truth, similarity))
        }
        Similarity::Metres => truths.all(|truth| has_place(truth, similarity)),
    };
    let mut kept = sequence.clone();
    for frame in &mut kept.frames {
        frame.truths.retain(|truth| has_place(truth, similarity));
        frame.reports.retain(|report| match similarity {
            Similarity::Iou => report.region.is_some(),
            Similarity::Metres => report.floor_m.is_some(),
        });
    }
    is_comparable.then_some(kept)
}

/// Returns true if a person of the truth has the box or the position that is compared.
fn has_place(truth: &Truth, similarity: Similarity) -> bool {
    match similarity {
        Similarity::Iou => truth.region.is_some(),
        Similarity::Metres => truth.floor_m.is_some(),
    }
}

/// Returns the sentence for an error in a truth or in tracks, with the option that solves it.
pub fn with_remedy(error: &EvalError) -> String {
    match error {
        EvalError::DuplicateId { side: "truth", .. } => {
            format!("{error}; `--drop-doubled-ids` keeps the first of them")
        }
        _ => error.to_string(),
    }
}

/// Returns the comparison that the truth's protocol requires.
pub fn comparison(truth: &TruthFile, similarity: Similarity) -> Comparison {
    if truth.is_kitti() && similarity == Similarity::Iou {
        kitti::comparison(similarity)
    } else {
        similarity.into()
    }
}

/// Returns a note on boxes of a file that have no area, each with its line, if there are any.
fn without_area<'a>(
    name: &str,
    boxes: impl Iterator<Item = (usize, &'a Region)>,
) -> Option<String> {
    OddLines::among(boxes.map(|(line, region)| (line, !region.has_area()))).map(
        |OddLines { count, first, of }| {
            format!(
                "{name}: {count} of {of} boxes have no area (the first in line {first}); as in \
                 TrackEval they match no person"
            )
        },
    )
}

/// Returns notes on KITTI labels that may have another meaning than intended.
fn odd_labels(name: &str, labels: &[kitti::Label]) -> Vec<String> {
    let anonymous = OddLines::among(labels.iter().map(|label| (label.line, label.is_anonymous())));
    let left_out = anonymous.map(|OddLines { count, first, of }| {
        format!(
            "{name}: {count} of {of} lines have an id below 0 (the first is line {first}); as in \
             TrackEval they are left out"
        )
    });
    let boxes = labels.iter().map(|label| (label.line, &label.region));
    without_area(name, boxes).into_iter().chain(left_out).collect()
}

/// Reads a text file.
///
/// # Errors
/// A file that cannot be read, with its name.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    let shown = path.display();
    read_bounded(path, FileLimit::Table).map_err(|error| {
        Failure::failed(match error.kind() {
            ErrorKind::InvalidData => format!(
                "{shown} is not text; truth and tracks are MOTChallenge, KITTI or CSV text, a log, \
                 or the folder of a run"
            ),
            ErrorKind::NotFound => format!("{shown}: no such file{}", file_hint(path)),
            _ => format!("cannot read {shown}: {error}"),
        })
    })
}

/// Converts a rectangle to the type of the metrics.
pub fn region(rect: &tagalong_geometry::Rect) -> Region {
    Region::new(rect.x, rect.y, rect.width, rect.height)
}
