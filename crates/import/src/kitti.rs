//! KITTI tracking (Geiger et al., CVPR 2012): `image_02` and `image_03` are the rectified colour
//! pair, `calib` has their projections, `label_02` has boxes of people, and `oxts` has the poses of
//! the car.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use tagalong_app::outcome::Failure;
use tagalong_eval::formats::MOST_FRAMES;

use super::args::ImportArgs;
use super::folders::level;
use super::sequence::{Calibration, EPOCH, Eye, Placed, Sequence, numbers, pictures, steady, text};

const LAYOUT: &str =
    "the `training` or `testing` folder of KITTI tracking, and that a sequence of it";
/// Images per second.
const HZ: f64 = 10.0;
/// Height of the cameras above the road, m.
const HEIGHT_M: f64 = 1.65;

/// Reads a sequence.
///
/// # Errors
/// Files that are missing or wrong.
pub fn read(args: &ImportArgs) -> Result<Sequence, Failure> {
    let folder = &args.path;
    let name = &args.sequence;
    let [left, right] = projections(&folder.join("calib").join(format!("{name}.txt")))?;
    // The fourth column of a projection is minus the focal length times the camera's offset.
    let baseline_m = (left[3] - right[3]) / left[0];
    let left_files = pictures(&folder.join("image_02").join(name))?;
    let mut moments: Vec<_> = steady(left_files, Eye::Left, HZ).collect();
    let right_folder = folder.join("image_03").join(name);
    let is_pair = right_folder.exists();
    if is_pair {
        moments.extend(steady(pictures(&right_folder)?, Eye::Right, HZ));
        moments.sort_by_key(|moment| (moment.stamp, moment.eye));
    }
    let labels = folder.join("label_02").join(format!("{name}.txt"));
    let beside = if labels.exists() { vec![("boxes.csv", boxes(&labels)?)] } else { Vec::new() };
    let oxts = folder.join("oxts").join(format!("{name}.txt"));
    let calibration = Calibration {
        focal: [left[0], left[5]],
        centre: Some([left[2], left[6]]),
        distortion: [0.0; 5],
    };
    Ok(Sequence {
        moments,
        calibration: Some(calibration),
        baseline_m: if is_pair { baseline_m } else { 0.0 },
        mount: Some(level(args.height.unwrap_or(HEIGHT_M), args.tilt)),
        placed: if oxts.exists() { drive(&oxts)? } else { Vec::new() },
        beside,
        ..Sequence::default()
    })
}

/// Returns P2 and P3, row by row.
fn projections(path: &Path) -> Result<[[f64; 12]; 2], Failure> {
    let text = text(path, LAYOUT)?;
    Ok([projection(&text, path, "P2:")?, projection(&text, path, "P3:")?])
}

fn projection(text: &str, path: &Path, name: &str) -> Result<[f64; 12], Failure> {
    let lines = (1..).zip(text.lines());
    let mut found = lines.filter_map(|(number, line)| Some((number, line.strip_prefix(name)?)));
    if let Some((number, line)) = found.next() {
        let values: Result<[f64; 12], _> =
            numbers(line.split_whitespace(), path, number)?.try_into();
        if let Some(values) = values.ok().filter(|values| values[0] > 0.0) {
            return Ok(values);
        }
    }
    Err(Failure::failed(format!("{}: no twelve numbers after {name}", path.display())))
}

/// Columns of a label: frame, id, type, truncated, occluded, alpha, and the box.
const BOX: std::ops::Range<usize> = 6..10;

/// Returns the boxes of people as MOTChallenge truth: pedestrians count; a sitting or riding person
/// is neither a miss nor a false alarm.
fn boxes(path: &Path) -> Result<String, Failure> {
    let text = text(path, LAYOUT)?;
    let mut out = String::new();
    for (number, line) in (1..).zip(text.lines()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let class = match words.get(2) {
            Some(&"Pedestrian") => 1,
            Some(&"Person" | &"Person_sitting") => 7,
            Some(&"Cyclist") => 2,
            _ => continue,
        };
        let frame = words[0].parse::<u32>().ok().filter(|frame| *frame < MOST_FRAMES);
        let (Some(frame), Some(corners)) = (frame, words.get(BOX)) else {
            return Err(no_label(path, number));
        };
        let &[left, top, right, bottom] = &numbers(corners.iter().copied(), path, number)?[..]
        else {
            return Err(no_label(path, number));
        };
        let width = right - left;
        let height = bottom - top;
        let id = words[1];
        let counts = u8::from(class == 1);
        let _ = writeln!(
            out,
            "{},{id},{left},{top},{width:.3},{height:.3},{counts},{class},-1",
            // KITTI counts frames from 0, MOTChallenge from 1.
            frame + 1
        );
    }
    Ok(out)
}

/// Returns the failure for a line that is not a label.
fn no_label(path: &Path, line: usize) -> Failure {
    Failure::failed(format!("{}:{line}: not a label of KITTI", path.display()))
}

/// Radius of the earth in KITTI's own tools, m.
const EARTH_M: f64 = 6_378_137.0;

/// Converts latitude, longitude and heading to poses on a plane (Mercator projection with true
/// scale at the first latitude), relative to the first pose.
fn drive(path: &Path) -> Result<Vec<Placed>, Failure> {
    let text = text(path, LAYOUT)?;
    let mut first: Option<Isometry3<f64>> = None;
    let mut scale = 0.0;
    let mut placed = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let values = numbers(line.split_whitespace(), path, index + 1)?;
        let &[latitude, longitude, _, _, _, yaw, ..] = &values[..] else {
            return Err(Failure::failed(format!(
                "{}:{}: not a line of oxts",
                path.display(),
                index + 1
            )));
        };
        if first.is_none() {
            scale = (latitude * PI / 180.0).cos();
        }
        let x = scale * EARTH_M * longitude * PI / 180.0;
        let y = scale * EARTH_M * ((90.0 + latitude) * PI / 360.0).tan().ln();
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        let here = Isometry3::from_parts(Translation3::new(x, y, 0.0), turn);
        let start = *first.get_or_insert(here);
        placed.push(Placed {
            stamp: EPOCH.plus_seconds(index as f64 / HZ),
            odom_from_robot: start.inverse() * here,
            robot_from_camera: None,
        });
    }
    Ok(placed)
}
