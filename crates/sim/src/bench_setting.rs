//! Table of a scene that follows Follow-Bench.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

use crate::crowd::Walk;

/// Layout of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BenchSetting {
    /// A crowd on a circle; each person walks to the opposite point and back.
    #[default]
    Circular,
    /// People that walk back and forth in a corridor.
    Corridor,
    /// People that walk through a crossing of two corridors.
    Crossing,
    /// People that walk through a wide doorway, in the direction of the target.
    Doorway,
    /// Obstacles in a room, and people that walk between random points.
    Clutter,
}

settings! {
    /// Scene that follows Follow-Bench: it sets the room, the blocks, the people, and the start and
    /// the footprint of the robot. The first person is the target.
    pub struct FollowBench {
        /// Layout.
        pub setting: BenchSetting = BenchSetting::Circular,
        /// Number of people besides the target.
        #[schemars(range(max = 40))]
        pub people: usize = 10,
        /// Width of the corridor, the crossing or the doorway, m; that of the benchmark if left
        /// out.
        #[schemars(range(min = 2.0, max = 10.0))]
        pub width_m: Option<f64>,
        /// Number of obstacles of the clutter.
        #[schemars(range(max = 40))]
        pub obstacles: usize = 20,
        /// Walking model of all people.
        pub walk: Walk = Walk::Orca,
    }
}

impl FollowBench {
    /// Returns the conditions on the settings, each with the message for a violation. A scene is
    /// `is_empty` if it has neither people nor blocks of its own.
    pub(crate) fn rules(&self, is_empty: bool) -> [(bool, &'static str); 1] {
        [(
            is_empty,
            "follow_bench makes the people and the blocks: leave out [[people]], \
             [[blocks]], crowd and approach",
        )]
    }
}
