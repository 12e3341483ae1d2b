//! Search for the calibrations of images, anywhere in the log.

use super::name::TopicName;
use crate::camera_info::{CalibrationError, Intrinsics, intrinsics};
use crate::scan::{Scan, Type, calibration_by_points};

/// Relation of a calibration to the images for which it is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Relation {
    /// It is on the topic on which drivers publish it, or the settings name it.
    Own,
    /// It is on a nearby topic, for the same stream of the same device.
    SameStream,
    /// It has the frame id of the images.
    SameFrame,
    /// It is the only one for images of that size.
    SameSize,
}

impl Relation {
    /// Returns the relation as the end of a sentence; `None` if there is nothing to say.
    pub(crate) fn words(self) -> Option<&'static str> {
        match self {
            Self::Own => None,
            Self::SameStream => Some("of the same stream, in another folder"),
            Self::SameFrame => Some("of the same frame"),
            Self::SameSize => Some("the only one for images of that size"),
        }
    }
}

/// Calibration that was found for images.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FoundCalibration {
    pub(crate) topic: String,
    pub(crate) relation: Relation,
    /// A nearer calibration, with the reason why it cannot be used.
    pub(crate) instead_of: Option<String>,
}

impl FoundCalibration {
    pub(crate) fn new(topic: &str, relation: Relation) -> Self {
        Self { topic: topic.to_owned(), relation, instead_of: None }
    }
}

/// Returns the calibration of an image topic: the nearest one that can be used for its images, or
/// otherwise the nearest one.
pub(crate) fn calibration_of(
    scan: &Scan,
    image: &str,
    is_disparity: bool,
) -> Option<FoundCalibration> {
    let mut found = candidates(scan, image, is_disparity);
    let mut nearer: Option<String> = None;
    for at in 0..found.len() {
        match unfit(scan, image, &found[at].topic, is_disparity) {
            None => {
                let fitting = found.swap_remove(at);
                return Some(FoundCalibration { instead_of: nearer, ..fitting });
            }
            Some(why) => nearer = nearer.or(Some(why)),
        }
    }
    found.into_iter().next()
}

/// Returns the reason why a calibration cannot be used for images; `None` if it can.
fn unfit(scan: &Scan, image: &str, topic: &str, is_disparity: bool) -> Option<String> {
    match intrinsics_of(scan, image, topic, is_disparity) {
        Err(why) => Some(format!("{topic}: {why}")),
        Ok(lens) => misfit(scan, image, &lens).map(|size| format!("{topic} is {size}")),
    }
}

/// Returns the calibrations that may belong to an image topic, the nearest first.
fn candidates(scan: &Scan, image: &str, is_disparity: bool) -> Vec<FoundCalibration> {
    let mut likely: Vec<(String, Relation)> = Vec::new();
    let folder = folder_of(image);
    likely.push((format!("{folder}/camera_info"), Relation::Own));
    let kind = scan.topics.get(image).map(|topic| topic.kind);
    // Disparities are those of the left camera, whose calibration is beside its images.
    if is_disparity || kind == Some(Type::DisparityImage) {
        likely.push((format!("{folder}/left/camera_info"), Relation::Own));
    }
    if kind == Some(Type::PointCloud) {
        likely.push((calibration_by_points(image), Relation::Own));
    }
    let name = TopicName::of(image);
    let mut others: Vec<(usize, &String)> =
        scan.infos.keys().map(|info| (common_folders(image, info), info)).collect();
    // The one in the nearest namespace first; of equally near ones the first by name.
    others.sort_by_key(|(common, info)| (std::cmp::Reverse(*common), *info));
    for (_, info) in others.iter().filter(|(common, _)| *common > 0) {
        let other = TopicName::of(info);
        if (&other.device, other.stream, other.side) == (&name.device, name.stream, name.side) {
            likely.push(((*info).clone(), Relation::SameStream));
        }
    }
    let frame = scan.frame_of(image).filter(|frame| !frame.is_empty());
    for (_, info) in &others {
        let is_same = frame.is_some_and(|frame| scan.infos[*info].header.frame_id == frame);
        // Recordings of some cameras have the same frame id for all streams.
        if is_same && !name.contradicts(&TopicName::of(info)) {
            likely.push(((*info).clone(), Relation::SameFrame));
        }
    }
    let mut found: Vec<FoundCalibration> = Vec::new();
    for (topic, relation) in likely {
        let is_new = !found.iter().any(|known| known.topic == topic);
        if is_new && scan.infos.contains_key(&topic) {
            found.push(FoundCalibration::new(&topic, relation));
        }
    }
    if found.is_empty()
        && let Some(only) = only_of_size(scan, image)
    {
        found.push(FoundCalibration::new(&only, Relation::SameSize));
    }
    found
}

