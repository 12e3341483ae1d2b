use tagalong_core::{Error, Result, settings};

use super::ChoiceRule;

settings! {
    /// Choice of the target, doubt about its identity, and the search for a lost person.
    #[non_exhaustive]
    pub struct TargetSettings {
        /// ID of the track to follow; if left out, `choose` picks one.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub track: Option<u32>,
        /// Choice of a person while there is none: "nearest" in front; "approach", the one that
        /// walks up to the robot and stops in front of it; "raised-hand", the one that raises a
        /// hand above the head, with a detector that finds joints; or "none", which waits for an
        /// enrollment.
        pub choose: ChoiceRule = ChoiceRule::Nearest,
        /// Largest bearing of a track that may be chosen, to either side, degrees.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub choose_within_deg: f64 = 45.0,
        /// Largest distance of a track that may be chosen, m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub choose_within_m: f64 = 5.0,
        /// Time for which such a track has to exist before one is chosen, s, because the nearest
        /// person is not always seen first.
        #[schemars(range(min = 0.0))]
        pub choose_after_s: f64 = 0.0,
        /// Time after that choice in which a nearer person, at most 3 m away and within the same
        /// bearing, replaces the chosen one, s. An enrolled person is kept in any case.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub reconsider_s: f64 = 0.0,
        /// Distance from the robot within which an approaching person has to stop, m.
        #[schemars(range(min = 0.5, max = 5.0))]
        pub approach_within_m: f64 = 2.0,
        /// Distance by which that person has to come nearer, m.
        #[schemars(range(min = 0.1, max = 5.0))]
        pub approach_by_m: f64 = 0.5,
        /// Time for which that person has to stand still, s.
        #[schemars(range(min = 0.2, max = 30.0))]
        pub approach_stands_s: f64 = 1.0,
        /// Time for which a person has to hold a hand above the head, s.
        #[schemars(range(min = 0.2, max = 10.0))]
        pub raised_hand_s: f64 = 0.6,
        /// Remembers the person's appearance, doubts a track that looks different, and recognises
        /// the person again. Without it a track is followed until it ends, and no other after it.
        pub remember: bool = true,
        /// Number of detections after which the person is known well.
        #[schemars(range(min = 1))]
        pub training_sightings: u32 = 15,
        /// Weight of one detection in the estimate of whether it is the same person, 0 to 1.
        #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
        pub belief_weight: f64 = 0.25,
        /// Probability of being the same person below which the track is followed slowly.
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        pub doubt_below: f64 = 0.4,
        /// Probability of being the same person below which the target is lost.
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        pub refuse_below: f64 = 0.15,
        /// Time out of sight after which the identity is doubted, s.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub doubt_after_s: f64 = 0.5,
        /// Time out of sight after which the target is lost, s.
        pub lose_after_s: f64 = 2.0,
        /// Probability from which a track counts as the person, accumulated over its detections.
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        pub again_from: f64 = 0.85,
        /// Number of consecutive detections in which `again_from` has to be reached.
        #[schemars(range(min = 1))]
        pub again_sightings: u32 = 5,
        /// Largest speed at which the person can have moved from where they were last seen, m/s.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub reach_mps: f64 = 2.0,
        /// Distance from the person below which another track may be confused with it, m:
        /// appearances are compared, and nothing is learned.
        #[schemars(range(min = 0.0))]
        pub alone_m: f64 = 0.8,
        /// Evidence from differences in appearance.
        pub looks: LooksSettings,
        /// Search for a lost person.
        pub search: SearchSettings,
    }
}

settings! {
    /// Log-odds that two detections show one person: the sum, over the kinds of difference, of a
    /// weight times the amount by which the difference is below its neutral value. Hellinger
    /// distances lie between 0 (equal) and 1. The values are those that `tagalong follow
    /// configs/follow-depth.toml --split train --seeds 4 --fit` prints: a logistic regression over
    /// 60 rides. Every `tagalong follow` prints the calibration of the probabilities.
    pub struct LooksSettings {
        /// Colours of the upper body: the neutral Hellinger distance, and the weight per unit below
        /// it.
        pub torso: [f64; 2] = [0.166, 12.566],
        /// Colours of the legs, likewise.
        pub legs: [f64; 2] = [0.472, 4.394],
        /// Directions of edges on the upper body, likewise.
        pub texture: [f64; 2] = [0.267, 7.819],
        /// Embeddings of the network of `[appearance]`, which replace the three above: the neutral
        /// distance (1 minus the cosine), and the weight per unit below it. Not fitted, because no
        /// network is shipped: fit it to yours with `tagalong follow --fit`.
        pub vector: [f64; 2] = [0.35, 12.0],
        /// Height of the head: the neutral difference, m, and the weight per metre below it.
        pub height: [f64; 2] = [-0.045, 7.009],
        /// Weight of being more similar to the person than to others seen beside them.
        #[schemars(range(min = 0.0))]
        pub rivals: f64 = 5.49,
        /// Calibration of the reported probability: pairs of the probability from the log-odds
        /// above and the share of true matches among detections with that probability; both rise,
        /// and lines connect the pairs. Decisions use the log-odds alone. Without pairs the
        /// probability is reported unchanged. `tagalong follow --fit` prints pairs by isotonic
        /// regression.
        pub calibration: Vec<[f64; 2]>,
    }
}

