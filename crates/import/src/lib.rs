//! `tagalong import`: data sets and folders of images become logs.
//!
//! Each kind is a module that reads its layout into a `Sequence`; one writer makes a log of it.
//! No other part of Tagalong knows these layouts.

mod cvat;
mod folders;
mod kitti;
mod leg_bags;
mod recorded;
mod sequence;
mod truth;
mod tum;
mod writer;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use tagalong_app::format::Format;
use tagalong_app::outcome::{
    CUT_SHORT, Ended, Failure, Outcome, make_room_for, print, say, spare, write_file,
};
use tagalong_app::signals::Signals;
use tagalong_config::PathText;

pub use self::cvat::people_of_cvat;
use self::sequence::Sequence;

/// Layout of the imported data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// A folder of the TUM RGB-D benchmark or of the Bonn RGB-D dynamic dataset: rgb.txt, depth.txt,
    /// groundtruth.txt.
    Tum,
    /// The `training` or `testing` folder of KITTI tracking; one --sequence.
    Kitti,
    /// A sequence of the MOTChallenge: seqinfo.ini and its images.
    Mot,
    /// A folder of JPEG or PNG images, in the order of their names.
    Images,
    /// The XML file of annotations made with CVAT (for video 1.1 or for images 1.1): truth for a log
    /// instead of a log.
    Cvat,
    /// An annotated bag of leg_tracker_benchmarks: truth for the bag instead of a log.
    LegTracker,
}

/// Arguments of `tagalong import`.
#[derive(Args, Debug)]
pub struct ImportArgs {
    /// Layout of the data.
    #[arg(value_enum)]
    pub kind: Kind,
    /// File or folder to import.
    pub path: PathBuf,
    /// The log to write [default: runs/NAME.mcap]; of cvat and leg-tracker the truth
    /// [default: NAME.people.csv, NAME.people-floor.csv].
    #[arg(short, long, value_name = "LOG")]
    pub output: Option<PathBuf>,
    /// Replace the log if it exists.
    #[arg(long)]
    pub overwrite: bool,
    /// kitti: number of the sequence.
    #[arg(long, value_name = "NUMBER", default_value = "0000")]
    pub sequence: String,
    /// images: images per second.
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = rate)]
    pub fps: f64,
    /// Focal length, pixels; positions in metres need it, or --view.
    #[arg(long, value_name = "PX", value_parser = focal_length)]
    pub focal: Option<f64>,
    /// Horizontal field of view, degrees; an alternative to --focal.
    #[arg(long, value_name = "DEG", conflicts_with = "focal", value_parser = angle)]
    pub view: Option<f64>,
    /// Height of the camera above the floor, m.
    #[arg(long, value_name = "M", value_parser = height)]
    pub height: Option<f64>,
    /// Downward tilt of the camera, degrees.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 0.0,
        requires = "height",
        allow_negative_numbers = true
    )]
    pub tilt: f64,
    /// images: folder of 16-bit PNG depth images, one for each image.
    #[arg(long, value_name = "DIR")]
    pub depth: Option<PathBuf>,
    /// images: metres per unit of depth.
    #[arg(long, value_name = "M", default_value_t = 0.001, requires = "depth", value_parser = positive)]
    pub depth_unit: f64,
    /// cvat: boxes are of whole bodies, of which the upper bodies are compared: writes
    /// NAME.boxes.csv.
    #[arg(long)]
    pub whole_bodies: bool,
    /// leg-tracker: topic of the annotated scans, where the bag has several.
    #[arg(long, value_name = "TOPIC")]
    pub scan: Option<String>,
    /// Output format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err("must be positive".into()) }
}

/// Highest rate of images, Hz.
pub(crate) const MAX_HZ: f64 = 1e4;

/// Parses a number up to a largest one that still makes sense.
fn up_to(text: &str, most: f64) -> Result<f64, String> {
    positive(text).and_then(|v| if v <= most { Ok(v) } else { Err(format!("at most {most}")) })
}

