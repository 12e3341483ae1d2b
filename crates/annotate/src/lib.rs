//! `tagalong annotate`: annotates the people in a log.
//!
//! A pipeline processes the log once and proposes tracks, while `film` stores images and depth.
//! Then `server` serves one page, on this computer only: the page shows a frame and requests
//! changes, `document` makes and undoes them, and `session` measures positions with depth and
//! writes the complete file after each change. The page has no logic of its own, so that everything
//! can be tested without a browser.
//!
//! ```
//! use clap::Parser as _;
//! use tagalong_config::Registry;
//! use tagalong_annotate::{annotate, AnnotateArgs};
//!
//! #[derive(clap::Parser)]
//! struct Cli {
//!     #[command(flatten)]
//!     args: AnnotateArgs,
//! }
//!
//! let cli = Cli::parse_from(["annotate", "none.mcap", "--empty"]);
//! let failure = annotate(&cli.args, &Registry::default()).unwrap_err();
//! assert_eq!(failure.code, 1);
//! assert!(failure.message.contains("none.mcap"), "{}", failure.message);
//! ```

mod document;
mod film;
mod person;
mod server;
mod session;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use clap::Args;
use tagalong_app::choice::fitting;
use tagalong_app::config_file::ConfigFile;
use tagalong_app::input_args::InputArgs;
use tagalong_app::lacking::Lacking;
use tagalong_app::outcome::{Ended, Failure, Outcome, make_room_for, print, say};
use tagalong_app::progress::Progress;
use tagalong_app::scoring::annotated_file;
use tagalong_app::signals::Signals;
use tagalong_app::suggest::check_log_path;
use tagalong_config::Registry;
use tagalong_eval::Region;
use tagalong_log::{FrameSource, Input, Inputs, LogFrame};
use tagalong_math::counted;
use tagalong_pipeline::{FrameReport, Pipeline};
use tagalong_render::background;
use tagalong_serve::{Access, Changes, Server};

use crate::film::Film;
use crate::person::{Person, sparse};
use crate::server::App;
use crate::session::{Session, read_people};

/// Longest time without a detection over which a proposed person is assumed to be present, s.
const BRIDGED_S: f64 = 2.0;

/// Least number of detections of a proposed person.
const LEAST_DETECTIONS: usize = 3;

/// Arguments of `tagalong annotate`.
#[derive(Args, Debug)]
pub struct AnnotateArgs {
    /// The log.
    pub log: PathBuf,
    /// Pipeline that proposes tracks: a config, or the name of a built-in one [default: the one for
    /// the sensors in the log].
    pub config: Option<PathBuf>,
    /// The file to write or to continue [default: LOG.people.csv].
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Port of the page on this computer; 0 selects a free one.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port: u16,
    /// Start without proposed tracks.
    #[arg(long)]
    pub empty: bool,
}

/// Examples for `tagalong annotate --help`.
pub const HELP: &str = "\
Opens a page for your browser on this computer; no data leaves it. A pipeline proposes tracks; if the
file exists, its annotation is continued instead. To compare pipelines start with --empty, or review
every frame (R), because truth that a pipeline proposed favours it. Click a head or drag a box; a digit
sets the ID of the person; boxes between two that you set are interpolated; depth gives the positions.
The whole file is written after every change, so a kill loses nothing. `Finish` in the page ends with
exit code 0, Ctrl-C with 130; the file is valid in both cases. `eval`, `bench` and `view` find it
beside the log.

Examples:
  tagalong annotate robot.mcap
  tagalong annotate robot.mcap depth-ekf -o robot.people.csv --port 8080
  tagalong annotate robot.mcap --empty
  ssh -L 8080:127.0.0.1:8080 robot tagalong annotate robot.mcap --port 8080    (log on another computer)";

/// Serves the page until it is finished, or a signal comes.
///
/// # Errors
/// A log or a config that cannot be used, a log without images, a file that cannot be continued or
/// written, or a port that is in use.
pub fn annotate(args: &AnnotateArgs, registry: &Registry) -> Outcome {
    let signals = Signals::listen()?;
    check_log_path(&args.log)?;
    let output = args.output.clone().unwrap_or_else(|| annotated_file(&args.log));
    check_writable(&output)?;
    let access = Access::loopback(args.port).with_changes(Changes::FromPage);
    let server = Server::open(access).map_err(|error| {
        let port = args.port;
        Failure::usage(format!("cannot listen on port {port}: {error}; choose another with --port"))
    })?;
    let continues = output.exists();
    let material = Material::of(args, registry, continues || args.empty, &signals)?;
    if let Some(signal) = signals.received() {
        return Ok(Ended::BySignal(signal));
    }
    let film = Arc::new(material.film);
    let people = if continues {
        read_people(&output, &film).map_err(Failure::failed)?
    } else {
        material.people
    };
    let origin = if continues {
        "the annotation in the file is continued".to_owned()
    } else {
        material.origin
    };
    say(&origin);
    let app = app(args, film, people, &output, origin);
    print(&format!(
        "{}\nopen this address in a browser on this computer; anyone with the address can \
         edit\nevery change is written to {}; Ctrl-C ends\n",
        server.address(),
        output.display()
    ))?;
    server.serve(&app, || signals.received().is_some() || app.finished.load(Ordering::Relaxed));
    if !app.finished.load(Ordering::Relaxed) {
        if !output.exists() {
            say(&format!(
                "nothing was changed, so {} is not written; `Finish` in the page accepts the \
                 proposed boxes as they are",
                output.display()
            ));
        }
        return Ok(signals.received().map_or(Ended::Well, Ended::BySignal));
    }
    let shown = output.display();
    say(&format!("finished: `tagalong eval --truth {shown} --tracks RUN` scores a run with it"));
    Ok(Ended::Well)
}

