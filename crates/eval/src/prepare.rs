//! Sequences as the metrics compare them: without ignored people, with similarities.

use crate::error::EvalError;
use crate::types::{Frame, Report, Role, Sequence, Similarity, Truth};
use tagalong_math::matching::{Edge, Matcher};

/// Rules for comparing truth and reports before anything is counted.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Comparison {
    /// Similarity of a truth and a report.
    pub similarity: Similarity,
    /// Minimum similarity at which a report that matches an ignored truth is left out; 0.5 as in
    /// TrackEval.
    pub ignore_similarity: f64,
    /// Fraction of an unmatched report inside an ignore region above which it
    /// is left out; 0.5 as in TrackEval's KITTI rules.
    pub ignore_covered: f64,
    /// Unmatched reports of at most this height are left out, in pixels; 25 in TrackEval's KITTI
    /// rules, otherwise absent.
    pub ignore_unmatched_below_px: Option<f64>,
}

impl Default for Comparison {
    fn default() -> Self {
        Self {
            similarity: Similarity::Iou,
            ignore_similarity: 0.5,
            ignore_covered: 0.5,
            ignore_unmatched_below_px: None,
        }
    }
}

impl From<Similarity> for Comparison {
    fn from(similarity: Similarity) -> Self {
        Self { similarity, ..Self::default() }
    }
}

/// Frame without the ignored truths and reports.
#[derive(Clone, Debug, Default)]
pub struct PreparedFrame {
    /// Time, in nanoseconds.
    pub stamp_ns: i64,
    /// People, as indices into [`Prepared::truth_ids`].
    pub truths: Vec<u32>,
    /// Reports, as indices into [`Prepared::track_ids`].
    pub tracks: Vec<u32>,
    /// For each of `truths`, its index in the frame of the sequence.
    pub truth_at: Vec<u32>,
    /// For each of `tracks`, its index in the frame of the sequence.
    pub track_at: Vec<u32>,
    /// All pairs with a similarity above zero, row by row: rows are indices into `truths`, columns
    /// indices into `tracks`, the weight is the similarity.
    pub pairs: Vec<Edge>,
}

/// Sequence prepared for the metrics: ignored truths and the reports on them are removed, IDs are
/// numbered from zero, and similarities are computed once.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// IDs of the truths in ascending order.
    pub truth_ids: Vec<i64>,
    /// IDs of the tracks in ascending order.
    pub track_ids: Vec<i64>,
    /// The frames.
    pub frames: Vec<PreparedFrame>,
    /// Number of frames in which each truth counts.
    pub truth_frames: Vec<u32>,
    /// Number of frames in which each track is reported.
    pub track_frames: Vec<u32>,
}

impl Prepared {
    /// Compares truth and reports of each frame and removes everything that does not count.
    ///
    /// The rules are those of TrackEval for MOT16 to MOT20 (Milan et al., arXiv 1603.00831, section
    /// 4): all truths of a frame, whatever their [`Role`], are matched with the reports; a report
    /// that is matched with an ignored truth is removed; then only the truths that count are kept.
    /// Frames without ignored truths need no such matching, which is the MOT15 rule.
    ///
    /// # Errors
    ///
    /// When an ID occurs twice in a frame, the region or position that is compared is missing, a
    /// number is not finite, or the frames are not in order.
    pub fn new(sequence: &Sequence, comparison: &Comparison) -> Result<Self, EvalError> {
        check(sequence, comparison.similarity)?;
        let mut matcher = Matcher::new();
        let mut kept: Vec<PreparedFrame> =
            sequence.frames.iter().map(|frame| reduce(frame, comparison, &mut matcher)).collect();
        let mut prepared = Self {
            truth_ids: unique(&kept, sequence, |frame, of| {
                frame.truth_at.iter().map(|&at| of.truths[at as usize].id).collect()
            }),
            track_ids: unique(&kept, sequence, |frame, of| {
                frame.track_at.iter().map(|&at| of.reports[at as usize].id).collect()
            }),
            ..Self::default()
        };
        prepared.truth_frames = vec![0; prepared.truth_ids.len()];
        prepared.track_frames = vec![0; prepared.track_ids.len()];
        for (frame, of) in kept.iter_mut().zip(&sequence.frames) {
            prepared.renumber(frame, of);
        }
        prepared.frames = kept;
        Ok(prepared)
    }

