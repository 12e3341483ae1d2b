use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

use crate::ramp::Ramp;

settings! {
    /// The room.
    pub struct RoomSettings {
        /// Length and width, m.
        #[schemars(inner(range(min = 1.0, max = 200.0)))]
        pub size_m: [f64; 2] = [9.0, 6.0],
        /// Height, m.
        #[schemars(range(min = 2.0, max = 20.0))]
        pub height_m: f64 = 2.8,
        /// If true, the walls have wallpaper; otherwise stereo finds no texture on them.
        pub wallpaper: bool = false,
        /// Material of the floor.
        pub floor: Floor = Floor::Planks,
        /// Number of pieces of furniture of any kind at random positions along the walls, away from
        /// all paths.
        #[schemars(range(max = 500))]
        pub clutter: usize = 0,
        /// If true, the door at the far end is open to a dark room.
        pub open_door: bool = false,
        /// A ramp across the room; without it the floor is level.
        pub ramp: Option<Ramp>,
    }
}

impl RoomSettings {
    /// Returns the height of the floor at a position, m.
    pub fn floor_m(&self, at: &Point2<f64>) -> f64 {
        self.ramp.as_ref().map_or(0.0, |ramp| ramp.height_m(at.x))
    }
}

/// Material of the floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Floor {
    /// Boards.
    Planks,
    /// Tiles.
    Tiles,
    /// Carpet.
    Carpet,
}
