//! `tagalong follow --approaches`: people and trolleys move towards the robot from every side, and
//! the contacts while it moves are counted.

mod story;
mod table;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use tagalong_app::format::TableFormat;
use tagalong_app::outcome::{Ended, Failure, Outcome, make_folder, print, say, spare, write_file};
use tagalong_app::serialize::to_json;
use tagalong_app::signals::Signals;
use tagalong_app::threads::threads;
use tagalong_config::Registry;
use tagalong_math::{RandomSource, SplitMix64, counted};
use tagalong_report::Table;
use tagalong_sim::{InjectedFault, Scene, Seeds, Split};
use tagalong_trials::{
    ApproachJudge, ApproachWatch, Approached, Contender, Ride, TrialError, in_order,
};

use super::log::RideLog;
use super::{FollowArgs, contenders, failure, folder_name, inject, run_files, swept, variant};

/// Result files, in addition to the logs of the approaches.
const RESULTS: [&str; 2] = ["approaches.json", "approaches.md"];
/// The scene of all approaches unless scenes are named.
const SCENE: &str = "configs/scenes/approach.toml";
/// Earliest time of an injected fault, s.
const FAULT_FROM_S: f64 = 0.3;

/// Faults that are injected into approaches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ApproachFaults {
    /// None.
    #[default]
    None,
    /// One in each approach; the seed chooses its kind and its time.
    One,
}

/// Laser scanner of the robot in approaches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ApproachLaser {
    /// In approaches with an odd seed.
    #[default]
    Half,
    /// In all of them.
    With,
    /// In none of them.
    Without,
}

/// One pipeline in one approach.
struct Job<'a> {
    contender: &'a Contender,
    path: &'a Path,
    suite: String,
    set: Option<(String, String)>,
    seed: u64,
}

/// Result of a job.
#[derive(Clone, Debug, Serialize)]
pub struct Outlived {
    /// Name of the scene, with the value of the sweep.
    pub suite: String,
    /// Name of the pipeline.
    pub pipeline: String,
    /// Result of the approach.
    #[serde(flatten)]
    pub approached: Approached,
    /// Course of the ride, as text.
    #[serde(skip)]
    pub story: Vec<String>,
    /// Log of the ride, if it was kept.
    #[serde(skip)]
    pub log: Option<PathBuf>,
}

/// Content of the JSON output.
#[derive(Serialize)]
struct Findings<'a> {
    seeds: Seeds,
    tables: &'a [Table],
    approaches: &'a [Outlived],
}

/// Runs the approaches and prints how often the robot was moving at a contact.
pub(super) fn approaches(args: &FollowArgs, registry: &Registry) -> Outcome {
    let signals = Signals::listen()?;
    let seeds = seeds(args)?;
    let contenders = contenders(args, registry)?;
    let paths = scenes(args);
    let jobs = jobs(args, &contenders, &paths, seeds);
    // A scene that cannot be read is reported before the first ride.
    for job in jobs.iter().filter(|job| seeds.numbers().start == job.seed) {
        read_scene(job, args)?;
    }
    if let Some(folder) = &args.output {
        for job in &jobs {
            spare(&log_file(folder, job), args.overwrite)?;
        }
        for name in RESULTS {
            spare(&folder.join(name), args.overwrite)?;
        }
        make_folder(folder)?;
    }
    let bar = bar(jobs.len());
    let results = in_order(
        &jobs,
        threads(args.jobs),
        |job| approach(job, args, registry, &signals),
        |_| bar.inc(1),
    );
    let results = results.map_err(failure)?;
    bar.finish_and_clear();
    let whole: Vec<Outlived> = results.into_iter().flatten().collect();
    if let Some(signal) = signals.received() {
        say(&format!("stopped after {} of {} approaches", whole.len(), jobs.len()));
        report(args, seeds, &whole)?;
        return Ok(Ended::BySignal(signal));
    }
    report(args, seeds, &whole)?;
    Ok(Ended::Well)
}

/// Returns the seeds of the approaches: those of the requested number, or the replayed one.
fn seeds(args: &FollowArgs) -> Result<Seeds, Failure> {
    let seeds = match args.replay {
        Some(seed) => Split::of(seed).seeds(seed, 1),
        None => args.split.seeds(args.first_seed, args.approaches.unwrap_or(1)),
    };
    seeds.map_err(Failure::usage)
}

fn scenes(args: &FollowArgs) -> Vec<PathBuf> {
    if args.scenes.is_empty() { vec![PathBuf::from(SCENE)] } else { args.scenes.clone() }
}

fn jobs<'a>(
    args: &FollowArgs,
    contenders: &'a [Contender],
    paths: &'a [PathBuf],
    seeds: Seeds,
) -> Vec<Job<'a>> {
    let mut jobs = Vec::new();
    for path in paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        for set in swept(args) {
            let value = set.as_ref().map(|(_, value)| format!(" {value}")).unwrap_or_default();
            let suite = format!("{name}{value}");
            for contender in contenders {
                jobs.extend(seeds.numbers().map(|seed| {
                    let suite = suite.clone();
                    let set = set.clone();
                    Job { contender, path, suite, set, seed }
                }));
            }
        }
    }
    jobs
}

