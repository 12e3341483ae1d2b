//! `tagalong triangulate`: where a coloured hat is, by fixed cameras in a log.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::{Isometry2, Point2, Point3};
use tagalong_core::{Stamp, planar_pose};
use tagalong_log::images::{Pixels, decode_compressed, decode_raw};
use tagalong_log::mcap_walk::{Message, Walker};
use tagalong_log::msgs::{CameraInfo, CompressedImage, Image, PoseStamped, decode};
use tagalong_log::{Limits, read_truth};
use tagalong_sim::WebcamSettings;
use tagalong_triangulate::{
    Calibrated, Fix, HatColour, Known, Sight, Station, calibrate, find_hat, triangulate as meet,
};

use crate::outcome::{Ended, Failure, Outcome, print};
use crate::suggest::check_log_path;

/// Where a drawn log says how the robot really stands.
const TRUE_ROBOT_TOPIC: &str = "/truth/robot";
/// Images of one moment differ by no more than this, s.
const TOGETHER_S: f64 = 0.05;
/// A known place holds for images this near in time, s.
const KNOWN_WITHIN_S: f64 = 0.2;

/// The arguments of `tagalong triangulate`.
#[derive(Args, Debug)]
pub struct TriangulateArgs {
    /// The log.
    pub log: PathBuf,
    /// A first guess of the cameras: a TOML file with a table `[[webcams]]` for
    /// each, with `at`, `heading_deg`, `pitch_down_deg` and `field_of_view_deg`.
    /// The images of the first are on the topic `/webcam_1/image_raw/compressed`.
    #[arg(long, value_name = "FILE")]
    pub cameras: PathBuf,
    /// Places that are known: a CSV file with `seconds,x_m,y_m`, the seconds
    /// counted from the first image. A drawn log knows all places itself.
    #[arg(long, value_name = "FILE")]
    pub known: Option<PathBuf>,
    /// Where the places go, as CSV.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Hue of the hat, degrees: 0 red, 120 green, 240 blue.
    #[arg(long, value_name = "DEGREES", default_value_t = 120.0)]
    pub hue: f64,
    /// Every how many known places one is used to calibrate; the others are held out.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub every: usize,
}

/// The cameras of a guess; a scene is one, too.
#[derive(serde::Deserialize)]
struct Guess {
    webcams: Vec<WebcamSettings>,
}

/// What the cameras saw.
#[derive(Default)]
struct Seen {
    /// By camera: stamps and pixels of the hat.
    hats: Vec<(Stamp, Sight)>,
    /// Focal lengths and centres, where the log tells them.
    lenses: BTreeMap<usize, (f64, Point2<f64>)>,
    sizes: BTreeMap<usize, (usize, usize)>,
    /// Where the robot really was.
    robot: BTreeMap<u64, Isometry2<f64>>,
    first: Option<Stamp>,
}

/// `tagalong triangulate`.
///
/// # Errors
/// Files that cannot be read, a log without webcams, places that do not suffice.
pub fn triangulate(args: &TriangulateArgs) -> Outcome {
    check_log_path(&args.log)?;
    let guess = guess(&args.cameras)?;
    let colour = HatColour { hue_deg: args.hue, ..HatColour::default() };
    let seen = Seen::read(&args.log, guess.len(), &colour)?;
    if seen.hats.is_empty() {
        let text = "no camera sees a hat; images are looked for on /webcam_1/image_raw/compressed \
                    and so on, and the hue is --hue";
        return Err(Failure::failed(text));
    }
    let stations = seen.stations(&guess);
    let moments = moments(&seen.hats);
    let places = match &args.known {
        Some(path) => known_places(path, &seen)?,
        None => true_places(&args.log, &seen)?,
    };
    let known = known(&moments, &places);
    let used: Vec<Known> = known.iter().step_by(args.every.max(1)).cloned().collect();
    let calibrated = calibrate(&stations, &used);
    let held: Vec<Known> = known
        .iter()
        .enumerate()
        .filter(|(at, _)| at % args.every.max(1) != 0)
        .map(|(_, known)| known.clone())
        .collect();
    print(&summary(&calibrated, &stations, &used, &held))?;
    if let Some(path) = &args.output {
        let text = csv(&moments, &calibrated.stations);
        fs::write(path, text)
            .map_err(|error| Failure::failed(format!("{}: {error}", path.display())))?;
    }
    Ok(Ended::Well)
}

fn guess(path: &Path) -> Result<Vec<WebcamSettings>, Failure> {
    let wrong = |why: String| Failure::usage(format!("{}: {why}", path.display()));
    let text = fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
    let guess: Guess = toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    Ok(guess.webcams)
}

