//! Choice of the topics of a log: colour images, depth images, and so on.

use std::collections::BTreeMap;

use tagalong_config::nearest;
use tagalong_core::{Input, Inputs, Usage};

use crate::images::{Content, VIDEO_REMEDY, may_be_disparity, refusal_of};
use crate::obstacles::ObstacleTopic;
use crate::scan::{Scan, Topic, Type};
use crate::sensors::{SENSORS, SensorType};
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
    /// Topics of the sensors beside the images.
    pub(crate) sensors: BTreeMap<Input, String>,
}

impl Chosen {
    /// Returns true for a topic that is read.
    pub(crate) fn has(&self, topic: &str) -> bool {
        let Self { colour, depth, right, colour_info, depth_info, right_info, .. } = self;
        [colour, depth, right, colour_info, depth_info, right_info]
            .into_iter()
            .chain([&self.odometry])
            .flatten()
            .chain(self.sensors.values())
            .any(|chosen| chosen == topic)
    }

    /// Returns the topic of a sensor beside the images.
    pub(crate) fn sensor(&self, input: Input) -> Option<&str> {
        self.sensors.get(&input).map(String::as_str)
    }

    /// Returns the topics of the inputs that core does not define, by name.
    pub(crate) fn named_sensors(&self) -> BTreeMap<&'static str, String> {
        let named = self.sensors.iter().filter(|(input, _)| is_named(input));
        named.map(|(input, topic)| (input.name(), topic.clone())).collect()
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
    let named = |key, topic: &Option<String>, fits: fn(&Topic) -> bool| {
        named(scan, key, topic.as_deref(), fits)
    };
    let is_depth = |topic: &Topic| is_usable_depth(topic, input);
    let is_disparity = input.disparity.is_some();
    // Chosen first, because such images look like those of a grey camera.
    let disparity = match is_disparity && input.depth_topic.is_none() {
        true => best(scan, &input.sources, None, disparity_rank),
        false => input.depth_topic.clone().filter(|_| is_disparity),
    };
    let colour = named("colour_topic", &input.colour_topic, is_usable_picture)?.or_else(|| {
        let rank = |name: &str, topic: &Topic| colour_rank(name, topic, false);
        best(scan, &input.sources, disparity.as_deref(), rank)
    });
    let depth = match inputs.uses(Input::Depth) || colour.is_none() {
        true => self::named(scan, "depth_topic", input.depth_topic.as_deref(), is_depth)?
            .or(disparity)
            .or_else(|| best(scan, &input.sources, None, depth_rank)),
        false => None,
    };
    let right = match inputs.uses(Input::Right) {
        true => named("right_topic", &input.right_topic, is_usable_picture)?.or_else(|| {
            let rank = |name: &str, topic: &Topic| colour_rank(name, topic, true);
            best(scan, &input.sources, None, rank)
        }),
        false => None,
    };
    // The settings may name the right images as the colour topic.
    let right = right.filter(|topic| Some(topic) != colour.as_ref());
    let mut sensors = BTreeMap::new();
    for sensor in SENSORS.iter().filter(|sensor| inputs.uses(sensor.input)) {
        let topic = choose_sensor(scan, sensor, input)?;
        sensors.extend(topic.map(|topic| (sensor.input, topic)));
    }
    let odometry = named("odometry_topic", &input.odometry_topic, is_odometry)?
        .or_else(|| best(scan, &input.sources, None, odometry_rank));
    let info = |key, wanted: &Option<String>, image: &Option<String>| {
        let of_left = key == "depth_info_topic" && is_disparity;
        let found = || info_of(scan, image.as_deref()?, of_left);
        Ok::<_, LogError>(named(key, wanted, is_info)?.or_else(found))
    };
    let chosen = Chosen {
        colour_info: info("colour_info_topic", &input.colour_info_topic, &colour)?,
        depth_info: info("depth_info_topic", &input.depth_info_topic, &depth)?,
        right_info: info("right_info_topic", &input.right_info_topic, &right)?,
        colour,
        depth,
        right,
        odometry,
        sensors,
    };
    check(scan, &chosen, inputs)?;
    Ok(chosen)
}

/// Returns the topic of a sensor: the one that the settings name, else that of the highest rank.
fn choose_sensor(
    scan: &Scan,
    sensor: &SensorType,
    input: &InputSettings,
) -> Result<Option<String>, LogError> {
    let fits = |topic: &Topic| is_of(sensor, topic);
    let named = named(scan, &sensor.key(), named_topic(sensor, input), fits)?;
    let rank = |name: &str, topic: &Topic| {
        sensor.rank.filter(|_| is_of(sensor, topic)).map(|rank| rank(name))
    };
    Ok(named.or_else(|| best(scan, &input.sources, None, rank)))
}

