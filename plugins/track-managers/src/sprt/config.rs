use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

settings! {
    /// Settings of the track manager `manage-sprt`.
    pub struct Config {
        /// A detection that belongs to no track starts one from these log-odds on (verifiers and
        /// clutter included).
        pub start_log_odds: f64 = 0.0,
        /// A track is confirmed from these log-odds on. Wald's bound ln((1 - b) / a) is 4.6 for
        /// one false confirmation in a hundred ...
        pub confirm_log_odds: f64 = 4.6,
        /// ... and it ends below these.
        pub end_log_odds: f64 = -2.0,
        /// Log-odds are kept below this bound, so that misses count in time.
        pub max_log_odds: f64 = 8.0,
        /// One detection says no more than this, for or against, log-odds.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_look: f64 = 10.0,
        /// A look is a new one where the track is so far from where it was looked at before, m, or
        /// the robot from where it looked.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub new_look_m: f64 = 0.25,
        /// Repeated looks count up to this times their mean: more where a single look says little,
        /// 1 where verifiers are sure at once, and things must not gain by standing there.
        #[schemars(range(min = 1.0, max = 1e6))]
        pub repeated: f64 = 2.0,
        /// Looks fade with this time constant, s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub look_s: f64 = 4.0,
        /// A track that moved and then stays must look like before: this part of its usual log-odds
        /// is taken off within `undecided_s`.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub usual: f64 = 0.5,
        /// Evidence of each of several misses in a row, log-odds.
        #[schemars(range(min = -1e6, max = 0.0))]
        pub miss_log_odds: f64 = -0.5,
        /// Evidence of a second in which the filter alone supports the track, log-odds per second.
        #[schemars(range(min = -1e6, max = 0.0))]
        pub unverified_log_odds: f64 = -1.0,
        /// Evidence of a second in which a track is seen and has not moved, log-odds per second ...
        #[schemars(range(min = -1e6, max = 0.0))]
        pub still_log_odds: f64 = -0.75,
        /// ... and at most.
        #[schemars(range(min = -1e6, max = 0.0))]
        pub max_still: f64 = -1.5,
        /// Evidence of the track's motion, log-odds.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub moved_log_odds: f64 = 3.0,
        /// A track has moved when it is so far from where it started, m, and farther than its
        /// uncertainty explains.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub moved_m: f64 = 0.5,
        /// A track that is not confirmed and did not move ends after this time, s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub undecided_s: f64 = 2.0,
        /// A confirmed track that did not move ends after this time, s, in which it was less likely
        /// a person than not.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub doubted_s: f64 = 5.0,
        /// Clutter is remembered with this time constant, s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub clutter_s: f64 = 60.0,
        /// Clutter is at a place within this, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub clutter_m: f64 = 0.3,
        /// Clutter outweighs what was seen of it by this, log-odds ...
        #[schemars(range(min = 0.0, max = 1e6))]
        pub min_clutter: f64 = 3.0,
        /// ... but no place counts for more clutter than this.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub max_clutter: f64 = 10.0,
        /// A track that is not confirmed ends after this many misses in a row.
        #[schemars(range(min = 1, max = 1000000))]
        pub tentative_misses: u32 = 2,
        /// A track ends when it should have been visible and was not seen for longer, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub drop_after_s: f64 = 1.0,
        /// A track that left the image ends when it was not seen for longer, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub left_drop_after_s: f64 = 2.0,
        /// A track that is hidden behind another one ends when it was not seen for longer, s.
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
