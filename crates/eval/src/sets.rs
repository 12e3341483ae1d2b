//! OSPA and GOSPA: distances between the set of people and that of reports in a frame.

use serde::{Deserialize, Serialize};

use crate::prepare::{Prepared, PreparedFrame};
use crate::types::{Frame, Sequence, Similarity, distance_m};
use tagalong_math::matching::{Edge, Matcher};

/// Settings of the distances between sets.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SetDistance {
    /// Cost of a missed person or a false report, and the maximum distance of a pair: metres on the
    /// floor, or `1 - IoU` in the image (then at most 1).
    pub cutoff: f64,
    /// Order of the mean, at least 1; 2 penalises outliers.
    pub order: f64,
}

impl Default for SetDistance {
    fn default() -> Self {
        Self { cutoff: 1.0, order: 2.0 }
    }
}

impl SetDistance {
    /// Creates settings with this cutoff and order.
    pub fn new(cutoff: f64, order: f64) -> Self {
        Self { cutoff, order }
    }

    /// Computes both distances of one frame from the distances of the pairs that lie below the
    /// cutoff (the weight of an edge is its distance).
    ///
    /// One assignment serves both: in OSPA (Schuhmacher et al., IEEE TSP 2008, equation 3) and in
    /// GOSPA with alpha = 2 (Rahmathullah et al., FUSION 2017, proposition 1) a match saves the
    /// same cost, `cutoff^order - distance^order`.
    pub fn between(&self, truths: usize, reports: usize, near: &[Edge]) -> FrameDistance {
        let pay = self.cutoff.powf(self.order);
        // The solver maximises: the weight of a pair is the cost that it saves against two
        // unmatched ones.
        let mut gains = near.to_vec();
        for edge in &mut gains {
            edge.weight = pay - edge.weight.powf(self.order);
        }
        let mut matched = Vec::new();
        Matcher::new().best(truths, reports, &gains, &mut matched);
        let location: f64 = matched.iter().map(|&e| pay - gains[e as usize].weight).sum();
        let pairs = matched.len();
        let most = truths.max(reports);
        let parts = GospaParts {
            location,
            // Half the penalty for each side, as GOSPA with alpha = 2.
            missed: 0.5 * pay * (truths - pairs) as f64,
            false_: 0.5 * pay * (reports - pairs) as f64,
        };
        // OSPA divides by the larger set; empty sets are at distance 0.
        let mean = (location + pay * (most - pairs) as f64) / most.max(1) as f64;
        // Rounding may bring the sum a little below 0.
        let [ospa, gospa] =
            [mean, parts.total()].map(|value| value.max(0.0).powf(self.order.recip()));
        FrameDistance { ospa, gospa, parts }
    }
}

/// The distances between truth and reports in one frame.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
#[non_exhaustive]
pub struct FrameDistance {
    /// Optimal sub-pattern assignment distance, 0 to the cutoff.
    pub ospa: f64,
    /// Generalised OSPA distance, 0 upwards.
    pub gospa: f64,
    /// Parts of GOSPA.
    pub parts: GospaParts,
}

/// GOSPA before the root is taken, by cause.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GospaParts {
    /// Distances of the matched pairs.
    pub location: f64,
    /// People without a report.
    pub missed: f64,
    /// Reports without a person.
    #[serde(rename = "false")]
    pub false_: f64,
}

impl GospaParts {
    fn total(&self) -> f64 {
        self.location + self.missed + self.false_
    }
}

/// The distances summed over frames.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct SetTally {
    /// Sum of OSPA.
    pub ospa_sum: f64,
    /// Sum of GOSPA.
    pub gospa_sum: f64,
    /// Sums of GOSPA's parts.
    pub parts: GospaParts,
    /// Number of frames.
    pub frames: u64,
}

impl SetTally {
    /// Measures each frame of the sequence from which `prepared` was made.
    pub fn measure(
        sequence: &Sequence,
        prepared: &Prepared,
        similarity: Similarity,
        settings: &SetDistance,
    ) -> Self {
        let mut tally = Self::default();
        for (of, frame) in sequence.frames.iter().zip(&prepared.frames) {
            let near = near(of, frame, similarity, settings.cutoff);
            tally.add(&settings.between(frame.truths.len(), frame.tracks.len(), &near));
        }
        tally
    }

    fn add(&mut self, frame: &FrameDistance) {
        self.ospa_sum += frame.ospa;
        self.gospa_sum += frame.gospa;
        self.parts.location += frame.parts.location;
        self.parts.missed += frame.parts.missed;
        self.parts.false_ += frame.parts.false_;
        self.frames += 1;
    }

    /// Combines the sums of several sequences.
    pub fn combine<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        all.into_iter().fold(Self::default(), |a, b| Self {
            ospa_sum: a.ospa_sum + b.ospa_sum,
            gospa_sum: a.gospa_sum + b.gospa_sum,
            parts: GospaParts {
                location: a.parts.location + b.parts.location,
                missed: a.parts.missed + b.parts.missed,
                false_: a.parts.false_ + b.parts.false_,
            },
            frames: a.frames + b.frames,
        })
    }

    /// Returns the mean OSPA over the frames; `None` without frames.
    pub fn ospa(&self) -> Option<f64> {
        (self.frames > 0).then(|| self.ospa_sum / self.frames as f64)
    }

    /// Returns the mean GOSPA over the frames; `None` without frames.
    pub fn gospa(&self) -> Option<f64> {
        (self.frames > 0).then(|| self.gospa_sum / self.frames as f64)
    }
}

/// Returns the pairs of a frame that are closer than the cutoff, weighted by their distance.
fn near(of: &Frame, frame: &PreparedFrame, similarity: Similarity, cutoff: f64) -> Vec<Edge> {
    let all: Vec<Edge> = match similarity {
        Similarity::Iou => {
            frame.pairs.iter().map(|pair| Edge { weight: 1.0 - pair.weight, ..*pair }).collect()
        }
        Similarity::Metres => floor_distances(of, frame),
    };
    all.into_iter().filter(|edge| edge.weight < cutoff).collect()
}

/// Returns the distances of all pairs on the floor. They cannot be computed from the similarity,
/// which is 0 from one metre on, because the cutoff may be larger.
fn floor_distances(of: &Frame, frame: &PreparedFrame) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (row, &truth) in frame.truth_at.iter().enumerate() {
        for (col, &report) in frame.track_at.iter().enumerate() {
            let places = (of.truths[truth as usize].floor_m, of.reports[report as usize].floor_m);
            if let (Some(a), Some(b)) = places {
                edges.push(Edge { row: row as u32, col: col as u32, weight: distance_m(a, b) });
            }
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(n: f64) -> FrameDistance {
        let parts = GospaParts { location: 3.0 * n, missed: 4.0 * n, false_: 5.0 * n };
        FrameDistance { ospa: n, gospa: 2.0 * n, parts }
    }

    #[test]
    fn frames_add_up_field_by_field() {
        let mut tally = SetTally::default();
        tally.add(&frame(1.0));
        tally.add(&frame(2.0));
        let parts = GospaParts { location: 9.0, missed: 12.0, false_: 15.0 };
        assert_eq!(tally, SetTally { ospa_sum: 3.0, gospa_sum: 6.0, parts, frames: 2 });
    }
}
