//! rosbag2 databases (`.db3`): written here from MCAP logs, and a real one; damaged and hostile ones.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use common::LogWriter;
use proptest::prelude::*;
use rusqlite::Connection;
use tagalong_core::{RgbImage, Stamp};
use tagalong_log::msgs::{CameraInfo, Header};
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits, LogWalker};

/// Message by topic, type, time and bytes.
type Told = (String, String, u64, Vec<u8>);

const TABLES: &str = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, \
    type TEXT NOT NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL); \
    CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, \
    timestamp INTEGER NOT NULL, data BLOB NOT NULL); \
    CREATE INDEX timestamp_idx ON messages (timestamp ASC);";

fn log() -> Vec<u8> {
    let mut writer = LogWriter::plain();
    let info = CameraInfo {
        header: Header::new(common::at(0.0), "colour"),
        width: 16,
        height: 12,
        k: [20.0, 0.0, 7.5, 0.0, 20.0, 5.5, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    };
    writer.message("/camera/color/camera_info", common::at(0.0), &info);
    for tenth in 0..9 {
        writer.colour(common::at(0.1 * f64::from(tenth)));
    }
    writer.finish()
}

fn told(mut walker: LogWalker<impl std::io::Read>) -> (Vec<Told>, Vec<&'static str>, bool) {
    let mut all = Vec::new();
    while let Some(m) = walker.next() {
        assert!(all.len() < 10_000, "a walk that does not end");
        let channel = m.channel;
        let topic = channel.topic.clone();
        let kind = channel.schema_name.clone();
        all.push((topic, kind, m.log_time, m.data.to_vec()));
    }
    assert!(walker.next().is_none(), "a walk that has ended stays ended");
    (all, walker.counters().keys().copied().collect(), walker.data_lost())
}

fn in_mcap(bytes: &[u8]) -> Vec<Told> {
    told(LogWalker::new(bytes, &Limits::default()).unwrap()).0
}

/// Writes the messages as `ros2 bag record -s sqlite3` does.
fn store(messages: &[Told], path: &Path) -> Connection {
    let database = Connection::open(path).unwrap();
    database.execute_batch(TABLES).unwrap();
    store_into(&database, messages);
    database
}

fn store_into(database: &Connection, messages: &[Told]) {
    let mut topics: Vec<&str> = Vec::new();
    for (topic, kind, time, data) in messages {
        let known = topics.iter().position(|name| name == topic);
        let id = known.unwrap_or_else(|| {
            topics.push(topic);
            let row = (topics.len() as i64, topic, kind, "cdr", "");
            database.execute("INSERT INTO topics VALUES (?, ?, ?, ?, ?)", row).unwrap();
            topics.len() - 1
        }) + 1;
        let sql = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)";
        database.execute(sql, (id as i64, *time as i64, data)).unwrap();
    }
}

/// A database in a folder of its own.
struct Stored {
    _folder: tempfile::TempDir,
    path: PathBuf,
    messages: Vec<Told>,
}

impl Stored {
    fn new(change: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("walk_0.db3");
        let messages = in_mcap(&log());
        store(&messages, &path).execute_batch(change).unwrap();
        Self { _folder: folder, path, messages }
    }

    fn walk(&self) -> Result<(Vec<Told>, Vec<&'static str>, bool), String> {
        let file = File::open(&self.path).unwrap();
        let walker = LogWalker::at(&self.path, file, &Limits::default());
        walker.map(told).map_err(|error| error.to_string())
    }
}

#[test]
fn a_database_tells_what_the_mcap_file_tells() {
    let stored = Stored::new("");
    let (messages, counters, lost) = stored.walk().unwrap();
    assert_eq!((messages, lost), (stored.messages, false), "{counters:?}");
}

#[test]
fn messages_of_a_database_have_the_encoding_of_their_topic() {
    let stored = Stored::new("");
    let file = File::open(&stored.path).unwrap();
    let mut walker = LogWalker::at(&stored.path, file, &Limits::default()).unwrap();
    let mut read = 0;
    while let Some(message) = walker.next() {
        assert_eq!(message.channel.encoding, "cdr");
        read += 1;
    }
    assert!(read > 0);
}

