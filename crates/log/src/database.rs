//! Reader of a rosbag2 database (`.db3`). See [`crate::LogWalker`] for the rules.
//!
//! Messages are read in the order in which they were stored, with one query each. Nothing but the
//! two tables that a recorder writes is read, because a view or a virtual table of the same name
//! would execute the contents of the file. Message definitions are not needed, so bags without them
//! are read like others.
//!
//! Source: `rosbag2_storage_sqlite3`, schema versions 1 to 4.

mod unfinished;

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use rusqlite::{OptionalExtension as _, Row};

use self::unfinished::Opened;
use crate::Limits;
use crate::error::NotMcap;
use crate::walk::{Channel, Located, Walk};

/// First bytes of a database.
pub(crate) const MAGIC: &[u8] = b"SQLite format 3\0";

/// The length of the data is queried first, so that a huge message is never in memory.
const NEXT: &str = "SELECT id, topic_id, timestamp, length(data), \
    CASE WHEN length(data) <= ?2 THEN data END \
    FROM messages WHERE id > ?1 ORDER BY id LIMIT 1";
const TOPICS: &str = "SELECT id, name, type, serialization_format FROM topics ORDER BY id";
const TABLES: &str = "SELECT count(*) FROM sqlite_master WHERE type = 'table' \
    AND name IN ('topics', 'messages') AND sql LIKE 'CREATE TABLE%'";

/// State of the reader of a database.
pub(crate) struct Database {
    opened: Opened,
    /// ID of the last message that was read.
    last: i64,
    /// ID of the last message in the file.
    end: i64,
    /// Size of the file, bytes ...
    bytes: u64,
    /// ... and what its header claims.
    claimed: u64,
}

/// Row of the table of messages.
struct Stored {
    topic: i64,
    time_ns: i64,
    length: u64,
    /// `None` if the data is longer than the limit.
    data: Option<Vec<u8>>,
}

impl Database {
    /// Opens a file for reading.
    ///
    /// # Errors
    /// A file that is not a database of messages.
    pub(crate) fn open(path: &Path, limits: &Limits) -> Result<Self, NotMcap> {
        let opened = unfinished::open(path, limits)?;
        let connection = &opened.connection;
        connection.pragma_update(None, "trusted_schema", false).map_err(no_database)?;
        let tables: i64 =
            connection.query_row(TABLES, [], |row| row.get(0)).map_err(no_database)?;
        if tables != 2 {
            let why = "not a rosbag2 database: a database without the tables `topics` and `messages` of rosbag2";
            return Err(NotMcap(why.to_owned()));
        }
        let end = connection
            .query_row("SELECT max(id) FROM messages", [], |row| row.get::<_, Option<i64>>(0))
            // If there is damage, it is found again, and counted, when the messages are read.
            .unwrap_or_default();
        let bytes = std::fs::metadata(&opened.path).map_or(0, |about| about.len());
        let claimed = if opened.tells_size { claimed_size(&opened.path).unwrap_or(0) } else { 0 };
        Ok(Self { opened, last: i64::MIN, end: end.unwrap_or(0), bytes, claimed })
    }

    /// Adds the channels.
    pub(crate) fn learn_topics<R: Read>(&self, walk: &mut Walk<R>) {
        let Self { opened, bytes, claimed, .. } = self;
        if let Some(left_out) = &opened.left_out {
            walk.fault("uncommitted_transactions", || left_out.clone());
        }
        // SQLite reads zeros behind the end of a file, so this would not be noticed later.
        if bytes < claimed {
            walk.fault("truncated", || {
                format!("{bytes} of {claimed} bytes are there; the last messages may be incomplete")
            });
        }
        let found = self.topics(walk.limits.schema_bytes);
        let found = found.unwrap_or_else(|why| {
            walk.fault("damaged_records", || format!("the table of topics: {why}"));
            Vec::new()
        });
        for topic in found {
            match topic {
                Some(channel) => walk.learn(channel),
                None => walk.fault("damaged_records", || "a topic is malformed".to_owned()),
            }
        }
    }

    fn topics(&self, longest: u64) -> rusqlite::Result<Vec<Option<Channel>>> {
        let mut statement = self.opened.connection.prepare(TOPICS)?;
        let rows = statement.query_map([], |row| Ok(channel(row, longest).ok()))?;
        rows.collect()
    }