impl LooksSettings {
    /// Returns the calibrated probability for one by the log-odds.
    pub(crate) fn calibrated(&self, probability: f64) -> f64 {
        let after = self.calibration.partition_point(|[stated, _]| *stated <= probability);
        let below = after.checked_sub(1).map(|at| self.calibration[at]);
        match (below, self.calibration.get(after)) {
            (Some([x, y]), Some([next_x, next_y])) => {
                // Pairs rise strictly, so the distance is not 0.
                y + (probability - x) / (next_x - x) * (next_y - y)
            }
            (Some([_, y]), None) | (None, Some(&[_, y])) => y,
            (None, None) => probability,
        }
    }

    /// Refuses a calibration that is none.
    ///
    /// # Errors
    /// [`Error::Settings`] names the key and the remedy.
    pub fn check(&self) -> Result<()> {
        fn rises(pair: &[[f64; 2]]) -> bool {
            pair[1][0] > pair[0][0] && pair[1][1] >= pair[0][1]
        }

        let are_shares =
            self.calibration.as_flattened().iter().all(|value| (0.0..=1.0).contains(value));
        if are_shares && self.calibration.windows(2).all(rises) {
            return Ok(());
        }
        let why = "must have pairs of numbers in 0 to 1, both rising from pair to pair";
        Err(Error::setting("looks.calibration", why))
    }
}

settings! {
    /// Search for a lost person. It needs free space around the robot; while it is off, the robot
    /// stops when the person is lost.
    #[non_exhaustive]
    pub struct SearchSettings {
        /// Turns towards where the person went, and drives to the last seen position.
        pub enabled: bool = false,
        /// Time to wait before the search starts, s: most people come back by themselves.
        #[schemars(range(min = 0.0))]
        pub wait_s: f64 = 1.0,
        /// Largest turn rate, rad/s.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub turn_radps: f64 = 0.5,
        /// Largest speed, m/s.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub speed_mps: f64 = 0.4,
        /// Distance from the last seen position at which the robot has arrived, m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub arrive_m: f64 = 0.6,
        /// Time after which the drive there is given up, s.
        #[schemars(range(min = 0.0))]
        pub drive_s: f64 = 8.0,
        /// Time after which the search is given up and the robot stops, s.
        #[schemars(range(min = 0.0))]
        pub give_up_s: f64 = 20.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(calibration: &[[f64; 2]]) -> LooksSettings {
        LooksSettings { calibration: calibration.to_vec(), ..LooksSettings::default() }
    }

    #[test]
    fn calibrated_probabilities_lie_on_lines_between_the_pairs() {
        let looks = with(&[[0.1, 0.0], [0.5, 0.2], [0.9, 1.0]]);
        for (stated, calibrated) in
            [(0.0, 0.0), (0.1, 0.0), (0.3, 0.1), (0.5, 0.2), (0.7, 0.6), (0.9, 1.0), (1.0, 1.0)]
        {
            let found = looks.calibrated(stated);
            assert!((found - calibrated).abs() < 1e-12, "{stated}: {found}");
        }
        assert_eq!(with(&[]).calibrated(0.7), 0.7, "without pairs");
        assert_eq!(with(&[[0.4, 0.3]]).calibrated(0.7), 0.3);
    }

    #[test]
    fn a_calibration_rises() {
        assert!(with(&[[0.0, 0.0], [0.5, 0.2], [0.6, 0.2]]).check().is_ok());
        assert!(LooksSettings::default().check().is_ok());
        for wrong in [[[0.5, 0.2], [0.5, 0.3]], [[0.4, 0.3], [0.5, 0.2]], [[0.4, 0.3], [0.5, 1.2]]]
        {
            let error = with(&wrong).check().unwrap_err().to_string();
            assert!(error.contains("both rising"), "{error}");
        }
        assert!(with(&[[f64::NAN, 0.5]]).check().is_err());
    }
}
