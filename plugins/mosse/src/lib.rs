//! `mosse`: follows a known person by a correlation filter (D. Bolme, J. Beveridge, B. Draper and
//! Y. Lui, *Visual object tracking using adaptive correlation filters*, CVPR 2010).
//!
//! The window around a person, two upper-body squares wide, is sampled at a fixed number of cells
//! ([`Patch`]). The filter ([`Filter`]) is the one whose correlation with all windows of the person
//! so far is nearest, in the mean square, to a narrow peak in the middle. In the Fourier domain it
//! is a quotient of two running means, so that learning and searching a window cost one transform
//! each. Where the correlation with a new window peaks, the person is; the height of the peak above
//! the sidelobes ([`Peak`]) is the confidence.
//!
//! The size of the window is that of the expected box, which is projected from the position of the
//! track; depth drops places that show something at another distance.

mod config;
mod detect;
mod filter;
mod fourier;
mod patch;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use detect::Mosse;
pub use filter::{Filter, Peak};
pub use fourier::Fourier;
pub use patch::{Patch, SIDE};
use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "mosse";

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.detector(
        NAME,
        "follows known people by a correlation filter in the Fourier domain",
        |config: Config, _| Mosse::new(config),
    );
}
