use tagalong_config::check_settings;
use tagalong_core::{Result, settings};

settings! {
    /// Settings of `correlation`.
    pub struct Config {
        /// Least correlation of a picture with the image for a detection.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_correlation: f64 = 0.78,
        /// It must correlate by so much more than elsewhere, ...
        #[schemars(range(min = 0.0, max = 1e6))]
        pub min_lead: f64 = 0.1,
        /// ... which is at least so far away, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub elsewhere_m: f64 = 0.25,
        /// This part of the body at least must not be behind something nearer.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_shown: f64 = 0.4,
        /// Where this part of the body has depth, other detectors know better.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub max_known: f64 = 0.5,
        /// Difference from the distance of the person from which on a reading is of another object,
        /// m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub depth_tolerance_m: f64 = 0.5,
        /// People are searched so many standard deviations around the expected place, ...
        #[schemars(range(min = 0.0, max = 1e6))]
        pub search_sigmas: f64 = 3.0,
        /// ... but not farther aside than this, m, ...
        #[schemars(range(min = 0.0, max = 2.0))]
        pub search_aside_m: f64 = 0.6,
        /// ... nor up and down.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub search_up_m: f64 = 0.2,
        /// A picture is remembered if depth shows the person's body in this part of the
        /// upper-body square.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_body: f64 = 0.35,
        /// Standard deviation of the place across the line of sight, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_place_m: f64 = 0.05,
        /// Standard deviation of the distance, which a picture does not tell, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_distance_m: f64 = 3.0,
        /// Age from which on a picture is not searched any more, s: an object that was mistaken for
        /// a person is found again as well, and its track must end.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub memory_s: f64 = 3.0,
        /// Score of a detection, log-odds. 0: a picture identifies a person, but is no evidence
        /// that it is one.
        pub score: f64 = 0.0,
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)
    }
}
