//! `tagalong-papers reproduce`: the tables of a published system beside ours.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use tagalong_app::format::TableFormat;
use tagalong_app::outcome::{Ended, Failure, Outcome, make_folder, print, say, write_file};
use tagalong_app::serialize::to_json;
use tagalong_app::threads::threads;
use tagalong_config::Registry;
use tagalong_report::Table;
use tagalong_sim::Split;

use crate::findings::{Experiment, ExperimentFindings, System};
use crate::lab::{Lab, Progress, SimulatedScenes};
use crate::systems::{SYSTEMS, system};

/// Arguments of `tagalong-papers reproduce`.
#[derive(Args, Debug)]
pub struct ReproduceArgs {
    /// The published system; without one, lists the systems and their tables.
    pub system: Option<String>,
    /// Only these of its tables and figures.
    #[arg(long, num_args = 1.., value_name = "NAME")]
    pub only: Vec<String>,
    /// A minute's version: fewer variants, wider intervals.
    #[arg(long)]
    pub quick: bool,
    /// Simulates each scene with this many seeds of the test split.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub seeds: Option<u64>,
    /// The first of these seeds, counted within the split: another one gives the tables of other
    /// random variants.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub first_seed: u64,
    /// Trials that run at once; apart from times, the results are the same
    /// [default: as many as there are cores].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub jobs: Option<u8>,
    /// The folder with the configs and scenes.
    #[arg(long, value_name = "DIR", default_value = "configs")]
    pub configs: PathBuf,
    /// The folder with the configs of printed forms and of single steps of a paper.
    #[arg(long, value_name = "DIR", default_value = "benches/papers/configs")]
    pub printed_configs: PathBuf,
    /// The folder with real logs and labelled images; experiments that need them are left out where
    /// there is none.
    #[arg(long, value_name = "DIR", default_value = "../shared/data")]
    pub data: PathBuf,
    /// Writes the tables (JSON, Markdown) and pictures (SVG) to this folder.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
}

/// Examples of the command.
pub const HELP: &str = "\
Everything is simulated with seeds of the test split. The whole of a system takes minutes to an hour.

Examples:
  tagalong-papers reproduce
  tagalong-papers reproduce stereo-svm-ekf --quick
  tagalong-papers reproduce stereo-svm-ekf --only occlusion --format json
  tagalong-papers reproduce stereo-svm-ekf -o tables";

/// Runs the experiments and prints their tables.
///
/// # Errors
/// Unknown names and unreadable configs are exit code 2; plugins that fail are 1.
pub fn reproduce(args: &ReproduceArgs, registry: &Registry) -> Outcome {
    let Some(name) = &args.system else { return list(args.format) };
    let system = system(name).ok_or_else(|| unknown(name, SYSTEMS.iter().map(|s| s.name)))?;
    let experiments = chosen(system, &args.only)?;
    // Checked first: a split has a limited number of seeds.
    Split::Test.seeds(args.first_seed, args.seeds.unwrap_or(1)).map_err(Failure::usage)?;
    // Before the work of an hour, not after it.
    args.output.as_deref().map_or(Ok(()), make_folder)?;
    let bar = Bar::new();
    let lab = lab(args, registry, &bar);
    let mut all = Vec::new();
    for experiment in experiments {
        let found = experiment.find(&lab).map_err(Failure::failed)?;
        bar.clear();
        show(&found.findings.tables, args.format)?;
        all.push(found);
    }
    if let Some(folder) = &args.output {
        write(folder, &all)?;
    }
    if args.format == TableFormat::Json {
        print(&json(&all)?)?;
    }
    Ok(Ended::Well)
}

fn lab<'a>(args: &ReproduceArgs, registry: &'a Registry, progress: &'a Bar) -> Lab<'a> {
    Lab {
        registry,
        configs: args.configs.clone(),
        printed_configs: args.printed_configs.clone(),
        data: args.data.is_dir().then(|| args.data.clone()),
        quick: args.quick,
        seeds: args.seeds,
        first_seed: args.first_seed,
        simulated: SimulatedScenes::default(),
        jobs: threads(args.jobs),
        progress,
    }
}

fn list(format: TableFormat) -> Outcome {
    fn names(system: &System) -> Vec<&str> {
        system.experiments.iter().map(|experiment| experiment.name).collect()
    }

    if format == TableFormat::Json {
        let all: Vec<_> = SYSTEMS.iter().map(|system| (system.name, names(system))).collect();
        print(&to_json("the list of systems", &all)?)?;
        return Ok(Ended::Well);
    }
    for system in SYSTEMS {
        print(&format!("{}  {}\n", system.name, system.about))?;
        for Experiment { name, about, .. } in system.experiments {
            print(&format!("  {name:<16} {about}\n"))?;
        }
    }
    Ok(Ended::Well)
}

