//! Every parser of foreign bytes under random mutations of small valid files: no coverage guides it,
//! so that it runs on stable Rust, is the same for a seed, and does some 100,000 files a second.
//!
//! A panic is a finding, and so is a file that takes longer than a second of the processor. The bytes of a finding are
//! written to a file; `tagalong-fuzz TARGET --file FILE` repeats it.

mod definitions;
mod live;
mod mutate;
mod targets;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Duration;

use cpu_time::ThreadTime;

pub use mutate::Mutator;
pub use targets::{Target, targets};

/// Time that no file of a few kilobytes may take.
const SLOW: Duration = Duration::from_secs(1);

/// Bytes at which a parser went wrong.
#[derive(Debug)]
pub struct Finding {
    /// The mutated file.
    pub bytes: Vec<u8>,
    /// Description of the panic, or of the time.
    pub why: String,
}

/// Result of a run on one target.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Number of files.
    pub files: u64,
    /// The longest time of one file.
    pub slowest: Duration,
    /// The first file at which the parser went wrong.
    pub finding: Option<Finding>,
}

/// Parses mutated files until one of them is a finding, at most so many.
pub fn run(target: &Target, files: u64, seed: u64, path: &Path, mut tick: impl FnMut()) -> Outcome {
    let mut mutator = Mutator::new(seed);
    let mut outcome = Outcome::default();
    while outcome.files < files && outcome.finding.is_none() {
        let bytes = mutator.mutated(&target.seeds);
        let (took, why) = tried(target, &bytes, path);
        outcome.slowest = outcome.slowest.max(took);
        outcome.finding = why.map(|why| Finding { bytes, why });
        outcome.files += 1;
        tick();
    }
    outcome
}

/// Parses one file; returns the time, and the fault if there is one.
pub fn tried(target: &Target, bytes: &[u8], path: &Path) -> (Duration, Option<String>) {
    // Of the processor, because a busy machine is no finding.
    let start = ThreadTime::now();
    let panic = catch_unwind(AssertUnwindSafe(|| (target.parse)(bytes, path))).err();
    let took = start.elapsed();
    let why = panic.map(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic");
        format!("panics: {text}")
    });
    (took, why.or_else(|| (took > SLOW).then(|| format!("takes {} s", took.as_secs_f64()))))
}