impl Seen {
    fn read(log: &Path, cameras: usize, colour: &HatColour) -> Result<Self, Failure> {
        let failed = |why: String| Failure::failed(format!("{}: {why}", log.display()));
        let file = File::open(log).map_err(|error| failed(error.to_string()))?;
        let limits = Limits::default();
        let mut walker = Walker::new(file, &limits).map_err(|error| failed(error.to_string()))?;
        let mut seen = Self::default();
        while let Some(message) = walker.next() {
            seen.take(&message, cameras, colour, &limits);
        }
        seen.hats.sort_by_key(|(stamp, sight)| (*stamp, sight.station));
        Ok(seen)
    }

    fn take(&mut self, message: &Message<'_>, cameras: usize, colour: &HatColour, limits: &Limits) {
        let topic = &*message.channel.topic;
        if topic == TRUE_ROBOT_TOPIC {
            let pose: Option<PoseStamped> = decode(message.data).ok();
            if let Some((stamp, pose)) =
                pose.and_then(|p| Some((p.header.stamp(), p.pose.isometry()?)))
            {
                self.robot.insert(stamp.nanos(), planar_pose(&pose));
            }
            return;
        }
        let Some((camera, rest)) = webcam(topic).filter(|(camera, _)| *camera < cameras) else {
            return;
        };
        if rest == "camera_info" {
            if let Ok(info) = decode::<CameraInfo>(message.data) {
                let centre = Point2::new(info.k[2], info.k[5]);
                self.lenses.insert(camera, (info.k[0], centre));
            }
        } else if let Some((stamp, pixels)) = image(message, limits) {
            self.look(camera, stamp, pixels, colour);
        }
    }

    fn look(&mut self, station: usize, stamp: Stamp, pixels: Pixels, colour: &HatColour) {
        let Pixels::Colour(image) = pixels else { return };
        self.sizes.insert(station, (image.width(), image.height()));
        self.first = Some(self.first.map_or(stamp, |first| first.min(stamp)));
        if let Some(hat) = find_hat(&image, colour).filter(|hat| !hat.cut) {
            self.hats.push((stamp, Sight { station, pixel: hat.centre }));
        }
    }

    /// The guess as stations, with the lenses of the log where it has them.
    fn stations(&self, guess: &[WebcamSettings]) -> Vec<Station> {
        let station = |(number, guess): (usize, &WebcamSettings)| {
            let (width, height) =
                self.sizes.get(&number).copied().unwrap_or((guess.width, guess.height));
            let middle = Point2::new(0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
            let by_view = 0.5 * width as f64 / (0.5 * guess.field_of_view_deg.to_radians()).tan();
            let (focal_px, centre_px) =
                self.lenses.get(&number).copied().unwrap_or((by_view, middle));
            Station {
                at: Point2::from(guess.at),
                heading_rad: guess.heading_deg.to_radians(),
                pitch_down_rad: guess.pitch_down_deg.to_radians(),
                focal_px,
                centre_px,
            }
        };
        guess.iter().enumerate().map(station).collect()
    }
}

/// The number of a webcam, from 0, and what follows it in a topic.
fn webcam(topic: &str) -> Option<(usize, &str)> {
    let (number, rest) = topic.strip_prefix("/webcam_")?.split_once('/')?;
    Some((number.parse::<usize>().ok()?.checked_sub(1)?, rest))
}

fn image(message: &Message<'_>, limits: &Limits) -> Option<(Stamp, Pixels)> {
    if message.channel.schema_name.ends_with("CompressedImage") {
        let image: CompressedImage<'_> = decode(message.data).ok()?;
        Some((image.header.stamp(), decode_compressed(&image, None, limits).ok()?))
    } else if message.channel.schema_name.ends_with("/Image") {
        let image: Image<'_> = decode(message.data).ok()?;
        Some((image.header.stamp(), decode_raw(&image, None, limits).ok()?))
    } else {
        None
    }
}

/// What all cameras saw at one moment.
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

/// The places of a file, by stamp.
fn known_places(path: &Path, seen: &Seen) -> Result<Places, Failure> {
    let wrong = |why: String| Failure::usage(format!("{}: {why}", path.display()));
    let text = fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
    let first = seen.first.map_or(0, |stamp| stamp.nanos());
    let mut places = Places::new();
    for (number, line) in text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()) {
        let numbers: Vec<f64> = line.split(',').filter_map(|n| n.trim().parse().ok()).collect();
        match numbers[..] {
            [seconds, x, y] if seconds >= 0.0 && x.is_finite() && y.is_finite() => {
                places.insert(first.saturating_add((1e9 * seconds) as u64), Point2::new(x, y));
            }
            _ if number == 0 => {}
            _ => return Err(wrong(format!("line {}: not `seconds,x_m,y_m`", number + 1))),
        }
    }
    Ok(places)
}

