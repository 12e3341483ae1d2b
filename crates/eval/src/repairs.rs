//! Scores of a tracker with one kind of its errors repaired.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tagalong_math::matching::{Edge, Matcher};

use crate::error::EvalError;
use crate::prepare::{Comparison, Prepared, PreparedFrame};
use crate::scores::Scores;
use crate::types::{Frame, Region, Report, Sequence, Similarity, Truth};

/// Similarity from which on a report counts as a badly placed report of a person, and not as a
/// false positive beside a miss.
pub const PAIRED_SIMILARITY: f64 = 0.1;

/// Kind of error that is repaired with the truth.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Repair {
    /// Each paired report gets the ID of its person.
    Identities,
    /// Reports without a person are removed.
    FalseReports,
    /// Each missed person is reported, by the track that the person had before or has next.
    Misses,
    /// Each paired report gets the box, or the position, of its person.
    Places,
    /// The middle of each paired box gets the height of that of its person.
    Heights,
    /// The middle of each paired box gets the horizontal position of that of its person.
    Sideways,
    /// Each paired box gets the size of that of its person, about its own middle.
    Sizes,
}

impl Repair {
    /// All kinds that apply to boxes.
    pub const ALL: [Self; 7] = [
        Self::Identities,
        Self::FalseReports,
        Self::Misses,
        Self::Places,
        Self::Heights,
        Self::Sideways,
        Self::Sizes,
    ];

    /// Returns a short description for tables.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Identities => "IDs right",
            Self::FalseReports => "no false reports",
            Self::Misses => "no misses",
            Self::Places => "places exact",
            Self::Heights => "boxes right in height",
            Self::Sideways => "boxes right sideways",
            Self::Sizes => "boxes right in size",
        }
    }

    /// Returns true for a repair of boxes, which positions on the floor do not have.
    fn needs_boxes(self) -> bool {
        matches!(self, Self::Heights | Self::Sideways | Self::Sizes)
    }
}

/// Figures with one kind of error repaired.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Repaired {
    /// Repaired kind of error.
    pub repair: Repair,
    /// HOTA, 0 to 1.
    #[serde(rename = "HOTA")]
    pub hota: Option<f64>,
    /// MOTA, at most 1.
    #[serde(rename = "MOTA")]
    pub mota: Option<f64>,
    /// IDF1, 0 to 1.
    #[serde(rename = "IDF1")]
    pub idf1: Option<f64>,
}

/// Returns the figures of a sequence, each time with one kind of error repaired. In each frame,
/// reports and people are paired one to one so that their similarities, from [`PAIRED_SIMILARITY`]
/// on, have the largest sum. Ignored people, and the reports on them, stay as they are.
///
/// ```
/// use tagalong_eval::{Frame, Region, Repair, Report, Sequence, Similarity, Truth, repairs};
///
/// let truth = Truth { id: 1, region: Some(Region::new(0.0, 0.0, 10.0, 10.0)), ..Truth::default() };
/// let low = Report { id: 7, region: Some(Region::new(0.0, 6.0, 10.0, 10.0)), ..Report::default() };
/// let frame = Frame { truths: vec![truth], reports: vec![low], ..Frame::default() };
/// let sequence = Sequence { name: "one frame".into(), frames: vec![frame] };
/// let repaired = repairs(&sequence, &Similarity::Iou.into())?;
/// let height = repaired.iter().find(|row| row.repair == Repair::Heights).unwrap();
/// assert_eq!(height.mota, Some(1.0));
/// # Ok::<(), tagalong_eval::EvalError>(())
/// ```
///
/// # Errors
/// See [`Prepared::new`].
pub fn repairs(sequence: &Sequence, comparison: &Comparison) -> Result<Vec<Repaired>, EvalError> {
    let pairing = Pairing::new(sequence, comparison)?;
    let mut rows = Vec::with_capacity(Repair::ALL.len());
    for repair in Repair::ALL {
        if repair.needs_boxes() && comparison.similarity != Similarity::Iou {
            continue;
        }
        let repaired = pairing.repaired(sequence, repair);
        let scores = Scores::measure(&repaired, *comparison)?;
        let Scores { hota, mota, idf1, .. } = scores;
        rows.push(Repaired { repair, hota, mota, idf1 });
    }
    Ok(rows)
}

