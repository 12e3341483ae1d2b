use std::path::Path;

use serde::Serialize;
use tagalong_app::signals::Signals;
use tagalong_log::write::WriteError;
use tagalong_pipeline::FrameReport;
use tagalong_sim::{Event, Scene, ScheduledFault, Simulation};
use tagalong_simulate::Recorder;
use tagalong_trials::{Ridden, SimulatedFrame, Tick, TrialError, Witness};

use super::ride_bar::RideBar;
use super::run_files::RunFiles;

/// Writer of a ride's log and of its folder, if they are requested; it ends the ride early after a
/// stop signal.
pub struct RideLog {
    recorder: Option<Recorder>,
    files: Option<RunFiles>,
    bar: Option<RideBar>,
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
    /// Creates a writer to a file, if there is one.
    pub fn new(file: Option<&Path>, scene: &Scene, signals: Signals) -> Self {
        // This simulation only provides the cameras' poses; the ride runs its own.
        let recorder = file.map(|it| Recorder::create(it, scene, &Simulation::new(scene, 1)));
        let (recorder, failed) = match recorder.transpose() {
            Ok(recorder) => (recorder, None),
            Err(error) => (None, Some(error.to_string())),
        };
        Self { recorder, files: None, bar: None, failed, signals }
    }

    /// Returns the writer with the folder of the ride as well.
    pub fn with_files(self, files: RunFiles) -> Self {
        Self { files: Some(files), ..self }
    }

    /// Returns the writer with a display of the progress.
    pub fn with_bar(self, bar: RideBar) -> Self {
        Self { bar: Some(bar), ..self }
    }

    /// Completes the log, then the folder with the result of the ride, if it has one, and with the
    /// injected faults.
    ///
    /// # Errors
    /// The first write error.
    pub fn finish(
        self,
        ridden: Option<&Ridden>,
        faults: &[ScheduledFault],
    ) -> Result<(), TrialError> {
        let finished = self.recorder.map_or(Ok(()), Recorder::finish);
        if let Some(error) = self.failed.or(finished.err().map(|error| error.to_string())) {
            return Err(TrialError::Witness(error));
        }
        let ended = match self.signals.received() {
            Some(signal) => format!("stopped by signal {signal}"),
            None => "complete".into(),
        };
        let Some(files) = self.files else { return Ok(()) };
        files.finish(&ended, ridden, faults).map_err(|failure| TrialError::Witness(failure.message))
    }

    fn note(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), WriteError>) {
        let Some(recorder) = self.recorder.as_mut().filter(|_| self.failed.is_none()) else {
            return;
        };
        self.failed = write(recorder).err().map(|error| error.to_string());
    }
}

impl Witness for RideLog {
    fn event(&mut self, event: &Event) {
        self.note(|recorder| recorder.write(event));
    }

    fn frame(&mut self, simulated: &SimulatedFrame, report: &FrameReport) {
        let at_ns = simulated.frame.stamp.nanos();
        self.note(|recorder| recorder.pursuit(at_ns, &frame_json(report)));
        if let Some(files) = self.files.as_mut().filter(|_| self.failed.is_none()) {
            self.failed = files.take(simulated, report).err();
        }
    }

    fn tick(&mut self, tick: &Tick) {
        if let Some(bar) = &mut self.bar {
            bar.show(tick.at_s);
        }
    }

    fn goes_on(&self) -> bool {
        // A ride without its log is useless, so a failure of the disk ends it.
        self.failed.is_none() && self.signals.received().is_none()
    }

    fn uses_images(&self) -> bool {
        self.recorder.is_some() || self.files.is_some()
    }
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
