use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

/// Data from which the motion is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MotionSource {
    /// Images with depth correct the odometry of the log.
    #[default]
    Depth,
    /// Images alone, for a log without odometry and depth.
    Image,
}

settings! {
    /// Settings of the odometry from images.
    #[non_exhaustive]
    pub struct OdometrySettings {
        /// `depth`: static points of known depth correct the odometry of the log. `image`: corners
        /// of the images alone, for a log without odometry and depth; of the settings below, only
        /// `cell_px`, `min_slope`, `min_points`, `scene_depth_m` and `settle_s` are used.
        pub source: MotionSource = MotionSource::Depth,
        /// Side of the square cells that yield at most one point each, px.
        #[schemars(range(min = 8, max = 256))]
        pub cell_px: usize = 24,
        /// Minimum change of brightness from pixel to pixel at a point, grey levels of 255.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub min_slope: f64 = 5.0,
        /// Minimum depth of a point, m: near things move more often than walls.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub min_depth_m: f64 = 0.8,
        /// Maximum depth of a point, m.
        pub max_depth_m: f64 = 10.0,
        /// Points on a person or behind one, within this distance of the line of sight, are left
        /// out, m.
        #[schemars(range(min = 0.0))]
        pub person_m: f64 = 0.55,
        /// Floor points within this distance of a person are left out because of the shadow, m.
        #[schemars(range(min = 0.0))]
        pub shadow_m: f64 = 2.0,
        /// Minimum number of points; with fewer the odometry of the log is not corrected.
        #[schemars(range(min = 8))]
        pub min_points: usize = 12,
        /// Distance from the keyframe beyond which a new one is taken, m.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub max_travel_m: f64 = 0.4,
        /// Turn from the keyframe beyond which a new one is taken, degrees.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub max_turn_deg: f64 = 10.0,
        /// Standard deviation of the path by wheel odometry, as a fraction of the path.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub wheel_error: f64 = 0.01,
        /// Standard deviation of the heading by wheel odometry, rad per metre of the path.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub heading_error_per_m: f64 = 0.05,
        /// `image`: assumed depth of the scene behind the people, m. The growth of the image gives
        /// the forward motion as a fraction of this depth.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub scene_depth_m: f64 = 8.0,
        /// `image`: time constant with which a camera that nods or rolls is assumed to return to
        /// its mount, s, because small errors add up.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub settle_s: f64 = 5.0,
    }
}

impl OdometrySettings {
    /// Rejects settings that cannot work.
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
