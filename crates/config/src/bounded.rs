//! Files that a user names, read within a limit, because a device has no end, a pipe waits for
//! ever, and a sparse file of gigabytes takes as much memory.

use std::fs::{self, File};
use std::io::{Error, ErrorKind, Read as _, Result};
use std::path::Path;

/// Largest number of bytes that is read of a file, by its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FileLimit {
    /// Configs, scenes, settings of trainers: 1 MiB.
    Config,
    /// Models of plugins: 64 MiB.
    Model,
    /// Truth, tracks, detections and reports: 512 MiB.
    Table,
    /// Encoded images: 256 MiB.
    Image,
    /// Any other number of bytes.
    Bytes(u64),
}

impl FileLimit {
    /// Returns the number of bytes.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Config => 1 << 20,
            Self::Model => 64 << 20,
            Self::Table => 512 << 20,
            Self::Image => 256 << 20,
            Self::Bytes(bytes) => bytes,
        }
    }
}

/// Reads a regular file.
///
/// # Errors
/// A file that is missing, unreadable or too large, a directory, a pipe or a device; the message
/// does not name the file.
pub fn read_bytes(path: &Path, limit: FileLimit) -> Result<Vec<u8>> {
    // Asked before it is opened: opening a pipe waits until another program writes to it.
    let about = fs::metadata(path)?;
    if about.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "is a directory"));
    }
    if !about.is_file() {
        let why = "is a pipe or a device; write what comes out of it to a file first";
        return Err(Error::new(ErrorKind::InvalidInput, why));
    }
    let most = limit.bytes();
    if about.len() > most {
        return Err(too_large(about.len(), most));
    }
    let mut bytes = Vec::with_capacity(about.len() as usize);
    // It may have grown, and the length that some systems tell is 0.
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(too_large(bytes.len() as u64, most));
    }
    Ok(bytes)
}

/// Reads a regular file of UTF-8 text.
///
/// # Errors
/// As [`read_bytes`], and for a file that is no text ([`ErrorKind::InvalidData`]).
pub fn read_text(path: &Path, limit: FileLimit) -> Result<String> {
    let text = String::from_utf8(read_bytes(path, limit)?);
    text.map_err(|_| Error::new(ErrorKind::InvalidData, "is not UTF-8 text"))
}

fn too_large(has: u64, most: u64) -> Error {
    Error::new(ErrorKind::FileTooLarge, format!("has {has} bytes; at most {most} are read"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(path: &Path, limit: FileLimit) -> (ErrorKind, String) {
        let error = read_text(path, limit).unwrap_err();
        (error.kind(), error.to_string())
    }

    #[test]
    fn a_file_is_read_up_to_its_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        fs::write(&path, "1234").unwrap();
        assert_eq!(read_text(&path, FileLimit::Bytes(4)).unwrap(), "1234");
        assert_eq!(read_bytes(&path, FileLimit::Config).unwrap(), b"1234");
        let (kind, why) = refusal(&path, FileLimit::Bytes(3));
        assert_eq!(
            (kind, why.as_str()),
            (ErrorKind::FileTooLarge, "has 4 bytes; at most 3 are read")
        );
    }

    #[test]
    fn a_sparse_file_of_gigabytes_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sparse");
        File::create(&path).unwrap().set_len(3 << 30).unwrap();
        for limit in [FileLimit::Config, FileLimit::Model, FileLimit::Table, FileLimit::Image] {
            assert_eq!(refusal(&path, limit).0, ErrorKind::FileTooLarge, "{limit:?}");
        }
    }

    #[test]
    fn what_is_no_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(refusal(folder.path(), FileLimit::Config).0, ErrorKind::IsADirectory);
        let missing = folder.path().join("missing");
        assert_eq!(refusal(&missing, FileLimit::Config).0, ErrorKind::NotFound);
        let noise = folder.path().join("noise");
        fs::write(&noise, [0xff, 0xfe]).unwrap();
        assert_eq!(refusal(&noise, FileLimit::Config).0, ErrorKind::InvalidData);
    }

    #[cfg(unix)]
    #[test]
    fn a_device_without_end_and_a_pipe_without_a_writer_are_refused_at_once() {
        assert_eq!(refusal(Path::new("/dev/zero"), FileLimit::Table).0, ErrorKind::InvalidInput);
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        if made.is_ok_and(|status| status.success()) {
            assert_eq!(refusal(&pipe, FileLimit::Table).0, ErrorKind::InvalidInput);
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_that_tells_no_length_is_held_to_its_limit_all_the_same() {
        let path = Path::new("/proc/self/status");
        assert!(read_text(path, FileLimit::Config).unwrap().contains("Name:"));
        assert_eq!(refusal(path, FileLimit::Bytes(10)).0, ErrorKind::FileTooLarge);
    }
}
