//! Attachments at the beginning of an MCAP file, where runs keep their config.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use mcap::records::{Record, op};

use crate::log_files::open_file;
use crate::{Limits, LogError};

/// Length of the magic bytes at the start of an MCAP file.
const MAGIC_BYTES: usize = 8;

/// Attachment of a log that `tagalong alter` made from another one: the SHA-256 of the recording
/// from which all copies originate.
pub const COPY_OF: &str = "copy-of.sha256";

/// Returns the attachment with this name, if it precedes the first message of a file; `None` if
/// there is none, or if the file is damaged before it.
///
/// # Errors
/// A file that cannot be opened.
pub fn read_attachment(
    path: &Path,
    name: &str,
    limits: &Limits,
) -> Result<Option<Vec<u8>>, LogError> {
    let mut file = BufReader::new(open_file(path)?);
    let mut magic = [0; MAGIC_BYTES];
    if file.read_exact(&mut magic).is_err() {
        return Ok(None);
    }
    while let Some((opcode, body)) = next_record(&mut file, limits) {
        match mcap::read::parse_record(opcode, &body) {
            Ok(Record::Attachment { header, data, .. }) if header.name == name => {
                return Ok(Some(data.into_owned()));
            }
            Ok(_) => {}
            Err(_) => return Ok(None),
        }
    }
    Ok(None)
}

/// Returns the next header or attachment with its bytes; `None` for any other record.
fn next_record(file: &mut BufReader<File>, limits: &Limits) -> Option<(u8, Vec<u8>)> {
    let mut head = [0; 9];
    file.read_exact(&mut head).ok()?;
    let opcode = head[0];
    let length = u64::from_le_bytes(head[1..].try_into().ok()?);
    if !matches!(opcode, op::HEADER | op::ATTACHMENT) || length > limits.record_bytes {
        return None;
    }
    let mut body = Vec::new();
    // The buffer grows with the data and is not allocated by the stated length, which may be wrong.
    let read = file.take(length).read_to_end(&mut body).ok()?;
    (read as u64 == length).then_some((opcode, body))
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use mcap::{Attachment, WriteOptions};

    use super::*;

    fn written(folder: &Path, names: &[&str]) -> std::path::PathBuf {
        let path = folder.join("a.mcap");
        let mut writer = WriteOptions::new().create(File::create(&path).unwrap()).unwrap();
        for name in names {
            let data = Cow::Owned(format!("text of {name}").into_bytes());
            let name = (*name).to_owned();
            let media_type = "text/plain".to_owned();
            let whole = Attachment { log_time: 0, create_time: 0, name, media_type, data };
            writer.attach(&whole).unwrap();
        }
        writer.finish().unwrap();
        path
    }

    #[test]
    fn an_attachment_is_found_by_its_name() {
        let home = tempfile::tempdir().unwrap();
        let path = written(home.path(), &["other", "config.toml"]);
        let [there, missing] = ["config.toml", "nothing"]
            .map(|name| read_attachment(&path, name, &Limits::default()).unwrap());
        assert_eq!(there.unwrap(), b"text of config.toml");
        assert_eq!(missing, None);
    }

    #[test]
    fn a_file_cut_anywhere_gives_nothing() {
        let home = tempfile::tempdir().unwrap();
        let path = written(home.path(), &["config.toml"]);
        let bytes = std::fs::read(&path).unwrap();
        for length in [0, 5, 8, 15, 60] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert_eq!(read_attachment(&path, "config.toml", &Limits::default()).unwrap(), None);
        }
        assert!(read_attachment(Path::new("nowhere.mcap"), "x", &Limits::default()).is_err());
    }
}
