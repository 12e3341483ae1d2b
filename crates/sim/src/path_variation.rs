//! Settings of paths that differ from seed to seed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Variation of the paths of a scene with its seed. No path is shared between splits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PathVariation {
    /// Maximum shift of the way-points of the first person in X and in Y, m; those within 1 m of
    /// furniture are not moved.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub path_jitter_m: f64,
    /// If true, about every second seed mirrors the scene from left to right.
    pub mirror: bool,
}

impl PathVariation {
    /// Returns true if paths do not vary.
    pub(crate) fn is_off(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the conditions on the settings, each with the message for a violation. A scene has
    /// sides if windows or cameras are on one of its walls.
    pub(crate) fn rules(&self, has_sides: bool) -> [(bool, &'static str); 1] {
        [(
            !(self.mirror && has_sides),
            "variation.mirror is not for scenes with light.day or webcams: windows and cameras \
             hang on one wall",
        )]
    }
}
