use std::path::PathBuf;

use crate::tuning::Objective;
use clap::Args;
use tagalong_app::format::TableFormat;

use crate::folder::FolderArgs;

/// Text of `--help` after the arguments.
pub const HELP: &str = "\
For each room the settings in `[tune]` of a config are chosen on the other rooms, and scored in this
one. The candidates are the same for all rooms, so each of them runs once on each log; results are
kept under a hash of everything they depend on, and running again computes only what is missing.

Examples:
  tagalong bench --leave-one-room-out benches/rooms.toml
  tagalong bench rooms benches/rooms.toml --configs configs/depth-ekf.toml --budget 60 --jobs 2
  tagalong bench rooms my-rooms.toml --logs-dir logs --objective MOTA --format json | jq .pipelines";

/// Arguments of `tagalong bench --leave-one-room-out`.
#[derive(Args, Clone, Debug)]
pub struct RoomsArgs {
    /// The rooms and their logs, a TOML file.
    #[arg(value_name = "ROOMS")]
    pub rooms: PathBuf,
    /// The pipelines, the last of which is the baseline of the others [default: every config in
    /// configs with a table `[tune]`, without a baseline].
    #[arg(long, num_args = 1.., value_name = "CONFIG")]
    pub configs: Vec<PathBuf>,
    /// Folder of the logs [default: the `folder` that the rooms name].
    #[arg(long, value_name = "DIR")]
    pub logs_dir: Option<PathBuf>,
    /// The objective: the mean of this figure over the rooms, weighted by their annotated people, is
    /// maximised.
    #[arg(long, value_enum, default_value_t = Objective::Hota)]
    pub objective: Objective,
    /// Maximum number of settings that are tried for a pipeline: all combinations if there are no
    /// more, otherwise a sample. Those of the config are also scored, but chosen only if they are
    /// among them; with 1 only those of the config are scored.
    #[arg(long, value_name = "N", default_value_t = 32,
          value_parser = clap::value_parser!(u16).range(1..=10_000))]
    pub budget: u16,
    /// Seed of the sample.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Samples, with this seed and those after it: the tables show the first one, and how far its
    /// figures are from those of the others. No effect if all combinations are tried.
    #[arg(long, value_name = "N", default_value_t = 3,
          value_parser = clap::value_parser!(u8).range(1..=100))]
    pub samples: u8,
    /// Number of runs in parallel; it does not affect the results.
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: u16,
    #[command(flatten)]
    pub folder: FolderArgs,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
}
