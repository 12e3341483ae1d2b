use nalgebra::Matrix2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

/// Prediction of a person's next position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    /// u = 0: the last position.
    Still,
    /// u is the difference of the last two posterior positions.
    LastDifference,
    /// Four states: position and velocity, with white acceleration.
    ConstantVelocity,
}

/// Covariance of a detection's position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Measurement {
    /// The detection's own covariance.
    Detection,
    /// `measurement_m2` for every detection.
    Fixed,
    /// From `sigma_range_m`, `sigma_range_per_m` and `sigma_bearing_deg`.
    Polar,
}

settings! {
    /// Settings of the filter `floor-kalman`.
    pub struct Config {
        /// Prediction of the next position: `still`, `last-difference` or `constant-velocity`.
        pub form: Form = Form::ConstantVelocity,
        /// Covariance of detections: `detection`, `fixed` or `polar`.
        pub measurement: Measurement = Measurement::Detection,
        /// Process noise Q of the forms without velocity: xx, xy, yy in room axes, m² per `step_s`.
        #[schemars(inner(range(min = -999_999, max = 999_999)))]
        pub process_m2: [f64; 3] = [0.024, -0.001, 0.043],
        /// Time between two images for which Q is given, s.
        #[schemars(range(min = 1e-3, max = 1e3))]
        pub step_s: f64 = 1.0 / 3.0,
        /// Measurement noise R of `fixed`: xx, xy, yy in room axes, m².
        #[schemars(inner(range(min = -999_999, max = 999_999)))]
        pub measurement_m2: [f64; 3] = [0.011, -0.004, 0.020],
        /// For `polar`: standard deviation of the range at the robot, m.
        #[schemars(range(min = 1e-3, max = 1e3))]
        pub sigma_range_m: f64 = 0.05,
        /// For `polar`: increase of that standard deviation per metre of range, m.
        #[schemars(range(min = 0.0, max = 1e3))]
        pub sigma_range_per_m: f64 = 0.03,
        /// For `polar`: standard deviation of the bearing, degrees.
        #[schemars(range(min = 1e-3, max = 1e3))]
        pub sigma_bearing_deg: f64 = 1.0,
        /// For `constant-velocity`: spectral density of the white acceleration, m²/s³.
        #[schemars(range(min = 1e-6, max = 1e3))]
        pub acceleration_noise: f64 = 0.2,
        /// Standard deviation of the velocity components of a new track, m/s.
        #[schemars(range(min = 1e-3, max = 1e3))]
        pub initial_speed_mps: f64 = 1.0,
        /// Random walk of the height of the head, m per square root of a second.
        #[schemars(range(min = 0.0, max = 1e3))]
        pub height_noise: f64 = 0.03,
        /// Angle from the robot's heading at the start to the X axis of the room, degrees.
        #[schemars(range(min = -360.0, max = 1e3))]
        pub room_heading_deg: f64 = 0.0,
    }
}

impl Config {
    /// Q for a time of `dt` seconds, m².
    pub(crate) fn process(&self, dt: f64) -> Matrix2<f64> {
        symmetric(self.process_m2) * (dt / self.step_s)
    }

    /// R of `fixed`, m².
    pub(crate) fn fixed_measurement(&self) -> Matrix2<f64> {
        symmetric(self.measurement_m2)
    }

    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        for (key, value) in
            [("process_m2", self.process_m2), ("measurement_m2", self.measurement_m2)]
        {
            if symmetric(value).cholesky().is_none() {
                let why = format!("must be a covariance (xx, xy, yy), not {value:?}");
                return Err(Error::setting(key, why));
            }
        }
        Ok(())
    }
}

fn symmetric([xx, xy, yy]: [f64; 3]) -> Matrix2<f64> {
    Matrix2::new(xx, xy, xy, yy)
}
