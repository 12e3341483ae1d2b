use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

settings! {
    /// Settings of the track manager `manage-m-of-n`.
    pub struct Config {
        /// Score from which a detection without a track starts one (log-odds, including verifiers).
        pub start_score: f64 = 0.0,
        /// Time constant with which rejected candidates at a position are forgotten, s; they count
        /// against a new candidate there. 0: each new candidate is judged alone.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub doubt_s: f64 = 0.0,
        /// Distance within which two positions are the same, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub doubt_m: f64 = 0.3,
        /// Bound on the log-odds against a position.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub doubt_limit: f64 = 6.0,
        /// Number of detections that confirm a track.
        #[schemars(range(min = 1, max = 32))]
        pub confirm_hits: u32 = 2,
        /// Number of frames, in which the track could have been seen, within which these detections
        /// must lie; at most 32.
        #[schemars(range(min = 1, max = 32))]
        pub confirm_within: u32 = 3,
        /// Least time between two consecutive frames with detections that also confirm a track, s;
        /// 0: they never do. Errors in images that are far apart in time are less correlated.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub confirm_apart_s: f64 = 0.0,
        /// Score of a detection that confirms a track at once.
        pub confirm_score: f64 = 2.0,
        /// Number of consecutive misses after which a tentative track ends.
        #[schemars(range(min = 1))]
        pub tentative_misses: u32 = 2,
        /// Time without a detection after which a track that should be visible ends, s;
        /// `drop_after_misses` must hold as well.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub drop_after_s: f64 = 1.0,
        /// Least number of consecutive misses with which a track ends by `drop_after_s`.
        #[schemars(range(min = 1))]
        pub drop_after_misses: u32 = 3,
        /// Time without a detection after which a track that left the image ends, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub left_drop_after_s: f64 = 2.0,
        /// Time without a detection after which a track that is hidden behind another one ends, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub occluded_drop_after_s: f64 = 3.0,
        /// Weight of one frame in the score of a track, 0 to 1.
        #[schemars(range(min = 1e-6, max = 1.0))]
        pub score_weight: f64 = 0.3,
        /// Score of a miss: the value to which the score of a track tends while it should be
        /// visible and is not detected.
        pub miss_score: f64 = -1.0,
        /// Score below which a track ends. It takes several doubtful detections to get there.
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
