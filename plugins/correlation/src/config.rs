use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::Result;

/// Settings of `correlation`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Least correlation of a picture with the image for a detection.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_correlation: f64,
    /// It must correlate by so much more than elsewhere, ...
    #[schemars(range(min = 0.0, max = 1e6))]
    pub min_lead: f64,
    /// ... which is at least so far away, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub elsewhere_m: f64,
    /// This part of the body at least must not be behind something nearer.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_shown: f64,
    /// Where this part of the body has depth, other detectors know better.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_known: f64,
    /// Difference from the distance of the person from which on a reading is of another object, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub depth_tolerance_m: f64,
    /// People are searched so many standard deviations around the expected place, ...
    #[schemars(range(min = 0.0, max = 1e6))]
    pub search_sigmas: f64,
    /// ... but not farther aside than this, m, ...
    #[schemars(range(min = 0.0, max = 2.0))]
    pub search_aside_m: f64,
    /// ... nor up and down.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub search_up_m: f64,
    /// A picture is remembered if depth shows the person's body in this part of the
    /// upper-body square.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_body: f64,
    /// Standard deviation of the place across the line of sight, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_place_m: f64,
    /// Standard deviation of the distance, which a picture does not tell, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_distance_m: f64,
    /// Age from which on a picture is not searched any more, s: an object that was mistaken for a
    /// person is found again as well, and its track must end.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub memory_s: f64,
    /// Score of a detection, log-odds. 0: a picture identifies a person, but is no evidence that it
    /// is one.
    pub score: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            min_correlation: 0.78,
            min_lead: 0.1,
            elsewhere_m: 0.25,
            min_shown: 0.4,
            max_known: 0.5,
            depth_tolerance_m: 0.5,
            search_sigmas: 3.0,
            search_aside_m: 0.6,
            search_up_m: 0.2,
            min_body: 0.35,
            sigma_place_m: 0.05,
            sigma_distance_m: 3.0,
            memory_s: 3.0,
            score: 0.0,
        }
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)
    }
}
