//! Types of MCAP records, and numbers in their heads.

use mcap::records::op;

/// Length of a schema record before its name, encoding and definition, bytes.
pub(super) const SCHEMA_HEAD: usize = 2;

/// Length of a channel record before its topic and encoding, bytes.
pub(super) const CHANNEL_HEAD: usize = 4;

/// Metadata of a channel that has none.
pub(super) const NO_METADATA: [u8; 4] = [0; 4];

/// Length of a message record before its payload, bytes.
pub(super) const MESSAGE_HEAD: usize = 22;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Opcode {
    Footer,
    Schema,
    Channel,
    Message,
    Chunk,
    Attachment,
    Statistics,
    DataEnd,
    /// The header, indexes and metadata, which are not needed here.
    Harmless,
    Unknown,
}

impl From<u8> for Opcode {
    fn from(byte: u8) -> Self {
        match byte {
            op::FOOTER => Self::Footer,
            op::SCHEMA => Self::Schema,
            op::CHANNEL => Self::Channel,
            op::MESSAGE => Self::Message,
            op::CHUNK => Self::Chunk,
            op::ATTACHMENT => Self::Attachment,
            op::STATISTICS => Self::Statistics,
            op::DATA_END => Self::DataEnd,
            op::HEADER
            | op::MESSAGE_INDEX
            | op::CHUNK_INDEX
            | op::ATTACHMENT_INDEX
            | op::METADATA
            | op::METADATA_INDEX
            | op::SUMMARY_OFFSET => Self::Harmless,
            _ => Self::Unknown,
        }
    }
}

/// Returns the little-endian number at a position that the caller has checked.
pub(crate) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

/// Returns the 32-bit number; see [`u16_at`].
pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from(u16_at(bytes, at)) | u32::from(u16_at(bytes, at + 2)) << 16
}

/// Returns the 64-bit number; see [`u16_at`].
pub(crate) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}

/// Returns the end of the last of `count` fields that begin at `at` and are preceded by their
/// lengths; `None` if one reaches beyond the record. This check is needed because the crate `mcap`
/// reserves as much memory as a length states before it reads the bytes.
pub(super) fn end_of_fields(body: &[u8], at: usize, count: usize) -> Option<usize> {
    let mut end = at;
    for _ in 0..count {
        let length = body.get(end..)?.first_chunk::<4>()?;
        end = end.checked_add(4)?.checked_add(u32::from_le_bytes(*length) as usize)?;
        body.get(..end)?;
    }
    Some(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_that_reach_beyond_the_record_are_refused() {
        let body = [9, 9, 1, 0, 0, 0, b'a', 2, 0, 0, 0, b'b', b'c'];
        assert_eq!([1, 2].map(|count| end_of_fields(&body, 2, count)), [Some(7), Some(13)]);
        assert_eq!(end_of_fields(&body, 2, 3), None, "there is no third");
        assert_eq!(end_of_fields(&body[..12], 2, 2), None, "cut short");
        let lies = [0xff, 0xff, 0xff, 0xff, b'a'];
        assert_eq!(end_of_fields(&lies, 0, 1), None);
        assert_eq!(end_of_fields(&body, 99, 1), None);
    }
}
