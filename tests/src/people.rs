//! Annotations `NAME.people.csv`, made by hand, and a small scorer for them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use tagalong_geometry::Rect;

/// Least overlap of a box with the person that it covers.
const MIN_IOU: f64 = 0.5;

/// One annotated person in one frame.
#[derive(Clone, Debug)]
pub struct Annotation {
    /// 1-based index of the colour image.
    pub frame: u64,
    /// Number of the person.
    pub id: u32,
    /// Upper-body square, clipped to the image.
    pub region: Rect,
    /// Visible part of the upper body, 0 to 1.
    pub visible: f64,
    /// True if the row counts neither as a miss nor as a false alarm.
    pub ignore: bool,
}

/// Reads a `people.csv`; returns `None` if there is no such file.
///
/// # Panics
/// If the file does not match its description.
pub fn read(path: &Path) -> Option<Vec<Annotation>> {
    let text = std::fs::read_to_string(path).ok()?;
    // The first line names the columns.
    let rows = text.lines().skip(1).filter(|line| !line.trim().is_empty());
    Some(rows.map(annotation).collect())
}

fn annotation(line: &str) -> Annotation {
    let fields: Vec<f64> = line.split(',').map(|f| f.parse().unwrap_or(f64::NAN)).collect();
    assert_eq!(fields.len(), 17, "columns of {line}");
    Annotation {
        frame: fields[0] as u64,
        id: fields[1] as u32,
        region: Rect::new(fields[2], fields[3], fields[4], fields[5]),
        visible: fields[13],
        ignore: fields[15] != 0.0,
    }
}

/// Boxes of one frame: track number and region.
pub type Boxes = BTreeMap<u64, Vec<(u32, Rect)>>;

/// Score of a run against the annotations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// People that count; see `covered_soon`.
    pub people: usize,
    /// People that were covered within two frames of being fully in view for the first time.
    pub covered_soon: usize,
    /// Annotated rows that count; see `covered`.
    pub rows: usize,
    /// Rows that were covered.
    pub covered: usize,
    /// Boxes on no person, annotated or ignored.
    pub false_boxes: usize,
    /// Track numbers of each person.
    pub ids: BTreeMap<u32, BTreeSet<u32>>,
}

/// Scores `boxes`: each covers at most one person, the pairs with the largest overlap first.
pub fn score(annotations: &[Annotation], boxes: &Boxes) -> Score {
    let mut score = Score::default();
    let mut covered: BTreeSet<(u64, u32)> = BTreeSet::new();
    let frames: BTreeSet<u64> =
        annotations.iter().map(|a| a.frame).chain(boxes.keys().copied()).collect();
    for frame in frames {
        let truth: Vec<&Annotation> = annotations.iter().filter(|a| a.frame == frame).collect();
        let found = boxes.get(&frame).map(Vec::as_slice).unwrap_or_default();
        let pairs = matched(&truth, found);
        score.false_boxes += found.len() - pairs.len();
        for (t, b) in pairs {
            covered.insert((frame, truth[t].id));
            if !truth[t].ignore {
                score.ids.entry(truth[t].id).or_default().insert(found[b].0);
            }
        }
    }
    let counting: Vec<&Annotation> = annotations.iter().filter(|a| !a.ignore).collect();
    score.rows = counting.len();
    score.covered = counting.iter().filter(|a| covered.contains(&(a.frame, a.id))).count();
    for (id, first) in first_full_view(&counting) {
        score.people += 1;
        score.covered_soon += usize::from((first..=first + 2).any(|f| covered.contains(&(f, id))));
    }
    score
}

fn matched(truth: &[&Annotation], found: &[(u32, Rect)]) -> Vec<(usize, usize)> {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (t, annotation) in truth.iter().enumerate() {
        for (b, (_, region)) in found.iter().enumerate() {
            pairs.push((annotation.region.iou(region), t, b));
        }
    }
    pairs.retain(|p| p.0 >= MIN_IOU);
    // Equal overlaps are ordered by index, so that the score is repeatable.
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut truths = BTreeSet::new();
    let mut boxes = BTreeSet::new();
    pairs
        .into_iter()
        .filter_map(|(_, t, b)| {
            let is_free = !truths.contains(&t) && !boxes.contains(&b);
            is_free.then(|| {
                truths.insert(t);
                boxes.insert(b);
                (t, b)
            })
        })
        .collect()
}

/// Returns the first frame in which each person is wholly visible.
fn first_full_view(counting: &[&Annotation]) -> BTreeMap<u32, u64> {
    let mut first = BTreeMap::new();
    for annotation in counting.iter().filter(|a| a.visible >= 1.0) {
        let frame: &mut u64 = first.entry(annotation.id).or_insert(annotation.frame);
        *frame = annotation.frame.min(*frame);
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    fn person(frame: u64, id: u32, x: f64, ignore: bool) -> Annotation {
        Annotation { frame, id, region: Rect::new(x, 0.0, 10.0, 10.0), visible: 1.0, ignore }
    }

    #[test]
    fn ignored_people_are_neither_misses_nor_false_alarms() {
        let truth = [person(1, 1, 0.0, false), person(1, 2, 50.0, true)];
        let boxes = BTreeMap::from([(
            1,
            vec![(7, Rect::new(50.0, 0.0, 10.0, 10.0)), (8, Rect::new(200.0, 0.0, 10.0, 10.0))],
        )]);
        let score = score(&truth, &boxes);
        assert_eq!((score.rows, score.covered, score.false_boxes), (1, 0, 1));
        assert_eq!((score.people, score.covered_soon), (1, 0));
    }

    #[test]
    fn covered_within_two_frames_counts() {
        fn at(frame: u64) -> BTreeMap<u64, Vec<(u32, Rect)>> {
            BTreeMap::from([(frame, vec![(7, Rect::new(1.0, 0.0, 10.0, 10.0))])])
        }

        let truth = [1, 2, 3, 4].map(|f| person(f, 1, 0.0, false));
        assert_eq!(score(&truth, &at(3)).covered_soon, 1);
        assert_eq!(score(&truth, &at(4)).covered_soon, 0);
        assert_eq!(score(&truth, &at(4)).ids[&1], BTreeSet::from([7]));
    }
}
