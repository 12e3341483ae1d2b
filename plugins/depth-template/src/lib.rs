//! Finds people in depth images by the silhouette of head and shoulders (P1 section 2.2, P4 section
//! II).
//!
//! The path of a pixel: is it at a height and depth where a head can be
//! ([`DepthTemplateConfig::min_head_height_m`]), is the scene farther away left, right and above of
//! it (P4's boundary points), is the object that it belongs to as wide as a head, is there a body
//! below; then, does the silhouette of one of three body directions fit ([`Matcher`])? The
//! remaining pixels are grouped into people.
//!
//! Why not the printed squared difference of depths against one background value? Because a wall
//! two metres behind a person then costs more than the person fits, and because a fixed threshold
//! means something else at every range. The README lists the differences, with the test behind
//! each.

mod bank;
mod body;
mod candidates;
mod config;
mod detector;
mod extension;
mod matching;
mod people;
mod scores;
mod view;
mod weigher;

pub use bank::{Bank, Direction, Pose, Template, TemplateRow};
pub use body::{Part, Relief, body_parts, render};
pub use config::{Cost, DepthTemplateConfig};
pub use detector::{DepthTemplate, background};
pub use extension::{FrameComparison, FrameLikelihood, SceneLikelihood, SilhouetteComparison};
pub use matching::{Match, Matcher};
pub use view::Working;
pub use weigher::{PlacedPerson, Span, Weigher, outside};

use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "depth-template";

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.detector(
        NAME,
        "head-and-shoulder silhouettes in depth images (P1, P3, P4)",
        |config: DepthTemplateConfig, _| DepthTemplate::new(config),
    );
}
