use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{ANY, NOT_NEGATIVE, POSITIVE, Result, check_ranges};

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
    pub max_score: f64,
    /// Smallest upper body that is looked for, pixels.
    pub min_side_px: f64,
    /// Largest, as a fraction of the shorter side of the image.
    pub max_side: f64,
    /// Each size is so many times the one before.
    pub scale_step: f64,
    /// With depth: a window may be larger or smaller than the distance says by
    /// this factor.
    pub size_tolerance: f64,
    /// Distances at which people are looked for, m.
    pub min_depth_m: f64,
    /// See `min_depth_m`.
    pub max_depth_m: f64,
    /// With depth: where most of what is above a square is as far away as what it shows,
    /// give or take this, it shows no head, m; 0: not asked.
    pub above_m: f64,
    /// Heights of a head's centre above the floor, m.
    pub min_head_height_m: f64,
    /// See `min_head_height_m`.
    pub max_head_height_m: f64,
    /// Looks at windows that depth and geometry allow only; off: at all.
    pub depth_proposals: bool,
    /// Two windows that overlap by more (IoU) are of one person ...
    pub overlap: f64,
    /// ... unless they are farther apart than this in depth, m.
    pub apart_m: f64,
    /// A search near a track looks at windows whose centre is nearer than this
    /// to the expected one, widths.
    pub near: f64,
    /// Standard deviation of a window's place, as a fraction of its side.
    pub sigma_place: f64,
    /// Standard deviation of a distance from the depth image, m.
    pub sigma_depth_m: f64,
    /// Standard deviation of a distance that only the size tells, as a fraction.
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
        check_ranges(&[
            ("min_score", self.min_score, ANY),
            ("max_score", self.max_score, POSITIVE),
            ("min_side_px", self.min_side_px, 16.0..=1e5),
            ("max_side", self.max_side, POSITIVE),
            ("scale_step", self.scale_step, 1.02..=4.0),
            ("size_tolerance", self.size_tolerance, 1.0..=1e3),
            ("min_depth_m", self.min_depth_m, ANY),
            ("max_depth_m", self.max_depth_m, POSITIVE),
            ("min_head_height_m", self.min_head_height_m, ANY),
            ("above_m", self.above_m, NOT_NEGATIVE),
            ("max_head_height_m", self.max_head_height_m, ANY),
            ("overlap", self.overlap, NOT_NEGATIVE),
            ("apart_m", self.apart_m, NOT_NEGATIVE),
            ("near", self.near, NOT_NEGATIVE),
            ("sigma_place", self.sigma_place, POSITIVE),
            ("sigma_depth_m", self.sigma_depth_m, POSITIVE),
            ("sigma_distance", self.sigma_distance, POSITIVE),
        ])
    }
}
