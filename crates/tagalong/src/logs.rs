//! Frames of a log for a pipeline.

use std::path::{Path, PathBuf};

use tagalong_log::{
    FrameSource, InputSettings, Inputs, Limits, LogError, LogFrame, ObstacleKind, ObstacleTopic,
};
use tagalong_pipeline::{Pipeline, ResolvedConfig, SourceKind, SourceSettings, Sources};

use crate::{Error, Result};

/// A log: an MCAP file, a rosbag2 database or folder, or a ROS 1 bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Log {
    path: PathBuf,
}

/// Settings with which a log is read, taken from the config of a pipeline.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LogSettings {
    /// `[input]`: topics and frames of the images, with the sources of obstacles that the collision
    /// monitor uses.
    pub input: InputSettings,
    /// `[limits]`: maximum sizes of the parts of a log.
    pub limits: Limits,
}

/// Frames of a log, one after the other. If part of the log was lost, the last item is an error that
/// says so, unless [`Frames::accept_loss`] was called.
pub struct Frames {
    log: PathBuf,
    source: FrameSource,
    accepts_loss: bool,
    has_ended: bool,
}

impl Log {
    /// Opens a log.
    ///
    /// # Errors
    /// [`LogError::Open`] if there is no such file or folder.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref().to_owned();
        match path.metadata() {
            Ok(_) => Ok(Self { path }),
            Err(source) => Err(LogError::Open { path, source }.into()),
        }
    }

    /// Returns the path of the log.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the frames for a pipeline: with the inputs that it declares, read with `[input]` and
    /// `[limits]` of its config. The log is scanned once without decoding images, so that missing
    /// inputs are known before the first frame.
    ///
    /// # Errors
    /// A log that lacks a topic or a calibration, a mistake in the two tables, and a controller
    /// without an obstacle sensor or without odometry.
    pub fn frames(&self, pipeline: &Pipeline) -> Result<Frames> {
        let frames = self.frames_for(pipeline, pipeline.inputs())?;
        pipeline.check_sources(frames.sources())?;
        Ok(frames)
    }

    /// Returns the frames as [`Log::frames`] does, with other inputs than those that the pipeline
    /// declares, for a caller that uses more images. The caller has to check with
    /// [`Pipeline::check_sources`] that a controller has its sources of data.
    ///
    /// # Errors
    /// As for [`Log::frames`].
    pub fn frames_for(&self, pipeline: &Pipeline, inputs: Inputs) -> Result<Frames> {
        let settings = LogSettings::of(pipeline)?;
        let source = FrameSource::open(&self.path, &settings.input, &settings.limits, inputs)
            .map_err(|error| refusal(error, pipeline.config()))?;
        Ok(Frames::new(&self.path, source))
    }
}

impl LogSettings {
    /// Returns the settings for logs in the config of a pipeline.
    ///
    /// # Errors
    /// A mistake in `[input]` or `[limits]`, with the line and the remedy.
    pub fn of(pipeline: &Pipeline) -> Result<Self> {
        let config = pipeline.config();
        let mut input: InputSettings = config.table("input")?;
        input.sources = pipeline.obstacle_sources().iter().map(obstacle_topic).collect();
        Ok(Self { input, limits: config.table("limits")? })
    }
}

impl Frames {
    /// Returns the frames of a source that is already open.
    pub fn new(log: impl AsRef<Path>, source: FrameSource) -> Self {
        let log = log.as_ref().to_owned();
        Self { log, source, accepts_loss: false, has_ended: false }
    }

    /// Accepts a log that is partly lost: the frames then end without an error.
    pub fn accept_loss(mut self) -> Self {
        self.accepts_loss = true;
        self
    }

    /// Returns the sources of data that the log offers to a controller.
    pub fn sources(&self) -> Sources {
        sources_of(&self.source)
    }

    /// Returns the reader of the log: its properties, counters and notes.
    pub fn source(&self) -> &FrameSource {
        &self.source
    }
}

impl Iterator for Frames {
    type Item = Result<LogFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some(frame) = self.source.next_frame() {
            return Some(Ok(frame));
        }
        let is_silent = self.has_ended || self.accepts_loss || !self.source.data_lost();
        self.has_ended = true;
        if is_silent {
            return None;
        }
        let notes = self.source.notes().join("; ");
        Some(Err(Error::Damaged { log: self.log.clone(), notes }))
    }
}

/// Returns the sources of data that a log offers to a controller.
pub fn sources_of(source: &FrameSource) -> Sources {
    let facts = source.facts();
    Sources {
        depth: facts.depth_topic.is_some(),
        right: facts.right_topic.is_some(),
        laser: facts.laser_topic.is_some(),
        odometry: source.has_odometry(),
    }
}

/// Returns the error for a log that does not fit a config. For a topic of the wrong kind it shows
/// the line of the config that names it.
pub fn refusal(error: LogError, config: &ResolvedConfig) -> Error {
    let (LogError::WrongTopic { key, .. } | LogError::UnknownTopic { key, .. }) = &error else {
        return error.into();
    };
    match config.mistake_at(&format!("input.{key}"), &error.to_string()) {
        Some(mistake) => mistake.into(),
        None => error.into(),
    }
}

/// Returns the topic of an obstacle source.
fn obstacle_topic(source: &SourceSettings) -> ObstacleTopic {
    ObstacleTopic {
        name: source.name.clone(),
        kind: match source.kind {
            SourceKind::Scan => ObstacleKind::Scan,
            SourceKind::Depth => ObstacleKind::Depth,
            SourceKind::Range => ObstacleKind::Range,
            SourceKind::Bumper => ObstacleKind::Bumper,
        },
        topic: source.topic.clone(),
        info_topic: Some(source.info_topic.clone()).filter(|topic| !topic.is_empty()),
        mount: source.mount,
    }
}