/// Returns the requested experiments, in the order of the system.
fn chosen(system: &System, only: &[String]) -> Result<Vec<&'static Experiment>, Failure> {
    let all = system.experiments;
    if let Some(name) = only.iter().find(|name| all.iter().all(|known| known.name != **name)) {
        return Err(unknown(name, all.iter().map(|experiment| experiment.name)));
    }
    Ok(all.iter().filter(|e| only.is_empty() || only.iter().any(|name| name == e.name)).collect())
}

fn unknown(name: &str, known: impl Iterator<Item = &'static str>) -> Failure {
    let known: Vec<&str> = known.collect();
    Failure::usage(format!("nothing is called `{name}`; there are: {}", known.join(", ")))
}

fn show(tables: &[Table], format: TableFormat) -> Result<(), Failure> {
    tables.iter().try_for_each(|table| match format {
        TableFormat::Text => print(&format!("{}\n", table.text())),
        TableFormat::Markdown => print(&format!("{}\n", table.markdown())),
        TableFormat::Json => Ok(()),
    })
}

fn json(all: &[ExperimentFindings]) -> Result<String, Failure> {
    to_json("the tables", all)
}

fn write(folder: &Path, all: &[ExperimentFindings]) -> Result<(), Failure> {
    let tables = all.iter().flat_map(|found| &found.findings.tables);
    let pages: Vec<String> = tables.map(Table::markdown).collect();
    write_file(&folder.join("tables.json"), &json(all)?)?;
    write_file(&folder.join("tables.md"), pages.join("\n"))?;
    for picture in all.iter().flat_map(|found| &found.findings.pictures) {
        write_file(&folder.join(format!("{}.svg", picture.name)), &picture.svg)?;
    }
    say(&format!("the tables and pictures are in {}", folder.display()));
    Ok(())
}

/// Progress bar that starts anew with each experiment; hidden without a terminal.
struct Bar(ProgressBar);

impl Bar {
    fn new() -> Self {
        let bar = ProgressBar::new(0);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} {msg} {eta}") {
            bar.set_style(style);
        }
        Self(bar)
    }

    fn clear(&self) {
        self.0.finish_and_clear();
    }
}

impl Progress for Bar {
    fn begin(&self, steps: usize, what: &str) {
        self.0.reset();
        self.0.set_length(steps as u64);
        self.0.set_message(what.to_owned());
    }

    fn step(&self) {
        self.0.inc(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::{Findings, Picture};

    fn system() -> &'static System {
        &SYSTEMS[0]
    }

    #[test]
    fn all_experiments_unless_some_are_named() {
        let all = chosen(system(), &[]).unwrap();
        assert_eq!(all.len(), system().experiments.len());
        let first = all[0].name.to_owned();
        assert_eq!(chosen(system(), std::slice::from_ref(&first)).unwrap()[0].name, first);
    }

    #[test]
    fn an_unknown_name_is_answered_with_those_there_are() {
        let failure = chosen(system(), &["alchemy".to_owned()]).unwrap_err();
        assert_eq!(failure.code, 2);
        assert!(failure.message.contains(system().experiments[0].name), "{}", failure.message);
    }

    #[test]
    fn seeds_that_the_split_does_not_have_and_unknown_systems_are_refused() {
        fn refusal(line: &str) -> Failure {
            let line = <Line as clap::Parser>::parse_from(line.split(' '));
            reproduce(&line.args, &Registry::default()).unwrap_err()
        }

        #[derive(clap::Parser)]
        struct Line {
            #[command(flatten)]
            args: ReproduceArgs,
        }
        let failure = refusal("reproduce stereo-ekf --seeds 2 --first-seed 999999999");
        assert!(failure.code == 2 && failure.message.contains("the split"), "{failure:?}");
        let failure = refusal("reproduce stereo-smv-ekf");
        assert!(failure.code == 2 && failure.message.contains("stereo-svm-ekf"), "{failure:?}");
    }

    #[test]
    fn files_hold_tables_and_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let table = Table { title: "A table".into(), ..Table::default() };
        let picture = Picture { name: "plot".into(), svg: "<svg/>".into() };
        let findings = Findings { tables: vec![table], pictures: vec![picture] };
        let found = ExperimentFindings { experiment: "one", simulated: Vec::new(), findings };
        write(folder.path(), &[found]).unwrap();
        let [page, json, plot] = ["tables.md", "tables.json", "plot.svg"]
            .map(|name| std::fs::read_to_string(folder.path().join(name)).unwrap());
        assert!(page.contains("**A table**"), "{page}");
        assert!(json.contains("\"experiment\": \"one\""), "{json}");
        assert_eq!(plot, "<svg/>");
    }
}