/// Equal frames are tracked equally.
#[test]
fn a_database_makes_the_frames_of_the_mcap_file() {
    let stored = Stored::new("");
    let mcap = stored.path.with_extension("mcap");
    std::fs::write(&mcap, log()).unwrap();
    let [of_database, of_mcap] = [&stored.path, &mcap].map(|path| {
        let mut source = source(path, &Limits::default()).unwrap();
        let mut all = Vec::new();
        while let Some(item) = source.next_frame() {
            let frame = item.frame;
            all.push((frame.stamp, frame.colour().unwrap().clone(), frame.camera.clone()));
        }
        all
    });
    assert_eq!(of_database.len(), 9);
    assert_eq!(of_database, of_mcap);
}

#[test]
fn a_real_database_tells_what_its_mcap_file_tells() {
    let Some(path) = tagalong_conformance::testdata::find("mcap/klintan-real-cdr/sample.db3")
    else {
        return;
    };
    let walker = LogWalker::at(&path, File::open(&path).unwrap(), &Limits::default()).unwrap();
    let (mut found, counters, lost) = told(walker);
    assert!(!lost && found.len() == 5, "{} {counters:?}", found.len());
    let mcap = std::fs::read(path.with_file_name("sample-none.mcap")).unwrap();
    // Old recorders leave out `msg`. The MCAP file is in the order of recording times, which the database does not keep.
    found.sort();
    let mut expected = in_mcap(&mcap);
    expected.sort();
    for ((topic, kind, time, data), expected) in found.iter().zip(&expected) {
        let kind = kind.replace('/', "/msg/");
        assert_eq!((topic, &kind, *time), (&expected.0, &expected.1, expected.2));
        // Too long to be printed.
        assert!(*data == expected.3, "{topic}: {} and {} bytes", data.len(), expected.3.len());
    }
    assert_eq!(found.len(), expected.len());
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    zstd::bulk::compress(bytes, 3).unwrap()
}

fn source(path: &Path, limits: &Limits) -> Result<FrameSource, String> {
    let input = InputSettings { base_frame: "colour".into(), ..InputSettings::default() };
    let inputs = Inputs::NONE.require(Input::Colour);
    FrameSource::open(path, &input, limits, inputs).map_err(|error| error.to_string())
}

/// Returns stamps and images of all frames, and what was counted.
fn frames_of(path: &Path) -> (Vec<(Stamp, RgbImage)>, Vec<String>, bool) {
    let mut source = source(path, &Limits::default()).unwrap();
    let mut frames = Vec::new();
    while let Some(found) = source.next_frame() {
        frames.push((found.frame.stamp, found.frame.colour().unwrap().clone()));
    }
    let counted = source.counters().iter().map(|(name, count)| format!("{name} {count}"));
    (frames, counted.collect(), source.data_lost())
}

/// Compresses each message, as `compression_mode: MESSAGE` does.
fn packed_messages(messages: &[Told]) -> Vec<Told> {
    let packed = messages
        .iter()
        .map(|(topic, kind, time, data)| (topic.clone(), kind.clone(), *time, packed(data)));
    packed.collect()
}

#[test]
fn compressed_messages_are_those_that_were_compressed() {
    let stored = Stored::new("DELETE FROM messages; DELETE FROM topics");
    store_into(&Connection::open(&stored.path).unwrap(), &packed_messages(&stored.messages));
    let (messages, counters, lost) = stored.walk().unwrap();
    assert_eq!((messages, lost), (stored.messages.clone(), false), "{counters:?}");
    assert!(counters.contains(&"messages_unpacked"));
}

#[test]
fn a_compressed_file_makes_the_frames_of_the_plain_one() {
    let stored = Stored::new("");
    let plain = frames_of(&stored.path);
    assert_eq!(plain.0.len(), 9);
    // Also under a name that says nothing.
    for name in ["walk_0.db3.zstd", "walk"] {
        let path = stored.path.with_file_name(name);
        std::fs::write(&path, packed(&std::fs::read(&stored.path).unwrap())).unwrap();
        assert_eq!(frames_of(&path), plain);
        std::fs::remove_file(&path).unwrap();
    }
    let mcap = stored.path.with_file_name("walk_0.mcap.zstd");
    std::fs::write(&mcap, packed(&log())).unwrap();
    assert_eq!(frames_of(&mcap).0, plain.0);
}

