//! Mutated ONNX files: each is refused or loads, and none ends the process.
//!
//! ```sh
//! TAGALONG_FUZZ_FILES=1000000 cargo test --release -p tagalong-network --test fuzz -- --nocapture
//! ```
//!
//! The mutations are seeded (`TAGALONG_FUZZ_SEED`) and know the encoding: bytes, numbers, pieces of
//! other files, lengths that are corrected afterwards. The file under test lies at
//! `TAGALONG_FUZZ_FILE` (by default in the folder for temporary files), so that one that ends the
//! process is still there, and those that take too long are kept beside it. Files that did harm go
//! into `tests/corpus`, and stay survived.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test may fail, and tells its count"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;
use std::{env, fs, panic};

use tagalong_network::{Limits, inspect};

/// Small limits, so that a file that loads is soon run.
fn limits() -> Limits {
    Limits {
        file_bytes: 1 << 20,
        operators: 1000,
        tensor_values: 1 << 20,
        load_deadline: Duration::from_secs(5),
        ..Limits::default()
    }
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name)
}

/// Returns all ONNX files of a folder, in the order of their names.
fn files(name: &str) -> Vec<Vec<u8>> {
    let entries = fs::read_dir(folder(name)).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|kind| kind == "onnx")).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

/// Generator of the mutations: xorshift64*.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() >> 33) as usize % end.max(1)
    }
}

/// Field of a message: its key, and where its content lies.
struct Field {
    start: usize,
    content: std::ops::Range<usize>,
    is_bytes: bool,
}

impl Field {
    /// Returns the message with another content of this field.
    fn with_content(&self, message: &[u8], content: &[u8]) -> Vec<u8> {
        let mut key = &message[self.start..self.content.start];
        let mut length = Vec::new();
        // The length follows the number of the field, which has one byte here.
        if self.is_bytes {
            key = &key[..1];
            length = encoded(content.len() as u64);
        }
        [&message[..self.start], key, &length, content, &message[self.content.end..]].concat()
    }
}

fn varint(bytes: &[u8], at: &mut usize) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = *bytes.get(*at)?;
        *at += 1;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

fn encoded(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value > 0x7f {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

/// Splits a message; `None` if it is none.
fn fields(bytes: &[u8]) -> Option<Vec<Field>> {
    let mut at = 0;
    let mut found = Vec::new();
    while at < bytes.len() {
        let start = at;
        let key = varint(bytes, &mut at)?;
        let (from, is_bytes) = match key & 7 {
            0 => {
                let from = at;
                varint(bytes, &mut at)?;
                (from, false)
            }
            2 => {
                let length = usize::try_from(varint(bytes, &mut at)?).ok()?;
                let from = at;
                at = at.checked_add(length).filter(|end| *end <= bytes.len())?;
                (from, true)
            }
            5 => (at, false),
            _ => return None,
        };
        at = at.max(if key & 7 == 5 { from + 4 } else { from });
        if at > bytes.len() {
            return None;
        }
        found.push(Field { start, content: from..at, is_bytes });
    }
    Some(found)
}

/// Numbers at which something usually ends.
const EDGES: [u64; 10] =
    [0, 1, 2, 127, 255, 65_536, 1 << 31, (1 << 31) - 1, u64::MAX, i64::MAX as u64];

/// Changes one field, here or in a message within; lengths around it stay right.
fn mutate(bytes: &[u8], other: &[u8], random: &mut Random, depth: usize) -> Vec<u8> {
    let Some(fields) = fields(bytes).filter(|fields| !fields.is_empty() && depth < 8) else {
        return mutate_bytes(bytes, random);
    };
    let field = &fields[random.below(fields.len())];
    let content = &bytes[field.content.clone()];
    match random.below(12) {
        // Drop, or repeat, the whole field.
        0 => [&bytes[..field.start], &bytes[field.content.end..]].concat(),
        1 => [&bytes[..field.content.end], &bytes[field.start..]].concat(),
        // A field of another file.
        2 => [&bytes[..field.start], piece(other, random), &bytes[field.start..]].concat(),
        3 => mutate_bytes(bytes, random),
        _ if field.is_bytes => {
            field.with_content(bytes, &mutate(content, other, random, depth + 1))
        }
        _ => field.with_content(bytes, &encoded(EDGES[random.below(EDGES.len())])),
    }
}

/// Returns a field of the graph of a file.
fn piece<'a>(bytes: &'a [u8], random: &mut Random) -> &'a [u8] {
    let mut inner = bytes;
    for _ in 0..random.below(4) {
        let parts = fields(inner).unwrap_or_default();
        let Some(longest) = parts.iter().max_by_key(|field| field.content.len()) else { break };
        inner = &inner[longest.content.clone()];
    }
    let Some(parts) = fields(inner).filter(|parts| !parts.is_empty()) else { return &[] };
    let part = &parts[random.below(parts.len())];
    &inner[part.start..part.content.end]
}

