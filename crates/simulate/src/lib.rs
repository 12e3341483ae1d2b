//! `tagalong simulate`: renders a scene to a log or to pictures.
//!
//! ```
//! use std::path::Path;
//! use tagalong_sim::Scene;
//! use tagalong_simulate::scenes;
//!
//! // Scenes are built in by name; `simulate` renders them to logs, and `sample` writes a short one.
//! let text = scenes::built_in(Path::new("crossing")).ok_or("no such scene")?;
//! let scene = Scene::parse(text)?;
//! assert!(scene.people.len() >= 2 && scenes::names().count() > 10);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod gallery;
mod record;
pub mod sample;
pub mod scenes;

use std::io::ErrorKind;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread;

use clap::Args;
use indicatif::ProgressBar;
pub use record::{CAMERA_FRAME, Recorder, log_stamp};
use tagalong_app::format::Format;
use tagalong_app::outcome::{CUT_SHORT, Ended, Failure, Outcome, make_room_for, print, say, spare};
use tagalong_app::signals::Signals;
use tagalong_app::threads::threads;
use tagalong_config::{FileLimit, PathText, nearest, read_text};
use tagalong_log::write::WriteError;
use tagalong_math::counted;
use tagalong_sim::{Event, Scene, Simulation, Split, Variant};

/// Arguments of `tagalong simulate`.
#[derive(Args, Debug)]
pub struct SimulateArgs {
    /// The scene, a TOML file.
    pub scene: PathBuf,
    /// The log to write [default: runs/SCENE.mcap].
    #[arg(short, long, value_name = "LOG")]
    pub output: Option<PathBuf>,
    /// Use this seed instead of the scene's: counted within --split if given.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Take seed, people and rooms from train, validation or test.
    #[arg(long, value_name = "SPLIT")]
    pub split: Option<Split>,
    /// Set a value of the scene, like camera.kind=stereo or people.0.speed_mps=0.8.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_and_value)]
    pub set: Vec<(String, String)>,
    /// Render pictures with the truth into this folder instead of writing a log.
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    pub gallery: Option<PathBuf>,
    /// Threads that render; the log is the same [default: as many as there are].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub threads: Option<u8>,
    /// Replace the log if it exists.
    #[arg(long)]
    pub overwrite: bool,
    /// Output format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// Simulates the scene.
///
/// # Errors
/// Exit code 2 for a scene that cannot be read or is wrong, and for an output path that cannot be
/// written; 1 for a failure of the disk.
pub fn simulate(args: &SimulateArgs) -> Outcome {
    let path = &args.scene;
    let variant = Variant { seed: args.seed, split: args.split, set: args.set.clone() };
    let scene = read(path, &variant)?;
    let simulation = Simulation::new(&scene, threads(args.threads));
    match &args.gallery {
        Some(folder) => gallery::paint(simulation, &scene, folder)?,
        None => {
            let log = args.output.clone().unwrap_or_else(|| default_log(path));
            spare(&log, args.overwrite)?;
            make_room_for(&log)?;
            return write(simulation, &scene, &log, args.format);
        }
    }
    Ok(Ended::Well)
}

fn write(simulation: Simulation, scene: &Scene, log: &Path, format: Format) -> Outcome {
    let signals = Signals::listen()?;
    let images = record(simulation, scene, log, &|| signals.received().is_none())
        .map_err(Failure::failed)?;
    if let Some(signal) = signals.received() {
        say(CUT_SHORT);
        return Ok(Ended::BySignal(signal));
    }
    match format {
        Format::Text => {
            let images = counted(images, "image");
            say(&format!("{images} and the truth are in {}", log.display()));
        }
        Format::Json => {
            let told = serde_json::json!({ "log": PathText(log), "images": images });
            print(&format!("{told:#}\n"))?;
        }
    }
    Ok(Ended::Well)
}

/// Splits `KEY=VALUE`.
///
/// # Errors
/// An argument without the sign.
pub fn key_and_value(argument: &str) -> Result<(String, String), String> {
    let (key, value) = argument.split_once('=').ok_or("write KEY=VALUE, like crowd=5")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

/// Reads a scene: a file, or the name of a built-in one.
///
/// # Errors
/// A file that cannot be read, or a mistake in it with its place: exit code 2.
pub fn read(path: &Path, variant: &Variant) -> Result<Scene, Failure> {
    let shown = path.display();
    let text = match read_text(path, FileLimit::Config) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound && scenes::built_in(path).is_some() => {
            scenes::built_in(path).unwrap_or_default().to_owned()
        }
        Err(error) => {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            let hint = match nearest(&stem, scenes::names()) {
                Some(name) => format!("did you mean `{name}`?"),
                None => format!("there are: {}", scenes::names().collect::<Vec<_>>().join(", ")),
            };
            return Err(Failure::usage(format!("cannot read scene {shown}: {error}; {hint}")));
        }
    };
    Scene::parse_with(&text, variant)
        .map_err(|error| Failure::usage(error.render(&shown.to_string(), &text)))
}

fn default_log(scene: &Path) -> PathBuf {
    Path::new("runs").join(scene.file_stem().unwrap_or_default()).with_extension("mcap")
}

/// Writes everything that the robot records, while `goes_on` returns true; returns the number of
/// images.
///
/// # Errors
/// [`WriteError`] if the file cannot be written.
pub fn record(
    mut simulation: Simulation,
    scene: &Scene,
    path: &Path,
    goes_on: &dyn Fn() -> bool,
) -> Result<u64, WriteError> {
    let mut recorder = Recorder::create(path, scene, &simulation)?;
    let bar = ProgressBar::new((scene.duration_s * 10.0) as u64);
    let (events, recorded) = mpsc::sync_channel(EVENTS_AHEAD);
    thread::scope(|scope| {
        // Images are encoded while the next ones are rendered.
        let writing = thread::Builder::new().spawn_scoped(scope, move || {
            recorded.into_iter().try_for_each(|event| recorder.write(&event))?;
            recorder.finish()
        });
        let writing = writing.map_err(|source| WriteError::Io { path: path.to_owned(), source })?;
        let mut images = 0;
        while let Some(event) = simulation.next_event().filter(|_| goes_on()) {
            if let Event::Shot(shot) = &event {
                images += 1;
                bar.set_position(shot.captured_ns / 100_000_000);
            }
            // The writer has gone if it failed; its error is the answer.
            if events.send(event).is_err() {
                break;
            }
        }
        drop(events);
        bar.finish_and_clear();
        writing.join().unwrap_or_else(|panic| resume_unwind(panic))?;
        Ok(images)
    })
}

/// Largest number of events that wait to be written: a few images, so that neither side waits long
/// for the other.
const EVENTS_AHEAD: usize = 16;

#[cfg(test)]
mod tests {
    use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits, LogFrame, inspect};
    use tagalong_sim::{FaultKind, InjectedFault};
    use tagalong_trials::Draw;

