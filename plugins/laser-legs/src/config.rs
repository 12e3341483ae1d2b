use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

settings! {
    /// Settings of `laser-legs`.
    pub struct Config {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// Division of a scan into segments.
        pub segments: Segmentation,
        /// A segment below these log-odds is no leg.
        #[schemars(range(min = -100.0, max = 100.0))]
        pub min_leg_log_odds: f64 = -1.0,
        /// Two legs belong to one person if their middles are no farther apart, m.
        #[schemars(range(min = 0.0, max = 2.0))]
        pub max_stride_m: f64 = 0.7,
        /// Added to the log-odds of a single leg: most segments like legs are furniture.
        #[schemars(range(min = -10.0, max = 10.0))]
        pub single_log_odds: f64 = 0.0,
        /// Added to the sum of both legs' log-odds.
        #[schemars(range(min = -10.0, max = 10.0))]
        pub pair_log_odds: f64 = 0.5,
        /// Added to the log-odds of a person where nothing was in the last two seconds, and taken
        /// from them where something was: people move, furniture does not. Only for robots with
        /// odometry, or at rest; 0: earlier scans are not looked at.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub free_log_odds: f64 = 0.0,
        /// Log-odds of a detection are limited to plus and minus this: one scan is never beyond
        /// doubt.
        #[schemars(range(min = 0.0, max = 100.0))]
        pub limit: f64 = 3.0,
        /// Standard deviation of the place of a person of whom both legs are seen, along either
        /// axis of the floor, m.
        #[schemars(range(min = 0.001, max = 2.0))]
        pub pair_sigma_m: f64 = 0.08,
        /// The same if one leg is seen: the other one may be on any side of it.
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
        /// Neighbouring points belong together if they are no farther apart than this, m, ...
        #[schemars(range(min = 0.001, max = 2.0))]
        pub jump_m: f64 = 0.1,
        /// ... plus so many times the distance of two rays at their range.
        #[schemars(range(min = 0.0, max = 100.0))]
        pub jump_rays: f64 = 1.5,
        /// Rays without a reflection that may lie between neighbouring points.
        #[schemars(range(min = 0, max = 100))]
        pub gap_rays: u32 = 1,
        /// Segments of fewer points are noise.
        #[schemars(range(min = 1, max = 1000))]
        pub min_points: usize = 2,
        /// Segments that are wider than this are walls and furniture, m.
        #[schemars(range(min = 0.01, max = 10.0))]
        pub max_width_m: f64 = 0.6,
    }
}

settings! {
    /// Settings of the fit.
    pub struct Training {
        /// Numbers of trees to try; the one with the best held-out ranking is taken.
        pub trees: Vec<usize> = vec![50, 100, 200],
        /// Questions from the root of a tree to a leaf.
        #[schemars(range(min = 1, max = 6))]
        pub depth: usize = 3,
        /// Number of parts into which the groups are divided; each is held out once.
        #[schemars(range(min = 2, max = 100))]
        pub folds: usize = 3,
        /// Each scan is also shown with every so-many-th ray only.
        pub every_ray: Vec<u32> = vec![2, 3],
        /// A segment is a leg if its middle is no farther from an annotated leg than this, m;
        /// beyond twice this it is none, and between them it is left out.
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
