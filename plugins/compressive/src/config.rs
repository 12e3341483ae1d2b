use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

use crate::learning::Learning;

settings! {
    /// Settings of `compressive`. Distances in the image are in widths of the box:
    /// a pixel of a box that is 64 pixels wide is 0.016.
    pub struct Config {
        /// Numbers that describe a box.
        #[schemars(range(min = 1, max = 1000))]
        pub features: usize = 50,
        /// Each of them is made of two rectangles to so many.
        #[schemars(range(min = 2, max = 16))]
        pub most_rectangles: usize = 4,
        /// Weight of the past when a model learns from a frame, 0 to 1.
        #[schemars(range(min = 0.0, max = 0.999))]
        pub memory: f64 = 0.85,
        /// The same when another detector has found the person elsewhere.
        #[schemars(range(min = 0.0, max = 0.999))]
        pub anchored_memory: f64 = 0.5,
        /// The least standard deviation of a number, grey values: a number that
        /// never changed so far must not decide alone.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub min_sigma: f64 = 1.0,
        /// Largest distance of searched boxes from the expected place, widths.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub search_radius: f64 = 0.4,
        /// Distance of the boxes of the coarse search, widths.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub coarse_step: f64 = 0.0625,
        /// The fine search goes so far around the best coarse box, widths, pixel by
        /// pixel as long as the boxes are small.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub fine_radius: f64 = 0.07,
        /// Boxes this near to the person are positive examples, widths.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub positive_radius: f64 = 0.06,
        /// Boxes at least so far are negative examples, widths, ...
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub negative_from: f64 = 0.125,
        /// ... and at most so far.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub negative_to: f64 = 0.5,
        /// Number of these.
        #[schemars(range(min = 2, max = 1000))]
        pub negatives: usize = 50,
        /// Drops boxes that do not show something at the person's distance.
        pub depth_filter: bool = true,
        /// Readings that differ by less than this from the expected distance may be of the person,
        /// m.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub depth_tolerance_m: f64 = 0.5,
        /// Readings nearer than the person by more than this are of an occluder, m.
        pub hidden_by_m: f64 = 0.3,
        /// Takes the size of the box from the distance.
        pub scale_from_depth: bool = true,
        /// Most that the size of the box changes from frame to frame, as a fraction.
        #[schemars(range(min = 0.0, max = 0.999))]
        pub max_scale_change: f64 = 0.08,
        /// Least confidence of a sighting: the mean log-ratio of a number.
        pub min_confidence: f64 = 0.0,
        /// Least confidence at which the model learns.
        pub learn_confidence: f64 = 0.2,
        /// By how much the best box must beat the best one that is half a width or
        /// more away from it.
        pub min_lead: f64 = 0.0,
        /// Score of a sure sighting, log-odds. Below 0, so that a track that no
        /// other detector supports loses its score and ends.
        pub score: f64 = -0.2,
        /// Standard deviation of the place of the box, widths.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub sigma_box: f64 = 0.05,
        /// Standard deviation of a distance from the depth image, m.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub sigma_depth_m: f64 = 0.1,
        /// Every box within the radius is compared, pixel by pixel: slow.
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
