use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

settings! {
    /// Settings of the track manager `manage-m-of-n`.
    pub struct Config {
        /// A detection that belongs to no track starts one from this score on
        /// (log-odds, verifiers included).
        pub start_score: f64 = 0.0,
        /// Newcomers that were rejected at the same place count, too, and are forgotten with this
        /// time constant, s; 0: each newcomer is judged alone.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub doubt_s: f64 = 0.0,
        /// A place is the same within this, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub doubt_m: f64 = 0.3,
        /// No place is doubted more than this, log-odds.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub doubt_limit: f64 = 6.0,
        /// A track is confirmed when it was seen this often ...
        #[schemars(range(min = 1, max = 32))]
        pub confirm_hits: u32 = 2,
        /// ... in so many frames in which it could have been seen (at most 32), ...
        #[schemars(range(min = 1, max = 32))]
        pub confirm_within: u32 = 3,
        /// ... or in two frames in a row that are at least so far apart, s (0: never): errors of
        /// images that are far apart in time are less alike, ...
        #[schemars(range(min = 0.0, max = 1e6))]
        pub confirm_apart_s: f64 = 0.0,
        /// ... or at once by a detection with at least this score.
        pub confirm_score: f64 = 2.0,
        /// A track that is not confirmed ends after this many misses in a row.
        #[schemars(range(min = 1))]
        pub tentative_misses: u32 = 2,
        /// A track ends when it should have been visible and was not seen for
        /// longer than this, s, ...
        #[schemars(range(min = 0.0, max = 1e6))]
        pub drop_after_s: f64 = 1.0,
        /// ... and missed at least this often in a row.
        #[schemars(range(min = 1))]
        pub drop_after_misses: u32 = 3,
        /// A track that left the image ends when it was not seen for longer, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub left_drop_after_s: f64 = 2.0,
        /// A track that is hidden behind another one ends when it was not seen for
        /// longer, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub occluded_drop_after_s: f64 = 3.0,
        /// Weight of a frame in the score of a track, 0 to 1.
        #[schemars(range(min = 1e-6, max = 1.0))]
        pub score_weight: f64 = 0.3,
        /// Score of a miss: the value that the score of a track tends to while it should be visible
        /// and is not.
        pub miss_score: f64 = -1.0,
        /// A track with a lower score ends. It takes several doubtful sightings
        /// to get there.
        pub drop_score: f64 = -2.0,
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        self.check_relations()
    }

    /// Refuses settings that contradict each other.
    fn check_relations(&self) -> Result<()> {
        let Self { confirm_hits, confirm_within, drop_score, start_score, .. } = self;
        if confirm_within < confirm_hits {
            let why =
                format!("must be at least {confirm_hits}, as `confirm_hits`, not {confirm_within}");
            return Err(Error::setting("confirm_within", why));
        }
        if drop_score > start_score {
            let why = format!("must be at most {start_score}, as `start_score`, not {drop_score}");
            return Err(Error::setting("drop_score", why));
        }
        Ok(())
    }
}
