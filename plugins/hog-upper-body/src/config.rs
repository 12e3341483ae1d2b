use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::Result;

use crate::Kind;

/// Settings of `hog-upper-body`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// What judges windows: `trees`, or `linear` as P2 has it.
    pub machine: Kind,
    /// Model file, relative to the config; it says by itself what machine it has.
    /// Empty: the model of that machine that is built in.
    pub model: String,
    /// Windows with lower log-odds are dropped.
    pub min_score: f64,
    /// Log-odds are limited to this.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub max_score: f64,
    /// Smallest upper body that is looked for, pixels.
    #[schemars(range(min = 16.0, max = 1e5))]
    pub min_side_px: f64,
    /// Largest, as a fraction of the shorter side of the image.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub max_side: f64,
    /// Each size is so many times the one before.
    #[schemars(range(min = 1.02, max = 4.0))]
    pub scale_step: f64,
    /// With depth: a window may be larger or smaller than the distance says by
    /// this factor.
    #[schemars(range(min = 1.0, max = 1e3))]
    pub size_tolerance: f64,
    /// Distances at which people are looked for, m.
    pub min_depth_m: f64,
    /// See `min_depth_m`.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub max_depth_m: f64,
    /// With depth: where most of what is above a square is as far away as what it shows,
    /// give or take this, it shows no head, m; 0: not asked.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub above_m: f64,
    /// Heights of a head's centre above the floor, m.
    pub min_head_height_m: f64,
    /// See `min_head_height_m`.
    pub max_head_height_m: f64,
    /// Looks at windows that depth and geometry allow only; off: at all.
    pub depth_proposals: bool,
    /// Two windows that overlap by more (IoU) are of one person ...
    #[schemars(range(min = 0.0, max = 1e6))]
    pub overlap: f64,
    /// ... unless they are farther apart than this in depth, m.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub apart_m: f64,
    /// A search near a track looks at windows whose centre is nearer than this
    /// to the expected one, widths.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub near: f64,
    /// Standard deviation of a window's place, as a fraction of its side.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_place: f64,
    /// Standard deviation of a distance from the depth image, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_depth_m: f64,
    /// Standard deviation of a distance that only the size tells, as a fraction.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_distance: f64,
    /// How a model is fitted; only `tagalong train` reads it.
    pub training: Training,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            machine: Kind::default(),
            model: String::new(),
            min_score: 0.0,
            max_score: 6.0,
            min_side_px: 40.0,
            max_side: 0.9,
            scale_step: 1.15,
            size_tolerance: 1.08,
            min_depth_m: 0.5,
            max_depth_m: 7.0,
            above_m: 0.25,
            min_head_height_m: 0.8,
            max_head_height_m: 2.1,
            depth_proposals: true,
            overlap: 0.4,
            apart_m: 0.4,
            near: 0.5,
            sigma_place: 0.06,
            sigma_depth_m: 0.1,
            sigma_distance: 0.2,
            training: Training::default(),
        }
    }
}

/// How a model is fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Training {
    /// Linear: penalty of a training error, of windows with people ...
    pub person_penalty: f64,
    /// ... and of others.
    pub other_penalty: f64,
    /// Linear: passes over all windows at most.
    pub epochs: usize,
    /// Trees of the last round; each round before has a quarter of those of the
    /// next.
    pub trees: usize,
    /// Numbers of a window that a tree chooses from, drawn anew for each.
    pub numbers: usize,
    /// Windows by chance from each picture without anybody, at first.
    pub random_windows: usize,
    /// How often pictures without anybody are searched for false alarms.
    pub mining_rounds: usize,
    /// False alarms that are kept of a picture and round at most.
    pub mined_per_picture: usize,
    /// False alarms that are kept of a round at most.
    pub mined_per_round: usize,
}

impl Default for Training {
    fn default() -> Self {
        Self {
            person_penalty: 0.02,
            other_penalty: 0.01,
            epochs: 40,
            trees: 1536,
            numbers: 128,
            random_windows: 10,
            mining_rounds: 3,
            mined_per_picture: 40,
            mined_per_round: 6000,
        }
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)
    }
}
