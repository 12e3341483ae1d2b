//! Reader of the records of a ROS 1 bag. See [`crate::LogWalker`] for the rules.
//!
//! A bag has no checksums, so damage within a message may go unnoticed until the message is
//! decoded. The payload of a message is preceded by four bytes that mark it as serialised by ROS 1
//! ([`crate::msgs::decode`] reads them like the encapsulation header of CDR).
//!
//! Source: the bag format, version 2.0 (wiki.ros.org/Bags/Format/2.0).

mod record;

use std::io::Read;
use std::ops::Range;

use record::{Fields, Op};

use crate::mcap::record::u32_at;
use crate::msgs::ROS1_MARK;
use crate::walk::{Channel, Located, Walk};

/// First bytes of a bag.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// Name of the serialisation format of the messages.
pub(crate) const ENCODING: &str = "ros1";

/// State of the reader of a bag.
#[derive(Default)]
pub(crate) struct Bag {
    /// Compressed chunk; the buffer is reused.
    packed: Vec<u8>,
}

/// Parts of a record in the buffer.
struct Parts {
    header: Range<usize>,
    data: Range<usize>,
}

impl Bag {
    /// Reads one record from the file into the buffer.
    pub(crate) fn step_in_file<R: Read>(&mut self, walk: &mut Walk<R>) {
        walk.offset = walk.source.position();
        let Some(header_length) = length(walk) else { return };
        // Without a header the next record cannot be found.
        if header_length > walk.limits.schema_bytes {
            walk.fault("damaged_records", || format!("a header claims {header_length} bytes"));
            walk.ended = true;
            return;
        }
        if walk.source.read_into(&mut walk.buffer, header_length) < header_length {
            return walk.end_truncated("in the middle of a record");
        }
        let Some(length) = length(walk) else {
            return walk.end_truncated("in the middle of a record");
        };
        match Fields::parse(&walk.buffer).and_then(|fields| fields.op()) {
            Some(Op::Chunk) => self.take_chunk(walk, length),
            Some(Op::Message | Op::Connection) => self.take_record(walk, length),
            Some(Op::BagHeader | Op::Index) => walk.skip(length),
            Some(Op::Unknown) => {
                walk.count("unknown_records_skipped");
                walk.skip(length);
            }
            None => {
                walk.fault("damaged_records", || "the header of a record is malformed".into());
                walk.skip(length);
            }
        }
    }

    /// Reads the data of a record outside of chunks, which follows its header.
    fn take_record<R: Read>(&mut self, walk: &mut Walk<R>, length: u64) {
        if length > walk.limits.record_bytes {
            walk.fault("oversized_records", || format!("a record claims {length} bytes"));
            return walk.skip(length);
        }
        let mut record = (walk.buffer.len() as u32).to_le_bytes().to_vec();
        record.append(&mut walk.buffer);
        record.extend((length as u32).to_le_bytes());
        if walk.source.read_into(&mut self.packed, length) < length {
            return walk.end_truncated("in the middle of a record");
        }
        record.extend_from_slice(&self.packed);
        walk.buffer = record;
        walk.rest = 0..walk.buffer.len();
    }

    fn take_chunk<R: Read>(&mut self, walk: &mut Walk<R>, length: u64) {
        let fields = Fields::parse(&walk.buffer);
        let size = fields.as_ref().and_then(|fields| fields.number("size")).map(u64::from);
        let compression = fields.as_ref().and_then(|fields| fields.text("compression"));
        let compression = compression.unwrap_or("?").to_owned();
        let largest = size.unwrap_or(u64::MAX).max(length);
        if largest > walk.limits.chunk_bytes {
            walk.fault("oversized_chunks", || format!("a chunk claims {largest} bytes"));
            return walk.skip(length);
        }
        if walk.source.read_into(&mut self.packed, length) < length {
            walk.buffer.clear();
            return walk.end_truncated("in the middle of a record");
        }
        walk.buffer.clear();
        match unpack(&compression, &self.packed, largest, &mut walk.buffer) {
            Ok(()) if Some(walk.buffer.len() as u64) == size => {
                walk.count("chunks_without_crc");
                walk.rest = 0..walk.buffer.len();
            }
            Ok(()) => walk.fault("damaged_chunks", || "a chunk is not of the claimed size".into()),
            Err(Unpack::Unknown) => {
                walk.fault("unknown_compression_chunks", || {
                    format!("compression `{compression}`; known: none, bz2, lz4")
                });
            }
            Err(Unpack::Damaged(why)) => {
                walk.fault("damaged_chunks", || format!("a chunk cannot be unpacked: {why}"));
            }
        }
    }
}

