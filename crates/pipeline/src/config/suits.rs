use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::{ConfigError, Value, parse_settings};

/// Name of the table.
pub(super) const TABLE: &str = "suits";

/// Cameras and robots that a config was fitted to and tried on. A run with others goes on, with a note
/// on missing odometry; `tagalong doctor` warns of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Suits {
    /// Lowest and highest camera above the floor, m.
    pub camera_height_m: Option<[f64; 2]>,
    /// Least and greatest angle of the optical axis below the horizon, degrees.
    pub pitch_down_deg: Option<[f64; 2]>,
    /// True if motion over ground is evidence, so that the robot's own has to be known.
    pub odometry: bool,
}

/// Reads `[suits]`.
pub(super) fn read(table: Option<Value<'_>>) -> Result<Suits, ConfigError> {
    let place = table.as_ref().map(Value::span);
    let suits: Suits = parse_settings(table)?;
    for (key, range) in
        [("camera_height_m", suits.camera_height_m), ("pitch_down_deg", suits.pitch_down_deg)]
    {
        if range.is_some_and(|[low, high]| low.is_nan() || high.is_nan() || low > high) {
            let message = format!("`{key}` is the lowest and the highest value, in this order");
            return Err(ConfigError { message, span: place });
        }
    }
    Ok(suits)
}
