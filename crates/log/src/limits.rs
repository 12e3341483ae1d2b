use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a log may ask for. A file that asks for more is damaged or hostile: the
/// part that asks is skipped and counted. The limits are absolute, never
/// ratios: an honest file of dark frames compresses a thousandfold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Longest record (a message with its image), bytes.
    pub record_bytes: u64,
    /// Longest chunk after decompression, bytes.
    pub chunk_bytes: u64,
    /// Longest message definition, bytes.
    pub schema_bytes: u64,
    /// Largest width or height of an image, pixels.
    pub image_side_px: u32,
    /// Largest decoded image, bytes.
    pub image_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            record_bytes: 64 << 20,
            chunk_bytes: 256 << 20,
            schema_bytes: 1 << 20,
            image_side_px: 16_384,
            image_bytes: 64 << 20,
        }
    }
}
