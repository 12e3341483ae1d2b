//! `tagalong follow`: a pipeline steers the simulated robot through scenes.

mod approaches;
mod crowd_table;
mod fit;
mod log;
mod reasons;
mod ride_bar;
mod run_files;
mod story;
mod table;

use std::fs;
use std::path::{Path, PathBuf};

pub use approaches::{ApproachFaults, ApproachLaser};
use clap::Args;
use log::RideLog;
use ride_bar::RidesBar;
use run_files::{RunFiles, folder_name};
use serde::Serialize;
use tagalong_app::config_file::ConfigFile;
use tagalong_app::format::TableFormat;
use tagalong_app::outcome::{Ended, Failure, Outcome, make_folder, print, say, spare, write_file};
use tagalong_app::serialize::to_json;
use tagalong_app::signals::Signals;
use tagalong_app::threads::threads;
use tagalong_config::Registry;
use tagalong_pipeline::LooksSettings;
use tagalong_report::Table;
use tagalong_sim::{FaultKind, InjectedFault, Scene, ScheduledFault, Seeds, Split, Variant};
use tagalong_simulate::scenes;
use tagalong_trials::{Contender, Ridden, Ride, RideJudge, TrialError, in_order};

use crate::experiments::contender::{contender, unsuited};

/// Result files, in addition to the logs of the rides.
const RESULTS: [&str; 3] = ["follow.json", "follow.md", "likeness.csv"];
/// Folder and name prefix of the default scenes.
const SCENES: (&str, &str) = ("configs/scenes", "follow-");

/// The built-in config that is used if none is named.
const CONFIG: &str = "follow-depth";
/// Proposed duration of a ride after the beginning of a fault, s.
const LONGER_S: f64 = 20.0;

/// Arguments of `tagalong follow`.
#[derive(Args, Debug)]
pub struct FollowArgs {
    /// The pipeline; it needs a `[controller]`.
    #[arg(default_value = "configs/follow-depth.toml")]
    pub config: PathBuf,
    /// The scenes; their first person is the one to follow [default: all
    /// follow-*.toml of configs/scenes].
    pub scenes: Vec<PathBuf>,
    /// More pipelines, on the same scenes.
    #[arg(long, num_args = 1.., value_name = "CONFIG")]
    pub against: Vec<PathBuf>,
    /// Ride each scene with this many seeds ...
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub seeds: u64,
    /// ... starting with this one of the split.
    #[arg(long, alias = "seed", value_name = "N", default_value_t = 0)]
    pub first_seed: u64,
    /// The split that the seeds belong to; settings are chosen on `validation`.
    #[arg(long, value_name = "SPLIT", default_value = "test")]
    pub split: Split,
    /// Delay from a command to the motion of the wheels, ms, instead of the scene's.
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u16).range(0..=2000))]
    pub latency_ms: Option<u16>,
    /// Lose this fraction of the images, instead of the scene's.
    #[arg(long, value_name = "FRACTION", value_parser = fraction)]
    pub drop: Option<f64>,
    /// Inject a fault, repeatable: a kind like `freeze-depth`, or `random`, from AT seconds on, for
    /// LASTS seconds; the seed decides what is left out.
    #[arg(long, value_name = "KIND[@AT[+LASTS]]")]
    pub inject: Vec<InjectedFault>,
    /// Replace a value in each scene: a dotted key, like `crowd=5`.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = tagalong_simulate::key_and_value)]
    pub set: Vec<(String, String)>,
    /// Ride each scene with each of these values instead of one, a row each:
    /// `camera.height_m=0.3,0.5`.
    #[arg(long, value_name = "KEY=VALUES", value_parser = tagalong_simulate::key_and_value)]
    pub sweep: Option<(String, String)>,
    /// Number of rides in parallel; it does not affect the results [default: the number of cores].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub jobs: Option<u8>,
    /// Write the log of every ride (images, truth, commands, reasons), its folder for `view`, and
    /// the tables, to this folder.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Replace the files of earlier rides in that folder.
    #[arg(long, requires = "output")]
    pub overwrite: bool,
    /// Also write a picture of every frame into the folder of every ride: boxes, IDs, target, plan.
    #[arg(long, requires = "output")]
    pub overlay: bool,
    /// Ride each scene once more with each pipeline given the true positions instead of detections: of
    /// all people within range of the laser scanner and in free sight (within 5 m without a scanner),
    /// and which of them is the target. The difference is the cost of perception.
    #[arg(long, conflicts_with_all = ["approaches", "replay", "fit"])]
    pub told: bool,
    /// Print the settings [target.looks] that fit these rides best, and the calibration of the
    /// probabilities; use the split `train`.
    #[arg(long)]
    pub fit: bool,
    /// Ride this many random approaches instead: a person or a trolley comes at the robot from any
    /// side and does not avoid it. Prints the contacts while the robot moves; with -o their
    /// logs are written. The scenes are those with a table `[approach]` [default: approach.toml].
    #[arg(long, value_name = "N", conflicts_with_all = ["seeds", "fit"],
          value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    pub approaches: Option<u64>,
    /// Ride the approach with this seed again, and print its course; with -o its log is written.
    #[arg(long, value_name = "SEED",
          conflicts_with_all = ["approaches", "seeds", "first_seed", "split", "fit"])]
    pub replay: Option<u64>,
    /// Inject a fault into each approach, with a time and a kind that its seed decides.
    #[arg(long, value_enum, default_value_t)]
    pub faults: ApproachFaults,
    /// Presence of a laser scanner on the robot in approaches.
    #[arg(long, value_enum, default_value_t)]
    pub laser: ApproachLaser,
    /// Also print how reliable the probabilities of the lock are; the files always have it.
    #[arg(long)]
    pub calibration: bool,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
}

