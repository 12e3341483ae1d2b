//! `tagalong-papers triangulate`: positions of a coloured hat, by fixed cameras in a log.

mod found;
mod seen;
mod truth;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::triangulate::{Cameras, HatColour, Known, Sight, calibrate};
use clap::Args;
use nalgebra::{Point2, Point3};
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print};
use tagalong_app::suggest::check_log_path;
use tagalong_config::{FileLimit, read_text};
use tagalong_core::Stamp;
use tagalong_log::{Limits, read_truth};
use tagalong_sim::WebcamSettings;

use self::found::TriangulationResult;
use self::seen::CameraSightings;
use self::truth::Standing;

/// Largest difference of the stamps of one moment, s.
const TOGETHER_S: f64 = 0.05;
/// Largest difference in time between a known place and an image, s.
const KNOWN_WITHIN_S: f64 = 0.2;

/// Arguments of `tagalong-papers triangulate`.
#[derive(Args, Debug)]
pub struct TriangulateArgs {
    /// The log.
    pub log: PathBuf,
    /// A first guess of the cameras: a TOML file with a table `[[webcams]]` for
    /// each, with `at`, `heading_deg`, `pitch_down_deg` and `field_of_view_deg`.
    /// The images of the first are on the topic `/webcam_1/image_raw/compressed`.
    #[arg(long, value_name = "FILE")]
    pub cameras: PathBuf,
    /// Known places: a CSV file with `seconds,x_m,y_m`, the seconds counted from the first image. A
    /// simulated log has its own.
    #[arg(long, value_name = "FILE")]
    pub known: Option<PathBuf>,
    /// Output file of the places, as CSV, in coordinates of the room.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Output file of the person's positions as seen from the robot, in one line of JSON for each
    /// of the robot's images: NAME.truth.jsonl beside NAME.mcap is the truth of `bench`, and of
    /// `eval --truth`.
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Pose of the robot at its first image, in coordinates of the room: x and y, m, and its
    /// heading, degrees. A simulated log has its own.
    #[arg(long, value_name = "X,Y,DEGREES", allow_hyphen_values = true)]
    pub robot: Option<Standing>,
    /// Height of the centre of the head under the hat, m: cameras that measure bearings cannot
    /// measure it.
    #[arg(long, value_name = "METRES", default_value_t = 1.6)]
    pub head: f64,
    /// Hue of the hat, degrees: 0 red, 120 green, 240 blue.
    #[arg(long, value_name = "DEGREES", default_value_t = 120.0)]
    pub hue: f64,
    /// Calibrate with one in so many known places; the others are held out.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub every: usize,
    /// Output format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// Examples of the command.
pub const HELP: &str = "\
Calibrates the cameras by places that are known, and says how far measured places are from known
ones that it was not told.

Examples:
  tagalong simulate configs/scenes/omni-hat.toml -o runs/hat.mcap
  tagalong-papers triangulate runs/hat.mcap --cameras configs/scenes/omni-hat.toml -o runs/hat.csv
  tagalong-papers triangulate lab.mcap --cameras cameras.toml --known places.csv --hue 240
  tagalong-papers triangulate lab.mcap --cameras cameras.toml --known places.csv --robot 5,2.5,0 \
    --truth lab.truth.jsonl    (then `tagalong bench --logs lab.mcap`)
  tagalong-papers triangulate runs/hat.mcap --cameras configs/scenes/omni-hat.toml --format json | jq .held_out";

/// Guessed cameras; a scene file has them, too.
#[derive(serde::Deserialize)]
struct Guess {
    webcams: Vec<WebcamSettings>,
}

/// Runs `tagalong-papers triangulate`.
///
/// # Errors
/// Files that cannot be read, a log without webcams, too few places.
pub fn triangulate(args: &TriangulateArgs) -> Outcome {
    check_log_path(&args.log)?;
    let guess = guess(&args.cameras)?;
    let colour = HatColour { hue_deg: args.hue, ..HatColour::default() };
    let seen = CameraSightings::read(&args.log, guess.len(), &colour)?;
    if seen.hats.is_empty() {
        let text = "no camera sees a hat; images are looked for on /webcam_1/image_raw/compressed \
                    and so on, and the hue is --hue";
        return Err(Failure::failed(text));
    }
    let moments = moments(&seen.hats);
    let places = match &args.known {
        Some(path) => known_places(path, &seen)?,
        None => true_places(&args.log, &seen)?,
    };
    let (used, held) = divided(known(&moments, &places), args.every);
    let guessed = Cameras::new(seen.stations(&guess));
    let calibrated = calibrate(&guessed.stations, &used);
    let cameras = Cameras::new(calibrated.stations.clone());
    let fixes: Vec<_> =
        moments.iter().filter_map(|(at, sights)| Some((*at, cameras.fix(sights)?))).collect();
    if let Some(path) = &args.output {
        put(path, &found::csv(&fixes))?;
    }
    let mut found =
        TriangulationResult::new(&calibrated, [&guessed, &cameras], [&used, &held], fixes.len());
    if let Some(path) = &args.truth {
        let frames = truth::frames(args, &seen, &fixes)?;
        put(path, &truth::lines(&frames)?)?;
        found.truth_frames = Some(frames.len());
    }
    print(&found.show(args.format)?)?;
    Ok(Ended::Well)
}

fn guess(path: &Path) -> Result<Vec<WebcamSettings>, Failure> {
    let text = read_text(path, FileLimit::Config).map_err(|error| failure_of(path, error))?;
    let guess: Guess = toml::from_str(&text).map_err(|error| failure_of(path, error))?;
    Ok(guess.webcams)
}

/// Returns the failure of a command with a wrong file.
fn failure_of(path: &Path, why: impl std::fmt::Display) -> Failure {
    Failure::usage(format!("{}: {why}", path.display()))
}

fn put(path: &Path, text: &str) -> Result<(), Failure> {
    fs::write(path, text).map_err(|error| Failure::failed(format!("{}: {error}", path.display())))
}

/// Groups the sightings of all cameras by moment.
fn moments(hats: &[(Stamp, Sight)]) -> Vec<(Stamp, Vec<Sight>)> {
    let mut moments: Vec<(Stamp, Vec<Sight>)> = Vec::new();
    for (stamp, sight) in hats {
        match moments.last_mut() {
            Some((first, sights)) if stamp.seconds_since(*first) <= TOGETHER_S => {
                sights.push(*sight);
            }
            _ => moments.push((*stamp, vec![*sight])),
        }
    }
    moments
}

type Places = BTreeMap<u64, Point2<f64>>;

/// Reads the places of a file, by stamp.
fn known_places(path: &Path, seen: &CameraSightings) -> Result<Places, Failure> {
    let text = read_text(path, FileLimit::Table).map_err(|error| failure_of(path, error))?;
    let first = seen.first.map_or(0, |stamp| stamp.nanos());
    let mut places = Places::new();
    for (number, line) in text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()) {
        let numbers: Vec<f64> = line.split(',').filter_map(|n| n.trim().parse().ok()).collect();
        match numbers[..] {
            [seconds, x, y] if seconds >= 0.0 && x.is_finite() && y.is_finite() => {
                places.insert(first.saturating_add((1e9 * seconds) as u64), Point2::new(x, y));
            }
            // The first line may be a heading.
            _ if number == 0 => {}
            _ => {
                let why = format!("line {}: not `seconds,x_m,y_m`", number + 1);
                return Err(failure_of(path, why));
            }
        }
    }
    Ok(places)
}

