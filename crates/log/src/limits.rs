use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Limits on the sizes that a log may claim. A file that claims more is damaged or hostile: that
/// part is skipped and counted. The limits are absolute, never ratios, because a regular file of
/// dark frames compresses a thousandfold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Maximum length of a record (a message with its image), bytes.
    pub record_bytes: u64,
    /// Maximum length of a chunk after decompression, bytes.
    pub chunk_bytes: u64,
    /// Maximum length of a compressed file after decompression, bytes.
    pub file_bytes: u64,
    /// Maximum length of a message definition, bytes.
    pub schema_bytes: u64,
    /// Maximum width or height of an image, pixels.
    pub image_side_px: u32,
    /// Maximum size of a decoded image, bytes.
    pub image_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            record_bytes: 64 << 20,
            chunk_bytes: 256 << 20,
            file_bytes: 8 << 30,
            schema_bytes: 1 << 20,
            image_side_px: 16_384,
            image_bytes: 64 << 20,
        }
    }
}
