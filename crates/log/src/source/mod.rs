//! Second pass over a log, which makes the frames.

mod align;
mod assemble;
mod assembly;
mod changes;
mod intake;
mod live;
mod mount;
mod parts;
mod plan;
mod restamp;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use assembly::{Assembly, Messages};
pub use live::{Listening, LiveSource};
pub(crate) use mount::robot_frame;
use nalgebra::Isometry2;
use parts::PartsWalker;
use plan::{plan, tally_of};
use serde::Serialize;
use tagalong_config::path_text;
use tagalong_core::Frame;

use crate::scan::Scan;
use crate::{InputAccount, InputSettings, Inputs, Limits, LogError};

/// Frame with the pose of the robot.
pub struct LogFrame {
    /// The frame. Its index counts, from 1 in the order of their stamps, the images (or scans) from
    /// which frames are made, including unusable ones.
    pub frame: Frame,
    /// Pose of the robot in the odometry frame; the identity without odometry.
    pub odom_from_robot: Isometry2<f64>,
    /// True if the pose is a guess, after a long gap in the odometry or a jump.
    pub odom_stale: bool,
}

impl AsRef<Frame> for LogFrame {
    fn as_ref(&self) -> &Frame {
        &self.frame
    }
}

/// Properties of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LogFacts {
    /// Path of the file.
    #[serde(serialize_with = "path_text::serialize")]
    pub path: PathBuf,
    /// Size of the file, bytes; that of the unpacked file if it is compressed, like the hash.
    pub bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Topic of the colour or left images.
    pub colour_topic: Option<String>,
    /// Topic of the depth images.
    pub depth_topic: Option<String>,
    /// Topic of the right images.
    pub right_topic: Option<String>,
    /// Topic of the odometry.
    pub odometry_topic: Option<String>,
    /// Topic of a laser scanner's scans.
    pub laser_topic: Option<String>,
    /// Topics of the sensors that other crates define, keyed by the names of their inputs.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub sensor_topics: BTreeMap<&'static str, String>,
    /// Topics of the further obstacle sources, keyed by the names of the sources.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub obstacle_topics: BTreeMap<String, String>,
    /// Frame id of the images.
    pub camera_frame: Option<String>,
    /// Topic of the calibration of the frames.
    pub calibration_topic: Option<String>,
    /// Robot frame in tf.
    pub robot_frame: String,
    /// Columns of the images.
    pub width: usize,
    /// Rows of the images.
    pub height: usize,
    /// Focal length along columns, pixels.
    pub focal_px: f64,
    /// Baseline: distance of the right camera from the left one, m.
    pub baseline_m: Option<f64>,
    /// Height of the camera above the floor at the first frame, m.
    pub camera_height_m: f64,
    /// Angle of the optical axis below the horizon, degrees.
    pub camera_pitch_down_deg: f64,
    /// Roll of the camera, degrees; positive if its right side is raised.
    pub camera_roll_deg: f64,
    /// Source of the height, the pitch and the roll.
    pub camera_source: String,
}

/// Frames of a log, one after the other.
pub struct FrameSource {
    walker: PartsWalker,
    assembly: Assembly,
    facts: LogFacts,
    first: Option<LogFrame>,
}

impl FrameSource {
    /// Opens a log: reads it once without decoding images, chooses topics and determines the pose
    /// of the camera.
    ///
    /// # Errors
    /// [`LogError`]: the file cannot be read, a calibration cannot be used, or the log lacks an
    /// input or topic that `inputs` or `input` requires.
    pub fn open(
        path: &Path,
        input: &InputSettings,
        limits: &Limits,
        inputs: Inputs,
    ) -> Result<Self, LogError> {
        input.check()?;
        let scan = Arc::new(Scan::read(path, input.depth_unit_m, limits)?);
        Self::of_scan(scan, input, limits, inputs)
    }