fn fraction(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("{text} is no number"))?;
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err("must be in 0 to 1".into()) }
}

/// One pipeline on one random variant of a scene.
struct Job {
    suite: String,
    swept: Option<String>,
    scene: Scene,
    contender: Contender,
    is_told: bool,
}

/// Result of a job.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Followed {
    /// Name of the scene, with the value of the sweep.
    pub suite: String,
    /// Value of the sweep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub swept: Option<String>,
    /// Name of the pipeline.
    pub pipeline: String,
    /// Name of the folder of the ride, in the same folder as its log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub folder: Option<String>,
    /// Faults that were injected.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<ScheduledFault>,
    /// Scores of the ride.
    #[serde(flatten)]
    pub ridden: Ridden,
    /// Processing time of each frame, ms.
    #[serde(skip)]
    pub took_ms: Vec<f64>,
    /// Events of the ride, as text.
    #[serde(skip)]
    pub story: Vec<String>,
}

/// Content of the JSON output.
#[derive(Serialize)]
struct Findings<'a> {
    seeds: Seeds,
    tables: &'a [Table],
    #[serde(skip_serializing_if = "Option::is_none")]
    looks: Option<&'a LooksSettings>,
    rides: &'a [Followed],
}

/// Runs the rides and prints the scores.
///
/// # Errors
/// Scenes and configs that cannot be used give exit code 2; plugins that fail and files that cannot
/// be written give 1.
pub fn follow(args: &FollowArgs, registry: &Registry) -> Outcome {
    if args.approaches.is_some() || args.replay.is_some() {
        return approaches::approaches(args, registry);
    }
    if args.faults != ApproachFaults::None || args.laser != ApproachLaser::Half {
        let message = "--faults and --laser are for --approaches: add it, or leave them out";
        return Err(Failure::usage(message));
    }
    let signals = Signals::listen()?;
    let seeds = args.split.seeds(args.first_seed, args.seeds).map_err(Failure::usage)?;
    let jobs = jobs(args, seeds, registry)?;
    if let Some(folder) = &args.output {
        for job in &jobs {
            spare(&log_file(folder, job), args.overwrite)?;
        }
        // Other rides may have left results there, which do not belong to these rides.
        for name in RESULTS {
            spare(&folder.join(name), args.overwrite)?;
        }
        make_folder(folder)?;
    }
    let bar = RidesBar::new(jobs.iter().map(|job| job.scene.duration_s));
    let threads = threads(args.jobs);
    let results = in_order(
        &jobs,
        threads,
        |job| ride(job, args, registry, (&signals, &bar)),
        |_| bar.advance(),
    );
    let results = results.map_err(failure)?;
    bar.finish();
    if let Some(signal) = signals.received() {
        say("stopped; the logs that were written are valid, but end early");
        return Ok(Ended::BySignal(signal));
    }
    report(args, seeds, &results)?;
    Ok(Ended::Well)
}

