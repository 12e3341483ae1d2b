use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{ANY, NOT_NEGATIVE, POSITIVE, Result, check_ranges};

/// Settings of `correlation`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// A picture that correlates less with what is seen is not found.
    pub min_correlation: f64,
    /// It must correlate by so much more than elsewhere, ...
    pub min_lead: f64,
    /// ... which is at least so far away, m.
    pub elsewhere_m: f64,
    /// This part of the body at least must not be behind something nearer.
    pub min_shown: f64,
    /// Where this part of the body has depth, other detectors know better.
    pub max_known: f64,
    /// What is nearer or farther than the person by more is something else, m.
    pub depth_tolerance_m: f64,
    /// People are searched so many standard deviations around the expected place, ...
    pub search_sigmas: f64,
    /// ... but not farther aside than this, m, ...
    pub search_aside_m: f64,
    /// ... nor up and down.
    pub search_up_m: f64,
    /// A picture is remembered if depth shows the person's body in this part of the
    /// upper-body square.
    pub min_body: f64,
    /// Standard deviation of the place across the line of sight, m.
    pub sigma_place_m: f64,
    /// Standard deviation of the distance, which a picture does not tell, m.
    pub sigma_distance_m: f64,
    /// A picture that is older than this is not looked for, s: what was taken for a person
    /// is found again as well, and its track must end.
    pub memory_s: f64,
    /// Score of a sighting, log-odds. 0: a picture says who it is, not whether that is a
    /// person.
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
        check_ranges(&[
            ("min_correlation", self.min_correlation, 0.0..=1.0),
            ("min_lead", self.min_lead, NOT_NEGATIVE),
            ("elsewhere_m", self.elsewhere_m, POSITIVE),
            ("min_shown", self.min_shown, 0.0..=1.0),
            ("max_known", self.max_known, 0.0..=1.0),
            ("depth_tolerance_m", self.depth_tolerance_m, POSITIVE),
            ("search_sigmas", self.search_sigmas, NOT_NEGATIVE),
            ("search_aside_m", self.search_aside_m, 0.0..=2.0),
            ("search_up_m", self.search_up_m, 0.0..=1.0),
            ("min_body", self.min_body, 0.0..=1.0),
            ("sigma_place_m", self.sigma_place_m, POSITIVE),
            ("sigma_distance_m", self.sigma_distance_m, POSITIVE),
            ("memory_s", self.memory_s, NOT_NEGATIVE),
            ("score", self.score, ANY),
        ])
    }
}
