//! `hog-upper-body`: finds upper bodies by histograms of oriented gradients and a linear support
//! vector machine (P2, section III-B; N. Dalal and B. Triggs, *Histograms of oriented gradients for
//! human detection*, CVPR 2005) or, with fewer errors, by boosted trees over finer cells.
//!
//! The image is scanned at several scales. At each scale, the features are computed once: cells of
//! 8x8 pixels and normalised blocks of them ([`Blocks`]), or cells of 4x4 pixels ([`Channels`]).
//! The score of a window is then a dot product of 7x7 blocks with the weights of a [`Model`], or
//! the sum of its trees over 16x16 cells, both read in place.
//!
//! With depth, a window is scanned only if a person at the distance of its centre would be as large
//! as the window, and would have the head at a plausible height. Without depth, all windows are
//! scanned.
//!
//! With the feature `train` the plugin also offers a trainer (`train`).

mod channels;
mod config;
mod coverage;
mod depth_channel;
mod detect;
mod gradients;
mod hog;
mod judge;
mod lattice;
mod model;
mod resample;
mod scan;
mod spans;
#[cfg(test)]
mod tests;
#[cfg(feature = "train")]
pub mod train;
mod trees;

pub use channels::Channels;
pub use config::{Config, Training};
pub use coverage::{Coverage, window_of};
pub use depth_channel::DepthTrees;
pub use detect::HogUpperBody;
pub use hog::Blocks;
pub use model::{Field, Kind, Layout, Machine, Model, NUMBERS};
pub use resample::resampled;
pub use scan::{Grid, Scanner, Wanted, Window, merge, window_numbers};
pub use spans::Spans;
use tagalong_config::{Registry, Remedy};
pub use trees::{ROUND, Tree, Trees};

/// Name of this plugin in configs.
pub const NAME: &str = "hog-upper-body";

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[
    Remedy {
        test: "window: size and depth",
        settings: &["size_tolerance"],
        look: "is the depth scaled right, and registered?",
    },
    Remedy {
        test: "window: goes on above",
        settings: &["above_m"],
        look: "raised arms; a wall right behind the head",
    },
    Remedy {
        test: "window: head height",
        settings: &["min_head_height_m", "max_head_height_m"],
        look: "is the camera's height and tilt right?",
    },
    Remedy {
        test: "window: gradients",
        settings: &["min_score"],
        look: "nearly all windows of any image; people who bend, sit sideways, or wear bags",
    },
];

/// Registers the plugin, and its trainer if that is compiled in.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.detector(
        NAME,
        "heads and shoulders by gradients, with boosted trees or a linear machine",
        HogUpperBody::new,
    );
    #[cfg(feature = "train")]
    registry.training(
        NAME,
        tagalong_config::TrainingOffer::new(
            tagalong_config::TrainingData::Windows,
            "[training]\nmining_rounds = 1\nepochs = 10",
        ),
    );
    #[cfg(feature = "train")]
    registry.trainer(NAME, |config: Config, context| {
        let layout = Layout { kind: config.machine, coverage: config.coverage };
        train::HogTrainer::new(layout, config.training, context.seed)
    });
}