fn failure(error: TrialError) -> Failure {
    match error {
        TrialError::Config(_) => Failure::usage(error),
        _ => Failure::failed(error),
    }
}

/// Returns every pipeline on every seed of every scene.
fn jobs(args: &FollowArgs, seeds: Seeds, registry: &Registry) -> Result<Vec<Job>, Failure> {
    let mut jobs = Vec::new();
    let mut contenders = Vec::new();
    for contender in self::contenders(args, registry)? {
        let told = if args.told { Some(contender.told(registry).map_err(failure)?) } else { None };
        contenders.push((contender, false));
        contenders.extend(told.map(|told| (told, true)));
    }
    // Checked before any file is written.
    let mut pipelines = Vec::new();
    for (contender, _) in &contenders {
        pipelines.push(contender.pipeline(registry, 0).map_err(failure)?);
    }
    for path in scenes(args)? {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        for value in swept(args) {
            let swept = value.as_ref().map(|(_, value)| value.clone());
            let suite = std::iter::once(&name).chain(&swept);
            let suite = suite.map(String::as_str).collect::<Vec<_>>().join(" ");
            for ((contender, is_told), pipeline) in contenders.iter().zip(&pipelines) {
                for seed in seeds.numbers() {
                    let mut variant = variant(args, seed);
                    variant.set.extend(value.clone());
                    let mut scene = tagalong_simulate::read(&path, &variant)?;
                    inject(&mut scene, &args.inject)?;
                    Ride::check_sensors(&scene, pipeline, &contender.name).map_err(failure)?;
                    let suite = suite.clone();
                    let swept = swept.clone();
                    let contender = contender.clone();
                    jobs.push(Job { suite, swept, scene, contender, is_told: *is_told });
                }
            }
        }
    }
    for ((contender, _), pipeline) in contenders.iter().zip(&pipelines) {
        let own = jobs.iter().filter(|job| job.contender.name == contender.name);
        let scenes = own.map(|job| (job.suite.as_str(), &job.scene));
        if let Some(note) = unsuited(&contender.name, &pipeline.config().suits, scenes) {
            say(&format!("note: {note}"));
        }
        for caution in pipeline.cautions(None) {
            say(&format!("note: {}: {caution}", contender.name));
        }
    }
    Ok(jobs)
}

/// Adds the faults of `--inject` to a scene.
fn inject(scene: &mut Scene, faults: &[InjectedFault]) -> Result<(), Failure> {
    for fault in faults {
        if let Some(at_s) = fault.at_s.filter(|at_s| *at_s >= scene.duration_s) {
            let kind = fault.kind.map_or("random", FaultKind::name);
            let ends_s = scene.duration_s;
            return Err(Failure::usage(format!(
                "--inject {kind}@{at_s}: the ride ends at {ends_s:.1} s, and the fault would never begin; \
                 give an earlier time, or a longer ride with `--set duration_s={:.1}`",
                at_s + LONGER_S
            )));
        }
    }
    scene.faults.inject.extend(faults.iter().cloned());
    scene.check_faults().map_err(Failure::usage)
}

