use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::Result;

/// Settings of `mosse`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Weight of the past when the filter learns from a frame, 0 to 1.
    #[schemars(range(min = 0.0, max = 0.999))]
    pub memory: f64,
    /// The same when another detector has found the person elsewhere.
    #[schemars(range(min = 0.0, max = 0.999))]
    pub anchored_memory: f64,
    /// Standard deviation of the peak that the filter is to answer with, upper-body widths.
    #[schemars(range(min = 0.01, max = 0.5))]
    pub peak_width: f64,
    /// Added to the power of each frequency, as a part of the mean power: frequencies that a person
    /// hardly has must not decide.
    #[schemars(range(min = 1e-9, max = 10.0))]
    pub regularisation: f64,
    /// Largest turn of the windows from which a filter begins, degrees, ...
    #[schemars(range(min = 0.0, max = 45.0))]
    pub turn_deg: f64,
    /// ... and the largest change of their size, as a fraction.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub growth: f64,
    /// Least ratio of the peak to the sidelobes of a detection: heights above their mean, in
    /// standard deviations.
    pub min_ratio: f64,
    /// Least ratio at which the filter learns.
    pub learn_ratio: f64,
    /// Drops places that show something at another distance than the person's by more than this,
    /// m; 0 looks at no depth.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub depth_tolerance_m: f64,
    /// Score of a detection, log-odds. Below 0, so that a track that no other detector supports
    /// loses its score and ends.
    pub score: f64,
    /// Standard deviation of the place of the box, upper-body widths.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub sigma_box: f64,
    /// Standard deviation of a distance from the depth image, m.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub sigma_depth_m: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            memory: 0.875,
            anchored_memory: 0.5,
            peak_width: 0.0625,
            regularisation: 0.01,
            turn_deg: 6.0,
            growth: 0.05,
            min_ratio: 7.0,
            learn_ratio: 9.0,
            depth_tolerance_m: 0.5,
            score: -0.2,
            sigma_box: 0.05,
            sigma_depth_m: 0.1,
        }
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)
    }
}
