//! Reasons why topics are used or not.

use super::account::{InputAccount, TopicUse};
use super::foreign::{Foreign, foreign};
use super::kinds::{
    depth_as_picture, is_image, is_odometry, is_of, kind_of, unread_detections, unreadable,
};
use super::problems::{SCANNER_REMEDY, depth_problem, scanner_problem};
use super::rigs::{Rig, rigs};
use super::{Chosen, Relation, Stream, TopicName, odometry_problem};
use crate::images::Content;
use crate::scan::{Scan, Topic, Type};
use crate::sensors::{SENSORS, SensorType};
use crate::{Input, InputSettings, Inputs};

/// Reason for images of a rig that was not chosen.
pub(super) const OTHER_CAMERA: &str = "it is of another camera";

/// Returns the account of all images, scans, detections and odometry.
pub(super) fn account(
    scan: &Scan,
    input: &InputSettings,
    inputs: Inputs,
    chosen: &Chosen,
) -> InputAccount {
    let judge = Judge { scan, input, inputs, chosen, rigs: rigs(scan) };
    let topics = scan.topics.iter().filter_map(|(name, topic)| judge.entry(name, topic));
    let mut account = InputAccount { topics: topics.collect() };
    account.sort();
    account
}

/// Everything on which the reasons depend.
struct Judge<'a> {
    scan: &'a Scan,
    input: &'a InputSettings,
    inputs: Inputs,
    chosen: &'a Chosen,
    rigs: Vec<Rig>,
}

/// Reason with a remedy, which may be missing.
type Reason = (String, Option<String>);

