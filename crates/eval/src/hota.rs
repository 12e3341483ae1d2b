//! HOTA, with its detection and association accuracy at nineteen similarity thresholds.
//!
//! Pairs compete by similarity times the alignment of their whole tracks. If several matchings have
//! the same sum, [`Matcher`] chooses one by the order of the pairs: that of the truths and then of
//! the tracks in the frame. A similarity that equals a threshold reaches it.

use serde::{Deserialize, Serialize};

use crate::pairs::PairTable;
use crate::prepare::{Prepared, PreparedFrame};
use crate::ratio;
use tagalong_math::matching::{Edge, Matcher};

/// Number of similarity thresholds.
pub const LEVELS: usize = 19;

/// Returns the threshold of a level: 0.05, 0.10, ... 0.95.
pub fn alpha(level: usize) -> f64 {
    0.05 + level as f64 * 0.05
}

/// The HOTA family (Luiten et al., IJCV 2021) at one similarity threshold.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct HotaLevel {
    /// Matched truths.
    pub tp: u64,
    /// Truths without a report.
    #[serde(rename = "fn")]
    pub fn_: u64,
    /// Reports without a truth.
    pub fp: u64,
    /// Association accuracy summed over all matches.
    pub association_sum: f64,
    /// Association recall summed over all matches.
    pub association_recall_sum: f64,
    /// Association precision summed over all matches.
    pub association_precision_sum: f64,
    /// Similarity summed over all matches.
    pub similarity_sum: f64,
}

impl HotaLevel {
    /// Returns the detection accuracy `TP / (TP + FN + FP)`.
    pub fn det_a(&self) -> f64 {
        ratio(self.tp as f64, (self.tp + self.fn_ + self.fp) as f64)
    }

    /// Returns the association accuracy, the mean over the matches.
    pub fn ass_a(&self) -> f64 {
        ratio(self.association_sum, self.tp as f64)
    }

    /// Returns `sqrt(DetA * AssA)`.
    pub fn hota(&self) -> f64 {
        (self.det_a() * self.ass_a()).sqrt()
    }

    /// Returns the mean similarity of the matches; 1 without any, as in TrackEval.
    pub fn loc_a(&self) -> f64 {
        // TrackEval's guard against a division by 0, kept so that the digits agree.
        self.similarity_sum.max(1e-10) / (self.tp as f64).max(1e-10)
    }

    /// Returns the detection recall.
    pub fn det_re(&self) -> f64 {
        ratio(self.tp as f64, (self.tp + self.fn_) as f64)
    }

    /// Returns the detection precision.
    pub fn det_pr(&self) -> f64 {
        ratio(self.tp as f64, (self.tp + self.fp) as f64)
    }

    /// Returns the association recall, the mean over the matches.
    pub fn ass_re(&self) -> f64 {
        ratio(self.association_recall_sum, self.tp as f64)
    }

    /// Returns the association precision, the mean over the matches.
    pub fn ass_pr(&self) -> f64 {
        ratio(self.association_precision_sum, self.tp as f64)
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            tp: self.tp + other.tp,
            fn_: self.fn_ + other.fn_,
            fp: self.fp + other.fp,
            association_sum: self.association_sum + other.association_sum,
            association_recall_sum: self.association_recall_sum + other.association_recall_sum,
            association_precision_sum: self.association_precision_sum
                + other.association_precision_sum,
            similarity_sum: self.similarity_sum + other.similarity_sum,
        }
    }
}

/// The HOTA family at all nineteen thresholds.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Hota {
    /// One entry for each threshold, see [`alpha`].
    pub levels: [HotaLevel; LEVELS],
}

impl Hota {
    /// Scores one sequence. The matching does not depend on the threshold, so it is computed once;
    /// each match is counted at the highest threshold that it passes, and cumulative sums then give
    /// all nineteen levels.
    pub fn measure(prepared: &Prepared, table: &PairTable) -> Self {
        let alignment = alignment(prepared, table);
        let mut run = Run {
            matcher: Matcher::new(),
            scored: Vec::new(),
            chosen: Vec::new(),
            matches: vec![[0; LEVELS]; table.pairs.len()],
            hota: Self::default(),
        };
        let mut rest = &table.pair_of[..];
        for frame in &prepared.frames {
            let (pair_of, others) = rest.split_at(frame.pairs.len());
            run.step(frame, pair_of, &alignment);
            rest = others;
        }
        run.finish(prepared, table)
    }

    /// Combines several sequences; each match has the same weight.
    pub fn combine<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        all.into_iter().fold(Self::default(), |sum, one| Self {
            levels: std::array::from_fn(|a| sum.levels[a].plus(&one.levels[a])),
        })
    }

    /// Returns the mean of a figure over the thresholds.
    ///
    /// ```
    /// use tagalong_eval::{Hota, HotaLevel};
    /// assert_eq!(Hota::default().mean(HotaLevel::hota), 0.0);
    /// ```
    pub fn mean(&self, figure: impl Fn(&HotaLevel) -> f64) -> f64 {
        self.levels.iter().map(figure).sum::<f64>() / LEVELS as f64
    }
}

