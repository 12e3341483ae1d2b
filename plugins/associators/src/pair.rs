//! Cost of a pair of a track and a detection.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Detection, Gate, Track};
use tagalong_geometry::Rect;

use crate::{AppearanceFusion, Fusion, Stage, assign};

/// Measure of how well a detection fits a track.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cost {
    /// Distance in the robot frame, in units of its uncertainty.
    #[default]
    Mahalanobis,
    /// Overlap of the boxes in the image.
    Overlap,
}

/// Measure of the overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Overlap {
    /// Intersection over union.
    #[default]
    Iou,
    /// Twice the intersection over the sum of the areas.
    Dice,
}

/// Settings of the gate of a pair in metres and of the weight of its appearance; flattened into
/// those of associators.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct GateSettings {
    /// Largest squared Mahalanobis distance. 11.34 is the 99 % point of chi-squared with 3 degrees
    /// of freedom.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub gate: f64,
    /// Largest distance on the floor, m, between frames that are close in time; only with the
    /// Mahalanobis distance as cost.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub gate_m: f64,
    /// Growth of `gate_m` with the time between the frames, m/s.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub gate_speed_mps: f64,
    /// Combination with the appearance of a pair (`[reidentification] association_weight`): added
    /// to the position (`sum`), or the better of the two (`minimum`).
    pub fusion: Fusion,
    /// For `minimum`: least similarity of the positions at which the appearance counts: exp(-d²/2)
    /// with the Mahalanobis distance d, or the overlap where that is the cost. BoT-SORT has 0.5.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub fusion_gate: f64,
}

impl Default for GateSettings {
    fn default() -> Self {
        Self {
            gate: 11.34,
            gate_m: 1.0,
            gate_speed_mps: 1.5,
            fusion: Fusion::Sum,
            fusion_gate: 0.0,
        }
    }
}

impl GateSettings {
    /// Returns the fit by distances in metres.
    pub fn pair_cost(&self) -> PairCost {
        let Self { gate, gate_m, gate_speed_mps, fusion, fusion_gate } = *self;
        PairCost {
            cost: Cost::Mahalanobis,
            gate,
            gate_m,
            gate_speed_mps,
            min_overlap: 1.0,
            overlap: Overlap::Iou,
            fusion: AppearanceFusion { fusion, gate: fusion_gate },
        }
    }
}

/// Measure of the fit of a pair, with its gate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairCost {
    /// Measure of the fit.
    pub cost: Cost,
    /// Mahalanobis: largest squared distance.
    pub gate: f64,
    /// Mahalanobis: largest distance on the floor, m, between frames that are close in time ...
    pub gate_m: f64,
    /// ... and its growth with the time between them, m/s.
    pub gate_speed_mps: f64,
    /// Overlap: smallest overlap.
    pub min_overlap: f64,
    /// Overlap: measure of the overlap.
    pub overlap: Overlap,
    /// Part of the appearance.
    pub fusion: AppearanceFusion,
}

/// Fit of a pair: the cost, and the logarithm of the volume of the innovation covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Squared Mahalanobis distance d², or -ln of the overlap.
    pub cost: f64,
    /// ln |S| of the innovation covariance S; 0 for overlaps.
    pub log_volume: f64,
}

impl PairCost {
    /// Returns the fit of a track and a detection, `dt_s` after the last frame; `None` outside of
    /// the gate.
    pub fn fit(&self, track: &Track, detection: &Detection, dt_s: f64) -> Option<Fit> {
        match self.cost {
            Cost::Mahalanobis => self.mahalanobis(track, detection, dt_s),
            Cost::Overlap => {
                let seen = detection.rect()?;
                let overlap = overlap(&track.estimate.region, &seen, self.overlap);
                let fits = overlap >= self.min_overlap;
                fits.then(|| Fit { cost: -overlap.ln(), log_volume: 0.0 })
            }
        }
    }

