//! `tagalong trials`: pipelines on many random variants of the same scenes.

mod contest;
mod table;

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use tagalong_app::config_file::ConfigFile;
use tagalong_app::format::TableFormat;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, say};
use tagalong_app::progress::Forecast;
use tagalong_app::serialize::to_json;
use tagalong_app::threads::threads;
use tagalong_config::Registry;
use tagalong_sim::{Scene, Seeds, Split, Variant};
use tagalong_trials::Contender;

use crate::experiments::contender::{contender, unsuited};

/// Scenes on which no pipeline should be perfect.
const HARD: [&str; 6] = [
    "crossing-parallel",
    "crossing-oblique",
    "crossing-three",
    "full-occlusion",
    "following",
    "crowd",
];

/// Pipelines that are compared if none are named.
const PIPELINES: [&str; 2] = ["depth-ekf", "naive"];

/// Arguments of `tagalong trials`.
#[derive(Args, Debug)]
pub struct TrialsArgs {
    /// The scenes [default: the hard ones of configs/scenes].
    pub scenes: Vec<PathBuf>,
    /// The pipelines; the last one is the baseline of the others [default:
    /// depth-ekf, naive].
    #[arg(long, num_args = 1.., value_name = "CONFIG")]
    pub configs: Vec<PathBuf>,
    /// The split that the seeds belong to; settings are chosen on `validation`.
    #[arg(long, value_name = "SPLIT", default_value = "test")]
    pub split: Split,
    /// Replaces a value in each scene: a dotted key, like `crowd=5`.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = tagalong_simulate::key_and_value)]
    pub set: Vec<(String, String)>,
    /// Simulates each scene with this many seeds of the split.
    #[arg(long, value_name = "N", default_value_t = 10,
          value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub seeds: u64,
    /// The first of these seeds, counted within the split: another one gives other random variants.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub first_seed: u64,
    /// Number of trials in parallel; it does not affect the results [default: the number of cores].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub jobs: Option<u8>,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
}

/// Runs the trials and prints the table.
///
/// # Errors
/// Scenes and configs that cannot be used give exit code 2; plugins that fail give 1.
pub fn trials(args: &TrialsArgs, registry: &Registry) -> Outcome {
    let seeds = args.split.seeds(args.first_seed, args.seeds).map_err(Failure::usage)?;
    let contenders = contenders(&args.configs, registry)?;
    let scenes = or_default(&args.scenes, "configs/scenes", &HARD);
    let suites =
        scenes.iter().map(|path| suite(path, args, seeds)).collect::<Result<Vec<_>, _>>()?;
    for contender in &contenders {
        let suits = contender.pipeline(registry, 0).map_err(Failure::usage)?.config().suits;
        let all = suites
            .iter()
            .flat_map(|(name, scenes)| scenes.iter().map(|scene| (name.as_str(), scene)));
        if let Some(note) = unsuited(&contender.name, &suits, all) {
            say(&format!("note: {note}"));
        }
    }
    let trials = suites.iter().map(|(_, scenes)| scenes.len()).sum();
    let bar = bar(trials);
    let forecast = Forecast::new(trials, "trials");
    let names = suites.iter().map(|(name, _)| name);
    let mut table = table::Table::new(seeds, names, contenders.iter().map(|c| &c.name));
    let is_text = args.format == TableFormat::Text;
    if is_text {
        bar.suspend(|| print(&table.header()))?;
    }
    for (name, scenes) in &suites {
        bar.set_message(name.clone());
        let jobs = threads(args.jobs);
        let results = contest::run(scenes, &contenders, registry, jobs, || {
            bar.inc(1);
            forecast.advance();
        });
        let results = results.map_err(Failure::failed)?;
        table.add(name, &contenders, &results);
        if is_text {
            bar.suspend(|| print(&table.last_rows()))?;
        }
    }
    bar.finish_and_clear();
    match args.format {
        TableFormat::Text => print(&table.summary())?,
        TableFormat::Markdown => print(&format!("{}\n", table.page().markdown()))?,
        TableFormat::Json => print(&to_json("the table", &table)?)?,
    }
    Ok(Ended::Well)
}

fn or_default(named: &[PathBuf], folder: &str, names: &[&str]) -> Vec<PathBuf> {
    if named.is_empty() {
        return names.iter().map(|name| Path::new(folder).join(format!("{name}.toml"))).collect();
    }
    named.to_vec()
}

/// Reads configs for trials.
///
/// # Errors
/// A config that cannot be read or built.
pub fn contenders(named: &[PathBuf], registry: &Registry) -> Result<Vec<Contender>, Failure> {
    let paths = or_default(named, "configs", &PIPELINES);
    let mut contenders = Vec::new();
    for path in &paths {
        let file = ConfigFile::read(path)?;
        // Built once in advance, so that an error shows before the first trial.
        file.pipeline(registry, None)?;
        contenders.push(contender(&file));
    }
    Ok(contenders)
}

/// Returns a scene with each of the seeds.
fn suite(path: &Path, args: &TrialsArgs, seeds: Seeds) -> Result<(String, Vec<Scene>), Failure> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let scenes = seeds.numbers().map(|seed| {
        let set = args.set.clone();
        let variant = Variant { seed: Some(seed), split: Some(args.split), set };
        tagalong_simulate::read(path, &variant)
    });
    Ok((name, scenes.collect::<Result<_, _>>()?))
}

fn bar(trials: usize) -> ProgressBar {
    let bar = ProgressBar::new(trials as u64);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} trials {msg} {eta}") {
        bar.set_style(style);
    }
    bar
}
