//! Folders of the TUM RGB-D benchmark (Sturm et al., IROS 2012): `rgb.txt` and `depth.txt` list
//! images with their times, and `groundtruth.txt` the poses of the camera in a room whose floor is
//! at z = 0; depth has 5000 units per metre.
//!
//! The Bonn RGB-D dynamic dataset (Palazzolo et al., IROS 2019) has the same layout and unit, and
//! folders named `rgbd_bonn_*`. Its poses are not imported: they are those of markers on the
//! camera, in a frame whose floor is unknown.

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use tagalong_app::outcome::Failure;
use tagalong_core::Stamp;

use super::args::ImportArgs;
use super::folders::level;
use super::sequence::{
    Calibration, Eye, Moment, Placed, Sequence, lines, numbers, stamp as seconds, text,
};

const LAYOUT: &str = "a folder of the TUM RGB-D benchmark";
const DEPTH_UNIT_M: f64 = 1.0 / 5000.0;

/// Reads the folder.
///
/// # Errors
/// Files that are missing or wrong.
pub fn read(args: &ImportArgs) -> Result<Sequence, Failure> {
    let folder = &args.path;
    let mut notes = Vec::new();
    let mut moments = images(folder, "rgb.txt", Eye::Left, &mut notes)?;
    moments.extend(images(folder, "depth.txt", Eye::Depth, &mut notes)?);
    moments.sort_by_key(|moment| (moment.stamp, moment.eye));
    let truth = folder.join("groundtruth.txt");
    let has_poses = !is_bonn(folder) && truth.exists();
    let placed = if has_poses { poses(&truth)? } else { Vec::new() };
    if placed.is_empty() && args.height.is_none() {
        notes.push(
            "no poses of the camera: it is taken to stand still; --height and --tilt tell where"
                .into(),
        );
    }
    let columns = 640;
    let calibration = args.calibration(columns).unwrap_or_else(|| calibration(folder, &mut notes));
    // True poses of the camera take precedence over a constant mount.
    let mount = args.height.filter(|_| placed.is_empty()).map(|height| level(height, args.tilt));
    let calibration = Some(calibration);
    Ok(Sequence {
        moments,
        calibration,
        depth_unit_m: DEPTH_UNIT_M,
        mount,
        placed,
        notes,
        ..Sequence::default()
    })
}

/// Returns true for the Bonn dataset, by the name of the folder.
fn is_bonn(folder: &Path) -> bool {
    folder.to_string_lossy().contains("rgbd_bonn")
}

/// Returns the published intrinsics of the colour camera, by the name of the folder.
fn calibration(folder: &Path, notes: &mut Vec<String>) -> Calibration {
    let name = folder.to_string_lossy();
    let (focal, centre, distortion) = if name.contains("freiburg1") {
        let distortion = [0.2624, -0.9531, -0.0054, 0.0026, 1.1633];
        ([517.3, 516.5], [318.6, 255.3], distortion)
    } else if name.contains("freiburg2") {
        let distortion = [0.2312, -0.7849, -0.0033, -0.0001, 0.9172];
        ([520.9, 521.0], [325.1, 249.7], distortion)
    } else if is_bonn(folder) {
        let distortion = [0.039903, -0.099343, -0.000730, -0.000144, 0.0];
        ([542.822841, 542.576870], [315.593520, 237.756098], distortion)
    } else if name.contains("freiburg3") {
        ([535.4, 539.2], [320.1, 247.6], [0.0; 5])
    } else {
        notes.push(
            "not freiburg1 to 3 nor rgbd_bonn by its name: the usual 525 pixels of focal length are taken".into(),
        );
        ([525.0, 525.0], [319.5, 239.5], [0.0; 5])
    };
    Calibration { focal, centre: Some(centre), distortion }
}

/// Reads a list of images. Missing images, for example in a part of a sequence, are left out.
fn images(
    folder: &Path,
    list: &str,
    eye: Eye,
    notes: &mut Vec<String>,
) -> Result<Vec<Moment>, Failure> {
    let path = folder.join(list);
    let text = text(&path, LAYOUT)?;
    let listed: Result<Vec<Moment>, Failure> = lines(&text)
        .map(|(number, line)| {
            let mut words = line.split_whitespace();
            let stamp = stamp(words.next().unwrap_or_default(), &path, number)?;
            let Some(file) = words.next() else {
                let message = format!("{}:{number}: no file after the time", path.display());
                return Err(Failure::failed(message));
            };
            Ok(Moment { stamp, eye, file: folder.join(file) })
        })
        .collect();
    let listed = listed?;
    let count = listed.len();
    let present: Vec<Moment> = listed.into_iter().filter(|moment| moment.file.is_file()).collect();
    if present.len() < count {
        let absent = count - present.len();
        notes.push(format!("{absent} of {count} images of {list} are not there and left out"));
    }
    Ok(present)
}

fn stamp(word: &str, path: &Path, line: usize) -> Result<Stamp, Failure> {
    seconds(word)
        .ok_or_else(|| Failure::failed(format!("{}:{line}: `{word}` is no time", path.display())))
}

/// Returns the poses of the robot: at the point on the floor below the camera, with the heading of
/// its optical axis.
fn poses(path: &Path) -> Result<Vec<Placed>, Failure> {
    let text = text(path, LAYOUT)?;
    lines(&text)
        .map(|(line, words)| {
            let mut words = words.split_whitespace();
            let stamp = stamp(words.next().unwrap_or_default(), path, line)?;
            let &[x, y, z, qx, qy, qz, qw] = &numbers(words, path, line)?[..] else {
                let message = format!("{}:{line}: not `time x y z qx qy qz qw`", path.display());
                return Err(Failure::failed(message));
            };
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
            Ok(below(stamp, &Isometry3::from_parts(Translation3::new(x, y, z), turn)))
        })
        .collect()
}

fn below(stamp: Stamp, room_from_camera: &Isometry3<f64>) -> Placed {
    let at = room_from_camera.translation;
    let ahead = room_from_camera.rotation * Vector3::z();
    let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), ahead.y.atan2(ahead.x));
    let odom_from_robot = Isometry3::from_parts(Translation3::new(at.x, at.y, 0.0), heading);
    let robot_from_camera = Some(odom_from_robot.inverse() * room_from_camera);
    Placed { stamp, odom_from_robot, robot_from_camera }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_robot_is_below_the_camera_and_looks_where_it_looks() {
        let camera = level(1.4, 10.0);
        let robot = Isometry3::new(Vector3::new(2.0, -1.0, 0.0), Vector3::new(0.0, 0.0, 0.7));
        let placed = below(Stamp::default(), &(robot * camera));
        let off = placed.odom_from_robot.to_homogeneous() - robot.to_homogeneous();
        assert!(off.norm() < 1e-9, "{off}");
        let off = placed.robot_from_camera.unwrap().to_homogeneous() - camera.to_homogeneous();
        assert!(off.norm() < 1e-9, "{off}");
    }
}
