use std::f64::consts::TAU;

use crate::{Fit, Pairs};
use tagalong_config::check_settings;
use tagalong_core::{Association, Associations, Associator, Detection, Gate, Result, Track};

use crate::jpda::Config;
use crate::jpda::cluster::{Cluster, clusters};
use crate::jpda::marginals::marginals;

/// The associator.
pub struct Jpda {
    config: Config,
}

impl Jpda {
    /// Creates the associator.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        Ok(Self { config })
    }

    /// Returns the likelihood of a pair relative to a miss and a false detection:
    /// P_D N(ν; 0, S) / (λ (1 - P_D)).
    fn likelihood_ratio(&self, fit: &Fit) -> f64 {
        let Config { detection_probability, clutter_per_m3, .. } = self.config;
        let log_density = -0.5 * (fit.cost + fit.log_volume + 3.0 * TAU.ln());
        let odds = detection_probability / (1.0 - detection_probability);
        odds * log_density.exp() / clutter_per_m3
    }

    /// Returns the most likely detections of a cluster, in their order.
    fn strongest(&self, cluster: &Cluster, ratios: &[Vec<f64>]) -> Vec<usize> {
        let mut all = cluster.detections.clone();
        let most = self.config.max_detections as usize;
        if all.len() > most {
            all.sort_by(|a, b| {
                let [of_a, of_b] =
                    [*a, *b].map(|detection| largest_ratio(cluster, ratios, detection));
                of_b.total_cmp(&of_a).then(a.cmp(b))
            });
            all.truncate(most);
            all.sort_unstable();
        }
        all
    }

    fn weigh_cluster(&self, cluster: &Cluster, ratios: &[Vec<f64>]) -> Vec<Association> {
        let detections = self.strongest(cluster, ratios);
        let mut likelihoods: Vec<Vec<f64>> = Vec::new();
        for track in &cluster.tracks {
            likelihoods.push(detections.iter().map(|d| ratios[*track][*d]).collect());
        }
        let weights = marginals(&likelihoods, detections.len());
        let mut pairs = Vec::new();
        for (track, row) in cluster.tracks.iter().zip(weights) {
            for (detection, weight) in detections.iter().zip(row) {
                if weight >= self.config.min_weight {
                    let weight = weight.min(1.0);
                    pairs.push(Association::new(*track, *detection, weight));
                }
            }
        }
        pairs
    }
}

impl Associator for Jpda {
    fn fits(&self, track: &Track, detection: &Detection, gate: &Gate) -> bool {
        self.config.gating.pair_cost().fit(track, detection, gate.dt_s).is_some()
    }

    fn associate(
        &mut self,
        tracks: &[Track],
        detections: &[Detection],
        gate: &Gate,
    ) -> Associations {
        let pair_cost = self.config.gating.pair_cost();
        let pairs = Pairs { tracks, detections, gate };
        let fits = pairs
            .fits(&pairs.all(), &pair_cost, |track, found| pair_cost.fit(track, found, gate.dt_s));
        let ratios: Vec<Vec<f64>> = fits
            .into_iter()
            .map(|row| {
                row.into_iter()
                    .map(|fit| fit.map_or(0.0, |fit| self.likelihood_ratio(&fit)))
                    .collect()
            })
            .collect();
        let together = clusters(tracks.len(), detections.len(), |t, d| ratios[t][d] > 0.0);
        let pairs = together.iter().flat_map(|cluster| self.weigh_cluster(cluster, &ratios));
        Associations::new(pairs.collect())
    }
}

/// Returns the largest likelihood ratio of a detection with the tracks of a cluster.
fn largest_ratio(cluster: &Cluster, ratios: &[Vec<f64>], detection: usize) -> f64 {
    cluster.tracks.iter().map(|track| ratios[*track][detection]).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use crate::{Fusion, GateSettings};
    use tagalong_conformance::samples::{GATE, detection_at, track_at};

    use super::*;

    fn detection(y: f64) -> Detection {
        detection_at(3.0, y)
    }

    fn track(id: u32, y: f64) -> Track {
        track_at(id, 3.0, y)
    }

    fn associate(config: Config, tracks: &[Track], detections: &[Detection]) -> Associations {
        Jpda::new(config).unwrap().associate(tracks, detections, &GATE)
    }

    #[test]
    fn one_detection_between_two_tracks_is_of_both_by_half() {
        let answer =
            associate(Config::default(), &[track(1, -0.2), track(2, 0.2)], &[detection(0.0)]);
        let weights: Vec<f64> = answer.pairs.iter().map(|pair| pair.weight).collect();
        assert_eq!(weights.len(), 2);
        assert!(weights.iter().all(|weight| (weight - 0.5).abs() < 0.02), "{weights:?}");
    }

    #[test]
    fn a_detection_that_is_alone_is_nearly_certain() {
        let answer = associate(Config::default(), &[track(1, 0.0)], &[detection(0.05)]);
        assert!(answer.pairs[0].weight > 0.98, "{answer:?}");
    }

    /// λ (1 - P_D) / P_D against the density of the innovation: equal odds.
    #[test]
    fn the_weight_is_that_of_the_densities() {
        let density = (TAU.powi(3) * 0.02_f64.powi(3)).sqrt().recip();
        let config =
            Config { detection_probability: 0.5, clutter_per_m3: density, ..Config::default() };
        let answer = associate(config, &[track(1, 0.0)], &[detection(0.0)]);
        assert!((answer.pairs[0].weight - 0.5).abs() < 1e-9, "{answer:?}");
    }

    /// Without appearances the detection between two tracks is of both by half.
    #[test]
    fn an_appearance_may_help_a_pair_and_not_harm_the_other() {
        let tracks = [track(1, -0.2), track(2, 0.2)];
        for (look, least, most) in [(5.0, 0.1, 1.0), (-5.0, -1e-9, 1e-9)] {
            let gating = GateSettings { fusion: Fusion::Minimum, ..GateSettings::default() };
            let config = Config { gating, ..Config::default() };
            let looks = [vec![look], vec![0.0]];
            let gate = GATE.with_appearance(&looks);
            let answer = Jpda::new(config).unwrap().associate(&tracks, &[detection(0.0)], &gate);
            let lead = answer.pairs[0].weight - answer.pairs[1].weight;
            assert!(least < lead && lead < most, "{look}: {lead}");
        }
    }

    #[test]
    fn the_least_likely_detections_of_a_large_cluster_are_left_out() {
        let config = Config { max_detections: 2, ..Config::default() };
        let detections = [0.3, 0.05, -0.05, -0.3].map(detection);
        let answer = associate(config, &[track(1, 0.0)], &detections);
        let mut used: Vec<usize> = answer.pairs.iter().map(|pair| pair.detection).collect();
        used.sort_unstable();
        assert_eq!(used, [1, 2]);
    }

    #[test]
    fn a_pair_fits_within_the_gate_alone() {
        let jpda = Jpda::new(Config::default()).unwrap();
        assert!(jpda.fits(&track(1, 0.0), &detection(0.1), &GATE));
        assert!(!jpda.fits(&track(1, 0.0), &detection(4.0), &GATE));
    }

    #[test]
    fn settings_that_cannot_work_are_refused() {
        let gating = GateSettings { fusion_gate: 1.5, ..GateSettings::default() };
        for config in [
            Config { detection_probability: 1.0, ..Config::default() },
            Config { clutter_per_m3: 0.0, ..Config::default() },
            Config { gating, ..Config::default() },
            Config { max_detections: 17, ..Config::default() },
        ] {
            assert!(Jpda::new(config.clone()).is_err(), "{config:?}");
        }
    }
}
