use std::fs;
use std::io;
use std::path::Path;

use serde::Serialize;
use tagalong_app::signals::Signals;
use tagalong_log::write::WriteError;
use tagalong_pipeline::FrameReport;
use tagalong_render::{Overlay, OverlayData, OverlayStyle};
use tagalong_sim::{Event, Scene, Simulation};
use tagalong_simulate::Recorder;
use tagalong_trials::{SimulatedFrame, TrialError, Witness};

/// Writer of a ride's log and pictures, as far as they are requested; it ends early at a stop
/// signal.
pub struct RideLog {
    recorder: Option<Recorder>,
    overlay: Option<Overlay>,
    failed: Option<String>,
    signals: Signals,
}

/// Command and reason of one frame, as a JSON text.
#[derive(Serialize)]
struct FrameJson {
    stamp_ns: u64,
    frame: u64,
    target: Option<u32>,
    state: Option<&'static str>,
    why: Option<&'static str>,
    belief: Option<f64>,
    likeness: Vec<(u32, f64)>,
    wheels_mps: Option<[f64; 2]>,
    reason: Option<&'static str>,
    valid_until_ns: Option<u64>,
}

impl RideLog {
    /// Writes to a file, if there is one.
    pub fn new(file: Option<&Path>, scene: &Scene, signals: Signals) -> Self {
        // This simulation only supplies the cameras' poses; the ride runs its own.
        let create = |path| Recorder::create(path, scene, &Simulation::new(scene, 1));
        let (recorder, failed) = match file.map(create).transpose() {
            Ok(recorder) => (recorder, None),
            Err(error) => (None, Some(error.to_string())),
        };
        Self { recorder, overlay: None, failed, signals }
    }

    /// Writes a picture of each frame into a folder, too, in place of those of an earlier ride.
    ///
    /// # Errors
    /// A folder that cannot be made or cleared.
    pub fn with_overlay(mut self, folder: &Path) -> Result<Self, TrialError> {
        clear_pictures(folder).map_err(|error| {
            let shown = folder.display();
            TrialError::Witness(format!("cannot make the folder {shown} for pictures: {error}"))
        })?;
        self.overlay = Some(Overlay::new(folder.to_owned(), OverlayStyle::default()));
        Ok(self)
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The first error in writing.
    pub fn finish(self) -> Result<(), TrialError> {
        let finished = self.recorder.map_or(Ok(()), Recorder::finish);
        let failed = self.failed.or(finished.err().map(|error| error.to_string()));
        failed.map_or(Ok(()), |error| Err(TrialError::Witness(error)))
    }

    fn note(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), WriteError>) {
        let Some(recorder) = self.recorder.as_mut().filter(|_| self.failed.is_none()) else {
            return;
        };
        self.failed = write(recorder).err().map(|error| error.to_string());
    }

    fn draw(&mut self, simulated: &SimulatedFrame, report: &FrameReport) {
        let Some(overlay) = self.overlay.as_mut().filter(|_| self.failed.is_none()) else {
            return;
        };
        let scene = OverlayData::of(&simulated.frame, simulated.odom_from_robot, report.clone());
        self.failed = overlay.draw(&scene).err();
    }
}

impl Witness for RideLog {
    fn event(&mut self, event: &Event) {
        self.note(|recorder| recorder.write(event));
    }

    fn frame(&mut self, simulated: &SimulatedFrame, report: &FrameReport) {
        let at_ns = simulated.frame.stamp.nanos();
        self.note(|recorder| recorder.pursuit(at_ns, &frame_json(report)));
        self.draw(simulated, report);
    }

    fn goes_on(&self) -> bool {
        // A ride without its log is of no use, so a failed disk ends it.
        self.failed.is_none() && self.signals.received().is_none()
    }
}

/// Makes the folder, or removes the pictures of an earlier ride from it, which could be longer.
fn clear_pictures(folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let is_numbered = stem.len() >= 6 && stem.bytes().all(|byte| byte.is_ascii_digit());
        if is_numbered && path.extension().is_some_and(|ending| ending == "png") {
            fs::remove_file(path)?;
        }
    }
    Ok(())
}

fn frame_json(report: &FrameReport) -> FrameJson {
    let command = report.command.as_ref();
    let lock = report.lock.as_ref();
    let likeness = lock.iter().flat_map(|lock| &lock.likeness);
    FrameJson {
        stamp_ns: report.stamp.nanos(),
        frame: report.index,
        target: report.target.map(|id| id.0),
        state: lock.map(|lock| lock.state.name()),
        why: lock.map(|lock| lock.why),
        belief: lock.and_then(|lock| lock.belief),
        likeness: likeness.map(|like| (like.track.0, like.probability)).collect(),
        wheels_mps: command.map(|command| [command.wheels.left, command.wheels.right]),
        reason: command.map(|command| command.reason.name()),
        valid_until_ns: command.map(|command| command.valid_until.nanos()),
    }
}