/// Reads a length; ends the walk at the end of the file.
fn length<R: Read>(walk: &mut Walk<R>) -> Option<u64> {
    let mut bytes = [0; 4];
    match walk.source.fill(&mut bytes) {
        4 => return Some(u64::from(u32_at(&bytes, 0))),
        // A bag ends with its last record.
        0 => walk.ended = true,
        _ => walk.end_truncated("in the middle of a record"),
    }
    None
}

/// Reads one record from the buffer.
pub(crate) fn step_in_buffer<R: Read>(walk: &mut Walk<R>) {
    let Some(parts) = parts(walk) else {
        walk.rest = 0..0;
        return walk.fault("damaged_chunks", || "a record is longer than its chunk".into());
    };
    walk.rest.start = parts.data.end;
    let fields = Fields::parse(&walk.buffer[parts.header.clone()]);
    let done = match fields.as_ref().and_then(Fields::op) {
        Some(Op::Message) => locate(walk, &parts),
        Some(Op::Connection) => learn(walk, &parts),
        Some(_) => {
            walk.count("unknown_records_skipped");
            Some(())
        }
        None => None,
    };
    if done.is_none() {
        walk.fault("damaged_records", || "a record in a chunk is malformed".into());
    }
}

/// Returns the parts of the record at the start of the rest; `None` if the record is longer than
/// that.
fn parts<R>(walk: &Walk<R>) -> Option<Parts> {
    let header = counted(&walk.buffer, walk.rest.start)?;
    let data = counted(&walk.buffer, header.end)?;
    (data.end <= walk.rest.end).then_some(Parts { header, data })
}

/// Returns the range of the bytes behind the length field at `at`, which gives their number.
fn counted(buffer: &[u8], at: usize) -> Option<Range<usize>> {
    let start = at.checked_add(4)?;
    let length = u32_at(buffer.get(at..start)?, 0) as usize;
    Some(start..start.checked_add(length)?)
}

fn learn<R: Read>(walk: &mut Walk<R>, parts: &Parts) -> Option<()> {
    let outer = Fields::parse(&walk.buffer[parts.header.clone()])?;
    let inner = Fields::parse(&walk.buffer[parts.data.clone()])?;
    let channel = Channel {
        id: u16::try_from(outer.number("conn")?).ok()?,
        topic: outer.text("topic")?.to_owned(),
        schema_name: inner.text("type")?.to_owned(),
        schema_encoding: "ros1msg".into(),
        encoding: ENCODING.into(),
        definition: inner.text("message_definition").unwrap_or_default().into(),
    };
    walk.learn(channel);
    Some(())
}

fn locate<R: Read>(walk: &mut Walk<R>, parts: &Parts) -> Option<()> {
    let fields = Fields::parse(&walk.buffer[parts.header.clone()])?;
    let id = fields.number("conn")?;
    let time_ns = fields.time_ns("time")?;
    let Some(channel) = walk.channel_of(id) else { return Some(()) };
    // The mark replaces the length of the data, which has been read already.
    let data = parts.data.start - ROS1_MARK.len()..parts.data.end;
    walk.buffer[data.start..parts.data.start].copy_from_slice(&ROS1_MARK);
    let log_time = time_ns;
    let publish_time = time_ns;
    walk.deliver(Located { channel, log_time, publish_time, sequence: 0, data });
    Some(())
}

/// Reason why a chunk cannot be unpacked.
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