    use super::*;

    const SCENE: &str = "seed = 3\nduration_s = 3.0\n[laser]\nrays = 90\n[camera]\nwidth = 64\nheight = 48\n\
        rate_hz = 20.0\ndepth_offset_s = 0.015\nrolling_shutter_s = 0.015\n[robot]\npath = [[6.0, 4.0]]\n[faults]\nlate = 0.4\ndropped = 0.1\n\
        [[people]]\npath = [[4.0, 3.0], [4.0, 1.0]]\n";

    #[test]
    fn a_mistyped_scene_is_answered_with_the_nearest_one() {
        let path = Path::new("configs/scenes/follow-pasing.toml");
        let failure = read(path, &Variant::default()).err().unwrap();
        assert!(failure.message.contains("did you mean `follow-passing`?"), "{}", failure.message);
    }

    #[test]
    fn a_log_has_encoders_commands_and_the_time_of_its_depth() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.mcap");
        let scene = Scene::parse(SCENE).unwrap();
        record(Simulation::new(&scene, 1), &scene, &path, &|| true).unwrap();
        let seen = inspect(&path, &InputSettings::default(), &Limits::default()).unwrap();
        for (topic, schema) in [
            ("/joint_states", "sensor_msgs/msg/JointState"),
            ("/cmd_vel", "geometry_msgs/msg/TwistStamped"),
            ("/odom", "nav_msgs/msg/Odometry"),
        ] {
            let found = seen.topics.iter().find(|t| t.topic == topic).unwrap();
            assert_eq!((found.schema.as_str(), found.count, found.undecodable), (schema, 150, 0));
        }
        assert!((seen.skew.unwrap().median_s - 0.015).abs() < 1e-6, "{:?}", seen.skew);
    }

    /// Records the scene with a fault from 1 s to 2 s, and returns its frames.
    fn logged(kind: FaultKind) -> Vec<LogFrame> {
        let mut scene = Scene::parse(SCENE).unwrap();
        scene.faults.inject = vec![InjectedFault::new(kind).at(1.0).lasting(1.0)];
        scene.faults.late = 0.0;
        scene.faults.dropped = 0.0;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.mcap");
        record(Simulation::new(&scene, 1), &scene, &path, &|| true).unwrap();
        let inputs = Inputs::ANY.require(Input::Depth);
        let mut source =
            FrameSource::open(&path, &InputSettings::default(), &Limits::default(), inputs)
                .unwrap();
        std::iter::from_fn(|| source.next_frame()).collect()
    }

    /// Frames of a log whose first stamp is the start of the scene, from 1 s to 2 s.
    fn within(frames: &[LogFrame]) -> &[LogFrame] {
        let start = frames[0].frame.stamp;
        let [first, end] = [0.99, 1.99].map(|seconds| {
            let mut elapsed_s = frames.iter().map(|one| one.frame.stamp.seconds_since(start));
            elapsed_s.position(|elapsed_s| elapsed_s > seconds).expect("frames of two seconds")
        });
        &frames[first..end]
    }

    #[test]
    fn injected_faults_are_in_the_log() {
        fn depth(frame: &LogFrame) -> Vec<u32> {
            frame.frame.depth().unwrap().pixels().iter().map(|z| z.to_bits()).collect()
        }

        fn is_dark(frame: &LogFrame, column: usize) -> bool {
            frame
                .frame
                .depth()
                .unwrap()
                .pixels()
                .iter()
                .skip(column)
                .step_by(64)
                .all(|z| z.is_nan())
        }

        let frozen = logged(FaultKind::FreezeDepth);
        let first = depth(&within(&frozen)[0]);
        assert_eq!(within(&frozen).len(), 20);
        assert!(within(&frozen).iter().all(|frame| depth(frame) == first));
        assert!(depth(&frozen[45]) != depth(&frozen[46]));

        let blank = logged(FaultKind::BlankDepth);
        assert!(within(&blank).iter().all(|frame| (0..64).all(|column| is_dark(frame, column))));
        let dark = logged(FaultKind::DarkColumns);
        for frame in within(&dark) {
            assert!((0..64).filter(|column| is_dark(frame, *column)).count() >= 56);
        }
        assert_eq!(logged(FaultKind::Drop).len(), 40);

        let frozen = logged(FaultKind::OdometryFrozen);
        assert!(within(&frozen)[2..].iter().all(|frame| frame.frame.motion.forward == 0.0));
        let silent = logged(FaultKind::OdometrySilent);
        assert!(within(&silent)[12..18].iter().all(|frame| frame.odom_stale));
        let lost = logged(FaultKind::NanOdometry);
        assert!(within(&lost)[12..18].iter().all(|frame| frame.odom_stale));
        let changed = logged(FaultKind::CalibrationChanged);
        assert!(within(&changed).iter().all(|frame| frame.frame.calibration_changed));
        assert!(!changed[19].frame.calibration_changed);
    }

    #[test]
    fn further_sensors_have_topics_by_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.mcap");
        let sensors = "[[ranges]]\nname = \"front\"\n[[bumpers]]\nname = \"skirt\"\n\
            [[lasers]]\nname = \"rear\"\nmount = [-0.2, 0.0, 0.2, 180.0]\n";
        let scene = Scene::parse(&format!("{SCENE}{sensors}")).unwrap();
        record(Simulation::new(&scene, 1), &scene, &path, &|| true).unwrap();
        let seen = inspect(&path, &InputSettings::default(), &Limits::default()).unwrap();
        for (topic, schema, count) in [
            ("/range/front", "sensor_msgs/msg/Range", 30),
            ("/bumper/skirt", "std_msgs/msg/Bool", 150),
            ("/scan/rear", "sensor_msgs/msg/LaserScan", 30),
        ] {
            let found = seen.topics.iter().find(|t| t.topic == topic).unwrap();
            assert_eq!((found.schema.as_str(), found.count, found.undecodable), (schema, count, 0));
        }
    }

    /// Trials skip the log; they must give the same frames as a pipeline that reads it.
    #[test]
    fn a_recorded_scene_gives_the_frames_of_a_trial() {
        let scene = Scene::parse(SCENE).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.mcap");
        record(Simulation::new(&scene, 1), &scene, &path, &|| true).unwrap();
        let inputs = Inputs::ANY.require(Input::Depth);
        let mut source =
            FrameSource::open(&path, &InputSettings::default(), &Limits::default(), inputs)
                .unwrap();
        let mut draw = Draw::new(&scene, 1);
        let mut frames = 0;
        while let Some(logged) = source.next_frame() {
            let drawn = draw.next_frame().unwrap().frame;
            let a = logged.frame.motion;
            let b = drawn.motion;
            let differences =
                [a.forward - b.forward, a.left - b.left, a.turn - b.turn, a.dt - b.dt];
            assert!(differences.iter().all(|d| d.abs() < 1e-9), "{a:?} {b:?}");
            assert!((a.covariance - b.covariance).norm() < 1e-9, "{a:?} {b:?}");
            assert_eq!(logged.frame.index, drawn.index);
            let logged_pose = logged.frame.camera.robot_from_camera;
            let off = logged_pose.inverse() * drawn.camera.robot_from_camera;
            assert!(off.translation.vector.norm() < 1e-9 && off.rotation.angle() < 1e-9);
            let a = logged.frame.depth().unwrap();
            let b = drawn.depth().unwrap();
            assert!(
                a.pixels().iter().zip(b.pixels()).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
            );
            let a = &logged.frame.laser().unwrap().points;
            let b = &drawn.laser().unwrap().points;
            assert_eq!(a.len(), b.len());
            assert!(a.len() > 60, "most rays meet something: {}", a.len());
            assert!(
                a.iter().zip(b.iter()).all(|(a, b)| (a - b).norm() < 1e-5),
                "{:?} {:?}",
                a[0],
                b[0]
            );
            frames += 1;
        }
        assert!(frames > 40 && draw.next_frame().is_none(), "{frames}");
    }
}
