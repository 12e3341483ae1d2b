//! `tagalong demo`: every step from a scene to a report, without an input file.

use std::path::{Path, PathBuf};

use clap::Args;
use tagalong_app::outcome::{Ended, Failure, Outcome, make_folder, print, say, write_file};
use tagalong_app::signals::Signals;
use tagalong_app::threads::threads;
use tagalong_benchmark::{BenchArgs, bench};
use tagalong_config::Registry;
use tagalong_log::write::RunDir;
use tagalong_sim::{Furniture, FurnitureKind, Scene, Simulation};
use tagalong_simulate::record;

use crate::run::{self, Overlaid, RunArgs};

const SCENE: &str = include_str!("../configs/scenes/demo.toml");

/// Compared pipelines, with the text of their configs.
const PIPELINES: [(&str, &str); 2] = [
    ("depth-ekf", include_str!("../configs/depth-ekf.toml")),
    ("naive", include_str!("../configs/naive.toml")),
];

/// Arguments of `tagalong demo`.
#[derive(Args, Debug)]
pub struct DemoArgs {
    /// Output folder.
    #[arg(short, long, value_name = "DIR", default_value = "tagalong-demo")]
    pub output: PathBuf,
    /// Replace the files of an earlier demo in the same folder.
    #[arg(long)]
    pub overwrite: bool,
    /// Use another random seed: appearance, furniture, noise.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
}

/// Simulates a scene, tracks its people with two pipelines, compares them.
///
/// # Errors
/// A directory that is not empty is exit code 2; a disk that fails is 1.
pub fn demo(args: &DemoArgs, registry: &Registry) -> Outcome {
    let folder = &args.output;
    RunDir::check(folder, args.overwrite, Path::new("")).map_err(Failure::usage)?;
    let signals = Signals::listen()?;
    say("1/4 simulating four people around a moving robot");
    let (log, note) = draw(folder, args.seed)?;
    for ((name, config), step) in PIPELINES.iter().zip(2..) {
        say(&format!("{step}/4 tracking them with {name}"));
        let config = put(&folder.join(format!("{name}.toml")), config)?;
        let ended = run::run(&run_args(folder, name, config, &log), registry)?;
        if let Some(signal) = signals.received() {
            return Ok(Ended::BySignal(signal));
        }
        if ended != Ended::Well {
            return Ok(ended);
        }
    }
    say("4/4 comparing both with the truth");
    let mut compared = bench_args(folder, &log);
    if let Some(note) = note {
        compared = compared.with_note(note);
    }
    let ended = bench(&compared, registry)?;
    if let Some(signal) = signals.received() {
        return Ok(Ended::BySignal(signal));
    }
    print(&what_now(folder))?;
    Ok(ended)
}

#[expect(clippy::expect_used, reason = "the scene is part of the program, and a test reads it")]
fn draw(folder: &Path, seed: Option<u64>) -> Result<(PathBuf, Option<String>), Failure> {
    let mut scene = Scene::parse(SCENE).expect("the built-in scene is right");
    scene.seed = seed.unwrap_or(scene.seed);
    let log = folder.join("demo.mcap");
    make_folder(folder)?;
    put(&folder.join("demo-scene.toml"), SCENE)?;
    let simulation = Simulation::new(&scene, threads(None));
    let note = note_on(simulation.furniture());
    record(simulation, &scene, &log, &|| true)?;
    Ok((log, note))
}

/// Returns the note on the things in the room that look like people, if there are any.
fn note_on(furniture: &[Furniture]) -> Option<String> {
    use FurnitureKind::{CardboardFigure, CoatStand, DrapedChair, Poster};
    let alike = [Poster, CardboardFigure, CoatStand, DrapedChair];
    let there = alike.into_iter().filter(|kind| furniture.iter().any(|piece| piece.kind == *kind));
    let names: Vec<String> = there.map(|kind| format!("a {}", kind.name())).collect();
    let names = names.join(" and ");
    (!names.is_empty()).then(|| {
        format!(
            "like people, but none: {names} in the room. The truth has no box there, and a track \
             there is a false positive"
        )
    })
}

fn put(path: &Path, text: &str) -> Result<PathBuf, Failure> {
    write_file(path, text)?;
    Ok(path.to_owned())
}

fn run_args(folder: &Path, name: &str, config: PathBuf, log: &Path) -> RunArgs {
    RunArgs {
        log: Some(log.to_owned()),
        with_images: true,
        overlay: Some(Overlaid::People),
        ..RunArgs::quiet(Some(config), folder.join(name))
    }
}

fn bench_args(folder: &Path, log: &Path) -> BenchArgs {
    let configs = PIPELINES.iter().map(|(name, _)| folder.join(format!("{name}.toml")));
    BenchArgs::of(configs.collect(), vec![log.to_owned()], folder.join("report"))
}

fn what_now(folder: &Path) -> String {
    let shown = folder.display();
    format!(
        "
Look at:
  {shown}/report/report.html: which pipeline is better, and a picture of every error
  {shown}/depth-ekf/overlay/: boxes, IDs, trails and a plan, one picture per frame
  {shown}/naive/overlay/: the same, with IDs that change whenever a person is hidden
  {shown}/depth-ekf/tracks.mcap: people in 3D and in the image, in Foxglove; import the layout
      bridges/ros2/foxglove/tagalong.json

Try next:
  tagalong view {shown}/depth-ekf {shown}/naive
      both runs side by side in the browser, frame by frame
  tagalong trials --seeds 10
      whether the differences are chance: ten samples of each hard scene
  tagalong run {shown}/demo.mcap --overlay
      with depth-verified, which `run` takes for colour and depth: slower than these two, but better
  tagalong run YOUR.mcap --overlay
      the log of your own robot, with the best pipeline for its sensors
  tagalong simulate {shown}/demo-scene.toml --gallery pictures
      change the scene, and look at its pictures
"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_scene_can_be_read() {
        assert_eq!(Scene::parse(SCENE).unwrap().people.len(), 4);
    }

    #[test]
    fn things_that_look_like_people_are_named() {
        let scene = Scene::parse(SCENE).expect("the built-in scene");
        let simulation = Simulation::new(&scene, 1);
        let note = note_on(simulation.furniture()).expect("a figure in the room");
        let kinds = simulation.furniture().iter().map(|piece| piece.kind);
        let alike = kinds
            .filter(|kind| matches!(kind, FurnitureKind::Poster | FurnitureKind::CardboardFigure));
        for kind in alike {
            assert!(note.contains(kind.name()), "{note}");
        }
        assert_eq!(note_on(&[]), None);
    }
}