/// Returns the topic that the settings name for a sensor.
pub(crate) fn named_topic<'a>(sensor: &SensorType, input: &'a InputSettings) -> Option<&'a str> {
    match sensor.input {
        Input::Laser => input.laser_topic.as_deref(),
        Input::Detections => input.detections_topic.as_deref(),
        other => input.topics.get(other.name()).map(String::as_str),
    }
}

/// Requirement of a pipeline or of the frames, with the topics that could meet it.
struct Requirement<'a> {
    lacks: bool,
    wanted: &'a str,
    key: String,
    /// Message types in words.
    types: String,
    fits: Box<dyn Fn(&Topic) -> bool + 'a>,
    /// Topic that another input has, so that it cannot be meant.
    taken: Option<&'a str>,
}

/// Checks that there is a topic for each required input, and one that makes the frames.
fn check(scan: &Scan, chosen: &Chosen, inputs: Inputs) -> Result<(), LogError> {
    let is_unknown = |input: &Input| !SENSORS.iter().any(|sensor| sensor.input == *input);
    let mut unknown = inputs.of(Usage::Required).filter(is_named).filter(is_unknown);
    if let Some(input) = unknown.next() {
        let name = input.name();
        return Err(missing(scan, format!("input `{name}`"), UNREADABLE.to_owned()));
    }
    let is_blind = chosen.colour.is_none() && chosen.depth.is_none();
    let lacks = |input, topic: &Option<String>| inputs.requires(input) && topic.is_none();
    let image = |lacks, wanted, key: &str, types: &str| Requirement {
        lacks,
        wanted,
        key: key.to_owned(),
        types: types.to_owned(),
        fits: Box::new(if key == "depth_topic" { could_be_depth } else { is_usable_picture }),
        taken: chosen.colour.as_deref().filter(|_| key == "right_topic"),
    };
    let lacks_right = lacks(Input::Right, &chosen.right);
    let images = [
        image(lacks(Input::Colour, &chosen.colour), "colour images", "colour_topic", COLOUR),
        image(lacks(Input::Depth, &chosen.depth), "depth images", "depth_topic", DEPTH),
        image(lacks_right, "right images of a stereo pair", "right_topic", COLOUR),
    ];
    let sensors = SENSORS.iter().map(|sensor| Requirement {
        lacks: inputs.requires(sensor.input) && chosen.sensor(sensor.input).is_none(),
        wanted: sensor.wanted,
        key: sensor.key(),
        types: sensor.messages.join(" or "),
        fits: Box::new(|topic| is_of(sensor, topic)),
        taken: None,
    });
    let has_no_clock = is_blind && chosen.sensor(Input::Laser).is_none();
    let any = image(has_no_clock, "images at all", "colour_topic", COLOUR);
    match images.into_iter().chain(sensors).chain([any]).find(|required| required.lacks) {
        None => Ok(()),
        Some(required) => Err(required.error(scan)),
    }
}