impl Judge<'_> {
    /// Returns the entry of a topic; `None` for topics that are not sensors.
    fn entry(&self, name: &str, topic: &Topic) -> Option<TopicUse> {
        let sensor = SENSORS.iter().find(|sensor| is_of(sensor, topic));
        // If depth is wanted and missing, the important reason is why these points are not depth.
        let lacks_depth = self.inputs.uses(Input::Depth) && self.chosen.depth.is_none();
        let sensor = sensor.filter(|_| !(topic.is_lidar() && lacks_depth));
        let is_known = is_image(topic) || is_odometry(topic) || sensor.is_some();
        let unread = unread_detections(topic);
        let is_listed = is_known || unreadable(topic).is_some() || unread.is_some();
        let foreign = foreign(topic).filter(|_| !is_listed);
        if !is_listed && foreign.is_none() {
            return None;
        }
        let used_as = self.use_of(name);
        let reason = match &used_as {
            Some(_) => self.failure(name),
            None => Some(match sensor {
                Some(sensor) => self.unused_sensor(name, topic, sensor),
                None if is_odometry(topic) => self.unused_odometry(name, topic),
                None => match (unread, &foreign) {
                    (Some(why), _) => empty(topic).unwrap_or_else(|| with_remedy(why)),
                    (None, Some(found)) => empty(topic)
                        .unwrap_or_else(|| (found.why.clone(), Some(found.remedy.clone()))),
                    (None, None) => self.unused_image(name, topic),
                },
            }),
        };
        let (problem, remedy) = match reason {
            Some((problem, remedy)) => (Some(problem), remedy),
            None => (None, None),
        };
        Some(TopicUse {
            topic: name.to_owned(),
            kind: self.kind(topic),
            camera: self.rig_of(name).map(|rig| rig.label.clone()),
            used_as,
            calibration: self.calibration(name),
            could_be: match &foreign {
                Some(foreign) => self.foreign_could_be(foreign, topic),
                None => problem.as_ref().and_then(|_| self.could_be(name, topic)),
            },
            problem,
            remedy,
        })
    }

    /// Returns the input for which a topic could be used, if its problem were solved and no other
    /// topic were used for it.
    fn could_be(&self, name: &str, topic: &Topic) -> Option<&'static str> {
        let Chosen { colour, depth, depth_problem, odometry, .. } = self.chosen;
        let Chosen { odom_frames, unused_odometry, .. } = self.chosen;
        let has_depth = depth.is_some() && depth_problem.is_none();
        let is_empty = topic.count == 0 || topic.undecodable == topic.count;
        if is_empty {
            return None;
        }
        if unused_odometry.iter().any(|(unused, _)| unused == name) {
            return (odometry.is_none() && odom_frames.is_none()).then_some("odometry");
        }
        if self.is_broken_scanner(name, topic) {
            return Some(Input::Laser.name());
        }
        let parts = TopicName::of(name);
        let is_scan = topic.kind == Type::PointCloud || topic.schema.ends_with("LaserScan");
        let is_depth = topic.content == Content::Depth || topic.is_jpeg_depth || topic.is_deep_grey;
        let is_depth = is_depth || topic.is_other_stream || parts.stream == Stream::Depth;
        if is_depth {
            let is_free = self.inputs.uses(Input::Depth) && !has_depth;
            let is_depth = is_image(topic) || unreadable(topic).is_some() && !is_scan;
            return (is_depth && is_free).then_some("depth");
        }
        let is_free = self.inputs.uses(Input::Colour) && colour.is_none();
        (unreadable(topic).is_some() && is_free && !is_scan).then_some("colour")
    }

    /// Returns true for a scanner beside the first one that would be used too, if nothing were wrong.
    fn is_broken_scanner(&self, name: &str, topic: &Topic) -> bool {
        let Some(first) = self.chosen.sensor(Input::Laser) else { return false };
        let is_scanner =
            SENSORS.iter().any(|sensor| sensor.input == Input::Laser && is_of(sensor, topic));
        let is_left = self.use_of(name).is_none() && self.input.laser_topic.is_none();
        // Of two topics with one frame, one is enough.
        is_scanner && is_left && self.scan.frame_of(first) != self.scan.frame_of(name)
    }

    /// Returns the first of the inputs of messages of another type for which nothing else is used.
    fn foreign_could_be(&self, foreign: &Foreign, topic: &Topic) -> Option<&'static str> {
        let Chosen { colour, depth, depth_problem, .. } = self.chosen;
        for input in foreign.could_be {
            let (wanted, is_served) = match *input {
                "colour" => (Input::Colour, colour.is_some()),
                "depth" => (Input::Depth, depth.is_some() && depth_problem.is_none()),
                "laser" => (Input::Laser, self.chosen.sensor(Input::Laser).is_some()),
                _ => (Input::POINTS, self.chosen.sensor(Input::POINTS).is_some()),
            };
            if topic.count > 0 && self.inputs.uses(wanted) && !is_served {
                return Some(input);
            }
        }
        None
    }

    fn kind(&self, topic: &Topic) -> String {
        let size = topic.size.map(|(width, height)| format!(", {width}x{height}"));
        format!("{}{}", kind_of(topic), size.unwrap_or_default())
    }

    /// Returns the input for which a topic is used.
    fn use_of(&self, name: &str) -> Option<String> {
        let Chosen { colour, depth, right, odometry, sensors, .. } = self.chosen;
        let images =
            [("colour", colour), ("depth", depth), ("right", right), ("odometry", odometry)];
        let of_image = images.iter().find(|(_, topic)| topic.as_deref() == Some(name));
        if let Some((input, _)) = of_image {
            return Some((*input).to_owned());
        }
        if let Some((input, _)) = sensors.iter().find(|(_, topic)| *topic == name) {
            return Some(input.name().to_owned());
        }
        if self.chosen.further_scans.iter().any(|topic| topic == name) {
            return Some("laser".to_owned());
        }
        let source = self.input.sources.iter().find(|source| source.topic == name)?;
        Some(format!("source of obstacles `{}`", source.name))
    }

    /// Returns the reason why a chosen topic gives no data.
    fn failure(&self, name: &str) -> Option<Reason> {
        if let Some(fault) = self.scan.topics.get(name).and_then(Topic::impossible) {
            return Some((
                format!("its messages are invalid: {fault}"),
                Some(SCANNER_REMEDY.to_owned()),
            ));
        }
        let is_depth = self.chosen.depth.as_deref() == Some(name);
        let mut sensors = self.chosen.sensors.iter();
        let sensor = sensors.find(|(_, topic)| *topic == name).map(|(input, _)| input);
        let of_sensor = sensor.and_then(|input| self.chosen.sensor_problems.get(input));
        let of_depth = self.chosen.depth_problem.as_ref().filter(|_| is_depth);
        let problem = of_sensor.or(of_depth)?;
        Some((problem.why.clone(), Some(problem.remedy.clone())))
    }

    fn calibration(&self, name: &str) -> Option<String> {
        let found = self.chosen.calibrations.get(name)?;
        let words = found.relation.words().map(|words| format!(", {words}")).unwrap_or_default();
        let info = self.scan.infos.get(&found.topic);
        let size = self.scan.topics.get(name).and_then(|topic| topic.size);
        let scaled = match (info, size) {
            (Some(info), Some(size))
                if found.relation != Relation::Own || is_scaled(info, size) =>
            {
                format!(", {}x{}", info.width, info.height)
            }
            _ => String::new(),
        };
        let instead = found.instead_of.as_ref();
        let instead = instead.map(|why| format!(", in place of {why}")).unwrap_or_default();
        Some(format!("{}{scaled}{words}{instead}", found.topic))
    }

    fn rig_of(&self, name: &str) -> Option<&Rig> {
        self.rigs.iter().find(|rig| rig.has(name))
    }

    fn unused_image(&self, name: &str, topic: &Topic) -> Reason {
        if let Some(reason) = empty(topic) {
            return reason;
        }
        if let Some((why, remedy)) = depth_as_picture(name, topic) {
            return (why.to_owned(), Some(remedy.to_owned()));
        }
        if let Some(why) = unreadable(topic) {
            return with_remedy(why);
        }
        let rig = self.rig_of(name);
        let other_rig = rig.filter(|rig| Some(&rig.label) != self.chosen.camera.as_ref());
        if let (Some(rig), Some(_)) = (other_rig, &self.chosen.camera) {
            let remedy = format!("`camera = \"{}\"` under [input] takes that one", rig.label);
            return (OTHER_CAMERA.to_owned(), Some(remedy));
        }
        let (kind, key, used) = match topic.content {
            Content::Depth => ("depth", "depth_topic", &self.chosen.depth),
            _ => ("colour", "colour_topic", &self.chosen.colour),
        };
        if topic.content == Content::Depth && used.is_none() {
            return self.unused_depth(name);
        }
        let Some(used) = used else {
            return (format!("no {kind} images are used"), None);
        };
        if topic.is_deep_grey {
            let remedy = "if they are depth, name the topic as `depth_topic` under [input], with \
                          its unit as `depth_unit_m`";
            return (
                "its grey images of 16 bits could be depth".to_owned(),
                Some(remedy.to_owned()),
            );
        }
        let remedy = format!("`{key} = \"{name}\"` under [input] takes this one");
        (format!("{used} is used"), Some(remedy))
    }

    /// Returns the reason why depth is left out.
    fn unused_depth(&self, name: &str) -> Reason {
        let colour = self.chosen.colour.as_deref().unwrap_or_default();
        match depth_problem(self.scan, self.input, colour, name) {
            Some(problem) => (problem.why, Some(problem.remedy)),
            None => ("the pipeline uses no depth".to_owned(), None),
        }
    }

    fn unused_odometry(&self, name: &str, topic: &Topic) -> Reason {
        if let Some(reason) = empty(topic) {
            return reason;
        }
        if let Some(problem) = odometry_problem(self.scan, self.chosen.primary(), name) {
            return (problem.why, Some(problem.remedy));
        }
        let remedy = format!("`odometry_topic = \"{name}\"` under [input] takes this one");
        let why = match (&self.chosen.odometry, &self.input.odometry_topic) {
            (Some(used), _) => format!("{used} is used"),
            (None, Some(named)) => format!("`odometry_topic` names {named}"),
            (None, None) => "no topic is used as odometry".to_owned(),
        };
        (why, Some(remedy))
    }

    fn unused_sensor(&self, name: &str, topic: &Topic, sensor: &SensorType) -> Reason {
        if topic.count == 0 {
            return ("no message was recorded".to_owned(), None);
        }
        let key = sensor.key();
        let takes = format!("`{key} = \"{name}\"` under [input] takes this one");
        if let Some(other) = self.chosen.sensor(sensor.input) {
            let is_scan = sensor.input == Input::Laser && self.input.laser_topic.is_none();
            let primary = self.chosen.primary();
            let problem = scanner_problem(self.scan, self.input, primary, other, name);
            if let Some(problem) = problem.filter(|_| is_scan) {
                let remedy = Some(problem.remedy).filter(|remedy| !remedy.is_empty());
                return (problem.why, remedy);
            }
            return (format!("{other} is used"), Some(takes));
        }
        let is_named = self.input.topic_of(sensor.input).is_some();
        if sensor.rank.is_none() && !is_named {
            let remedy = recorded_remedy(&key, name);
            return (
                "recorded detections are read only if their topic is named".to_owned(),
                Some(remedy),
            );
        }
        if !self.inputs.uses(sensor.input) {
            return (format!("the pipeline uses no {}", sensor.wanted), None);
        }
        (format!("no {} are used", sensor.wanted), Some(takes))
    }
}

