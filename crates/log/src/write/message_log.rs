use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Attachment, Compression, WriteOptions, Writer};
use serde::Serialize;
use tagalong_core::Stamp;

use super::WriteError;
use crate::msgs::{Message, StringMsg, encode};
use crate::walk::{Channel, Message as LoggedMessage};
use crate::{TRUTH_TOPIC, TruthFrame};

/// Writer of any ROS 2 messages to an MCAP file, like the recorder of a robot. The file has a
/// partial name until [`MessageLog::finish`].
pub struct MessageLog {
    writer: Writer<BufWriter<File>>,
    channels: BTreeMap<String, u16>,
    partial: PathBuf,
    path: PathBuf,
}

impl MessageLog {
    /// Starts a file, and creates its folder.
    ///
    /// # Errors
    /// [`WriteError::Io`], [`WriteError::Mcap`], [`WriteError::Busy`].
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
            fs::create_dir_all(folder).map_err(WriteError::io(folder))?;
        }
        let partial = path.with_extension("mcap.partial");
        let file = open_alone(&partial)?;
        let writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("tagalong ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            // As for `tracks.mcap`: one thread gives the same bytes on every machine.
            .compression_threads(1)
            .create(BufWriter::new(file))
            .map_err(WriteError::mcap(&partial))?;
        Ok(Self { writer, channels: BTreeMap::new(), partial, path: path.to_owned() })
    }

    /// Attaches a text, which [`crate::read_attachment`] finds if it precedes the first message.
    ///
    /// # Errors
    /// [`WriteError::Mcap`].
    pub fn attach(&mut self, name: &str, media_type: &str, text: &str) -> Result<(), WriteError> {
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: Cow::Borrowed(text.as_bytes()),
        };
        self.writer.attach(&attachment).map_err(WriteError::mcap(&self.partial))
    }

    /// Writes a message; `captured` is both its publish time and its log time.
    ///
    /// # Errors
    /// [`WriteError::Mcap`].
    pub fn send<M: Message + Serialize>(
        &mut self,
        topic: &str,
        captured: Stamp,
        message: &M,
    ) -> Result<(), WriteError> {
        let channel_id = match self.channels.get(topic) {
            Some(id) => *id,
            None => self.open::<M>(topic)?,
        };
        self.put(channel_id, captured, &encode(message))
    }

    /// Writes the truth of an image to [`TRUTH_TOPIC`]; `recorded` is both its publish time and its
    /// log time.
    ///
    /// # Errors
    /// As for [`MessageLog::send_json`].
    pub fn send_truth(&mut self, recorded: Stamp, truth: &TruthFrame) -> Result<(), WriteError> {
        self.send_json(TRUTH_TOPIC, recorded, truth)
    }

    /// Writes a value as a JSON text; `captured` is both its publish time and its log time.
    ///
    /// # Errors
    /// [`WriteError::Io`] for a value that JSON cannot express, [`WriteError::Mcap`].
    pub fn send_json<T: Serialize>(
        &mut self,
        topic: &str,
        captured: Stamp,
        value: &T,
    ) -> Result<(), WriteError> {
        let data = serde_json::to_string(value)
            .map_err(|why| io::Error::other(format!("a message of {topic} as JSON: {why}")))
            .map_err(WriteError::io(&self.path))?;
        self.send(topic, captured, &StringMsg { data })
    }

    /// Writes a message of another log unchanged, with its topic, type and times.
    ///
    /// # Errors
    /// [`WriteError::Mcap`].
    pub fn copy(&mut self, message: &LoggedMessage<'_>) -> Result<(), WriteError> {
        let channel = message.channel;
        let channel_id = match self.channels.get(&channel.topic) {
            Some(id) => *id,
            None => self.open_like(channel)?,
        };
        self.put_like(channel_id, message, message.data)
    }

    /// Writes a message that replaces one of another log, with its topic and times.
    ///
    /// # Errors
    /// [`WriteError::Mcap`].
    pub fn send_like<M: Message + Serialize>(
        &mut self,
        replaced: &LoggedMessage<'_>,
        message: &M,
    ) -> Result<(), WriteError> {
        let channel_id = match self.channels.get(&replaced.channel.topic) {
            Some(id) => *id,
            None => self.open::<M>(&replaced.channel.topic)?,
        };
        self.put_like(channel_id, replaced, &encode(message))
    }

    fn put_like(
        &mut self,
        channel_id: u16,
        like: &LoggedMessage<'_>,
        data: &[u8],
    ) -> Result<(), WriteError> {
        let LoggedMessage { sequence, log_time, publish_time, .. } = *like;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        let written = self.writer.write_to_known_channel(&header, data);
        written.map_err(WriteError::mcap(&self.partial))
    }

    fn open_like(&mut self, channel: &Channel) -> Result<u16, WriteError> {
        let definition = channel.definition.as_bytes();
        let schema =
            self.writer.add_schema(&channel.schema_name, &channel.schema_encoding, definition);
        let schema = schema.map_err(WriteError::mcap(&self.partial))?;
        let added =
            self.writer.add_channel(schema, &channel.topic, &channel.encoding, &BTreeMap::new());
        let id = added.map_err(WriteError::mcap(&self.partial))?;
        self.channels.insert(channel.topic.clone(), id);
        Ok(id)
    }

    fn put(&mut self, channel_id: u16, at: Stamp, data: &[u8]) -> Result<(), WriteError> {
        let at = at.nanos();
        let header = MessageHeader { channel_id, sequence: 0, log_time: at, publish_time: at };
        let written = self.writer.write_to_known_channel(&header, data);
        written.map_err(WriteError::mcap(&self.partial))
    }

    fn open<M: Message>(&mut self, topic: &str) -> Result<u16, WriteError> {
        let schema = self.writer.add_schema(M::TYPE, "ros2msg", M::DEFINITION.as_bytes());
        let schema = schema.map_err(WriteError::mcap(&self.partial))?;
        let channel = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new());
        let id = channel.map_err(WriteError::mcap(&self.partial))?;
        self.channels.insert(topic.to_owned(), id);
        Ok(id)
    }

    /// Completes the file and renames it to its final name.
    ///
    /// # Errors
    /// [`WriteError::Io`], [`WriteError::Mcap`].
    pub fn finish(mut self) -> Result<(), WriteError> {
        self.writer.finish().map_err(WriteError::mcap(&self.partial))?;
        fs::rename(&self.partial, &self.path).map_err(WriteError::io(&self.path))
    }
}

/// Opens a file for writing, unless another process is writing it, and truncates it.
fn open_alone(path: &Path) -> Result<File, WriteError> {
    // Truncated only under the lock, because the file may belong to another process.
    let file = File::options().write(true).create(true).truncate(false).open(path);
    let file = file.map_err(WriteError::io(path))?;
    match file.try_lock() {
        // Some file systems have no locks.
        Ok(()) | Err(TryLockError::Error(_)) => {}
        Err(TryLockError::WouldBlock) => return Err(WriteError::Busy { path: path.to_owned() }),
    }
    file.set_len(0).map_err(WriteError::io(path))?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_writers_do_not_write_one_file() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("walk.mcap");
        // Longer than what is written now: the rest of a killed writer must not stay.
        fs::write(home.path().join("walk.mcap.partial"), vec![7; 100_000]).unwrap();
        let first = MessageLog::create(&path).unwrap();
        let error = MessageLog::create(&path).err().unwrap();
        assert!(matches!(error, WriteError::Busy { .. }), "{error}");
        first.finish().unwrap();
        assert!(fs::metadata(&path).unwrap().len() < 50_000);
        MessageLog::create(&path).unwrap();
    }
}
