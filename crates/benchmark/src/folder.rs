use std::path::PathBuf;

use clap::Args;

/// Folder of a benchmark.
#[derive(Args, Clone, Debug)]
pub struct FolderArgs {
    /// The folder of the benchmark: plan.jsonl, results, report.
    #[arg(short, long, value_name = "DIR", default_value = "bench")]
    pub output: PathBuf,
}
