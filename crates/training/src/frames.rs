//! Training of detectors on whole frames: simulated depth, and annotated logs of real rooms, each
//! of which is left out once.

use std::path::{Path, PathBuf};

use nalgebra::{Point2, Point3};
use tagalong_app::outcome::{Ended, Failure, Outcome, make_folder, print, say, write_file};
use tagalong_app::serialize::to_toml;
use tagalong_app::threads::threads;
use tagalong_config::{AnnotatedPerson, FileLimit, Trainer, read_text};
use tagalong_core::Frame;
use tagalong_eval::Region;
use tagalong_eval::formats::{mot, people};
use tagalong_geometry::HEAD_RADIUS_M;
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};
use tagalong_sim::{Split, Truth};
use tagalong_trials::Draw;

use super::args::TrainArgs;
use super::rooms::ImageTiming;
use super::session::Session;
use super::wide_rooms::wide_scene;

/// Real rooms with their logs.
const ROOMS: [(&str, &str); 6] = [
    ("um and filinha", "um"),
    ("um and filinha", "filinha"),
    ("lab2", "lab2-camera1"),
    ("lab2", "lab2-camera2"),
    ("corredor1", "corredor1-camera1"),
    ("uc3m", "uc3m-single-frames"),
];

/// Default number of scenes, and the number in a quick training.
const SCENES: [u64; 2] = [400, 12];
/// A low rate of images: images that are farther apart in time are more informative.
const LOOK: ImageTiming = ImageTiming { rate_hz: 1.0, duration_s: 3.6 };
/// Height of the head's centre below the upper edge of a box around a person, as a fraction of the
/// box.
const HEAD_IN_BOX: f64 = 0.06;
/// Part of a box in which the depth of the trunk is measured: left, top, width, height, as
/// fractions.
const TRUNK_IN_BOX: [f64; 4] = [0.25, 0.1, 0.5, 0.5];

/// Simulates, reads logs, fits, writes model and card, and prints the card.
pub(super) fn train(session: &Session<'_>, trainer: &mut dyn Trainer) -> Outcome {
    let args = session.args;
    let scenes = args.scenes.unwrap_or(SCENES[usize::from(args.quick)]);
    show_scenes(session, scenes, trainer)?;
    session.bar.set_message("reading logs");
    if let Some(data) = &args.data {
        show_rooms(data, trainer)?;
    }
    session.bar.set_message("fitting");
    session.bar.set_position(0);
    session.bar.set_length(1000);
    let fitted = trainer.fit(&mut |part| session.bar.set_position((1000.0 * part) as u64));
    let fitted = fitted.map_err(Failure::failed)?;
    session.bar.finish_and_clear();
    write_file(&session.model, &fitted.model)?;
    let path = session.model.with_extension("card.toml");
    let card = card(args, scenes, &fitted.figures)?;
    write_file(&path, &card)?;
    write_left_out(session, &fitted.without)?;
    print(&card)?;
    say(&format!("{} and {}", session.model.display(), path.display()));
    Ok(Ended::Well)
}

/// Passes the frames of simulated rooms to a trainer.
pub(super) fn show_scenes(
    session: &Session<'_>,
    scenes: u64,
    trainer: &mut dyn Trainer,
) -> Result<(), Failure> {
    session.bar.set_message("simulating rooms");
    session.bar.set_length(scenes);
    for group in 0..scenes {
        let number = session.args.seed.wrapping_mul(1000) % 1_000_000 + group;
        show_scene(number, group, trainer)?;
        session.bar.inc(1);
    }
    Ok(())
}

/// Passes the annotated frames of all real rooms in a folder of data to a trainer.
///
/// # Errors
/// A log or an annotation that cannot be read, and errors of the trainer.
pub(super) fn show_rooms(data: &Path, trainer: &mut dyn Trainer) -> Result<(), Failure> {
    ROOMS.into_iter().try_for_each(|(room, log)| show_log(&data.join("logs"), log, room, trainer))
}

/// Returns the names of the logs of [`show_rooms`], as they are printed on cards.
pub(super) fn room_logs() -> impl Iterator<Item = String> {
    ROOMS.into_iter().map(|(_, log)| format!("logs/{log}.mcap"))
}

/// Writes the leave-one-room-out models, to the folder of the arguments or beside the model of all
/// rooms.
///
/// # Errors
/// A folder that cannot be created, and a file that cannot be written: exit code 1.
pub(super) fn write_left_out(
    session: &Session<'_>,
    left_out: &[(String, String)],
) -> Result<(), Failure> {
    let folder = session.args.left_out.as_deref();
    if let Some(folder) = folder.filter(|_| !left_out.is_empty()) {
        make_folder(folder)?;
    }
    for (room, text) in left_out {
        write_file(&without(&session.model, folder, room), text)?;
    }
    Ok(())
}

/// Returns the path of the model without a room.
fn without(model: &Path, folder: Option<&Path>, room: &str) -> PathBuf {
    let stem = model.file_stem().unwrap_or_default().to_string_lossy();
    let beside = model.with_file_name(format!("{stem}.without-{}.toml", room.replace(' ', "-")));
    match (folder, beside.file_name()) {
        (Some(folder), Some(name)) => folder.join(name),
        _ => beside,
    }
}

fn show_scene(number: u64, group: u64, trainer: &mut dyn Trainer) -> Result<(), Failure> {
    let scene = wide_scene(Split::Train, number, LOOK).map_err(Failure::failed)?;
    let mut draw = Draw::new(&scene, threads(None));
    while let Some(simulated) = draw.next_frame() {
        let people: Vec<AnnotatedPerson> = simulated.truth.iter().map(of_truth).collect();
        trainer.add_frame(&simulated.frame, &people, None, group).map_err(Failure::failed)?;
    }
    Ok(())
}