    /// Takes the log-likelihood ratio of the appearances into the cost of a pair, in the unit of
    /// the cost. Positions alone decide about the gate.
    pub fn with_appearance(&self, fit: Fit, log_ratio: f64) -> Fit {
        // d² + ln |S| is twice a negative log-likelihood.
        let unit = if self.cost == Cost::Mahalanobis { 2.0 } else { 1.0 };
        Fit { cost: self.fusion.cost(fit.cost, unit, log_ratio), ..fit }
    }

    /// Returns the largest cost within the gate.
    pub fn at_gate(&self) -> f64 {
        match self.cost {
            Cost::Mahalanobis => self.gate,
            Cost::Overlap => -self.min_overlap.ln(),
        }
    }

    /// Returns the largest distance on the floor of a pair within the gate, m.
    fn reach_m(&self, dt_s: f64) -> f64 {
        match self.cost {
            Cost::Mahalanobis => self.gate_m + self.gate_speed_mps * dt_s,
            Cost::Overlap => f64::INFINITY,
        }
    }

    /// Computes d² = ν' S⁻¹ ν with S = P + R.
    fn mahalanobis(&self, track: &Track, detection: &Detection, dt_s: f64) -> Option<Fit> {
        let innovation = detection.position - track.estimate.person.position;
        // A track with a large covariance admits detections at any distance by d² alone.
        if innovation.xy().norm() > self.reach_m(dt_s) {
            return None;
        }
        let position = track.estimate.covariance.fixed_view::<3, 3>(0, 0);
        // A singular covariance has no inverse, and the pair no distance.
        let spread = (position + detection.covariance).cholesky()?;
        let cost = innovation.dot(&spread.solve(&innovation));
        let log_volume = 2.0 * spread.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>();
        let is_near = cost <= self.gate && log_volume.is_finite();
        is_near.then_some(Fit { cost, log_volume })
    }
}

/// Tracks and detections of one frame.
#[derive(Clone, Copy)]
pub struct Pairs<'a> {
    /// The tracks.
    pub tracks: &'a [Track],
    /// The detections.
    pub detections: &'a [Detection],
    /// The tracker's gate, with the appearances of the pairs.
    pub gate: &'a Gate<'a>,
}

impl Pairs<'_> {
    /// Returns the numbers of all tracks and of all detections.
    pub fn all(&self) -> Stage {
        Stage {
            rows: (0..self.tracks.len()).collect(),
            columns: (0..self.detections.len()).collect(),
        }
    }

    /// Returns the fits of these tracks and detections, by their numbers, with a row for each
    /// track: `None` for a pair that the tracker's gate does not admit, or that `fit`, which stays
    /// within the gate of `pair_cost`, gives none. The appearance of a pair takes part as `pair_cost` weighs it.
    pub fn fits(
        &self,
        stage: &Stage,
        pair_cost: &PairCost,
        fit: impl Fn(&Track, &Detection) -> Option<Fit>,
    ) -> Vec<Vec<Option<Fit>>> {
        let Stage { rows, columns } = stage;
        // Most pairs are too far apart along one axis, which is seen soonest in a list of places.
        let reach = 1.01 * pair_cost.reach_m(self.gate.dt_s);
        let places: Vec<_> = columns.iter().map(|i| self.detections[*i].position.xy()).collect();
        rows.iter()
            .map(|row| {
                let track = &self.tracks[*row];
                let own = track.estimate.person.position.xy();
                let each = columns.iter().zip(&places).map(|(column, place)| {
                    let detection = &self.detections[*column];
                    if (place - own).amax() > reach || !self.gate.admits(track, detection) {
                        return None;
                    }
                    let look = self.gate.appearance_of(*row, *column);
                    fit(track, detection).map(|fit| pair_cost.with_appearance(fit, look))
                });
                each.collect()
            })
            .collect()
    }

    /// Assigns these detections to these tracks, by their numbers, with the least sum of costs:
    /// [`assign_fits`] of their [`Pairs::fits`]. Returns the number of the detection of each track.
    pub fn assigned(
        &self,
        stage: &Stage,
        pair_cost: &PairCost,
        miss_factor: f64,
        fit: impl Fn(&Track, &Detection) -> Option<Fit>,
    ) -> Vec<Option<usize>> {
        let fits = self.fits(stage, pair_cost, fit);
        let columns = &stage.columns;
        let given = assign_fits(&fits, columns.len(), pair_cost.at_gate(), miss_factor);
        given.into_iter().map(|column| column.map(|column| columns[column])).collect()
    }
}

