use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use crate::bag::{self, Bag};
use crate::database::{self, Database};
use crate::error::NotMcap;
use crate::mcap::Mcap;
use crate::packed::LogFile;
use crate::walk::{Channel, Counters, LOSSES, Message, Source, Walk};
use crate::{Limits, LogError};

/// Robust reader of an MCAP file, a ROS 1 bag or a rosbag2 database, which trusts none of their
/// contents. The container is recognised by its first bytes.
///
/// The file is read once from front to back through a small buffer, so that a pipe of any length
/// can be read, and a file that shrinks meanwhile is only a truncated file. The index at its end is
/// never needed, so a file without it (because its writer was killed) is read like any other, up to
/// its last complete chunk. Sizes are bounded by [`Limits`]. A part that cannot be used is counted,
/// and reading continues behind it; a part without an end (a record longer than the rest of the
/// file) ends the walk. Once ended, it stays ended.
pub struct LogWalker<R> {
    walk: Walk<R>,
    container: Container,
}

/// Container of the messages.
enum Container {
    Mcap(Mcap),
    Bag(Bag),
    Database(Box<Database>),
}

/// Returns true if the file begins with these magic bytes, of which the first have been read.
fn begins<R: Read>(source: &mut Source<R>, first: &[u8], magic: &[u8]) -> bool {
    let mut rest = vec![0; magic.len() - 8];
    first == &magic[..8] && {
        source.fill(&mut rest);
        rest == magic[8..]
    }
}

impl LogWalker<LogFile> {
    /// Opens a file of a log, compressed or not.
    ///
    /// # Errors
    /// [`LogError`] for a file that cannot be opened, is not a regular file or does not start like
    /// a container.
    pub fn open(path: &Path, limits: &Limits) -> Result<Self, LogError> {
        let file = LogFile::open(path, limits)?;
        let contents = file.path().to_owned();
        Self::at(&contents, file, limits)
            .map_err(|source| LogError::NotMcap { path: path.to_owned(), source })
    }
}

impl<R: Read> LogWalker<R> {
    /// Starts a walk.
    ///
    /// # Errors
    /// [`NotMcap`] if the file starts like neither container.
    pub fn new(reader: R, limits: &Limits) -> Result<Self, NotMcap> {
        Self::begin(None, reader, limits)
    }

    /// Starts a walk through a file at this path. A database is read by its path, front to back in
    /// the order of message IDs; then only the first bytes of `reader` are read.
    ///
    /// # Errors
    /// [`NotMcap`] if the file does not start like a container, or is another database.
    pub fn at(path: &Path, reader: R, limits: &Limits) -> Result<Self, NotMcap> {
        Self::begin(Some(path), reader, limits)
    }

    fn begin(path: Option<&Path>, reader: R, limits: &Limits) -> Result<Self, NotMcap> {
        let mut source = Source::new(reader);
        let mut magic = [0; 8];
        let got = source.fill(&mut magic);
        let magic = &magic[..got];
        let container = if begins(&mut source, magic, bag::MAGIC) {
            Container::Bag(Bag::default())
        } else if begins(&mut source, magic, database::MAGIC) {
            let path = path.ok_or_else(|| NotMcap("a database is read by its path".into()))?;
            Container::Database(Box::new(Database::open(path, limits)?))
        } else {
            Container::Mcap(Mcap::behind(magic)?)
        };
        let mut walk = Walk::new(source, limits);
        if let Container::Database(database) = &container {
            database.learn_topics(&mut walk);
        }
        Ok(Self { walk, container })
    }

    /// Adds the channels of an earlier walk through the same file. The index of an MCAP file
    /// repeats them at its end, which helps if the chunk with their first record is damaged.
    #[must_use]
    pub fn knowing(mut self, channels: impl IntoIterator<Item = Arc<Channel>>) -> Self {
        self.walk.channels.extend(channels.into_iter().map(|channel| (channel.id, channel)));
        self
    }

    /// Returns the next message in the order of the file; `None` at the end, and from then on.
    #[expect(clippy::should_implement_trait, reason = "the message borrows the walker's buffer")]
    pub fn next(&mut self) -> Option<Message<'_>> {
        self.advance();
        self.message()
    }

    /// Advances to the next message; returns false at the end.
    pub(crate) fn advance(&mut self) -> bool {
        let Self { walk, container } = self;
        walk.located = None;
        while walk.located.is_none() && !walk.ended {
            match (&mut *container, walk.rest.is_empty()) {
                (Container::Mcap(mcap), true) => mcap.step_in_file(walk),
                (Container::Mcap(mcap), false) => mcap.step_in_buffer(walk),
                (Container::Bag(bag), true) => bag.step_in_file(walk),
                (Container::Bag(_), false) => bag::step_in_buffer(walk),
                (Container::Database(database), _) => database.step(walk),
            }
        }
        walk.located.is_some()
    }

    /// Returns the message that [`LogWalker::advance`] reached.
    pub(crate) fn message(&self) -> Option<Message<'_>> {
        self.walk.message()
    }

    /// Returns the channels found so far.
    pub fn channels(&self) -> impl Iterator<Item = &Arc<Channel>> {
        self.walk.channels.values()
    }

    /// Returns the numbers of records read, skipped and lost, by name.
    pub fn counters(&self) -> &Counters {
        &self.walk.counters
    }

    /// Returns true if some part of the file could not be used.
    pub fn data_lost(&self) -> bool {
        self.walk.counters.keys().any(|name| LOSSES.contains(name))
    }

    /// Returns sentences about the damage, each with its offset in the file; only the first few.
    pub fn notes(&self) -> &[String] {
        &self.walk.notes
    }

    /// Returns the number of bytes of the file consumed so far.
    pub fn position(&self) -> u64 {
        match &self.container {
            Container::Database(database) => database.position(),
            Container::Mcap(_) | Container::Bag(_) => self.walk.source.position(),
        }
    }

    /// Returns the reader, behind the buffered part of the file.
    pub fn into_reader(self) -> R {
        self.walk.source.into_inner()
    }
}
