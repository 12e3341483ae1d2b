//! Common representation of all layouts.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use tagalong_app::outcome::Failure;
use tagalong_config::{FileLimit, read_text};
use tagalong_core::Stamp;

use super::args::ImportArgs;

/// Start time of a sequence without a clock.
pub const EPOCH: Stamp = Stamp::from_nanos(1_700_000_000_000_000_000);

/// Intrinsics of a camera: focal lengths in both directions and the principal point, pixels, and
/// the `plumb_bob` distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Focal lengths, pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels; `None`: the centre of the image.
    pub centre: Option<[f64; 2]>,
    /// Distortion.
    pub distortion: [f64; 5],
}

/// Kind of an image of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Eye {
    /// Colour image, or the left one of a pair.
    Left,
    /// Right image of a pair.
    Right,
    /// Depth image.
    Depth,
}

/// Image file with its capture time.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Capture time.
    pub stamp: Stamp,
    /// Kind of the image.
    pub eye: Eye,
    /// Path of the file.
    pub file: PathBuf,
}

/// Pose at a point in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Time of the pose.
    pub stamp: Stamp,
    /// Pose of the robot, on the floor, in the odometry frame.
    pub odom_from_robot: Isometry3<f64>,
    /// Pose of the camera on the robot; `None` if it does not move.
    pub robot_from_camera: Option<Isometry3<f64>>,
}

/// Sequence of images, independent of the layout.
#[derive(Default)]
pub struct Sequence {
    /// Images, in the order of time.
    pub moments: Vec<Moment>,
    /// Lens, if it is known.
    pub calibration: Option<Calibration>,
    /// Distance of the right camera from the left one, m.
    pub baseline_m: f64,
    /// Metres per unit of depth.
    pub depth_unit_m: f64,
    /// Pose of the camera on the robot, where it does not move.
    pub mount: Option<Isometry3<f64>>,
    /// Poses of the robot.
    pub placed: Vec<Placed>,
    /// Files that are written beside the log: their ending and their text.
    pub beside: Vec<(&'static str, String)>,
    /// Config that tracks the recorded detections of the sequence, if it has any.
    pub recorded: Option<String>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Reads a text file of a layout.
///
/// # Errors
/// A missing file, which means that the folder has another layout.
pub fn text(path: &Path, layout: &str) -> Result<String, Failure> {
    read_text(path, FileLimit::Table).map_err(|error| {
        let shown = path.display();
        Failure::failed(format!("cannot read {shown}: {error}; is this {layout}?"))
    })
}

/// Returns the lines of a text that are neither empty nor comments, with their numbers from 1.
pub fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let numbered = (1..).zip(text.lines().map(str::trim));
    numbered.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Parses seconds with a fraction exactly.
pub fn stamp(word: &str) -> Option<Stamp> {
    // A double cannot hold nanoseconds of today's times, so the digits are parsed as integers.
    let (seconds, fraction) = word.split_once('.').unwrap_or((word, "0"));
    let seconds: u64 = seconds.parse().ok()?;
    let nanos: u64 = format!("{fraction:0<9}").get(..9)?.parse().ok()?;
    seconds.checked_mul(1_000_000_000)?.checked_add(nanos).map(Stamp::from_nanos)
}

/// Returns the blank-separated numbers of a line.
///
/// # Errors
/// A word that is not a number, with the file and the line.
pub fn numbers<'a>(
    words: impl Iterator<Item = &'a str>,
    path: &Path,
    line: usize,
) -> Result<Vec<f64>, Failure> {
    words
        .map(|word| match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(Failure::failed(format!("{}:{line}: `{word}` is no number", path.display()))),
        })
        .collect()
}

/// File name extensions of images that are copied unchanged.
pub const PICTURES: [&str; 3] = ["jpg", "jpeg", "png"];

/// Returns the JPEG and PNG files of a folder, sorted by name, with numbers in names in numerical
/// order.
///
/// # Errors
/// A folder that cannot be read.
pub fn pictures(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    files(folder, &PICTURES)
}

/// Returns the files of a folder with one of the extensions, sorted by name, with numbers in names
/// in numerical order.
///
/// # Errors
/// A folder that cannot be read.
pub fn files(folder: &Path, endings: &[&str]) -> Result<Vec<PathBuf>, Failure> {
    let entries = fs::read_dir(folder)
        .map_err(|error| Failure::failed(format!("cannot read {}: {error}", folder.display())))?;
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        endings.contains(&extension.to_lowercase().as_str())
    });
    // The order of a directory depends on the file system.
    files.sort_by_cached_key(|path| (counted(path), path.clone()));
    Ok(files)
}

/// Returns the words and numbers of a name: `img2` comes before `img10`.
fn counted(path: &Path) -> Vec<(String, u64)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut parts = Vec::new();
    let mut rest = name.as_str();
    while !rest.is_empty() {
        let word = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let behind = &rest[word..];
        let digits = behind.find(|c: char| !c.is_ascii_digit()).unwrap_or(behind.len());
        // A number beyond the range is the last one.
        parts.push((rest[..word].to_owned(), behind[..digits].parse().unwrap_or(u64::MAX)));
        rest = &behind[digits..];
    }
    parts
}

/// Returns files with times at a constant rate.
pub fn steady(files: Vec<PathBuf>, eye: Eye, hz: f64) -> impl Iterator<Item = Moment> {
    files.into_iter().enumerate().map(move |(index, file)| Moment {
        stamp: EPOCH.plus_seconds(index as f64 / hz),
        eye,
        file,
    })
}

impl ImportArgs {
    /// Returns the lens of the options, for images with this number of columns.
    pub fn calibration(&self, columns: u32) -> Option<Calibration> {
        let half = 0.5 * f64::from(columns);
        let by_view = self.view.map(|view| half / (0.5 * view.to_radians()).tan());
        let focal = self.focal.or(by_view)?;
        Some(Calibration { focal: [focal; 2], centre: None, distortion: [0.0; 5] })
    }
}

/// Returns the columns and rows of an image file.
///
/// # Errors
/// A file that is not an image.
pub fn size(file: &Path) -> Result<(u32, u32), Failure> {
    image::image_dimensions(file)
        .map_err(|error| Failure::failed(format!("cannot read {}: {error}", file.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_keep_every_digit() {
        for (word, nanos) in [
            ("1305031102.175304", Some(1_305_031_102_175_304_000)),
            ("1339064317.986969085", Some(1_339_064_317_986_969_085)),
            ("7", Some(7_000_000_000)),
            ("x.5", None),
            ("1.x", None),
            ("", None),
        ] {
            assert_eq!(stamp(word).map(Stamp::nanos), nanos, "{word}");
        }
    }
}
