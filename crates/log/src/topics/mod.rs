//! Choice of the topics of a log, in one decision with a reason for each topic.
//!
//! Images are grouped into rigs, the streams of one device, before anything is ranked; a pipeline
//! gets the images of one rig unless the settings name others. For each topic with images, scans,
//! detections or odometry, the [account](InputAccount) contains its use, or the reason why it is
//! not used.

mod account;
mod calibration;
mod entries;
mod foreign;
mod kinds;
mod name;
mod odometry;
mod problems;
mod rigs;
mod units;
mod unpaired;

use std::collections::BTreeMap;

pub use account::{InputAccount, TopicUse};
pub(crate) use calibration::{FoundCalibration, Relation, calibration_of, intrinsics_of};
use foreign::foreign;
pub(crate) use foreign::part_of;
use kinds::{
    could_be_depth, depth_as_picture, detection_types, disparity_rank, is_info, is_of,
    is_usable_depth, is_usable_picture, remedy_as_depth,
};
pub(crate) use kinds::{kind_of, unreadable};
pub(crate) use name::{Stream, TopicName};
use odometry::{choose_odometry, odometry_problem};
pub(crate) use odometry::{exchanged_frames, transform_odometry_problem, transform_problem};
pub(crate) use problems::{Problem, geometry_problem};
use problems::{detections_problem, scan_times_problem, scanner_problem};
pub(crate) use rigs::camera_frames;
use rigs::{Pick, Rig, may_be_one, rigs};
use tagalong_config::nearest;
use tagalong_core::{Input, Inputs, Usage};
pub(crate) use units::told_unit;
pub(crate) use unpaired::{slower_words, unpaired};

use crate::obstacles::ObstacleTopic;
use crate::scan::{Scan, Topic};
use crate::sensors::{SENSORS, SensorType};
use crate::source::robot_frame;
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
    /// Relation of each calibration to its images, by the topic of the images.
    pub(crate) calibrations: BTreeMap<String, FoundCalibration>,
    /// Camera to which the images belong.
    pub(crate) camera: Option<String>,
    /// Reason why the depth images cannot be used.
    pub(crate) depth_problem: Option<Problem>,
    /// Frames of tf that give the odometry if no topic does: odometry frame and robot frame.
    pub(crate) odom_frames: Option<(String, String)>,
    /// Odometry that would have been chosen but cannot be used, with the reasons.
    pub(crate) unused_odometry: Vec<(String, Problem)>,
    /// Topics of the sensors other than cameras.
    pub(crate) sensors: BTreeMap<Input, String>,
    /// Reasons why chosen sensors give no data.
    pub(crate) sensor_problems: BTreeMap<Input, Problem>,
    /// Topics of further laser scanners on the robot.
    pub(crate) further_scans: Vec<String>,
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
            .chain(&self.further_scans)
            .any(|chosen| chosen == topic)
    }

    /// Returns the topic from whose messages the frames are made; empty without one.
    pub(crate) fn primary(&self) -> &str {
        let images = self.colour.as_ref().or(self.depth.as_ref());
        let scans = self.sensor(Input::Laser).or(self.sensor(Input::POINTS));
        images.map(String::as_str).or(scans).unwrap_or_default()
    }

    /// Returns the topic of a sensor other than a camera.
    pub(crate) fn sensor(&self, input: Input) -> Option<&str> {
        self.sensors.get(&input).map(String::as_str)
    }

    /// Returns the topics of the inputs that core does not define, by name.
    pub(crate) fn named_sensors(&self) -> BTreeMap<&'static str, String> {
        let named = self.sensors.iter().filter(|(input, _)| is_named(input));
        named.map(|(input, topic)| (input.name(), topic.clone())).collect()
    }
}

/// Topics that are read, and the account of all.
#[derive(Clone, Debug, Default)]
pub(crate) struct Decision {
    pub(crate) chosen: Chosen,
    pub(crate) account: InputAccount,
}

