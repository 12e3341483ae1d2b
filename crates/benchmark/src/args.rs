use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Subcommand};
use tagalong_app::format::Format;

use super::folder::FolderArgs;
pub use super::rooms::RoomsArgs;

/// Arguments of `tagalong bench`.
#[derive(Args, Debug)]
#[command(args_conflicts_with_subcommands = true)]
pub struct BenchArgs {
    /// One step; without one, all three.
    #[command(subcommand)]
    pub(crate) step: Option<Step>,
    #[command(flatten)]
    pub(crate) plan: PlanArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
    #[command(flatten)]
    pub(crate) report: ReportArgs,
    #[command(flatten)]
    pub(crate) folder: FolderArgs,
}

/// Steps of a benchmark.
#[derive(Debug, Subcommand)]
pub enum Step {
    /// Lists the tasks, one JSON object per line
    #[command(after_help = "Example:\n  tagalong bench plan --logs-dir logs -o bench")]
    Plan {
        #[command(flatten)]
        plan: PlanArgs,
        #[command(flatten)]
        folder: FolderArgs,
    },
    /// Runs the planned tasks that have no result yet
    #[command(after_help = "Examples:\n  tagalong bench run -o bench --jobs 4\n  \
                            tagalong bench run -o bench --task 17\n  \
                            tagalong bench run -o bench --shard 3/64")]
    Run {
        #[command(flatten)]
        run: RunArgs,
        #[command(flatten)]
        folder: FolderArgs,
    },
    /// Makes report.html, report.json and report.csv from the results
    #[command(after_help = "Example:\n  tagalong bench report -o bench --baseline old.json \
                            --fail-if 'HOTA<-0.01' --fail-if 'IDSW>0'")]
    Report {
        #[command(flatten)]
        report: ReportArgs,
        #[command(flatten)]
        folder: FolderArgs,
    },
    /// Fits settings on all rooms but one, and scores them in that one
    #[command(long_flag = "leave-one-room-out", after_help = super::rooms::HELP)]
    Rooms(RoomsArgs),
    /// Writes the results as the folder tree that TrackEval scores
    #[command(after_help = "Example:\n  tagalong bench export -o bench --trackeval tree")]
    Export {
        /// Folder for the tree.
        #[arg(long, value_name = "DIR")]
        trackeval: PathBuf,
        #[command(flatten)]
        folder: FolderArgs,
    },
}

/// Compared pipelines and logs.
#[derive(Args, Clone, Debug, Default)]
pub struct PlanArgs {
    /// The pipelines [default: every config in configs that suits a log, or every built-in one].
    #[arg(long, num_args = 1.., value_name = "CONFIG")]
    pub configs: Vec<PathBuf>,
    /// The logs; the truth of NAME.mcap is in NAME.people.csv, NAME.truth.jsonl, NAME.boxes.csv,
    /// NAME.people-floor.csv, or in the log itself.
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Every log with truth in this folder.
    #[arg(long, value_name = "DIR")]
    pub logs_dir: Option<PathBuf>,
    /// Tracks of another program, scored beside the pipelines: a name, and a folder with LOG.txt or LOG.csv
    /// for each log, in a format that `eval` reads.
    #[arg(long, num_args = 1.., value_name = "NAME=DIR")]
    pub tracks: Vec<ForeignTracks>,
    /// The rooms of the logs, as for --leave-one-room-out: they state which logs are single frames
    /// or of one room, and which frames are not scored. Without --logs and --logs-dir, all logs of
    /// the rooms are used.
    #[arg(long, value_name = "ROOMS")]
    pub rooms: Option<PathBuf>,
    /// Runs each pipeline with this many seeds, counted from that of its config.
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: u64,
    /// Keep the first of several people with the same ID in a frame of a truth, and count the others.
    #[arg(long)]
    pub drop_doubled_ids: bool,
}

/// Execution of the tasks.
#[derive(Args, Clone, Debug)]
pub struct RunArgs {
    /// Number of tasks that run in parallel; it does not affect the results.
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: u16,
    /// Only this task: its number in the plan, or its hash.
    #[arg(long, value_name = "K|HASH")]
    pub task: Option<String>,
    /// Only part K of N, by logs: the logs K, K + N, and so on of the plan, with all of their
    /// tasks.
    #[arg(long, value_name = "K/N", conflicts_with = "task")]
    pub shard: Option<Shard>,
    /// Run tasks again that failed before.
    #[arg(long)]
    pub retry_failed: bool,
    /// Measure times, one task at a time, on an otherwise idle machine.
    #[arg(long)]
    pub timing: bool,
}

/// Part of a plan for one of several processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    part: usize,
    parts: usize,
}

impl Shard {
    /// Returns true if the log with this index in the plan, from 0, belongs to this part.
    pub fn has(self, log: usize) -> bool {
        log % self.parts == self.part - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(part, parts)| {
            Some(Self { part: part.parse().ok()?, parts: parts.parse().ok()? })
        });
        numbers
            .filter(|shard| (1..=shard.parts).contains(&shard.part))
            .ok_or_else(|| "expected K/N with K from 1 to N, for example 3/64".into())
    }
}

/// Content of the report.
#[derive(Args, Clone, Debug)]
pub struct ReportArgs {
    #[command(flatten)]
    pub gate: GateArgs,
    /// Output format; JSON is the text of report.json.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Notes of the caller on the logs.
    #[arg(skip)]
    pub notes: Vec<String>,
}

/// Conditions under which a benchmark counts as worse than its baseline.
#[derive(Args, Clone, Debug)]
pub struct GateArgs {
    /// An earlier report.json to compare with.
    #[arg(long, value_name = "FILE")]
    pub baseline: Option<PathBuf>,
    /// Exit with 1 if a figure changed by this much, for example HOTA<-0.01,
    /// IDSW>0 or metres.MOTA<-0.02.
    #[arg(long, value_name = "FIGURE<CHANGE", requires = "baseline", num_args = 1..)]
    pub fail_if: Vec<String>,
}

impl BenchArgs {
    /// Returns the arguments for all steps, with one seed and without a gate.
    pub fn of(configs: Vec<PathBuf>, logs: Vec<PathBuf>, output: PathBuf) -> Self {
        Self {
            step: None,
            plan: PlanArgs { configs, logs, seeds: 1, ..PlanArgs::default() },
            run: RunArgs { jobs: 1, task: None, shard: None, retry_failed: false, timing: false },
            report: ReportArgs {
                gate: GateArgs { baseline: None, fail_if: Vec::new() },
                format: Format::Text,
                notes: Vec::new(),
            },
            folder: FolderArgs { output },
        }
    }

    /// Adds a note on the logs to the report.
    #[must_use]
    pub fn with_note(mut self, note: String) -> Self {
        self.report.notes.push(note);
        self
    }
}

/// Tracks of another program on all logs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ForeignTracks {
    /// Name in tables.
    pub name: String,
    /// Folder with a file for each log, named after it.
    pub folder: PathBuf,
}

impl FromStr for ForeignTracks {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, folder) = text.split_once('=').unwrap_or_default();
        if name.is_empty() || folder.is_empty() {
            return Err("expected NAME=DIR, for example bytetrack=tracks/bytetrack".into());
        }
        Ok(Self { name: name.to_owned(), folder: folder.into() })
    }
}