    /// Returns the number of truths that count, over all frames.
    pub fn truth_count(&self) -> u64 {
        self.truth_frames.iter().map(|&n| u64::from(n)).sum()
    }

    /// Returns the number of reports that count, over all frames.
    pub fn report_count(&self) -> u64 {
        self.track_frames.iter().map(|&n| u64::from(n)).sum()
    }

    fn renumber(&mut self, frame: &mut PreparedFrame, of: &Frame) {
        for &at in &frame.truth_at {
            let index = self.truth_ids.partition_point(|&id| id < of.truths[at as usize].id);
            self.truth_frames[index] += 1;
            frame.truths.push(index as u32);
        }
        for &at in &frame.track_at {
            let index = self.track_ids.partition_point(|&id| id < of.reports[at as usize].id);
            self.track_frames[index] += 1;
            frame.tracks.push(index as u32);
        }
    }
}

fn unique(
    kept: &[PreparedFrame],
    sequence: &Sequence,
    ids: impl Fn(&PreparedFrame, &Frame) -> Vec<i64>,
) -> Vec<i64> {
    let mut all: Vec<i64> =
        kept.iter().zip(&sequence.frames).flat_map(|(frame, of)| ids(frame, of)).collect();
    // Sorted ids make the numbers independent of the order of frames and readers.
    all.sort_unstable();
    all.dedup();
    all
}

/// Returns all pairs of a frame with some similarity, row by row.
fn similar_pairs(frame: &Frame, similarity: Similarity) -> Vec<Edge> {
    let mut pairs = Vec::new();
    for (row, truth) in frame.truths.iter().enumerate() {
        for (col, report) in frame.reports.iter().enumerate() {
            let weight = similarity.between(truth, report);
            // Most pairs have no similarity, and cannot be matched.
            if weight > 0.0 {
                pairs.push(Edge { row: row as u32, col: col as u32, weight });
            }
        }
    }
    pairs
}

fn reduce(frame: &Frame, comparison: &Comparison, matcher: &mut Matcher) -> PreparedFrame {
    let pairs = similar_pairs(frame, comparison.similarity);
    let keep_report = kept_reports(frame, comparison, &pairs, matcher);
    let keep_truth: Vec<bool> = frame.truths.iter().map(|t| t.role == Role::Counts).collect();
    let (truth_at, new_row) = compact(&keep_truth);
    let (track_at, new_col) = compact(&keep_report);
    let pairs = pairs
        .into_iter()
        .filter(|pair| keep_truth[pair.row as usize] && keep_report[pair.col as usize])
        .map(|pair| Edge {
            row: new_row[pair.row as usize],
            col: new_col[pair.col as usize],
            weight: pair.weight,
        })
        .collect();
    PreparedFrame { stamp_ns: frame.stamp_ns, truth_at, track_at, pairs, ..Default::default() }
}

/// Returns the indices that are kept, and for each old index its new one.
fn compact(keep: &[bool]) -> (Vec<u32>, Vec<u32>) {
    let mut stay = Vec::new();
    let mut new = Vec::with_capacity(keep.len());
    for (old, &keep) in keep.iter().enumerate() {
        new.push(stay.len() as u32);
        if keep {
            stay.push(old as u32);
        }
    }
    (stay, new)
}

