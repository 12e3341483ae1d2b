use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

settings! {
    /// Settings of `laser-legs`.
    pub struct Config {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// Division of a scan into segments.
        pub segments: Segmentation,
        /// Least log-odds of a leg; segments with less are not used.
        #[schemars(range(min = -100.0, max = 100.0))]
        pub min_leg_log_odds: f64 = -1.0,
        /// Largest distance between the centres of the two legs of a person, m.
        #[schemars(range(min = 0.0, max = 2.0))]
        pub max_stride_m: f64 = 0.7,
        /// Log-odds added to those of a single leg, because most leg-like segments are furniture.
        #[schemars(range(min = -10.0, max = 10.0))]
        pub single_log_odds: f64 = 0.0,
        /// Log-odds added to the sum over both legs.
        #[schemars(range(min = -10.0, max = 10.0))]
        pub pair_log_odds: f64 = 0.5,
        /// Log-odds added for a person at a position that was free in the last two seconds, and
        /// subtracted where it was occupied: people move, furniture does not. Only for robots with
        /// odometry, or at rest; 0: earlier scans are not used.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub free_log_odds: f64 = 0.0,
        /// Bound on the log-odds of a detection, in both directions: a single scan is never
        /// certain.
        #[schemars(range(min = 0.0, max = 100.0))]
        pub limit: f64 = 3.0,
        /// Standard deviation of the position of a person with both legs visible, along either axis
        /// of the floor, m.
        #[schemars(range(min = 0.001, max = 2.0))]
        pub pair_sigma_m: f64 = 0.08,
        /// The same with one leg visible: the other one may be on any side of it.
        #[schemars(range(min = 0.001, max = 2.0))]
        pub single_sigma_m: f64 = 0.16,
        /// Height at which the centre of the head is assumed, m. A scan contains no information on
        /// it, so its variance is large.
        #[schemars(range(min = 0.0, max = 3.0))]
        pub head_height_m: f64 = 1.6,
        /// Settings of the fit; only `tagalong train` reads them.
        pub training: Training,
    }
}

settings! {
    /// Division of a scan into segments.
    pub struct Segmentation {
        /// Largest distance between neighbouring points of a segment, m; `jump_rays` adds to it.
        #[schemars(range(min = 0.001, max = 2.0))]
        pub jump_m: f64 = 0.1,
        /// Addition to this distance, as a multiple of the spacing of two rays at their range.
        #[schemars(range(min = 0.0, max = 100.0))]
        pub jump_rays: f64 = 1.5,
        /// Largest number of rays without a return between neighbouring points of a segment.
        #[schemars(range(min = 0, max = 100))]
        pub gap_rays: u32 = 1,
        /// Least number of points of a segment; smaller ones are noise.
        #[schemars(range(min = 1, max = 1000))]
        pub min_points: usize = 2,
        /// Largest width of a segment, m; wider ones are walls and furniture.
        #[schemars(range(min = 0.01, max = 10.0))]
        pub max_width_m: f64 = 0.6,
    }
}

settings! {
    /// Settings of the fit.
    pub struct Training {
        /// Numbers of trees to try; the one that ranks the held-out segments best is used.
        pub trees: Vec<usize> = vec![50, 100, 200],
        /// Number of decisions from the root of a tree to a leaf.
        #[schemars(range(min = 1, max = 6))]
        pub depth: usize = 3,
        /// Number of parts into which the groups are divided; each is held out once.
        #[schemars(range(min = 2, max = 100))]
        pub folds: usize = 3,
        /// Training also uses each scan with only every n-th ray, for each n in this list.
        pub every_ray: Vec<u32> = vec![2, 3],
        /// Largest distance of a segment's centre from an annotated leg at which it is labelled as
        /// a leg, m; beyond twice this distance it is labelled as no leg, and in between it is left
        /// out.
        #[schemars(range(min = 0.01, max = 1.0))]
        pub label_m: f64 = 0.15,
    }
}

impl Config {
    /// Checks the ranges of the settings.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        let Training { trees, every_ray, .. } = &self.training;
        if trees.is_empty() || trees.iter().any(|count| !(1..=2000).contains(count)) {
            return Err(Error::setting("training.trees", "must be numbers of 1 to 2000"));
        }
        if every_ray.iter().any(|step| !(2..=16).contains(step)) {
            return Err(Error::setting("training.every_ray", "must be numbers of 2 to 16"));
        }
        Ok(())
    }
}