/// Pairs of reports and people in all frames.
struct Pairing {
    frames: Vec<FramePairing>,
    /// Tracks of each person in chronological order: index of the frame, and ID.
    tracks_of: BTreeMap<i64, Vec<(usize, i64)>>,
    /// For each person an ID that no report has.
    own_ids: BTreeMap<i64, i64>,
}

/// Pairs of reports and people in one frame, by their indices in the frame of the sequence.
#[derive(Default)]
struct FramePairing {
    /// Reports with their person.
    pairs: Vec<(usize, usize)>,
    /// Reports without a person.
    false_reports: Vec<usize>,
    /// People without a report.
    misses: Vec<usize>,
}

impl Pairing {
    fn new(sequence: &Sequence, comparison: &Comparison) -> Result<Self, EvalError> {
        let prepared = Prepared::new(sequence, comparison)?;
        let mut matcher = Matcher::new();
        let mut frames = Vec::with_capacity(prepared.frames.len());
        let mut tracks_of: BTreeMap<i64, Vec<(usize, i64)>> = BTreeMap::new();
        for (number, (prepared, frame)) in prepared.frames.iter().zip(&sequence.frames).enumerate()
        {
            let paired = FramePairing::new(prepared, &mut matcher);
            for (report, truth) in &paired.pairs {
                let track = (number, frame.reports[*report].id);
                tracks_of.entry(frame.truths[*truth].id).or_default().push(track);
            }
            frames.push(paired);
        }
        Ok(Self { frames, tracks_of, own_ids: own_ids(sequence) })
    }

    /// Returns the sequence with one kind of error repaired.
    fn repaired(&self, sequence: &Sequence, repair: Repair) -> Sequence {
        let mut repaired = sequence.clone();
        for (number, frame) in repaired.frames.iter_mut().enumerate() {
            let paired = &self.frames[number];
            match repair {
                Repair::FalseReports => drop_reports(frame, &paired.false_reports),
                Repair::Misses => self.fill(frame, number),
                _ => {
                    for (report, truth) in &paired.pairs {
                        let truth = frame.truths[*truth];
                        self.repair_report(&mut frame.reports[*report], &truth, repair);
                    }
                }
            }
        }
        repaired
    }

    fn repair_report(&self, report: &mut Report, truth: &Truth, repair: Repair) {
        match repair {
            Repair::Identities => report.id = self.own_ids[&truth.id],
            Repair::Places => {
                report.region = truth.region.or(report.region);
                report.floor_m = truth.floor_m.or(report.floor_m);
            }
            _ => {
                if let (Some(region), Some(right)) = (&mut report.region, &truth.region) {
                    repair_region(region, right, repair);
                }
            }
        }
    }

    /// Adds a report for each missed person of a frame.
    fn fill(&self, frame: &mut Frame, number: usize) {
        for place in &self.frames[number].misses {
            let truth = frame.truths[*place];
            let near = self.track_near(truth.id, number);
            let free = near.filter(|id| frame.reports.iter().all(|report| report.id != *id));
            let id = free.unwrap_or(self.own_ids[&truth.id]);
            let Truth { region, floor_m, .. } = truth;
            frame.reports.push(Report { id, region, floor_m, ..Report::default() });
        }
    }

    /// Returns the track that a person had last before a frame, or has next after it.
    fn track_near(&self, person: i64, number: usize) -> Option<i64> {
        let tracks = self.tracks_of.get(&person)?;
        let later = tracks.partition_point(|(frame, _)| *frame < number);
        let (_, id) = tracks[..later].last().or_else(|| tracks.get(later))?;
        Some(*id)
    }
}