#[test]
fn a_split_bag_of_compressed_files_and_messages_is_one_log() {
    let stored = Stored::new("");
    let whole = frames_of(&stored.path);
    let bag = tempfile::tempdir().unwrap();
    let (first, second) = stored.messages.split_at(5);
    for (number, part) in [first, second].iter().enumerate() {
        let part_file = stored.path.with_file_name(format!("part_{number}.db3"));
        store(&packed_messages(part), &part_file).close().unwrap();
        let bytes = packed(&std::fs::read(&part_file).unwrap());
        std::fs::write(bag.path().join(format!("walk_{number}.db3.zstd")), bytes).unwrap();
    }
    let text = "  relative_file_paths:\n    - walk_0.db3.zstd\n    - walk_1.db3.zstd\n";
    std::fs::write(bag.path().join("metadata.yaml"), text).unwrap();
    let (frames, counted, lost) = frames_of(bag.path());
    assert_eq!((frames, lost), (whole.0, false), "{counted:?}");
}

#[test]
fn messages_that_do_not_unpack_are_counted_and_passed_over() {
    let huge = packed(&vec![0; 65 << 20]);
    let unstated = {
        // A stream does not state its size in advance.
        let mut encoder = zstd::Encoder::new(Vec::new(), 3).unwrap();
        std::io::copy(&mut std::io::repeat(0).take(65 << 20), &mut encoder).unwrap();
        encoder.finish().unwrap()
    };
    let cut = packed(&[7; 300])[..12].to_vec();
    let cases = [
        (huge, "oversized_records"),
        (unstated, "oversized_records"),
        (cut, "damaged_records"),
        (b"\x28\xb5\x2f\xfdnoise".to_vec(), "damaged_records"),
    ];
    for (data, counter) in cases {
        let stored = Stored::new("");
        let sql = "UPDATE messages SET data = ? WHERE id = 3";
        Connection::open(&stored.path).unwrap().execute(sql, [data]).unwrap();
        let (messages, counters, lost) = stored.walk().unwrap();
        let mut expected = stored.messages.clone();
        expected.remove(2);
        assert!(lost && counters.contains(&counter), "{counter}: {counters:?}");
        assert_eq!(messages, expected, "{counter}");
    }
}

#[test]
fn a_compressed_file_beyond_the_limit_is_refused_and_a_cut_one_is_used_up_to_the_cut() {
    let stored = Stored::new("");
    let bytes = std::fs::read(&stored.path).unwrap();
    let path = stored.path.with_file_name("walk_0.db3.zstd");
    let limits = Limits { file_bytes: bytes.len() as u64 - 1, ..Limits::default() };
    let unstated = zstd::encode_all(&bytes[..], 3).unwrap();
    for packed in [packed(&bytes), unstated] {
        std::fs::write(&path, packed).unwrap();
        let error = source(&path, &limits).err().unwrap();
        assert!(error.contains("walk_0.db3.zstd") && error.contains("`file_bytes`"), "{error}");
        assert!(error.contains("zstd -d"), "{error}");
    }
    // An MCAP file in several frames of zstd, of which the last is cut.
    let mcap = log();
    let frames: Vec<u8> = mcap.chunks(1000).flat_map(packed).collect();
    std::fs::write(&path, &frames[..frames.len() - 5]).unwrap();
    let (found, counted, lost) = frames_of(&path);
    assert!(lost && !found.is_empty(), "{counted:?}");
    assert!(counted.contains(&"damaged_compression 1".to_owned()), "{counted:?}");
}

#[test]
fn what_cannot_be_used_is_counted_and_passed_over() {
    let cases = [
        ("UPDATE messages SET topic_id = 77 WHERE id = 3", "unknown_channel_messages"),
        ("UPDATE messages SET topic_id = -1 WHERE id = 3", "unknown_channel_messages"),
        ("UPDATE messages SET data = 'words' WHERE id = 3", "damaged_records"),
        ("UPDATE messages SET timestamp = 'noon' WHERE id = 3", "damaged_records"),
        ("UPDATE messages SET data = zeroblob(300000000) WHERE id = 3", "oversized_records"),
    ];
    for (change, name) in cases {
        let stored = Stored::new(change);
        let (messages, counters, lost) = stored.walk().unwrap();
        assert!(lost && counters.contains(&name), "{change}: {counters:?}");
        let mut expected = stored.messages.clone();
        expected.remove(2);
        assert_eq!(messages, expected, "{change}");
    }
    let stored = Stored::new("INSERT INTO topics VALUES (70000, '/a', 'b', 'cdr', '')");
    let (messages, counters, lost) = stored.walk().unwrap();
    assert!(lost && counters.contains(&"damaged_records"), "{counters:?}");
    assert_eq!(messages, stored.messages);
}