/// Chooses the topics that the settings name, and otherwise by device, type, encoding and name. A
/// topic of an unused input is not chosen, as if the log did not have it, with one exception:
/// frames are numbered and timed by the images of the colour topic, or without it by those of the
/// depth topic. In a log without images the laser scans take this role, and without these the
/// points of a lidar.
///
/// # Errors
/// [`LogError::Missing`] for a named topic or camera that is not there, and for required inputs that
/// are not found.
pub(crate) fn decide(
    scan: &Scan,
    input: &InputSettings,
    inputs: Inputs,
) -> Result<Decision, LogError> {
    let chosen = choose(scan, input, inputs)?;
    let account = entries::account(scan, input, inputs, &chosen);
    check(scan, &chosen, inputs, &account)?;
    Ok(Decision { chosen, account })
}

/// Returns the account of a log from which no frames can be made.
pub(crate) fn account_of(scan: &Scan, input: &InputSettings) -> InputAccount {
    let chosen = choose(scan, input, Inputs::ANY).unwrap_or_default();
    entries::account(scan, input, Inputs::ANY, &chosen)
}

/// Chooses topics without checking that all required ones exist.
///
/// # Errors
/// A named topic or camera that is not there.
pub(crate) fn choose(
    scan: &Scan,
    input: &InputSettings,
    inputs: Inputs,
) -> Result<Chosen, LogError> {
    // If images are more frequent than points, they would show each point several times.
    let images = if inputs.are_of_points() {
        Default::default()
    } else {
        choose_images(scan, input, inputs)?
    };
    let (Pick { colour, depth, right, depth_problem }, camera) = images;
    let images = colour.as_ref().or(depth.as_ref()).cloned();
    let mut sensors = BTreeMap::new();
    for sensor in SENSORS.iter().filter(|sensor| inputs.uses(sensor.input)) {
        let topic = choose_sensor(scan, sensor, input, images.as_deref())?;
        sensors.extend(topic.map(|topic| (sensor.input, topic)));
    }
    let colour_info = choose_info(scan, input, "colour_info_topic", colour.as_deref())?;
    let depth_info = choose_info(scan, input, "depth_info_topic", depth.as_deref())?;
    let right_info = choose_info(scan, input, "right_info_topic", right.as_deref())?;
    let mut calibrations = BTreeMap::new();
    for (image, info) in [(&colour, &colour_info), (&depth, &depth_info), (&right, &right_info)] {
        if let (Some(image), Some(info)) = (image, info) {
            calibrations.insert(image.clone(), info.clone());
        }
    }
    let mut chosen = Chosen {
        colour,
        depth,
        right,
        colour_info: colour_info.map(|info| info.topic),
        depth_info: depth_info.map(|info| info.topic),
        right_info: right_info.map(|info| info.topic),
        odometry: None,
        odom_frames: None,
        calibrations,
        camera,
        depth_problem,
        unused_odometry: Vec::new(),
        sensor_problems: BTreeMap::new(),
        further_scans: Vec::new(),
        sensors,
    };
    let primary = chosen.primary().to_owned();
    chosen.further_scans = further_scans(scan, input, &primary, chosen.sensor(Input::Laser));
    let odometry = choose_odometry(scan, input, &primary)?;
    chosen.odometry = odometry.topic;
    chosen.odom_frames = odometry.frames;
    chosen.unused_odometry = odometry.unused;
    if let Some(detections) = chosen.sensor(Input::Detections)
        && let Some(problem) = detections_problem(scan, input, &primary, detections)
    {
        chosen.sensor_problems.insert(Input::Detections, problem);
    }
    if let Some(scanner) = chosen.sensor(Input::Laser)
        && let Some(problem) = scan_times_problem(scan, &primary, scanner)
    {
        chosen.sensor_problems.insert(Input::Laser, problem);
    }
    Ok(chosen)
}

/// Chooses the calibration of a stream of images: the one that the settings name, or otherwise the
/// nearest.
fn choose_info(
    scan: &Scan,
    input: &InputSettings,
    key: &str,
    image: Option<&str>,
) -> Result<Option<FoundCalibration>, LogError> {
    let (wanted, is_disparity) = match key {
        "colour_info_topic" => (&input.colour_info_topic, false),
        "depth_info_topic" => (&input.depth_info_topic, input.disparity.is_some()),
        _ => (&input.right_info_topic, false),
    };
    let named = named(scan, key, wanted.as_deref(), is_info)?;
    let own = named.map(|topic| FoundCalibration::new(&topic, Relation::Own));
    Ok(own.or_else(|| calibration_of(scan, image?, is_disparity)))
}

