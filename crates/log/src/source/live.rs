//! Frames from messages that arrive now.
//!
//! What takes two readings of a file takes two phases here: [`Listening`] gathers
//! until everything is there that the pipeline needs, [`LiveSource`] makes frames.
//! Who comes too late for a frame is not waited for: see
//! [`LiveSource::newest_frame`].

use std::collections::BTreeMap;
use std::slice::Iter;
use std::sync::Arc;

use super::assembly::{Assembly, Messages};
use super::plan::{plan, tally_of};
use super::{LogFacts, LogFrame};
use crate::mcap_walk::{Channel, Message};
use crate::scan::{Gathering, Type};
use crate::{InputSettings, Inputs, Limits, LogError};

/// Messages that are kept of each topic, to find the floor in.
const KEPT: u64 = 16;

/// A topic and one of its messages.
type Held = (Arc<Channel>, Vec<u8>);

/// The first phase: which topics are there, and what are they?
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
    /// Knows of no topic yet. `name` stands in errors where a log has its path.
    ///
    /// # Errors
    /// [`LogError::Settings`] for numbers that cannot work.
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

    /// Takes note of a topic; false if it was known.
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
        };
        self.channels.insert(topic.to_owned(), Arc::new(channel));
        self.gathering.topic(topic, message_type, "cdr");
        true
    }

    /// True for a topic that was announced and of whose messages frames can be made.
    /// Detections of others are wanted only where the settings name them, since our
    /// own have the same type.
    pub fn wants(&self, topic: &str) -> bool {
        let kind = self.channels.get(topic).map(|channel| Type::of(&channel.schema_name));
        match kind {
            None | Some(Type::Other) => false,
            Some(Type::Detections2D | Type::Detections3D) => {
                self.input.detections_topic.as_deref() == Some(topic)
            }
            Some(_) => true,
        }
    }

    /// True once an image has come.
    pub fn has_image(&self) -> bool {
        self.gathering.has_image()
    }

    /// Takes in a message, in CDR with its encapsulation header. Those of topics
    /// that were not announced are ignored.
    pub fn take(&mut self, topic: &str, data: &[u8]) {
        let Some(channel) = self.channels.get(topic) else { return };
        self.gathering.take(&message(channel, data));
        if self.gathering.topic(topic, "", "cdr").count <= KEPT {
            self.held.push((Arc::clone(channel), data.to_vec()));
        }
    }

    /// Begins to make frames, if everything that is needed has been seen. To be
    /// asked again after an error, which may pass as messages arrive.
    ///
    /// # Errors
    /// [`LogError`]: something that the inputs or the settings name is not there
    /// (yet), or a calibration cannot be used.
    pub fn start(&self) -> Result<LiveSource, LogError> {
        let scan = Arc::new(self.gathering.scan(&self.name));
        let mut tally = tally_of(&scan);
        let reread = || Ok(Box::new(self.held.iter()) as Box<dyn Messages + '_>);
        let plan = plan(scan, &self.input, &self.limits, self.inputs, &mut tally, &reread)?;
        let assembly = Assembly::new(plan, tally);
        let channels = self.channels.clone().into_iter();
        let channels = channels.filter(|(_, channel)| assembly.reads(channel)).collect();
        Ok(LiveSource { assembly, channels })
    }
}

/// The second phase: frames, as images arrive.
pub struct LiveSource {
    assembly: Assembly,
    channels: BTreeMap<String, Arc<Channel>>,
}

impl LiveSource {
    /// The topics that are read; messages of others are ignored.
    pub fn topics(&self) -> impl Iterator<Item = &str> {
        self.channels.keys().map(String::as_str)
    }

    /// Takes in a message, in CDR with its encapsulation header. One that does not
    /// decode is counted.
    pub fn take(&mut self, topic: &str, data: &[u8]) {
        if let Some(channel) = self.channels.get(topic) {
            self.assembly.take(&message(channel, data));
        }
    }

    /// The newest frame whose images have all arrived, if there is a new one.
    ///
    /// A log can be waited for, a robot cannot: an image whose partners are there
    /// becomes a frame at once, and what is older is skipped and counted as
    /// `frames_skipped`. An image whose partners do not come is given up once
    /// [`InputSettings::reorder_frames`] newer ones wait.
    pub fn newest_frame(&mut self) -> Option<LogFrame> {
        self.assembly.newest_frame()
    }

    /// Why no frame can be made of the images that came, if that is so.
    pub fn misfit(&self) -> Option<LogError> {
        self.assembly.misfit().map(|misfit| self.assembly.plan.misfit(misfit.clone()))
    }

    /// What was counted so far: images skipped and lost, and why.
    pub fn counters(&self) -> &BTreeMap<&'static str, u64> {
        &self.assembly.tally.counters
    }

    /// What is to be said about the messages, each thing once.
    pub fn notes(&self) -> &[String] {
        &self.assembly.tally.notes
    }

    /// What was found out; the camera once there was a frame.
    pub fn facts(&self) -> LogFacts {
        self.assembly.facts()
    }
}

fn message<'a>(channel: &'a Arc<Channel>, data: &'a [u8]) -> Message<'a> {
    Message { channel, log_time: 0, publish_time: 0, sequence: 0, data }
}