/// Returns the scene of an approach, which depends only on the seed.
fn read_scene(job: &Job<'_>, args: &FollowArgs) -> Result<Scene, Failure> {
    let mut variant = variant(args, job.seed);
    variant.split = Some(Split::of(job.seed));
    // Inserted after the values of the user, which have priority.
    if has_laser(args.laser, job.seed) {
        variant.set.insert(0, ("laser".to_owned(), "{}".to_owned()));
    }
    variant.set.extend(job.set.clone());
    let mut scene = tagalong_simulate::read(job.path, &variant)?;
    let Some(approach) = &scene.approach else {
        let shown = job.path.display();
        return Err(Failure::usage(format!(
            "{shown} has no table [approach], so nothing approaches the robot in it; add one, or \
             leave out the scene for {SCENE}"
        )));
    };
    let arrives_s = approach.arrives_s();
    inject(&mut scene, &args.inject)?;
    if args.faults == ApproachFaults::One {
        let mut random = SplitMix64::new(job.seed);
        let last_s = arrives_s.max(FAULT_FROM_S);
        let at_s = FAULT_FROM_S + (last_s - FAULT_FROM_S) * random.positive_uniform();
        scene.faults.inject.push(InjectedFault::random().at(at_s));
    }
    scene.check_faults().map_err(Failure::usage)?;
    Ok(scene)
}

fn has_laser(laser: ApproachLaser, seed: u64) -> bool {
    match laser {
        ApproachLaser::Half => seed % 2 == 1,
        ApproachLaser::With => true,
        ApproachLaser::Without => false,
    }
}

/// Runs one approach; `None` after a stop signal. If there is a contact while the robot moves, the
/// approach is run again with a log, because the logs of all approaches would fill a disk.
fn approach(
    job: &Job<'_>,
    args: &FollowArgs,
    registry: &Registry,
    signals: &Signals,
) -> Result<Option<Outlived>, TrialError> {
    if signals.received().is_some() {
        return Ok(None);
    }
    let scene = read_scene(job, args).map_err(|error| TrialError::Config(error.message))?;
    let replays = args.replay.is_some();
    let file = args.output.as_deref().map(|folder| log_file(folder, job));
    let first_file = file.as_deref().filter(|_| replays);
    let mut result = ride(job, &scene, (args, first_file), registry, signals)?;
    let logs_contact = file.is_some() && !replays;
    if logs_contact && result.as_ref().is_some_and(|one| one.approached.contact.is_some()) {
        result = ride(job, &scene, (args, file.as_deref()), registry, signals)?;
    }
    Ok(result)
}

/// Rides one approach, with a log if there is a file for it.
fn ride(
    job: &Job<'_>,
    scene: &Scene,
    (args, file): (&FollowArgs, Option<&Path>),
    registry: &Registry,
    signals: &Signals,
) -> Result<Option<Outlived>, TrialError> {
    let mut log = RideLog::new(file, scene, signals.clone());
    if let Some(file) = file {
        let seed = scene.seed;
        log = log.with_files(run_files(file, job.contender, registry, seed, args.overlay)?);
    }
    let mut watch = ApproachWatch::new(scene, &mut log);
    let ride = Ride::new(scene, job.contender, registry, &mut watch)?;
    log.finish(None, &[])?;
    // A ride that a signal interrupted has no meaningful result.
    if signals.received().is_some() {
        return Ok(None);
    }
    let judge = ApproachJudge::default();
    let approached = judge.judge(scene, &ride);
    Ok(approached.map(|approached| Outlived {
        suite: job.suite.clone(),
        pipeline: job.contender.name.clone(),
        story: story::story(scene, &ride, &judge, &approached),
        approached,
        log: file.map(Path::to_owned),
    }))
}

fn bar(rides: usize) -> ProgressBar {
    let bar = ProgressBar::new(rides as u64);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} rides {eta}") {
        bar.set_style(style);
    }
    bar
}

/// Returns the file of an approach's log.
fn log_file(folder: &Path, job: &Job<'_>) -> PathBuf {
    let suite = job.suite.replace(' ', "-");
    folder.join(format!("{suite}-{}-{}.mcap", job.contender.name, job.seed))
}

/// Returns all tables in one text.
fn joined(tables: &[Table], show: fn(&Table) -> String) -> String {
    let shown: Vec<String> = tables.iter().map(show).collect();
    shown.join("\n")
}

fn report(args: &FollowArgs, seeds: Seeds, results: &[Outlived]) -> Result<(), Failure> {
    let tables = table::tables(results, seeds);
    let findings = Findings { seeds, tables: &tables, approaches: results };
    let json = to_json("the results of the approaches", &findings)?;
    if let Some(folder) = &args.output {
        let texts = [json.clone(), joined(&tables, Table::markdown)];
        for (name, text) in RESULTS.iter().zip(texts) {
            write_file(&folder.join(name), text)?;
        }
    }
    match args.format {
        TableFormat::Json => print(&json)?,
        TableFormat::Markdown => print(&joined(&tables, Table::markdown))?,
        TableFormat::Text => {
            if args.replay.is_some() {
                for result in results {
                    print(&format!("{}\n{}\n\n", result.pipeline, result.story.join("\n")))?;
                }
            } else {
                print(&joined(&tables, Table::text))?;
            }
        }
    }
    let Some(folder) = &args.output else { return Ok(()) };
    say(&kept(folder, results));
    Ok(())
}

/// Returns the line about the files of the rides that were kept, with the command that shows one.
fn kept(folder: &Path, results: &[Outlived]) -> String {
    let logged = results.iter().filter_map(|one| one.log.as_deref());
    let rides: Vec<String> =
        logged.map(|log| folder.join(folder_name(log)).display().to_string()).collect();
    let shown = folder.display();
    let Some(first) = rides.first() else {
        return format!(
            "the tables are in {shown}; no robot moved at a contact, so no log was kept"
        );
    };
    let count = counted(rides.len(), "ride");
    format!("the tables and the logs of {count} are in {shown}; `tagalong view {first}` shows one")
}
