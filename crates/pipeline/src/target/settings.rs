use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Who is followed, when it is doubted that it is still the same person, and what
/// is done when the person is lost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TargetSettings {
    /// Follow the track with this number; the nearest one in front if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track: Option<u32>,
    /// In front is up to this bearing to either side, degrees ...
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub choose_within_deg: f64,
    /// ... and up to this distance, m, ...
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub choose_within_m: f64,
    /// ... once there has been somebody for this long, s: who is nearest is not
    /// always seen first.
    #[schemars(range(min = 0.0))]
    pub choose_after_s: f64,
    /// Remember what the person looks like, doubt a track that looks like
    /// somebody else, and know the person again. Without it a track is followed
    /// while it lives, and nobody after that.
    pub remember: bool,
    /// The person is known well after so many sightings.
    #[schemars(range(min = 1))]
    pub training_sightings: u32,
    /// Weight of a sighting in the belief that it is the same person, 0 to 1.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub belief_weight: f64,
    /// Below this probability it is doubted that it is the same person: slower.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub doubt_below: f64,
    /// Below this probability it is somebody else: lost.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub refuse_below: f64,
    /// Out of sight for longer than this, s, it is doubted who comes back.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub doubt_after_s: f64,
    /// Out of sight for longer than this, s, the person is lost.
    pub lose_after_s: f64,
    /// Somebody is known again from this probability on, sightings added up, ...
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub again_from: f64,
    /// ... in so many sightings in a row.
    #[schemars(range(min = 1))]
    pub again_sightings: u32,
    /// Nobody gets farther than at this speed from where they were seen last, m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reach_mps: f64,
    /// Somebody nearer to the person than this may be taken for them, m: looks are
    /// compared, and nothing is learned.
    #[schemars(range(min = 0.0))]
    pub alone_m: f64,
    /// What differences in looks say.
    pub looks: LooksSettings,
    /// Looking for a person who is lost.
    pub search: SearchSettings,
}

impl Default for TargetSettings {
    fn default() -> Self {
        Self {
            track: None,
            choose_within_deg: 45.0,
            choose_within_m: 5.0,
            choose_after_s: 0.0,
            remember: true,
            training_sightings: 15,
            belief_weight: 0.25,
            doubt_below: 0.4,
            refuse_below: 0.15,
            doubt_after_s: 0.5,
            lose_after_s: 2.0,
            again_from: 0.85,
            again_sightings: 5,
            reach_mps: 2.0,
            alone_m: 0.8,
            looks: LooksSettings::default(),
            search: SearchSettings::default(),
        }
    }
}

/// The log-odds that two sightings are of one person: for each kind of
/// difference its weight times how far it is below what is even, summed up.
/// Hellinger distances lie between 0, the same, and 1. The numbers are what
/// `tagalong follow configs/follow-best.toml --split train --seeds 4 --fit` prints, a
/// logistic regression over 60 rides; every `tagalong follow` prints how far the
/// probabilities can be believed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LooksSettings {
    /// Colours of the upper body: the Hellinger distance that says nothing, and
    /// the weight of one below it.
    pub torso: [f64; 2],
    /// Colours of the legs, likewise.
    pub legs: [f64; 2],
    /// Directions of edges on the upper body, likewise.
    pub texture: [f64; 2],
    /// Height of the head: the difference that says nothing, m, and the weight of
    /// one metre.
    pub height: [f64; 2],
    /// Weight of being nearer to the person's looks than to those of others who
    /// were seen beside them.
    #[schemars(range(min = 0.0))]
    pub rivals: f64,
}

impl Default for LooksSettings {
    fn default() -> Self {
        Self {
            torso: [0.166, 12.566],
            legs: [0.472, 4.394],
            texture: [0.267, 7.819],
            height: [-0.045, 7.009],
            rivals: 5.49,
        }
    }
}

/// What the robot does to find a person again. It asks for room all the time;
/// without it the robot stands still when the person is lost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SearchSettings {
    /// Turn towards where the person went, and drive to where they were last.
    pub enabled: bool,
    /// Waits for this long first: most people come back by themselves, s.
    #[schemars(range(min = 0.0))]
    pub wait_s: f64,
    /// Turns at most this fast, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub turn_radps: f64,
    /// Drives at most this fast, m/s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed_mps: f64,
    /// As near as this to where the person was last is there, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub arrive_m: f64,
    /// Gives up driving there after this time, s.
    #[schemars(range(min = 0.0))]
    pub drive_s: f64,
    /// Gives up, stands still and watches after this time, s.
    #[schemars(range(min = 0.0))]
    pub give_up_s: f64,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self {
            enabled: false,
            wait_s: 1.0,
            turn_radps: 0.5,
            speed_mps: 0.4,
            arrive_m: 0.6,
            drive_s: 8.0,
            give_up_s: 20.0,
        }
    }
}