/// Chooses the images, all of one rig unless the settings name others; returns them with the name of
/// the rig.
fn choose_images(
    scan: &Scan,
    input: &InputSettings,
    inputs: Inputs,
) -> Result<(Pick, Option<String>), LogError> {
    let is_disparity = input.disparity.is_some();
    // Chosen first, because disparity images look like those of a grey camera.
    let disparity = match (&input.depth_topic, is_disparity) {
        (None, true) => best_of(scan, &input.sources, scan.names(), disparity_rank),
        _ => None,
    };
    let colour_topic = input.colour_topic.as_deref();
    let depth = named(scan, "depth_topic", input.depth_topic.as_deref(), |topic| {
        is_usable_depth(topic, input)
    });
    // An error in a topic that is not used does not matter.
    let depth = if inputs.uses(Input::Depth) { depth? } else { depth.unwrap_or(None) };
    let named = Pick {
        colour: named(scan, "colour_topic", colour_topic, is_usable_picture)?,
        depth: depth.or(disparity),
        right: if inputs.uses(Input::Right) {
            named(scan, "right_topic", input.right_topic.as_deref(), is_usable_picture)?
        } else {
            None
        },
        depth_problem: None,
    };
    let all = rigs(scan);
    let wanted = wanted_rigs(scan, input, &named, &all)?;
    let mut best: Option<(&Rig, Pick, [i64; 4])> = None;
    for rig in wanted {
        let pick = rig.pick(scan, input, &named);
        if pick.colour.is_none() && pick.depth.is_none() {
            continue;
        }
        let worth = rig.worth(scan, &pick, inputs);
        // Of equally good ones the first by name.
        if best.as_ref().is_none_or(|(.., most)| worth > *most) {
            best = Some((rig, pick, worth));
        }
    }
    let Some((rig, mut pick, _)) = best else { return Ok((named, None)) };
    // Without colour, the frames are made from depth, whether or not depth is used.
    if !inputs.uses(Input::Depth) && pick.colour.is_some() {
        pick.depth = None;
        pick.depth_problem = None;
    }
    if !inputs.uses(Input::Right) {
        pick.right = None;
    }
    Ok((pick, Some(rig.label.clone())))
}

/// Returns the rigs that the settings allow.
///
/// # Errors
/// A camera that the settings name and the log lacks.
fn wanted_rigs<'a>(
    scan: &Scan,
    input: &InputSettings,
    named: &Pick,
    all: &'a [Rig],
) -> Result<Vec<&'a Rig>, LogError> {
    if let Some(camera) = input.camera_name() {
        let called: Vec<&Rig> = all.iter().filter(|rig| rig.is_called(camera)).collect();
        if called.is_empty() {
            let names: Vec<&str> = all.iter().map(|rig| rig.label.as_str()).collect();
            let hint = if names.is_empty() {
                "; it has no images of a camera".to_owned()
            } else {
                format!("; `camera` under [input] can be one of: {}", names.join(", "))
            };
            return Err(missing(scan, format!("camera `{camera}`"), hint));
        }
        // The label in the account means exactly that rig.
        let label = camera.trim_matches('/');
        let own = called.iter().copied().find(|rig| rig.label.trim_matches('/') == label);
        return Ok(own.map_or(called, |own| vec![own]));
    }
    for topic in [&named.colour, &named.right, &named.depth].into_iter().flatten() {
        let Some(own) = all.iter().find(|rig| rig.has(topic)) else { continue };
        // Depth that the settings name may be separate from the colour images of its device.
        let may_add = named.colour.is_none();
        let wanted =
            all.iter().filter(|rig| rig.has(topic) || may_add && may_be_one(scan, rig, own));
        return Ok(wanted.collect());
    }
    Ok(all.iter().collect())
}

/// Returns the topics of the scanners beside the first one, unless the settings name one.
fn further_scans(
    scan: &Scan,
    input: &InputSettings,
    primary: &str,
    first: Option<&str>,
) -> Vec<String> {
    let Some(first) = first.filter(|_| input.laser_topic.is_none()) else { return Vec::new() };
    let further = scan.topics.iter().filter(|(name, topic)| {
        let is_scan =
            SENSORS.iter().any(|sensor| sensor.input == Input::Laser && is_of(sensor, topic))
                && *name != first;
        is_scan && topic.count > 0 && scanner_problem(scan, input, primary, first, name).is_none()
    });
    further.map(|(name, _)| name.clone()).collect()
}

