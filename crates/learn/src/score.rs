use tagalong_core::{Error, Result};

/// Linear calibration of a verifier's log-odds, with a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreCalibration {
    weight: f64,
    limit: f64,
    bias: f64,
}

impl ScoreCalibration {
    /// Creates the calibration `weight * log_odds + bias`, where the log-odds are clamped to plus
    /// and minus `limit`.
    ///
    /// # Errors
    /// [`Error::Settings`] for invalid numbers, by the names of the arguments.
    pub fn new(weight: f64, limit: f64, bias: f64) -> Result<Self> {
        for (name, value) in [("weight", weight), ("limit", limit)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::setting(name, format!("must be at least 0, not {value}")));
            }
        }
        if !bias.is_finite() {
            return Err(Error::setting("bias", format!("must be a finite number, not {bias}")));
        }
        Ok(Self { weight, limit, bias })
    }

    /// Returns the calibrated log-odds for the log-odds of a model.
    pub fn calibrate(&self, log_odds: f64) -> f64 {
        // Without the limit one overconfident verdict could outweigh all other evidence of a track.
        self.weight * log_odds.clamp(-self.limit, self.limit) + self.bias
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_look_is_never_beyond_doubt() {
        let calibration = ScoreCalibration::new(2.0, 3.0, -1.0).unwrap();
        assert_eq!([0.5, 9.0, -9.0].map(|odds| calibration.calibrate(odds)), [0.0, 5.0, -7.0]);
        for (weight, limit, bias, word) in [
            (-1.0, 1.0, 0.0, "weight"),
            (1.0, f64::NAN, 0.0, "limit"),
            (1.0, 1.0, f64::INFINITY, "bias"),
        ] {
            let error = ScoreCalibration::new(weight, limit, bias).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
