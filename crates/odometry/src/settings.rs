use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Odometry, corrected by what stands still in the images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OdometrySettings {
    /// One point is taken of each square of this side, px.
    pub cell_px: usize,
    /// Least change of brightness from pixel to pixel at a point, of 255.
    pub min_slope: f64,
    /// Points are no nearer than this, m: what is near moves more often than walls do, ...
    pub min_depth_m: f64,
    /// ... and no farther away than this, m.
    pub max_depth_m: f64,
    /// What is at a person or behind one, within this of the line of sight, is no point, m.
    pub person_m: f64,
    /// Nor is what lies on the floor within this of a person, m: shadows walk, too.
    pub shadow_m: f64,
    /// With fewer points than this an image shows too little, and the odometry of the log
    /// is believed.
    pub min_points: usize,
    /// Images are compared with one that was taken no farther away than this, m, ...
    pub max_travel_m: f64,
    /// ... nor with the robot turned by more, degrees.
    pub max_turn_deg: f64,
    /// Standard deviation of the way by the wheels, as a fraction of it.
    pub wheel_error: f64,
    /// Standard deviation of the heading by the wheels, rad for each metre of the way.
    pub heading_error_per_m: f64,
}

impl Default for OdometrySettings {
    fn default() -> Self {
        Self {
            cell_px: 24,
            min_slope: 5.0,
            min_depth_m: 0.8,
            max_depth_m: 10.0,
            person_m: 0.55,
            shadow_m: 2.0,
            min_points: 12,
            max_travel_m: 0.4,
            max_turn_deg: 10.0,
            wheel_error: 0.01,
            heading_error_per_m: 0.05,
        }
    }
}

impl OdometrySettings {
    /// What is wrong with the settings: the key, and what its value must be.
    pub fn mistake(&self) -> Option<(&'static str, String)> {
        let must = |right: bool, key, words: &str| (!right).then(|| (key, words.to_owned()));
        let positive = |value: f64, key| must(value.is_finite() && value > 0.0, key, "positive");
        must((8..=256).contains(&self.cell_px), "cell_px", "from 8 to 256")
            .or_else(|| positive(self.min_slope, "min_slope"))
            .or_else(|| positive(self.min_depth_m, "min_depth_m"))
            .or_else(|| {
                let farther = self.max_depth_m > self.min_depth_m;
                must(farther, "max_depth_m", "greater than `min_depth_m`")
            })
            .or_else(|| must(self.person_m >= 0.0, "person_m", "at least 0"))
            .or_else(|| must(self.shadow_m >= 0.0, "shadow_m", "at least 0"))
            .or_else(|| must(self.min_points >= 8, "min_points", "at least 8"))
            .or_else(|| positive(self.max_travel_m, "max_travel_m"))
            .or_else(|| positive(self.max_turn_deg, "max_turn_deg"))
            .or_else(|| positive(self.wheel_error, "wheel_error"))
            .or_else(|| positive(self.heading_error_per_m, "heading_error_per_m"))
    }
}
