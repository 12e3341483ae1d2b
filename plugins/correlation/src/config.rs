use tagalong_config::check_settings;
use tagalong_core::{Result, settings};

settings! {
    /// Settings of `correlation`.
    pub struct Config {
        /// Least correlation of the remembered picture with the image for a detection.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_correlation: f64 = 0.78,
        /// Least lead of this correlation over that of other positions in the search.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub min_lead: f64 = 0.1,
        /// Least distance of these other positions from the best one, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub elsewhere_m: f64 = 0.25,
        /// Least share of the body that is not behind something nearer.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_shown: f64 = 0.4,
        /// Share of the body with depth above which there is no detection, because other detectors
        /// are better there.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub max_known: f64 = 0.5,
        /// Difference from the person's distance at which a reading belongs to another object, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub depth_tolerance_m: f64 = 0.5,
        /// Radius of the search around the expected position, in its standard deviations.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub search_sigmas: f64 = 3.0,
        /// Largest sideways distance of the search, m.
        #[schemars(range(min = 0.0, max = 2.0))]
        pub search_aside_m: f64 = 0.6,
        /// Largest vertical distance of the search, m.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub search_up_m: f64 = 0.2,
        /// Least share of the upper-body square in which depth shows the person's body, so that the
        /// picture is remembered.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_body: f64 = 0.35,
        /// Standard deviation of the position across the line of sight, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_place_m: f64 = 0.05,
        /// Standard deviation of the distance, which a picture does not contain, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_distance_m: f64 = 3.0,
        /// Age at which a picture is no longer searched for, s: an object that was mistaken for a
        /// person is also found again, and its track must end.
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
