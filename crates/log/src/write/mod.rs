//! Files of a run: `tracks.mcap`, `tracks.csv`, `tracks-metres.csv`, `report.json`, `timings.json`
//! and `origin.json`, `joints.csv` if a detector finds joints, and `tracks-smoothed.csv` if it is
//! requested.
//!
//! All are written under partial names and get their final names together at the end of the run, so
//! that the files of a crash are never mistaken for a result. At least once per second of log time
//! everything written so far is passed to the operating system, so that a killed run loses no more
//! than that. The contents do not depend on the time of day: the same frames give the same bytes.

mod body;
mod colours;
mod csv;
mod error;
mod mcap_tracks;
mod message_log;
mod messages;
mod record;
mod run_dir;
mod scene;
mod smoothed;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod trails;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

pub use colours::{TRACK_COLOURS, track_colour};
pub use csv::METRES_HEADER;
pub use error::WriteError;
pub use mcap_tracks::FrameNames;
use mcap_tracks::McapTracks;
pub use message_log::MessageLog;
pub use messages::{detections, people, person_transforms, pose};
pub use record::{BoxedPart, FrameRecord, OutputSettings};
pub use run_dir::RunDir;
pub use scene::{markers, no_markers};
use serde::Serialize;
use smoothed::Correction;
use tagalong_core::{Stamp, TrackId};
pub use trails::Trails;

/// Log time after which everything written is flushed, s.
const FLUSH_EVERY_S: f64 = 1.0;

/// Small files of a run, written at its end.
#[derive(Clone, Copy, Debug)]
pub struct RunTexts<'a> {
    /// `report.json`: results, the same for the same log, config and seed.
    pub report: &'a str,
    /// `timings.json`: processing times, different in each run.
    pub timings: &'a str,
    /// `origin.json`: paths of the log and the config, which depend on the machine.
    pub origin: &'a str,
}

/// Writer of the tracks of a run, frame by frame.
pub struct TrackLog {
    dir: RunDir,
    output: OutputSettings,
    mcap: McapTracks<BufWriter<File>>,
    boxes: BufWriter<File>,
    metres: BufWriter<File>,
    /// Opened when the first joints arrive.
    joints: Option<BufWriter<File>>,
    /// Corrections of wrong IDs, for `tracks-smoothed.csv`; `None` if that file is not wanted.
    corrections: Option<Vec<Correction>>,
    flushed: Option<Stamp>,
}

impl TrackLog {
    /// Opens the files. `config` is the resolved config, which is attached to the log.
    ///
    /// # Errors
    /// [`WriteError`], which names the file.
    pub fn create(
        mut dir: RunDir,
        frames: FrameNames,
        output: OutputSettings,
        config: &str,
    ) -> Result<Self, WriteError> {
        let mcap = McapTracks::new(dir.open("tracks.mcap")?, frames, config)
            .map_err(WriteError::mcap(&dir.path().join("tracks.mcap")))?
            .with_boxes(output.boxes);
        let boxes = dir.open("tracks.csv")?;
        let mut metres = dir.open("tracks-metres.csv")?;
        writeln!(metres, "{METRES_HEADER}").map_err(WriteError::io(dir.path()))?;
        Ok(Self {
            dir,
            output,
            mcap,
            boxes,
            metres,
            joints: None,
            corrections: None,
            flushed: None,
        })
    }

    /// Adds `tracks-smoothed.csv` to the files: `tracks.csv` with the IDs corrected that later
    /// frames show to be wrong. It is not an online result.
    #[must_use]
    pub fn with_smoothed(mut self) -> Self {
        self.corrections = Some(Vec::new());
        self
    }

    /// Notes that two IDs are exchanged in frames before `noticed`, from `since` on.
    pub fn correct(&mut self, since: u64, noticed: u64, ids: [TrackId; 2]) {
        let correction = Correction { frames: since..noticed, ids: ids.map(|id| id.0) };
        self.corrections.iter_mut().for_each(|all| all.push(correction.clone()));
    }

    /// Returns the directory of the run.
    pub fn dir(&self) -> &RunDir {
        &self.dir
    }

