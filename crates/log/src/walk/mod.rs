//! State while reading a log file, shared by the readers of all containers.

mod source;

use std::collections::BTreeMap;
use std::io::Read;
use std::ops::Range;
use std::sync::Arc;

pub(crate) use source::Source;

use crate::Limits;
use crate::packed::{is_packed, unpack_message};

/// Stream of messages of one type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// ID within the file.
    pub id: u16,
    /// Name of the topic.
    pub topic: String,
    /// Name of the message type, for example `sensor_msgs/msg/Image`; empty if the file does not
    /// give it.
    pub schema_name: String,
    /// Language of the definition, for example `ros2msg`.
    pub schema_encoding: String,
    /// Encoding of the messages, for example `cdr`.
    pub encoding: String,
    /// Definition of the message type, including those that it contains; empty if the file has
    /// none.
    pub definition: Arc<str>,
}

/// One message, borrowed from the walker's buffer.
#[derive(Clone, Copy, Debug)]
pub struct Message<'a> {
    /// Channel on which it was published.
    pub channel: &'a Arc<Channel>,
    /// Recording time, ns.
    pub log_time: u64,
    /// Time of publication, ns.
    pub publish_time: u64,
    /// Sequence number given by the publisher.
    pub sequence: u32,
    /// Encoded message.
    pub data: &'a [u8],
}

/// Counters of a walk by name. Those in [`LOSSES`] mean that some part of the file could not be
/// used.
pub type Counters = BTreeMap<&'static str, u64>;

/// Names of the counters that mean lost data.
pub const LOSSES: &[&str] = &[
    "conflicting_channels",
    "crc_failed_chunks",
    "damaged_chunks",
    "damaged_compression",
    "damaged_records",
    "data_section_crc_failed",
    "nested_chunks",
    "oversized_chunks",
    "oversized_records",
    "statistics_disagree",
    "truncated",
    "uncommitted_transactions",
    "unknown_channel_messages",
    "unknown_compression_chunks",
];

/// Maximum number of stored sentences about one file.
const MAX_NOTES: usize = 12;

/// Position of a message in the buffer.
pub(crate) struct Located {
    pub(crate) channel: Arc<Channel>,
    pub(crate) log_time: u64,
    pub(crate) publish_time: u64,
    pub(crate) sequence: u32,
    pub(crate) data: Range<usize>,
}

/// Position in a log file, and the results so far.
pub(crate) struct Walk<R> {
    pub(crate) source: Source<R>,
    pub(crate) limits: Limits,
    pub(crate) channels: BTreeMap<u16, Arc<Channel>>,
    /// Records of the current chunk, or one top-level record.
    pub(crate) buffer: Vec<u8>,
    /// Part of the buffer that has not been read yet.
    pub(crate) rest: Range<usize>,
    /// Offset of the current top-level record in the file.
    pub(crate) offset: u64,
    pub(crate) located: Option<Located>,
    /// The decompressed message, if it is compressed in the buffer.
    unpacked: Vec<u8>,
    is_unpacked: bool,
    pub(crate) counters: Counters,
    pub(crate) notes: Vec<String>,
    pub(crate) ended: bool,
}

impl<R: Read> Walk<R> {
    /// Starts after the part of the file that was already read from `source`.
    pub(crate) fn new(source: Source<R>, limits: &Limits) -> Self {
        Self {
            offset: source.position(),
            source,
            limits: limits.clone(),
            channels: BTreeMap::new(),
            buffer: Vec::new(),
            rest: 0..0,
            located: None,
            unpacked: Vec::new(),
            is_unpacked: false,
            counters: BTreeMap::new(),
            notes: Vec::new(),
            ended: false,
        }
    }

    /// Returns the message that the walk has reached.
    pub(crate) fn message(&self) -> Option<Message<'_>> {
        let found = self.located.as_ref()?;
        Some(Message {
            channel: &found.channel,
            log_time: found.log_time,
            publish_time: found.publish_time,
            sequence: found.sequence,
            data: if self.is_unpacked { &self.unpacked } else { &self.buffer[found.data.clone()] },
        })
    }

    pub(crate) fn count(&mut self, name: &'static str) {
        *self.counters.entry(name).or_default() += 1;
    }

    /// Counts a fault, and stores a sentence about the first few.
    pub(crate) fn fault(&mut self, name: &'static str, what: impl FnOnce() -> String) {
        self.count(name);
        if self.notes.len() < MAX_NOTES {
            let what = what();
            self.notes.push(format!("at byte {}: {what}", self.offset));
        }
    }

    pub(crate) fn end_truncated(&mut self, what: &str) {
        self.fault("truncated", || format!("the file ends {what}; what came before is used"));
        self.ended = true;
    }

    /// Skips the rest of a record.
    pub(crate) fn skip(&mut self, length: u64) {
        if self.source.skip(length) < length {
            self.end_truncated(&format!("inside a record that claims {length} bytes"));
        }
    }

    /// Adds a channel that a record defines.
    pub(crate) fn learn(&mut self, channel: Channel) {
        let known = self.channels.entry(channel.id).or_insert_with(|| Arc::new(channel.clone()));
        // The first one is kept; messages of the other cannot be distinguished from its own.
        if known.topic != channel.topic || known.encoding != channel.encoding {
            let topic = known.topic.clone();
            self.fault("conflicting_channels", || {
                format!("channel {} is {topic} and then {}", channel.id, channel.topic)
            });
        }
    }

    /// Returns the channel of a message; counts a message of an unknown one.
    pub(crate) fn channel_of(&mut self, id: u32) -> Option<Arc<Channel>> {
        let known = u16::try_from(id).ok().and_then(|id| self.channels.get(&id)).map(Arc::clone);
        if known.is_none() {
            self.fault("unknown_channel_messages", || format!("a message of channel {id}"));
        }
        known
    }

    /// Delivers a message, unpacked if it is compressed.
    pub(crate) fn deliver(&mut self, located: Located) {
        let data = &self.buffer[located.data.clone()];
        // Messages in other encodings than CDR may start with any bytes.
        self.is_unpacked = located.channel.encoding == "cdr" && is_packed(data);
        if self.is_unpacked {
            if let Err((counter, why)) = unpack_message(data, &self.limits, &mut self.unpacked) {
                return self.fault(counter, || why);
            }
            self.count("messages_unpacked");
        }
        self.located = Some(located);
        self.count("messages");
    }
}
