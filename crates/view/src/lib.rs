//! `tagalong view`: one run, or two side by side, as one page that needs neither a network nor a
//! server; and [`Live`], which serves the same page for a live run.
//!
//! A `recording` is read from the folder of a run; `assemble` aligns runs on one list of times;
//! `film` reads the log once for images, laser scans and trails; `truth` determines which annotated
//! people a run missed; `page` has the markup, the style, the script and the data of the page.
//!
//! ```
//! use clap::Parser as _;
//! use tagalong_config::Registry;
//! use tagalong_view::{view, ViewArgs};
//!
//! #[derive(clap::Parser)]
//! struct Cli {
//!     #[command(flatten)]
//!     args: ViewArgs,
//! }
//!
//! let cli = Cli::parse_from(["view", "runs/none"]);
//! let failure = view(&cli.args, &Registry::default()).unwrap_err();
//! assert!(failure.message.contains("runs/none"), "{}", failure.message);
//! ```

mod assemble;
mod clip;
mod film;
mod live;
mod page;
mod pictures;
mod recording;
mod rides;
mod truth;

use std::path::{Path, PathBuf};

use crate::page::data::{PageData, RunData};
use crate::page::html::{Heading, html};
use clap::Args;
use tagalong_app::missed::Rules;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, spare, write_file};
use tagalong_app::remedies::Remedies;
use tagalong_app::scoring::{TruthFile, is_of_whole_bodies};
use tagalong_config::Registry;
use tagalong_math::counted;

use crate::assemble::{run_data, stamps, times, witness};
use crate::film::Film;
use crate::recording::{FaultFacts, Recording, RideFacts, Span, Window, no_frames};
use crate::truth::PageTruth;

pub use crate::live::{Live, parse_address};

/// Arguments of `tagalong view`.
#[derive(Args, Clone, Debug)]
pub struct ViewArgs {
    /// Folder of the run, of a ride, or of many rides.
    pub run: PathBuf,
    /// Folder of another run over the same log, shown beside the first.
    pub other: Option<PathBuf>,
    /// The page [default: view.html in the folder of the run; index.html for many rides].
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace an existing page.
    #[arg(long)]
    pub overwrite: bool,
    /// The log of the run, for its images [default: its path at the time of the run].
    #[arg(long, value_name = "LOG")]
    pub log: Option<PathBuf>,
    /// The truth [default: the file beside the log, as for `bench`, or the truth in the log].
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Show frames from this time on, in seconds since the first.
    #[arg(long, value_name = "S")]
    pub from: Option<f64>,
    /// Show frames up to this time, in seconds since the first.
    #[arg(long, value_name = "S")]
    pub to: Option<f64>,
    /// Largest size of the page, in megabytes: images are made smaller, and if that is not enough,
    /// frames are left out evenly [default: 25; 6 for each of many rides].
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub max_mb: Option<u32>,
    /// Write an animation (GIF) of the pictures of `run --overlay` instead of the page.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["other", "output", "log", "truth"])]
    pub animation: Option<PathBuf>,
    /// Width of the animation, in pixels.
    #[arg(long, value_name = "PX", default_value_t = 480, requires = "animation", value_parser = clap::value_parser!(u32).range(64..=4096))]
    pub width: u32,
    /// Pictures of the animation per second of the log, shown at that rate.
    #[arg(long, value_name = "HZ", default_value_t = 8, requires = "animation", value_parser = clap::value_parser!(u32).range(1..=50))]
    pub fps: u32,
}

/// Number of frames that are read per megabyte of the page: more than fit, because a frame with one
/// track takes half a kilobyte.
const FRAMES_PER_MB: usize = 2000;

/// Default size of the page of a run, MB.
const PAGE_MB: u32 = 25;

/// Name of the page in the folder of a run.
const PAGE: &str = "view.html";

impl ViewArgs {
    fn folders(&self) -> impl Iterator<Item = &PathBuf> {
        [Some(&self.run), self.other.as_ref()].into_iter().flatten()
    }

    /// Reads the runs, which must be of the same log.
    fn recordings(&self) -> Result<Vec<Recording>, Failure> {
        let window = self.window()?;
        let read = self.folders().map(|folder| Recording::read(folder, &window));
        let runs: Vec<Recording> = read.collect::<Result<_, _>>()?;
        check_same_log(&runs)?;
        Ok(runs)
    }

    fn window(&self) -> Result<Window, Failure> {
        let span = Span { from_s: self.from, to_s: self.to };
        Window::of(self.folders(), span, self.megabytes() * FRAMES_PER_MB)
    }