/// Returns an ID for each person that no report has.
fn own_ids(sequence: &Sequence) -> BTreeMap<i64, i64> {
    let mut people = BTreeMap::new();
    let mut free_id = 0;
    for frame in &sequence.frames {
        for report in &frame.reports {
            free_id = report.id.saturating_add(1).max(free_id);
        }
        people.extend(frame.truths.iter().map(|truth| (truth.id, 0)));
    }
    for (own_id, free_id) in people.values_mut().zip(free_id..) {
        *own_id = free_id;
    }
    people
}

impl FramePairing {
    fn new(prepared: &PreparedFrame, matcher: &mut Matcher) -> Self {
        let mut near = prepared.pairs.clone();
        near.retain(|pair| pair.weight >= PAIRED_SIMILARITY);
        let mut matched = Vec::new();
        matcher.best(prepared.truths.len(), prepared.tracks.len(), &near, &mut matched);
        let mut paired = Self::default();
        let mut is_found = vec![false; prepared.truths.len()];
        let mut is_right = vec![false; prepared.tracks.len()];
        for edge in matched {
            let Edge { row, col, .. } = near[edge as usize];
            is_found[row as usize] = true;
            is_right[col as usize] = true;
            let report = prepared.track_at[col as usize] as usize;
            paired.pairs.push((report, prepared.truth_at[row as usize] as usize));
        }
        paired.misses = left(&prepared.truth_at, &is_found);
        paired.false_reports = left(&prepared.track_at, &is_right);
        paired
    }
}

/// Returns the indices that are not marked.
fn left(places: &[u32], marked: &[bool]) -> Vec<usize> {
    let unmarked = places.iter().zip(marked).filter(|(_, marked)| !**marked);
    unmarked.map(|(place, _)| *place as usize).collect()
}

fn drop_reports(frame: &mut Frame, places: &[usize]) {
    let mut place = 0;
    frame.reports.retain(|_| {
        place += 1;
        !places.contains(&(place - 1))
    });
}