/// Returns the only calibration for images of this size that does not belong to other images.
fn only_of_size(scan: &Scan, image: &str) -> Option<String> {
    let size = scan.topics.get(image)?.size?;
    let name = TopicName::of(image);
    let fitting = scan.infos.iter().filter(|(info, message)| {
        (message.width, message.height) == size
            && !has_other_images(scan, image, info)
            && !name.contradicts(&TopicName::of(info))
    });
    let mut names = fitting.map(|(info, _)| info.clone());
    let only = names.next()?;
    names.next().is_none().then_some(only)
}

/// Returns true if a calibration belongs to other images than these.
fn has_other_images(scan: &Scan, image: &str, info: &str) -> bool {
    scan.topics.iter().any(|(other, topic)| {
        let is_image = topic.pixels.is_some() && other != image;
        is_image && format!("{}/camera_info", folder_of(other)) == info
    })
}

/// Returns the namespace of an image topic, without the suffixes of transports.
fn folder_of(image: &str) -> &str {
    let base = image.trim_end_matches("/compressedDepth").trim_end_matches("/compressed");
    base.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// Returns the number of leading namespaces that two topics share.
pub(super) fn common_folders(a: &str, b: &str) -> usize {
    folders(a).zip(folders(b)).take_while(|(a, b)| a == b).count()
}

/// Returns the namespaces of a topic, without its last name.
pub(super) fn folders(topic: &str) -> impl Iterator<Item = &str> {
    let (path, _) = topic.trim_matches('/').rsplit_once('/').unwrap_or_default();
    path.split('/').filter(move |_| !path.is_empty())
}

/// Returns the lens of an image topic from a calibration, scaled to the size of the images if an
/// integer factor explains the difference.
///
/// # Errors
/// A calibration that cannot be used. A wrong size is not an error here.
pub(crate) fn intrinsics_of(
    scan: &Scan,
    image: &str,
    info: &str,
    is_disparity: bool,
) -> Result<Intrinsics, CalibrationError> {
    let Some(message) = scan.infos.get(info) else { return Err(CalibrationError::Uncalibrated) };
    let topic = scan.topics.get(image);
    let is_disparity =
        is_disparity || topic.is_some_and(|topic| topic.kind == Type::DisparityImage);
    // For other images, the topic name is the only indication that they are rectified.
    let lens = intrinsics(message, image.contains("rect") || is_disparity)?;
    let size = topic.and_then(|topic| topic.size);
    Ok(match size {
        Some((width, height)) => lens.scaled_to(width as usize, height as usize).unwrap_or(lens),
        None => lens,
    })
}

/// Returns the error for a calibration that does not fit the images, with both sizes.
pub(crate) fn misfit(scan: &Scan, image: &str, lens: &Intrinsics) -> Option<CalibrationError> {
    let (width, height) = scan.topics.get(image)?.size?;
    crate::camera_info::check_size(lens, width as usize, height as usize).err()
}

/// Returns the calibrations of a log with their sizes, as text.
pub(crate) fn calibrations(scan: &Scan) -> String {
    let each = scan.infos.iter().map(|(topic, info)| {
        format!("{topic} ({}x{}, frame `{}`)", info.width, info.height, info.header.frame_id)
    });
    let all: Vec<String> = each.collect();
    if all.is_empty() { "there are none in the log".into() } else { all.join(", ") }
}
