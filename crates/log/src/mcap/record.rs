//! Records of MCAP that are needed here, read with every length checked.

pub(super) const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];

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
            0x02 => Self::Footer,
            0x03 => Self::Schema,
            0x04 => Self::Channel,
            0x05 => Self::Message,
            0x06 => Self::Chunk,
            0x09 => Self::Attachment,
            0x0b => Self::Statistics,
            0x0f => Self::DataEnd,
            0x01 | 0x07 | 0x08 | 0x0a | 0x0c | 0x0d | 0x0e => Self::Harmless,
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

/// Reader of values from the front of a record.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn u16(&mut self) -> Option<u16> {
        self.bytes(2).map(|b| u16_at(b, 0))
    }

    fn u32(&mut self) -> Option<u32> {
        self.bytes(4).map(|b| u32_at(b, 0))
    }

    fn string(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        std::str::from_utf8(self.bytes(length)?).ok().map(str::to_owned)
    }
}

pub(super) struct Schema {
    pub(super) id: u16,
    pub(super) name: String,
    pub(super) encoding: String,
    pub(super) definition: String,
}

pub(super) fn schema(body: &[u8]) -> Option<Schema> {
    let mut fields = Fields(body);
    let id = fields.u16()?;
    let name = fields.string()?;
    let encoding = fields.string()?;
    let length = fields.u32()? as usize;
    // Those of other languages are no text.
    let definition = std::str::from_utf8(fields.bytes(length)?).unwrap_or_default().to_owned();
    let schema = Schema { id, name, encoding, definition };
    (schema.id != 0).then_some(schema)
}

pub(super) struct RawChannel {
    pub(super) id: u16,
    pub(super) schema_id: u16,
    pub(super) topic: String,
    pub(super) encoding: String,
}

pub(super) fn channel(body: &[u8]) -> Option<RawChannel> {
    let mut fields = Fields(body);
    let channel = RawChannel {
        id: fields.u16()?,
        schema_id: fields.u16()?,
        topic: fields.string()?,
        encoding: fields.string()?,
    };
    let metadata = fields.u32()? as usize;
    fields.bytes(metadata)?;
    Some(channel)
}
