//! A detector without an image: people by their legs in a laser scan, in fifty lines (`legs.rs`),
//! and the `tagalong` command with it. A log that has scans and no images makes a frame of each
//! scan.
//!
//! ```text
//! cargo run --release -p tagalong-cli --example laser_legs -- \
//!     run crates/cli/examples/laser_legs/legs.toml LOG.mcap
//! ```

mod legs;

use std::process::ExitCode;

fn main() -> ExitCode {
    tagalong_cli::main_with(|registry| {
        tagalong_catalog::register(registry);
        let summary = "two segments of a scan that are as wide as legs";
        registry.detector("legs", summary, |legs: legs::Legs, _| Ok(legs));
    })
}
