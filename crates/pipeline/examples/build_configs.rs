//! Builds the pipeline of each config file that is named on the command line, and prints the names
//! of its stages:
//!
//! ```text
//! cargo run -p tagalong-pipeline --features plugins --example build_configs -- configs/mono.toml
//! ```
#![allow(clippy::print_stdout, reason = "an example prints what it finds")]

use tagalong_pipeline::{BuildError, Pipeline};

fn main() -> Result<(), BuildError> {
    for path in std::env::args().skip(1) {
        let pipeline = Pipeline::from_toml_file(&path)?;
        println!("{path}: {}", pipeline.stage_names().join(", "));
    }
    Ok(())
}