    /// Writes one frame.
    ///
    /// # Errors
    /// [`WriteError`]; the track log must not be used after one.
    pub fn write(&mut self, record: &FrameRecord<'_>) -> Result<(), WriteError> {
        self.mcap.write(record).map_err(WriteError::mcap(&self.file("tracks.mcap")))?;
        csv::boxes(&mut self.boxes, record, &self.output)
            .map_err(WriteError::io(&self.file("tracks.csv")))?;
        csv::metres(&mut self.metres, record)
            .map_err(WriteError::io(&self.file("tracks-metres.csv")))?;
        self.write_joints(record)?;
        let due =
            // The absolute value, because the stamps of a log may jump back.
            self.flushed.is_none_or(|last| record.stamp.seconds_since(last).abs() >= FLUSH_EVERY_S);
        if due { self.flush(record.stamp) } else { Ok(()) }
    }

    fn write_joints(&mut self, record: &FrameRecord<'_>) -> Result<(), WriteError> {
        if record.joints.is_empty() {
            return Ok(());
        }
        let path = self.file("joints.csv");
        if self.joints.is_none() {
            let mut out = self.dir.open("joints.csv")?;
            writeln!(out, "{}", csv::JOINTS_HEADER).map_err(WriteError::io(&path))?;
            self.joints = Some(out);
        }
        match &mut self.joints {
            Some(out) => csv::joints(out, record).map_err(WriteError::io(&path)),
            None => Ok(()),
        }
    }

    /// Writes a value as a JSON text to a topic of `tracks.mcap`; `at` is the stamp of its frame.
    ///
    /// # Errors
    /// [`WriteError`], also for a value that JSON cannot express.
    pub fn write_json<T: Serialize>(
        &mut self,
        topic: &str,
        at: Stamp,
        value: &T,
    ) -> Result<(), WriteError> {
        let path = self.file("tracks.mcap");
        let text = serde_json::to_string(value)
            .map_err(|why| io::Error::other(format!("a message of {topic} as JSON: {why}")))
            .map_err(WriteError::io(&path))?;
        self.mcap.write_text(topic, at, text).map_err(WriteError::mcap(&path))
    }

    /// Writes a JPEG as the image of a frame to `tracks.mcap`; `at` is the stamp of the frame.
    ///
    /// # Errors
    /// [`WriteError::Mcap`].
    pub fn write_image(&mut self, at: Stamp, jpeg: &[u8]) -> Result<(), WriteError> {
        let path = self.file("tracks.mcap");
        self.mcap.write_image(at, jpeg).map_err(WriteError::mcap(&path))
    }

    fn flush(&mut self, now: Stamp) -> Result<(), WriteError> {
        self.flushed = Some(now);
        self.mcap.flush().map_err(WriteError::mcap(&self.file("tracks.mcap")))?;
        self.flush_text()
    }

    fn flush_text(&mut self) -> Result<(), WriteError> {
        self.boxes.flush().map_err(WriteError::io(&self.file("tracks.csv")))?;
        self.metres.flush().map_err(WriteError::io(&self.file("tracks-metres.csv")))?;
        let path = self.file("joints.csv");
        self.joints.iter_mut().try_for_each(|out| out.flush()).map_err(WriteError::io(&path))
    }

    /// Completes the files, adds the report, the timings, the origin and `about` (as metadata of
    /// the log), and gives all files their final names. Returns the directory.
    ///
    /// # Errors
    /// [`WriteError`]; the partial files are kept.
    pub fn finish(
        mut self,
        about: BTreeMap<String, String>,
        texts: &RunTexts<'_>,
    ) -> Result<PathBuf, WriteError> {
        self.flush_text()?;
        if let Some(corrections) = &self.corrections {
            let path = self.file("tracks.csv");
            let boxes = File::open(&path).map_err(WriteError::io(&path))?;
            let mut out = self.dir.open("tracks-smoothed.csv")?;
            smoothed::write(BufReader::new(boxes), corrections, &mut out)
                .map_err(WriteError::io(&self.file("tracks-smoothed.csv")))?;
        }
        let mcap = self.file("tracks.mcap");
        self.mcap.finish(about).map_err(WriteError::mcap(&mcap))?;
        self.dir.put("report.json", texts.report.as_bytes())?;
        self.dir.put("timings.json", texts.timings.as_bytes())?;
        self.dir.put("origin.json", texts.origin.as_bytes())?;
        let path = self.dir.path().to_owned();
        self.dir.publish()?;
        Ok(path)
    }

    /// Removes the files that were written, and then the directory if it is empty: for a run that
    /// failed before its first frame.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn discard(self) -> Result<(), WriteError> {
        self.dir.discard()
    }

    fn file(&self, name: &str) -> PathBuf {
        Path::new(self.dir.path()).join(run_dir::partial(name))
    }
}
