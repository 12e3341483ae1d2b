use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How disparities are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The best match of a window: fast; holes where there is no texture.
    Block,
    /// Costs summed up along paths: smoother, with fewer holes.
    #[default]
    SemiGlobal,
}

/// From a rectified stereo pair to depth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StereoSettings {
    /// `block` (fast) or `semi-global` (smooth, fewer holes).
    pub method: Method,
    /// Pairs that are wider are reduced to this width, px, and their depth is
    /// brought back to their size.
    pub width: usize,
    /// Nearest depth that is looked for, m. Half of it is twice the work.
    pub min_depth_m: f64,
    /// Greatest depth that is given, m.
    pub max_depth_m: f64,
    /// Largest disparity that is looked for, px at the reduced width; 0 takes
    /// what `min_depth_m` asks for.
    pub max_disparity: usize,
    /// Differences in brightness up to this are taken for noise, of 255.
    pub noise: u8,
    /// Least distance of the second best match from the best, as a fraction of
    /// its cost, 0 to 1.
    pub uniqueness: f64,
    /// Largest difference between the disparities of a point in the left and
    /// in the right image, px at the reduced width.
    pub left_right: u8,
    /// Least change of brightness across a textured pixel (half of Sobel's sum: twice
    /// the height of a step). Others keep their disparity only between textured
    /// ones that have it, too; 0 keeps them all.
    pub texture: u8,
    /// Patches of fewer pixels than this are taken for errors.
    pub speckle_pixels: usize,
    /// Neighbours whose disparities differ by at most this are of one patch, px.
    pub speckle_step: f64,
    /// Holes of at most so many pixels along a row are filled, px at the reduced
    /// width, if their ends are of one patch; 0 leaves them.
    pub fill_px: usize,
    /// So are holes up to this wide, in distances of the two cameras.
    pub fill_baselines: f64,
    /// Half the side of the window over which disparities are refined from the
    /// brightness itself, px at the reduced width; 0 leaves them.
    pub refine_px: usize,
    /// Block: side of the window, px; odd, at most 9.
    pub window: usize,
    /// Semi-global: penalty of a disparity that changes by one.
    pub small_penalty: u8,
    /// Semi-global: penalty of a greater change where the image is smooth ...
    pub large_penalty: u8,
    /// ... and where it has a strong edge.
    pub edge_penalty: u8,
    /// Vertical offset of the images from which on a warning is given, px.
    pub max_vertical_px: f64,
    /// Threads; 0 takes one for each core. The result does not depend on it.
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

/// Most disparities that are looked for.
pub const MAX_DISPARITIES: usize = 256;

impl StereoSettings {
    /// What is wrong with the settings: the key, and what its value must be.
    pub fn mistake(&self) -> Option<(&'static str, String)> {
        let must = |right: bool, key, words: &str| (!right).then(|| (key, words.to_owned()));
        let near = self.min_depth_m;
        must((16..=8192).contains(&self.width), "width", "from 16 to 8192")
            .or_else(|| must(near.is_finite() && near > 0.0, "min_depth_m", "positive"))
            .or_else(|| must(self.max_depth_m > near, "max_depth_m", "greater than `min_depth_m`"))
            .or_else(|| must(self.max_disparity < MAX_DISPARITIES, "max_disparity", "below 256"))
            .or_else(|| {
                must((0.0..1.0).contains(&self.uniqueness), "uniqueness", "from 0 to below 1")
            })
            .or_else(|| must(self.speckle_step >= 0.0, "speckle_step", "at least 0"))
            .or_else(|| must(self.fill_baselines >= 0.0, "fill_baselines", "at least 0"))
            .or_else(|| must(self.refine_px <= 16, "refine_px", "at most 16"))
            .or_else(|| {
                let odd = self.window % 2 == 1 && (3..=9).contains(&self.window);
                must(odd, "window", "3, 5, 7 or 9")
            })
            .or_else(|| {
                let rising = self.small_penalty <= self.edge_penalty
                    && self.edge_penalty <= self.large_penalty;
                let words = "at least `small_penalty` and at most `large_penalty`";
                must(rising, "edge_penalty", words)
            })
            .or_else(|| must(self.large_penalty <= 200, "large_penalty", "at most 200"))
            .or_else(|| must(self.max_vertical_px > 0.0, "max_vertical_px", "positive"))
            .or_else(|| must(self.threads <= 64, "threads", "at most 64"))
    }
}