/// The places that a drawn log with one person knows.
fn true_places(log: &Path, seen: &Seen) -> Result<Places, Failure> {
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
        let text = "nothing says where the hat really was: give places with --known; a drawn log \
                    knows them if there is one person in it";
        return Err(Failure::usage(text));
    }
    Ok(places)
}

/// Moments whose place is known.
fn known(moments: &[(Stamp, Vec<Sight>)], places: &Places) -> Vec<Known> {
    let within = (1e9 * KNOWN_WITHIN_S) as u64;
    let nearest = |at: u64| {
        let near = places.range(at.saturating_sub(within)..=at.saturating_add(within));
        near.min_by_key(|(stamp, _)| stamp.abs_diff(at)).map(|(_, place)| *place)
    };
    moments
        .iter()
        .filter_map(|(stamp, sights)| {
            Some(Known { place: nearest(stamp.nanos())?, sights: sights.clone() })
        })
        .collect()
}

/// Distances of measured from known places, m.
fn distances(stations: &[Station], known: &[Known]) -> Vec<f64> {
    let fix = |known: &Known| meet(stations, &known.sights, SIGMA_RAD);
    known.iter().filter_map(|k| Some((fix(k)?.place - k.place).norm())).collect()
}

/// Standard deviation of a bearing, rad.
const SIGMA_RAD: f64 = 0.004;

fn summary(calibrated: &Calibrated, guess: &[Station], used: &[Known], held: &[Known]) -> String {
    let mut out =
        String::from("camera      x m      y m  heading  pitch  focal px  places  misfit\n");
    let rows = calibrated.stations.iter().zip(&calibrated.places).zip(&calibrated.misfit_rad);
    for (number, ((station, places), misfit)) in rows.enumerate() {
        let _ = writeln!(
            out,
            "{:>6} {:>8.3} {:>8.3} {:>8.2} {:>6.2} {:>9.1} {:>7} {:>6.2}\u{b0}",
            number + 1,
            station.at.x,
            station.at.y,
            station.heading_rad.to_degrees(),
            station.pitch_down_rad.to_degrees(),
            station.focal_px,
            places,
            misfit.to_degrees(),
        );
    }
    let mean = |stations: &[Station], known: &[Known]| {
        let all = distances(stations, known);
        let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
        format!("{:.1} cm at {} places", 100.0 * mean, all.len())
    };
    let _ = writeln!(out, "mean distance from known places, as guessed: {}", mean(guess, used));
    let _ = writeln!(out, "  calibrated with them: {}", mean(&calibrated.stations, used));
    let _ = writeln!(out, "  held out: {}", mean(&calibrated.stations, held));
    out
}

/// All places, as CSV.
fn csv(moments: &[(Stamp, Vec<Sight>)], stations: &[Station]) -> String {
    let mut out = String::from("stamp_ns,x_m,y_m,sigma_m,cameras,misfit_deg\n");
    for (stamp, sights) in moments {
        if let Some(Fix { place, covariance, misfit_rad }) = meet(stations, sights, SIGMA_RAD) {
            let _ = writeln!(
                out,
                "{},{:.4},{:.4},{:.4},{},{:.3}",
                stamp.nanos(),
                place.x,
                place.y,
                (0.5 * covariance.trace()).sqrt(),
                sights.len(),
                misfit_rad.to_degrees(),
            );
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn webcams_are_counted_from_one() {
        assert_eq!(webcam("/webcam_2/image_raw"), Some((1, "image_raw")));
        assert_eq!(webcam("/webcam_0/image_raw"), None);
        assert_eq!(webcam("/camera/color"), None);
    }

    #[test]
    fn sights_of_one_moment_come_together() {
        let at = |ms: u64, station| {
            let sight = Sight { station, pixel: Point2::origin() };
            (Stamp::from_nanos(ms * 1_000_000), sight)
        };
        let found = moments(&[at(0, 0), at(20, 1), at(333, 0), at(340, 2), at(700, 3)]);
        assert_eq!(found.iter().map(|(_, s)| s.len()).collect::<Vec<_>>(), [2, 2, 1]);
    }
}
