//! ROS 1 bags: written here record by record, and real ones; damaged and hostile ones.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use std::io::Write;

use proptest::prelude::*;
use tagalong_log::msgs::{LaserScan, decode};
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits, LogWalker, read_leg_scans};

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
const MESSAGES: u32 = 12;
const COMPRESSIONS: [&str; 2] = ["none", "lz4"];

fn field(name: &str, value: &[u8]) -> Vec<u8> {
    let body = [name.as_bytes(), b"=", value].concat();
    [&(body.len() as u32).to_le_bytes()[..], &body].concat()
}

fn record(header: &[Vec<u8>], data: &[u8]) -> Vec<u8> {
    let header = header.concat();
    let lengths = [header.len(), data.len()].map(|length| (length as u32).to_le_bytes());
    [&lengths[0][..], &header, &lengths[1], data].concat()
}

fn connection(id: u32, topic: &str, kind: &str) -> Vec<u8> {
    let data = [field("topic", topic.as_bytes()), field("type", kind.as_bytes())].concat();
    let header =
        [field("op", &[7]), field("conn", &id.to_le_bytes()), field("topic", topic.as_bytes())];
    record(&header, &data)
}

fn message(id: u32, seconds: u32, data: &[u8]) -> Vec<u8> {
    let time = [seconds.to_le_bytes(), 500_u32.to_le_bytes()].concat();
    record(&[field("op", &[2]), field("conn", &id.to_le_bytes()), field("time", &time)], data)
}

/// Returns a laser scan as ROS 1 serialises it.
fn scan(seconds: u32) -> Vec<u8> {
    let mut out = [seconds, seconds, 0].map(u32::to_le_bytes).concat();
    out.extend(5_u32.to_le_bytes());
    out.extend(b"laser");
    let fixed = [-0.1_f32, 0.1, 0.1, 0.0, 0.1, 0.05, 9.0];
    out.extend(fixed.iter().flat_map(|value| value.to_le_bytes()));
    out.extend(3_u32.to_le_bytes());
    out.extend(
        [1.0_f32, seconds as f32 * 0.125 + 1.0, f32::INFINITY].iter().flat_map(|v| v.to_le_bytes()),
    );
    out.extend(0_u32.to_le_bytes());
    out
}

fn pack(compression: &str, data: &[u8]) -> Vec<u8> {
    match compression {
        "lz4" => {
            let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
            encoder.write_all(data).unwrap();
            encoder.finish().0
        }
        _ => data.to_vec(),
    }
}

fn chunk(compression: &str, size: u32, packed: &[u8]) -> Vec<u8> {
    let header = [
        field("op", &[5]),
        field("compression", compression.as_bytes()),
        field("size", &size.to_le_bytes()),
    ];
    record(&header, packed)
}

fn four_scans(first: u32) -> Vec<u8> {
    let mut records = connection(3, "/scan", "sensor_msgs/LaserScan");
    (first..first + 4).for_each(|at| records.extend(message(3, at, &scan(at))));
    records
}

fn bag(compression: &str) -> Vec<u8> {
    let mut out = [MAGIC, &record(&[field("op", &[3])], &[b' '; 40])].concat();
    for first in (0..MESSAGES).step_by(4) {
        let records = four_scans(first);
        out.extend(chunk(compression, records.len() as u32, &pack(compression, &records)));
        out.extend(record(&[field("op", &[4])], &[0; 12]));
    }
    out.extend(connection(3, "/scan", "sensor_msgs/LaserScan"));
    out.extend(record(&[field("op", &[6])], &[0; 8]));
    out
}

/// Result of a walk: seconds of the scans that are readable, names of what was lost.
fn walk(bytes: &[u8], limits: &Limits) -> Option<(Vec<u32>, Vec<&'static str>, bool)> {
    let mut walker = LogWalker::new(bytes, limits).ok()?;
    let mut seconds = Vec::new();
    let mut count = 0;
    while let Some(message) = walker.next() {
        count += 1;
        assert!(count < 1000, "a walk that does not end");
        assert_eq!(message.channel.encoding, "ros1");
        if let Ok(scan) = decode::<LaserScan>(message.data) {
            seconds.push(scan.header.stamp.sec as u32);
        }
    }
    assert!(walker.next().is_none(), "a walk that has ended stays ended");
    Some((seconds, walker.counters().keys().copied().collect(), walker.data_lost()))
}

