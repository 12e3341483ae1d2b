use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

/// Method of stereo matching.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Method {
    /// Best match of a window: fast, with holes where there is no texture.
    Block,
    /// Costs that are summed up along paths: smoother, with fewer holes.
    #[default]
    SemiGlobal,
}

settings! {
    /// Settings of the depth from a rectified stereo pair.
    pub struct StereoSettings {
        /// Matching method: `block` (fast) or `semi-global` (smooth, fewer holes).
        pub method: Method = Method::SemiGlobal,
        /// Maximum width at which pairs are matched, px; wider images are downscaled to it, and
        /// their depth is enlarged to the original size.
        #[schemars(range(min = 16, max = 8192))]
        pub width: usize = 512,
        /// Minimum depth, m. Half the value takes twice the work.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub min_depth_m: f64 = 0.5,
        /// Maximum depth, m.
        pub max_depth_m: f64 = 20.0,
        /// Maximum disparity, px at the reduced width; 0 derives it from `min_depth_m`.
        #[schemars(range(max = 255))]
        pub max_disparity: usize = 0,
        /// Difference in brightness up to which two pixels count as equal, of 255.
        pub noise: u8 = 3,
        /// Minimum difference between the costs of the second best match and the best, as a
        /// fraction of the former, 0 to 1.
        #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 1))]
        pub uniqueness: f64 = 0.05,
        /// Maximum difference between the disparities of a point in the left and in the right
        /// image, px at the reduced width.
        pub left_right: u8 = 1,
        /// Minimum change of brightness across a textured pixel (half of Sobel's sum: twice the
        /// height of a step). Other pixels only keep their disparity if it equals that of their
        /// textured neighbours in the row; 0 keeps them all.
        pub texture: u8 = 12,
        /// Minimum size of a patch, pixels; smaller ones are dropped.
        pub speckle_pixels: usize = 100,
        /// Maximum difference between neighbouring disparities of one patch, px.
        #[schemars(range(min = 0.0))]
        pub speckle_step: f64 = 2.0,
        /// Maximum length along a row of holes that are filled, px at the reduced width, if both
        /// ends belong to the same patch; 0 fills none.
        pub fill_px: usize = 8,
        /// The same in baselines, if that is longer.
        #[schemars(range(min = 0.0))]
        pub fill_baselines: f64 = 1.0,
        /// Half the side of the window over which disparities are refined from the brightness
        /// itself, px at the reduced width; 0: no refinement.
        #[schemars(range(max = 16))]
        pub refine_px: usize = 2,
        /// Block: side of the window, px; odd, at most 9.
        pub window: usize = 9,
        /// Semi-global: penalty of a disparity that changes by one.
        pub small_penalty: u8 = 6,
        /// Semi-global: penalty of a larger change where the image is smooth.
        #[schemars(range(max = 200))]
        pub large_penalty: u8 = 40,
        /// Semi-global: penalty of a larger change where the image has a strong edge.
        pub edge_penalty: u8 = 15,
        /// Vertical offset of the images above which a warning is given, px.
        #[schemars(extend("exclusiveMinimum" = 0))]
        pub max_vertical_px: f64 = 1.0,
        /// Number of threads; 0: one per core. The result does not depend on it.
        #[schemars(range(max = 64))]
        pub threads: usize = 0,
    }
}

/// Maximum number of disparities.
pub const MAX_DISPARITIES: usize = 256;

impl StereoSettings {
    /// Returns the settings with at most this number of threads, but at least 1.
    #[must_use]
    pub fn on_threads(&self, most: usize) -> Self {
        let own = if self.threads == 0 { most } else { self.threads };
        Self { threads: own.min(most).max(1), ..self.clone() }
    }

    /// Refuses invalid settings.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] names the key.
    pub fn check(&self) -> Result<()> {
        check_settings(self)?;
        let Self { min_depth_m, max_depth_m, window, .. } = self;
        let Self { small_penalty, edge_penalty, large_penalty, .. } = self;
        if max_depth_m <= min_depth_m {
            return Err(Error::setting("max_depth_m", "must be greater than `min_depth_m`"));
        }
        if ![3, 5, 7, 9].contains(window) {
            return Err(Error::setting("window", "must be 3, 5, 7 or 9"));
        }
        if edge_penalty < small_penalty || edge_penalty > large_penalty {
            let why = "must be at least `small_penalty` and at most `large_penalty`";
            return Err(Error::setting("edge_penalty", why));
        }
        Ok(())
    }
}
