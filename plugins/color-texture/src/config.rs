use tagalong_core::settings;

settings! {
    /// Settings of `color-texture`.
    pub struct Config {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// Weight of this verifier's log-odds relative to the detector's score.
        pub weight: f64 = 1.0,
        /// Bound on the log-odds of one frame, in both directions: a single frame is never certain.
        pub limit: f64 = 6.0,
        /// Log-odds added to the evidence of each frame, as a prior. Below zero the verifier is
        /// stricter.
        pub bias: f64 = 0.0,
        /// Settings of the fit; only `tagalong train` reads them.
        pub training: Training,
    }
}

settings! {
    /// Settings of the fit.
    pub struct Training {
        /// Numbers of trees to try; each is one row of the card.
        pub trees: Vec<usize> = vec![100, 200, 400, 800],
        /// Learning rate: the fraction of the values of each tree that is added.
        pub rate: f64 = 0.1,
        /// Fraction of the features, chosen at random, among which each tree selects.
        pub features: f64 = 0.25,
        /// Shrinkage of the values of a tree that has few examples: as if it had this many more,
        /// undecided ones.
        pub caution: f64 = 5.0,
        /// Share of the weight of candidates without depth (photographs).
        pub without_depth: f64 = 0.1,
        /// Number of parts into which the groups are divided; each is held out once.
        pub folds: usize = 4,
    }
}
