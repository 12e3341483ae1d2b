//! Run as it was recorded: frames with tracks, candidates and funnel, and its config.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use tagalong_app::frame_notes::{FRAME_NOTES_TOPIC, FrameNotes};
use tagalong_app::origin::Origin;
use tagalong_app::outcome::Failure;
use tagalong_config::{FileLimit, read_text};
use tagalong_log::msgs::{StringMsg, decode};
use tagalong_log::{Limits, LogWalker, read_attachment};
use tagalong_page::moment::{Moment, TrackState};
use toml::Table;

/// Topic of the tracks as JSON in `tracks.mcap`.
const TRACKS_TOPIC: &str = "/people/tracks_json";

/// Run of a pipeline over a log.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Folder of the run.
    pub folder: PathBuf,
    /// Name of the log, its hash, and the config.
    pub report: ReportFacts,
    /// Paths of the log and the config, as far as they are recorded.
    pub origin: Origin,
    /// Resolved config; empty if it cannot be read.
    pub config: Table,
    /// Frames in the order of their stamps.
    pub moments: Vec<Moment>,
}

/// Part of a run's `report.json` that is used.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct ReportFacts {
    /// End of the run.
    pub ended: String,
    /// The log.
    pub log: FileFacts,
    /// The config.
    pub config: FileFacts,
}

/// File of a run.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct FileFacts {
    /// Name without the folder.
    pub name: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// Message on [`TRACKS_TOPIC`].
#[derive(Deserialize)]
struct TracksMessage {
    stamp_ns: u64,
    target: Option<u32>,
    tracks: Vec<TrackState>,
}

impl Recording {
    /// Reads the folder of a run.
    ///
    /// # Errors
    /// A folder that is no run, or one without notes on its frames; names the remedy.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        let tracks = folder.join("tracks.mcap");
        if !tracks.is_file() {
            return Err(no_run(folder));
        }
        let report = read_json(&folder.join("report.json"))?;
        // Only the images need it, and they may be found without it.
        let origin = read_json(&folder.join("origin.json")).unwrap_or_default();
        let moments = read_moments(&tracks)?;
        let config = read_attachment(&tracks, "config.toml", &Limits::default())?;
        let text = config.and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default();
        let config = toml::from_str(&text).unwrap_or_default();
        Ok(Self { folder: folder.to_owned(), report, origin, config, moments })
    }

    /// Returns the name of its config without the ending.
    pub fn config_name(&self) -> String {
        self.report.config.name.trim_end_matches(".toml").to_owned()
    }
}

/// Returns the failure of a path that is not the folder of a run.
fn no_run(folder: &Path) -> Failure {
    let shown = folder.display();
    Failure::usage(if folder.is_file() {
        format!(
            "{shown} is a file, not the folder of a run; `tagalong run {shown}` makes one, \
             and prints its name"
        )
    } else if folder.exists() {
        format!("{shown} is no run: it has no tracks.mcap; `tagalong run LOG` makes one")
    } else {
        format!("{shown}: no such folder; `tagalong run LOG` makes one, and prints its name")
    })
}

fn read_json<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T, Failure> {
    let shown = path.display();
    let text = read_text(path, FileLimit::Table)
        .map_err(|error| Failure::failed(format!("cannot read {shown}: {error}")))?;
    serde_json::from_str(&text).map_err(|error| Failure::failed(format!("{shown}: {error}")))
}

fn read_moments(path: &Path) -> Result<Vec<Moment>, Failure> {
    let shown = path.display();
    let broken = |why: &dyn std::fmt::Display| Failure::failed(format!("{shown}: {why}"));
    // Its message names the file.
    let mut walker = LogWalker::open(path, &Limits::default()).map_err(Failure::failed)?;
    let mut by_stamp: BTreeMap<u64, Moment> = BTreeMap::new();
    let mut has_notes = false;
    while let Some(message) = walker.next() {
        let topic = message.channel.topic.as_str();
        if !matches!(topic, TRACKS_TOPIC | FRAME_NOTES_TOPIC) {
            continue;
        }
        let text: StringMsg = decode(message.data).map_err(|error| broken(&error))?;
        let unread = |error: serde_json::Error| broken(&format!("{topic}: {error}"));
        if topic == FRAME_NOTES_TOPIC {
            let notes: FrameNotes = serde_json::from_str(&text.data).map_err(unread)?;
            has_notes = true;
            let stamp = notes.stamp_ns;
            by_stamp.entry(stamp).or_default().notes = notes;
        } else {
            let read: TracksMessage = serde_json::from_str(&text.data).map_err(unread)?;
            let moment = by_stamp.entry(read.stamp_ns).or_default();
            (moment.tracks, moment.target) = (read.tracks, read.target);
        }
    }
    if !has_notes {
        return Err(Failure::failed(format!(
            "{shown} has no {FRAME_NOTES_TOPIC}: no frame was processed, or an earlier version \
             made the run; repeat it with `tagalong run ... --overwrite`"
        )));
    }
    // A file that was cut may end between the two messages of a frame.
    Ok(by_stamp.into_values().filter(|moment| moment.notes.frame > 0).collect())
}