/// Returns the true places of a simulated log with one person.
fn true_places(log: &Path, seen: &CameraSightings) -> Result<Places, Failure> {
    let truth = read_truth(log, &Limits::default())?.unwrap_or_default();
    let mut places = Places::new();
    for frame in &truth {
        let (Some(pose), [person]) = (seen.robot.get(&frame.stamp_ns), &frame.people[..]) else {
            continue;
        };
        if let Some(head) = person.head_in_robot_m {
            places.insert(frame.stamp_ns, pose * Point3::from(head).xy());
        }
    }
    if places.is_empty() {
        let text = "nothing says where the hat really was: give places with --known; a simulated log \
                    knows them if there is one person in it";
        return Err(Failure::usage(text));
    }
    Ok(places)
}

/// Returns the moments with a known place.
fn known(moments: &[(Stamp, Vec<Sight>)], places: &Places) -> Vec<Known> {
    let within = (1e9 * KNOWN_WITHIN_S) as u64;
    let known = moments.iter().filter_map(|(stamp, sights)| {
        let at = stamp.nanos();
        let near = places.range(at.saturating_sub(within)..=at.saturating_add(within));
        let (_, place) = near.min_by_key(|(stamp, _)| stamp.abs_diff(at))?;
        Some(Known { place: *place, sights: sights.clone() })
    });
    known.collect()
}

/// Splits the places into one in `every` to calibrate with, and the others.
fn divided(known: Vec<Known>, every: usize) -> (Vec<Known>, Vec<Known>) {
    fn places(part: Vec<(usize, Known)>) -> Vec<Known> {
        part.into_iter().map(|(_, known)| known).collect()
    }

    let (used, held): (Vec<_>, Vec<_>) =
        known.into_iter().enumerate().partition(|(at, _)| at % every.max(1) == 0);
    (places(used), places(held))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sights_of_one_moment_come_together() {
        fn at(ms: u64, station: usize) -> (Stamp, Sight) {
            let sight = Sight { station, pixel: Point2::origin() };
            (Stamp::from_nanos(ms * 1_000_000), sight)
        }

        let found = moments(&[at(0, 0), at(20, 1), at(333, 0), at(340, 2), at(700, 3)]);
        assert_eq!(found.iter().map(|(_, s)| s.len()).collect::<Vec<_>>(), [2, 2, 1]);
    }

    #[test]
    fn one_place_in_so_many_is_used() {
        fn place(x: usize) -> Known {
            Known { place: Point2::new(x as f64, 0.0), sights: Vec::new() }
        }

        let (used, held) = divided((0..7).map(place).collect(), 3);
        assert_eq!(used, [place(0), place(3), place(6)]);
        assert_eq!(held.len(), 4);
    }
}
