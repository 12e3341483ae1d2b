//! Robust reader of a ROS 1 bag, which trusts nothing in it.
//!
//! It follows the rules of [`crate::mcap_walk`]: one pass from front to back without the index,
//! sizes bounded by [`Limits`], damaged parts skipped and counted, a truncated file read up to its
//! last whole chunk. A bag has no checksums, so damage within a message may go unnoticed until the
//! message is decoded.
//!
//! The payload of a message stands behind four bytes that say that it is serialised as ROS 1 does
//! ([`crate::msgs::decode`] reads them as it reads the encapsulation header of CDR).
//!
//! Source: the bag format, version 2.0 (wiki.ros.org/Bags/Format/2.0).

mod record;

use std::collections::BTreeMap;
use std::io::Read;
use std::ops::Range;
use std::sync::Arc;

use record::{Fields, Op};

use crate::Limits;
use crate::mcap_walk::record::u32_at;
use crate::mcap_walk::source::Source;
use crate::mcap_walk::{Channel, Counters, LOSSES, MAX_NOTES, Message};
use crate::msgs::ROS1_MARK;

/// First bytes of a bag.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// Name of the serialisation of the messages.
pub(crate) const ENCODING: &str = "ros1";

/// Position of the next message in the buffer.
struct Located {
    channel: Arc<Channel>,
    time_ns: u64,
    data: Range<usize>,
}

/// Reader of a bag, record by record. See the [module](self).
pub struct BagWalker<R> {
    source: Source<R>,
    limits: Limits,
    channels: BTreeMap<u32, Arc<Channel>>,
    /// Records of the current chunk, or one top-level record.
    buffer: Vec<u8>,
    /// Part of the buffer that is still to be read.
    rest: Range<usize>,
    /// Packed chunk, kept for its memory.
    packed: Vec<u8>,
    offset: u64,
    located: Option<Located>,
    counters: Counters,
    notes: Vec<String>,
    ended: bool,
}

/// Parts of a record in the buffer.
struct Parts {
    header: Range<usize>,
    data: Range<usize>,
}

impl<R: Read> BagWalker<R> {
    /// Starts a walk behind the first bytes of the file, which the caller has compared with
    /// [`MAGIC`].
    pub(crate) fn new(source: Source<R>, limits: &Limits) -> Self {
        Self {
            source,
            limits: limits.clone(),
            channels: BTreeMap::new(),
            buffer: Vec::new(),
            rest: 0..0,
            packed: Vec::new(),
            offset: MAGIC.len() as u64,
            located: None,
            counters: BTreeMap::new(),
            notes: Vec::new(),
            ended: false,
        }
    }