/// Returns the topic of a sensor: the one that the settings name, or otherwise the one with the
/// highest rank.
fn choose_sensor(
    scan: &Scan,
    sensor: &SensorType,
    input: &InputSettings,
    images: Option<&str>,
) -> Result<Option<String>, LogError> {
    let named = named(scan, &sensor.key(), input.topic_of(sensor.input), |it| is_of(sensor, it))?;
    let robot = robot_frame(scan, input);
    Ok(named.or_else(|| {
        best_of(scan, &input.sources, scan.names(), |name, topic| {
            let rank = sensor.rank.filter(|_| is_of(sensor, topic))?(&name.to_lowercase());
            // Any scanner is better than one with impossible scans, or without a pose or a time.
            let frame = topic.frame_id.as_ref();
            let has_place = frame.is_none_or(|frame| scan.tf.connects(robot, frame));
            let is_possible = topic.impossible().is_none();
            let has_time =
                images.is_none_or(|images| scan_times_problem(scan, images, name).is_none());
            let lacks = 50 * (i32::from(!has_place) + i32::from(!has_time));
            Some(rank - 100 * i32::from(!is_possible) - lacks)
        })
    }))
}

/// Requirement of a pipeline or of the frames, with the topics that could satisfy it.
struct Requirement<'a> {
    lacks: bool,
    wanted: &'a str,
    key: String,
    /// Message types in words.
    types: String,
    fits: Box<dyn Fn(&Topic) -> bool + 'a>,
    /// Topic that is used for another input, so that it cannot be meant.
    taken: Option<&'a str>,
}

/// Checks that there is a topic for each required input, and one from which the frames are made.
fn check(
    scan: &Scan,
    chosen: &Chosen,
    inputs: Inputs,
    account: &InputAccount,
) -> Result<(), LogError> {
    for input in inputs.of(Usage::Required).filter(is_named) {
        if !SENSORS.iter().any(|sensor| sensor.input == input) {
            let name = input.name();
            return Err(missing(scan, format!("input `{name}`"), UNREADABLE.to_owned()));
        }
    }
    let is_blind = chosen.colour.is_none() && chosen.depth.is_none();
    let lacks_colour = inputs.requires(Input::Colour) && chosen.colour.is_none();
    let lacks_depth = inputs.requires(Input::Depth) && chosen.depth.is_none();
    let lacks_right = inputs.requires(Input::Right) && chosen.right.is_none();
    let has_no_clock = is_blind && chosen.primary().is_empty();
    let [colour, depth, right, any] = [
        (lacks_colour, "colour images", "colour_topic", COLOUR),
        (lacks_depth, "depth images", "depth_topic", DEPTH),
        (lacks_right, "right images of a stereo pair", "right_topic", COLOUR),
        (has_no_clock, "images at all", "colour_topic", COLOUR),
    ]
    .map(|(lacks, wanted, key, types)| Requirement {
        lacks,
        wanted,
        key: key.to_owned(),
        types: types.to_owned(),
        fits: Box::new(if key == "depth_topic" { could_be_depth } else { is_usable_picture }),
        taken: chosen.colour.as_deref().filter(|_| key == "right_topic"),
    });
    let images = [colour, depth, right];
    let sensors = SENSORS.iter().map(|sensor| Requirement {
        lacks: inputs.requires(sensor.input) && chosen.sensor(sensor.input).is_none(),
        wanted: sensor.wanted,
        key: sensor.key(),
        types: sensor.messages.join(" or "),
        fits: Box::new(|topic| is_of(sensor, topic)),
        taken: None,
    });
    match images.into_iter().chain(sensors).chain([any]).find(|required| required.lacks) {
        None => Ok(()),
        Some(required) => Err(required.error(scan, account)),
    }
}