fn all() -> Vec<u32> {
    (0..MESSAGES).collect()
}

#[test]
fn messages_of_all_chunks_are_delivered_in_order() {
    for compression in COMPRESSIONS {
        let (seconds, counters, lost) = walk(&bag(compression), &Limits::default()).unwrap();
        assert_eq!((seconds, lost), (all(), false), "{compression}: {counters:?}");
    }
}

/// Only a decoder of bz2 is among the dependencies: the chunk was packed by another program from the
/// records of [`four_scans`].
#[test]
fn chunks_of_bz2_are_read() {
    let packed: &[u8] = include_bytes!("data/scans.bz2");
    let size = four_scans(0).len() as u32;
    let bytes = [MAGIC, &chunk("bz2", size, packed)].concat();
    let (seconds, counters, lost) = walk(&bytes, &Limits::default()).unwrap();
    assert_eq!((seconds, lost), (vec![0, 1, 2, 3], false), "{counters:?}");
    for end in 0..packed.len() {
        let bytes = [MAGIC, &chunk("bz2", size, &packed[..end])].concat();
        let (seconds, counters, lost) = walk(&bytes, &Limits::default()).unwrap();
        assert!(seconds.is_empty() && lost, "{end}: {counters:?}");
    }
    for at in 0..packed.len() {
        let mut damaged = packed.to_vec();
        damaged[at] ^= 0x10;
        assert!(
            walk(&[MAGIC, &chunk("bz2", size, &damaged)].concat(), &Limits::default()).is_some()
        );
    }
}

#[test]
fn a_message_keeps_topic_type_and_time() {
    let bytes = bag("none");
    let mut walker = LogWalker::new(&bytes[..], &Limits::default()).unwrap();
    let _ = walker.next();
    let message = walker.next().unwrap();
    assert_eq!(message.log_time, 1_000_000_500);
    assert_eq!(message.channel.topic, "/scan");
    assert_eq!(message.channel.schema_name, "sensor_msgs/LaserScan");
    let scan: LaserScan = decode(message.data).unwrap();
    assert_eq!((scan.ranges[1], scan.header.frame_id.as_str()), (1.125, "laser"));
}

#[test]
fn messages_outside_of_chunks_are_read_too() {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(connection(0, "/scan", "sensor_msgs/LaserScan"));
    bytes.extend(message(0, 5, &scan(5)));
    assert_eq!(walk(&bytes, &Limits::default()).unwrap().0, [5]);
}

#[test]
fn a_truncated_bag_is_read_up_to_its_last_whole_chunk() {
    for compression in COMPRESSIONS {
        let bytes = bag(compression);
        for end in MAGIC.len()..bytes.len() {
            let (seconds, counters, _) = walk(&bytes[..end], &Limits::default()).unwrap();
            assert!(all().starts_with(&seconds), "{end}");
            // Between two records, a shorter bag is a whole one.
            let lost = counters.contains(&"truncated");
            assert!(lost || seconds.len() % 4 == 0, "{end}: {seconds:?}");
        }
    }
}

