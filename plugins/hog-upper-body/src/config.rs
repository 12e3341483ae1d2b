use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

use crate::{Coverage, Kind};

settings! {
    /// Settings of `hog-upper-body`.
    pub struct Config {
        /// Classifier of windows: `trees` on fine cells, or `linear` on normalised blocks.
        pub machine: Kind,
        /// Part of a person that windows show: `upper-body`, or `whole-body`, which `linear` does
        /// not support.
        pub coverage: Coverage,
        /// Model file, relative to the config; the file states its classifier and the part. Empty:
        /// the built-in model for the chosen ones.
        pub model: String,
        /// Least log-odds of a window; windows with less are dropped.
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
        /// Ratio of each window size to the one before.
        #[schemars(range(min = 1.02, max = 4.0))]
        pub scale_step: f64 = 1.15,
        /// With depth: largest factor between the size of a window and the size that its distance
        /// predicts, in either direction.
        #[schemars(range(min = 1.0, max = 1e3))]
        pub size_tolerance: f64 = 1.08,
        /// Nearest person, m.
        pub min_depth_m: f64 = 0.5,
        /// Farthest person, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_depth_m: f64 = 7.0,
        /// With depth: a square shows no head if most of the points above it are as far away as it
        /// is, within this tolerance, m; 0: not tested.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub above_m: f64 = 0.25,
        /// Lowest head centre above the floor, m.
        pub min_head_height_m: f64 = 0.8,
        /// Highest head centre above the floor, m.
        pub max_head_height_m: f64 = 2.1,
        /// Scans only windows that depth and geometry allow; false: all windows.
        pub depth_proposals: bool = true,
        /// With depth: adds the log-odds of the depth channel, if the model has one.
        pub depth_channel: bool = false,
        /// Overlap (IoU of the squares, or of whole bodies) above which two windows belong to one
        /// person, unless `apart_m` separates them.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub overlap: f64 = 0.4,
        /// Difference in depth above which overlapping windows belong to two people, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub apart_m: f64 = 0.4,
        /// Radius around the expected position in which a search near a track scans windows, by
        /// their centre, widths.
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
        /// examples in addition to those of photographs; false: rooms are used for the depth
        /// channel alone.
        pub rooms: bool = false,
        /// Linear: penalty of a training error on a window with a person.
        pub person_penalty: f64 = 0.02,
        /// Linear: penalty of a training error on a window without a person.
        pub other_penalty: f64 = 0.01,
        /// Linear: largest number of passes over all windows.
        pub epochs: usize = 40,
        /// Number of trees in the last round; each round has a quarter of the trees of the next.
        pub trees: usize = 1536,
        /// Number of values of a window that a tree chooses from, sampled anew for each tree.
        pub numbers: usize = 128,
        /// Number of random windows from each picture without people, at first.
        pub random_windows: usize = 10,
        /// Number of searches for false alarms in pictures without people.
        pub mining_rounds: usize = 3,
        /// Largest number of false alarms that are kept from one picture in one round.
        pub mined_per_picture: usize = 40,
        /// Largest number of false alarms that are kept in one round.
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
