//! Writing of a sequence as a log with the topics that robots use.

use std::path::Path;

use image::{DynamicImage, GenericImageView as _};
use tagalong_app::outcome::Failure;
use tagalong_app::signals::Signals;
use tagalong_config::{FileLimit, read_bytes};
use tagalong_core::Stamp;
use tagalong_geometry::{Distortion, Pinhole};
use tagalong_log::msgs::{CameraInfo, CompressedImage, Header, Image, Odometry, TFMessage};
use tagalong_log::write::{MessageLog, WriteError};

use super::sequence::{Eye, Moment, Placed, Sequence};

const CAMERA_FRAME: &str = "camera_optical_frame";
const RIGHT_FRAME: &str = "camera_right_optical_frame";
const ROBOT_FRAME: &str = "base_link";
const ODOM_FRAME: &str = "odom";

/// Writes the log until the end or a signal.
///
/// # Errors
/// Exit code 1 for an image that cannot be read; 2 for a log that cannot be written.
pub fn write(sequence: &Sequence, path: &Path, signals: &Signals) -> Result<(), Failure> {
    let mut log = MessageLog::create(path).map_err(Failure::usage)?;
    let start = sequence.moments.first().map_or(Stamp::default(), |moment| moment.stamp);
    if let Some(mount) = &sequence.mount {
        let tf = TFMessage::of_link(start, ROBOT_FRAME, CAMERA_FRAME, mount);
        log.send("/tf_static", start, &tf).map_err(Failure::failed)?;
    }
    let mut places = sequence.placed.iter().peekable();
    for moment in sequence.moments.iter().take_while(|_| signals.received().is_none()) {
        // A pose is written before its image.
        while let Some(placed) = places.next_if(|placed| placed.stamp <= moment.stamp) {
            place(&mut log, placed).map_err(Failure::failed)?;
        }
        picture(&mut log, sequence, moment)?;
    }
    for placed in places {
        place(&mut log, placed).map_err(Failure::failed)?;
    }
    log.finish().map_err(Failure::failed)
}

fn place(log: &mut MessageLog, placed: &Placed) -> Result<(), WriteError> {
    if let Some(camera) = &placed.robot_from_camera {
        let tf = TFMessage::of_link(placed.stamp, ROBOT_FRAME, CAMERA_FRAME, camera);
        log.send("/tf", placed.stamp, &tf)?;
    }
    let pose = &placed.odom_from_robot;
    log.send("/odom", placed.stamp, &Odometry::of_pose(placed.stamp, ODOM_FRAME, ROBOT_FRAME, pose))
}

/// Writes one image with its calibration.
fn picture(log: &mut MessageLog, sequence: &Sequence, moment: &Moment) -> Result<(), Failure> {
    let is_pair = sequence.baseline_m > 0.0;
    let (camera, frame, aside_m) = match moment.eye {
        Eye::Left if is_pair => ("/stereo/left", CAMERA_FRAME, 0.0),
        Eye::Left => ("/camera/color", CAMERA_FRAME, 0.0),
        Eye::Right => ("/stereo/right", RIGHT_FRAME, sequence.baseline_m),
        Eye::Depth => ("/camera/aligned_depth_to_color", CAMERA_FRAME, 0.0),
    };
    let header = Header::new(moment.stamp, frame);
    let (data, decoded) = whole_image(&moment.file)?;
    if let Some(info) = info(sequence, &header, decoded.dimensions(), aside_m) {
        log.send(&format!("{camera}/camera_info"), moment.stamp, &info).map_err(Failure::failed)?;
    }
    if moment.eye == Eye::Depth {
        return depth(log, sequence.depth_unit_m, moment, decoded, header);
    }
    // By content: file endings in data sets are not reliable.
    let format = if data.starts_with(b"\x89PNG") { "png" } else { "jpeg" }.to_owned();
    let image = if is_pair { "image_rect_color" } else { "image_raw" };
    let message = CompressedImage { header, format, data: &data };
    log.send(&format!("{camera}/{image}/compressed"), moment.stamp, &message)
        .map_err(Failure::failed)
}

fn info(
    sequence: &Sequence,
    header: &Header,
    (width, height): (u32, u32),
    aside_m: f64,
) -> Option<CameraInfo> {
    let lens = sequence.calibration?;
    let [fx, fy] = lens.focal;
    // Pixel centres have whole coordinates, so the middle of the image is half a pixel less.
    let middle = [width, height].map(|side| 0.5 * (f64::from(side) - 1.0));
    let [cx, cy] = lens.centre.unwrap_or(middle);
    let distortion = Distortion::PlumbBob(lens.distortion);
    let lens = Pinhole { fx, fy, cx, cy, distortion };
    Some(CameraInfo::of_lens(header, &lens, (width as usize, height as usize), aside_m))
}

/// Reads the bytes of an image, and checks that it can be decoded completely.
fn whole_image(file: &Path) -> Result<(Vec<u8>, DynamicImage), Failure> {
    let data = read_bytes(file, FileLimit::Image).map_err(|error| unusable_file(file, &error))?;
    let decoded = image::load_from_memory(&data).map_err(|error| unusable_file(file, &error))?;
    Ok((data, decoded))
}

/// Returns the failure for a file that is not a readable image.
fn unusable_file(file: &Path, why: &dyn std::fmt::Display) -> Failure {
    Failure::failed(format!("cannot use {}: {why}", file.display()))
}

/// Writes a 16-bit PNG as a depth image in millimetres.
fn depth(
    log: &mut MessageLog,
    unit_m: f64,
    moment: &Moment,
    decoded: DynamicImage,
    header: Header,
) -> Result<(), Failure> {
    let image = match decoded {
        DynamicImage::ImageLuma16(image) => image,
        other => {
            let shown = moment.file.display();
            let colour = other.color();
            let why = format!("depth is a 16-bit grey PNG, this is {colour:?}");
            return Err(Failure::failed(format!("cannot use {shown}: {why}")));
        }
    };
    // Saturates at 65.535 m, the largest value of 16 bits in millimetres.
    let millimetres =
        image.as_raw().iter().map(|value| (f64::from(*value) * unit_m * 1e3).round().min(65535.0));
    let data: Vec<u8> = millimetres.flat_map(|value| (value as u16).to_le_bytes()).collect();
    let (width, height) = image.dimensions();
    let message = Image::packed(header, "16UC1", width, height, &data);
    log.send("/camera/aligned_depth_to_color/image_raw", moment.stamp, &message)
        .map_err(Failure::failed)
}
