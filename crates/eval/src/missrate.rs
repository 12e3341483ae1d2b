//! Log-average miss rate and average precision of detections by their scores.

use serde::{Deserialize, Serialize};

use crate::ratio;
use crate::types::{Frame, Region, Report, Role, Sequence, Similarity, Truth};

/// False positives per image at which the miss rate is read.
pub const REFERENCE_FPPI: [f64; 9] =
    [0.01, 0.0178, 0.0316, 0.0562, 0.1, 0.1778, 0.3162, 0.5623, 1.0];

/// Lowest miss rate that enters the logarithm.
const FLOOR: f64 = 1e-10;

/// Every detection with its score and its correctness: the data of the miss-rate curve and of the
/// precision-recall curve.
///
/// The protocol is that of the Caltech benchmark (Dollár et al., PAMI 2012): detections in order of
/// descending score each take the best free truth, a counted one before an ignored one. An ignored
/// truth absorbs any number of detections; the overlap with it is relative to the area of the
/// detection.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct DetectionTally {
    /// Scores and verdicts of the detections that count.
    pub verdicts: Vec<Verdict>,
    /// Truths that count.
    pub truths: u64,
    /// Number of images, including those without people.
    pub images: u64,
}

/// Result for one detection that counts.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Verdict {
    /// Confidence of the detector.
    pub score: f64,
    /// True if it is matched with a truth of its own.
    pub right: bool,
}

/// Point of the curve: the result of accepting all detections with at least this score.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Lowest accepted score.
    pub score: f64,
    /// False positives per image.
    pub fppi: f64,
    /// Fraction of the truths that are missed.
    pub miss_rate: f64,
    /// Fraction of the accepted detections that are right.
    pub precision: f64,
}

impl DetectionTally {
    /// Scores the reports of a sequence as single detections; `at_least` is the minimum similarity
    /// of a match (0.5 in the protocol).
    pub fn measure(sequence: &Sequence, similarity: Similarity, at_least: f64) -> Self {
        let mut tally = Self { images: sequence.frames.len() as u64, ..Self::default() };
        for frame in &sequence.frames {
            tally.add(frame, &Judge { similarity, at_least });
        }
        tally
    }

    /// Combines the detections of several sequences.
    pub fn combine<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        all.into_iter().fold(Self::default(), |mut sum, one| {
            sum.verdicts.extend_from_slice(&one.verdicts);
            sum.truths += one.truths;
            sum.images += one.images;
            sum
        })
    }

    fn add(&mut self, frame: &Frame, judge: &Judge) {
        let real: Vec<&Truth> = frame.truths.iter().filter(|t| t.role == Role::Counts).collect();
        self.truths += real.len() as u64;
        let mut taken = vec![false; real.len()];
        let mut reports: Vec<&Report> = frame.reports.iter().collect();
        // In descending score, so that a weak detection cannot take the truth of a strong one.
        reports.sort_by(|a, b| b.score.total_cmp(&a.score));
        for report in reports {
            let right = match judge.best_free(&real, &taken, report) {
                Some(index) => {
                    taken[index] = true;
                    true
                }
                None if judge.ignored(frame, report) => continue,
                None => false,
            };
            self.verdicts.push(Verdict { score: report.score, right });
        }
    }

    /// Returns the curve from the highest score to the lowest, with one point for each distinct
    /// score, because no threshold lies between equal ones.
    pub fn curve(&self) -> Vec<CurvePoint> {
        let mut sorted = self.verdicts.clone();
        sorted.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut right = 0_u64;
        let mut wrong = 0_u64;
        let mut points = Vec::new();
        // Detections of equal score are accepted together, because their order has no meaning.
        for equal in sorted.chunk_by(|a, b| a.score == b.score) {
            let found = equal.iter().filter(|v| v.right).count() as u64;
            right += found;
            wrong += equal.len() as u64 - found;
            points.push(CurvePoint {
                score: equal[0].score,
                fppi: ratio(wrong as f64, self.images as f64),
                miss_rate: 1.0 - ratio(right as f64, self.truths as f64),
                precision: ratio(right as f64, (right + wrong) as f64),
            });
        }
        points
    }

    /// Returns the log-average miss rate, 0 to 1: the geometric mean of the miss rates at the
    /// [`REFERENCE_FPPI`], each read at the last point of the curve that does not exceed it (1 if
    /// there is none). `None` without truths.
    pub fn log_average_miss_rate(&self) -> Option<f64> {
        if self.truths == 0 {
            return None;
        }
        let curve = self.curve();
        let mut sum = 0.0;
        for fppi in REFERENCE_FPPI {
            // Left of the curve all people are missed, as in the Caltech benchmark.
            let within = curve.partition_point(|point| point.fppi <= fppi);
            let rate = within.checked_sub(1).map_or(1.0, |last| curve[last].miss_rate);
            // Guards against a miss rate of 0, whose logarithm is infinite.
            sum += rate.max(FLOOR).ln();
        }
        Some((sum / REFERENCE_FPPI.len() as f64).exp())
    }

    /// Returns the number of distinct scores. With a single one, no threshold separates some
    /// detections from others: the curve is one point, and its averages have no meaning.
    pub fn distinct_scores(&self) -> usize {
        let mut scores: Vec<f64> = self.verdicts.iter().map(|verdict| verdict.score).collect();
        scores.sort_by(f64::total_cmp);
        scores.dedup();
        scores.len()
    }

    /// Returns the area under the precision-recall curve, with the precision made monotonic from
    /// the right (all-point interpolation, Pascal VOC 2010). `None` without truths.
    pub fn average_precision(&self) -> Option<f64> {
        if self.truths == 0 {
            return None;
        }
        let mut area = 0.0;
        let mut best = 0.0_f64;
        let mut recall_after = None;
        // From the right, so that precision is made monotonic on the way.
        for point in self.curve().iter().rev() {
            let recall = 1.0 - point.miss_rate;
            area += best * (recall_after.unwrap_or(recall) - recall);
            best = best.max(point.precision);
            recall_after = Some(recall);
        }
        Some(area + best * recall_after.unwrap_or(0.0))
    }
}

struct Judge {
    similarity: Similarity,
    at_least: f64,
}

impl Judge {
    fn best_free(&self, real: &[&Truth], taken: &[bool], report: &Report) -> Option<usize> {
        let mut best = None;
        let mut at_least = self.at_least;
        for (index, truth) in real.iter().enumerate().filter(|(index, _)| !taken[*index]) {
            let similarity = self.similarity.between(truth, report);
            if similarity >= at_least && (best.is_none() || similarity > at_least) {
                best = Some(index);
                at_least = similarity;
            }
        }
        best
    }

    fn ignored(&self, frame: &Frame, report: &Report) -> bool {
        let mut ignored = frame.truths.iter().filter(|t| t.role == Role::Ignored);
        ignored.any(|truth| match (self.similarity, &truth.region) {
            (Similarity::Iou, Some(region)) => self.is_inside(report, region),
            _ => self.similarity.between(truth, report) >= self.at_least,
        }) || frame.ignore_regions.iter().any(|region| self.is_inside(report, region))
    }

    /// Returns true if the report overlaps this ignored truth enough. The overlap is relative to
    /// the area of the report, because an ignored truth may contain a whole crowd.
    fn is_inside(&self, report: &Report, region: &Region) -> bool {
        report.region.is_some_and(|r| r.covered_by(region) >= self.at_least)
    }
}