/// Returns the values of `--sweep` with their key; `None` once without it.
fn swept(args: &FollowArgs) -> Vec<Option<(String, String)>> {
    let Some((key, values)) = &args.sweep else { return vec![None] };
    values.split(',').map(|value| Some((key.clone(), value.trim().to_owned()))).collect()
}

fn contenders(args: &FollowArgs, registry: &Registry) -> Result<Vec<Contender>, Failure> {
    let mut contenders = Vec::new();
    for path in std::iter::once(&args.config).chain(&args.against) {
        if is_scene(path) {
            return Err(scene_in_place_of_config(path, args));
        }
        let file = ConfigFile::read(path)?;
        let (pipeline, _) = file.pipeline(registry, None)?;
        if !pipeline.has_controller() {
            let shown = path.display();
            let steering = steering_configs(registry).join(", ");
            return Err(Failure::usage(format!(
                "{shown} has no [controller], so it drives no robot; built-in configs with one: \
                 {steering}"
            )));
        }
        contenders.push(contender(&file));
    }
    Ok(contenders)
}

/// Returns true for the name or the file of a built-in scene that is no config as well.
fn is_scene(path: &Path) -> bool {
    let is_config = path.to_str().is_some_and(|name| ConfigFile::named(name).is_some());
    scenes::built_in(path).is_some() && !is_config
}

/// Returns the error for a scene that is given in place of the config.
fn scene_in_place_of_config(path: &Path, args: &FollowArgs) -> Failure {
    let shown = path.display();
    let mut given = args.scenes.iter().filter_map(|path| path.to_str());
    let config = given.find(|name| ConfigFile::named(name).is_some()).unwrap_or(CONFIG);
    Failure::usage(format!("{shown} is a scene: `tagalong follow {config} {shown}`"))
}

/// Returns the names of the built-in configs that steer a robot.
fn steering_configs(registry: &Registry) -> Vec<&'static str> {
    let mut steering = Vec::new();
    for name in ConfigFile::built_in_names() {
        let Some(file) = ConfigFile::named(name) else { continue };
        // A config that needs a file of the user is no help.
        if file.pipeline(registry, None).is_ok_and(|(pipeline, _)| pipeline.has_controller()) {
            steering.push(name);
        }
    }
    steering
}

/// Returns the named scenes, or all default ones.
fn scenes(args: &FollowArgs) -> Result<Vec<PathBuf>, Failure> {
    if !args.scenes.is_empty() {
        return Ok(args.scenes.clone());
    }
    let (folder, prefix) = SCENES;
    // Outside of a clone the same scenes are built in.
    let Ok(found) = fs::read_dir(folder) else { return Ok(scenes::beginning_with(prefix)) };
    let mut paths: Vec<PathBuf> = found
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix))
        .map(|entry| entry.path())
        .collect();
    paths.sort();
    Ok(paths)
}

fn variant(args: &FollowArgs, seed: u64) -> Variant {
    let latency = args.latency_ms.map(|ms| f64::from(ms) * 1e-3);
    let faults = [("robot.latency_s", latency), ("faults.dropped", args.drop)];
    let faults = faults
        .into_iter()
        // Debug formatting keeps the decimal point of integers, which TOML needs for a float.
        .filter_map(|(key, value)| Some((key.to_owned(), format!("{:?}", value?))));
    let set = args.set.iter().cloned().chain(faults).collect();
    Variant { seed: Some(seed), split: Some(args.split), set }
}

