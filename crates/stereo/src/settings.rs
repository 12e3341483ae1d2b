use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Error, Result};

/// Method of stereo matching.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Method {
    /// Best match of a window: fast; holes where there is no texture.
    Block,
    /// Costs summed up along paths: smoother, with fewer holes.
    #[default]
    SemiGlobal,
}

/// Settings of the depth from a rectified stereo pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StereoSettings {
    /// Matching method: `block` (fast) or `semi-global` (smooth, fewer holes).
    pub method: Method,
    /// Maximum width at which pairs are matched, px; wider ones are reduced to it, and their depth
    /// is enlarged to their size.
    #[schemars(range(min = 16, max = 8192))]
    pub width: usize,
    /// Minimum depth, m. Half of it is twice the work.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min_depth_m: f64,
    /// Maximum depth, m.
    pub max_depth_m: f64,
    /// Maximum disparity, px at the reduced width; 0 derives it from `min_depth_m`.
    #[schemars(range(max = 255))]
    pub max_disparity: usize,
    /// Difference in brightness up to which it is taken for noise, of 255.
    pub noise: u8,
    /// Minimum distance of the second best match from the best, as a fraction of its cost, 0 to 1.
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 1))]
    pub uniqueness: f64,
    /// Maximum difference between the disparities of a point in the left and in the right image, px
    /// at the reduced width.
    pub left_right: u8,
    /// Minimum change of brightness across a textured pixel (half of Sobel's sum: twice the height
    /// of a step). Other pixels keep their disparity only if it is that of their textured
    /// neighbours in the row; 0 keeps them all.
    pub texture: u8,
    /// Minimum size of a patch, pixels; smaller ones are taken for errors.
    pub speckle_pixels: usize,
    /// Maximum difference between neighbouring disparities of one patch, px.
    #[schemars(range(min = 0.0))]
    pub speckle_step: f64,
    /// Maximum length of holes along a row that are filled, px at the reduced width, if their ends
    /// are of one patch; 0 leaves them open.
    pub fill_px: usize,
    /// Maximum length of such holes in baselines, if that is longer.
    #[schemars(range(min = 0.0))]
    pub fill_baselines: f64,
    /// Half the side of the window over which disparities are refined from the brightness itself,
    /// px at the reduced width; 0 leaves them.
    #[schemars(range(max = 16))]
    pub refine_px: usize,
    /// Block: side of the window, px; odd, at most 9.
    pub window: usize,
    /// Semi-global: penalty of a disparity that changes by one.
    pub small_penalty: u8,
    /// Semi-global: penalty of a greater change where the image is smooth ...
    #[schemars(range(max = 200))]
    pub large_penalty: u8,
    /// ... and where it has a strong edge.
    pub edge_penalty: u8,
    /// Vertical offset of the images above which a warning is given, px.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_vertical_px: f64,
    /// Number of threads; 0 takes one for each core. The result does not depend on it.
    #[schemars(range(max = 64))]
    pub threads: usize,
}

impl Default for StereoSettings {
    fn default() -> Self {
        Self {
            method: Method::SemiGlobal,
            width: 512,
            min_depth_m: 0.5,
            max_depth_m: 20.0,
            max_disparity: 0,
            noise: 3,
            uniqueness: 0.05,
            left_right: 1,
            texture: 12,
            speckle_pixels: 100,
            speckle_step: 2.0,
            fill_px: 8,
            fill_baselines: 1.0,
            refine_px: 2,
            window: 9,
            small_penalty: 6,
            large_penalty: 40,
            edge_penalty: 15,
            max_vertical_px: 1.0,
            threads: 0,
        }
    }
}

/// Maximum number of disparities.
pub const MAX_DISPARITIES: usize = 256;

impl StereoSettings {
    /// Returns the settings for at most so many threads, 1 at least.
    #[must_use]
    pub fn on_threads(&self, most: usize) -> Self {
        let own = if self.threads == 0 { most } else { self.threads };
        Self { threads: own.min(most).max(1), ..self.clone() }
    }

    /// Refuses settings that cannot work.
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
