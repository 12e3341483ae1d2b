//! Folder of a ride: the files that `tagalong run` writes, so that `tagalong view` shows a ride
//! like a run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tagalong_app::frame_notes::{FRAME_NOTES_TOPIC, FrameNotes};
use tagalong_app::origin::Origin;
use tagalong_app::outcome::Failure;
use tagalong_app::serialize::to_json;
use tagalong_app::timings::Timings;
use tagalong_log::write::{
    FrameNames, FrameRecord, OutputSettings, RunDir, RunTexts, TrackLog, WriteError,
};
use tagalong_pipeline::{FrameReport, ResolvedConfig};
use tagalong_render::{Overlay, OverlayData, OverlayStyle};
use tagalong_sim::ScheduledFault;
use tagalong_simulate::{CAMERA_FRAME, log_stamp};
use tagalong_trials::{Ridden, SimulatedFrame};

use crate::plan::{sha256, sha256_of_file};

/// Writer of the folder of a ride, in the same folder as its log.
pub struct RunFiles {
    tracks: TrackLog,
    overlay: Option<Overlay>,
    timings: Timings,
    log: PathBuf,
    config: FileFacts,
    seed: u64,
    /// Time of the first frame, s since the start of the scene.
    first_s: Option<f64>,
}

/// `report.json` of a ride.
#[derive(Serialize)]
struct RideReport<'a> {
    tagalong: &'static str,
    ended: &'a str,
    config: &'a FileFacts,
    seed: u64,
    log: &'a FileFacts,
    #[serde(skip_serializing_if = "Option::is_none")]
    ride: Option<&'a Ridden>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    faults: Vec<ScheduledFault>,
}

/// Name and hash of a file of a ride.
#[derive(Clone, Debug, Serialize)]
struct FileFacts {
    name: String,
    sha256: String,
}

/// Returns faults with their times since the first frame, as on the page of the ride.
fn since(first_s: f64, faults: &[ScheduledFault]) -> Vec<ScheduledFault> {
    let mut shifted = faults.to_vec();
    for fault in &mut shifted {
        fault.from_s -= first_s;
        fault.to_s -= first_s;
    }
    shifted
}

/// Returns the folder of the ride with this log: the name of the log without the extension.
pub fn folder_of(log: &Path) -> PathBuf {
    log.with_extension("")
}

/// Returns the name of that folder.
pub fn folder_name(log: &Path) -> String {
    log.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

impl RunFiles {
    /// Opens the folder for a log, in place of that of an earlier ride, with a folder of pictures
    /// if they are wanted. `name` is that of the config.
    ///
    /// # Errors
    /// A folder that cannot be created.
    pub fn create(
        log: &Path,
        name: &str,
        config: &ResolvedConfig,
        pictures: bool,
    ) -> Result<Self, WriteError> {
        // Whether logs may be replaced was checked before the first ride.
        let dir = RunDir::create(&folder_of(log), true, log)?;
        let overlay = if pictures {
            Some(Overlay::new(dir.overlay()?, OverlayStyle::default()))
        } else {
            None
        };
        let names = FrameNames {
            base: "base_link".into(),
            odom: "odom".into(),
            camera: CAMERA_FRAME.into(),
        };
        let output = OutputSettings::default();
        let tracks = TrackLog::create(dir, names, output, config.to_toml())?;
        let text = config.source().text();
        let facts = FileFacts { name: format!("{name}.toml"), sha256: sha256(text.as_bytes()) };
        Ok(Self {
            tracks,
            overlay,
            timings: Timings::default(),
            log: log.to_owned(),
            config: facts,
            seed: config.seed,
            first_s: None,
        })
    }

    /// Adds a frame with the report of the pipeline on it.
    ///
    /// # Errors
    /// A sentence that names the file.
    pub fn take(&mut self, simulated: &SimulatedFrame, report: &FrameReport) -> Result<(), String> {
        self.write(simulated, report).map_err(|error| error.to_string())?;
        let Some(overlay) = &mut self.overlay else { return Ok(()) };
        overlay.draw(&OverlayData::of(&simulated.frame, simulated.odom_from_robot, report.clone()))
    }

    fn write(
        &mut self,
        simulated: &SimulatedFrame,
        report: &FrameReport,
    ) -> Result<(), WriteError> {
        if !report.outcome.is_processed() {
            return Ok(());
        }
        self.timings.add_frame(&report.timings);
        self.first_s.get_or_insert(report.stamp.nanos() as f64 * 1e-9);
        // The clock of a ride starts at zero, that of its log does not.
        let stamp = log_stamp(report.stamp.nanos());
        let camera = &simulated.frame.camera;
        let odom_from_robot = &simulated.odom_from_robot;
        self.tracks.write(&FrameRecord {
            index: report.index,
            stamp,
            camera,
            odom_from_robot,
            is_odom_known: true,
            tracks: &report.tracks,
            joints: &report.joints(),
            target: report.target,
            command: report.command.map(|command| command.wheels),
        })?;
        let mut notes = FrameNotes::of(report, camera, odom_from_robot);
        notes.stamp_ns = stamp.nanos();
        self.tracks.write_json(FRAME_NOTES_TOPIC, stamp, &notes)
    }

    /// Completes the folder of a ride whose log is complete; `ridden` is its result, `faults` are
    /// the injected ones.
    ///
    /// # Errors
    /// A file that cannot be read or written.
    pub fn finish(
        self,
        ended: &str,
        ridden: Option<&Ridden>,
        faults: &[ScheduledFault],
    ) -> Result<(), Failure> {
        let name = self.log.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let log = FileFacts { name, sha256: sha256_of_file(&self.log)? };
        let report = RideReport {
            tagalong: env!("CARGO_PKG_VERSION"),
            ended,
            config: &self.config,
            seed: self.seed,
            log: &log,
            ride: ridden,
            faults: since(self.first_s.unwrap_or(0.0), faults),
        };
        let report = to_json("report.json", &report)?;
        let timings = to_json("timings.json", &self.timings.summary())?;
        let origin = to_json("origin.json", &Origin::of(&self.log, None))?;
        let about = BTreeMap::from([
            ("version".into(), env!("CARGO_PKG_VERSION").into()),
            ("seed".into(), self.seed.to_string()),
            ("config_sha256".into(), self.config.sha256.clone()),
            ("log_sha256".into(), log.sha256.clone()),
        ]);
        let texts = RunTexts { report: &report, timings: &timings, origin: &origin };
        self.tracks.finish(about, &texts)?;
        Ok(())
    }
}
