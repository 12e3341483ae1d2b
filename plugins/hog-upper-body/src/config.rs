use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

use crate::{Coverage, Kind};

settings! {
    /// Settings of `hog-upper-body`.
    pub struct Config {
        /// Machine that classifies windows: `trees` on fine cells, or `linear` on normalised
        /// blocks.
        pub machine: Kind,
        /// Part of a person that windows show: `upper-body`, or `whole-body`, which machine
        /// `linear` does not know.
        pub coverage: Coverage,
        /// Model file, relative to the config; the file states its machine and the part.
        /// Empty: the built-in model of the chosen ones.
        pub model: String,
        /// Windows with lower log-odds are dropped.
        pub min_score: f64 = 0.0,
        /// Upper limit of the log-odds.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_score: f64 = 6.0,
        /// Smallest upper body in a search, pixels.
        #[schemars(range(min = 16.0, max = 1e5))]
        pub min_side_px: f64 = 40.0,
        /// Largest upper body, as a fraction of the shorter side of the image.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_side: f64 = 0.9,
        /// Ratio of each size to the one before.
        #[schemars(range(min = 1.02, max = 4.0))]
        pub scale_step: f64 = 1.15,
        /// With depth: factor by which a window may be larger or smaller than its distance
        /// predicts.
        #[schemars(range(min = 1.0, max = 1e3))]
        pub size_tolerance: f64 = 1.08,
        /// Range of distances of people, m.
        pub min_depth_m: f64 = 0.5,
        /// See `min_depth_m`.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_depth_m: f64 = 7.0,
        /// With depth: a square shows no head if most of the points above it are as far away as it
        /// is, to within this, m; 0: not tested.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub above_m: f64 = 0.25,
        /// Range of heights of a head's centre above the floor, m.
        pub min_head_height_m: f64 = 0.8,
        /// See `min_head_height_m`.
        pub max_head_height_m: f64 = 2.1,
        /// Scans only windows that depth and geometry allow; off: all windows.
        pub depth_proposals: bool = true,
        /// With depth: adds the log-odds of the depth channel, if the model has one.
        pub depth_channel: bool = false,
        /// Two windows that overlap by more (IoU of the squares, or of whole bodies) belong to one
        /// person ...
        #[schemars(range(min = 0.0, max = 1e6))]
        pub overlap: f64 = 0.4,
        /// ... unless they are farther apart than this in depth, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub apart_m: f64 = 0.4,
        /// A search near a track scans windows with their centre nearer than this to the expected
        /// one, widths.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub near: f64 = 0.5,
        /// Standard deviation of the position of a window, as a fraction of its side.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_place: f64 = 0.06,
        /// Standard deviation of a distance from the depth image, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_depth_m: f64 = 0.1,
        /// Standard deviation of a distance from the size of the window alone, as a fraction.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_distance: f64 = 0.2,
        /// Settings of the fit; only `tagalong train` reads them.
        pub training: Training,
    }
}

settings! {
    /// Settings of the fit of a model.
    pub struct Training {
        /// Trees: false alarms in annotated rooms and, for upper bodies, the people there are
        /// examples beside those of photographs; off: rooms teach the depth channel alone.
        pub rooms: bool = false,
        /// Linear: penalty of a training error, of windows with people ...
        pub person_penalty: f64 = 0.02,
        /// ... and of windows without.
        pub other_penalty: f64 = 0.01,
        /// Linear: most passes over all windows.
        pub epochs: usize = 40,
        /// Number of trees of the last round; each round has a quarter of the trees of the next.
        pub trees: usize = 1536,
        /// Number of values of a window that a tree chooses from, sampled anew for each tree.
        pub numbers: usize = 128,
        /// Number of random windows from each picture without people, at first.
        pub random_windows: usize = 10,
        /// Number of searches for false alarms in pictures without people.
        pub mining_rounds: usize = 3,
        /// Most false alarms that are kept of one picture in one round.
        pub mined_per_picture: usize = 40,
        /// Most false alarms that are kept of one round.
        pub mined_per_round: usize = 6000,
    }
}

impl Config {
    /// Refuses settings outside their ranges.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        if self.machine == Kind::Linear && self.coverage == Coverage::WholeBody {
            let why = "machine `linear` has windows of upper bodies only; take `trees`".into();
            return Err(Error::Settings { key: "coverage".into(), why });
        }
        Ok(())
    }
}
