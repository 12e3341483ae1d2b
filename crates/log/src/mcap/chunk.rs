//! Chunks: decompressed into one buffer, within limits, and verified.

use std::io::Read;

use super::record;
use crate::Limits;
use crate::walk::Source;

/// Reason why a chunk gives no records.
pub(super) enum ChunkFault {
    /// The file ends inside the chunk.
    Truncated,
    /// The chunk was skipped.
    Skipped { counter: &'static str, why: String },
}

fn skipped(counter: &'static str, why: impl Into<String>) -> ChunkFault {
    ChunkFault::Skipped { counter, why: why.into() }
}

/// Header fields of a chunk.
struct Head {
    uncompressed_size: u64,
    uncompressed_crc: u32,
    compression: String,
    data_size: u64,
}

/// Reads a chunk record of `length` bytes and writes its records to `out`; returns true if their
/// checksum was verified, false if there is none. Even after a fault the source is positioned
/// behind the record, unless the file ended.
pub(super) fn read<R: Read>(
    source: &mut Source<R>,
    length: u64,
    limits: &Limits,
    out: &mut Vec<u8>,
) -> Result<bool, ChunkFault> {
    out.clear();
    let start = source.position();
    let result = read_parts(source, length, limits, out);
    // After a fault a part of the chunk may be unread.
    let used = source.position() - start;
    let rest = length.saturating_sub(used);
    if source.skip(rest) < rest {
        return Err(ChunkFault::Truncated);
    }
    result
}

fn read_parts<R: Read>(
    source: &mut Source<R>,
    length: u64,
    limits: &Limits,
    out: &mut Vec<u8>,
) -> Result<bool, ChunkFault> {
    let head = read_head(source, length)?;
    if head.uncompressed_size > limits.chunk_bytes {
        let why = format!(
            "a chunk claims {} bytes; the limit is {}",
            head.uncompressed_size, limits.chunk_bytes
        );
        return Err(skipped("oversized_chunks", why));
    }
    decompress(source, &head, out)?;
    if out.len() as u64 != head.uncompressed_size {
        let why = format!("a chunk claims {} bytes, but has another size", head.uncompressed_size);
        return Err(skipped("damaged_chunks", why));
    }
    let has_crc = head.uncompressed_crc != 0;
    if has_crc && crc32fast::hash(out) != head.uncompressed_crc {
        return Err(skipped("crc_failed_chunks", "the checksum of a chunk is wrong"));
    }
    Ok(has_crc)
}

/// Reads the header: start and end time, uncompressed size and checksum, compression, data size.
fn read_head<R: Read>(source: &mut Source<R>, length: u64) -> Result<Head, ChunkFault> {
    let mut fixed = [0; 32];
    // The fixed fields and both length fields, without the name of the compression.
    if length < 40 {
        return Err(skipped("damaged_chunks", "a chunk shorter than its own header"));
    }
    if source.fill(&mut fixed) < fixed.len() {
        return Err(ChunkFault::Truncated);
    }
    let name_length = u64::from(record::u32_at(&fixed, 28));
    if name_length > 64 || 40 + name_length > length {
        return Err(skipped("damaged_chunks", "the name of the compression is too long"));
    }
    let mut name = vec![0; name_length as usize + 8];
    if source.fill(&mut name) < name.len() {
        return Err(ChunkFault::Truncated);
    }
    let data_size = record::u64_at(&name, name_length as usize);
    if length - 40 - name_length != data_size {
        return Err(skipped("damaged_chunks", "the lengths of a chunk contradict each other"));
    }
    name.truncate(name_length as usize);
    Ok(Head {
        uncompressed_size: record::u64_at(&fixed, 16),
        uncompressed_crc: record::u32_at(&fixed, 24),
        compression: String::from_utf8_lossy(&name).into_owned(),
        data_size,
    })
}

fn decompress<R: Read>(
    source: &mut Source<R>,
    head: &Head,
    out: &mut Vec<u8>,
) -> Result<(), ChunkFault> {
    let size = head.uncompressed_size;
    let data = source.take(head.data_size);
    let outcome = match head.compression.as_str() {
        "" | "none" => fill_from(data, size, out),
        "zstd" => zstd::stream::read::Decoder::new(data).and_then(|d| fill_from(d, size, out)),
        "lz4" => lz4::Decoder::new(data).and_then(|d| fill_from(d, size, out)),
        other => {
            let why = format!("compression `{other}`; known: none, lz4, zstd");
            return Err(skipped("unknown_compression_chunks", why));
        }
    };
    outcome
        .map_err(|error| skipped("damaged_chunks", format!("a chunk cannot be unpacked: {error}")))
}

/// Reads at most one byte more than promised, which is enough to detect a wrong size.
fn fill_from(mut reader: impl Read, promised: u64, out: &mut Vec<u8>) -> std::io::Result<()> {
    // At most 4 MiB are reserved in advance, because the promised size may be wrong.
    out.reserve((promised as usize).min(1 << 22));
    reader.by_ref().take(promised + 1).read_to_end(out).map(drop)
}
