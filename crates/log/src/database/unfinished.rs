//! Databases whose recorder has not finished, with a rollback journal or a write-ahead log beside
//! them.
//!
//! SQLite changes such a database when it is read: it rolls the journal back, or creates a file
//! `-shm` beside a write-ahead log. The log of a user is never changed, so in both cases a copy is
//! read, and a database with an empty write-ahead log is opened as immutable.
//!
//! Source: <https://www.sqlite.org/fileformat2.html>, sections 1.3.3, 3 and 4.

use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use rusqlite::{Connection, OpenFlags};
use tempfile::TempDir;

use super::no_database;
use crate::Limits;
use crate::error::NotMcap;

/// Start of the header of a rollback journal, and end of one that covers several databases.
const JOURNAL_MAGIC: [u8; 8] = [0xd9, 0xd5, 0x05, 0xf9, 0x20, 0xa1, 0x63, 0xd7];
/// Length of the header of a write-ahead log, bytes, ...
const WAL_HEADER: usize = 32;
/// ... and of the header of each of its pages.
const WAL_PAGE_HEADER: usize = 24;
/// Name of a database in the folder of its copy.
const COPY: &str = "log.db3";

/// Database that is open for reading.
pub(super) struct Opened {
    pub(super) connection: Connection,
    /// Path of the file that is read.
    pub(super) path: PathBuf,
    /// Description of what was left out because it was not committed.
    pub(super) left_out: Option<String>,
    /// True if the file header states its size.
    pub(super) tells_size: bool,
    /// Copy, which is deleted when it is dropped.
    _copy: Option<TempDir>,
}

/// State in which the recorder left a database.
enum State {
    /// Finished.
    Closed,
    /// Finished, in the mode of a write-ahead log.
    ClosedWal,
    /// A transaction was in progress; the journal has the pages as they were before.
    Journal,
    /// Transactions are in the write-ahead log.
    Wal,
}

/// Opens a database without changing anything beside it.
///
/// # Errors
/// A sentence with the remedy.
pub(super) fn open(path: &Path, limits: &Limits) -> Result<Opened, NotMcap> {
    // SQLite looks for the other files beside the target of a link.
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let read_only = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    match state_of(&path) {
        State::Closed => {
            let connection = Connection::open_with_flags(&path, read_only).map_err(no_database)?;
            Ok(Opened { connection, path, left_out: None, tells_size: true, _copy: None })
        }
        State::ClosedWal => {
            let flags = read_only | OpenFlags::SQLITE_OPEN_URI;
            let connection =
                Connection::open_with_flags(unchanging(&path), flags).map_err(no_database)?;
            Ok(Opened { connection, path, left_out: None, tells_size: true, _copy: None })
        }
        State::Journal => {
            let journal = beside(&path, "-journal");
            let pages = pages_of_journal(&journal).map_err(|why| unread(&journal, &why))?;
            let left_out = format!(
                "the recorder was stopped within a transaction of {pages} changed pages, which is \
                 left out: its rollback journal lies beside the file"
            );
            open_copy(&path, "-journal", Some(left_out), limits)
        }
        State::Wal => {
            let wal = beside(&path, "-wal");
            let pages = uncommitted_pages(&wal).map_err(|why| unread(&wal, &why.to_string()))?;
            let left_out = (pages > 0).then(|| {
                format!(
                    "the last {pages} pages of the write-ahead log beside the file are of a \
                     transaction that was not committed, and are left out"
                )
            });
            open_copy(&path, "-wal", left_out, limits)
        }
    }
}

fn unread(file: &Path, why: &str) -> NotMcap {
    NotMcap(format!("a rosbag2 database with {}, which cannot be read: {why}", file.display()))
}

/// Returns the path of a file that SQLite keeps beside a database.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    name.into()
}

fn state_of(path: &Path) -> State {
    let is_wal_mode = start_of::<20>(path).is_some_and(|header| header[18..20].contains(&2));
    if start_of(&beside(path, "-journal")) == Some(JOURNAL_MAGIC) {
        return State::Journal;
    }
    if !is_wal_mode {
        return State::Closed;
    }
    let length = std::fs::metadata(beside(path, "-wal")).map_or(0, |about| about.len());
    if length > WAL_HEADER as u64 { State::Wal } else { State::ClosedWal }
}

/// Returns the first bytes of a regular file, if it is long enough.
fn start_of<const N: usize>(path: &Path) -> Option<[u8; N]> {
    if !std::fs::metadata(path).ok()?.is_file() {
        return None;
    }
    let mut start = [0; N];
    File::open(path).ok()?.read_exact(&mut start).ok()?;
    Some(start)
}

