//! Kinds of furniture, and positions of the pieces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A piece of furniture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Furniture {
    /// Kind of furniture.
    pub kind: FurnitureKind,
    /// Position, m.
    pub at: [f64; 2],
    /// Heading of its front, degrees.
    #[serde(default)]
    pub heading_deg: f64,
}

/// Furniture, most of it with the silhouette of a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FurnitureKind {
    /// A stand with a coat and a hat.
    CoatStand,
    /// A chair with a jacket over its back.
    DrapedChair,
    /// A lamp with a shade at head height.
    FloorLamp,
    /// A tall plant in a pot.
    Plant,
    /// A round pillar up to the ceiling.
    Pillar,
    /// A sheet on a panel that shows a person.
    Poster,
    /// A cardboard cut-out of a person.
    CardboardFigure,
    /// A desk with a monitor.
    Desk,
    /// A shelf with books.
    Shelf,
    /// A chair.
    Chair,
    /// A round bin on a small table.
    BinOnTable,
    /// A wall of 2.4 m across its heading, with an open doorway in its middle.
    Doorway,
    /// A screen of 1.6 m x 1.7 m across its heading.
    Partition,
    /// A blanket over the back of a chair, down to the floor.
    Blanket,
    /// A flag that hangs from a pole.
    Flag,
    /// A door of frosted glass, which does not return projected dots.
    GlassDoor,
    /// A large mirror in a frame on the floor, which faces its heading.
    Mirror,
    /// A wall of clear glass across its heading, 2 m wide, with a metal frame.
    GlassWall,
}

impl FurnitureKind {
    /// Returns the name of the kind in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::CoatStand => "coat stand",
            Self::DrapedChair => "draped chair",
            Self::FloorLamp => "floor lamp",
            Self::Plant => "plant",
            Self::Pillar => "pillar",
            Self::Poster => "poster",
            Self::CardboardFigure => "cardboard figure",
            Self::Desk => "desk",
            Self::Shelf => "shelf",
            Self::Chair => "chair",
            Self::BinOnTable => "bin on a table",
            Self::Doorway => "doorway",
            Self::Partition => "partition",
            Self::Blanket => "blanket",
            Self::Flag => "flag",
            Self::GlassDoor => "glass door",
            Self::Mirror => "mirror",
            Self::GlassWall => "glass wall",
        }
    }
}
