use tagalong_core::settings;

settings! {
    /// Limits on the sizes that a log may claim. A file that claims more is damaged or hostile:
    /// that part is skipped and counted. The limits are absolute, not ratios, because even a
    /// regular file of dark frames compresses a thousandfold.
    #[derive(Eq)]
    pub struct Limits {
        /// Maximum length of a record (a message with its image), bytes.
        pub record_bytes: u64 = 64 << 20,
        /// Maximum length of a chunk after decompression, bytes.
        pub chunk_bytes: u64 = 256 << 20,
        /// Maximum length of a compressed file after decompression, bytes.
        pub file_bytes: u64 = 8 << 30,
        /// Maximum length of a message definition, bytes.
        pub schema_bytes: u64 = 1 << 20,
        /// Maximum width or height of an image, pixels.
        pub image_side_px: u32 = 16_384,
        /// Maximum size of a decoded image, bytes.
        pub image_bytes: u64 = 64 << 20,
    }
}
