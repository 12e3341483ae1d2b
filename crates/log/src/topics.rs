//! Choice of the topics of a log: colour images, depth images, and so on.

use tagalong_config::nearest;
use tagalong_core::{Input, Inputs, Usage};

use crate::images::Content;
use crate::scan::{Scan, Topic, Type};
use crate::{InputSettings, LogError};

/// Topics that are read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Chosen {
    pub(crate) colour: Option<String>,
    pub(crate) depth: Option<String>,
    pub(crate) right: Option<String>,
    pub(crate) colour_info: Option<String>,
    pub(crate) depth_info: Option<String>,
    pub(crate) right_info: Option<String>,
    pub(crate) odometry: Option<String>,
    pub(crate) laser: Option<String>,
    pub(crate) detections: Option<String>,
}

impl Chosen {
    /// Returns true for a topic that is read.
    pub(crate) fn has(&self, topic: &str) -> bool {
        let Self { colour, depth, right, colour_info, depth_info, right_info, .. } = self;
        [colour, depth, right, colour_info, depth_info, right_info]
            .into_iter()
            .chain([&self.odometry, &self.laser, &self.detections])
            .any(|chosen| chosen.as_deref() == Some(topic))
    }
}

/// Chooses topics as named in the settings, else by type, encoding and name. A topic of an unused
/// input is not chosen, as if the log did not have it, with one exception: frames are numbered and
/// timed by the images of the colour topic, and without it by those of the depth topic. In a log
/// without images they are laser scans.
///
/// # Errors
/// [`LogError::Missing`] for a named topic that is not there, and for required inputs that are not
/// found.
pub(crate) fn choose(
    scan: &Scan,
    input: &InputSettings,
    inputs: Inputs,
) -> Result<Chosen, LogError> {
    let images = &[Type::Image, Type::CompressedImage][..];
    let infos = &[Type::CameraInfo][..];
    let detections = &[Type::Detections2D, Type::Detections3D][..];
    let named = |key, topic: &Option<String>, types| named(scan, key, topic.as_deref(), types);
    let colour = named("colour_topic", &input.colour_topic, images)?
        .or_else(|| best(scan, |name, topic| colour_rank(name, topic, false)));
    let depth = match inputs.uses(Input::Depth) || colour.is_none() {
        true => {
            named("depth_topic", &input.depth_topic, images)?.or_else(|| best(scan, depth_rank))
        }
        false => None,
    };
    let right = match inputs.uses(Input::Right) {
        true => named("right_topic", &input.right_topic, images)?
            .or_else(|| best(scan, |name, topic| colour_rank(name, topic, true))),
        false => None,
    };
    // The settings may name the right images as the colour topic.
    let right = right.filter(|topic| Some(topic) != colour.as_ref());
    let laser = match inputs.uses(Input::Laser) {
        true => named("laser_topic", &input.laser_topic, &[Type::LaserScan])?
            .or_else(|| best(scan, laser_rank)),
        false => None,
    };
    let detections = match inputs.uses(Input::Detections) {
        true => named("detections_topic", &input.detections_topic, detections)?,
        false => None,
    };
    let odometry = named("odometry_topic", &input.odometry_topic, &[Type::Odometry])?
        .or_else(|| best(scan, odometry_rank));
    let info = |key, wanted: &Option<String>, image: &Option<String>| {
        Ok::<_, LogError>(named(key, wanted, infos)?.or_else(|| info_of(scan, image.as_deref()?)))
    };
    let chosen = Chosen {
        colour_info: info("colour_info_topic", &input.colour_info_topic, &colour)?,
        depth_info: info("depth_info_topic", &input.depth_info_topic, &depth)?,
        right_info: info("right_info_topic", &input.right_info_topic, &right)?,
        colour,
        depth,
        right,
        odometry,
        laser,
        detections,
    };
    check(scan, &chosen, inputs)?;
    Ok(chosen)
}

fn check(scan: &Scan, chosen: &Chosen, inputs: Inputs) -> Result<(), LogError> {
    if let Some(Input::Named(name)) = inputs.of(Usage::Required).find(is_named) {
        return Err(missing(scan, format!("input `{name}`"), UNREADABLE.to_owned()));
    }
    let lacks = |input, topic: &Option<String>| inputs.requires(input) && topic.is_none();
    let wanted = [
        (lacks(Input::Colour, &chosen.colour), "colour images", "colour_topic", COLOUR),
        (lacks(Input::Depth, &chosen.depth), "depth images", "depth_topic", DEPTH),
        (
            lacks(Input::Right, &chosen.right),
            "right images of a stereo pair",
            "right_topic",
            COLOUR,
        ),
        (lacks(Input::Laser, &chosen.laser), "laser scans", "laser_topic", LASER),
        (
            lacks(Input::Detections, &chosen.detections),
            "recorded detections that `detections_topic` under [input] names",
            "detections_topic",
            DETECTIONS,
        ),
        (
            chosen.colour.is_none() && chosen.depth.is_none() && chosen.laser.is_none(),
            "images at all",
            "colour_topic",
            COLOUR,
        ),
    ];
    match wanted.into_iter().find(|(missing, ..)| *missing) {
        None => Ok(()),
        Some((_, what, key, kinds)) => {
            let types = match key {
                "laser_topic" => &[Type::LaserScan][..],
                "detections_topic" => &[Type::Detections2D, Type::Detections3D],
                _ => &[Type::Image, Type::CompressedImage],
            };
            let fitting = scan.topics.iter().find(|(_, topic)| types.contains(&topic.kind));
            let hint = fitting.map(|(name, topic)| {
                let kind = topic.pixels.as_deref().unwrap_or(&topic.schema);
                format!("; if {name} ({kind}) is meant, name it as `{key}` under [input]")
            });
            Err(missing(scan, format!("{what} ({kinds})"), hint.unwrap_or_default()))
        }
    }
}

