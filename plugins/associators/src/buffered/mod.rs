//! `associate-buffered`: overlap of enlarged boxes, first slightly and then more (C-BIoU: Yang et
//! al., *Hard to Track Objects with Irregular Motions and Similar Appearances? Make It Easier by
//! Buffering the Matching Space*, WACV 2023).
//!
//! Between two frames far apart in time, or after a sudden turn, the boxes of one person may not
//! overlap. Boxes enlarged in proportion to their size do, so no appearance is needed.

mod associate;
mod config;

pub use associate::Buffered;
pub use config::{Config, Motion};
use tagalong_config::Registry;

/// Registers the associator `associate-buffered`.
pub fn register(registry: &mut Registry) {
    registry.associator(
        "associate-buffered",
        "overlap of enlarged boxes, a little first and then more (C-BIoU)",
        |config: Config, _| Buffered::new(config),
    );
}
