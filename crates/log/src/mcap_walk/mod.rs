//! Robust reader of an MCAP file, which trusts nothing in it.
//!
//! The file is read once from front to back through a small buffer, so that a pipe of any length
//! can be read, and a file that shrinks meanwhile is only a truncated file. The records of a chunk
//! are delivered only after all of it was decompressed and its checksum verified. A part that
//! cannot be used is counted and the walk goes on behind it; a part without an end (a record longer
//! than the rest of the file) ends the walk. Once ended, it stays ended.
//!
//! The index at the end of a file is never needed, hence a file without it (because its writer was
//! killed) is read like any other, up to its last complete chunk.
//!
//! Source: the MCAP specification, version 0, sections "Records" and "Chunk".

mod chunk;
mod record;
mod source;

use std::collections::BTreeMap;
use std::io::Read;
use std::ops::Range;
use std::sync::Arc;

use chunk::ChunkFault;
use record::Opcode;
use source::Source;

use crate::Limits;

/// Stream of messages of one type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Id within the file.
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
}

/// One message, borrowed from the walker's buffer.
#[derive(Clone, Copy, Debug)]
pub struct Message<'a> {
    /// Channel on which it was published.
    pub channel: &'a Arc<Channel>,
    /// Time of recording, ns.
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
    "damaged_records",
    "data_section_crc_failed",
    "nested_chunks",
    "oversized_chunks",
    "oversized_records",
    "statistics_disagree",
    "truncated",
    "unknown_channel_messages",
    "unknown_compression_chunks",
];

/// Error for a file that is not MCAP at all.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("not an MCAP file: {0}")]
pub struct NotMcap(pub String);

/// Position of the next message in the buffer.
struct Located {
    channel: Arc<Channel>,
    log_time: u64,
    publish_time: u64,
    sequence: u32,
    data: Range<usize>,
}

/// Reader of a file, record by record. See the [module](self).
pub struct Walker<R> {
    source: Source<R>,
    limits: Limits,
    schemas: BTreeMap<u16, (String, String)>,
    channels: BTreeMap<u16, Arc<Channel>>,
    /// Records of the current chunk, or one top-level message.
    buffer: Vec<u8>,
    /// Part of the buffer that is still to be read.
    rest: Range<usize>,
    /// Offset of the current top-level record in the file.
    offset: u64,
    located: Option<Located>,
    counters: Counters,
    notes: Vec<String>,
    claimed_messages: Option<u64>,
    ended: bool,
}

impl<R: Read> Walker<R> {
    /// Starts a walk.
    ///
    /// # Errors
    /// [`NotMcap`] if the file does not start with the magic of MCAP.
    pub fn new(reader: R, limits: &Limits) -> Result<Self, NotMcap> {
        let mut source = Source::new(reader);
        let mut magic = [0; 8];
        let got = source.fill(&mut magic);
        if got < 8 || magic != record::MAGIC {
            return Err(NotMcap(describe_start(&magic[..got])));
        }
        Ok(Self {
            source,
            limits: limits.clone(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            buffer: Vec::new(),
            rest: 0..0,
            offset: 8,
            located: None,
            counters: BTreeMap::new(),
            notes: Vec::new(),
            claimed_messages: None,
            ended: false,
        })
    }

    /// Adds the channels of an earlier walk through the same file. The index at the end repeats
    /// them, which helps where the chunk with their first record is damaged.
    #[must_use]
    pub fn knowing(mut self, channels: impl IntoIterator<Item = Arc<Channel>>) -> Self {
        self.channels.extend(channels.into_iter().map(|channel| (channel.id, channel)));
        self
    }

    /// Returns the next message in the order of the file; `None` at the end, and from then on.
    #[expect(clippy::should_implement_trait, reason = "the message borrows the walker's buffer")]
    pub fn next(&mut self) -> Option<Message<'_>> {
        self.advance();
        self.message()
    }

    /// Goes on to the next message; returns false at the end.
    pub(crate) fn advance(&mut self) -> bool {
        self.located = None;
        while self.located.is_none() && !self.ended {
            if self.rest.is_empty() {
                self.step_in_file();
            } else {
                self.step_in_buffer();
            }
        }
        self.located.is_some()
    }

