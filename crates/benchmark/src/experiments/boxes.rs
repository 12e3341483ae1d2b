//! `tagalong boxes`: association alone, on the boxes of another detector.
//!
//! Every tracker gets exactly the same boxes, in memory and without images, so that a setting of
//! the association is tried on thousands of frames in less than a second.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::tuning::{
    Choice, Figures, Objective, Poll, Search, candidates, leave_one_out, mean, shipped, shown_value,
};
use clap::Args;
use tagalong_app::config_file::ConfigFile;
use tagalong_app::format::TableFormat;
use tagalong_app::outcome::{Ended, Failure, Outcome, make_folder, print, say, write_file};
use tagalong_app::scoring::with_remedy;
use tagalong_app::serialize::to_json;
use tagalong_app::threads::threads;
use tagalong_config::Registry;
use tagalong_eval::Tally;
use tagalong_pipeline::{Tunable, with_values};
use tagalong_report::{Cell, Row, Table};
use tagalong_trials::{
    Contender, GivenSequence, GivenTracks, TrialError, for_given_boxes, in_order,
};

/// The config that is used if none is named.
const RECORDED: &str = "configs/recorded.toml";
/// Columns of the tables: means over sequences, and figures over all boxes together.
const COLUMNS: [&str; 8] = [
    "HOTA, mean",
    "IDF1, mean",
    "MOTA, mean",
    "switches",
    "HOTA, all",
    "IDF1, all",
    "MOTA, all",
    "frames/s",
];

/// Text of `--help` after the arguments.
pub const HELP: &str = "\
A sequence is a folder with seqinfo.ini and gt/gt.txt, as in the MOTChallenge; its boxes are in
det/det.txt of the folder, or in BOXES/NAME/det.txt or BOXES/NAME.txt. No image is read.

With --leave-one-out the settings in `[tune]` of a config are chosen on all other sequences, and
scored in this one. Sequences of one place, whose names agree up to the first hyphen, are left out
together.

Examples:
  tagalong boxes MOT17/train
  tagalong boxes gt/MOT15-train --boxes sort-detections --configs configs/recorded*.toml -o out
  tagalong boxes gt/MOT15-train --boxes sort-detections --leave-one-out --budget 1000";

/// Arguments of `tagalong boxes`.
#[derive(Args, Debug)]
pub struct BoxesArgs {
    /// Folder of the sequences.
    #[arg(required_unless_present = "configs")]
    pub sequences: Option<PathBuf>,
    /// Folder of the boxes [default: det/det.txt beside the truth].
    #[arg(long, value_name = "DIR")]
    pub boxes: Option<PathBuf>,
    /// The pipelines [default: configs/recorded.toml].
    #[arg(long, num_args = 1.., value_name = "CONFIG")]
    pub configs: Vec<PathBuf>,
    /// Keep the first of several people with the same ID in a frame of a truth, and count the others.
    #[arg(long)]
    pub drop_doubled_ids: bool,
    /// Chooses settings on the other sequences.
    #[arg(long)]
    pub leave_one_out: bool,
    /// The objective: the mean of this figure over the places is maximised.
    #[arg(long, value_enum, default_value_t = Objective::HotaAndIdf1)]
    pub objective: Objective,
    /// Maximum number of settings that are tried for a pipeline: all combinations if there are no
    /// more, otherwise a sample. Those of the config are also scored, but chosen only if they are
    /// among them; with 1 only those of the config are scored.
    #[arg(long, value_name = "N", default_value_t = 100,
          value_parser = clap::value_parser!(u16).range(1..=10_000))]
    pub budget: u16,
    /// Seed of the sample.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Number of runs in parallel; it does not affect the results [default: the number of cores].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub jobs: Option<u8>,
    /// Writes the tracks to CONFIG/SEQUENCE.txt in this folder; those with the settings
    /// chosen on the other sequences to CONFIG-left-out/SEQUENCE.txt.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
}

/// A config with the settings that are tried.
struct Contestant {
    name: String,
    tunables: Vec<Tunable>,
    /// Values and their contenders, beginning with those among which the sequences choose.
    settings: Vec<(Vec<toml::Value>, Contender)>,
    /// Number of settings among which the sequences choose.
    candidates: usize,
    /// Method of the search.
    search: Search,
    /// Index of the settings of the config, which are a candidate only by chance.
    shipped: usize,
}

/// Result on one sequence.
struct Tracked {
    tracks: GivenTracks,
    tally: Tally,
    frames: usize,
}

