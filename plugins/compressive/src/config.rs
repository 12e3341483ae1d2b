use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Error, Result};

/// Settings of `compressive`. Distances in the image are in widths of the box:
/// a pixel of the papers, whose boxes are some 64 pixels wide, is 0.016.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Numbers that describe a box.
    pub features: usize,
    /// Each of them is made of two rectangles to so many.
    pub most_rectangles: usize,
    /// Weight of the past when a model learns from a frame, 0 to 1.
    pub memory: f64,
    /// The same when another detector has found the person elsewhere.
    pub anchored_memory: f64,
    /// The least standard deviation of a number, grey values: a number that
    /// never changed so far must not decide alone.
    pub min_sigma: f64,
    /// How far from the expected place boxes are searched, widths.
    pub search_radius: f64,
    /// Distance of the boxes of the coarse search, widths.
    pub coarse_step: f64,
    /// The fine search goes so far around the best coarse box, widths, pixel by
    /// pixel as long as the boxes are small.
    pub fine_radius: f64,
    /// Boxes this near to the person teach what they look like, widths.
    pub positive_radius: f64,
    /// Boxes at least so far teach what they do not look like, widths, ...
    pub negative_from: f64,
    /// ... and at most so far.
    pub negative_to: f64,
    /// Number of these.
    pub negatives: usize,
    /// Drops boxes that do not show something at the person's distance.
    pub depth_filter: bool,
    /// What is nearer than this to the expected distance may be the person, m.
    pub depth_tolerance_m: f64,
    /// Whatever is nearer than the person by more than this hides them, m.
    pub hidden_by_m: f64,
    /// Takes the size of the box from the distance.
    pub scale_from_depth: bool,
    /// Most that the size of the box changes from frame to frame, as a fraction.
    pub max_scale_change: f64,
    /// Least confidence of a sighting: the mean log-ratio of a number.
    pub min_confidence: f64,
    /// Least confidence at which the model learns.
    pub learn_confidence: f64,
    /// By how much the best box must beat the best one that is half a width or
    /// more away from it.
    pub min_lead: f64,
    /// Score of a sure sighting, log-odds. Below 0, so that a track that no
    /// other detector supports loses its score and ends.
    pub score: f64,
    /// Standard deviation of the place of the box, widths.
    pub sigma_box: f64,
    /// Standard deviation of a distance from the depth image, m.
    pub sigma_depth_m: f64,
    /// As in the papers: learn in every frame, whoever is in the box.
    pub compat_always_learn: bool,
    /// As in the public code: the model starts at mean 0 and deviation 1 and
    /// meets its first frame with the same weight as any other.
    pub compat_blank_start: bool,
    /// As in the first paper: every box within the radius, pixel by pixel.
    pub compat_full_search: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            features: 50,
            most_rectangles: 4,
            memory: 0.85,
            anchored_memory: 0.5,
            min_sigma: 1.0,
            search_radius: 0.4,
            coarse_step: 0.0625,
            fine_radius: 0.07,
            positive_radius: 0.06,
            negative_from: 0.125,
            negative_to: 0.5,
            negatives: 50,
            depth_filter: true,
            depth_tolerance_m: 0.5,
            hidden_by_m: 0.3,
            scale_from_depth: true,
            max_scale_change: 0.08,
            min_confidence: 0.0,
            learn_confidence: 0.2,
            min_lead: 0.0,
            score: -0.2,
            sigma_box: 0.05,
            sigma_depth_m: 0.1,
            compat_always_learn: false,
            compat_blank_start: false,
            compat_full_search: false,
        }
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        let positive = [
            ("min_sigma", self.min_sigma),
            ("search_radius", self.search_radius),
            ("coarse_step", self.coarse_step),
            ("positive_radius", self.positive_radius),
            ("negative_from", self.negative_from),
            ("depth_tolerance_m", self.depth_tolerance_m),
            ("sigma_box", self.sigma_box),
            ("sigma_depth_m", self.sigma_depth_m),
        ];
        let wrong = |key: &str, must: &str| Err(Error::Settings(format!("`{key}` must {must}")));
        if let Some((key, _)) = positive.into_iter().find(|(_, v)| !(*v > 0.0 && *v <= 100.0)) {
            return wrong(key, "be positive");
        }
        let fractions = [
            ("memory", self.memory),
            ("anchored_memory", self.anchored_memory),
            ("max_scale_change", self.max_scale_change),
        ];
        if let Some((key, _)) = fractions.into_iter().find(|(_, v)| !(0.0..1.0).contains(v)) {
            return wrong(key, "lie between 0 and 1");
        }
        let finite = [self.hidden_by_m, self.min_confidence, self.learn_confidence, self.min_lead];
        match self {
            Self { features, .. } if !(1..=1000).contains(features) => {
                wrong("features", "lie between 1 and 1000")
            }
            Self { most_rectangles, .. } if !(2..=16).contains(most_rectangles) => {
                wrong("most_rectangles", "lie between 2 and 16")
            }
            Self { negatives, .. } if !(2..=1000).contains(negatives) => {
                wrong("negatives", "lie between 2 and 1000")
            }
            _ if self.search_radius / self.coarse_step > 100.0 => {
                wrong("coarse_step", "be at least a hundredth of `search_radius`")
            }
            _ if !(0.0..=1.0).contains(&self.fine_radius) => {
                wrong("fine_radius", "lie between 0 and 1")
            }
            _ if !(self.negative_to > self.negative_from && self.negative_to <= 10.0) => {
                wrong("negative_to", "be larger than `negative_from`, and at most 10")
            }
            _ if !finite.iter().all(|v| v.is_finite()) || !self.score.is_finite() => {
                wrong("hidden_by_m, min_confidence, learn_confidence, min_lead, score", "be finite")
            }
            _ => Ok(()),
        }
    }
}
