//! Reader of the records of an MCAP file. See [`crate::LogWalker`] for the rules.
//!
//! The records of a chunk are delivered only after the whole chunk has been decompressed and its
//! checksum verified.
//!
//! The crate `mcap` parses schemas, channels and messages, but its `sans_io::LinearReader` is not
//! used for reading record by record: it stops at the first record beyond its limit and at the
//! first damaged chunk, does not tell where the next record begins, and has one limit for both
//! records and chunks. Here such a part is counted, with its position, and reading continues behind
//! it.
//!
//! Source: the MCAP specification, version 0, sections "Records" and "Chunk".

mod chunk;
pub(crate) mod record;

use std::collections::BTreeMap;
use std::io::Read;
use std::ops::Range;
use std::sync::Arc;

use chunk::ChunkFault;
use mcap::records::{Record, op};
use mcap::{MAGIC, parse_record};
use record::Opcode;

use crate::bag;
use crate::error::NotMcap;
use crate::msgs::ROS1_MARK;
use crate::walk::{Channel, Located, Walk};

/// State for an MCAP file that other containers do not have.
#[derive(Default)]
pub(crate) struct Mcap {
    schemas: BTreeMap<u16, (String, String, Arc<str>)>,
    claimed_messages: Option<u64>,
}

impl Mcap {
    /// Creates the reader behind the first eight bytes of a file.
    ///
    /// # Errors
    /// [`NotMcap`] if they are not the magic bytes of MCAP.
    pub(crate) fn behind(magic: &[u8]) -> Result<Self, NotMcap> {
        if magic == MAGIC {
            return Ok(Self::default());
        }
        Err(NotMcap(format!("not an MCAP file: {}", describe_start(magic))))
    }

    /// Reads one record from the file.
    pub(crate) fn step_in_file<R: Read>(&mut self, walk: &mut Walk<R>) {
        walk.offset = walk.source.position();
        // The checksum of the data section covers the bytes before the record that closes it.
        let before = walk.source.crc();
        let mut head = [0; 9];
        match walk.source.fill(&mut head) {
            9 => {}
            // The closing magic bytes instead of a record: there is no footer.
            8 if head[..8] == *MAGIC => {
                return walk.end_truncated("before its index is complete");
            }
            0 => return walk.end_truncated("without its closing records"),
            _ => return walk.end_truncated("in the middle of a record"),
        }
        let length = record::u64_at(&head, 1);
        match Opcode::from(head[0]) {
            Opcode::Chunk => take_chunk(walk, length),
            Opcode::Schema | Opcode::Channel | Opcode::Message => {
                self.take_record(walk, head[0], length)
            }
            Opcode::DataEnd => take_data_end(walk, length, before),
            Opcode::Statistics => self.take_statistics(walk, length),
            Opcode::Footer => self.take_footer(walk, length),
            Opcode::Attachment => pass(walk, length, "attachments_skipped"),
            Opcode::Unknown => pass(walk, length, "unknown_records_skipped"),
            Opcode::Harmless => walk.skip(length),
        }
    }

    fn take_record<R: Read>(&mut self, walk: &mut Walk<R>, opcode: u8, length: u64) {
        if read_record(walk, length) {
            self.interpret(walk, opcode, 0..walk.buffer.len());
        }
    }

    fn take_statistics<R: Read>(&mut self, walk: &mut Walk<R>, length: u64) {
        if read_record(walk, length) && walk.buffer.len() >= 8 {
            self.claimed_messages = Some(record::u64_at(&walk.buffer, 0));
        }
    }

    fn take_footer<R: Read>(&mut self, walk: &mut Walk<R>, length: u64) {
        if !read_record(walk, length) {
            return;
        }
        let mut magic = [0; 8];
        if walk.source.fill(&mut magic) < 8 || magic[..] != *MAGIC {
            walk.end_truncated("without its closing magic");
        }
        let delivered = walk.counters.get("messages").copied().unwrap_or(0);
        if let Some(claimed) = self.claimed_messages.filter(|claimed| *claimed != delivered) {
            walk.fault("statistics_disagree", || {
                format!("the index counts {claimed} messages, {delivered} were readable")
            });
        }
        walk.ended = true;
    }

    /// Reads one record from the chunk in the buffer.
    pub(crate) fn step_in_buffer<R: Read>(&mut self, walk: &mut Walk<R>) {
        let Range { start, end } = walk.rest.clone();
        let whole = walk.buffer[start..end]
            .get(..9)
            .map(|head| (head[0], record::u64_at(head, 1)))
            .filter(|(_, length)| *length <= (end - start - 9) as u64);
        let Some((opcode, length)) = whole else {
            walk.rest = 0..0;
            return walk.fault("damaged_chunks", || {
                format!("record at {start} of the decompressed chunk is longer than the chunk")
            });
        };
        let body = start + 9..start + 9 + length as usize;
        walk.rest.start = body.end;
        if length > walk.limits.record_bytes {
            return walk.fault("oversized_records", || format!("a record of {length} bytes"));
        }
        match Opcode::from(opcode) {
            Opcode::Schema | Opcode::Channel | Opcode::Message => {
                self.interpret(walk, opcode, body)
            }
            Opcode::Chunk => walk.fault("nested_chunks", || "a chunk inside a chunk".into()),
            _ => walk.count("unknown_records_skipped"),
        }
    }