fn ride(
    job: &Job,
    args: &FollowArgs,
    registry: &Registry,
    (signals, bar): (&Signals, &RidesBar),
) -> Result<Followed, TrialError> {
    let Job { suite, swept, scene, contender, is_told } = job;
    // A ride that did not start because of a signal leaves no log.
    let folder = args.output.as_deref().filter(|_| signals.received().is_none());
    let file = folder.map(|folder| log_file(folder, job));
    let mut log = RideLog::new(file.as_deref(), scene, signals.clone())
        .with_bar(bar.of_ride(scene.duration_s));
    if let Some(file) = &file {
        log = log.with_files(run_files(file, contender, registry, scene.seed, args.overlay)?);
    }
    let ride = if *is_told {
        Ride::told(scene, contender, registry, &mut log)?
    } else {
        Ride::new(scene, contender, registry, &mut log)?
    };
    let ridden = RideJudge::default().judge(&ride);
    log.finish(Some(&ridden), &ride.faults)?;
    Ok(Followed {
        suite: suite.clone(),
        swept: swept.clone(),
        pipeline: contender.name.clone(),
        folder: file.as_deref().map(folder_name),
        ridden,
        story: story::story(&ride),
        faults: ride.faults,
        took_ms: ride.took_ms,
    })
}

/// Opens the folder of the ride with this log.
fn run_files(
    log: &Path,
    contender: &Contender,
    registry: &Registry,
    seed: u64,
    pictures: bool,
) -> Result<RunFiles, TrialError> {
    let pipeline = contender.pipeline(registry, seed)?;
    let files = RunFiles::create(log, &contender.name, pipeline.config(), pictures);
    files.map_err(|error| TrialError::Witness(error.to_string()))
}

fn log_file(folder: &Path, job: &Job) -> PathBuf {
    let suite = job.suite.replace(' ', "-");
    folder.join(format!("{suite}-{}-{}.mcap", job.contender.name, job.scene.seed))
}

fn report(args: &FollowArgs, seeds: Seeds, results: &[Followed]) -> Result<(), Failure> {
    let tables = table::tables(results, seeds);
    let looks = args.fit.then(|| fit::looks(results));
    let findings = Findings { seeds, tables: &tables, looks: looks.as_ref(), rides: results };
    let json = to_json("the scores of the rides", &findings)?;
    let markdown = tables.iter().map(Table::markdown).collect::<Vec<_>>().join("\n");
    // Written before it is printed, so that a closed pipe does not cost the results.
    if let Some(folder) = &args.output {
        let texts = [json.clone(), markdown.clone(), table::likeness_csv(results)];
        for (name, text) in RESULTS.iter().zip(texts) {
            write_file(&folder.join(name), text)?;
        }
    }
    match args.format {
        TableFormat::Json => print(&json)?,
        TableFormat::Markdown => print(&markdown)?,
        TableFormat::Text => {
            print(&text(results, &tables, args.calibration))?;
        }
    }
    if let Some(looks) = looks.filter(|_| args.format != TableFormat::Json) {
        print(&fit::toml(&looks, &fit::calibration(results))?)?;
    }
    let Some(folder) = &args.output else {
        if args.format == TableFormat::Text {
            say("with -o FOLDER the rides are kept, and `tagalong view FOLDER` shows them");
        }
        return Ok(());
    };
    let shown = folder.display();
    say(&format!("the logs and tables are in {shown}; `tagalong view {shown}` shows the rides"));
    Ok(())
}

/// Returns the findings for a terminal: the causes and the scores, then the course of a single
/// ride, and finally the calibration, if requested.
fn text(results: &[Followed], tables: &[Table], calibration: bool) -> String {
    let mut parts = vec![reasons::lines(results).join("\n") + "\n"];
    let mut last = Vec::new();
    for table in tables {
        if !table.title.starts_with(table::CALIBRATION) {
            parts.push(table.text());
        } else if calibration {
            last.push(table.text());
        }
    }
    // The course of events is readable only for a single ride.
    if let [one] = results {
        parts.push(one.story.join("\n") + "\n");
    }
    parts.extend(last);
    parts.join("\n")
}

#[cfg(test)]
mod tests;