impl Requirement<'_> {
    /// Returns the error for a log without the topic, with the reason and the remedy of the most
    /// suitable other topic.
    fn error(&self, scan: &Scan, account: &InputAccount) -> LogError {
        let Self { wanted, key, types, fits, taken, .. } = self;
        let is_image = key.ends_with("_topic") && types.contains("Image");
        let unreadable = scan.topics.iter().find_map(|(name, topic)| {
            let why = unreadable(topic).filter(|_| is_image && !topic.is_other_stream);
            let why = why.or_else(|| self.foreign_reason(topic))?;
            Some(format!("; {name} ({}) cannot be read: {why}", kind_of(topic)))
        });
        let mut free = scan.topics.iter().filter(|(name, _)| *taken != Some(name.as_str()));
        let fitting =
            free.find(|(name, topic)| fits(topic) && depth_as_picture(name, topic).is_none());
        let meant = fitting.map(|(name, topic)| {
            let kind = topic.pixels.as_deref().unwrap_or(&topic.schema);
            let of_camera = account.topics.iter().find(|entry| {
                let is_other = entry.problem.as_deref() == Some(entries::OTHER_CAMERA);
                entry.topic == *name && is_other
            });
            if let Some(remedy) = of_camera.and_then(|entry| entry.remedy.as_ref()) {
                return format!("; {name} ({kind}) is of another camera: {remedy}");
            }
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

    /// Returns the reason and the remedy for messages of the wanted sensor whose type is not read.
    fn foreign_reason(&self, topic: &Topic) -> Option<String> {
        let found = foreign(topic)?;
        let input = self.key.trim_end_matches("_topic").trim_start_matches("topics.");
        let is_wanted = found.could_be.contains(&input);
        is_wanted.then(|| format!("{}: {}", found.why, found.remedy))
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
                     compressedDepth, stereo_msgs/DisparityImage, or sensor_msgs/PointCloud2 in rows and columns";

const DEPTH_REMEDY: &str = "; name a topic that has them as `depth_topic` under [input], or take \
                            a config without depth";

const RIGHT_REMEDY: &str = ": this is no log of a stereo pair; take a config for what it has, which \
                            `tagalong run LOG` chooses by itself and `tagalong doctor LOG` lists";

pub(crate) fn missing(scan: &Scan, wanted: String, hint: String) -> LogError {
    LogError::Missing { path: scan.path.clone(), wanted, hint, present: scan.listing() }
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
            .or_else(|| foreign(topic).map(|found| format!("{}: {}", found.why, found.remedy)))
            .or_else(|| as_depth.map(|remedy| format!("if it is meant, {remedy}")))
            .or_else(|| other.map(|other| format!("{other} would fit")))
            .or_else(|| {
                let types = format!("read are {}", detection_types());
                (key == "detections_topic").then(|| format!("{types}: convert it to one of them"))
            })
            .unwrap_or_else(|| "no topic of the log would fit: leave the key out".to_owned());
        let path = scan.path.clone();
        let kind = kind_of(topic);
        let key = key.to_owned();
        let topic = name.to_owned();
        return Err(LogError::WrongTopic { path, key, topic, kind, remedy });
    }
    let near = nearest(name, fitting.map(|(name, _)| name.as_str()));
    let hint = near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
    Err(LogError::UnknownTopic {
        path: scan.path.clone(),
        key: key.to_owned(),
        topic: name.to_owned(),
        hint: hint.into_boxed_str(),
        present: scan.listing(),
    })
}

/// Returns the topic with the highest rank among those in `names` that are not further obstacle
/// sources; of equal ones the one with the most messages, then the first by name.
pub(super) fn best_of<'a>(
    scan: &Scan,
    sources: &[ObstacleTopic],
    names: impl Iterator<Item = &'a str>,
    rank: impl Fn(&str, &Topic) -> Option<i32>,
) -> Option<String> {
    let mut best: Option<(i32, u32, &str)> = None;
    for name in names {
        if sources.iter().any(|source| source.topic == name) {
            continue;
        }
        let Some(topic) = scan.topics.get(name).filter(|topic| topic.count > 0) else { continue };
        let Some(rank) = rank(name, topic) else { continue };
        // Compared by powers of two, because one or two lost messages must not change the choice.
        let count = topic.count.ilog2();
        let is_better = best.is_none_or(|(most, of_best, first)| {
            (rank, count) > (most, of_best) || (rank, count) == (most, of_best) && name < first
        });
        if is_better {
            best = Some((rank, count, name));
        }
    }
    best.map(|(.., name)| name.to_owned())
}