    /// Reads one message.
    pub(crate) fn step<R: Read>(&mut self, walk: &mut Walk<R>) {
        let (id, stored) = match self.next(walk.limits.record_bytes) {
            // A damaged page may hold any ID, even one that would be repeated for ever.
            Ok(Some((id, _))) if id <= self.last => return self.end(walk, "numbers out of order"),
            Ok(Some(found)) => found,
            Ok(None) => return walk.ended = true,
            // The messages behind a damaged page cannot be found.
            Err(why) => return self.end(walk, &why.to_string()),
        };
        self.last = id;
        let Some(stored) = stored else {
            return walk.fault("damaged_records", || format!("message {id} is malformed"));
        };
        let Some(data) = stored.data else {
            let length = stored.length;
            return walk.fault("oversized_records", || format!("a message of {length} bytes"));
        };
        let topic = u32::try_from(stored.topic).unwrap_or(u32::MAX);
        let Some(channel) = walk.channel_of(topic) else { return };
        walk.buffer = data;
        let time = stored.time_ns.max(0) as u64;
        let data = 0..walk.buffer.len();
        walk.deliver(Located { channel, log_time: time, publish_time: time, sequence: 0, data });
    }

    fn end<R: Read>(&self, walk: &mut Walk<R>, why: &str) {
        let after = self.last.max(0);
        walk.fault("truncated", || {
            format!("after message {after}: {why}; what came before is used")
        });
        walk.ended = true;
    }

    /// Returns the next message by its ID, without contents if these have wrong types.
    fn next(&self, longest: u64) -> rusqlite::Result<Option<(i64, Option<Stored>)>> {
        let mut statement = self.opened.connection.prepare_cached(NEXT)?;
        let longest = i64::try_from(longest).unwrap_or(i64::MAX);
        let found =
            statement.query_row((self.last, longest), |row| Ok((row.get(0)?, stored(row).ok())));
        found.optional()
    }

    /// Returns approximately how many bytes of the file have been read.
    pub(crate) fn position(&self) -> u64 {
        let part = self.last.max(0) as f64 / self.end.max(1) as f64;
        (part.min(1.0) * self.bytes as f64) as u64
    }
}

/// Returns the size that the header of a database states: number of pages times bytes per page.
fn claimed_size(path: &Path) -> std::io::Result<u64> {
    let mut header = [0; 32];
    std::fs::File::open(path)?.read_exact(&mut header)?;
    let page = match u16::from_be_bytes([header[16], header[17]]) {
        // 65,536 does not fit in 16 bits.
        1 => 65_536,
        size => u64::from(size),
    };
    let pages = u32::from_be_bytes([header[28], header[29], header[30], header[31]]);
    Ok(page * u64::from(pages))
}

fn stored(row: &Row<'_>) -> rusqlite::Result<Stored> {
    let length: Option<i64> = row.get(3)?;
    Ok(Stored {
        topic: row.get(1)?,
        time_ns: row.get(2)?,
        length: length.unwrap_or(0).max(0) as u64,
        // Some recorders store an empty message as NULL.
        data: match length {
            None => Some(Vec::new()),
            Some(_) => row.get(4)?,
        },
    })
}

fn no_database(why: rusqlite::Error) -> NotMcap {
    use rusqlite::ErrorCode::{DatabaseCorrupt, NotADatabase};
    // The first bytes were those of a database.
    if matches!(why.sqlite_error_code(), Some(DatabaseCorrupt | NotADatabase)) {
        return NotMcap(format!(
            "the database is damaged or cut off: {why}; copy it again from the robot"
        ));
    }
    NotMcap(format!("not a rosbag2 database: {why}"))
}

fn bounded_text(row: &Row<'_>, at: usize, longest: u64) -> rusqlite::Result<String> {
    let text: String = row.get(at)?;
    if text.len() as u64 <= longest { Ok(text) } else { Err(rusqlite::Error::InvalidQuery) }
}

/// Reads a row of the table of topics. The length of names is limited, because all of them are
/// kept.
fn channel(row: &Row<'_>, longest: u64) -> rusqlite::Result<Channel> {
    Ok(Channel {
        id: row.get(0)?,
        topic: bounded_text(row, 1, longest)?,
        schema_name: bounded_text(row, 2, longest)?,
        schema_encoding: "ros2msg".into(),
        encoding: bounded_text(row, 3, longest)?,
        definition: Arc::default(),
    })
}
