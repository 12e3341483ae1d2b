//! Frames from messages that arrive live.
//!
//! The two passes over a file become two phases here: [`Listening`] collects messages until all
//! inputs of the pipeline are there, and [`LiveSource`] makes frames. Images that come too late for
//! a frame are not waited for: see [`LiveSource::newest_frame`].

use std::collections::BTreeMap;
use std::slice::Iter;
use std::sync::Arc;

use super::assembly::{Assembly, Messages};
use super::intake::UNKNOWN_TIME;
use super::plan::{plan, tally_of};
use super::{LogFacts, LogFrame};
use crate::scan::{Gathering, Type};
use crate::sensors::SensorType;
use crate::walk::{Channel, Message};
use crate::{InputSettings, Inputs, Limits, LogError};

/// Number of stored messages of each topic, for fitting the floor.
const KEPT: u64 = 16;

/// Channel with one of its messages.
type Held = (Arc<Channel>, Vec<u8>);

/// First phase: discovery of the topics and their types.
pub struct Listening {
    name: String,
    input: InputSettings,
    limits: Limits,
    inputs: Inputs,
    gathering: Gathering,
    channels: BTreeMap<String, Arc<Channel>>,
    held: Vec<Held>,
}

impl Messages for Iter<'_, Held> {
    fn next_message(&mut self) -> Option<Message<'_>> {
        self.next().map(|(channel, data)| message(channel, data))
    }
}

impl Listening {
    /// Starts without any topic. `name` replaces the path of a log in errors.
    ///
    /// # Errors
    /// [`LogError::Settings`] for invalid values.
    pub fn new(
        name: &str,
        input: &InputSettings,
        limits: &Limits,
        inputs: Inputs,
    ) -> Result<Self, LogError> {
        input.check()?;
        Ok(Self {
            name: name.to_owned(),
            input: input.clone(),
            limits: limits.clone(),
            inputs,
            gathering: Gathering::new(input.depth_unit_m),
            channels: BTreeMap::new(),
            held: Vec::new(),
        })
    }

    /// Adds a topic; returns false if it was already known.
    pub fn announce(&mut self, topic: &str, message_type: &str) -> bool {
        if self.channels.contains_key(topic) {
            return false;
        }
        let channel = Channel {
            id: 0,
            topic: topic.to_owned(),
            schema_name: message_type.to_owned(),
            schema_encoding: "ros2msg".into(),
            encoding: "cdr".into(),
            definition: Arc::default(),
        };
        self.channels.insert(topic.to_owned(), Arc::new(channel));
        self.gathering.topic(topic, message_type, "cdr");
        true
    }

    /// Returns true for an announced topic whose messages frames can use. Some sensors are used
    /// only if the settings name their topic, for example detections, because Tagalong's own output
    /// has the same type.
    pub fn wants(&self, topic: &str) -> bool {
        let Some(channel) = self.channels.get(topic) else { return false };
        if self.input.sources.iter().any(|source| source.topic == topic) {
            return true;
        }
        match Type::of(&channel.schema_name) {
            Type::Other => false,
            Type::Sensor => SensorType::of_message(&channel.schema_name).is_some_and(|sensor| {
                sensor.rank.is_some() || self.input.topic_of(sensor.input) == Some(topic)
            }),
            _ => true,
        }
    }

    /// Returns true once an image has arrived.
    pub fn has_image(&self) -> bool {
        self.gathering.has_image()
    }

    /// Adds a message, in CDR with its encapsulation header. Messages on topics that were not
    /// announced are ignored.
    pub fn take(&mut self, topic: &str, data: &[u8]) {
        let Some(channel) = self.channels.get(topic) else { return };
        self.gathering.take(&message(channel, data));
        // Only the first messages are stored, because listening may go on for ever.
        if self.gathering.topic(topic, "", "cdr").count <= KEPT {
            self.held.push((Arc::clone(channel), data.to_vec()));
        }
    }

    /// Starts making frames, if all inputs have been seen. Call it again after an error, because
    /// further messages may resolve it.
    ///
    /// # Errors
    /// [`LogError`]: a topic that the inputs or the settings name is not there (yet), or a
    /// calibration cannot be used.
    pub fn start(&self) -> Result<LiveSource, LogError> {
        let scan = Arc::new(self.gathering.scan(&self.name));
        let mut tally = tally_of(&scan);
        let plan = plan(scan, &self.input, &self.limits, self.inputs, &mut tally, &|| {
            Ok(Box::new(self.held.iter()) as Box<dyn Messages + '_>)
        })?;
        let assembly = Assembly::new(plan, tally);
        let channels = self.channels.clone().into_iter();
        let channels = channels.filter(|(_, channel)| assembly.reads(channel)).collect();
        Ok(LiveSource { assembly, channels })
    }
}

/// Second phase: makes frames as images arrive.
pub struct LiveSource {
    assembly: Assembly,
    channels: BTreeMap<String, Arc<Channel>>,
}

impl LiveSource {
    /// Returns the topics that are used; messages on others are ignored.
    pub fn topics(&self) -> impl Iterator<Item = &str> {
        self.channels.keys().map(String::as_str)
    }

    /// Adds a message, in CDR with its encapsulation header. One that cannot be decoded is counted.
    pub fn take(&mut self, topic: &str, data: &[u8]) {
        self.take_at(topic, data, UNKNOWN_TIME);
    }

    /// Adds a message as [`LiveSource::take`] does, with its arrival time in ns, of any clock that
    /// does not go back and is not at 0. It serves as the stamp of messages that have none, such as
    /// those of simple bumpers. Without it they get the stamp of the image before them.
    pub fn take_at(&mut self, topic: &str, data: &[u8], arrival_ns: u64) {
        if let Some(channel) = self.channels.get(topic) {
            self.assembly.take(&Message { log_time: arrival_ns, ..message(channel, data) });
        }
    }

    /// Returns the newest frame with all its images, if there is a new one.
    ///
    /// Unlike a log, a robot does not wait: an image with all its partners becomes a frame at once,
    /// and older ones are skipped and counted as `frames_skipped`. An image with missing partners
    /// is given up once [`InputSettings::reorder_frames`] newer ones wait.
    pub fn newest_frame(&mut self) -> Option<LogFrame> {
        self.assembly.newest_frame()
    }

    /// Returns the reason why no frame can be made from the images, if there is one.
    pub fn misfit(&self) -> Option<LogError> {
        self.assembly.misfit().map(|misfit| self.assembly.plan.misfit(misfit.clone()))
    }

    /// Returns the topic of the first calibration that changed on the way, if one did.
    pub fn changed_calibration(&self) -> Option<&str> {
        self.assembly.changed_calibration()
    }

    /// Returns the numbers of skipped and lost images so far, by reason.
    pub fn counters(&self) -> &BTreeMap<&'static str, u64> {
        &self.assembly.tally.counters
    }

    /// Returns the remarks about the messages, each of them once.
    pub fn notes(&self) -> &[String] {
        &self.assembly.tally.notes
    }

    /// Returns true if there is odometry, as a topic or as transforms.
    pub fn has_odometry(&self) -> bool {
        self.assembly.plan.odom_frames.is_some()
    }

    /// Returns the properties of the source; those of the camera are known only after a frame.
    pub fn facts(&self) -> LogFacts {
        self.assembly.facts()
    }
}

fn message<'a>(channel: &'a Arc<Channel>, data: &'a [u8]) -> Message<'a> {
    Message { channel, log_time: UNKNOWN_TIME, publish_time: 0, sequence: 0, data }
}