#[test]
fn a_view_in_place_of_a_table_is_not_run() {
    let views = [
        "ALTER TABLE messages RENAME TO real; CREATE VIEW messages AS SELECT * FROM real",
        "DROP TABLE messages",
        "DROP TABLE topics",
    ];
    for change in views {
        let error = Stored::new(change).walk().unwrap_err();
        assert!(error.contains("without the tables"), "{change}: {error}");
    }
}

#[test]
fn a_database_without_its_path_is_named() {
    let error = LogWalker::new(&b"SQLite format 3\0abc"[..], &Limits::default()).err().unwrap();
    assert!(error.to_string().contains("by its path"), "{error}");
}

#[test]
fn a_file_cut_anywhere_is_said_to_be_cut() {
    let stored = Stored::new("");
    let bytes = std::fs::read(&stored.path).unwrap();
    let mut refused = 0;
    for end in (0..bytes.len()).step_by(512) {
        std::fs::write(&stored.path, &bytes[..end]).unwrap();
        match stored.walk() {
            Ok((messages, counters, lost)) => {
                assert!(lost, "{end}: {counters:?}");
                // SQLite fills the page of the cut with zeros: what it held cannot be told from them.
                assert!(messages.len() <= stored.messages.len(), "{end}");
            }
            Err(why) if end > 0 => {
                refused += 1;
                let why = why.to_string();
                let cause = "the database is damaged or cut off: ";
                assert!(why.contains(cause) && why.contains("copy it again"), "{end}: {why}");
            }
            Err(_) => {}
        }
    }
    assert!(refused > 0, "a part of the first page is no database");
}

/// Database that its recorder has not finished, copied as it is on the disk: with the file of this
/// ending beside it.
struct Unfinished {
    folder: tempfile::TempDir,
    path: PathBuf,
    ending: &'static str,
    messages: Vec<Told>,
}

impl Unfinished {
    /// Stores the messages, does some SQL and does not end the connection before all is copied.
    fn after(ending: &'static str, sql: &[&str]) -> Self {
        let home = tempfile::tempdir().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let from = home.path().join("walk.db3");
        let path = folder.path().join("walk.db3");
        let messages = in_mcap(&log());
        let recorder = store(&messages, &from);
        sql.iter().for_each(|sql| recorder.execute_batch(sql).unwrap());
        let unfinished = Self { folder, path, ending, messages };
        std::fs::copy(&from, &unfinished.path).unwrap();
        std::fs::copy(home.path().join(format!("walk.db3{ending}")), unfinished.beside()).unwrap();
        unfinished
    }

    fn journal() -> Self {
        Self::after(
            "-journal",
            &[
                "PRAGMA cache_size=2",
                "BEGIN",
                "UPDATE messages SET data = zeroblob(901)",
                "INSERT INTO messages SELECT id + 1000, 1, 5, zeroblob(5000) FROM messages",
            ],
        )
    }

    fn write_ahead(last: &str) -> Self {
        Self::after(
            "-wal",
            &[
                "PRAGMA journal_mode=WAL; PRAGMA wal_autocheckpoint=0; PRAGMA cache_size=2",
                "INSERT INTO messages SELECT id + 1000, topic_id, timestamp, data FROM messages",
                last,
            ],
        )
    }

    fn beside(&self) -> PathBuf {
        self.folder.path().join(format!("walk.db3{}", self.ending))
    }

