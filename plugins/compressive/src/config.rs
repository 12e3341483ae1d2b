use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

use crate::learning::Learning;

settings! {
    /// Settings of `compressive`. Distances in the image are in widths of the box: one pixel of a
    /// box that is 64 pixels wide is 0.016.
    pub struct Config {
        /// Number of features that describe a box.
        #[schemars(range(min = 1, max = 1000))]
        pub features: usize = 50,
        /// Largest number of rectangles in a feature; the smallest is two.
        #[schemars(range(min = 2, max = 16))]
        pub most_rectangles: usize = 4,
        /// Weight of the past when a model is updated with a frame, 0 to 1.
        #[schemars(range(min = 0.0, max = 0.999))]
        pub memory: f64 = 0.85,
        /// The same when another detector has found the person elsewhere.
        #[schemars(range(min = 0.0, max = 0.999))]
        pub anchored_memory: f64 = 0.5,
        /// Least standard deviation of a feature, grey values: a feature that has never changed
        /// must not decide alone.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub min_sigma: f64 = 1.0,
        /// Largest distance of searched boxes from the expected position, widths.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub search_radius: f64 = 0.4,
        /// Spacing of the boxes in the coarse search, widths.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub coarse_step: f64 = 0.0625,
        /// Radius of the fine search around the best coarse box, widths; pixel by pixel while the
        /// boxes are small.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub fine_radius: f64 = 0.07,
        /// Largest distance of positive examples from the person, widths.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub positive_radius: f64 = 0.06,
        /// Least distance of negative examples from the person, widths.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub negative_from: f64 = 0.125,
        /// Largest distance of negative examples from the person, widths.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub negative_to: f64 = 0.5,
        /// Number of negative examples.
        #[schemars(range(min = 2, max = 1000))]
        pub negatives: usize = 50,
        /// Drops boxes whose depth does not match the person's distance.
        pub depth_filter: bool = true,
        /// Largest difference from the expected distance of readings that may belong to the person,
        /// m.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub depth_tolerance_m: f64 = 0.5,
        /// Readings nearer than the person by more than this belong to an occluder, m.
        pub hidden_by_m: f64 = 0.3,
        /// Computes the size of the box from the distance.
        pub scale_from_depth: bool = true,
        /// Largest change of the size of the box from frame to frame, as a fraction.
        #[schemars(range(min = 0.0, max = 0.999))]
        pub max_scale_change: f64 = 0.08,
        /// Least confidence of a detection: the mean log-ratio over the features.
        pub min_confidence: f64 = 0.0,
        /// Least confidence at which the model is updated.
        pub learn_confidence: f64 = 0.2,
        /// Least lead of the best box over the best one at least half a width away from it.
        pub min_lead: f64 = 0.0,
        /// Score of a confident detection, log-odds. Below 0, so that a track that no other
        /// detector supports loses its score and ends.
        pub score: f64 = -0.2,
        /// Standard deviation of the position of the box, widths.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub sigma_box: f64 = 0.05,
        /// Standard deviation of a distance from the depth image, m.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub sigma_depth_m: f64 = 0.1,
        /// Compares every box within the radius, pixel by pixel: slow.
        pub full_search: bool = false,
        /// Rule of learning: of a program, not of a file.
        #[serde(skip)]
        pub learning: Learning,
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        // A finer grid than a hundredth of the radius is thousands of boxes a person.
        let least = 0.01 * self.search_radius;
        if self.coarse_step < least {
            let why = format!("must be at least {least}, a hundredth of `search_radius`");
            return Err(Error::setting("coarse_step", why));
        }
        if self.negative_to < self.negative_from {
            let why = format!("must be at least {}, as `negative_from`", self.negative_from);
            return Err(Error::setting("negative_to", why));
        }
        Ok(())
    }
}