fn app(
    args: &AnnotateArgs,
    film: Arc<Film>,
    people: BTreeMap<i64, Person>,
    output: &Path,
    origin: String,
) -> Arc<App> {
    let mut session = Session::new(Arc::clone(&film), people, output.to_owned());
    let progress = Progress::titled("places");
    session.measure(|share, number| progress.advance(share, u64::from(number)));
    Arc::new(App {
        film,
        session: Mutex::new(session),
        log: args.log.clone(),
        origin,
        finished: AtomicBool::new(false),
    })
}

/// Refuses a file that could not be written, before the user spends an hour on the annotation.
fn check_writable(output: &Path) -> Result<(), Failure> {
    make_room_for(output)?;
    let shown = output.display();
    if output.is_dir() {
        return Err(Failure::usage(format!("{shown} is a folder; name a file with -o")));
    }
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty());
    tempfile::tempfile_in(folder.unwrap_or(Path::new("."))).map_err(|error| {
        Failure::usage(format!("cannot write {shown}: {error}; choose another file with -o"))
    })?;
    Ok(())
}

/// Everything that one pass over the log yields.
struct Material {
    film: Film,
    people: BTreeMap<i64, Person>,
    origin: String,
}

impl Material {
    fn of(
        args: &AnnotateArgs,
        registry: &Registry,
        only_images: bool,
        signals: &Signals,
    ) -> Result<Self, Failure> {
        let named = args.config.as_deref().map(ConfigFile::read).transpose()?;
        let config = match (named, only_images) {
            (Some(config), _) => Some(config),
            (None, true) => None,
            // Without a pipeline that fits, the people are set by hand.
            (None, false) => {
                let found = fitting(&args.log, registry, &InputArgs::default(), 1);
                found.fitting.into_iter().next().map(|found| found.config)
            }
        };
        let outer = config.as_ref().map(ConfigFile::outer).transpose()?.unwrap_or_default();
        let proposing = config.filter(|_| !only_images);
        let mut pipeline = match &proposing {
            Some(config) => Some(config.pipeline(registry, None)?.0),
            None => None,
        };
        let inputs = pipeline.as_ref().map_or(Inputs::NONE, Pipeline::inputs);
        let inputs = inputs.accept(Input::Colour).accept(Input::Depth);
        let mut source = FrameSource::open(&args.log, &outer.input, &outer.limits, inputs)?;
        let mut pass = Pass::new()?;
        let mut lacking = Lacking::default();
        let progress = Progress::new();
        while let Some(item) = source.next_frame() {
            if signals.received().is_some() {
                break;
            }
            let report = match &mut pipeline {
                Some(pipeline) => lacking.step(pipeline, &item.frame).map_err(Failure::failed)?,
                None => None,
            };
            pass.take(&item, report.as_ref())?;
            progress.advance(source.progress(), item.frame.index);
        }
        if let Some(error) = lacking.failure() {
            return Err(Failure::failed(error));
        }
        for warning in lacking.warnings() {
            say(&format!("warning: {warning}; no boxes are proposed there"));
        }
        let proposer = proposing.as_ref().map(ConfigFile::stem).unwrap_or_default();
        let Pass { film, tracks, .. } = pass;
        check_images(&args.log, &film)?;
        let short = tracks.values().filter(|boxes| boxes.len() < LEAST_DETECTIONS).count();
        let people = proposals(&film, tracks, &proposer);
        let origin = match &proposing {
            Some(_) => format!("the boxes are proposed by {proposer}{}", hidden(short)),
            None => "no boxes are proposed".to_owned(),
        };
        Ok(Self { film, people, origin })
    }
}

fn check_images(log: &Path, film: &Film) -> Result<(), Failure> {
    let has_images = film.shots().iter().any(|shot| !shot.camera.is_blind());
    if has_images {
        return Ok(());
    }
    let log = log.display();
    Err(Failure::failed(format!(
        "{log}: no image to annotate people in; `tagalong inspect {log}` lists its topics, and \
         [input] of a config selects them"
    )))
}