    fn files(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let mut files: Vec<PathBuf> = std::fs::read_dir(self.folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        files.sort();
        files.into_iter().map(|file| (file.clone(), std::fs::read(&file).unwrap())).collect()
    }

    /// Reads all messages; the folder must be as before.
    fn walk(&self) -> Result<(Vec<Told>, Vec<&'static str>, bool), String> {
        let before = self.files();
        let result = LogWalker::open(&self.path, &Limits::default()).map(told);
        assert!(self.files() == before, "the folder of the log has changed");
        result.map_err(|error| error.to_string())
    }
}

#[test]
fn a_transaction_that_was_not_committed_is_left_out_and_counted() {
    let (messages, counters, lost) = Unfinished::journal().walk().unwrap();
    assert_eq!(messages, in_mcap(&log()));
    assert!(lost && counters.contains(&"uncommitted_transactions"), "{counters:?}");
}

#[test]
fn a_write_ahead_log_is_read_up_to_its_last_commit() {
    let stored = Unfinished::write_ahead("");
    let (messages, counters, lost) = stored.walk().unwrap();
    assert_eq!(messages, [&stored.messages[..], &stored.messages].concat());
    assert!(!lost, "{counters:?}");
    let cut = Unfinished::write_ahead("BEGIN; UPDATE messages SET data = zeroblob(9000)");
    let (messages, counters, lost) = cut.walk().unwrap();
    assert_eq!(messages.len(), 2 * stored.messages.len());
    assert!(messages.iter().all(|message| message.3 != vec![0; 9000]));
    assert!(lost && counters.contains(&"uncommitted_transactions"), "{counters:?}");
}

#[test]
fn no_file_appears_beside_a_database_without_its_write_ahead_log() {
    let stored = Unfinished::write_ahead("PRAGMA wal_checkpoint(TRUNCATE)");
    let (messages, _, lost) = stored.walk().unwrap();
    assert_eq!((messages.len(), lost), (2 * stored.messages.len(), false));
    std::fs::remove_file(stored.beside()).unwrap();
    assert_eq!(stored.walk().unwrap().0.len(), 2 * stored.messages.len());
    let odd = stored.folder.path().join("100% a?b#ü.db3");
    std::fs::rename(&stored.path, &odd).unwrap();
    let renamed = Unfinished { path: odd, ..stored };
    assert_eq!(renamed.walk().unwrap().0.len(), 2 * renamed.messages.len());
}

#[test]
fn a_journal_that_names_another_file_is_refused_and_the_file_stays() {
    let stored = Unfinished::journal();
    let victim = stored.folder.path().join("precious.txt");
    std::fs::write(&victim, "not a journal").unwrap();
    // As SQLite writes it: page number, name, length, checksum, magic.
    let name = victim.to_str().unwrap().as_bytes();
    let checksum: u32 = name.iter().map(|byte| u32::from(*byte)).sum();
    let mut journal = std::fs::read(stored.beside()).unwrap();
    journal.extend(0_u32.to_be_bytes());
    journal.extend(name);
    journal.extend((name.len() as u32).to_be_bytes());
    journal.extend(checksum.to_be_bytes());
    journal.extend([0xd9, 0xd5, 0x05, 0xf9, 0x20, 0xa1, 0x63, 0xd7]);
    std::fs::write(stored.beside(), journal).unwrap();
    let error = stored.walk().unwrap_err();
    assert!(error.contains("several databases") && error.contains("sqlite3"), "{error}");
    assert!(victim.exists());
}

#[test]
fn a_copy_beyond_the_limit_is_refused_with_the_remedy() {
    let stored = Unfinished::journal();
    let limits = Limits { file_bytes: 10_000, ..Limits::default() };
    let error = LogWalker::open(&stored.path, &limits).err().unwrap().to_string();
    assert!(error.contains("file_bytes") && error.contains("sqlite3 FILE"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn a_damaged_file_beside_a_database_is_survived(
        is_journal in any::<bool>(),
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        kept in any::<prop::sample::Index>(),
    ) {
        let stored = if is_journal { Unfinished::journal() } else { Unfinished::write_ahead("") };
        let mut bytes = std::fs::read(stored.beside()).unwrap();
        for (at, value) in hits {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        bytes.truncate(kept.index(bytes.len() + 1));
        std::fs::write(stored.beside(), bytes).unwrap();
        let _ = stored.walk();
    }

    #[test]
    fn damaged_bytes_are_survived(
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
    ) {
        let stored = Stored::new("");
        let mut bytes = std::fs::read(&stored.path).unwrap();
        for (at, value) in hits {
            let at = 16 + at.index(bytes.len() - 16);
            bytes[at] = value;
        }
        std::fs::write(&stored.path, &bytes).unwrap();
        let _ = stored.walk();
    }
}
