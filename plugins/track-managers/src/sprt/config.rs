use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

settings! {
    /// Settings of the track manager `manage-sprt`.
    pub struct Config {
        /// Log-odds from which a detection without a track starts one (including verifiers and
        /// clutter).
        pub start_log_odds: f64 = 0.0,
        /// Log-odds from which a track is confirmed. Wald's bound ln((1 - b) / a) is 4.6 for one
        /// false confirmation in a hundred.
        pub confirm_log_odds: f64 = 4.6,
        /// Log-odds below which a track ends.
        pub end_log_odds: f64 = -2.0,
        /// Upper bound on the log-odds of a track, so that misses take effect in time.
        pub max_log_odds: f64 = 8.0,
        /// Bound on the log-odds of one detection, in both directions.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_look: f64 = 10.0,
        /// Distance that the track or the robot must have moved since the previous observation, m,
        /// so that an observation counts as a new one.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub new_look_m: f64 = 0.25,
        /// Largest weight of repeated observations, as a multiple of their mean: more where a
        /// single observation says little, 1 where verifiers are certain at once and static objects
        /// must not gain by repetition.
        #[schemars(range(min = 1.0, max = 1e6))]
        pub repeated: f64 = 2.0,
        /// Time constant with which observations decay, s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub look_s: f64 = 4.0,
        /// Fraction of its usual log-odds that a track has to keep when it moved and then stays: this
        /// fraction is subtracted over `undecided_s`.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub usual: f64 = 0.5,
        /// Evidence of each of several consecutive misses, log-odds.
        #[schemars(range(min = -1e6, max = 0.0))]
        pub miss_log_odds: f64 = -0.5,
        /// Evidence of one second in which the filter alone supports the track, log-odds per
        /// second.
        #[schemars(range(min = -1e6, max = 0.0))]
        pub unverified_log_odds: f64 = -1.0,
        /// Evidence of one second in which a track is seen and has not moved, log-odds per second.
        #[schemars(range(min = -1e6, max = 0.0))]
        pub still_log_odds: f64 = -0.75,
        /// Bound on the total evidence of `still_log_odds`, log-odds.
        #[schemars(range(min = -1e6, max = 0.0))]
        pub max_still: f64 = -1.5,
        /// Evidence of the track's motion, log-odds.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub moved_log_odds: f64 = 3.0,
        /// Distance from its start beyond which a track has moved, m; it must also exceed what the
        /// track's uncertainty explains.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub moved_m: f64 = 0.5,
        /// Time after which a tentative track that did not move ends, s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub undecided_s: f64 = 2.0,
        /// Time after which a confirmed track that did not move ends, s, if it was less likely a
        /// person than not during that time.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub doubted_s: f64 = 5.0,
        /// Time constant with which clutter is forgotten, s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub clutter_s: f64 = 60.0,
        /// Radius within which clutter counts at a position, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub clutter_m: f64 = 0.3,
        /// Margin by which clutter outweighs the evidence that was seen there, log-odds.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub min_clutter: f64 = 3.0,
        /// Largest clutter at a position, log-odds.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub max_clutter: f64 = 10.0,
        /// Number of consecutive misses after which a tentative track ends.
        #[schemars(range(min = 1, max = 1000000))]
        pub tentative_misses: u32 = 2,
        /// Time without a detection after which a track that should be visible ends, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub drop_after_s: f64 = 1.0,
        /// Time without a detection after which a track that left the image ends, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub left_drop_after_s: f64 = 2.0,
        /// Time without a detection after which a track that is hidden behind another one ends, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub occluded_drop_after_s: f64 = 3.0,
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        let Self { start_log_odds, confirm_log_odds, end_log_odds, max_log_odds, .. } = *self;
        let in_order = end_log_odds < start_log_odds
            && start_log_odds <= confirm_log_odds
            && confirm_log_odds <= max_log_odds;
        if !in_order {
            let why = format!(
                "= {end_log_odds}, `start_log_odds` = {start_log_odds}, `confirm_log_odds` = \
                 {confirm_log_odds} and `max_log_odds` = {max_log_odds} must rise in this order"
            );
            return Err(Error::setting("end_log_odds", why));
        }
        Ok(())
    }
}
