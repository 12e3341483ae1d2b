//! Groups of topics that belong to one device: a camera with its streams.

use std::collections::{BTreeMap, BTreeSet};

use super::kinds::{colour_rank, depth_rank, is_image, is_usable_picture};
use super::name::{Side, Stream, TopicName};
use super::problems::{Problem, depth_problem};
use crate::camera_frames::CameraFrames;
use crate::images::Content;
use crate::scan::{Scan, Topic, Type};
use crate::tf::plain;
use crate::{Input, InputSettings, Inputs};

/// Images of one device.
#[derive(Clone, Debug)]
pub(super) struct Rig {
    /// Name for the user: the namespace that the topics share.
    pub(super) label: String,
    pub(super) topics: Vec<String>,
}

/// Images that are chosen from a rig.
#[derive(Clone, Debug, Default)]
pub(super) struct Pick {
    pub(super) colour: Option<String>,
    pub(super) depth: Option<String>,
    pub(super) right: Option<String>,
    pub(super) depth_problem: Option<Problem>,
}

/// Maximum distance between two cameras of one device, m.
const ONE_MOUNT_M: f64 = 0.5;
/// Maximum angle between the viewing directions of two cameras of one device, rad.
const ONE_MOUNT_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// Groups the images of a log by device.
pub(super) fn rigs(scan: &Scan) -> Vec<Rig> {
    let images: Vec<&String> =
        scan.topics.iter().filter(|(_, topic)| is_image(topic)).map(|(name, _)| name).collect();
    let mut groups: BTreeMap<Vec<String>, Vec<String>> = BTreeMap::new();
    for image in images {
        groups.entry(TopicName::of(image).device).or_default().push(image.clone());
    }
    let mut found: Vec<Rig> = groups.into_values().flat_map(|group| by_side(scan, group)).collect();
    join_streams(scan, &mut found);
    join_copies(scan, &mut found);
    for rig in &mut found {
        rig.label = label_of(&rig.topics);
    }
    let labels: Vec<String> = found.iter().map(|rig| rig.label.clone()).collect();
    for rig in &mut found {
        let is_shared = labels.iter().filter(|label| **label == rig.label).count() > 1;
        if let Some(first) = rig.topics.first().filter(|_| is_shared) {
            rig.label = words_of(first).unwrap_or_else(|| first.clone());
        }
    }
    found
}

/// Returns the device words of a topic, joined; `None` without any.
fn words_of(topic: &str) -> Option<String> {
    let words = TopicName::of(topic).device;
    (!words.is_empty()).then(|| words.join("_"))
}

/// Splits a group into left and right if each side has its own depth, because those are two devices
/// and not a stereo pair.
fn by_side(scan: &Scan, group: Vec<String>) -> Vec<Rig> {
    let with_depth: Vec<Side> = group
        .iter()
        .filter(|name| scan.topics[*name].content == Content::Depth)
        .map(|name| TopicName::of(name).side)
        .collect();
    let mut sides: BTreeMap<Side, Vec<String>> = BTreeMap::new();
    if with_depth.contains(&Side::Left) && with_depth.contains(&Side::Right) {
        for name in group {
            sides.entry(TopicName::of(&name).side).or_default().push(name);
        }
    } else {
        sides.insert(Side::Left, group);
    }
    sides.into_values().map(|topics| Rig { label: String::new(), topics }).collect()
}

/// Joins a rig that has only depth with the only one that has only colour and may belong to the
/// same device, because drivers do not always use a common word in the names.
fn join_streams(scan: &Scan, rigs: &mut Vec<Rig>) {
    loop {
        let mut pairs = Vec::new();
        for (d, depth) in rigs.iter().enumerate().filter(|(_, rig)| has_depth_alone(scan, rig)) {
            for (c, colour) in rigs.iter().enumerate() {
                if c != d && has_colour_alone(scan, colour) && may_be_one(scan, colour, depth) {
                    pairs.push((c, d));
                }
            }
        }
        let only = pairs.iter().copied().find(|(c, d)| {
            pairs.iter().filter(|(other, _)| other == c).count() == 1
                && pairs.iter().filter(|(_, other)| other == d).count() == 1
        });
        let Some((colour, depth)) = only else { return };
        let topics = std::mem::take(&mut rigs[depth].topics);
        rigs[colour].topics.extend(topics);
        rigs.remove(depth);
    }
}

/// Joins pictures that other programs made from the images of a camera, for example with boxes
/// drawn into them, with that camera: they have the same namespace and frame id.
fn join_copies(scan: &Scan, rigs: &mut Vec<Rig>) {
    let mut at = 0;
    while at < rigs.len() {
        let original = rigs.iter().position(|rig| {
            rig.topics != rigs[at].topics
                && has_colour_alone(scan, &rigs[at])
                && rigs[at].topics.iter().all(|copy| rig.holds_original(scan, copy))
        });
        match original {
            Some(original) => {
                let copies = std::mem::take(&mut rigs[at].topics);
                rigs[original].topics.extend(copies);
                rigs.remove(at);
            }
            None => at += 1,
        }
    }
}