impl Requirement<'_> {
    /// Returns the error of a log that lacks the topic, with the first topic that could be meant, or
    /// the first one that cannot be read.
    fn error(&self, scan: &Scan) -> LogError {
        let Self { wanted, key, types, fits, taken, .. } = self;
        let is_image = key.ends_with("_topic") && types.contains("Image");
        let unreadable = scan.topics.iter().find_map(|(name, topic)| {
            let why = unreadable(topic).filter(|_| is_image)?;
            Some(format!("; {name} ({}) cannot be read: {why}", kind_of(topic)))
        });
        let is_free = |name: &str| *taken != Some(name);
        let mut free = scan.topics.iter().filter(|(name, _)| is_free(name));
        let meant = free.find(|(_, topic)| fits(topic)).map(|(name, topic)| {
            let kind = topic.pixels.as_deref().unwrap_or(&topic.schema);
            match remedy_as_depth(topic).filter(|_| key == "depth_topic") {
                Some(remedy) => format!("; if {name} ({kind}) is meant, {remedy}"),
                None => format!("; if {name} ({kind}) is meant, name it as `{key}` under [input]"),
            }
        });
        let depth = (key == "depth_topic").then(|| DEPTH_REMEDY.to_owned());
        let other = (key == "right_topic").then(|| RIGHT_REMEDY.to_owned());
        let hint = unreadable.or(meant).or(depth).or(other).unwrap_or_default();
        missing(scan, format!("{wanted} ({types})"), hint)
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
const DEPTH: &str = "sensor_msgs/Image with 16UC1 or 32FC1, sensor_msgs/CompressedImage with \
                     compressedDepth, or stereo_msgs/DisparityImage";

const DEPTH_REMEDY: &str = "; name a topic that has them as `depth_topic` under [input], or take \
                            a config without depth";

const RIGHT_REMEDY: &str = ": this is no log of a stereo pair; take a config for what it has, which \
                            `tagalong run LOG` chooses by itself and `tagalong doctor LOG` lists";

pub(crate) fn missing(scan: &Scan, wanted: String, hint: String) -> LogError {
    LogError::Missing { path: scan.path.clone(), wanted, hint, present: scan.listing() }
}

fn is_picture(topic: &Topic) -> bool {
    matches!(topic.kind, Type::Image | Type::CompressedImage)
}

/// Returns true for images, of disparity included.
fn is_image(topic: &Topic) -> bool {
    is_picture(topic) || topic.kind == Type::DisparityImage
}

/// Returns true for pictures that can be read, as far as that is known before the first one.
fn is_usable_picture(topic: &Topic) -> bool {
    is_picture(topic) && (topic.content == Content::Picture || topic.pixels.is_none())
}

/// Returns true for depth that can be read.
fn is_usable_depth(topic: &Topic, input: &InputSettings) -> bool {
    let is_disparity = input.disparity.is_some() && disparity_rank("disparity", topic).is_some();
    let is_depth = topic.content == Content::Depth || topic.pixels.is_none();
    is_image(topic) && (is_depth || is_disparity)
}

/// Returns true for images whose pixels may be depth or disparities, by a setting at most.
fn could_be_depth(topic: &Topic) -> bool {
    is_image(topic) && (topic.content != Content::Picture || remedy_as_depth(topic).is_some())
}

/// Returns the setting that makes depth of images that look like others.
fn remedy_as_depth(topic: &Topic) -> Option<&'static str> {
    match topic.pixels.as_deref()? {
        "mono16" => Some("set `depth_unit_m` under [input] (0.001 for millimetres)"),
        "mono8" | "8UC1" | "16SC1" => Some("and its pixels are disparities, add [input.disparity]"),
        _ => None,
    }
}

/// Returns type and encoding of the messages of a topic.
pub(crate) fn kind_of(topic: &Topic) -> String {
    match (&topic.pixels, topic.encoding.as_str()) {
        (Some(pixels), _) => format!("{}, {pixels}", topic.schema),
        (None, "cdr" | "ros1" | "") => topic.schema.clone(),
        (None, encoding) => format!("{}, {encoding}", topic.schema),
    }
}

/// Names of messages with images or scans, whatever their package and encoding.
const SENSOR_MESSAGES: [&str; 5] =
    ["Image", "RawImage", "CompressedImage", "DisparityImage", "LaserScan"];
/// Names of messages with video.
const VIDEO_MESSAGES: [&str; 3] = ["CompressedVideo", "FFMPEGPacket", "H264Packet"];

/// Returns the reason for which images or scans of a topic cannot be read, with the remedy; `None`
/// for those that can, and for all other topics.
pub(crate) fn unreadable(topic: &Topic) -> Option<String> {
    let name = topic.schema.rsplit(['/', '.']).next().unwrap_or_default();
    if VIDEO_MESSAGES.contains(&name) {
        return Some(VIDEO_REMEDY.to_owned());
    }
    match (&topic.pixels, topic.kind) {
        (Some(pixels), _) if topic.content == Content::Unknown => Some(refusal_of(pixels)),
        (None, Type::Other) if SENSOR_MESSAGES.contains(&name) => Some(match &*topic.encoding {
            "cdr" | "ros1" => format!("its type is not read; {name} of sensor_msgs is"),
            other => format!(
                "its messages are in `{other}`, and those of ROS 2 (`cdr`) and ROS 1 (`ros1`) are \
                 read: record with `ros2 bag record`, or convert the log"
            ),
        }),
        _ => None,
    }
}

fn is_info(topic: &Topic) -> bool {
    topic.kind == Type::CameraInfo
}

fn is_odometry(topic: &Topic) -> bool {
    topic.kind == Type::Odometry
}

/// Returns true for a topic with messages of this sensor, in an encoding that can be read.
fn is_of(sensor: &SensorType, topic: &Topic) -> bool {
    topic.kind == Type::Sensor && sensor.reads(&topic.schema)
}

