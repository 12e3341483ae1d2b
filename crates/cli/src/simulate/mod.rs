//! `tagalong simulate`: from a scene to a log or to pictures.

mod gallery;
mod record;

use std::fs;
use std::path::{Path, PathBuf};
use std::thread::available_parallelism;

use clap::Args;
use indicatif::ProgressBar;
pub use record::Recorder;
use tagalong_log::write::WriteError;
use tagalong_sim::{Event, Scene, Simulation};

use crate::outcome::{Ended, Failure, Outcome, say};

/// The arguments of `tagalong simulate`.
#[derive(Args, Debug)]
pub struct SimulateArgs {
    /// The scene, a TOML file.
    pub scene: PathBuf,
    /// The log to write [default: runs/<scene>.mcap].
    #[arg(short, long, value_name = "LOG")]
    pub output: Option<PathBuf>,
    /// Use this seed instead of the scene's.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Draw pictures with the truth into this folder instead of writing a log.
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    pub gallery: Option<PathBuf>,
    /// Threads that draw; the log is the same [default: as many as there are].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub threads: Option<u8>,
}

/// Draws the scene.
///
/// # Errors
/// A scene that cannot be read or is wrong is exit code 2; files that cannot be
/// written are 1.
pub fn simulate(args: &SimulateArgs) -> Outcome {
    let scene = read(&args.scene, args.seed)?;
    let simulation = Simulation::new(&scene, threads(args.threads));
    match &args.gallery {
        Some(folder) => gallery::paint(simulation, &scene, folder)?,
        None => {
            let path = args.output.clone().unwrap_or_else(|| default_log(&args.scene));
            let images = record(simulation, &scene, &path).map_err(Failure::failed)?;
            say(&format!("{images} images and the truth are in {}", path.display()));
        }
    }
    Ok(Ended::Well)
}

fn read(path: &Path, seed: Option<u64>) -> Result<Scene, Failure> {
    let shown = path.display();
    let text = fs::read_to_string(path)
        .map_err(|error| Failure::usage(format!("cannot read scene {shown}: {error}")))?;
    let mut scene = Scene::parse(&text)
        .map_err(|error| Failure::usage(error.render(&shown.to_string(), &text)))?;
    scene.seed = seed.unwrap_or(scene.seed);
    Ok(scene)
}

/// As many threads as asked for, else as many as there are.
pub fn threads(asked: Option<u8>) -> usize {
    asked.map_or_else(|| available_parallelism().map_or(1, usize::from), usize::from)
}

fn default_log(scene: &Path) -> PathBuf {
    Path::new("runs").join(scene.file_stem().unwrap_or_default()).with_extension("mcap")
}

/// Writes all that the robot records; returns the number of images.
///
/// # Errors
/// [`WriteError`] if the disk says no.
pub fn record(mut simulation: Simulation, scene: &Scene, path: &Path) -> Result<u64, WriteError> {
    let mut recorder = Recorder::create(path, scene, simulation.camera())?;
    let bar = ProgressBar::new((scene.duration_s * 10.0) as u64);
    let mut images = 0;
    while let Some(event) = simulation.next_event() {
        if let Event::Shot(shot) = &event {
            images += 1;
            bar.set_position(shot.captured_ns / 100_000_000);
        }
        recorder.write(&event)?;
    }
    bar.finish_and_clear();
    recorder.finish()?;
    Ok(images)
}
