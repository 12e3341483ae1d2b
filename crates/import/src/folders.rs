//! Folders of images, plain or in the layout of the MOTChallenge.

use std::path::PathBuf;

use tagalong_app::outcome::Failure;
use tagalong_config::{FileLimit, read_text};
use tagalong_geometry::{Camera, Pinhole};

use super::args::{ImportArgs, MAX_HZ};
use super::boxes;
use super::recorded;
use super::sequence::{Eye, Sequence, pictures, size, steady, text};
use super::truth::boxes_csv;

/// Reads a folder of images, with a folder of depth images if the options name one.
///
/// # Errors
/// Folders that cannot be read, or have different numbers of images.
pub fn images(args: &ImportArgs) -> Result<Sequence, Failure> {
    let files = pictures(&args.path)?;
    let annotated = args.boxes.as_ref().map(|boxes| boxes::read(boxes, &files)).transpose()?;
    let mut sequence = of_files(args, files, args.fps)?;
    if let Some((bodies, notes)) = annotated {
        sequence.beside.push(("boxes.csv", boxes_csv(&bodies)));
        sequence.notes.extend(notes);
    }
    let Some(folder) = &args.depth else { return Ok(sequence) };
    let depth = pictures(folder)?;
    // Images are paired by their order, so the counts must agree.
    if depth.len() != sequence.moments.len() {
        return Err(Failure::failed(format!(
            "{} holds {} images and {} holds {}; there must be one for each",
            folder.display(),
            depth.len(),
            args.path.display(),
            sequence.moments.len()
        )));
    }
    sequence.depth_unit_m = args.depth_unit;
    sequence.moments.extend(steady(depth, Eye::Depth, args.fps));
    // The log is written in the order of time, colour before depth.
    sequence.moments.sort_by_key(|moment| (moment.stamp, moment.eye));
    Ok(sequence)
}

/// Reads a sequence of the MOTChallenge: its images, and its truth if there is one.
///
/// # Errors
/// Files that are missing or wrong.
pub fn mot(args: &ImportArgs) -> Result<Sequence, Failure> {
    let ini = args.path.join("seqinfo.ini");
    let about = text(&ini, "a folder of the MOTChallenge, with seqinfo.ini and img1")?;
    let fps = ini_value(&about, "frameRate")
        .and_then(|hz| hz.parse::<f64>().ok())
        .filter(|hz| *hz > 0.0 && *hz <= MAX_HZ);
    let Some(fps) = fps else {
        let message =
            format!("{}: there is no `frameRate` above 0 and up to {MAX_HZ}", ini.display());
        return Err(Failure::failed(message));
    };
    let folder = args.path.join(ini_value(&about, "imDir").unwrap_or("img1"));
    if !folder.exists() {
        return Err(Failure::failed(format!(
            "{}: no such folder, so there are no images; `tagalong boxes FOLDER_OF_SEQUENCES` tracks \
             the boxes of det/det.txt without them; --boxes DIR names the folder of the boxes",
            folder.display()
        )));
    }
    let mut sequence = of_files(args, pictures(&folder)?, fps)?;
    if let Ok(truth) = read_text(&args.path.join("gt/gt.txt"), FileLimit::Table) {
        sequence.beside.push(("boxes.csv", truth));
    }
    let detections = args.path.join("det/det.txt");
    if detections.exists() {
        sequence.recorded = Some(recorded::config(&detections)?);
    }
    Ok(sequence)
}

/// Returns the value of a key in a `seqinfo.ini`.
fn ini_value<'t>(text: &'t str, key: &str) -> Option<&'t str> {
    let mut pairs = text.lines().filter_map(|line| line.split_once('='));
    pairs.find(|(name, _)| name.trim() == key).map(|(_, value)| value.trim())
}

/// Reads images with times at a constant rate, and with the camera of the options.
fn of_files(args: &ImportArgs, files: Vec<PathBuf>, fps: f64) -> Result<Sequence, Failure> {
    let columns = match files.first() {
        Some(first) => size(first)?.0,
        None => 0,
    };
    let mut sequence = Sequence {
        calibration: args.calibration(columns),
        moments: steady(files, Eye::Left, fps).collect(),
        mount: args.height.map(|height| level(height, args.tilt)),
        ..Sequence::default()
    };
    // Without a focal length the image still serves trackers that work in pixels.
    if sequence.calibration.is_none() {
        sequence.notes.push("no --focal and no --view: places in metres will be guesses".into());
    }
    Ok(sequence)
}

/// Returns the pose of a camera at a height above the floor that looks ahead, tilted down by an
/// angle.
pub fn level(height_m: f64, down_deg: f64) -> nalgebra::Isometry3<f64> {
    // The lens does not matter for the pose; any valid one will do.
    Camera::mounted(Pinhole::centred(1.0, 1, 1), 1, 1, height_m, down_deg.to_radians(), 0.0)
        .robot_from_camera
}