/// Returns a topic that the settings name.
fn named(
    scan: &Scan,
    key: &str,
    name: Option<&str>,
    fits: impl Fn(&Topic) -> bool,
) -> Result<Option<String>, LogError> {
    let Some(name) = name else { return Ok(None) };
    if scan.topics.get(name).is_some_and(&fits) {
        return Ok(Some(name.to_owned()));
    }
    let mut fitting = scan.topics.iter().filter(|(_, topic)| fits(topic));
    if let Some(topic) = scan.topics.get(name) {
        let other = fitting.next().map(|(name, topic)| format!("{name} ({})", kind_of(topic)));
        let as_depth = remedy_as_depth(topic).filter(|_| key == "depth_topic");
        let remedy = unreadable(topic)
            .or_else(|| as_depth.map(|remedy| format!("if it is meant, {remedy}")))
            .or_else(|| other.map(|other| format!("{other} would fit")))
            .unwrap_or_else(|| "no topic of the log would fit: leave the key out".to_owned());
        let (path, kind) = (scan.path.clone(), kind_of(topic));
        let (key, topic) = (key.to_owned(), name.to_owned());
        return Err(LogError::WrongTopic { path, key, topic, kind, remedy });
    }
    let near = nearest(name, fitting.map(|(name, _)| name.as_str()));
    let hint = near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
    Err(missing(scan, format!("topic `{name}` fit for `{key}` of [input]"), hint))
}

/// Returns the topic with the highest rank but one that is taken or is a further source of obstacles;
/// of equal ones that with the most messages, then the first by name.
fn best(
    scan: &Scan,
    sources: &[ObstacleTopic],
    taken: Option<&str>,
    rank: impl Fn(&str, &Topic) -> Option<i32>,
) -> Option<String> {
    let is_source = |name: &str| sources.iter().any(|source| source.topic == name);
    let free = |(name, topic): &(&String, &Topic)| {
        topic.count > 0 && taken != Some(name.as_str()) && !is_source(name)
    };
    let ranked =
        scan.topics.iter().filter(free).filter_map(|(name, topic)| {
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
    if !is_picture(topic) || topic.content != Content::Picture || is_right != right {
        return None;
    }
    // A name for colour decides before one for a side, and before an uncompressed image.
    let mut rank = 0;
    rank += 8 * i32::from(has(name, &["color", "colour", "rgb"]));
    rank += 4 * i32::from(has(name, &["left", "front", "rect"]));
    rank -= 6 * i32::from(has(
        name,
        &["infra", "/ir", "depth", "disparity", "fisheye", "mono", "debug"],
    ));
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

/// Returns the rank of images that the settings declare to be disparities, by their name.
fn disparity_rank(name: &str, topic: &Topic) -> Option<i32> {
    let pixels = topic.pixels.as_deref().unwrap_or_default();
    let may_be = match topic.kind {
        Type::Image => may_be_disparity(pixels),
        Type::CompressedImage => pixels.contains("png"),
        _ => false,
    };
    (may_be && name.contains("disp")).then(|| i32::from(topic.kind == Type::Image))
}

fn odometry_rank(name: &str, topic: &Topic) -> Option<i32> {
    let filtered = has(name, &["filtered", "fused"]);
    (topic.kind == Type::Odometry).then(|| i32::from(!has(name, &["visual"])) + i32::from(filtered))
}

/// Returns the calibration of an image topic: its `camera_info` sibling, else the only one with the
/// same frame.
pub(crate) fn info_of(scan: &Scan, image: &str, is_disparity: bool) -> Option<String> {
    let base = image.trim_end_matches("/compressedDepth").trim_end_matches("/compressed");
    let folder = base.rsplit_once('/').map_or("", |(folder, _)| folder);
    let sibling = format!("{folder}/camera_info");
    if scan.infos.contains_key(&sibling) {
        return Some(sibling);
    }
    let left = format!("{folder}/left/camera_info");
    // Disparities are those of the left camera, and its calibration stands beside its images.
    let is_disparity = is_disparity || scan.topics.get(image)?.kind == Type::DisparityImage;
    if is_disparity && scan.infos.contains_key(&left) {
        return Some(left);
    }
    let frame = scan.frame_of(image)?;
    let mut same = scan.infos.iter().filter(|(_, info)| info.header.frame_id == frame);
    let found = same.next()?.0.clone();
    same.next().is_none().then_some(found)
}
