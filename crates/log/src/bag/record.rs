//! Record headers of a ROS 1 bag: fields `name=value`, each preceded by its length.

use std::collections::BTreeMap;

use crate::mcap::record::{u32_at, u64_at};

/// Kind of a record: the field `op` of its header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Op {
    Message,
    BagHeader,
    Chunk,
    Connection,
    /// Indexes, which are not needed here.
    Index,
    Unknown,
}

/// Fields of a record header by name.
pub(super) struct Fields<'a>(BTreeMap<&'a [u8], &'a [u8]>);

impl<'a> Fields<'a> {
    /// Splits a header; `None` if a field is longer than the header or has no name.
    pub(super) fn parse(mut header: &'a [u8]) -> Option<Self> {
        let mut fields = BTreeMap::new();
        while !header.is_empty() {
            let (length, rest) = header.split_at_checked(4)?;
            let (field, rest) = rest.split_at_checked(u32_at(length, 0) as usize)?;
            let equals = field.iter().position(|byte| *byte == b'=')?;
            fields.insert(&field[..equals], &field[equals + 1..]);
            header = rest;
        }
        Some(Self(fields))
    }

    fn bytes(&self, name: &str) -> Option<&'a [u8]> {
        self.0.get(name.as_bytes()).copied()
    }

    /// Returns a text field.
    pub(super) fn text(&self, name: &str) -> Option<&'a str> {
        std::str::from_utf8(self.bytes(name)?).ok()
    }

    /// Returns a field of four bytes as a number.
    pub(super) fn number(&self, name: &str) -> Option<u32> {
        let bytes = self.bytes(name)?;
        (bytes.len() == 4).then(|| u32_at(bytes, 0))
    }

    /// Returns a time field, ns.
    pub(super) fn time_ns(&self, name: &str) -> Option<u64> {
        let bytes = self.bytes(name)?;
        let both = (bytes.len() == 8).then(|| u64_at(bytes, 0))?;
        let seconds = both & u64::from(u32::MAX);
        let nanos = both >> 32;
        Some(seconds * 1_000_000_000 + nanos)
    }

    /// Returns the kind of the record.
    pub(super) fn op(&self) -> Option<Op> {
        let &[op] = self.bytes("op")? else { return None };
        Some(match op {
            0x02 => Op::Message,
            0x03 => Op::BagHeader,
            0x05 => Op::Chunk,
            0x07 => Op::Connection,
            0x04 | 0x06 => Op::Index,
            _ => Op::Unknown,
        })
    }
}
