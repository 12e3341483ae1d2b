use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the filter `ekf`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Spectral density of the person's white acceleration, m²/s³.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub acceleration_noise: f64,
    /// Random walk of the height of the head (sitting down, gait), m per square root of a second.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub height_noise: f64,
    /// Variance of each velocity component of a newcomer, m²/s².
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub initial_velocity_variance: f64,
    /// Standard deviation added to that of each detection, m, because detectors underestimate their
    /// errors.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub extra_sigma_m: f64,
    /// Degrees of freedom of the measurement noise: with few of them, 4 say, a
    /// detection far from the prediction counts for less (Student's t); 0: the
    /// noise is normal, and every detection counts in full.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub student_dof: f64,
    /// Time constant with which the velocity decays, s; 0: it does not. A person who is hidden for
    /// long walks on for less long than that.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub velocity_decay_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            acceleration_noise: 0.5,
            height_noise: 0.07,
            initial_velocity_variance: 2.0,
            extra_sigma_m: 0.02,
            student_dof: 0.0,
            velocity_decay_s: 0.0,
        }
    }
}