    fn megabytes(&self) -> usize {
        self.max_mb.unwrap_or(PAGE_MB) as usize
    }
}

/// Examples for `tagalong view --help`.
pub const HELP: &str = "\
The page has a time line, the images with boxes, IDs and trails, a plan from above, the funnel of each
frame and a list of events. A click on an image shows which tests dropped candidates there, and the
settings that decide these tests. The page is one file and works offline.

Examples:
  tagalong run robot.mcap && tagalong view runs/robot-depth-verified
  tagalong view runs/robot-depth-verified runs/robot-depth-ekf -o compare.html
  tagalong view runs/robot-depth-verified --from 30 --to 60 --max-mb 50
  tagalong follow configs/follow-depth.toml -o rides && tagalong view rides
  tagalong view runs/robot-depth-verified --log /data/robot.mcap --truth robot.people.csv
  tagalong view runs/robot-depth-verified --from 30 --to 36 --animation clip.gif    (after run --overlay)";

/// Writes the page of one or two runs.
///
/// # Errors
/// A folder that is not a run, two runs of different logs, a log or a truth that the user named and
/// that cannot be used, or an existing file with the name given with `-o`.
pub fn view(args: &ViewArgs, registry: &Registry) -> Outcome {
    if let Some(file) = &args.animation {
        return clip::write(args, file);
    }
    let remedies = Remedies::new(registry);
    if rides::is_folder_of_rides(&args.run) {
        return rides::view_rides(args, &remedies);
    }
    let args = ViewArgs { run: rides::run_of(&args.run), ..args.clone() };
    let output = args.output.clone().unwrap_or_else(|| args.run.join(PAGE));
    let runs = args.recordings()?;
    // The page in the folder of a run only depends on that folder, and may be overwritten.
    if args.output.is_some() {
        spare(&output, args.overwrite)?;
    }
    let page = Page::of(&runs, &args, &remedies)?;
    write_file(&output, &page.text)?;
    let shown = output.display();
    let megabytes = page.text.len() as f64 / 1e6;
    let frames = counted(page.frames, "frame");
    let mut said = format!("{shown}: {frames}, {megabytes:.1} MB\n");
    page.notes.iter().for_each(|note| said += &format!("  {note}\n"));
    print(&(said + "open it in a browser; it needs no network\n"))?;
    Ok(Ended::Well)
}

fn check_same_log(runs: &[Recording]) -> Result<(), Failure> {
    let [one, other] = runs else { return Ok(()) };
    if one.report.log.sha256 == other.report.log.sha256 {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "the runs are of different logs, {} and {}, but two runs are compared frame by frame: run \
         both pipelines on one log",
        one.report.log.name, other.report.log.name
    )))
}

/// Finished page.
struct Page {
    text: String,
    frames: usize,
    notes: Vec<String>,
}

impl Page {
    fn of(runs: &[Recording], args: &ViewArgs, remedies: &Remedies) -> Result<Self, Failure> {
        let mut notes = Vec::new();
        let all = stamps(runs);
        if all.is_empty() {
            return Err(no_frames(runs));
        }
        let budget = args.megabytes() * 1_000_000;
        let (stamps, run_data) = thinned(runs, all, budget / 2, remedies, &mut notes);
        let mut data = PageData {
            t: times(&stamps),
            image_px: image_size(runs),
            runs: run_data,
            ..PageData::default()
        };
        name_apart(&mut data.runs, runs);
        let left = budget.saturating_sub(length_of(&data));
        add_log(&mut data, runs, &stamps, (args, remedies), left, &mut notes)?;
        let heading = heading(runs, &data, &notes);
        let text = html(&heading, &data).map_err(Failure::failed)?;
        Ok(Self { text, frames: data.t.len(), notes })
    }
}

/// Describes the runs of a page.
fn heading(runs: &[Recording], data: &PageData, notes: &[String]) -> Heading {
    let log = runs.first().map(|run| run.report.log.name.clone()).unwrap_or_default();
    let described = runs.iter().zip(&data.runs).map(|(run, shown)| {
        let frames = counted(shown.frames.iter().flatten().count(), "frame");
        let name = &shown.name;
        let folder = run.folder.display();
        format!("{name}: {frames}, {}, from {folder}", run.report.ended)
    });
    let rides = runs.iter().filter_map(|run| run.report.ride.as_ref());
    let mut lines: Vec<String> = described.chain(rides.map(RideFacts::summary)).collect();
    for run in runs.iter().filter(|run| !run.report.faults.is_empty()) {
        let faults: Vec<String> = run.report.faults.iter().map(FaultFacts::in_words).collect();
        lines.push(format!("{}: injected faults: {}", run.config_name(), faults.join("; ")));
    }
    Heading { log, runs: lines, notes: notes.to_vec() }
}

