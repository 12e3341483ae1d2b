//! Files in the folder of a benchmark.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use tagalong_app::outcome::{Failure, write_file};
use tagalong_config::{FileLimit, read_bytes, read_text};
use tagalong_eval::Sequence;
use tagalong_report::{TaskResult, TaskTiming};

use super::plan::Task;

/// Folder of a benchmark.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

/// Contents of a result file.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Stored {
    /// Content for the report.
    pub result: TaskResult,
    /// Scored sequence, for other evaluators; absent if the task failed.
    pub recording: Option<Recording>,
    /// Images of moments in which people are missed, by frame: JPEG in base64.
    #[serde(default)]
    pub images: BTreeMap<u64, String>,
    /// Notes on the truth of the log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// Scored sequence, with the properties that the formats need in addition.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Recording {
    /// Truth and reports of all frames.
    pub sequence: Sequence,
    /// Frames per second.
    pub rate_hz: f64,
    /// Columns of the images.
    pub width: u32,
    /// Rows of the images.
    pub height: u32,
}

/// Contents of a file of times.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct StoredTiming {
    /// Hash of its task.
    #[serde(default)]
    pub hash: String,
    /// Description of the machine.
    pub machine: String,
    /// Its times.
    pub timing: TaskTiming,
}

impl Store {
    /// Returns the store of a folder, which need not exist yet.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    /// Returns the path of a file of the benchmark.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Writes a file atomically.
    ///
    /// # Errors
    /// A disk that fails.
    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        put(&self.path(name), bytes)
    }

    /// Returns the plan.
    ///
    /// # Errors
    /// If there is none, or it is damaged.
    pub fn plan(&self) -> Result<Vec<Task>, Failure> {
        let path = self.path("plan.jsonl");
        let shown = path.display();
        let text = read_text(&path, FileLimit::Table).map_err(|error| {
            Failure::usage(format!("cannot read {shown}: {error}; `tagalong bench plan` writes it"))
        })?;
        let tasks = text.lines().enumerate().map(|(index, line)| {
            serde_json::from_str(line).map_err(|error| {
                Failure::failed(format!("{shown}, line {}: {error}; plan again", index + 1))
            })
        });
        tasks.collect()
    }

    /// Returns the result of a task, if it exists, is intact, and contains the hash of this task: a
    /// file that was copied or renamed belongs to another one.
    pub fn result(&self, task: &Task) -> Option<Stored> {
        let stored: Stored = self.get(&result_name(&task.hash))?;
        let TaskResult { hash, inputs, seed, .. } = &stored.result;
        let is_own = *hash == task.hash && *inputs == task.inputs && *seed == task.seed;
        is_own.then_some(stored)
    }

    /// Stores a result.
    ///
    /// # Errors
    /// A disk that fails.
    pub fn put_result(&self, hash: &str, stored: &Stored) -> Result<(), Failure> {
        let json = serde_json::to_vec(stored).map_err(Failure::failed)?;
        self.put(&result_name(hash), &json)
    }

    /// Returns the times of a task, if they were measured and contain the hash of this task.
    pub fn timing(&self, hash: &str) -> Option<StoredTiming> {
        self.get(&timing_name(hash)).filter(|timing: &StoredTiming| timing.hash == hash)
    }

    /// Stores times.
    ///
    /// # Errors
    /// A disk that fails.
    pub fn put_timing(&self, hash: &str, timing: &StoredTiming) -> Result<(), Failure> {
        let json = serde_json::to_vec_pretty(timing).map_err(Failure::failed)?;
        self.put(&timing_name(hash), &json)
    }

    /// Returns a file of the benchmark as JSON, if it exists and is intact.
    pub fn get<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        // A damaged file counts as missing.
        serde_json::from_slice(&read_bytes(&self.path(name), FileLimit::Table).ok()?).ok()
    }
}

fn result_name(hash: &str) -> String {
    format!("results/{hash}.json")
}

fn timing_name(hash: &str) -> String {
    format!("timings/{hash}.json")
}

/// Writes under a name of this process and renames, because several processes may write the same
/// result, and all of them are right.
///
/// # Errors
/// A disk that fails.
pub fn put(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let partial = path.with_file_name(format!("{name}.{}.partial", std::process::id()));
    write_file(&partial, bytes)?;
    fs::rename(&partial, path)
        .map_err(|error| Failure::failed(format!("cannot write {}: {error}", path.display())))
}