/// Assigns detections to tracks so that the sum of the negative log-likelihoods d² + ln |S| is
/// minimal: with ln |S|, a nearly certain track does not lose its detection to one with a large
/// covariance. A missed track costs `miss_factor` times the cost at the gate, plus the range of ln
/// |S|. Returns the detection of each track.
pub fn assign_fits(
    fits: &[Vec<Option<Fit>>],
    detections: usize,
    at_gate: f64,
    miss_factor: f64,
) -> Vec<Option<usize>> {
    let mut least = f64::INFINITY;
    let mut most = f64::NEG_INFINITY;
    for fit in fits.iter().flatten().flatten() {
        least = least.min(fit.log_volume);
        most = most.max(fit.log_volume);
    }
    // With the range of ln |S| added, no pair within the gate costs more than a miss at factor 1.
    let range = if most > least { most - least } else { 0.0 };
    let miss = miss_factor * at_gate + range;
    assign(detections, &vec![miss; fits.len()], |row, column| {
        fits[row][column].map(|f| f.cost + f.log_volume - least)
    })
}

fn overlap(a: &Rect, b: &Rect, kind: Overlap) -> f64 {
    match kind {
        Overlap::Iou => a.iou(b),
        Overlap::Dice => {
            let sum = a.area() + b.area();
            if sum > 0.0 { 2.0 * a.intersection(b).area() / sum } else { 0.0 }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3, SMatrix};
    use proptest::prelude::*;
    use tagalong_conformance::samples::{detection_at, track_at};
    use tagalong_geometry::ImageBox;

    use super::*;

    const DEFAULT: PairCost = PairCost {
        cost: Cost::Mahalanobis,
        gate: 11.34,
        gate_m: 1.0,
        gate_speed_mps: 1.5,
        min_overlap: 0.3,
        overlap: Overlap::Iou,
        fusion: AppearanceFusion { fusion: Fusion::Sum, gate: 0.0 },
    };

    #[test]
    fn appearance_counts_in_the_unit_of_the_cost() {
        let fit = Fit { cost: 3.0, log_volume: -1.0 };
        let overlap = PairCost { cost: Cost::Overlap, ..DEFAULT };
        assert_eq!(DEFAULT.with_appearance(fit, 0.5), Fit { cost: 2.0, ..fit });
        assert_eq!(overlap.with_appearance(fit, 0.5), Fit { cost: 2.5, ..fit });
    }

    /// exp(-3/2) is 0.22 as a similarity, and exp(-3) 0.05.
    #[test]
    fn the_smaller_cost_counts_in_the_unit_of_the_cost() {
        let fit = Fit { cost: 3.0, log_volume: -1.0 };
        let even = 0.5_f64.ln();
        for (cost, gate, expected) in
            [(Cost::Mahalanobis, 0.2, -2.0 * even), (Cost::Overlap, 0.04, -even)]
        {
            let found = cost_with(fit, cost, gate, 1e-9);
            assert!((found - expected).abs() < 1e-6, "{cost:?}: {found}");
        }
        for (cost, gate, log_ratio, why) in [
            (Cost::Mahalanobis, 0.3, 4.0, "too far away"),
            (Cost::Overlap, 0.06, 4.0, "too far away"),
            (Cost::Mahalanobis, 0.0, -4.0, "it never speaks against a pair"),
        ] {
            assert_eq!(cost_with(fit, cost, gate, log_ratio), 3.0, "{cost:?}: {why}");
        }
    }

    /// Returns the cost of a pair whose appearance has this log-likelihood ratio.
    fn cost_with(fit: Fit, cost: Cost, gate: f64, log_ratio: f64) -> f64 {
        let fusion = AppearanceFusion { fusion: Fusion::Minimum, gate };
        PairCost { cost, fusion, ..DEFAULT }.with_appearance(fit, log_ratio).cost
    }

    /// Runs the assignment with the cost of a miss in multiples of the cost at the gate.
    fn assigned_pairs(
        tracks: &[Track],
        detections: &[Detection],
        settings: &PairCost,
        miss_factor: f64,
    ) -> Vec<Option<usize>> {
        let mut fits = Vec::new();
        for track in tracks {
            fits.push(detections.iter().map(|found| settings.fit(track, found, 0.1)).collect());
        }
        assign_fits(&fits, detections.len(), settings.at_gate(), miss_factor)
    }

    fn track(position: Point3<f64>, covariance: SMatrix<f64, 5, 5>) -> Track {
        let mut track = track_at(1, position.x, position.y);
        (track.estimate.person.position, track.estimate.covariance) = (position, covariance);
        track
    }

    proptest! {
        #[test]
        fn the_distance_is_that_of_the_inverted_matrix(
            off in prop::array::uniform3(-0.6..0.6f64), spread in prop::array::uniform9(-0.3..0.3f64),
        ) {
            let settings = PairCost { gate: 1e9, ..DEFAULT };
            let root = Matrix3::from_iterator(spread);
            let covariance = root * root.transpose() + Matrix3::identity() * 0.01;
            let detection = detection_at(3.0, 0.0).with_covariance(covariance);
            let prior = SMatrix::<f64, 5, 5>::identity() * 0.04;
            let track = track(detection.position - nalgebra::Vector3::from(off), prior);
            let found = settings.fit(&track, &detection, 0.1).unwrap();
            let s = covariance + Matrix3::identity() * 0.04;
            let nu = nalgebra::Vector3::from(off);
            let expected = (nu.transpose() * s.try_inverse().unwrap() * nu).x;
            prop_assert!((found.cost - expected).abs() < 1e-6 * (1.0 + expected));
            prop_assert!((found.log_volume - s.determinant().ln()).abs() < 1e-6);
        }
    }

    #[test]
    fn a_vague_track_does_not_take_the_detection_of_a_certain_one() {
        let detection = detection_at(3.0, 0.0);
        let near = detection.position + nalgebra::Vector3::new(0.25, 0.0, 0.0);
        let certain = track(near, SMatrix::identity() * 0.01);
        let vague = track(near, SMatrix::identity() * 1.0);
        let given = assigned_pairs(&[vague, certain], &[detection], &DEFAULT, 1.0);
        assert_eq!(given, [None, Some(0)]);
    }

    #[test]
    fn both_measures_of_overlap() {
        let a = Rect::new(0.0, 0.0, 2.0, 1.0);
        let b = Rect::new(1.0, 0.0, 2.0, 1.0);
        assert_eq!(overlap(&a, &b, Overlap::Iou), 1.0 / 3.0);
        assert_eq!(overlap(&a, &b, Overlap::Dice), 0.5);
        assert_eq!(overlap(&Rect::default(), &Rect::default(), Overlap::Dice), 0.0);
    }

    #[test]
    fn nobody_is_found_outside_the_gate_or_farther_than_they_can_have_walked() {
        let settings = PairCost { gate: 4.0, ..DEFAULT };
        // The gate is one metre, plus 1.5 m for each second.
        for (off_m, variance, dt_s, fits) in [
            // Two standard deviations.
            (0.19, 0.01, 0.1, true),
            (0.21, 0.01, 0.1, false),
            (1.14, 1.0, 0.1, true),
            (1.16, 1.0, 0.1, false),
            (1.74, 1.0, 0.5, true),
            (1.76, 1.0, 0.5, false),
            // A place without any uncertainty can be held against none.
            (0.0, 0.0, 0.1, false),
        ] {
            let detection = detection_at(3.0, 0.0).with_covariance(Matrix3::zeros());
            let at = detection.position - nalgebra::Vector3::new(off_m, 0.0, 0.0);
            let track = track(at, SMatrix::identity() * variance);
            let found = settings.fit(&track, &detection, dt_s);
            assert_eq!(found.is_some(), fits, "{off_m} {variance} {dt_s}");
        }
    }

    /// The two people are far apart; one track was missed for long and has a large covariance.
    #[test]
    fn a_vague_track_takes_its_own_detection_as_well_as_a_certain_one_does() {
        let detections = [detection_at(3.0, 0.0), detection_at(5.0, 2.0)];
        let certain = track(detections[0].position, SMatrix::identity() * 1e-4);
        let off = detections[1].position + nalgebra::Vector3::new(0.9, 0.0, 0.0);
        let vague = track(off, SMatrix::identity() * 0.5);
        let given = assigned_pairs(&[certain, vague.clone()], &detections, &DEFAULT, 1.0);
        assert_eq!(given, [Some(0), Some(1)]);
        assert_eq!(assigned_pairs(&[vague], &detections[1..], &DEFAULT, 1.0), [Some(0)]);
    }

    /// The cost of a miss decides if a poor pair is better than none.
    #[test]
    fn a_track_is_rather_left_alone_where_a_miss_is_cheap() {
        let detection = detection_at(3.0, 0.0);
        let off = detection.position + nalgebra::Vector3::new(0.42, 0.0, 0.0);
        let track = track(off, SMatrix::identity() * 0.01);
        // The squared distance is 0.42² / 0.02 = 8.8, the gate 11.34.
        for (miss_factor, expected) in [(1.0, Some(0)), (0.5, None)] {
            let tracks = std::slice::from_ref(&track);
            let seen = std::slice::from_ref(&detection);
            assert_eq!(assigned_pairs(tracks, seen, &DEFAULT, miss_factor), [expected]);
        }
    }

    #[test]
    fn regions_that_overlap_enough_fit_the_better_the_more_they_overlap() {
        let settings = PairCost { cost: Cost::Overlap, ..DEFAULT };
        let mut track = track(Point3::new(3.0, 0.0, 1.5), SMatrix::identity());
        track.estimate.region = Rect::new(0.0, 0.0, 10.0, 10.0);
        let [same, third, less] = [0.0, 5.0, 5.5].map(|x| {
            let region = Rect::new(x, 0.0, 10.0, 10.0);
            detection_at(9.0, 9.0).with_image(ImageBox::upper_body(region))
        });
        let [of_same, of_third, of_less] = [&same, &third, &less]
            .map(|detection| settings.fit(&track, detection, 0.1).map(|fit| fit.cost));
        assert_eq!(of_same, Some(0.0));
        let cost = of_third.expect("a third is enough");
        assert!((cost - 3.0_f64.ln()).abs() < 1e-12, "a third: {cost}");
        assert_eq!(of_less, None, "less than 0.3");
        let detection = detection_at(3.0, 0.0)
            .with_image(ImageBox::upper_body(Rect::new(5.0, 0.0, 10.0, 10.0)));
        for (miss_factor, expected) in [(1.0, Some(0)), (0.9, None)] {
            let tracks = std::slice::from_ref(&track);
            let seen = std::slice::from_ref(&detection);
            assert_eq!(assigned_pairs(tracks, seen, &settings, miss_factor), [expected]);
        }
    }
}
