//! `tagalong bench`: pipelines x logs x seeds, in separate steps.
//!
//! A plan lists tasks, each with a hash of everything on which its result depends. A result is a
//! file named by that hash, so that running again costs nothing, several processes or machines can
//! share a folder, and a changed config is never paired with an old result. A report only reads
//! results.
//!
//! ```
//! use clap::Parser as _;
//! use tagalong_config::Registry;
//! use tagalong_benchmark::{bench, BenchArgs};
//!
//! #[derive(clap::Parser)]
//! struct Cli {
//!     #[command(flatten)]
//!     args: BenchArgs,
//! }
//!
//! let cli = Cli::parse_from(["bench", "plan", "--configs", "none.toml", "--logs", "none.mcap"]);
//! let failure = bench(&cli.args, &Registry::default()).unwrap_err();
//! assert!(failure.message.contains("none.toml"), "{}", failure.message);
//! ```

mod args;
mod closing;
pub mod experiments;
mod export;
mod folder;
mod foreign;
mod gate;
mod made_with;
mod misses;
mod moments;
mod pictures;
mod plan;
mod report;
mod rooms;
mod store;
mod tuning;
mod watch;
mod work;

pub use args::BenchArgs;
use args::{PlanArgs, ReportArgs, Step};
use folder::FolderArgs;
use gate::Gate;
use store::Store;
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, say};
use tagalong_app::serialize::to_json_line;
use tagalong_config::Registry;
use tagalong_math::counted;
use work::Tally;

/// Runs `tagalong bench`.
///
/// # Errors
/// Files that cannot be read or written; tasks that failed; a gate that was violated.
pub fn bench(args: &BenchArgs, registry: &Registry) -> Outcome {
    match &args.step {
        None => everything(args, registry),
        Some(Step::Plan { plan, folder }) => {
            print(&make_plan(plan, folder, registry)?)?;
            Ok(Ended::Well)
        }
        Some(Step::Run { run, folder }) => {
            let store = store(folder);
            let tally = work::work(run, &store, registry)?;
            verdict(tally, &store)
        }
        Some(Step::Report { report, folder }) => {
            let gate = Gate::read(&report.gate)?;
            make_report(folder, report, gate.as_ref())?;
            Ok(Ended::Well)
        }
        Some(Step::Rooms(args)) => rooms::rooms(args, registry),
        Some(Step::Export { trackeval, folder }) => {
            let (trackers, sequences) = export::export(&store(folder), trackeval)?;
            say(&format!(
                "{trackers} trackers on {sequences} sequences in {}",
                trackeval.display()
            ));
            Ok(Ended::Well)
        }
    }
}

fn store(folder: &FolderArgs) -> Store {
    Store::new(&folder.output)
}

/// Runs all steps. A failed task does not prevent the others from being reported.
fn everything(args: &BenchArgs, registry: &Registry) -> Outcome {
    // The gate is read first, so that an error in a rule does not cost a whole benchmark.
    let gate = Gate::read(&args.report.gate)?;
    make_plan(&args.plan, &args.folder, registry)?;
    let store = store(&args.folder);
    let tally = work::work(&args.run, &store, registry)?;
    // A single task or shard does not have all results that a report needs.
    let is_whole = args.run.task.is_none() && args.run.shard.is_none();
    if tally.signal.is_none() && is_whole {
        make_report(&args.folder, &args.report, gate.as_ref())?;
    }
    verdict(tally, &store)
}

/// Writes the plan, and returns it as text.
fn make_plan(args: &PlanArgs, folder: &FolderArgs, registry: &Registry) -> Result<String, Failure> {
    let tasks = plan::plan(args, registry)?;
    let lines = tasks.iter().map(|task| to_json_line("a task of the plan", task));
    let text: String = lines.collect::<Result<_, _>>()?;
    store(folder).put("plan.jsonl", text.as_bytes())?;
    Ok(text)
}

fn make_report(folder: &FolderArgs, args: &ReportArgs, gate: Option<&Gate>) -> Result<(), Failure> {
    let store = store(folder);
    let mut benchmark = report::gather(&store)?;
    benchmark.notes.extend(args.notes.iter().cloned());
    let json = report::write(&store, &benchmark)?;
    match args.format {
        Format::Text => print(&report::text(&store, &benchmark))?,
        Format::Json => print(&json)?,
    }
    match gate.and_then(|gate| gate.worse(&benchmark)) {
        Some(worse) => Err(Failure::failed(worse.trim_end())),
        None => Ok(()),
    }
}

/// Returns the end of a sentence on the tasks that were run: the number of results that existed
/// before.
fn earlier(count: usize) -> String {
    if count == 0 { String::new() } else { format!("; {count} had results of an earlier run") }
}

fn verdict(tally: Tally, store: &Store) -> Outcome {
    let Tally { asked, ran, done, failed, lost, signal } = tally;
    if let Some(signal) = signal {
        say(&stopped(done, &counted(asked, "task"), store));
        return Ok(Ended::BySignal(signal));
    }
    say(&format!("{} run{}", counted(ran, "task"), earlier(asked - ran)));
    match (failed, lost) {
        (0, false) => Ok(Ended::Well),
        (0, true) => Ok(Ended::WithLoss),
        _ => Err(Failure::failed(format!(
            "{failed} of {} failed; the report says why",
            counted(asked, "task")
        ))),
    }
}

/// Returns the message after a signal: which results are kept, and how to continue.
fn stopped(done: usize, asked: &str, store: &Store) -> String {
    let folder = store.path("");
    format!(
        "stopped: {done} of {asked} have their results in {}, and there is no new report; the same \
         command continues with the others",
        folder.display()
    )
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        bench: BenchArgs,
    }

    fn parse(line: &str) -> Result<BenchArgs, clap::Error> {
        Cli::try_parse_from(line.split(' ')).map(|cli| cli.bench)
    }

    #[test]
    fn an_interrupted_benchmark_says_where_its_results_are_and_how_it_goes_on() {
        let told = stopped(3, "12 tasks", &Store::new(std::path::Path::new("out")));
        assert!(told.contains("3 of 12 tasks have their results in out"), "{told}");
        assert!(told.contains("the same command continues"), "{told}");
    }

    #[test]
    fn steps_take_only_what_is_theirs() {
        assert!(parse("bench --logs a.mcap b.mcap --jobs 2 -o x").is_ok());
        assert!(parse("bench plan --logs a.mcap -o x").is_ok());
        assert!(parse("bench plan --jobs 2").is_err());
        assert!(parse("bench run --fail-if HOTA<0").is_err());
        assert!(parse("bench report --fail-if HOTA<0").is_err(), "a gate needs a baseline");
    }

    #[test]
    fn all_arguments_have_their_step() {
        let args = parse("bench --jobs 3").unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((args.plan.seeds, args.run.jobs, args.report.gate.baseline), (1, 3, None));
    }

    #[test]
    fn the_shards_of_a_plan_have_each_log_once() {
        for log in 0..7 {
            let shards = (1..=3).filter(|k| {
                let args = parse(&format!("bench run --shard {k}/3")).ok();
                let Some(Step::Run { run, .. }) = args.and_then(|args| args.step) else {
                    return false;
                };
                run.shard.is_some_and(|shard| shard.has(log))
            });
            assert_eq!(shards.collect::<Vec<_>>(), [log % 3 + 1]);
        }
        for wrong in ["0/3", "4/3", "1/0", "3", "a/b", "1/3 --task 1"] {
            assert!(parse(&format!("bench run --shard {wrong}")).is_err(), "{wrong}");
        }
    }
}