/// Tracks the boxes and prints the tables.
///
/// # Errors
/// Configs that cannot be used give exit code 2; files that cannot be read give 1.
pub fn boxes(args: &BoxesArgs, registry: &Registry) -> Outcome {
    let (folder, configs) = folder_and_configs(args)?;
    let contestants = contestants(configs, args, registry)?;
    let mut sequences =
        GivenSequence::read_all(folder, args.boxes.as_deref()).map_err(Failure::failed)?;
    if args.drop_doubled_ids {
        drop_doubled_ids(&mut sequences);
    }
    let bench = Bench { args, registry, sequences: &sequences, places: places(&sequences) };
    let mut notes = Vec::new();
    let mut details = Vec::new();
    for contestant in &contestants {
        let shipped = vec![contestant.shipped; sequences.len()];
        let tracked = bench.track(contestant, &shipped)?;
        details.push(bench.keep_tracks(contestant.name.clone(), tracked)?);
        if args.leave_one_out {
            let (choice, figures) = bench.choose(contestant)?;
            let without: Vec<usize> =
                bench.places.iter().map(|place| choice.without[*place]).collect();
            let tracked = bench.track(contestant, &without)?;
            details.push(bench.keep_tracks(format!("{}-left-out", contestant.name), tracked)?);
            let with_all = vec![choice.with_all; sequences.len()];
            let tracked = bench.track(contestant, &with_all)?;
            details.push(bench.keep_tracks(format!("{}-with-all", contestant.name), tracked)?);
            let tried = contestant.search.words(figures, args.seed);
            notes.push(format!("{}: tried: {tried}.", contestant.name));
            notes.extend(bench.words(contestant, &choice));
        }
    }
    let title = format!("Given boxes, {} sequences", sequences.len());
    let rows = details.iter().map(|(name, tracked)| Row::ours(name, cells(tracked))).collect();
    let columns = COLUMNS.map(String::from).to_vec();
    let summary = Table { title, columns, rows, notes };
    show(&[summary, bench.details(&details)], args.format)?;
    Ok(Ended::Well)
}

/// Sequences, and the index of the place of each.
struct Bench<'a> {
    args: &'a BoxesArgs,
    registry: &'a Registry,
    sequences: &'a [GivenSequence],
    places: Vec<usize>,
}

impl Bench<'_> {
    /// Tracks each sequence with one of the settings.
    fn track(&self, contestant: &Contestant, settings: &[usize]) -> Result<Vec<Tracked>, Failure> {
        let things: Vec<(&GivenSequence, usize)> =
            self.sequences.iter().zip(settings.iter().copied()).collect();
        in_order(
            &things,
            threads(self.args.jobs),
            |(sequence, setting)| {
                let tracks = sequence.track(&contestant.settings[*setting].1, self.registry)?;
                let tally = sequence.tally(&tracks)?;
                Ok(Tracked { tracks, tally, frames: sequence.len() })
            },
            |_| {},
        )
        .map_err(|error| failed(&error))
    }

    /// Runs all settings on all sequences; returns the chosen ones, and the number of those that
    /// were tried.
    fn choose(&self, contestant: &Contestant) -> Result<(Choice, usize), Failure> {
        let places = self.places.iter().max().map_or(0, |last| last + 1);
        if places < 2 {
            let message = "one sequence is left out, so two are needed for --leave-one-out";
            return Err(Failure::usage(message));
        }
        let candidates = &contestant.settings[..contestant.candidates];
        let figures = in_order(
            candidates,
            threads(self.args.jobs),
            |(_, contender)| {
                let mut by_place: Vec<Vec<Figures>> = vec![Vec::new(); places];
                for (sequence, place) in self.sequences.iter().zip(&self.places) {
                    let tracks = sequence.track(contender, self.registry)?;
                    let scores = sequence.tally(&tracks)?.scores();
                    by_place[*place].extend(Figures::of(&scores));
                }
                Ok(by_place.iter().map(mean).collect())
            },
            |done| say_progress(done, candidates.len()),
        )
        .map_err(|error| failed(&error))?;
        let poll = Poll::of_equals(places);
        Ok((leave_one_out(&figures, self.args.objective, &poll), figures.len()))
    }

    /// Returns the chosen settings as text.
    fn words(&self, contestant: &Contestant, choice: &Choice) -> Vec<String> {
        let mut without: BTreeMap<usize, Vec<&str>> = BTreeMap::new();
        for (sequence, place) in self.sequences.iter().zip(&self.places) {
            without.entry(choice.without[*place]).or_default().push(&sequence.info.name);
        }
        let mut words = vec![format!("With all: {}.", contestant.words(choice.with_all))];
        for (setting, names) in without {
            words.push(format!("Without {}: {}.", names.join(", "), contestant.words(setting)));
        }
        words
    }

    /// Writes the tracks of a pipeline, if requested, and keeps them with its name.
    fn keep_tracks(
        &self,
        name: String,
        tracked: Vec<Tracked>,
    ) -> Result<(String, Vec<Tracked>), Failure> {
        if let Some(folder) = &self.args.output {
            let folder = folder.join(&name);
            make_folder(&folder)?;
            for (sequence, tracked) in self.sequences.iter().zip(&tracked) {
                let path = folder.join(format!("{}.txt", sequence.info.name));
                write_file(&path, tracked.tracks.text())?;
            }
        }
        Ok((name, tracked))
    }

    /// Returns HOTA and IDF1 by sequence.
    fn details(&self, all: &[(String, Vec<Tracked>)]) -> Table {
        let columns = all
            .iter()
            .flat_map(|(name, _)| ["HOTA", "IDF1"].map(|figure| format!("{figure}, {name}")));
        let rows = self.sequences.iter().enumerate().map(|(at, sequence)| {
            let cells = all.iter().flat_map(|(_, tracked)| {
                let scores = tracked[at].tally.scores();
                [percent(scores.hota), percent(scores.idf1)]
            });
            Row::ours(&sequence.info.name, cells.collect())
        });
        Table {
            title: "By sequence, %".into(),
            columns: columns.collect(),
            rows: rows.collect(),
            notes: Vec::new(),
        }
    }
}