fn has_depth_alone(scan: &Scan, rig: &Rig) -> bool {
    has_content(scan, rig, Content::Depth) && !has_content(scan, rig, Content::Picture)
}

fn has_colour_alone(scan: &Scan, rig: &Rig) -> bool {
    has_content(scan, rig, Content::Picture) && !has_content(scan, rig, Content::Depth)
}

fn has_content(scan: &Scan, rig: &Rig, content: Content) -> bool {
    rig.topics.iter().any(|name| scan.topics[name].content == content)
}

/// Returns true if two groups may be streams of one device: by frame id, by the mounts in tf, and
/// without both if their names do not mean different positions.
pub(super) fn may_be_one(scan: &Scan, colour: &Rig, depth: &Rig) -> bool {
    let mut may_be = false;
    for (a, b) in colour.topics.iter().flat_map(|a| depth.topics.iter().map(move |b| (a, b))) {
        match is_one_mount(scan, a, b) {
            Some(true) => return !TopicName::of(a).contradicts(&TopicName::of(b)),
            Some(false) => return false,
            None => may_be = !TopicName::of(a).contradicts(&TopicName::of(b)),
        }
    }
    may_be
}

/// Returns true if two cameras are close together and look in the same direction, by their frames
/// and tf; `None` if these do not show it.
fn is_one_mount(scan: &Scan, a: &str, b: &str) -> Option<bool> {
    are_one_mount(scan, scan.frame_of(a)?, scan.frame_of(b)?)
}

/// Returns true if two camera frames are close together and have the same viewing direction; `None`
/// if tf does not show it.
fn are_one_mount(scan: &Scan, a: &str, b: &str) -> Option<bool> {
    if a == b {
        return (!a.is_empty()).then_some(true);
    }
    if !scan.tf.connects(a, b) {
        return None;
    }
    let pose = scan.tf.static_pose(a, b)?;
    let is_near = pose.translation.vector.norm() <= ONE_MOUNT_M;
    Some(is_near && pose.rotation.angle() <= ONE_MOUNT_RAD)
}

