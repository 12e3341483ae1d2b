use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{POSITIVE, Result, check_ranges};

/// Settings of `image-kalman`. Lengths in the image are given in widths of the
/// box, so that near and far people are treated alike; the box of an upper body
/// is 0.57 m wide.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Spectral density of the white acceleration of the box, widths²/s³.
    pub acceleration_noise: f64,
    /// How fast the width may wander, as a fraction of it per square root of a
    /// second.
    pub scale_noise: f64,
    /// Spectral density of the white acceleration along the ray, m²/s³.
    pub range_noise: f64,
    /// Standard deviation of the velocity of a newcomer's box, widths/s.
    pub initial_speed: f64,
    /// Standard deviation of a newcomer's velocity along the ray, m/s.
    pub initial_range_speed_mps: f64,
    /// Standard deviation added to that of a box's centre, widths: what
    /// detectors do not know about themselves.
    pub sigma_centre: f64,
    /// Standard deviation of a box's width, as a fraction of it.
    pub sigma_scale: f64,
    /// Standard deviation added to that of a range, m.
    pub sigma_range_m: f64,
    /// Weight of a sighting in the shape of the box (its height over its width,
    /// and where in it the head is), 0 to 1.
    pub shape_weight: f64,
    /// As printed: the measurement matrix of eq. 8, which has the time step in
    /// it. Lags by one frame's way.
    pub compat_printed_measurement: bool,
    /// As printed: nothing is done about the robot's own motion.
    pub compat_printed_ego_motion: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            acceleration_noise: 1.5,
            scale_noise: 0.3,
            range_noise: 0.5,
            initial_speed: 2.5,
            initial_range_speed_mps: 1.4,
            sigma_centre: 0.03,
            sigma_scale: 0.1,
            sigma_range_m: 0.02,
            shape_weight: 0.3,
            compat_printed_measurement: false,
            compat_printed_ego_motion: false,
        }
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_ranges(&[
            ("acceleration_noise", self.acceleration_noise, POSITIVE),
            ("scale_noise", self.scale_noise, POSITIVE),
            ("range_noise", self.range_noise, POSITIVE),
            ("initial_speed", self.initial_speed, POSITIVE),
            ("initial_range_speed_mps", self.initial_range_speed_mps, POSITIVE),
            ("sigma_centre", self.sigma_centre, POSITIVE),
            ("sigma_scale", self.sigma_scale, POSITIVE),
            ("sigma_range_m", self.sigma_range_m, POSITIVE),
            ("shape_weight", self.shape_weight, 0.0..=1.0),
        ])
    }
}