#[test]
fn sizes_are_bounded() {
    let huge = chunk("none", u32::MAX, b"x");
    let bytes = [&bag("none")[..], &huge].concat();
    let (seconds, counters, lost) = walk(&bytes, &Limits::default()).unwrap();
    assert_eq!(seconds, all());
    assert!(lost && counters.contains(&"oversized_chunks"), "{counters:?}");
    // A header that claims more than there is.
    let bytes = [&bag("none")[..], &u32::MAX.to_le_bytes()].concat();
    let (_, counters, _) = walk(&bytes, &Limits::default()).unwrap();
    assert!(counters.contains(&"damaged_records"), "{counters:?}");
    // A chunk that unpacks to more than it claims.
    let bomb = pack("lz4", &vec![0; 1 << 20]);
    let bytes = [&bag("lz4")[..], &chunk("lz4", 100, &bomb)].concat();
    let (seconds, counters, _) = walk(&bytes, &Limits::default()).unwrap();
    assert_eq!(seconds, all());
    assert!(counters.contains(&"damaged_chunks"), "{counters:?}");
    let small = Limits { chunk_bytes: 64, ..Limits::default() };
    let (seconds, counters, _) = walk(&bag("none"), &small).unwrap();
    assert!(seconds.is_empty() && counters.contains(&"oversized_chunks"), "{counters:?}");
}

#[test]
fn what_is_not_understood_is_counted() {
    let odd = [
        (chunk("zip", 3, b"abc"), "unknown_compression_chunks"),
        (chunk("bz2", 3, b"abc"), "damaged_chunks"),
        (record(&[field("op", &[99])], b"abc"), "unknown_records_skipped"),
        (record(&[field("no", &[2])], b"abc"), "damaged_records"),
        (message(77, 1, b"abc"), "unknown_channel_messages"),
        (connection(3, "/other", "std_msgs/String"), "conflicting_channels"),
        (connection(70_000, "/scan", "sensor_msgs/LaserScan"), "damaged_records"),
    ];
    for (record, name) in odd {
        let bytes = [&bag("none")[..], &record].concat();
        let (seconds, counters, _) = walk(&bytes, &Limits::default()).unwrap();
        assert_eq!(seconds, all(), "{name}");
        assert!(counters.contains(&name), "{name}: {counters:?}");
    }
}

#[test]
fn another_version_is_no_log() {
    let error = LogWalker::new(&b"#ROSBAG V1.2\nabc"[..], &Limits::default()).err().unwrap();
    assert!(error.to_string().contains("another version"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn damaged_bytes_are_survived(
        which in 0..2_usize,
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        let mut bytes = bag(COMPRESSIONS[which]);
        for (at, value) in hits {
            let at = MAGIC.len() + at.index(bytes.len() - MAGIC.len());
            bytes[at] = value;
        }
        prop_assert!(walk(&bytes, &Limits::default()).is_some());
    }
}

/// The scans of a bag make frames as those of an MCAP file do.
#[test]
fn a_bag_makes_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scans.bag");
    std::fs::write(&path, bag("lz4")).unwrap();
    let inputs = Inputs::NONE.require(Input::Laser);
    let settings = InputSettings::default();
    let mut source = FrameSource::open(&path, &settings, &Limits::default(), inputs).unwrap();
    let mut frames = 0;
    while let Some(item) = source.next_frame() {
        assert_eq!(item.frame.scan().unwrap().points.len(), 2);
        frames += 1;
    }
    assert_eq!(frames, MESSAGES);
}

#[test]
fn annotated_legs_belong_to_the_scans_in_their_order() {
    let Some(path) = tagalong_conformance::testdata::find("laser/train/positive_2_extracted.bag")
    else {
        return;
    };
    let scans = read_leg_scans(&path, &Limits::default()).unwrap();
    assert_eq!(scans.len(), 83);
    assert!(scans.iter().all(|scan| scan.scan.points.len() > 300 && !scan.legs.is_empty()));
    // Most legs are where the scanner met something.
    let near = scans.iter().filter(|scan| {
        scan.legs
            .iter()
            .all(|leg| scan.scan.points.iter().any(|point| (point.xy() - leg).norm() < 0.15))
    });
    assert!(near.count() > 75);
}

#[test]
fn a_truncated_bag_of_legs_is_refused() {
    let Some(path) = tagalong_conformance::testdata::find("laser/train/positive_2_extracted.bag")
    else {
        return;
    };
    let bytes = std::fs::read(&path).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.bag");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let error = read_leg_scans(&cut, &Limits::default()).unwrap_err().to_string();
    assert!(error.contains("damaged"), "{error}");
}