/// Returns the namespace of a topic; empty at the root.
fn parent(topic: &str) -> &str {
    topic.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// Finds the frames of other cameras: those of images of other devices, and optical ones in tf,
/// unless tf places them beside the own camera.
pub(crate) fn camera_frames(scan: &Scan, primary: &str) -> CameraFrames {
    let Some(own) = scan.frame_of(primary).filter(|own| !own.is_empty()) else {
        return CameraFrames::default();
    };
    let mut others = BTreeSet::new();
    let mut beside = BTreeSet::from([plain(own).to_owned()]);
    for rig in rigs(scan) {
        let frames = rig.topics.iter().filter_map(|topic| scan.frame_of(topic));
        for frame in frames.filter(|frame| !frame.is_empty()) {
            if rig.has(primary) || are_one_mount(scan, own, frame) == Some(true) {
                beside.insert(plain(frame).to_owned());
            } else {
                others.insert(plain(frame).to_owned());
            }
        }
    }
    for frame in scan.tf.parents().into_keys() {
        // Other frames do not belong to a camera, for example that of a robot whose detector uses
        // it.
        if !frame.contains("optical") {
            continue;
        }
        match are_one_mount(scan, own, &frame) {
            Some(false) => others.insert(frame),
            _ => beside.insert(frame),
        };
    }
    CameraFrames::new(own, beside, others)
}

/// Rank of depth that is registered to colour: higher than any rank by name.
const REGISTERED_RANK: i32 = 16;

/// Returns the rank of depth images by their frame id: those in the frame of the colour images are
/// registered to them. Points may also be in that frame if the images from which they come are not.
fn registered_rank(scan: &Scan, colour: Option<&str>, depth: &str) -> i32 {
    let of_colour = colour.and_then(|colour| scan.frame_of(colour));
    let is_cloud = scan.topics.get(depth).is_some_and(|topic| topic.kind == Type::PointCloud);
    let is_known = of_colour.is_some_and(|frame| !frame.is_empty());
    if is_known && !is_cloud && scan.frame_of(depth) == of_colour { REGISTERED_RANK } else { 0 }
}

/// Returns the namespace that the topics of a rig share, or otherwise that of the first one.
fn label_of(topics: &[String]) -> String {
    let mut shared: Option<Vec<&str>> = None;
    for topic in topics {
        let mut own: Vec<&str> = topic.split('/').collect();
        own.pop();
        if let Some(shared) = shared {
            let same = shared.iter().zip(&own).take_while(|(a, b)| a == b).count();
            own.truncate(same);
        }
        shared = Some(own);
    }
    let label = shared.unwrap_or_default().join("/");
    if !label.trim_matches('/').is_empty() {
        return label;
    }
    let first = topics.first().cloned().unwrap_or_default();
    words_of(&first).unwrap_or(first)
}

impl Rig {
    pub(super) fn has(&self, topic: &str) -> bool {
        self.topics.iter().any(|own| own == topic)
    }

    /// Returns true if a picture may be made from one of this rig: by its namespace, its frame id,
    /// and a name with additional words.
    fn holds_original(&self, scan: &Scan, copy: &str) -> bool {
        let name = TopicName::of(copy);
        let frame = scan.frame_of(copy).filter(|frame| !frame.is_empty());
        self.topics.iter().any(|original| {
            let of_original = TopicName::of(original);
            let is_longer = name.device.len() > of_original.device.len();
            let is_beside = parent(copy) == parent(original) && !parent(copy).is_empty();
            let is_same_stream = name.stream == of_original.stream && name.side == of_original.side;
            let is_same_frame = frame.is_some() && frame == scan.frame_of(original);
            is_longer
                && is_beside
                && is_same_stream
                && is_same_frame
                && !name.contradicts(&of_original)
        })
    }

    /// Returns true if the user may mean this rig by a name: its namespace, a part of it, or the
    /// words for the device.
    pub(super) fn is_called(&self, name: &str) -> bool {
        let wanted = name.trim_matches('/');
        let words = TopicName::of(name).device;
        self.label.trim_matches('/') == wanted
            || self.topics.iter().any(|topic| {
                let plain = topic.trim_matches('/');
                plain == wanted
                    || plain.starts_with(&format!("{wanted}/"))
                    || !words.is_empty() && TopicName::of(topic).device == words
            })
    }

    /// Chooses the images of the rig. Those that are `taken` are already used for another input.
    pub(super) fn pick(&self, scan: &Scan, input: &InputSettings, named: &Pick) -> Pick {
        let is_pair = self.is_pair(scan);
        let colour = named.colour.clone().or_else(|| {
            self.best(scan, input, |name, topic| {
                let is_right = is_pair && TopicName::of(name).side == Side::Right;
                let is_free = named.depth.as_deref() != Some(name);
                if is_right || !is_free { None } else { colour_rank(name, topic) }
            })
        });
        let right = named.right.clone().or_else(|| {
            self.best(scan, input, |name, topic| {
                let is_right = is_pair && TopicName::of(name).side == Side::Right;
                if is_right { colour_rank(name, topic) } else { None }
            })
        });
        let depth = named.depth.clone().or_else(|| {
            self.best(scan, input, |name, topic| {
                let rank =
                    depth_rank(name, topic)? + registered_rank(scan, colour.as_deref(), name);
                // Any depth that can be used is better than one that cannot.
                let problem = colour.as_deref().and_then(|it| depth_problem(scan, input, it, name));
                Some(if problem.is_some() { rank - 100 } else { rank })
            })
        });
        let both = colour.as_deref().zip(depth.as_deref());
        let depth_problem =
            both.and_then(|(colour, depth)| depth_problem(scan, input, colour, depth));
        // The settings may name the right images as the colour topic.
        let right = right.filter(|topic| Some(topic) != colour.as_ref());
        Pick { colour, depth, right, depth_problem }
    }

    /// Returns true if the rig has pictures of both sides, so that the frames are not made from
    /// those of the right side.
    fn is_pair(&self, scan: &Scan) -> bool {
        let mut pictures = self.topics.iter().filter(|name| is_usable_picture(&scan.topics[*name]));
        pictures.any(|name| {
            let parts = TopicName::of(name);
            parts.side != Side::Right && parts.stream != Stream::Depth
        })
    }

    /// Returns the topic with the highest rank that is not a further obstacle source; of equal ones
    /// the one with the most messages, then the first by name.
    fn best(
        &self,
        scan: &Scan,
        input: &InputSettings,
        rank: impl Fn(&str, &Topic) -> Option<i32>,
    ) -> Option<String> {
        let names = self.topics.iter().map(String::as_str);
        super::best_of(scan, &input.sources, names, rank)
    }

    /// Returns the value of the rig for a pipeline: first that nothing required is missing, then
    /// what it has beyond that, then names and rates.
    pub(super) fn worth(&self, scan: &Scan, pick: &Pick, inputs: Inputs) -> [i64; 4] {
        let has_depth = pick.depth.is_some() && pick.depth_problem.is_none();
        let has = [
            (Input::Colour, pick.colour.is_some(), 2),
            (Input::Depth, has_depth, 3),
            (Input::Right, pick.right.is_some(), 1),
        ];
        let lacking = has.iter().filter(|(input, has, _)| inputs.requires(*input) && !has).count();
        let extra: i64 = has
            .iter()
            .filter(|(input, has, _)| inputs.uses(*input) && *has)
            .map(|(.., w)| *w)
            .sum();
        let first = pick.colour.as_ref().or(pick.depth.as_ref());
        let topic = first.and_then(|name| Some((name, scan.topics.get(name)?)));
        let rank = topic.map_or(0, |(name, topic)| {
            let lower = name.to_lowercase();
            colour_rank(&lower, topic).or(depth_rank(&lower, topic)).unwrap_or(0)
        });
        // One or two lost messages are no reason to prefer another camera.
        let count = topic.map_or(0, |(_, topic)| topic.count.max(1).ilog2());
        [-(lacking as i64), extra, i64::from(rank), i64::from(count)]
    }
}
