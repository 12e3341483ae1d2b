use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Floor that rises along the length of the room, and is level before and after the ramp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Start of the ramp, m from the near end of the room.
    pub from_m: f64,
    /// Length along the room, m.
    pub length_m: f64,
    /// Height at its end, m.
    pub rise_m: f64,
}

impl Ramp {
    /// Returns the height of the floor at this position along the room, m.
    pub(crate) fn height_m(&self, x: f64) -> f64 {
        self.rise_m * ((x - self.from_m) / self.length_m).clamp(0.0, 1.0)
    }

    /// Returns the conditions on the settings, each with the message for a violation.
    pub(crate) fn rules(&self) -> [(bool, &'static str); 2] {
        [
            (self.from_m >= 0.0 && self.length_m > 0.0, "room.ramp must have a place and a length"),
            (
                (0.0..=0.2).contains(&(self.rise_m / self.length_m)),
                "room.ramp.rise_m must be in 0 to a fifth of length_m",
            ),
        ]
    }
}