    /// Adds the channels of an earlier walk through the same file.
    #[must_use]
    pub(crate) fn knowing(mut self, channels: impl IntoIterator<Item = Arc<Channel>>) -> Self {
        self.channels.extend(channels.into_iter().map(|c| (u32::from(c.id), c)));
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

    /// Returns the message that [`BagWalker::advance`] reached.
    pub(crate) fn message(&self) -> Option<Message<'_>> {
        let found = self.located.as_ref()?;
        Some(Message {
            channel: &found.channel,
            log_time: found.time_ns,
            publish_time: found.time_ns,
            sequence: 0,
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
    pub(crate) fn into_reader(self) -> R {
        self.source.into_inner()
    }

    fn count(&mut self, name: &'static str) {
        *self.counters.entry(name).or_default() += 1;
    }

    fn fault(&mut self, name: &'static str, what: impl FnOnce() -> String) {
        self.count(name);
        if self.notes.len() < MAX_NOTES {
            let what = what();
            self.notes.push(format!("at byte {}: {what}", self.offset));
        }
    }

    fn end_truncated(&mut self) {
        let what = || "the file ends in the middle of a record; what came before is used".into();
        self.fault("truncated", what);
        self.ended = true;
    }

    /// Reads one record from the file into the buffer.
    fn step_in_file(&mut self) {
        self.offset = self.source.position();
        let Some(header_length) = self.length() else { return };
        // Without a header there is no way to find the next record.
        if header_length > self.limits.schema_bytes {
            self.fault("damaged_records", || format!("a header claims {header_length} bytes"));
            self.ended = true;
            return;
        }
        if self.source.read_into(&mut self.buffer, header_length) < header_length {
            return self.end_truncated();
        }
        let Some(length) = self.length() else { return self.end_truncated() };
        match Fields::parse(&self.buffer).and_then(|fields| fields.op()) {
            Some(Op::Chunk) => self.take_chunk(length),
            Some(Op::Message | Op::Connection) => self.take_record(length),
            Some(Op::BagHeader | Op::Index) => self.skip(length),
            Some(Op::Unknown) => {
                self.count("unknown_records_skipped");
                self.skip(length);
            }
            None => {
                self.fault("damaged_records", || "the header of a record is malformed".into());
                self.skip(length);
            }
        }
    }

    /// Reads a length; ends the walk at the end of the file.
    fn length(&mut self) -> Option<u64> {
        let mut bytes = [0; 4];
        match self.source.fill(&mut bytes) {
            4 => return Some(u64::from(u32_at(&bytes, 0))),
            // A bag ends with its last record.
            0 => self.ended = true,
            _ => self.end_truncated(),
        }
        None
    }

    fn skip(&mut self, length: u64) {
        self.buffer.clear();
        if self.source.skip(length) < length {
            self.end_truncated();
        }
    }

    /// Reads the data of a record that stands outside of chunks, behind its header.
    fn take_record(&mut self, length: u64) {
        if length > self.limits.record_bytes {
            self.fault("oversized_records", || format!("a record claims {length} bytes"));
            return self.skip(length);
        }
        let mut record = (self.buffer.len() as u32).to_le_bytes().to_vec();
        record.append(&mut self.buffer);
        record.extend((length as u32).to_le_bytes());
        if self.source.read_into(&mut self.packed, length) < length {
            return self.end_truncated();
        }
        record.extend_from_slice(&self.packed);
        self.buffer = record;
        self.rest = 0..self.buffer.len();
    }

    fn take_chunk(&mut self, length: u64) {
        let fields = Fields::parse(&self.buffer);
        let size = fields.as_ref().and_then(|fields| fields.number("size")).map(u64::from);
        let compression = fields.as_ref().and_then(|fields| fields.text("compression"));
        let compression = compression.unwrap_or("?").to_owned();
        let largest = size.unwrap_or(u64::MAX).max(length);
        if largest > self.limits.chunk_bytes {
            self.fault("oversized_chunks", || format!("a chunk claims {largest} bytes"));
            return self.skip(length);
        }
        if self.source.read_into(&mut self.packed, length) < length {
            self.buffer.clear();
            return self.end_truncated();
        }
        self.buffer.clear();
        match unpack(&compression, &self.packed, largest, &mut self.buffer) {
            Ok(()) if Some(self.buffer.len() as u64) == size => {
                self.count("chunks_without_crc");
                self.rest = 0..self.buffer.len();
            }
            Ok(()) => self.fault("damaged_chunks", || "a chunk has not the size it claims".into()),
            Err(Unpack::Unknown) => {
                let why = || format!("compression `{compression}`; known: none, bz2, lz4");
                self.fault("unknown_compression_chunks", why);
            }
            Err(Unpack::Damaged(why)) => {
                self.fault("damaged_chunks", || format!("a chunk does not unpack: {why}"));
            }
        }
    }

    /// Reads one record from the buffer.
    fn step_in_buffer(&mut self) {
        let Some(parts) = self.parts() else {
            self.rest = 0..0;
            return self.fault("damaged_chunks", || "a record is longer than its chunk".into());
        };
        self.rest.start = parts.data.end;
        let fields = Fields::parse(&self.buffer[parts.header.clone()]);
        let done = match fields.as_ref().and_then(Fields::op) {
            Some(Op::Message) => self.locate(&parts),
            Some(Op::Connection) => self.learn(&parts),
            Some(_) => {
                self.count("unknown_records_skipped");
                Some(())
            }
            None => None,
        };
        if done.is_none() {
            self.fault("damaged_records", || "a record in a chunk is malformed".into());
        }
    }

    /// Returns the parts of the record at the start of the rest; `None` if it is longer than that.
    fn parts(&self) -> Option<Parts> {
        let length = |at: usize| {
            let bytes = self.buffer.get(at..at.checked_add(4)?)?;
            Some(u32_at(bytes, 0) as usize)
        };
        let start = self.rest.start + 4;
        let header = start..start.checked_add(length(self.rest.start)?)?;
        let start = header.end.checked_add(4)?;
        let data = start..start.checked_add(length(header.end)?)?;
        (data.end <= self.rest.end).then_some(Parts { header, data })
    }

    fn learn(&mut self, parts: &Parts) -> Option<()> {
        let outer = Fields::parse(&self.buffer[parts.header.clone()])?;
        let inner = Fields::parse(&self.buffer[parts.data.clone()])?;
        let id = outer.number("conn")?;
        let channel = Channel {
            id: u16::try_from(id).ok()?,
            topic: outer.text("topic")?.to_owned(),
            schema_name: inner.text("type")?.to_owned(),
            schema_encoding: "ros1msg".into(),
            encoding: ENCODING.into(),
        };
        let topic = channel.topic.clone();
        let known = self.channels.entry(id).or_insert_with(|| Arc::new(channel));
        if known.topic != topic {
            let known = known.topic.clone();
            let what = || format!("connection {id} is {known} and then {topic}");
            self.fault("conflicting_channels", what);
        }
        Some(())
    }

    fn locate(&mut self, parts: &Parts) -> Option<()> {
        let fields = Fields::parse(&self.buffer[parts.header.clone()])?;
        let (id, time_ns) = (fields.number("conn")?, fields.time_ns("time")?);
        let Some(channel) = self.channels.get(&id).map(Arc::clone) else {
            self.fault("unknown_channel_messages", || format!("a message of connection {id}"));
            return Some(());
        };
        // The mark takes the place of the length of the data, which was read.
        let data = parts.data.start - ROS1_MARK.len()..parts.data.end;
        self.buffer[data.start..parts.data.start].copy_from_slice(&ROS1_MARK);
        self.located = Some(Located { channel, time_ns, data });
        self.count("messages");
        Some(())
    }
}

/// Reason for which a chunk does not unpack.
enum Unpack {
    Unknown,
    Damaged(String),
}

/// Decompresses a chunk; `promised` bounds the memory.
fn unpack(
    compression: &str,
    packed: &[u8],
    promised: u64,
    out: &mut Vec<u8>,
) -> Result<(), Unpack> {
    // One byte more than promised is enough to detect a wrong size.
    let outcome = match compression {
        "none" => packed.take(promised + 1).read_to_end(out),
        "bz2" => bzip2_rs::DecoderReader::new(packed).take(promised + 1).read_to_end(out),
        "lz4" => lz4::Decoder::new(packed)
            .and_then(|decoder| decoder.take(promised + 1).read_to_end(out)),
        _ => return Err(Unpack::Unknown),
    };
    outcome.map(drop).map_err(|error| Unpack::Damaged(error.to_string()))
}