/// Boxes of the tracks by their IDs.
type Boxes = BTreeMap<u32, Vec<(u32, Region)>>;

/// Pass over the log.
struct Pass {
    film: Film,
    tracks: Boxes,
    first_ns: Option<u64>,
}

impl Pass {
    fn new() -> Result<Self, Failure> {
        let film = Film::new().map_err(no_room)?;
        Ok(Self { film, tracks: Boxes::new(), first_ns: None })
    }

    fn take(&mut self, item: &LogFrame, report: Option<&FrameReport>) -> Result<(), Failure> {
        let frame = &item.frame;
        let number = u32::try_from(frame.index).unwrap_or(u32::MAX);
        let first_ns = *self.first_ns.get_or_insert(frame.stamp.nanos());
        let t_s = frame.stamp.nanos().saturating_sub(first_ns) as f64 * 1e-9;
        let image = background(&frame.images());
        let depth = frame.depth().ok();
        self.film.push(number, t_s, &frame.camera, image.as_ref(), depth).map_err(no_room)?;
        let tracks = report.iter().flat_map(|report| &report.tracks);
        for track in tracks.filter(|track| track.confirmed && track.seen) {
            let at = &track.estimate.region;
            let region = Region { x: at.x, y: at.y, width: at.width, height: at.height };
            let is_inside = at.clipped(frame.camera.width, frame.camera.height).area() > 0.0;
            if is_inside {
                self.tracks.entry(track.id.0).or_default().push((number, region));
            }
        }
        Ok(())
    }
}

fn no_room(error: std::io::Error) -> Failure {
    let folder = std::env::temp_dir();
    Failure::failed(format!(
        "cannot keep the images in {}: {error}; TMPDIR names another folder",
        folder.display()
    ))
}

/// Reports the number of tracks that are too short to be proposed.
fn hidden(short: usize) -> String {
    if short == 0 {
        return String::new();
    }
    format!(", without {} of fewer than {LEAST_DETECTIONS} detections", counted(short, "track"))
}

/// Returns people with few keys from the boxes of tracks, with IDs from 1 in the order of
/// appearance.
fn proposals(film: &Film, tracks: Boxes, proposer: &str) -> BTreeMap<i64, Person> {
    let mut tracks: Vec<_> = tracks.into_values().collect();
    tracks.retain(|boxes| boxes.len() >= LEAST_DETECTIONS);
    tracks.sort_by_key(|boxes| boxes[0].0);
    (1..).zip(tracks.iter().map(|boxes| proposal(film, boxes, proposer))).collect()
}

fn proposal(film: &Film, boxes: &[(u32, Region)], proposer: &str) -> Person {
    let mut keys = BTreeMap::new();
    let mut shown = BTreeSet::new();
    for part in boxes.chunk_by(|a, b| time_of(film, b.0) - time_of(film, a.0) <= BRIDGED_S) {
        keys.extend(sparse(part));
        shown.extend(part[0].0..=part[part.len() - 1].0);
    }
    keys.values_mut().for_each(|key| proposer.clone_into(&mut key.proposed));
    Person::of(keys, &shown)
}

/// Returns the time of a frame, s; 0 if the film does not have it.
fn time_of(film: &Film, number: u32) -> f64 {
    film.shot(number).map_or(0.0, |shot| shot.t_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proposals_bridge_short_pauses_and_not_long_ones() {
        let film = film::tests::film(40);
        let mut tracks = Boxes::new();
        for (id, frames) in [(7, &[3, 4, 5, 10, 30, 31][..]), (9, &[1, 2, 3, 4]), (12, &[8, 9])] {
            for frame in frames {
                let region = Region { x: f64::from(*frame), y: 9.0, width: 50.0, height: 50.0 };
                tracks.entry(id).or_default().push((*frame, region));
            }
        }
        let people = proposals(&film, tracks, "net");
        assert_eq!(people.keys().copied().collect::<Vec<_>>(), [1, 2], "too short is left out");
        assert_eq!(people[&1].frames().collect::<Vec<_>>(), [1, 2, 3, 4]);
        let frames: Vec<u32> = people[&2].frames().collect();
        assert_eq!(frames, [3, 4, 5, 6, 7, 8, 9, 10, 30, 31]);
        assert_eq!(people[&2].at(7).unwrap().region.x, 7.0);
        assert!(people[&2].key(7).is_none());
        assert_eq!(people[&2].at(7).expect("a box").proposed, "net");
        assert_eq!(hidden(1), ", without 1 track of fewer than 3 detections");
        assert_eq!(hidden(0), "");
    }

    #[test]
    fn the_file_is_beside_the_log() {
        assert_eq!(annotated_file(Path::new("a/walk.mcap")), Path::new("a/walk.people.csv"));
    }
}
