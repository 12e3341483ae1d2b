//! Files written by other programs: rosbag2, libmcap, Python, the MCAP conformance suite.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use std::io::BufReader;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use tagalong_log::Limits;
use tagalong_log::LogWalker;
use tagalong_log::images::{decode_compressed, decode_raw};
use tagalong_log::msgs::{CompressedImage, Image, StringMsg, decode};

fn folder() -> Option<PathBuf> {
    tagalong_conformance::testdata::find("mcap")
}

fn walker(path: &Path) -> LogWalker<BufReader<std::fs::File>> {
    LogWalker::new(BufReader::new(std::fs::File::open(path).unwrap()), &Limits::default()).unwrap()
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn messages_and_images_are_those_that_were_written() {
    let Some(folder) = folder() else { return };
    let text = std::fs::read_to_string(folder.join("expected.json")).unwrap();
    let expected: serde_json::Value = serde_json::from_str(&text).unwrap();
    let files = expected.as_object().unwrap();
    assert_eq!(files.len(), 26);
    for (name, file) in files {
        let mut walker = walker(&folder.join(name));
        let listed = file["messages"].as_array().unwrap();
        // The list is in log order; a file may be in another one.
        let mut got: Vec<(u64, String, u64, String)> = Vec::new();
        while let Some(message) = walker.next() {
            let channel = &file["channels"][&message.channel.topic];
            assert_eq!(channel[0], message.channel.schema_name.as_str(), "{name}");
            assert_eq!(channel[1], message.channel.encoding.as_str(), "{name}");
            check_image(listed, message.channel.topic.as_str(), message.data);
            got.push((
                message.log_time,
                message.channel.topic.clone(),
                message.publish_time,
                sha256(message.data),
            ));
        }
        let mut wanted: Vec<_> = listed
            .iter()
            .map(|m| {
                let log = number(&m["log_time"]);
                let publish = number(&m["publish_time"]);
                (log, string(&m["topic"]), publish, string(&m["payload_sha256"]))
            })
            .collect();
        wanted.sort();
        got.sort();
        assert_eq!(got.len() as u64, number(&file["message_count"]), "{name}");
        // Of long files only some messages are listed.
        assert!(wanted.iter().all(|message| got.binary_search(message).is_ok()), "{name}");
        assert!(wanted.len() == got.len() || wanted.len() >= 100, "{name}");
        assert!(!walker.data_lost(), "{name}: {:?} {:?}", walker.counters(), walker.notes());
    }
}

fn number(value: &serde_json::Value) -> u64 {
    value.as_u64().unwrap()
}

fn string(value: &serde_json::Value) -> String {
    value.as_str().unwrap().to_owned()
}

fn check_image(listed: &[serde_json::Value], topic: &str, data: &[u8]) {
    let Some(wanted) =
        listed.iter().find(|m| m["topic"] == topic && m.get("data_sha256").is_some())
    else {
        return;
    };
    if let Some(format) = wanted["format"].as_str() {
        let image: CompressedImage<'_> = decode(data).unwrap();
        assert_eq!(image.format, format);
        assert_eq!(sha256(image.data), wanted["data_sha256"].as_str().unwrap());
        assert!(decode_compressed(&image, None, &Limits::default()).is_ok());
    } else {
        let image: Image<'_> = decode(data).unwrap();
        let size = (u64::from(image.width), u64::from(image.height), u64::from(image.step));
        let expected = ["width", "height", "step"].map(|key| number(&wanted[key]));
        assert_eq!(size, expected.into());
        assert_eq!(image.encoding, wanted["encoding"].as_str().unwrap());
        assert_eq!(sha256(image.data), wanted["data_sha256"].as_str().unwrap());
        assert_eq!(decode_raw(&image, None, &Limits::default()).unwrap().size(), (640, 480));
    }
}

#[test]
fn strings_that_ros_wrote_are_read() {
    let Some(folder) = folder() else { return };
    let mut walker = walker(&folder.join("klintan-real-cdr/sample-zstd.mcap"));
    let message = walker.next().unwrap();
    assert_eq!(message.channel.topic, "/text");
    assert!(!decode::<StringMsg>(message.data).unwrap().data.is_empty());
}

#[test]
fn every_variant_of_the_conformance_suite_is_whole() {
    let Some(folder) = folder() else { return };
    let mut files = 0;
    let mut stack = vec![folder.join("conformance")];
    while let Some(folder) = stack.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                stack.push(path);
            } else if path.extension().is_some_and(|e| e == "mcap") {
                files += 1;
                let mut walker = walker(&path);
                let mut count = 0;
                while let Some(message) = walker.next() {
                    assert_eq!(message.channel.topic, "example");
                    assert_eq!(message.sequence, count);
                    count += 1;
                }
                assert_eq!(count, 10, "{}", path.display());
                let lost = (walker.counters(), walker.notes());
                assert!(!walker.data_lost(), "{}: {lost:?}", path.display());
            }
        }
    }
    assert_eq!(files, 154);
}
