//! Damaged and hostile files: nothing panics, hangs or takes more memory than the file has data;
//! intact messages are delivered, lost ones are counted.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use std::io::{Read, Write};
use std::path::Path;

use common::{LogWriter, SavedLog, at, compressions};
use mcap::{Compression, WriteOptions};
use tagalong_log::LogWalker;
use tagalong_log::msgs::StringMsg;
use tagalong_log::{InputSettings, Inputs, Limits};
use tagalong_math::{RandomSource, XorShift64};

const MESSAGES: usize = 120;
const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];

/// Result of a walk: the numbers in the messages.
struct Walk {
    numbers: Vec<usize>,
    counters: std::collections::BTreeMap<&'static str, u64>,
    lost: bool,
    notes: Vec<String>,
}

impl Walk {
    fn count(&self, name: &str) -> u64 {
        self.counters.get(name).copied().unwrap_or(0)
    }
}

fn walk_with(reader: impl Read, limits: &Limits) -> Option<Walk> {
    let mut walker = LogWalker::new(reader, limits).ok()?;
    let mut numbers = Vec::new();
    while let Some(message) = walker.next() {
        let text = std::str::from_utf8(message.data).ok();
        numbers.push(text.and_then(|t| t.split(' ').next()?.parse().ok()).unwrap_or(usize::MAX));
        assert!(numbers.len() < 10 * MESSAGES, "a walk that does not end");
    }
    assert!(walker.next().is_none(), "a walk that has ended stays ended");
    Some(Walk {
        numbers,
        counters: walker.counters().clone(),
        lost: walker.data_lost(),
        notes: walker.notes().to_vec(),
    })
}

fn walk(bytes: &[u8]) -> Option<Walk> {
    walk_with(bytes, &Limits::default())
}

fn text(number: usize) -> String {
    // Different in each message, so that compression does not remove it.
    let noise: String =
        (0..40).map(|i| char::from(b'a' + ((number * 31 + i * i) % 26) as u8)).collect();
    format!("{number} {noise}")
}

fn healthy(compression: Option<Compression>) -> Vec<u8> {
    let options = WriteOptions::new().compression(compression).chunk_size(Some(700));
    let mut log = LogWriter::new(options);
    for number in 0..MESSAGES {
        log.bytes::<StringMsg>("/text", at(number as f64), text(number).as_bytes());
    }
    log.attachment(b"some notes");
    log.finish()
}

/// Makes one top-level record.
fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn header() -> Vec<u8> {
    [&MAGIC[..], &record(1, &[0; 8])].concat()
}

fn end() -> Vec<u8> {
    [&record(0x0f, &[0; 4])[..], &record(2, &[0; 20]), &MAGIC].concat()
}