impl Contestant {
    fn new(file: &ConfigFile, args: &BoxesArgs, registry: &Registry) -> Result<Self, Failure> {
        let (pipeline, settings) = file.pipeline(registry, None)?;
        let resolved = for_given_boxes(&pipeline.resolved(), registry).map_err(Failure::usage)?;
        let tunables = if args.leave_one_out { settings.tune } else { Vec::new() };
        if args.leave_one_out {
            file.check_tuning(registry)?;
        }
        let now = shipped(&tunables);
        let mut settings: Vec<(Vec<toml::Value>, Contender)> = Vec::new();
        for values in candidates(&tunables, args.budget.into(), args.seed) {
            let contender = contender(file, &resolved, &tunables, &values)?;
            // Each value alone is allowed, so a rejection means that the combination contradicts
            // itself.
            if values == now || contender.pipeline(registry, 1).is_ok() {
                settings.push((values, contender));
            }
        }
        let candidates = settings.len();
        if candidates == 0 {
            let why =
                format!("{}: no setting of [tune] is left, all contradict themselves", file.stem());
            return Err(Failure::usage(why));
        }
        let shipped = settings.iter().position(|(values, _)| *values == now);
        if shipped.is_none() {
            let as_is = contender(file, &resolved, &tunables, &now)?;
            settings.push((now, as_is));
        }
        let shipped = shipped.unwrap_or(settings.len() - 1);
        let search = Search::of(&tunables, args.budget.into());
        Ok(Self { name: file.stem(), tunables, settings, candidates, search, shipped })
    }

    fn words(&self, setting: usize) -> String {
        let words: Vec<String> = self
            .tunables
            .iter()
            .zip(&self.settings[setting].0)
            .map(|(tunable, value)| format!("`{}` = {}", tunable.key, shown_value(value)))
            .collect();
        if setting == self.shipped { "as shipped".to_owned() } else { words.join(", ") }
    }
}

/// Returns the failure of trackers or of their scoring, with the option that solves it.
fn failed(error: &TrialError) -> Failure {
    Failure::failed(match error {
        TrialError::Eval(error) => with_remedy(error),
        other => other.to_string(),
    })
}

/// Returns the folder of the sequences, and the configs. Since `--configs` takes all paths that
/// follow it, a folder among them is that of the sequences.
///
/// # Errors
/// A missing folder of sequences, with the command to type.
fn folder_and_configs(args: &BoxesArgs) -> Result<(&Path, &[PathBuf]), Failure> {
    if let Some(folder) = &args.sequences {
        return Ok((folder, &args.configs));
    }
    match args.configs.split_last() {
        Some((folder, configs)) if folder.is_dir() => Ok((folder, configs)),
        _ => Err(Failure::usage(
            "the folder of the sequences is missing: name it before --configs, as in `tagalong boxes \
             DIR --configs A.toml B.toml`",
        )),
    }
}

/// Keeps the first of several people with the same ID in each truth, and reports the number of the
/// others.
fn drop_doubled_ids(sequences: &mut [GivenSequence]) {
    for sequence in sequences {
        let dropped = sequence.drop_doubled_ids();
        if dropped > 0 {
            let name = &sequence.info.name;
            say(&format!(
                "note: {name}: {dropped} people are left out, because the frame has their ID already"
            ));
        }
    }
}