/// Topic that the built-in config `recorded` names.
const RECORDED_TOPIC: &str = "/detections";

/// Returns the command that uses recorded detections, with the config that is needed for a topic
/// other than that of the built-in config.
fn recorded_remedy(key: &str, name: &str) -> String {
    if name == RECORDED_TOPIC {
        return "`tagalong run recorded LOG` uses them".to_owned();
    }
    format!(
        "`tagalong run own.toml LOG` uses them, with these two lines in own.toml: \
         `extends = \"recorded.toml\"` and `input.{key} = \"{name}\"`"
    )
}

fn is_scaled(info: &crate::msgs::CameraInfo, size: (u32, u32)) -> bool {
    // Binning and regions of interest explain other sizes.
    let is_plain = info.binning_x <= 1 && info.binning_y <= 1 && info.roi.width == 0;
    is_plain && (info.width, info.height) != size
}

/// Splits a reason from its remedy.
fn with_remedy(why: String) -> Reason {
    match why.split_once(": ") {
        Some((why, remedy)) => (why.to_owned(), Some(remedy.to_owned())),
        None => (why, None),
    }
}

/// Returns the reason for a topic of which no message can be decoded.
fn mismatched(messages: u64) -> String {
    match messages {
        1 => "its only message does not match its type".to_owned(),
        _ => format!("its {messages} messages do not match their type"),
    }
}

/// Returns the reason for a topic without any readable message.
fn empty(topic: &Topic) -> Option<Reason> {
    if topic.count == 0 {
        return Some(("no message was recorded".to_owned(), None));
    }
    let is_lost = topic.undecodable == topic.count;
    is_lost.then(|| (mismatched(topic.count), None))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_message_is_told_in_the_singular() {
        assert_eq!(mismatched(1), "its only message does not match its type");
        assert_eq!(mismatched(2), "its 2 messages do not match their type");
    }
}