    /// Returns the message that [`Walker::advance`] reached.
    pub(crate) fn message(&self) -> Option<Message<'_>> {
        let found = self.located.as_ref()?;
        Some(Message {
            channel: &found.channel,
            log_time: found.log_time,
            publish_time: found.publish_time,
            sequence: found.sequence,
            data: &self.buffer[found.data.clone()],
        })
    }

    /// Returns the channels found so far.
    pub fn channels(&self) -> impl Iterator<Item = &Arc<Channel>> {
        self.channels.values()
    }

    /// Returns the numbers of records read, skipped and lost, by name.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Returns true if some part of the file could not be used.
    pub fn data_lost(&self) -> bool {
        self.counters.keys().any(|name| LOSSES.contains(name))
    }

    /// Returns sentences about the damage, each with its offset in the file; only the first few.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Returns the number of bytes of the file consumed so far.
    pub fn position(&self) -> u64 {
        self.source.position()
    }

    /// Returns the reader, behind the buffered part of the file.
    pub fn into_reader(self) -> R {
        self.source.into_inner()
    }

    fn count(&mut self, name: &'static str) {
        *self.counters.entry(name).or_default() += 1;
    }

    /// Counts a fault, and keeps a sentence about the first few.
    fn fault(&mut self, name: &'static str, what: impl FnOnce() -> String) {
        self.count(name);
        if self.notes.len() < MAX_NOTES {
            let what = what();
            self.notes.push(format!("at byte {}: {what}", self.offset));
        }
    }

    fn end_truncated(&mut self, what: &str) {
        self.fault("truncated", || format!("the file ends {what}; what came before is used"));
        self.ended = true;
    }

    /// Reads one record from the file.
    fn step_in_file(&mut self) {
        self.offset = self.source.position();
        // The checksum of the data section covers the bytes before its closing record.
        let before = self.source.crc();
        let mut head = [0; 9];
        match self.source.fill(&mut head) {
            9 => {}
            // The closing magic in place of a record: there is no footer.
            8 if head[..8] == record::MAGIC => {
                return self.end_truncated("before its index is complete");
            }
            0 => return self.end_truncated("without its closing records"),
            _ => return self.end_truncated("in the middle of a record"),
        }
        let length = record::u64_at(&head, 1);
        match Opcode::from(head[0]) {
            Opcode::Chunk => self.take_chunk(length),
            Opcode::Schema | Opcode::Channel | Opcode::Message => self.take_record(head[0], length),
            Opcode::DataEnd => self.take_data_end(length, before),
            Opcode::Statistics => self.take_statistics(length),
            Opcode::Footer => self.take_footer(length),
            Opcode::Attachment => self.pass(length, "attachments_skipped"),
            Opcode::Unknown => self.pass(length, "unknown_records_skipped"),
            Opcode::Harmless => self.skip(length),
        }
    }

    fn pass(&mut self, length: u64, counter: &'static str) {
        self.count(counter);
        self.skip(length);
    }

    fn skip(&mut self, length: u64) {
        if self.source.skip(length) < length {
            self.end_truncated(&format!("inside a record that claims {length} bytes"));
        }
    }

    /// Reads a record into the buffer; returns false if it is too long or truncated.
    fn read_record(&mut self, length: u64) -> bool {
        if length > self.limits.record_bytes {
            let limit = self.limits.record_bytes;
            self.fault("oversized_records", || {
                format!("a record claims {length} bytes; the limit is {limit}")
            });
            self.skip(length);
            return false;
        }
        let got = self.source.read_into(&mut self.buffer, length);
        if got < length {
            self.end_truncated(&format!("inside a record that claims {length} bytes"));
        }
        got == length
    }

    fn take_record(&mut self, opcode: u8, length: u64) {
        if self.read_record(length) {
            self.interpret(opcode, 0..self.buffer.len());
        }
    }

    fn take_chunk(&mut self, length: u64) {
        match chunk::read(&mut self.source, length, &self.limits, &mut self.buffer) {
            Ok(has_crc) => {
                self.count(if has_crc { "chunks_verified" } else { "chunks_without_crc" });
                self.rest = 0..self.buffer.len();
            }
            Err(ChunkFault::Truncated) => {
                self.end_truncated(&format!("inside a chunk that claims {length} bytes"));
            }
            Err(ChunkFault::Skipped { counter, why }) => self.fault(counter, || why),
        }
        if self.rest.is_empty() {
            self.buffer.clear();
        }
    }

    /// Verifies the checksum over everything before the record, if the file has one.
    fn take_data_end(&mut self, length: u64, crc: u32) {
        if !self.read_record(length) {
            return;
        }
        let stored = self.buffer.get(..4).map_or(0, |b| record::u32_at(b, 0));
        if stored != 0 && stored != crc {
            self.fault("data_section_crc_failed", || {
                "the checksum of the whole file is wrong: something in it was changed".into()
            });
        }
    }

    fn take_statistics(&mut self, length: u64) {
        if self.read_record(length) && self.buffer.len() >= 8 {
            self.claimed_messages = Some(record::u64_at(&self.buffer, 0));
        }
    }

    fn take_footer(&mut self, length: u64) {
        if !self.read_record(length) {
            return;
        }
        let mut magic = [0; 8];
        if self.source.fill(&mut magic) < 8 || magic != record::MAGIC {
            self.end_truncated("without its closing magic");
        }
        let delivered = self.counters.get("messages").copied().unwrap_or(0);
        if let Some(claimed) = self.claimed_messages.filter(|claimed| *claimed != delivered) {
            self.fault("statistics_disagree", || {
                format!("the index counts {claimed} messages, {delivered} were readable")
            });
        }
        self.ended = true;
    }

    /// Reads one record from the chunk in the buffer.
    fn step_in_buffer(&mut self) {
        let Range { start, end } = self.rest.clone();
        let whole = self.buffer[start..end]
            .get(..9)
            .map(|head| (head[0], record::u64_at(head, 1)))
            .filter(|(_, length)| *length <= (end - start - 9) as u64);
        let Some((opcode, length)) = whole else {
            self.rest = 0..0;
            return self.fault("damaged_chunks", || {
                format!("record at {start} of the decompressed chunk is longer than the chunk")
            });
        };
        let body = start + 9..start + 9 + length as usize;
        self.rest.start = body.end;
        if length > self.limits.record_bytes {
            return self.fault("oversized_records", || format!("a record of {length} bytes"));
        }
        match Opcode::from(opcode) {
            Opcode::Schema | Opcode::Channel | Opcode::Message => self.interpret(opcode, body),
            Opcode::Chunk => self.fault("nested_chunks", || "a chunk inside a chunk".into()),
            _ => self.count("unknown_records_skipped"),
        }
    }

    /// Interprets a schema, channel or message record in the buffer.
    fn interpret(&mut self, opcode: u8, body: Range<usize>) {
        let done = match Opcode::from(opcode) {
            Opcode::Schema => self.learn_schema(body),
            Opcode::Channel => self.learn_channel(body),
            _ => self.locate_message(body),
        };
        if done.is_none() {
            self.fault("damaged_records", || format!("record of kind {opcode} is malformed"));
        }
    }

    fn learn_schema(&mut self, body: Range<usize>) -> Option<()> {
        let too_long = body.len() as u64 > self.limits.schema_bytes;
        let schema = record::schema(&self.buffer[body])?;
        if too_long {
            return None;
        }
        // The first definition is kept; later ones repeat it.
        self.schemas.entry(schema.id).or_insert((schema.name, schema.encoding));
        Some(())
    }

    fn learn_channel(&mut self, body: Range<usize>) -> Option<()> {
        let read = record::channel(&self.buffer[body])?;
        let schema = self.schemas.get(&read.schema_id).cloned();
        if schema.is_none() && read.schema_id != 0 {
            self.count("channels_without_schema");
        }
        let (schema_name, schema_encoding) = schema.unwrap_or_default();
        let channel = Channel {
            id: read.id,
            topic: read.topic,
            schema_name,
            schema_encoding,
            encoding: read.encoding,
        };
        let known = self.channels.entry(channel.id).or_insert_with(|| Arc::new(channel.clone()));
        // The first one is kept; messages of the other cannot be told apart from its own.
        if known.topic != channel.topic || known.encoding != channel.encoding {
            let topic = known.topic.clone();
            self.fault("conflicting_channels", || {
                format!("channel {} is {topic} and then {}", channel.id, channel.topic)
            });
        }
        Some(())
    }

    fn locate_message(&mut self, body: Range<usize>) -> Option<()> {
        let head = self.buffer.get(body.clone())?.get(..record::MESSAGE_HEAD)?;
        let id = record::u16_at(head, 0);
        let Some(channel) = self.channels.get(&id).map(Arc::clone) else {
            self.fault("unknown_channel_messages", || format!("a message of channel {id}"));
            return Some(());
        };
        self.located = Some(Located {
            channel,
            sequence: record::u32_at(head, 2),
            log_time: record::u64_at(head, 6),
            publish_time: record::u64_at(head, 14),
            data: body.start + record::MESSAGE_HEAD..body.end,
        });
        self.count("messages");
        Some(())
    }
}

/// Maximum number of sentences kept about one file.
const MAX_NOTES: usize = 12;

fn describe_start(start: &[u8]) -> String {
    match start {
        [] => "it is empty".into(),
        [b'#', b'R', b'O', b'S', ..] => {
            "it is a ROS 1 bag; convert it with `rosbags-convert`".into()
        }
        [b'S', b'Q', b'L', b'i', ..] => {
            "it is a SQLite bag; convert it with `ros2 bag convert` to storage `mcap`".into()
        }
        _ => format!("it starts with {start:02x?}"),
    }
}