fn is_named(input: &Input) -> bool {
    matches!(input, Input::Named(_))
}

/// Remedy for an input of a sensor that another crate defines.
const UNREADABLE: &str = ", because no topic is read for it: a program that adds it to each frame \
                          with `Frame::with_sensor` opens the log with `inputs.relax(..)`; \
                          otherwise leave out the plugin that requires it";
const COLOUR: &str = "sensor_msgs/Image with colour, mono, bayer or yuv pixels of 8 bits, or \
                      sensor_msgs/CompressedImage with jpeg or png";
const LASER: &str = "sensor_msgs/LaserScan";
const DETECTIONS: &str = "vision_msgs/Detection2DArray or Detection3DArray";
const DEPTH: &str = "sensor_msgs/Image with 16UC1 or 32FC1, or sensor_msgs/CompressedImage \
                     with compressedDepth";

pub(crate) fn missing(scan: &Scan, wanted: String, hint: String) -> LogError {
    LogError::Missing { path: scan.path.clone(), wanted, hint, present: scan.listing() }
}

fn is_image(topic: &Topic) -> bool {
    matches!(topic.kind, Type::Image | Type::CompressedImage)
}

/// Returns a topic that the settings name.
fn named(
    scan: &Scan,
    key: &str,
    name: Option<&str>,
    types: &[Type],
) -> Result<Option<String>, LogError> {
    let Some(name) = name else { return Ok(None) };
    if scan.topics.get(name).is_some_and(|topic| types.contains(&topic.kind)) {
        return Ok(Some(name.to_owned()));
    }
    let fitting = scan.topics.iter().filter(|(_, topic)| types.contains(&topic.kind));
    let near = nearest(name, fitting.map(|(name, _)| name.as_str()));
    let hint = near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
    Err(missing(scan, format!("topic `{name}` fit for `{key}` of [input]"), hint))
}

/// Returns the topic with the highest rank; of equal ones that with the most messages, then the
/// first by name.
fn best(scan: &Scan, rank: impl Fn(&str, &Topic) -> Option<i32>) -> Option<String> {
    let ranked =
        scan.topics.iter().filter(|(_, topic)| topic.count > 0).filter_map(|(name, topic)| {
            Some((rank(&name.to_lowercase(), topic)?, topic.count, name))
        });
    // Reversed, because the last of equal maxima is returned.
    ranked.rev().max_by_key(|(rank, count, _)| (*rank, *count)).map(|(.., name)| name.clone())
}

fn has(name: &str, words: &[&str]) -> bool {
    words.iter().any(|word| name.contains(word))
}

fn colour_rank(name: &str, topic: &Topic, right: bool) -> Option<i32> {
    let is_right = has(name, &["right", "infra2"]);
    if !is_image(topic) || topic.content != Content::Picture || is_right != right {
        return None;
    }
    // A name for colour decides before one for a side, and before an uncompressed image.
    let mut rank = 0;
    rank += 8 * i32::from(has(name, &["color", "colour", "rgb"]));
    rank += 4 * i32::from(has(name, &["left", "front", "rect"]));
    rank -= 6 * i32::from(has(name, &["infra", "/ir", "depth", "fisheye", "mono", "debug"]));
    rank += i32::from(topic.kind == Type::Image);
    Some(rank)
}

fn depth_rank(name: &str, topic: &Topic) -> Option<i32> {
    if !is_image(topic) || topic.content != Content::Depth {
        return None;
    }
    let mut rank = 0;
    rank += 8 * i32::from(has(name, &["aligned", "registered"]));
    rank += 4 * i32::from(name.contains("depth"));
    rank -= 6 * i32::from(has(name, &["infra", "/ir", "confidence", "debug", "disparity"]));
    rank += i32::from(topic.kind == Type::Image);
    Some(rank)
}

fn odometry_rank(name: &str, topic: &Topic) -> Option<i32> {
    let filtered = has(name, &["filtered", "fused"]);
    (topic.kind == Type::Odometry).then(|| i32::from(!has(name, &["visual"])) + i32::from(filtered))
}

fn laser_rank(name: &str, topic: &Topic) -> Option<i32> {
    let rank = 2 * i32::from(name.ends_with("/scan")) - i32::from(has(name, &["rear", "back"]));
    (topic.kind == Type::LaserScan).then_some(rank)
}

/// Returns the calibration of an image topic: its `camera_info` sibling, else the only one with the
/// same frame.
fn info_of(scan: &Scan, image: &str) -> Option<String> {
    let base = image.trim_end_matches("/compressedDepth").trim_end_matches("/compressed");
    let folder = base.rsplit_once('/').map_or("", |(folder, _)| folder);
    let sibling = format!("{folder}/camera_info");
    if scan.infos.contains_key(&sibling) {
        return Some(sibling);
    }
    let frame = scan.frame_of(image)?;
    let mut same = scan.infos.iter().filter(|(_, info)| info.header.frame_id == frame);
    let found = same.next()?.0.clone();
    same.next().is_none().then_some(found)
}
