use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::{ConfigError, Value, parse_settings};

/// Name of the table.
pub(super) const TABLE: &str = "suits";

/// Cameras and robots for which a config was fitted and tested. A run with others continues with a
/// note; `tagalong doctor` also warns about them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Suits {
    /// Lowest and highest position of the camera above the floor, m.
    pub camera_height_m: Option<[f64; 2]>,
    /// Smallest and largest angle of the optical axis below the horizon, degrees.
    pub pitch_down_deg: Option<[f64; 2]>,
    /// Smallest and largest distance of the right camera from the left one, m. `tagalong run LOG`
    /// chooses the config only for such pairs.
    pub baseline_m: Option<[f64; 2]>,
    /// True if motion over ground is evidence, so that the robot's own motion has to be known.
    pub odometry: bool,
}

impl Suits {
    /// Deviation of the camera's height from the stated range that does not matter, m.
    pub const HEIGHT_TOLERANCE_M: f64 = 0.1;

    /// Returns the distance of a camera's height from the stated range, m; zero within it, or where none
    /// is stated.
    pub fn height_off_m(&self, height_m: f64) -> f64 {
        beyond(height_m, self.camera_height_m)
    }

    /// Returns the distance of a camera's pitch from the stated range, degrees, likewise.
    pub fn pitch_off_deg(&self, pitch_down_deg: f64) -> f64 {
        beyond(pitch_down_deg, self.pitch_down_deg)
    }

    /// Returns the distance of a stereo pair's baseline from the stated range, m, likewise.
    pub fn baseline_off_m(&self, baseline_m: f64) -> f64 {
        beyond(baseline_m, self.baseline_m)
    }
}

fn beyond(value: f64, range: Option<[f64; 2]>) -> f64 {
    let Some([low, high]) = range else { return 0.0 };
    (low - value).max(value - high).max(0.0)
}

/// Reads `[suits]`.
pub(super) fn read(table: Option<Value<'_>>) -> Result<Suits, ConfigError> {
    let place = table.as_ref().map(Value::span);
    let suits: Suits = parse_settings(table)?;
    let ranges = [
        ("camera_height_m", suits.camera_height_m),
        ("pitch_down_deg", suits.pitch_down_deg),
        ("baseline_m", suits.baseline_m),
    ];
    for (key, range) in ranges {
        if range.is_some_and(|[low, high]| low.is_nan() || high.is_nan() || low > high) {
            let message = format!("`{key}` is the lowest and the highest value, in this order");
            return Err(ConfigError::new(message).or_at(place));
        }
    }
    Ok(suits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_count_on_both_sides() {
        let suits = Suits { camera_height_m: Some([0.9, 2.0]), ..Suits::default() };
        let off = [0.3, 1.0, 2.5].map(|height_m| suits.height_off_m(height_m));
        assert_eq!(off, [0.6000000000000001, 0.0, 0.5]);
        assert_eq!(suits.pitch_off_deg(90.0), 0.0);
        assert_eq!(suits.baseline_off_m(0.53), 0.0);
        let narrow = Suits { baseline_m: Some([0.0, 0.3]), ..suits };
        assert_eq!([0.12, 0.8].map(|baseline_m| narrow.baseline_off_m(baseline_m)), [0.0, 0.5]);
    }
}