    /// Interprets a schema, channel or message record in the buffer.
    fn interpret<R: Read>(&mut self, walk: &mut Walk<R>, opcode: u8, body: Range<usize>) {
        let done = match Opcode::from(opcode) {
            Opcode::Schema => self.learn_schema(walk, body),
            Opcode::Channel => self.learn_channel(walk, body),
            _ => locate_message(walk, body),
        };
        if done.is_none() {
            walk.fault("damaged_records", || format!("record of kind {opcode} is malformed"));
        }
    }

    fn learn_schema<R: Read>(&mut self, walk: &mut Walk<R>, body: Range<usize>) -> Option<()> {
        let is_too_long = body.len() as u64 > walk.limits.schema_bytes;
        let record = &walk.buffer[body];
        record::end_of_fields(record, record::SCHEMA_HEAD, 3)?;
        let Ok(Record::Schema { header, data }) = parse_record(op::SCHEMA, record) else {
            return None;
        };
        // The ID 0 means that there is no schema.
        if is_too_long || header.id == 0 {
            return None;
        }
        // Definitions in some schema languages are not text.
        let definition = Arc::from(std::str::from_utf8(&data).unwrap_or_default());
        let known = (header.name, header.encoding, definition);
        // The first definition is kept; later ones repeat it.
        self.schemas.entry(header.id).or_insert(known);
        Some(())
    }

    fn learn_channel<R: Read>(&mut self, walk: &mut Walk<R>, body: Range<usize>) -> Option<()> {
        let record = &walk.buffer[body];
        // Excludes the metadata, which is not used here and need not be text.
        let end = record::end_of_fields(record, record::CHANNEL_HEAD, 2)?;
        let plain = [&record[..end], &record::NO_METADATA].concat();
        let Ok(Record::Channel(read)) = parse_record(op::CHANNEL, &plain) else { return None };
        let schema = self.schemas.get(&read.schema_id).cloned();
        if schema.is_none() && read.schema_id != 0 {
            walk.count("channels_without_schema");
        }
        let (schema_name, schema_encoding, definition) = schema.unwrap_or_default();
        let channel = Channel {
            id: read.id,
            topic: read.topic,
            schema_name,
            schema_encoding,
            encoding: read.message_encoding,
            definition,
        };
        walk.learn(channel);
        Some(())
    }
}

fn pass<R: Read>(walk: &mut Walk<R>, length: u64, counter: &'static str) {
    walk.count(counter);
    walk.skip(length);
}

/// Reads a record into the buffer; returns false if it is too long or truncated.
fn read_record<R: Read>(walk: &mut Walk<R>, length: u64) -> bool {
    if length > walk.limits.record_bytes {
        let limit = walk.limits.record_bytes;
        walk.fault("oversized_records", || {
            format!("a record claims {length} bytes; the limit is {limit}")
        });
        walk.skip(length);
        return false;
    }
    let got = walk.source.read_into(&mut walk.buffer, length);
    if got < length {
        walk.end_truncated(&format!("inside a record that claims {length} bytes"));
    }
    got == length
}

fn take_chunk<R: Read>(walk: &mut Walk<R>, length: u64) {
    match chunk::read(&mut walk.source, length, &walk.limits, &mut walk.buffer) {
        Ok(has_crc) => {
            walk.count(if has_crc { "chunks_verified" } else { "chunks_without_crc" });
            walk.rest = 0..walk.buffer.len();
        }
        Err(ChunkFault::Truncated) => {
            walk.end_truncated(&format!("inside a chunk that claims {length} bytes"));
        }
        Err(ChunkFault::Skipped { counter, why }) => walk.fault(counter, || why),
    }
    if walk.rest.is_empty() {
        walk.buffer.clear();
    }
}

/// Verifies the checksum over everything before the record, if the file has one.
fn take_data_end<R: Read>(walk: &mut Walk<R>, length: u64, crc: u32) {
    if !read_record(walk, length) {
        return;
    }
    let stored = walk.buffer.get(..4).map_or(0, |b| record::u32_at(b, 0));
    if stored != 0 && stored != crc {
        walk.fault("data_section_crc_failed", || {
            "the checksum of the whole file is wrong: its content was changed".into()
        });
    }
}

fn locate_message<R: Read>(walk: &mut Walk<R>, body: Range<usize>) -> Option<()> {
    let record = parse_record(op::MESSAGE, &walk.buffer[body.clone()]);
    let Ok(Record::Message { header, .. }) = record else { return None };
    if let Some(channel) = walk.channel_of(u32::from(header.channel_id)) {
        let mut data = body.start + record::MESSAGE_HEAD..body.end;
        if channel.encoding == bag::ENCODING {
            // The mark replaces the last bytes of the head, which has been read already.
            data.start -= ROS1_MARK.len();
            walk.buffer[data.start..][..ROS1_MARK.len()].copy_from_slice(&ROS1_MARK);
        }
        walk.deliver(Located {
            channel,
            log_time: header.log_time,
            publish_time: header.publish_time,
            sequence: header.sequence,
            data,
        });
    }
    Some(())
}

fn describe_start(start: &[u8]) -> String {
    match start {
        [] => "it is empty".into(),
        [b'#', b'R', b'O', b'S', ..] => {
            "it is a ROS 1 bag of another version than 2.0; convert it with `rosbag fix`".into()
        }
        [0x28, 0xb5, 0x2f, 0xfd, ..] => "it is compressed by zstd, twice or as a stream".into(),
        _ => {
            let text: String = start.iter().map(|byte| byte.escape_ascii().to_string()).collect();
            format!("it starts with `{text}`")
        }
    }
}
