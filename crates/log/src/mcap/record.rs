//! Kinds of records of MCAP, and numbers in their heads.

use mcap::records::op;

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
