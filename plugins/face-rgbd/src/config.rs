use tagalong_config::check_settings;
use tagalong_core::{Result, settings};

settings! {
    /// Settings of `face-rgbd`.
    pub struct Config {
        /// Cascade in OpenCV's XML format, relative to the config; empty: the built-in one.
        /// Training continues from it; empty: training starts anew.
        pub model: String,
        /// Least log-odds of a face; faces with less are dropped.
        pub min_score: f64 = 0.0,
        /// Upper limit of the log-odds.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_score: f64 = 6.0,
        /// Number of grouped windows that a face must exceed (OpenCV's `minNeighbors`).
        pub min_neighbours: usize = 2,
        /// Narrowest window of a search, pixels.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub min_side_px: f64 = 24.0,
        /// Widest window, as a fraction of the shorter side of the image.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_side: f64 = 0.9,
        /// Ratio of each window size to the one before.
        #[schemars(range(min = 1.02, max = 4.0))]
        pub scale_step: f64 = 1.05,
        /// Searches only where depth and geometry allow a face; false: everywhere.
        pub depth_proposals: bool = true,
        /// With depth: narrowest window, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub min_face_m: f64 = 0.10,
        /// With depth: widest window, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_face_m: f64 = 0.19,
        /// Nearest face, m.
        pub min_depth_m: f64 = 0.5,
        /// Farthest face, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_depth_m: f64 = 6.0,
        /// Lowest face above the floor, m.
        pub min_height_m: f64 = 0.8,
        /// Highest face above the floor, m.
        pub max_height_m: f64 = 2.1,
        /// Largest number of sampling points (one in 8 x 8 pixels) that are searched; regions with
        /// much skin colour come first.
        pub max_points: usize = 5000,
        /// Width of the window of a face, m; it gives the distance where there is no depth.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub face_m: f64 = 0.135,
        /// Distance of the centre of the head above that of the window, as a fraction of the
        /// window's side.
        pub head_above: f64 = 0.1,
        /// Standard deviation of the position of a window, as a fraction of its side.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_place: f64 = 0.15,
        /// Standard deviation of a distance from the depth image, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_depth_m: f64 = 0.1,
        /// Standard deviation of a distance from the size of the window alone, as a fraction.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_distance: f64 = 0.2,
        /// Settings of the training; only `tagalong train cascade` reads them.
        pub training: Training,
    }
}

settings! {
    /// Settings of the training of a cascade: Gentle AdaBoost, stage by stage.
    pub struct Training {
        /// Side of a window, pixels.
        pub side: usize = 20,
        /// Largest angle by which copies of the faces are rotated, rad.
        pub tilt: f64 = 0.15,
        /// Largest number of stages.
        pub stages: usize = 12,
        /// Least share of the faces that every stage has to pass.
        pub min_hit_rate: f64 = 0.995,
        /// Largest share of the other windows that a stage may pass.
        pub max_false_alarm: f64 = 0.4,
        /// Largest number of trees in a stage.
        pub max_trees: usize = 100,
        /// Number of decisions from the root of a tree to a leaf.
        pub depth: usize = 2,
        /// Number of features that a stage chooses from, sampled anew for each stage.
        pub features: usize = 2500,
        /// Number of other windows for the training of a stage; they pass all stages before it.
        pub others: usize = 5000,
        /// Least number of other windows for a further stage; with fewer it would overfit, so
        /// training ends.
        pub fewest_others: usize = 300,
        /// Tenths of the pictures, 2 to 9, for calibration and validation; 0 and 1 are held out,
        /// and the others are used for training.
        pub calibration: Vec<u64> = vec![2],
    }
}

impl Config {
    /// Refuses settings outside their ranges.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)
    }
}

impl Training {
    /// Refuses settings outside their ranges.
    #[cfg(feature = "train")]
    pub(crate) fn check(&self) -> Result<()> {
        fn is_part(v: f64) -> bool {
            v > 0.0 && v < 1.0
        }

        let counts = [self.stages, self.max_trees, self.depth, self.features, self.others];
        let fine = is_part(self.min_hit_rate)
            && is_part(self.max_false_alarm)
            && (12..=64).contains(&self.side)
            && (0.0..1.0).contains(&self.tilt)
            && counts.iter().all(|count| *count > 0)
            && self.depth <= 4
            && self.calibration.iter().all(|tenth| (2..10).contains(tenth));
        let why = "rates and `tilt` lie between 0 and 1, `side` between 12 and 64, `depth` is at \
                   most 4, `calibration` has numbers from 2 to 9, and counts are positive";
        if fine { Ok(()) } else { Err(tagalong_core::Error::Other(format!("`training`: {why}"))) }
    }
}
