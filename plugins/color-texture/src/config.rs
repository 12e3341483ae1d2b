use tagalong_core::settings;

settings! {
    /// Settings of `color-texture`.
    pub struct Config {
        /// Model file, relative to the config; empty: the model that is built in.
        pub model: String,
        /// Weight of this verifier's log-odds beside the detector's score.
        pub weight: f64 = 1.0,
        /// Log-odds of one frame are limited to plus and minus this: one look is
        /// never beyond doubt.
        pub limit: f64 = 6.0,
        /// Prior evidence, added to the evidence of each frame, log-odds. Below zero the verifier
        /// is stricter.
        pub bias: f64 = 0.0,
        /// Fit of a model; only `tagalong train` reads it.
        pub training: Training,
    }
}

settings! {
    /// Fit of a model.
    pub struct Training {
        /// Numbers of trees that are tried; each is one row of the card.
        pub trees: Vec<usize> = vec![100, 200, 400, 800],
        /// Each tree goes this part of its way.
        pub rate: f64 = 0.1,
        /// Part of the features among which each tree chooses, at random.
        pub features: f64 = 0.25,
        /// Where a tree has few examples its values shrink: as if it had so many
        /// more, undecided.
        pub caution: f64 = 5.0,
        /// Share of the weight of candidates without depth, photographs.
        pub without_depth: f64 = 0.1,
        /// Parts into which the groups are divided, each held out once.
        pub folds: usize = 4,
    }
}