fn rate(text: &str) -> Result<f64, String> {
    up_to(text, MAX_HZ)
}

fn focal_length(text: &str) -> Result<f64, String> {
    up_to(text, 1e6)
}

fn height(text: &str) -> Result<f64, String> {
    up_to(text, 100.0)
}

fn angle(text: &str) -> Result<f64, String> {
    // The focal length goes to zero as the view approaches 180 degrees.
    positive(text).and_then(|v| if v < 175.0 { Ok(v) } else { Err("must be below 175".into()) })
}

/// Imports a data set.
///
/// # Errors
/// A path with unexpected content, or a file in it that cannot be read: exit code 1; a log that
/// exists or cannot be written: 2.
pub fn import(args: &ImportArgs) -> Outcome {
    let path = &args.path;
    if !path.exists() {
        return Err(Failure::failed(format!("{}: no such file or folder", path.display())));
    }
    match args.kind {
        Kind::Cvat => return cvat::import(args),
        Kind::LegTracker => return leg_bags::import(args),
        _ => {}
    }
    let log = args.output.clone().unwrap_or_else(|| default_log(args));
    let signals = Signals::listen()?;
    spare(&log, args.overwrite)?;
    if !path.is_dir() {
        let message =
            format!("{} is a file; give the folder that holds the sequence", path.display());
        return Err(Failure::failed(message));
    }
    let sequence = read(args)?;
    make_room_for(&log)?;
    writer::write(&sequence, &log, &signals).inspect_err(|_| {
        // A log without its end would pass for the whole sequence.
        let _ = std::fs::remove_file(&log);
    })?;
    beside(&sequence, &log)?;
    if let Some(signal) = signals.received() {
        say(CUT_SHORT);
        return Ok(Ended::BySignal(signal));
    }
    sequence.notes.iter().for_each(|note| say(&format!("note: {note}")));
    let images = sequence.moments.len();
    print(&match args.format {
        Format::Text => format!("{images} images are in {}\n", log.display()),
        Format::Json => {
            format!("{:#}\n", serde_json::json!({ "log": PathText(&log), "images": images }))
        }
    })?;
    Ok(Ended::Well)
}

fn read(args: &ImportArgs) -> Result<Sequence, Failure> {
    let sequence = match args.kind {
        Kind::Tum => tum::read(args)?,
        Kind::Kitti => kitti::read(args)?,
        Kind::Mot => folders::mot(args)?,
        Kind::Images => folders::images(args)?,
        Kind::Cvat | Kind::LegTracker => return Err(Failure::usage("annotations are no log")),
    };
    if sequence.moments.is_empty() {
        return Err(Failure::failed(format!("{} has no images", args.path.display())));
    }
    Ok(sequence)
}

/// Writes the truth beside the log, where `eval` and `bench` look for it, and the config that tracks
/// recorded detections.
fn beside(sequence: &Sequence, log: &Path) -> Result<(), Failure> {
    let write = |ending: &str, text: &str| {
        let path = log.with_extension(ending);
        write_file(&path, text)?;
        Ok::<_, Failure>(path)
    };
    for (ending, text) in &sequence.beside {
        say(&format!("truth is in {}", write(ending, text)?.display()));
    }
    if let Some(text) = &sequence.recorded {
        let config = write("recorded.toml", text)?;
        let config = config.display();
        let log = log.display();
        say(&format!("its detections can be tracked: tagalong run {config} {log}"));
    }
    Ok(())
}

fn default_log(args: &ImportArgs) -> PathBuf {
    let whole = args.path.canonicalize().unwrap_or_else(|_| args.path.clone());
    let name = match args.kind {
        Kind::Kitti => format!("kitti-{}", args.sequence),
        _ => whole.file_name().unwrap_or_default().to_string_lossy().into_owned(),
    };
    Path::new("runs").join(name + ".mcap")
}