fn kept_reports(
    frame: &Frame,
    comparison: &Comparison,
    pairs: &[Edge],
    matcher: &mut Matcher,
) -> Vec<bool> {
    let mut keep = vec![true; frame.reports.len()];
    let by_region = !frame.ignore_regions.is_empty();
    let by_size = comparison.ignore_unmatched_below_px.is_some();
    // Without anything to ignore, the matching would change nothing.
    if !by_region && !by_size && frame.truths.iter().all(|t| t.role != Role::Ignored) {
        return keep;
    }
    let enough = comparison.ignore_similarity - f64::EPSILON;
    let near: Vec<Edge> = pairs.iter().copied().filter(|pair| pair.weight >= enough).collect();
    let mut matched = Vec::new();
    matcher.best(frame.truths.len(), frame.reports.len(), &near, &mut matched);
    let mut partner = vec![None; frame.reports.len()];
    for pair in matched.iter().map(|&e| near[e as usize]) {
        partner[pair.col as usize] = Some(frame.truths[pair.row as usize].role);
    }
    for (col, report) in frame.reports.iter().enumerate() {
        // A report that is matched with an ignored truth is neither right nor wrong.
        keep[col] = match partner[col] {
            Some(role) => role != Role::Ignored,
            None => !excused(report, frame, comparison),
        };
    }
    keep
}

/// Returns true for a report that matches no truth and lies in an ignore region or is too small.
fn excused(report: &Report, frame: &Frame, comparison: &Comparison) -> bool {
    let Some(region) = report.region else { return false };
    let small = comparison
        .ignore_unmatched_below_px
        .is_some_and(|below| region.height <= below + f64::EPSILON);
    small
        || frame
            .ignore_regions
            .iter()
            .any(|ignored| region.covered_by(ignored) > comparison.ignore_covered + f64::EPSILON)
}

fn check(sequence: &Sequence, similarity: Similarity) -> Result<(), EvalError> {
    for (index, frame) in sequence.frames.iter().enumerate() {
        if index > 0 && frame.stamp_ns < sequence.frames[index - 1].stamp_ns {
            return Err(EvalError::OutOfOrder {
                sequence: sequence.name.clone(),
                frame: index + 1,
            });
        }
        let at = FrameContext { sequence: &sequence.name, frame: index + 1, similarity };
        at.check_side("truth", frame.truths.iter().map(Someone::from).collect())?;
        at.check_side("track", frame.reports.iter().map(Someone::from).collect())?;
    }
    Ok(())
}

struct FrameContext<'a> {
    sequence: &'a str,
    frame: usize,
    similarity: Similarity,
}

/// Properties that truths and reports have in common.
struct Someone {
    id: i64,
    has_region: bool,
    has_floor: bool,
    /// True if the region or position that is compared may be missing; such a truth does not count
    /// and excuses no report.
    may_lack_place: bool,
    sane: bool,
}

impl From<&Truth> for Someone {
    fn from(truth: &Truth) -> Self {
        let sane = truth.region.is_none_or(|r| r.is_finite())
            && truth.floor_m.is_none_or(|p| p.iter().all(|v| v.is_finite()));
        Self {
            id: truth.id,
            has_region: truth.region.is_some(),
            has_floor: truth.floor_m.is_some(),
            may_lack_place: truth.role != Role::Counts,
            sane,
        }
    }
}

impl From<&Report> for Someone {
    fn from(report: &Report) -> Self {
        let place = Truth {
            id: report.id,
            region: report.region,
            floor_m: report.floor_m,
            ..Truth::default()
        };
        let mut someone = Self::from(&place);
        someone.sane &= !report.score.is_nan();
        someone
    }
}

impl FrameContext<'_> {
    fn check_side(&self, side: &'static str, mut all: Vec<Someone>) -> Result<(), EvalError> {
        let (sequence, frame) = (|| self.sequence.to_owned(), self.frame);
        for Someone { id, has_region, has_floor, may_lack_place, sane } in &all {
            if !sane {
                return Err(EvalError::NotFinite { sequence: sequence(), frame, side, id: *id });
            }
            let (present, what) = match self.similarity {
                Similarity::Iou => (has_region, "image region"),
                Similarity::Metres => (has_floor, "floor position"),
            };
            if !(*present || *may_lack_place) {
                return Err(EvalError::NoPlace {
                    sequence: sequence(),
                    frame,
                    side,
                    id: *id,
                    what,
                });
            }
        }
        // Equal ids are neighbours after sorting.
        all.sort_unstable_by_key(|someone| someone.id);
        match all.windows(2).find(|two| two[0].id == two[1].id) {
            Some(two) => {
                Err(EvalError::DuplicateId { sequence: sequence(), frame, side, id: two[0].id })
            }
            None => Ok(()),
        }
    }
}
