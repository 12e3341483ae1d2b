use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ramp::Ramp;

/// The room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RoomSettings {
    /// Length and width, m.
    #[schemars(inner(range(min = 1.0, max = 200.0)))]
    pub size_m: [f64; 2],
    /// Height, m.
    #[schemars(range(min = 2.0, max = 20.0))]
    pub height_m: f64,
    /// The walls have wallpaper; without it stereo finds nothing on them.
    pub wallpaper: bool,
    /// The floor.
    pub floor: Floor,
    /// Pieces of furniture of any kind at random places along the walls, off
    /// everybody's way.
    #[schemars(range(max = 500))]
    pub clutter: usize,
    /// The door at the far end stands open to a dark room.
    pub open_door: bool,
    /// A ramp across the room; without it the floor is level.
    pub ramp: Option<Ramp>,
}

impl RoomSettings {
    /// Returns the height of the floor at a place, m.
    pub fn floor_m(&self, at: &Point2<f64>) -> f64 {
        self.ramp.as_ref().map_or(0.0, |ramp| ramp.height_m(at.x))
    }
}

impl Default for RoomSettings {
    fn default() -> Self {
        Self {
            size_m: [9.0, 6.0],
            height_m: 2.8,
            wallpaper: false,
            floor: Floor::Planks,
            clutter: 0,
            open_door: false,
            ramp: None,
        }
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