/// Returns the frames of the runs, or every second or third one if the page would be too large.
fn thinned(
    runs: &[Recording],
    all: Vec<u64>,
    bytes: usize,
    remedies: &Remedies,
    notes: &mut Vec<String>,
) -> (Vec<u64>, Vec<RunData>) {
    let whole: Vec<RunData> = runs.iter().map(|run| run_data(run, &all, remedies)).collect();
    let length: usize = whole.iter().map(length_of).sum();
    let step = length.div_ceil(bytes.max(1)).max(1);
    let every = step as u64 * runs.iter().map(|run| run.every).max().unwrap_or(1);
    if every > 1 {
        notes.push(format!(
            "one frame in {every} is shown, so that the page stays small; --from and --to show all \
             of a part"
        ));
    }
    if step == 1 {
        return (all, whole);
    }
    let kept: Vec<u64> = all.iter().copied().step_by(step).collect();
    let data = runs.iter().map(|run| run_data(run, &kept, remedies)).collect();
    (kept, data)
}

fn length_of<T: serde::Serialize>(data: &T) -> usize {
    serde_json::to_string(data).map_or(0, |text| text.len())
}

/// Returns the size of the image in which boxes are given.
fn image_size(runs: &[Recording]) -> [usize; 2] {
    let mut moments = runs.iter().flat_map(|run| &run.moments);
    moments.find(|m| m.notes.image_px[0] > 0).map_or([0, 0], |m| m.notes.image_px)
}

/// Names runs of the same config after their folders.
fn name_apart(data: &mut [RunData], runs: &[Recording]) {
    let are_alike = data.len() == 2 && data[0].name == data[1].name;
    for (run, recording) in data.iter_mut().zip(runs).filter(|_| are_alike) {
        run.name = recording.folder.display().to_string();
    }
}

/// Adds the data of the log: images, scans, trails, and the truth.
fn add_log(
    data: &mut PageData,
    runs: &[Recording],
    stamps: &[u64],
    (args, remedies): (&ViewArgs, &Remedies),
    image_bytes: usize,
    notes: &mut Vec<String>,
) -> Result<(), Failure> {
    let Some(first) = runs.first() else { return Ok(()) };
    let source = match film::open(first, args.log.as_deref())? {
        Ok(source) => source,
        Err(why) => {
            notes.push(why);
            return Ok(());
        }
    };
    let log = source.facts().path.clone();
    let film = Film::of(source, stamps, &mut data.runs, runs, image_bytes);
    notes.extend(film.pictures.summary());
    data.scans = film.scans();
    data.view_rad = film.view_rad;
    if let Some(truth) = read_truth(args, (&log, &first.report.log.name), &film, stamps, notes)? {
        for (run, recording) in data.runs.iter_mut().zip(runs) {
            let witness = witness(recording, stamps, &film.depths);
            let rules = Rules { remedies, config: &recording.config };
            // A contradiction is a fault of the truth, without which the page is still useful.
            if let Err(why) = truth.judge(&data.t, data.image_px, run, (&witness, rules)) {
                notes.push(format!("{} is not compared with the truth: {why}", run.name));
            }
        }
        data.truth = Some(truth.frames);
    }
    data.images = film.pictures.into_images();
    Ok(())
}

fn read_truth(
    args: &ViewArgs,
    (log, log_name): (&Path, &str),
    film: &Film,
    stamps: &[u64],
    notes: &mut Vec<String>,
) -> Result<Option<PageTruth>, Failure> {
    let named = args.truth.clone().map(|path| {
        let is_whole = is_of_whole_bodies(&path);
        (path, is_whole)
    });
    let Some((path, is_whole)) = named.or_else(|| TruthFile::beside(log).ok().flatten()) else {
        return Ok(None);
    };
    // Truth that was found beside the log has its name.
    let named_log = args.truth.as_ref().map(|_| log_name);
    let truth = PageTruth::read(&path, is_whole, named_log, &film.shots, stamps)?;
    notes.extend(truth.signs.iter().cloned());
    if !truth.has_people() {
        notes.push(format!("{} has nobody in the frames shown", path.display()));
        return Ok(None);
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    notes.push(format!("truth: {name}"));
    Ok(Some(truth))
}