/// Returns the contender with these values of the tunable settings.
fn contender(
    file: &ConfigFile,
    resolved: &str,
    tunables: &[Tunable],
    values: &[toml::Value],
) -> Result<Contender, Failure> {
    let keys = tunables.iter().map(|tunable| tunable.key.as_str());
    let named: Vec<(&str, &toml::Value)> = keys.zip(values).collect();
    let text = with_values(resolved, &named).map_err(|e| Failure::usage(e.message))?;
    Ok(Contender { folder: file.folder().to_owned(), ..Contender::new(file.stem(), text) })
}

fn contestants(
    configs: &[PathBuf],
    args: &BoxesArgs,
    registry: &Registry,
) -> Result<Vec<Contestant>, Failure> {
    let default = [PathBuf::from(RECORDED)];
    let named = if configs.is_empty() { &default[..] } else { configs };
    named.iter().map(|path| Contestant::new(&ConfigFile::read(path)?, args, registry)).collect()
}

/// Returns the index of the place of each sequence: names that agree up to the first hyphen belong
/// to one place, unless all of them do.
fn places(sequences: &[GivenSequence]) -> Vec<usize> {
    let names: Vec<&str> = sequences.iter().map(|sequence| sequence.info.name.as_str()).collect();
    numbered(&names)
}

fn numbered(names: &[&str]) -> Vec<usize> {
    let mut numbers: BTreeMap<&str, usize> = BTreeMap::new();
    let mut places = Vec::new();
    for name in names {
        let next = numbers.len();
        let place = name.split('-').next().unwrap_or_default();
        places.push(*numbers.entry(place).or_insert(next));
    }
    if numbers.len() < 2 {
        return (0..names.len()).collect();
    }
    places
}

fn cells(tracked: &[Tracked]) -> Vec<Cell> {
    let figures: Vec<Figures> =
        tracked.iter().filter_map(|one| Figures::of(&one.tally.scores())).collect();
    let means = mean(&figures);
    let all = Tally::combine(tracked.iter().map(|one| &one.tally)).scores();
    let frames: usize = tracked.iter().map(|one| one.frames).sum();
    let worked_ms: f64 = tracked.iter().map(|one| one.tracks.worked_ms).sum();
    vec![
        percent(Some(means.hota)),
        percent(Some(means.idf1)),
        percent(Some(means.mota)),
        Cell::number(all.idsw as f64, 0),
        percent(all.hota),
        percent(all.idf1),
        percent(all.mota),
        Cell::number(1e3 * frames as f64 / worked_ms, 0),
    ]
}

fn percent(value: Option<f64>) -> Cell {
    Cell::number(value.unwrap_or(f64::NAN), 4).percent()
}

fn say_progress(done: usize, of: usize) {
    if done.is_multiple_of(100) {
        say(&format!("{done} of {of} settings"));
    }
}

fn show(tables: &[Table], format: TableFormat) -> Result<(), Failure> {
    match format {
        TableFormat::Text => tables.iter().try_for_each(|t| print(&format!("{}\n", t.text()))),
        TableFormat::Markdown => {
            tables.iter().try_for_each(|t| print(&format!("{}\n", t.markdown())))
        }
        TableFormat::Json => print(&to_json("the tables", tables)?),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;

    #[test]
    fn sequences_of_one_place_are_left_out_together() {
        assert_eq!(numbered(&["ETH-A", "TUD-B", "ETH-C"]), [0, 1, 0]);
        assert_eq!(numbered(&["MOT17-02", "MOT17-04"]), [0, 1], "or each alone");
    }

    #[derive(clap::Parser)]
    struct Program {
        #[command(flatten)]
        boxes: BoxesArgs,
    }

    /// Returns folder and configs of a command line, or what is said of it.
    fn parsed(line: &[&str]) -> Result<(PathBuf, Vec<PathBuf>), String> {
        let line = std::iter::once(&"boxes").chain(line);
        let args = Program::try_parse_from(line).map_err(|error| error.to_string())?.boxes;
        match folder_and_configs(&args) {
            Ok((folder, configs)) => Ok((folder.to_owned(), configs.to_vec())),
            Err(failure) => Err(failure.message),
        }
    }

    #[test]
    fn the_folder_may_stand_behind_the_configs() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().to_str().unwrap();
        let both = [PathBuf::from("a.toml"), PathBuf::from("b.toml")];
        let expected = Ok((PathBuf::from(folder), both.to_vec()));
        assert_eq!(parsed(&[folder, "--configs", "a.toml", "b.toml"]), expected);
        assert_eq!(parsed(&["--configs", "a.toml", "b.toml", folder]), expected);
        let why = parsed(&["--configs", "a.toml", "b.toml"]).unwrap_err();
        assert!(why.contains("`tagalong boxes DIR --configs A.toml B.toml`"), "{why}");
        assert!(parsed(&[]).unwrap_err().contains("SEQUENCES"));
    }
}
