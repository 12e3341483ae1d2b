//! Assignment by similarity, in stages, as in several trackers of boxes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::Detection;
use tagalong_geometry::Rect;

use crate::{AppearanceFusion, Fusion, assign};

/// Tracks and detections that a stage may pair, by their numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stage {
    /// Tracks.
    pub rows: Vec<usize>,
    /// Detections.
    pub columns: Vec<usize>,
}

/// Detections given to tracks, stage by stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Staged {
    given: Vec<Option<usize>>,
    taken: Vec<bool>,
}

impl Staged {
    /// Creates the state before the first stage.
    pub fn new(tracks: usize, detections: usize) -> Self {
        Self { given: vec![None; tracks], taken: vec![false; detections] }
    }

    /// Returns the tracks without a detection and the detections without a track that are wanted.
    pub fn open(&self, track: impl Fn(usize) -> bool, detection: impl Fn(usize) -> bool) -> Stage {
        let rows = (0..self.given.len()).filter(|at| self.given[*at].is_none() && track(*at));
        let columns = (0..self.taken.len()).filter(|at| !self.taken[*at] && detection(*at));
        Stage { rows: rows.collect(), columns: columns.collect() }
    }

    /// Pairs the tracks and detections of a stage so that the sum of the similarities is largest;
    /// `None` is a pair that must not be.
    pub fn assign(&mut self, stage: &Stage, similarity: impl Fn(usize, usize) -> Option<f64>) {
        let Stage { rows, columns } = stage;
        // Computed once, because the assignment asks for a pair several times.
        let similarities: Vec<Vec<Option<f64>>> = rows
            .iter()
            .map(|row| columns.iter().map(|column| similarity(*row, *column)).collect())
            .collect();
        let missed = vec![0.0; rows.len()];
        let found =
            assign(columns.len(), &missed, |row, column| similarities[row][column].map(|s| -s));
        for (row, column) in rows.iter().zip(found) {
            let column = column.map(|column| columns[column]);
            self.given[*row] = column;
            column.into_iter().for_each(|column| self.taken[column] = true);
        }
    }

    /// Returns the detection of each track.
    pub fn given(&self) -> &[Option<usize>] {
        &self.given
    }

    /// Returns the detections without a track that are wanted.
    pub fn left(&self, detection: impl Fn(usize) -> bool) -> Vec<usize> {
        (0..self.taken.len()).filter(|at| !self.taken[*at] && detection(*at)).collect()
    }
}

/// Returns the overlap (IoU) of two boxes that are each enlarged on every side by the fraction
/// `buffer` of its width and height (C-BIoU: Yang et al., WACV 2023).
///
/// ```
/// use tagalong_associators::buffered_iou;
/// use tagalong_geometry::Rect;
/// let (a, b) = (Rect::new(0.0, 0.0, 10.0, 10.0), Rect::new(12.0, 0.0, 10.0, 10.0));
/// assert_eq!(buffered_iou(&a, &b, 0.0), 0.0);
/// assert_eq!(buffered_iou(&a, &b, 0.5), 8.0 / 32.0);
/// ```
pub fn buffered_iou(a: &Rect, b: &Rect, buffer: f64) -> f64 {
    // `inflated` adds its fraction once, half of it on each side.
    a.inflated(2.0 * buffer).iou(&b.inflated(2.0 * buffer))
}

/// Returns the probability with these log-odds.
pub fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

/// Order of detections and tracks, by score and confirmation, and the weight of the appearance in
/// associators of boxes; flattened into their settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct StageSettings {
    /// Log-odds from which a detection is strong; 0.405 is a probability of 0.6.
    pub strong_log_odds: f64,
    /// Tentative tracks get only the detections that confirmed tracks leave.
    pub confirmed_first: bool,
    /// Weights the overlap with the probability of the detection.
    pub weigh_by_score: bool,
    /// Combination with the appearance of a pair (`[reidentification] association_weight`): added
    /// to the position (`sum`), or the better of the two (`minimum`).
    pub fusion: Fusion,
    /// For `minimum`: least overlap of the boxes, enlarged as in their stage, at which the
    /// appearance counts. BoT-SORT has 0.5.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub fusion_gate: f64,
}

impl Default for StageSettings {
    fn default() -> Self {
        Self {
            strong_log_odds: 0.405,
            confirmed_first: false,
            weigh_by_score: false,
            fusion: Fusion::Minimum,
            fusion_gate: 0.0,
        }
    }
}

impl StageSettings {
    /// Returns true for a strong detection.
    pub fn is_strong(&self, detection: &Detection) -> bool {
        detection.score >= self.strong_log_odds
    }

    /// Returns the similarity of a track and a detection from the overlap of their boxes and the
    /// log-likelihood ratio of their appearances.
    pub fn similarity(&self, overlap: f64, detection: &Detection, log_ratio: f64) -> f64 {
        let appearance = AppearanceFusion { fusion: self.fusion, gate: self.fusion_gate };
        let similarity = appearance.similarity(overlap, log_ratio);
        if self.weigh_by_score { similarity * probability(detection.score) } else { similarity }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_later_stage_gets_those_that_are_left() {
        let mut staged = Staged::new(3, 3);
        let first = staged.open(|track| track < 2, |detection| detection != 1);
        assert_eq!(first, Stage { rows: vec![0, 1], columns: vec![0, 2] });
        staged.assign(&first, |track, detection| (track == 1 && detection == 2).then_some(0.5));
        assert_eq!(staged.given(), [None, Some(2), None]);
        let second = staged.open(|_| true, |_| true);
        assert_eq!(second, Stage { rows: vec![0, 2], columns: vec![0, 1] });
        staged.assign(&second, |track, detection| (track == 2 && detection == 0).then_some(0.5));
        assert_eq!(staged.given(), [None, Some(2), Some(0)]);
        assert_eq!(staged.left(|_| true), [1]);
    }

    #[test]
    fn the_sum_of_the_similarities_counts() {
        let similarity = [[0.6, 0.5], [0.55, 0.1]];
        let mut staged = Staged::new(2, 2);
        let all = staged.open(|_| true, |_| true);
        staged.assign(&all, |track, detection| Some(similarity[track][detection]));
        assert_eq!(staged.given(), [Some(1), Some(0)]);
    }

    #[test]
    fn a_pair_that_is_worse_than_none_is_not_formed() {
        let mut staged = Staged::new(1, 1);
        let all = staged.open(|_| true, |_| true);
        staged.assign(&all, |_, _| Some(-0.1));
        assert_eq!(staged.given(), [None]);
    }
}
