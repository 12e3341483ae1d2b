//! Table of a scene by the rules of Follow-Bench.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::crowd::Walk;

/// Layout of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BenchSetting {
    /// A crowd on a circle, each on the way to the opposite point and back.
    #[default]
    Circular,
    /// People on their way to and fro in a corridor.
    Corridor,
    /// People on their way through a crossing of two corridors.
    Crossing,
    /// People on their way through a wide doorway, in the direction of the target.
    Doorway,
    /// Obstacles in a room, and people on their way between random points.
    Clutter,
}

/// Scene by the rules of Follow-Bench: it sets the room, the blocks, the people, and the start and the
/// footprint of the robot. The first person is the target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FollowBench {
    /// Layout.
    pub setting: BenchSetting,
    /// Number of people besides the target.
    #[schemars(range(max = 40))]
    pub people: usize,
    /// Width of the corridor, the crossing or the doorway, m; that of the benchmark if left out.
    #[schemars(range(min = 2.0, max = 10.0))]
    pub width_m: Option<f64>,
    /// Number of obstacles of the clutter.
    #[schemars(range(max = 40))]
    pub obstacles: usize,
    /// Way of walking of all people.
    pub walk: Walk,
}

impl Default for FollowBench {
    fn default() -> Self {
        Self {
            setting: BenchSetting::Circular,
            people: 10,
            width_m: None,
            obstacles: 20,
            walk: Walk::Orca,
        }
    }
}

impl FollowBench {
    /// Returns the conditions on the settings, each with the message for a violation; a scene is
    /// empty if it has neither people nor blocks of its own.
    pub(crate) fn rules(&self, is_empty: bool) -> [(bool, &'static str); 1] {
        [(
            is_empty,
            "follow_bench makes the people and the blocks: leave out [[people]], \
             [[blocks]], crowd and approach",
        )]
    }
}