/// Repairs one property of a box and keeps the others.
fn repair_region(region: &mut Region, right: &Region, repair: Repair) {
    let middle_x = region.x + 0.5 * region.width;
    let middle_y = region.y + 0.5 * region.height;
    match repair {
        Repair::Heights => region.y += right.y + 0.5 * right.height - middle_y,
        Repair::Sideways => region.x += right.x + 0.5 * right.width - middle_x,
        Repair::Sizes => {
            let Region { width, height, .. } = *right;
            *region = Region::new(middle_x - 0.5 * width, middle_y - 0.5 * height, width, height);
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Role;

    fn person(id: i64, x: f64) -> Truth {
        Truth { id, region: Some(Region::new(x, 0.0, 20.0, 40.0)), ..Truth::default() }
    }

    fn report(id: i64, [x, y, width, height]: [f64; 4]) -> Report {
        Report {
            id,
            region: Some(Region::new(x, y, width, height)),
            score: 1.0,
            ..Report::default()
        }
    }

    fn sequence(frames: Vec<(Vec<Truth>, Vec<Report>)>) -> Sequence {
        let frames = frames.into_iter().enumerate().map(|(number, (truths, reports))| Frame {
            stamp_ns: number as i64,
            truths,
            reports,
            ..Frame::default()
        });
        Sequence { name: "test".into(), frames: frames.collect() }
    }

    fn figures(sequence: &Sequence, repair: Repair) -> [f64; 3] {
        let rows = repairs(sequence, &Similarity::Iou.into()).unwrap();
        let row = rows.iter().find(|row| row.repair == repair).unwrap();
        [row.hota, row.mota, row.idf1].map(Option::unwrap)
    }

    /// One kind of error each, which its repair removes and no other.
    #[test]
    fn each_repair_removes_its_own_errors_alone() {
        let right = [0.0, 0.0, 20.0, 40.0];
        let swapped = sequence(vec![
            (vec![person(1, 0.0)], vec![report(5, right)]),
            (vec![person(1, 0.0)], vec![report(6, right)]),
        ]);
        let extra = sequence(vec![(
            vec![person(1, 0.0)],
            vec![report(5, right), report(6, [100.0, 0.0, 20.0, 40.0])],
        )]);
        let missed = sequence(vec![
            (vec![person(1, 0.0)], vec![report(5, right)]),
            (vec![person(1, 0.0)], vec![]),
        ]);
        let low = one([0.0, 20.0, 20.0, 40.0]);
        let aside = one([12.0, 0.0, 20.0, 40.0]);
        let large = one([-10.0, -20.0, 40.0, 80.0]);
        let cases = [
            (swapped, vec![Repair::Identities]),
            (extra, vec![Repair::FalseReports]),
            (missed, vec![Repair::Misses]),
            (low, vec![Repair::Places, Repair::Heights]),
            (aside, vec![Repair::Places, Repair::Sideways]),
            (large, vec![Repair::Places, Repair::Sizes]),
        ];
        for (sequence, cures) in cases {
            let before = Scores::measure(&sequence, Similarity::Iou).unwrap();
            assert!(before.hota.unwrap() < 1.0);
            for repair in Repair::ALL {
                let after = figures(&sequence, repair);
                if cures.contains(&repair) {
                    assert_eq!(after, [1.0; 3], "{cures:?}");
                } else {
                    let before = [before.hota, before.mota, before.idf1].map(Option::unwrap);
                    assert_eq!(after, before, "{repair:?} of {cures:?}");
                }
            }
        }
    }

    fn one(region: [f64; 4]) -> Sequence {
        sequence(vec![(vec![person(1, 0.0)], vec![report(5, region)])])
    }

    /// A missed person gets the track from before; where that is on another person, one of its own.
    #[test]
    fn a_filled_miss_goes_on_with_the_track_of_its_person() {
        fn people() -> Vec<Truth> {
            vec![person(1, 0.0), person(2, 100.0)]
        }

        let right = [0.0, 0.0, 20.0, 40.0];
        let other = [100.0, 0.0, 20.0, 40.0];
        let swapped = sequence(vec![
            (people(), vec![report(5, right), report(6, other)]),
            (people(), vec![report(5, other)]),
        ]);
        let pairing = Pairing::new(&swapped, &Similarity::Iou.into()).unwrap();
        let filled = pairing.repaired(&swapped, Repair::Misses);
        let ids: Vec<i64> = filled.frames[1].reports.iter().map(|report| report.id).collect();
        assert_eq!(ids, [5, 7], "5 is on the other person");
        let later = sequence(vec![(people(), vec![]), (people(), vec![report(5, right)])]);
        let pairing = Pairing::new(&later, &Similarity::Iou.into()).unwrap();
        let filled = pairing.repaired(&later, Repair::Misses);
        let ids: Vec<i64> = filled.frames[0].reports.iter().map(|report| report.id).collect();
        assert_eq!(ids[0], 5, "the track that comes later");
        assert_eq!(figures(&later, Repair::Misses)[1], 1.0);
    }

    #[test]
    fn people_who_do_not_count_stay_as_they_are() {
        let ignored = Truth { role: Role::Ignored, ..person(1, 0.0) };
        let sequence = sequence(vec![(
            vec![ignored, person(2, 100.0)],
            vec![report(5, [1.0, 1.0, 20.0, 40.0])],
        )]);
        let pairing = Pairing::new(&sequence, &Similarity::Iou.into()).unwrap();
        for repair in Repair::ALL {
            let repaired = pairing.repaired(&sequence, repair);
            assert_eq!(repaired.frames[0].reports[0], sequence.frames[0].reports[0], "{repair:?}");
        }
    }

    #[test]
    fn places_on_the_floor_have_no_size() {
        let truth = Truth { id: 1, floor_m: Some([0.0, 0.0]), ..Truth::default() };
        let report = Report { id: 1, floor_m: Some([0.7, 0.0]), ..Report::default() };
        let rows =
            repairs(&sequence(vec![(vec![truth], vec![report])]), &Similarity::Metres.into());
        let rows = rows.unwrap();
        assert_eq!(rows.len(), 4);
        let places = rows.iter().find(|row| row.repair == Repair::Places).unwrap();
        assert_eq!((places.hota, places.mota), (Some(1.0), Some(1.0)));
    }
}