    /// Opens a log as [`FrameSource::open`] does, after its first pass.
    pub(crate) fn of_scan(
        scan: Arc<Scan>,
        input: &InputSettings,
        limits: &Limits,
        inputs: Inputs,
    ) -> Result<Self, LogError> {
        let mut tally = tally_of(&scan);
        let plan = plan(Arc::clone(&scan), input, limits, inputs, &mut tally, &|| {
            Ok(Box::new(PartsWalker::new(&scan, limits)?) as Box<dyn Messages>)
        })?;
        let mut source = Self {
            walker: PartsWalker::new(&scan, limits)?,
            assembly: Assembly::new(plan, tally),
            facts: LogFacts::default(),
            first: None,
        };
        // Read in advance, because the properties of the camera are known only after a frame.
        source.first = source.advance();
        if let (None, Some(misfit)) = (&source.first, source.assembly.misfit()) {
            return Err(source.assembly.plan.misfit(misfit.clone()));
        }
        source.facts = source.assembly.facts();
        Ok(source)
    }

    /// Returns the next frame in the order of stamps; `None` at the end.
    pub fn next_frame(&mut self) -> Option<LogFrame> {
        self.first.take().or_else(|| self.advance())
    }

    fn advance(&mut self) -> Option<LogFrame> {
        let was_over = self.assembly.has_ended();
        let frame = self.assembly.read(&mut self.walker);
        if self.assembly.has_ended() && !was_over {
            self.check_whole();
        }
        frame
    }

    /// Checks at the end that the file has not changed since it was opened.
    fn check_whole(&mut self) {
        let Assembly { plan, tally, .. } = &mut self.assembly;
        if self.walker.data_lost() && !plan.scan.data_lost {
            let notes = self.walker.notes();
            tally.lose("log_changed_while_read", || {
                format!("the file was undamaged when it was opened, but is damaged now: {notes}")
            });
        }
    }

    /// Returns the fraction of the file that has been read, 0 to 1.
    pub fn progress(&self) -> f64 {
        let bytes = self.assembly.plan.scan.bytes.max(1);
        if self.assembly.has_ended() {
            1.0
        } else {
            (self.walker.position() as f64 / bytes as f64).min(1.0)
        }
    }

    /// Returns the counters so far: damage of the file, and skipped images by reason.
    pub fn counters(&self) -> &BTreeMap<&'static str, u64> {
        &self.assembly.tally.counters
    }

    /// Returns the remarks about the log, each of them once.
    pub fn notes(&self) -> &[String] {
        &self.assembly.tally.notes
    }

    /// Returns the remarks about what was lost, each one once. They are among [`FrameSource::notes`].
    pub fn losses(&self) -> &[String] {
        &self.assembly.tally.losses
    }

    /// Returns the remarks on images that make no frame although nothing was lost. They are among
    /// [`FrameSource::notes`], and there are none before the end of the log.
    pub fn frameless(&self) -> &[String] {
        &self.assembly.tally.frameless
    }

    /// Returns true if some part of the log could not be used because it is damaged.
    pub fn data_lost(&self) -> bool {
        self.assembly.tally.lost
    }

    /// Returns the remark about the first loss since the log was opened, which may be the cause of
    /// other losses.
    pub fn first_loss(&self) -> Option<&str> {
        self.assembly.tally.first_loss.as_deref()
    }

    /// Returns true if there is odometry, as a topic or as transforms.
    pub fn has_odometry(&self) -> bool {
        self.assembly.plan.odom_frames.is_some()
    }

    /// Returns true if the log only has odometry that cannot be used.
    pub fn lacks_usable_odometry(&self) -> bool {
        let plan = &self.assembly.plan;
        !plan.chosen.unused_odometry.is_empty() && plan.odom_frames.is_none()
    }

    /// Returns the use of each topic, with the reasons for those that are not used.
    pub fn account(&self) -> &InputAccount {
        &self.assembly.plan.account
    }

    /// Returns the properties of the log.
    pub fn facts(&self) -> &LogFacts {
        &self.facts
    }
}