/// Converts the truth of a scene. All people count, because the trainer itself decides by their
/// visible surface.
fn of_truth(truth: &Truth) -> AnnotatedPerson {
    AnnotatedPerson::new(truth.head_in_robot).with_visible(truth.visible_fraction)
}

/// Passes the frames of a log to a trainer.
fn show_log(
    folder: &Path,
    log: &str,
    room: &str,
    trainer: &mut dyn Trainer,
) -> Result<(), Failure> {
    let truth = RealTruth::read(folder, log)?;
    let input = InputSettings::default();
    let limits = Limits::default();
    let inputs = Inputs::NONE.require(Input::Colour).require(Input::Depth);
    let path = folder.join(log).with_extension("mcap");
    let mut source = FrameSource::open(&path, &input, &limits, inputs)?;
    while let Some(item) = source.next_frame() {
        let people = truth.people(&item.frame);
        trainer.add_frame(&item.frame, &people, Some(room), 0).map_err(Failure::failed)?;
    }
    Ok(())
}

/// Annotation of a log.
enum RealTruth {
    /// Heads.
    People(Vec<people::Row>),
    /// Boxes around whole people.
    Boxes(Vec<mot::Row>),
}

impl RealTruth {
    fn read(folder: &Path, log: &str) -> Result<Self, Failure> {
        let [heads, boxes] =
            ["people", "boxes"].map(|kind| folder.join(format!("{log}.{kind}.csv")));
        let path = if heads.is_file() { &heads } else { &boxes };
        let name = path.display().to_string();
        let text = read_text(path, FileLimit::Table)
            .map_err(|error| Failure::failed(format!("{name}: {error}")))?;
        if path == &heads {
            return people::parse(&text, &name).map(Self::People).map_err(Failure::failed);
        }
        let rows = mot::parse_truth(&text, &name, mot::Rules::Mot17).map_err(Failure::failed)?;
        Ok(Self::Boxes(rows))
    }

    /// Returns the people in a frame.
    fn people(&self, frame: &Frame) -> Vec<AnnotatedPerson> {
        match self {
            Self::People(rows) => {
                let here = rows.iter().filter(|row| u64::from(row.frame) == frame.index);
                here.filter_map(|row| of_row(row, frame)).collect()
            }
            Self::Boxes(rows) => {
                let here = rows.iter().filter(|row| u64::from(row.frame) == frame.index);
                here.filter_map(|row| of_box(&row.region, frame)).collect()
            }
        }
    }
}

/// Returns an annotated person; `None` if neither the row nor the depth in its box gives a
/// position.
fn of_row(row: &people::Row, frame: &Frame) -> Option<AnnotatedPerson> {
    let head = match (row.head_in_camera_m, row.upper_body) {
        (Some(surface), _) => {
            let surface = Point3::from(surface);
            // Depth sees the surface; tracks estimate the centre of the head.
            let ray = surface.coords.try_normalize(1e-6).unwrap_or_default();
            frame.camera.robot_from_camera * (surface + ray * HEAD_RADIUS_M)
        }
        (None, Some(Region { x, y, width, height })) => {
            let square = tagalong_geometry::Rect::new(x, y, width, height);
            frame.camera.head_of(&square, frame.depth().ok()?.face_m(&square)?)
        }
        (None, None) => return None,
    };
    Some(AnnotatedPerson::new(head).with_counts(!row.ignore).with_visible(row.visible))
}

/// Returns the person in a box, at the distance of the trunk; `None` without depth there.
fn of_box(region: &Region, frame: &Frame) -> Option<AnnotatedPerson> {
    let [left, top, width, height] = TRUNK_IN_BOX;
    let trunk = tagalong_geometry::Rect::new(
        region.x + left * region.width,
        region.y + top * region.height,
        width * region.width,
        height * region.height,
    );
    let depth_m = frame.depth().ok()?.surface_m(&trunk)?;
    let pixel = Point2::new(region.x + 0.5 * region.width, region.y + HEAD_IN_BOX * region.height);
    let head = frame.camera.back_project(pixel, depth_m + HEAD_RADIUS_M);
    Some(AnnotatedPerson::new(head))
}

/// Returns the card: the origin of the model, and a table of its scores.
fn card(args: &TrainArgs, scenes: u64, figures: &toml::Table) -> Result<String, Failure> {
    let mut sources = vec![format!("{scenes} simulated rooms")];
    if args.data.is_some() {
        sources.extend(room_logs());
    }
    let mut card = toml::Table::new();
    card.insert("plugin".into(), args.plugin.clone().into());
    card.insert("quick".into(), args.quick.into());
    card.insert("seed".into(), (args.seed as i64).into());
    card.insert("trained_on".into(), sources.into());
    let figures = to_toml("the scores", &with_key("figures", figures))?;
    Ok(format!(
        "# Single frames. People within 5 m with at least half the upper body visible; false\n\
         # people are more than 0.6 m from anybody. `left out`: trained on simulated rooms and the\n\
         # other real ones; `simulation only`: on no real room. The model itself has seen all.\n{card}\n{figures}"
    ))
}

fn with_key(key: &str, table: &toml::Table) -> toml::Table {
    toml::Table::from_iter([(key.to_owned(), toml::Value::Table(table.clone()))])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_without_a_room_are_beside_the_model_or_in_the_folder_that_is_asked_for() {
        let model = Path::new("models/depth-net.toml");
        let beside = without(model, None, "um and filinha");
        assert_eq!(beside, Path::new("models/depth-net.without-um-and-filinha.toml"));
        let apart = without(model, Some(Path::new("left/out")), "lab2");
        assert_eq!(apart, Path::new("left/out/depth-net.without-lab2.toml"));
    }
}