/// Returns the URI of an immutable database, so that SQLite neither locks it nor creates files
/// beside it.
fn unchanging(path: &Path) -> String {
    let mut address = String::from("file:");
    for byte in path.as_os_str().as_encoded_bytes() {
        match byte {
            b'/' | b'.' | b'-' | b'_' | b'0'..=b'9' | b'a'..=b'z' | b'A'..=b'Z' => {
                address.push(char::from(*byte));
            }
            // Writing to a string cannot fail.
            _ => _ = write!(address, "%{byte:02x}"),
        }
    }
    address + "?immutable=1"
}

/// Copies a database with the file beside it, and lets SQLite finish the copy.
fn open_copy(
    path: &Path,
    ending: &str,
    left_out: Option<String>,
    limits: &Limits,
) -> Result<Opened, NotMcap> {
    let bytes = file_size(path).saturating_add(file_size(&beside(path, ending)));
    let limit = limits.file_bytes;
    if bytes > limit {
        return Err(NotMcap(format!(
            "a rosbag2 database that its recorder did not finish: it is read from a copy, which has \
             {bytes} bytes, and the limit is {limit} (`file_bytes` under [limits]); if you trust it, \
             `sqlite3 FILE \"PRAGMA journal_mode=DELETE\"` finishes it"
        )));
    }
    let folder = tempfile::tempdir().map_err(|why| no_room(&why))?;
    let copy = folder.path().join(COPY);
    copy_file(path, &copy).map_err(|why| no_room(&why))?;
    copy_file(&beside(path, ending), &beside(&copy, ending)).map_err(|why| no_room(&why))?;
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(&copy, flags).map_err(|why| {
        NotMcap(format!(
            "a rosbag2 database that its recorder did not finish, nor can SQLite: {why}"
        ))
    })?;
    // The header may be from before the transactions in a write-ahead log.
    let tells_size = ending != "-wal";
    Ok(Opened { connection, path: copy, left_out, tells_size, _copy: Some(folder) })
}

fn no_room(why: &io::Error) -> NotMcap {
    let folder = std::env::temp_dir();
    NotMcap(format!(
        "a rosbag2 database that its recorder did not finish: it cannot be copied to {} to be read: \
         {why}; TMPDIR names another folder",
        folder.display()
    ))
}

/// Copies the contents of a file but not its permissions, because the copy is written to.
fn copy_file(from: &Path, to: &Path) -> io::Result<()> {
    io::copy(&mut File::open(from)?, &mut File::create(to)?).map(drop)
}

/// Returns the number of pages whose previous contents are in a journal.
///
/// # Errors
/// A journal of a transaction over several databases, because it names a file that SQLite would
/// delete.
fn pages_of_journal(journal: &Path) -> Result<u64, String> {
    let (header, length, end) = ends_of_journal(journal).map_err(|error| error.to_string())?;
    if end == JOURNAL_MAGIC {
        return Err("it belongs to a transaction over several databases; open it with `sqlite3`, \
                    which finishes it"
            .into());
    }
    let sector = u64::from(u32_at(&header, 20));
    let page = u64::from(u32_at(&header, 24));
    // Each page comes with its number and a checksum.
    Ok(length.saturating_sub(sector) / (page + 8))
}

/// Returns the header of a journal, its length, and its last bytes.
fn ends_of_journal(journal: &Path) -> io::Result<([u8; 28], u64, [u8; 8])> {
    let mut file = File::open(journal)?;
    let mut header = [0; 28];
    file.read_exact(&mut header)?;
    let length = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::End(-8))?;
    let mut end = [0; 8];
    file.read_exact(&mut end)?;
    Ok((header, length, end))
}

fn file_size(file: &Path) -> u64 {
    std::fs::metadata(file).map_or(0, |about| about.len())
}

/// Returns the number of pages behind the last commit in a write-ahead log.
fn uncommitted_pages(wal: &Path) -> io::Result<u64> {
    let length = std::fs::metadata(wal)?.len();
    let mut file = io::BufReader::new(File::open(wal)?);
    let mut header = [0; WAL_HEADER];
    file.read_exact(&mut header)?;
    let page = u32_at(&header, 8);
    let mut pages = 0;
    let mut position = WAL_HEADER as u64;
    let mut frame = [0; WAL_PAGE_HEADER];
    while file.read_exact(&mut frame).is_ok() {
        // Pages from an earlier use of the file have different salts.
        if frame[8..16] != header[16..24] {
            break;
        }
        position += WAL_PAGE_HEADER as u64 + u64::from(page);
        // The last page may be cut off.
        let is_commit = u32_at(&frame, 4) != 0 && position <= length;
        pages = if is_commit { 0 } else { pages + 1 };
        file.seek_relative(i64::from(page))?;
    }
    Ok(pages)
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    let mut number = [0; 4];
    number.copy_from_slice(&bytes[at..at + 4]);
    u32::from_be_bytes(number)
}
