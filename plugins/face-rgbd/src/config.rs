use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::Result;

/// Settings of `face-rgbd`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Cascade in OpenCV's XML, relative to the config; empty: the built-in one. Training continues
    /// from it; empty: begins anew.
    pub model: String,
    /// Faces with lower log-odds are dropped.
    pub min_score: f64,
    /// Upper limit of the log-odds.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub max_score: f64,
    /// A face is a group of more windows than this.
    pub min_neighbours: usize,
    /// Narrowest window in a search, pixels.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub min_side_px: f64,
    /// Widest window, as a fraction of the shorter side of the image.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub max_side: f64,
    /// Ratio of each size to the one before.
    #[schemars(range(min = 1.02, max = 4.0))]
    pub scale_step: f64,
    /// Searches only where depth and geometry allow a face; off: everywhere.
    pub depth_proposals: bool,
    /// With depth: least width of a window, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub min_face_m: f64,
    /// With depth: largest width of a window, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub max_face_m: f64,
    /// Range of distances of faces, m.
    pub min_depth_m: f64,
    /// See `min_depth_m`.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub max_depth_m: f64,
    /// Range of heights of faces above the floor, m.
    pub min_height_m: f64,
    /// See `min_height_m`.
    pub max_height_m: f64,
    /// Most sampling points (one in 8 x 8 pixels) that are searched; regions with much skin come
    /// first.
    pub max_points: usize,
    /// Width of the window of a face, m: gives the distance where there is no depth.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub face_m: f64,
    /// Distance of the centre of the head above that of the window, as a fraction of the window's
    /// side.
    pub head_above: f64,
    /// Standard deviation of the position of a window, as a fraction of its side.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_place: f64,
    /// Standard deviation of a distance from the depth image, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_depth_m: f64,
    /// Standard deviation of a distance from the size of the window alone, as a fraction.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_distance: f64,
    /// Settings of the training; only `tagalong train cascade` reads them.
    pub training: Training,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            model: String::new(),
            min_score: 0.0,
            max_score: 6.0,
            min_neighbours: 2,
            min_side_px: 24.0,
            max_side: 0.9,
            scale_step: 1.05,
            depth_proposals: true,
            min_face_m: 0.10,
            max_face_m: 0.19,
            min_depth_m: 0.5,
            max_depth_m: 6.0,
            min_height_m: 0.8,
            max_height_m: 2.1,
            max_points: 5000,
            face_m: 0.135,
            head_above: 0.1,
            sigma_place: 0.15,
            sigma_depth_m: 0.1,
            sigma_distance: 0.2,
            training: Training::default(),
        }
    }
}

/// Settings of the training of a cascade: Gentle AdaBoost, stage by stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Training {
    /// Side of a window, pixels.
    pub side: usize,
    /// Largest angle by which copies of the faces are turned, rad.
    pub tilt: f64,
    /// Most stages.
    pub stages: usize,
    /// Part of the faces that every stage has to pass.
    pub min_hit_rate: f64,
    /// Part of the other windows that a stage may pass.
    pub max_false_alarm: f64,
    /// Most trees of a stage.
    pub max_trees: usize,
    /// Number of questions from the root of a tree to a leaf.
    pub depth: usize,
    /// Number of features that a stage chooses from, sampled anew for each stage.
    pub features: usize,
    /// Number of other windows for the training of a stage; all stages before it pass them.
    pub others: usize,
    /// Fewest other windows for a further stage: it would learn fewer by heart, so training ends.
    pub fewest_others: usize,
    /// Tenths of the pictures, 2 to 9, for calibration and validation; 0 and 1 are held out, and
    /// the others are trained with.
    pub calibration: Vec<u64>,
}

impl Default for Training {
    fn default() -> Self {
        Self {
            side: 20,
            tilt: 0.15,
            stages: 12,
            min_hit_rate: 0.995,
            max_false_alarm: 0.4,
            max_trees: 100,
            depth: 2,
            features: 2500,
            others: 5000,
            fewest_others: 300,
            calibration: vec![2],
        }
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
