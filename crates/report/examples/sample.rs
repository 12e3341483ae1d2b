//! Writes a sample report, with JSON and CSV beside it, from invented results:
//!
//! ```text
//! cargo run -p tagalong-report --example sample -- target/sample-report
//! ```

#[path = "../tests/common/mod.rs"]
mod common;

use std::error::Error;
use std::path::PathBuf;

use tagalong_report::Outcome;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).map(PathBuf::from).ok_or("usage: sample FOLDER")?;
    let pipelines = ["sample-a", "sample-b", "sample-c with a longer name"];
    let logs = ["made-up corridor", "made-up hall", "made-up office", "made-up crossing"];
    let mut benchmark = common::benchmark(&pipelines, &logs);
    let why =
        "made-up failure: plugin `sample` panicked in frame 212:\n  index out of bounds".into();
    common::spoil(&mut benchmark, Outcome::Failed { why });
    let timings = common::timings(&benchmark);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("report.html"), tagalong_report::html(&benchmark, Some(&timings)))?;
    std::fs::write(folder.join("report.json"), tagalong_report::json(&benchmark)?)?;
    std::fs::write(folder.join("report.csv"), tagalong_report::csv(&benchmark))?;
    Ok(())
}
