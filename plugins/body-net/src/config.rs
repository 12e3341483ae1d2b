use tagalong_core::settings;

settings! {
    /// Settings of `body-net`.
    pub struct Config {
        /// Model file, relative to the config; empty: the model that is built in.
        pub model: String,
        /// Weight of this verifier's log-odds beside the detector's score.
        pub weight: f64 = 1.0,
        /// Log-odds of one frame are limited to plus and minus this: one look is
        /// never beyond doubt.
        pub limit: f64 = 6.0,
        /// Added to the evidence of each frame, log-odds. Below zero the verifier is stricter.
        pub bias: f64 = 0.0,
        /// True to look at depth and say nothing without it; false for cameras that have none, with
        /// a model that was trained so.
        pub depth: bool = true,
        /// Fit of a model; only `tagalong train` reads it.
        pub training: Training,
    }
}

settings! {
    /// Fit of a model.
    pub struct Training {
        /// Number of passes over the candidates, each time a little changed.
        pub epochs: u32 = 24,
        /// Largest step of a weight.
        pub rate: f64 = 0.002,
        /// Weights shrink by this part of a step.
        pub decay: f64 = 0.01,
        /// Candidates a step.
        pub batch: usize = 64,
        /// Parts into which the groups are divided, each held out once.
        pub folds: usize = 2,
    }
}
