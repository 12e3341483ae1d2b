//! Log that consists of one file, or of several: a rosbag2 folder whose recorder split the
//! recording. The parts are read one after the other, as one log.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::LogError;

/// Topic of the truth.
pub const TRUTH_TOPIC: &str = "/truth/people";

/// File of a rosbag2 folder that lists its parts.
const METADATA: &str = "metadata.yaml";
/// Extensions of the files of a rosbag2 folder.
const KINDS: [&str; 2] = ["mcap", "db3"];
/// Extensions of compressed files: that of rosbag2, and that of the command `zstd`.
const PACKED: [&str; 2] = [".zstd", ".zst"];
/// Maximum size of the metadata that is read, bytes. A list of 10,000 parts fits.
const MAX_METADATA: u64 = 1 << 20;

/// Files of one log, in the order of recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogFiles {
    parts: Vec<PathBuf>,
    missing: Vec<String>,
}

impl LogFiles {
    /// Finds the files of a log: a file itself, or the parts of a folder. A folder is one log if it
    /// contains a `metadata.yaml`, a single `.mcap` or `.db3`, or files `NAME_0.mcap`,
    /// `NAME_1.mcap`, ... with the same name. If a folder has both kinds, the MCAP files are read.
    ///
    /// # Errors
    /// [`LogError::Open`] for a path that cannot be read; [`LogError::NotAFile`] for a pipe, a
    /// device, or a folder that is not one log.
    pub fn of(path: &Path) -> Result<Self, LogError> {
        if !std::fs::metadata(path).map_err(LogError::opening(path))?.is_dir() {
            return Ok(Self { parts: vec![path.to_owned()], missing: Vec::new() });
        }
        let mut parts = parts_in(path).map_err(LogError::opening(path))?;
        // The order of directory entries depends on the file system.
        parts.sort_by_key(|part| part_number(part));
        let listed = listed_parts(&path.join(METADATA));
        // True for files that the recorder split: the same name, and a number.
        let names: Vec<&str> = parts.iter().map(|part| part_name(part)).collect();
        let is_split = names.windows(2).all(|pair| pair[0] == pair[1]);
        if parts.is_empty() || (listed.is_none() && !is_split) {
            let remedy = if parts.is_empty() {
                without_parts(path).into()
            } else {
                " of those in it".into()
            };
            let kind = "a folder, and not one log";
            return Err(LogError::NotAFile { path: path.to_owned(), kind, remedy });
        }
        // Only the file names count, because the metadata may come from another machine.
        let mut missing = listed.unwrap_or_default();
        missing.retain(|name| !parts.iter().any(|part| unpacked_name(part) == stripped(name)));
        Ok(Self { missing, parts })
    }

    /// Returns the files of the log.
    pub fn parts(&self) -> &[PathBuf] {
        &self.parts
    }

    /// Returns the names of the files that the metadata lists but that are missing.
    pub fn missing(&self) -> &[String] {
        &self.missing
    }
}

/// Opens one file of a log.
///
/// # Errors
/// [`LogError::Open`], [`LogError::NotAFile`].
pub(crate) fn open_file(path: &Path) -> Result<File, LogError> {
    let about = std::fs::metadata(path).map_err(LogError::opening(path))?;
    if about.is_file() {
        return File::open(path).map_err(LogError::opening(path));
    }
    let (kind, remedy) = if about.is_dir() {
        ("a directory", " (the .mcap or .db3 in it)")
    } else {
        ("a pipe or a device", "; a pipe can be written to a file first")
    };
    Err(LogError::NotAFile { path: path.to_owned(), kind, remedy: remedy.into() })
}

/// Tells what a folder holds that is not one log of rosbag2.
fn without_parts(folder: &Path) -> String {
    let mut remedy = ": it holds no .mcap and no .db3".to_owned();
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let bags = files.filter(|file| file.path().extension().is_some_and(|it| it == "bag")).count();
    if bags > 0 {
        remedy += &format!(", but {bags} .bag: name one of them");
    }
    remedy
}

/// Returns the name of a file without the extension of a compressed one.
fn unpacked_name(path: &Path) -> &str {
    stripped(path.file_name().and_then(|name| name.to_str()).unwrap_or_default())
}

fn stripped(name: &str) -> &str {
    PACKED.iter().find_map(|ending| name.strip_suffix(ending)).unwrap_or(name)
}

/// Returns the files of a folder that have one of the [`KINDS`]: those of the first kind that is
/// present. Players leave a compressed file beside its unpacked copy; then only the copy is
/// returned.
fn parts_in(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let files = std::fs::read_dir(folder)?.flatten().map(|entry| entry.path());
    let files: Vec<PathBuf> = files.collect();
    for kind in KINDS {
        let mut parts = Vec::new();
        for path in &files {
            let unpacked = path.with_file_name(unpacked_name(path));
            let is_twice = unpacked != *path && files.contains(&unpacked);
            if unpacked.extension().is_some_and(|it| it == kind) && !is_twice {
                parts.push(path.clone());
            }
        }
        if !parts.is_empty() {
            return Ok(parts);
        }
    }
    Ok(Vec::new())
}