fn string(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn schema_record(id: u16) -> Vec<u8> {
    schema_of(id, "")
}

fn schema_of(id: u16, definition: &str) -> Vec<u8> {
    let names = [string("std_msgs/msg/String"), string("ros2msg")].concat();
    record(3, &[&id.to_le_bytes()[..], &names, &string(definition)].concat())
}

fn channel_record(id: u16, schema: u16, topic: &[u8]) -> Vec<u8> {
    let topic = [&(topic.len() as u32).to_le_bytes()[..], topic].concat();
    let body = [&id.to_le_bytes()[..], &schema.to_le_bytes(), &topic, &string("cdr"), &[0; 4]];
    record(4, &body.concat())
}

fn message_record(channel: u16, number: usize) -> Vec<u8> {
    record(5, &[&channel.to_le_bytes()[..], &[0; 20], text(number).as_bytes()].concat())
}

fn chunk(compression: &str, uncompressed: u64, crc: u32, data: &[u8]) -> Vec<u8> {
    let body = [
        &[0; 16][..],
        &uncompressed.to_le_bytes(),
        &crc.to_le_bytes(),
        &string(compression),
        &(data.len() as u64).to_le_bytes(),
        data,
    ];
    record(6, &body.concat())
}

/// Makes a file of a valid start, `middle`, and a valid message.
fn around(middle: &[u8]) -> Vec<u8> {
    let start = [header(), schema_record(1), channel_record(1, 1, b"/text"), message_record(1, 0)];
    [&start.concat()[..], middle, &message_record(1, 1), &end()].concat()
}

#[test]
fn a_healthy_file_is_whole() {
    for (name, compression) in compressions() {
        let found = walk(&healthy(compression)).unwrap();
        assert_eq!(found.numbers, (0..MESSAGES).collect::<Vec<_>>(), "{name}");
        assert!(!found.lost, "{name}: {:?}", found.counters);
        assert!(found.count("chunks_verified") > 5);
        assert_eq!(found.count("attachments_skipped"), 1);
    }
}

#[test]
fn a_truncated_file_gives_its_complete_chunks() {
    for (name, compression) in compressions() {
        let whole = healthy(compression);
        let mut delivered = 0;
        for length in (8..whole.len()).step_by(37) {
            let found = walk(&whole[..length]).unwrap();
            let count = found.numbers.len();
            assert_eq!(found.numbers, (0..count).collect::<Vec<_>>(), "{name} cut at {length}");
            assert!(count >= delivered, "{name} cut at {length}: a longer file gives less");
            assert_eq!(found.count("truncated"), 1, "{name} cut at {length}");
            assert!(found.lost);
            delivered = count;
        }
        for cut in [1, 8, 37] {
            let found = walk(&whole[..whole.len() - cut]).unwrap();
            assert_eq!(found.numbers.len(), MESSAGES, "{name} without its last {cut} bytes");
            assert!(found.lost);
        }
    }
}

#[test]
fn a_flipped_byte_never_delivers_a_wrong_message_unnoticed() {
    for (name, compression) in compressions() {
        let whole = healthy(compression);
        let mut random = XorShift64::new(0x1234_5678_9abc_def1);
        let mut unnoticed = 0;
        for _ in 0..600 {
            let place = random.below(whole.len() as u64) as usize;
            let with = 1 + random.below(255) as u8;
            let mut bytes = whole.clone();
            bytes[place] ^= with;
            let Some(found) = walk(&bytes) else {
                assert!(place < 8, "{name}: refused for byte {place}");
                continue;
            };
            // Chunks with a checksum deliver no wrong message.
            let right = found.numbers.iter().all(|number| *number < MESSAGES);
            assert!(right, "{name}: flip at {place} delivered {:?}", found.numbers);
            if found.numbers.len() < MESSAGES {
                assert!(found.lost, "{name}: flip at {place} lost messages without a word");
            }
            unnoticed += u32::from(!found.lost);
        }
        // Indexes behind the data are not read: nothing is lost there.
        assert!(unnoticed < 400, "{name}: {unnoticed} of 600 flips were not noticed");
    }
}

#[test]
fn the_chunk_that_was_changed_is_the_one_that_is_missing() {
    for (name, compression) in compressions() {
        let whole = healthy(compression);
        let first = whole.windows(9).position(|w| w[0] == 6 && w[3..9] == [0; 6]).unwrap();
        let length = u16::from_le_bytes([whole[first + 1], whole[first + 2]]) as usize;
        let mut bytes = whole.clone();
        bytes[first + 9 + length - 40] ^= 0x55;
        let found = walk(&bytes).unwrap();
        let faults = found.count("crc_failed_chunks") + found.count("damaged_chunks");
        assert_eq!(faults, 1, "{name}: {:?}", found.counters);
        // The changed chunk introduced the channel, which the index repeats.
        let mut first = LogWalker::new(&bytes[..], &Limits::default()).unwrap();
        while first.next().is_some() {}
        let again = LogWalker::new(&bytes[..], &Limits::default()).unwrap();
        let mut again = again.knowing(first.channels().cloned());
        let mut count = 0;
        while again.next().is_some() {
            count += 1;
        }
        assert!(count > MESSAGES / 2 && count < MESSAGES, "{name}: {count}");
    }
}

#[test]
fn a_file_without_checksums_says_so() {
    let options = WriteOptions::new().compression(None).calculate_chunk_crcs(false);
    let mut log = LogWriter::new(options);
    log.colour(at(0.0));
    let source = log.save().open(&InputSettings::default(), Inputs::ANY).unwrap();
    assert!(source.notes().iter().any(|note| note.starts_with("crc: absent")));
    assert!(!source.counters().contains_key("chunks_verified"));
}

#[test]
fn lengths_that_lie_are_named_with_their_place() {
    for length in [1_u64 << 62, u64::MAX, 1 << 40] {
        let mut bytes = [header(), schema_record(1), channel_record(1, 1, b"/text")].concat();
        bytes.extend(message_record(1, 0));
        let place = bytes.len();
        for opcode in [3, 4, 5, 6, 9, 0x0b, 0x70] {
            let mut bytes = bytes.clone();
            bytes.push(opcode);
            bytes.extend(length.to_le_bytes());
            let found = walk(&bytes).unwrap();
            assert_eq!(found.numbers, [0]);
            assert!(found.lost);
            let told = found.notes.join("\n");
            assert!(told.contains(&format!("at byte {place}")), "{opcode}: {told}");
            assert!(told.contains(&length.to_string()) || opcode > 0x0f, "{opcode}: {told}");
        }
        // The same inside a chunk, stored and compressed.
        let mut inside = message_record(1, 7);
        inside.push(5);
        inside.extend(length.to_le_bytes());
        for (name, data) in [("", inside.clone()), ("zstd", zstd(&inside))] {
            let crc = crc32fast::hash(&inside);
            let found = walk(&around(&chunk(name, inside.len() as u64, crc, &data))).unwrap();
            assert_eq!(found.numbers, [0, 7, 1]);
            assert_eq!(found.count("damaged_chunks"), 1);
        }
    }
}

fn zstd(data: &[u8]) -> Vec<u8> {
    zstd::encode_all(data, 3).unwrap()
}

/// Makes a compressed stream of zeros that would be much larger than the file.
fn bomb(bytes: u64) -> Vec<u8> {
    let mut encoder = zstd::stream::write::Encoder::new(Vec::new(), 3).unwrap();
    std::io::copy(&mut std::io::repeat(0).take(bytes), &mut encoder).unwrap();
    encoder.flush().unwrap();
    encoder.finish().unwrap()
}

#[test]
fn a_bomb_is_refused_and_what_follows_is_read() {
    // The stated size is beyond the limit: decompression is not even started.
    let data = bomb(300 << 20);
    let found = walk(&around(&chunk("zstd", 3 << 30, 0, &data))).unwrap();
    assert_eq!((found.count("oversized_chunks"), &found.numbers[..]), (1, &[0, 1][..]));
    // The stated size is wrong: decompression stops one byte behind it.
    for claimed in [4, 5000] {
        let found = walk(&around(&chunk("zstd", claimed, 0, &data))).unwrap();
        assert_eq!((found.count("damaged_chunks"), &found.numbers[..]), (1, &[0, 1][..]));
    }
    for claimed in [1 << 40, u64::MAX] {
        let found = walk(&around(&chunk("zstd", claimed, 0, &zstd(b"abc")))).unwrap();
        assert_eq!((found.count("oversized_chunks"), &found.numbers[..]), (1, &[0, 1][..]));
    }
}

#[test]
fn odd_records_are_skipped_and_counted() {
    let stored = message_record(1, 5);
    let nested = chunk("", stored.len() as u64, 0, &stored);
    let cases: Vec<(&str, Vec<u8>, bool)> = vec![
        ("attachments_skipped", record(9, &[]), false),
        ("attachments_skipped", record(9, &[1, 2, 3]), false),
        ("unknown_records_skipped", record(0x70, b"what?"), false),
        ("unknown_records_skipped", record(0x90, b"private"), false),
        ("unknown_compression_chunks", chunk("snappy", 3, 0, b"abc"), true),
        ("nested_chunks", chunk("", nested.len() as u64, 0, &nested), true),
        ("unknown_channel_messages", message_record(77, 3), true),
        ("damaged_records", channel_record(2, 1, &[0xff, 0xfe]), true),
        ("damaged_records", record(3, &[0, 0]), true),
        ("damaged_records", record(4, &[0, 0, 255, 255, 255, 255, 255]), true),
        ("damaged_records", record(5, &[1, 0, 0]), true),
        ("conflicting_channels", channel_record(1, 1, b"/other"), true),
        ("channels_without_schema", channel_record(3, 9, b"/bare"), false),
        ("damaged_chunks", record(6, &[0; 39]), true),
        ("damaged_chunks", chunk("lz4", 100, 0, b"not lz4 at all"), true),
        ("damaged_chunks", chunk("zstd", 100, 0, b"not zstd at all"), true),
        ("crc_failed_chunks", chunk("", stored.len() as u64, 1, &stored), true),
    ];
    for (counter, middle, lost) in cases {
        let found = walk(&around(&middle)).unwrap();
        assert_eq!(found.count(counter), 1, "{counter}: {:?}", found.counters);
        assert_eq!(found.numbers, [0, 1], "{counter}");
        assert_eq!(found.lost, lost, "{counter}: {:?}", found.counters);
    }
    let found = walk(&around(&channel_record(4, 0, b"/schemaless"))).unwrap();
    assert!(!found.lost && found.numbers == [0, 1]);
}

#[test]
fn records_beyond_the_limit_are_passed_over() {
    let limits = Limits { record_bytes: 100, ..Limits::default() };
    let middle = record(5, &[&[1, 0][..], &[0; 500]].concat());
    let found = walk_with(&around(&middle)[..], &limits).unwrap();
    assert_eq!((found.count("oversized_records"), &found.numbers[..]), (1, &[0, 1][..]));
    let inside = [middle, message_record(1, 8)].concat();
    let found =
        walk_with(&around(&chunk("", inside.len() as u64, 0, &inside))[..], &limits).unwrap();
    assert_eq!((found.count("oversized_records"), &found.numbers[..]), (1, &[0, 8, 1][..]));
}

#[test]
fn a_pipe_in_small_pieces_gives_the_same() {
    struct Drops<'a>(&'a [u8]);
    impl Read for Drops<'_> {
        fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
            let count = out.len().min(3);
            self.0.read(&mut out[..count])
        }
    }
    for (_, compression) in compressions() {
        let found = walk_with(Drops(&healthy(compression)), &Limits::default()).unwrap();
        assert!(found.numbers.len() == MESSAGES && !found.lost);
    }
}

