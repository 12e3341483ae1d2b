use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of `image-kalman`. Lengths in the image are given in widths of the box, so that they
/// hold at every distance; the box of an upper body is 0.57 m wide.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Spectral density of the white acceleration of the box, widths²/s³.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub acceleration_noise: f64,
    /// Factor by which `acceleration_noise` is larger in a manoeuvre; 0: there are none. Two filters
    /// then run for each person, and the likelihoods of the detections weigh them.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub manoeuvre_factor: f64,
    /// Rate at which manoeuvres begin and end, 1/s.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub manoeuvre_rate_hz: f64,
    /// Random walk of the box beside its velocity, widths per square root of a second: the shaking
    /// of a camera whose motion is not known.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub position_noise: f64,
    /// Random walk of the width, as a fraction of it per square root of a second.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub scale_noise: f64,
    /// Spectral density of the white acceleration along the ray, m²/s³.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub range_noise: f64,
    /// Standard deviation of the velocity of a new track's box, widths/s.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub initial_speed: f64,
    /// Standard deviation of a new track's velocity along the ray, m/s.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub initial_range_speed_mps: f64,
    /// Standard deviation added to that of a box's centre, widths: errors that detectors leave out
    /// of their covariance.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_centre: f64,
    /// Standard deviation of a box's width, as a fraction of it.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_scale: f64,
    /// Standard deviation added to that of a range, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_range_m: f64,
    /// Weight of a detection in the shape of the box (its height over its width, and the place of
    /// the head in it), 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub shape_weight: f64,
    /// Time constant with which the velocity of the box decays, s; 0: it does not. A person who is
    /// hidden for long walks on for less long than that.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub velocity_decay_s: f64,
    /// A track that is observed again after frames without a detection is filtered anew over these
    /// frames, along the straight way between the two observations.
    pub reupdate: bool,
    /// A track with a detection is reported with the detection's box instead of the filtered one:
    /// for a detector whose boxes are better than their average over time.
    pub observed_boxes: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            acceleration_noise: 1.5,
            manoeuvre_factor: 0.0,
            manoeuvre_rate_hz: 0.5,
            position_noise: 0.0,
            scale_noise: 0.3,
            range_noise: 0.5,
            initial_speed: 2.5,
            initial_range_speed_mps: 1.4,
            sigma_centre: 0.03,
            sigma_scale: 0.1,
            sigma_range_m: 0.02,
            shape_weight: 0.3,
            velocity_decay_s: 0.0,
            reupdate: false,
            observed_boxes: false,
        }
    }
}