/// Splits `NAME_12.mcap` into its name and its number; a name without a number has the number 0.
fn name_and_number(part: &Path) -> (&str, u64) {
    let name = unpacked_name(part);
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let split = stem.rsplit_once('_').and_then(|(name, n)| Some((name, n.parse().ok()?)));
    split.unwrap_or((stem, 0))
}

fn part_name(part: &Path) -> &str {
    name_and_number(part).0
}

/// Returns the sort key for the order of recording: the number, because `_10` comes after `_9`.
fn part_number(part: &Path) -> (u64, PathBuf) {
    (name_and_number(part).1, part.to_owned())
}

/// Returns the files that the metadata lists under `relative_file_paths`; `None` without metadata.
/// Only this list of names is read, so no YAML parser is needed.
fn listed_parts(metadata: &Path) -> Option<Vec<String>> {
    let mut text = String::new();
    open_file(metadata).ok()?.take(MAX_METADATA).read_to_string(&mut text).ok()?;
    let lines = text.lines().map(str::trim).skip_while(|line| *line != "relative_file_paths:");
    let items = lines.skip(1).map_while(|line| line.strip_prefix("- "));
    // Older recorders write the folder in front of the name.
    let names = items.filter_map(|item| item.trim_matches(['"', '\'']).rsplit('/').next());
    Some(
        names
            .filter(|name| KINDS.iter().any(|kind| stripped(name).ends_with(kind)))
            .map(str::to_owned)
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|file| fs::write(folder.path().join(file), "x").unwrap());
        folder
    }

    fn names(files: &LogFiles) -> Vec<&str> {
        files.parts.iter().map(|part| part.file_name().unwrap().to_str().unwrap()).collect()
    }

    #[test]
    fn parts_come_in_the_order_of_their_numbers() {
        let bag = folder(&["walk_10.mcap", "walk_9.mcap", "walk_0.mcap", "notes.txt"]);
        let files = LogFiles::of(bag.path()).unwrap();
        assert_eq!(names(&files), ["walk_0.mcap", "walk_9.mcap", "walk_10.mcap"]);
        assert!(files.missing().is_empty());
    }

    #[test]
    fn a_folder_of_databases_is_a_log_and_one_of_both_kinds_is_its_mcap() {
        let bag = folder(&["walk_1.db3", "walk_0.db3"]);
        assert_eq!(names(&LogFiles::of(bag.path()).unwrap()), ["walk_0.db3", "walk_1.db3"]);
        let text = "  relative_file_paths:\n    - walk_0.db3\n    - walk_2.db3\n";
        fs::write(bag.path().join(METADATA), text).unwrap();
        assert_eq!(LogFiles::of(bag.path()).unwrap().missing(), ["walk_2.db3"]);
        let both = folder(&["walk_0.db3", "walk_0.mcap"]);
        assert_eq!(names(&LogFiles::of(both.path()).unwrap()), ["walk_0.mcap"]);
    }

    #[test]
    fn compressed_parts_are_parts_and_the_unpacked_one_of_two_is_read() {
        let bag = folder(&["walk_1.db3.zstd", "walk_0.db3.zstd", "walk_0.db3", "walk_2.db3.zst"]);
        let text = "  relative_file_paths:\n    - walk_0.db3.zstd\n    - walk_1.db3\n    - \
                    walk_3.db3.zstd\n";
        fs::write(bag.path().join(METADATA), text).unwrap();
        let files = LogFiles::of(bag.path()).unwrap();
        assert_eq!(names(&files), ["walk_0.db3", "walk_1.db3.zstd", "walk_2.db3.zst"]);
        assert_eq!(files.missing(), ["walk_3.db3.zstd"]);
    }

    #[test]
    fn a_part_that_the_metadata_lists_and_that_is_not_there_is_named() {
        let bag = folder(&["walk_0.mcap", "other.mcap"]);
        let text = "rosbag2_bagfile_information:\n  relative_file_paths:\n    - bag/walk_0.mcap\n    \
                    - \"walk_1.mcap\"\n  duration:\n    - walk_2.mcap\n";
        fs::write(bag.path().join(METADATA), text).unwrap();
        let files = LogFiles::of(bag.path()).unwrap();
        assert_eq!(files.missing(), ["walk_1.mcap"]);
        assert_eq!(files.parts().len(), 2);
    }

    #[test]
    fn a_folder_of_different_logs_is_not_one_log() {
        let logs = folder(&["kitchen.mcap", "hall.mcap"]);
        let error = LogFiles::of(logs.path()).unwrap_err().to_string();
        assert!(error.contains("not one log") && error.contains("of those in it"), "{error}");
        let error = LogFiles::of(folder(&["a.txt"]).path()).unwrap_err().to_string();
        assert!(error.ends_with("holds no .mcap and no .db3"), "{error}");
        let bags = folder(&["a.bag", "b.bag", "c.txt"]);
        let error = LogFiles::of(bags.path()).unwrap_err().to_string();
        assert!(error.ends_with("no .db3, but 2 .bag: name one of them"), "{error}");
    }
}
