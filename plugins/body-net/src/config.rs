use tagalong_core::settings;

settings! {
    /// Settings of `body-net`.
    pub struct Config {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// Weight of this verifier's log-odds relative to the detector's score.
        pub weight: f64 = 1.0,
        /// Bound on the log-odds of one frame, in both directions: a single frame is never certain.
        pub limit: f64 = 6.0,
        /// Log-odds added to the evidence of each frame. Below zero the verifier is stricter.
        pub bias: f64 = 0.0,
        /// Uses depth, and gives no evidence without it; false for cameras without depth, with a
        /// model that was trained so.
        pub depth: bool = true,
        /// Settings of the fit; only `tagalong train` reads them.
        pub training: Training,
    }
}

settings! {
    /// Settings of the fit.
    pub struct Training {
        /// Number of passes over the candidates, each time with small random changes.
        pub epochs: u32 = 24,
        /// Peak learning rate (Adam).
        pub rate: f64 = 0.002,
        /// Weight decay, as a fraction of the learning rate.
        pub decay: f64 = 0.01,
        /// Candidates per step.
        pub batch: usize = 64,
        /// Number of parts into which the groups are divided; each is held out once.
        pub folds: usize = 2,
    }
}