/// Computes the alignment of each pair over the whole sequence, 0 to 1: the soft Jaccard index of
/// their frames (Luiten et al., section 5; as in TrackEval, a similarity is first divided by the
/// sum of all that compete with it).
fn alignment(prepared: &Prepared, table: &PairTable) -> Vec<f64> {
    let mut together = vec![0.0; table.pairs.len()];
    let mut of_row = Vec::new();
    let mut of_col = Vec::new();
    let mut indices = table.pair_of.iter();
    for frame in &prepared.frames {
        sums(frame, &mut of_row, &mut of_col);
        for (pair, &index) in frame.pairs.iter().zip(&mut indices) {
            let rivals = of_col[pair.col as usize] + of_row[pair.row as usize] - pair.weight;
            // Without any similarity to others this would be 0 / 0.
            if rivals > f64::EPSILON {
                together[index as usize] += pair.weight / rivals;
            }
        }
    }
    let pairs = table.pairs.iter().zip(together);
    let jaccard = pairs.map(|(&(truth, track), both)| {
        // Jaccard index: the intersection over the union, in frames weighted by their share.
        let either = prepared.truth_frames[truth as usize] + prepared.track_frames[track as usize];
        both / (f64::from(either) - both)
    });
    jaccard.collect()
}

/// Sums the similarities in each row and column.
fn sums(frame: &PreparedFrame, of_row: &mut Vec<f64>, of_col: &mut Vec<f64>) {
    of_row.clear();
    of_row.resize(frame.truths.len(), 0.0);
    of_col.clear();
    of_col.resize(frame.tracks.len(), 0.0);
    for pair in &frame.pairs {
        of_row[pair.row as usize] += pair.weight;
        of_col[pair.col as usize] += pair.weight;
    }
}

struct Run {
    matcher: Matcher,
    scored: Vec<Edge>,
    chosen: Vec<u32>,
    /// For each pair, the number of matches whose highest threshold is the level.
    matches: Vec<[u32; LEVELS]>,
    hota: Hota,
}

impl Run {
    fn step(&mut self, frame: &PreparedFrame, pair_of: &[u32], alignment: &[f64]) {
        let truths = frame.truths.len();
        let tracks = frame.tracks.len();
        // At first all are unmatched; `add` removes the matched ones again.
        for level in &mut self.hota.levels {
            level.fn_ += truths as u64;
            level.fp += tracks as u64;
        }
        self.scored.clear();
        self.scored.extend(frame.pairs.iter().zip(pair_of).map(|(pair, &index)| Edge {
            // Weighted by the global alignment, so that long-lived pairs are preferred (Luiten et
            // al.).
            weight: alignment[index as usize] * pair.weight,
            ..*pair
        }));
        self.matcher.best(truths, tracks, &self.scored, &mut self.chosen);
        for &e in &self.chosen {
            let similarity = frame.pairs[e as usize].weight;
            if let Some(level) = highest_level(similarity) {
                self.matches[pair_of[e as usize] as usize][level] += 1;
                self.hota.levels[level].similarity_sum += similarity;
            }
        }
    }

    fn finish(mut self, prepared: &Prepared, table: &PairTable) -> Hota {
        // A match at a level is also a match at all lower levels.
        for level in (0..LEVELS - 1).rev() {
            self.hota.levels[level].similarity_sum += self.hota.levels[level + 1].similarity_sum;
        }
        for (counts, &(truth, track)) in self.matches.iter().zip(&table.pairs) {
            let of_truth = prepared.truth_frames[truth as usize];
            let of_track = prepared.track_frames[track as usize];
            let mut both = 0;
            for level in (0..LEVELS).rev() {
                both += counts[level];
                self.hota.levels[level].add(both, of_truth, of_track);
            }
        }
        self.hota
    }
}

impl HotaLevel {
    /// Adds a pair that is matched in `both` frames, of the `of_truth` and `of_track` frames of its
    /// two sides.
    fn add(&mut self, both: u32, of_truth: u32, of_track: u32) {
        let n = f64::from(both);
        let truth = f64::from(of_truth);
        let track = f64::from(of_track);
        self.tp += u64::from(both);
        self.fn_ -= u64::from(both);
        self.fp -= u64::from(both);
        self.association_sum += n * n / (truth + track - n).max(1.0);
        self.association_recall_sum += n * n / truth.max(1.0);
        self.association_precision_sum += n * n / track.max(1.0);
    }
}

/// Returns the highest level whose threshold the similarity reaches.
fn highest_level(similarity: f64) -> Option<usize> {
    (0..LEVELS).rev().find(|&level| similarity >= alpha(level) - f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_similarity_at_a_threshold_reaches_it_and_one_below_does_not() {
        for level in 0..LEVELS {
            assert_eq!(highest_level(alpha(level)), Some(level));
            assert_eq!(highest_level(alpha(level) - 1e-9), level.checked_sub(1));
        }
    }
}