fn mutate_bytes(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut changed = bytes.to_vec();
    let at = random.below(changed.len());
    match random.below(4) {
        0 if !changed.is_empty() => changed[at] = random.next() as u8,
        1 if !changed.is_empty() => changed[at] ^= 1 << random.below(8),
        2 => changed.truncate(at),
        _ => changed.insert(at.min(bytes.len()), random.next() as u8),
    }
    changed
}

/// Loads a file and runs it once; returns the kind of the outcome.
fn outcome(path: &Path) -> &'static str {
    match inspect(path, Some([64, 64]), &limits()) {
        Ok(about) if about.run.is_ok() => "run",
        Ok(_) => "loaded",
        Err(why) if why.contains("the runtime failed") => "panicked, contained",
        Err(why) if why.contains("within") => "late",
        Err(_) => "refused",
    }
}

fn file() -> PathBuf {
    let named = env::var_os("TAGALONG_FUZZ_FILE").map(PathBuf::from);
    named.unwrap_or_else(|| env::temp_dir().join("tagalong-fuzz.onnx"))
}

/// Runs so many mutated files, and returns the number of each outcome.
fn fuzz(seed: u64, rounds: u64) -> BTreeMap<&'static str, u64> {
    let seeds = [files("models"), files("corpus")].concat();
    let mut random = Random(seed.max(1));
    let mut counts = BTreeMap::new();
    let path = file();
    for _ in 0..rounds {
        let mut bytes = seeds[random.below(seeds.len())].clone();
        for _ in 0..=random.below(4) {
            let other = &seeds[random.below(seeds.len())];
            bytes = mutate(&bytes, other, &mut random, 0);
        }
        fs::write(&path, &bytes).unwrap();
        let found = outcome(&path);
        let count = counts.entry(found).or_default();
        *count += 1;
        if found == "late" {
            fs::copy(&path, path.with_extension(format!("late-{count}.onnx"))).unwrap();
        }
    }
    counts
}

#[test]
fn files_that_once_did_harm_are_survived() {
    for (number, bytes) in files("corpus").into_iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("network.onnx");
        fs::write(&path, bytes).unwrap();
        assert_ne!(outcome(&path), "late", "file {number} of the corpus");
    }
}

#[test]
fn mutated_files_are_survived() {
    fn number(name: &str, usual: u64) -> u64 {
        env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
    }

    let seed = number("TAGALONG_FUZZ_SEED", 1);
    let files = number("TAGALONG_FUZZ_FILES", 1000);
    // Panics of the runtime are contained by its thread; their messages would hide all others.
    let usual = panic::take_hook();
    panic::set_hook(Box::new(|_| ()));
    let counts = fuzz(seed, files);
    panic::set_hook(usual);
    println!("{counts:?}");
    assert!(counts.get("run").is_some_and(|count| *count > 0), "{counts:?}");
    assert!(counts.get("refused").is_some_and(|count| *count > 0), "{counts:?}");
}