#[test]
fn what_is_no_log_is_refused_in_one_line() {
    let noise: Vec<u8> =
        (0..5000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    for (bytes, reason) in [
        (&b""[..], "it is empty"),
        (b"#ROSBAG V1.2\n", "ROS 1 bag"),
        (b"#ROSBAG V2.0\n", "no images"),
        (b"SQLite format 3\0", "the database is damaged or cut off"),
        (b"hello, this is text", "starts with"),
        (&MAGIC, "no images"),
        (&[MAGIC, MAGIC].concat(), "no images"),
        (&noise, "not an MCAP file"),
        (&[&MAGIC[..], &noise].concat(), "no images"),
    ] {
        let error = refusal(&SavedLog::new(bytes).path);
        assert!(error.contains("test.mcap") && error.contains(reason), "{error}");
    }
}

fn refusal(path: &Path) -> String {
    common::open(path, &InputSettings::default(), Inputs::ANY).err().unwrap().to_string()
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    assert!(refusal(folder.path()).contains("holds no .mcap"));
    assert!(refusal(&folder.path().join("absent.mcap")).contains("absent.mcap"));
    if cfg!(unix) {
        assert!(refusal(Path::new("/dev/zero")).contains("a pipe or a device"));
    }
}

#[test]
fn f13_schemas_are_not_parsed() {
    let rule = "=".repeat(80);
    let cyclic = format!(
        "a/A a\n{rule}\nMSG: a/A\nstd_msgs/String a\n{rule}\nMSG: std_msgs/String\na/A a\n"
    );
    let deep: String =
        (0..5000).map(|n| format!("a/A{} a\n{rule}\nMSG: a/A{}\n", n + 1, n + 1)).collect();
    for definition in [cyclic, deep, "\u{0}[[[".into()] {
        let start = [header(), schema_of(1, &definition), channel_record(1, 1, b"/text")].concat();
        let found = walk(&[start, message_record(1, 0), end()].concat()).unwrap();
        assert_eq!((found.numbers, found.lost), (vec![0], false));
    }
}
