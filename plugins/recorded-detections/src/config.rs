use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};
use tagalong_vision::{BoxSettings, log_odds_of};

/// Meaning of the recorded score.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ScoreScale {
    /// A probability, 0 to 1.
    Probability,
    /// Log-odds, or a margin like that of an SVM: 0 is undecided.
    LogOdds,
}

settings! {
    /// Settings of `recorded-detections`.
    pub struct Config {
        /// A MOTChallenge `det.txt` (frame, -1, x, y, width, height, score; frames from 1, pixels),
        /// relative to the config; for `run` and `bench`, `{log}` in it is the name of the log
        /// without its extension. Empty: the log topic that `[input] detections_topic` names.
        pub path: String,
        /// Least score of a box, on the recorded scale; boxes with less are dropped.
        pub min_score: f64 = 0.3,
        /// Score, on the recorded scale, from which a box may be a new person; boxes with less only
        /// continue tracks. Scores of detections are log-odds relative to it. By default
        /// `min_score`, or even odds (a probability of a half) if that is less.
        pub discover_score: Option<f64>,
        /// Meaning of the score.
        pub score: ScoreScale = ScoreScale::Probability,
        /// Conversion of boxes to detections with a position.
        #[serde(flatten)]
        pub boxes: BoxSettings,
        /// Standard deviation of a recorded position in space, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_position_m: f64 = 0.15,
        /// Keeps recorded positions outside of the image, without a box, for a detector that sees
        /// more than the camera.
        pub outside_image: bool = false,
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        match self.discover_score {
            Some(score) if score < self.min_score => {
                let least = self.min_score;
                let why = format!("must be at least {least}, as `min_score`, not {score}");
                Err(Error::setting("discover_score", why))
            }
            _ => Ok(()),
        }
    }

    /// Returns the log-odds of a recorded score.
    fn log_odds(&self, score: f64) -> f64 {
        match self.score {
            ScoreScale::LogOdds => score,
            ScoreScale::Probability => log_odds_of(score),
        }
    }

    /// Returns the score of a detection with this recorded score: its log-odds above those from
    /// which a box may be a new person.
    pub(crate) fn score_of(&self, recorded: f64) -> f64 {
        let zero = match self.discover_score {
            Some(score) => self.log_odds(score),
            // A detector that is never sure starts tracks from its own threshold on.
            None => self.log_odds(self.min_score).min(0.0),
        };
        self.log_odds(recorded) - zero
    }
}
