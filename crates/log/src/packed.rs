//! Compression in rosbag2, of whole files (`compression_mode: FILE`) or of single messages
//! (`MESSAGE`).
//!
//! Neither needs metadata: a compressed file or message starts with the magic bytes of zstd, which
//! neither a container nor a message in CDR does. A file is unpacked to a temporary one, because a
//! database is read by its path; sizes are bounded by [`Limits`].

use std::fs::File;
use std::io::{Read, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};
use zstd::stream::read::Decoder;
use zstd::zstd_safe::get_frame_content_size;

use crate::log_files::open_file;
use crate::{Limits, LogError};

/// Magic bytes of a zstd frame.
const MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// Maximum length of a frame header, bytes.
const MAX_FRAME_HEADER: usize = 18;
/// Maximum window of a frame that is accepted, as a power of two: that of the highest levels.
const MAX_WINDOW_LOG: u32 = 27;

/// Returns true for compressed data.
pub(crate) fn is_packed(data: &[u8]) -> bool {
    data.starts_with(&MAGIC)
}

fn too_long(length: u64, limit: u64) -> (&'static str, String) {
    let why = format!("a compressed message of {length} bytes or more; the limit is {limit}");
    ("oversized_records", why)
}

/// Unpacks a message.
///
/// # Errors
/// The counter and the reason for a message that is damaged or exceeds the maximum length of a
/// record.
pub(crate) fn unpack_message(
    data: &[u8],
    limits: &Limits,
    out: &mut Vec<u8>,
) -> Result<(), (&'static str, String)> {
    out.clear();
    let longest = limits.record_bytes;
    // Most writers state the size; a wrong one is noticed while the message is unpacked.
    let claimed = get_frame_content_size(data).ok().flatten().unwrap_or(0);
    if claimed > longest {
        return Err(too_long(claimed, longest));
    }
    let unpacked = Decoder::with_buffer(data).and_then(|mut decoder| {
        decoder.window_log_max(MAX_WINDOW_LOG)?;
        // One byte beyond the limit is enough to detect an excess.
        decoder.take(longest + 1).read_to_end(out)
    });
    match unpacked {
        Ok(length) if length as u64 > longest => Err(too_long(longest + 1, longest)),
        Ok(_) => Ok(()),
        Err(error) => {
            let why = format!("a compressed message cannot be unpacked: {error}");
            Err(("damaged_records", why))
        }
    }
}

/// File of a log that is open for reading, unpacked if it is compressed.
pub struct LogFile {
    file: File,
    path: PathBuf,
    /// Deletes the temporary file when it is dropped.
    _unpacked: Option<TempPath>,
    /// Damage that was found while the file was unpacked.
    fault: Option<String>,
}

impl LogFile {
    /// Opens a file.
    ///
    /// # Errors
    /// [`LogError::Open`], [`LogError::NotAFile`]; [`LogError::Packed`] for a compressed file that
    /// is beyond the limit or cannot be unpacked to a temporary one.
    pub(crate) fn open(path: &Path, limits: &Limits) -> Result<Self, LogError> {
        let mut file = open_file(path)?;
        let mut head = Vec::with_capacity(MAX_FRAME_HEADER);
        let read = (&mut file).take(MAX_FRAME_HEADER as u64).read_to_end(&mut head);
        read.and_then(|_| file.rewind()).map_err(LogError::opening(path))?;
        if !is_packed(&head) {
            return Ok(Self { file, path: path.to_owned(), _unpacked: None, fault: None });
        }
        let claimed = get_frame_content_size(&head).ok().flatten().unwrap_or(0);
        let unpacked = if claimed > limits.file_bytes {
            Err(too_large(claimed, limits))
        } else {
            unpack_file(file, limits)
        };
        unpacked.map_err(|why| LogError::Packed { path: path.to_owned(), why })
    }

    /// Returns the path of the contents.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Describes the damage that was found while the file was unpacked; the bytes before it are
    /// there.
    pub(crate) fn fault(&self) -> Option<&str> {
        self.fault.as_deref()
    }
}

impl Read for LogFile {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        self.file.read(out)
    }
}

fn too_large(bytes: u64, limits: &Limits) -> String {
    let limit = limits.file_bytes;
    format!(
        "unpacked it has {bytes} bytes or more, and the limit is {limit} (`file_bytes` under \
         [limits]); if you trust it, unpack it with `zstd -d`"
    )
}

fn no_room(error: std::io::Error) -> String {
    let folder = std::env::temp_dir();
    format!("it cannot be unpacked in {}: {error}; TMPDIR names another", folder.display())
}

/// Unpacks a file to a temporary one, up to the first damage.
fn unpack_file(packed: File, limits: &Limits) -> Result<LogFile, String> {
    let mut out = NamedTempFile::new().map_err(no_room)?;
    let mut decoder = Decoder::new(packed).map_err(|error| error.to_string())?;
    decoder.window_log_max(MAX_WINDOW_LOG).map_err(|error| error.to_string())?;
    let mut step = vec![0; 1 << 17];
    let mut written = 0;
    let fault = loop {
        let count = match decoder.read(&mut step) {
            Ok(0) => break None,
            Ok(count) => count,
            Err(error) => {
                break Some(format!("it cannot be unpacked after byte {written}: {error}"));
            }
        };
        written += count as u64;
        if written > limits.file_bytes {
            return Err(too_large(written, limits));
        }
        out.write_all(&step[..count]).map_err(no_room)?;
    };
    let (mut file, path) = out.into_parts();
    file.rewind().map_err(no_room)?;
    Ok(LogFile { file, path: path.to_path_buf(), _unpacked: Some(path), fault })
}
