use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Error, Result, check_settings};

/// Odometry, corrected by what stands still in the images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OdometrySettings {
    /// One point is taken of each square of this side, px.
    #[schemars(range(min = 8, max = 256))]
    pub cell_px: usize,
    /// Least change of brightness from pixel to pixel at a point, of 255.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min_slope: f64,
    /// Points are no nearer than this, m: what is near moves more often than walls do, ...
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min_depth_m: f64,
    /// ... and no farther away than this, m.
    pub max_depth_m: f64,
    /// What is at a person or behind one, within this of the line of sight, is no point, m.
    #[schemars(range(min = 0.0))]
    pub person_m: f64,
    /// Nor is what lies on the floor within this of a person, m: shadows walk, too.
    #[schemars(range(min = 0.0))]
    pub shadow_m: f64,
    /// With fewer points than this an image shows too little, and the odometry of the log
    /// is believed.
    #[schemars(range(min = 8))]
    pub min_points: usize,
    /// Images are compared with one that was taken no farther away than this, m, ...
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_travel_m: f64,
    /// ... nor with the robot turned by more, degrees.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_turn_deg: f64,
    /// Standard deviation of the way by the wheels, as a fraction of it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub wheel_error: f64,
    /// Standard deviation of the heading by the wheels, rad for each metre of the way.
    #[schemars(extend("exclusiveMinimum" = 0))]
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
    /// Refuses settings that cannot work.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] names the key.
    pub fn check(&self) -> Result<()> {
        check_settings(self)?;
        if self.max_depth_m <= self.min_depth_m {
            return Err(Error::setting("max_depth_m", "must be greater than `min_depth_m`"));
        }
        Ok(())
    }
}
