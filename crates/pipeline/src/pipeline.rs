use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::Isometry3;
use tagalong_core::{Command, Frame, Inputs, PointCloud, Reason, Stamp};
use tagalong_tracking::StepError;
use tagalong_tracking::{Identities, Outcome, Tracked, Tracker};

use crate::{
    Enrollment, EnrollmentError, FollowStatus, FrameReport, Orders, PipelineSettings,
    ResolvedConfig,
};
use tagalong_following::{
    BlindZone, EnableSwitch, SafetyDistances, SourceSettings, Steered, Steering,
};
use tagalong_geometry::Camera;
use tagalong_vision::Describer;

/// Tracker, with the controller that drives the robot after one of its tracks.
pub struct Pipeline {
    pub(crate) settings: PipelineSettings,
    pub(crate) inputs: Inputs,
    pub(crate) tracker: Tracker,
    pub(crate) steering: Option<Steering>,
    pub(crate) describer: Describer,
    pub(crate) config: ResolvedConfig,
    pub(crate) failed: Option<u64>,
}

/// Stages that [`FrameReport::timings`] names: those of the tracker, then the controller.
const STAGES: [&str; 9] = {
    let [preprocess, predict, track, discover, associate, update, manage, learn] =
        tagalong_tracking::STAGES;
    [preprocess, predict, track, discover, associate, update, manage, learn, "control"]
};

impl Pipeline {
    /// Takes one frame through the pipeline. Data of the frame beyond [`Pipeline::inputs`] is
    /// ignored. From a frame with [`Frame::calibration_changed`] on, the tracks stay where they were
    /// and the robot stands, also after [`Pipeline::arm`]. At a frame with
    /// [`Frame::odometry_jumped`] the robot stops until [`Pipeline::arm`].
    ///
    /// # Errors
    /// [`StepError::Lacks`] for a frame without an input that a plugin requires: no plugin sees it, the
    /// last command ends at once, and the next frame is taken as usual. Another [`StepError`] if a
    /// plugin fails or panics: the pipeline is stopped then, and each further call fails.
    pub fn step(&mut self, frame: impl AsRef<Frame>) -> Result<FrameReport, StepError> {
        self.step_frame(frame.as_ref())
    }

    fn step_frame(&mut self, frame: &Frame) -> Result<FrameReport, StepError> {
        if let Some(failed) = self.failed {
            return Err(StepError::Stopped { frame: failed });
        }
        // Before the frame is processed, so that the command of this very frame is a stop.
        if frame.odometry_jumped {
            self.disarm("odometry jumped");
        }
        let mut restricted = frame.restricted_to(&self.inputs);
        if let (true, Ok(cloud)) = (self.inputs.are_of_points(), frame.sensor::<PointCloud>()) {
            // No person leaves the view at the edge of an image that is not used.
            let at = Isometry3::from(cloud.scanner.coords);
            let used = restricted.as_ref().unwrap_or(frame);
            restricted = Some(used.with_camera(Arc::new(Camera::blind(at))));
        }
        let report = self
            .process(restricted.as_ref().unwrap_or(frame))
            .map_err(|error| error.blame_declaration(frame));
        match &report {
            Ok(_) => {}
            Err(StepError::Lacks { .. }) => {
                if let Some(steering) = &mut self.steering {
                    steering.pass_over(frame);
                }
            }
            Err(_) => {
                self.failed = Some(frame.index);
                self.disarm("a plugin failed");
            }
        }
        report
    }

    /// Returns the inputs that the plugins and the stages declare, without those that the config
    /// excludes: the frame source need not read others.
    pub fn inputs(&self) -> Inputs {
        self.inputs
    }

    /// Returns the command in force at a time, by the clock of the frames' stamps: the last command
    /// until it expires, zero after that, after a fault and before the first frame. A control loop
    /// asks at its own rate. `None` without a controller.
    ///
    /// A command also ends by the age of its frame on the monotonic clock of this machine, whatever
    /// `now` says; see [`Orders::at`].
    pub fn command_at(&self, now: Stamp) -> Option<Command> {
        Some(self.orders()?.at(now))
    }

    /// Returns the command in force as [`Pipeline::command_at`], in simulated time: `since_frame` is
    /// the time since the last frame that led to a command.
    pub fn command_after(&self, now: Stamp, since_frame: Duration) -> Option<Command> {
        Some(self.orders()?.after(now, since_frame))
    }

    /// Returns the distances that follow from the settings of the robot; `None` without a controller.
    pub fn safety_distances(&self) -> Option<SafetyDistances> {
        self.has_controller().then(|| SafetyDistances::of(&self.settings.following()))
    }

    /// Returns the region around the robot that a camera does not see; `None` without a controller.
    pub fn blind_zone(&self, camera: &Camera) -> Option<BlindZone> {
        self.has_controller().then(|| BlindZone::of(&self.settings.following(), camera))
    }

    /// Returns the further sources of obstacles of `[[collision_monitor.sources]]`; none without a
    /// controller.
    pub fn obstacle_sources(&self) -> &[SourceSettings] {
        match &self.steering {
            Some(_) => &self.settings.collision_monitor.sources,
            None => &[],
        }
    }

    /// Returns a copy of the state behind [`Pipeline::command_at`], for use in another thread.
    pub fn orders(&self) -> Option<Orders> {
        Some(self.steering.as_ref()?.orders())
    }

    /// Returns a latched switch, whose enable holds for the time of the config, for a program that
    /// drives a robot; `None` without a controller.
    pub fn enable_switch(&self) -> Option<EnableSwitch> {
        let timeout = Duration::from_secs_f64(self.settings.command_limiter.enable_s);
        self.has_controller().then(|| EnableSwitch::new(timeout))
    }

    /// Follows the person of a request from the next frame on, and forgets the previous one.
    ///
    /// # Errors
    /// [`EnrollmentError`] if the person is not there, a time of the request is beyond its bounds, or
    /// there is no controller. The robot goes on as before.
    pub fn enroll(&mut self, enrollment: &Enrollment) -> Result<(), EnrollmentError> {
        self.steering.as_mut().ok_or(EnrollmentError::NoController)?.enroll(enrollment)
    }

    /// Forgets the person, and follows none until the next [`Pipeline::enroll`]: the robot slows down
    /// and stands.
    pub fn clear(&mut self) {
        if let Some(steering) = &mut self.steering {
            steering.clear();
        }
    }

    /// Limits the speed to this, m/s, beside all limits of the config, until the next call; infinite
    /// for no limit. A planner asks for it, in a crowd or near a door.
    pub fn allow_speed(&mut self, most_mps: f64) {
        if let Some(steering) = &mut self.steering {
            steering.allow_speed(most_mps);
        }
    }

    /// Tells whether the base executes the commands from now on; not at the start, because a log was
    /// driven by others. Only then can the commands be compared with the odometry: a base that does
    /// something else (wheels that are stuck, another driver), or responds too late, is a fault. A base
    /// that begins to execute the commands starts from rest, whatever they were before.
    pub fn set_driving(&mut self, is_driving: bool) {
        if let Some(steering) = &mut self.steering {
            steering.set_driving(is_driving);
        }
    }

    /// Returns the state of the pursuit after the last frame, and the people to choose from; `None`
    /// without a controller.
    pub fn status(&self) -> Option<FollowStatus> {
        Some(self.steering.as_ref()?.status())
    }

    /// Returns true if the config has a controller: frames lead to commands.
    pub fn has_controller(&self) -> bool {
        self.steering.is_some()
    }

    /// Returns the distance that the controller keeps from the person, m, if there is a controller
    /// and it keeps one.
    pub fn stand_off_m(&self) -> Option<f64> {
        self.steering.as_ref()?.stand_off_m()
    }

    /// Returns the fault that holds the robot until [`Pipeline::arm`], if there is one.
    pub fn fault(&self) -> Option<&'static str> {
        self.steering.as_ref()?.fault()
    }

    /// Stops the robot until [`Pipeline::arm`]: after a press of a stop button, or a fault that no
    /// frame shows.
    pub fn disarm(&mut self, why: &'static str) {
        if let Some(steering) = &mut self.steering {
            steering.disarm(why);
        }
    }

    /// Lets the robot move again after a fault that a person has checked. A plugin that failed
    /// stays stopped, and with it the pipeline.
    pub fn arm(&mut self) {
        // A failed plugin may hold broken state, so a pipeline with one is never armed again.
        if let Some(steering) = self.steering.as_mut().filter(|_| self.failed.is_none()) {
            steering.arm();
        }
    }

    /// Turns [`FrameReport::visualisation`] on or off. It takes time, which counts as that of the
    /// stage `update`, and changes nothing else.
    pub fn visualise(&mut self, wanted: bool) {
        self.tracker.visualise(wanted);
    }

    /// Shares the answers of detectors and verifiers with other sharing pipelines that process the
    /// very same frame, so that each answer is computed once. The reports are the same; a search
    /// for settings takes less time.
    pub fn share_findings(&mut self) {
        // Two plugins are interchangeable only with the same name, config, place, seed, base
        // directory and robot.
        let resolved = self.config.values();
        let around = format!(
            "{} {} {:?}",
            self.config.source().folder().display(),
            self.settings.seed,
            resolved.get("robot")
        );
        let slots = self.tracker.detectors().iter().enumerate();
        let detectors = slots.map(|(at, slot)| {
            let forgets = !slot.plugin.plugin().remembers();
            // An answer of a detector with memory depends on earlier frames, so it is not shared.
            forgets.then(|| identity_of(resolved, "detectors", at, &around))
        });
        let detectors = detectors.collect();
        let verifiers = (0..self.tracker.verifier_count())
            .map(|at| identity_of(resolved, "verifiers", at, &around))
            .collect();
        self.tracker.share_answers(Identities { detectors, verifiers });
    }

    /// Returns the names of the stages in [`FrameReport::timings`], in their order.
    pub fn stage_names(&self) -> &'static [&'static str] {
        &STAGES
    }

    /// Returns the config with every default filled in.
    pub fn config(&self) -> &ResolvedConfig {
        &self.config
    }

    /// Returns the config with every default filled in, as TOML.
    pub fn resolved(&self) -> String {
        self.config.to_toml().to_owned()
    }

    fn process(&mut self, frame: &Frame) -> Result<FrameReport, StepError> {
        let Tracked { report, completed } = self.tracker.step(frame)?;
        let mut report = FrameReport::from(report);
        if self.tracker.is_frozen() {
            self.disarm("the calibration changed");
        }
        if report.outcome.is_processed() {
            let start = Instant::now();
            // Depth from a stereo pair shows obstacles, too.
            self.steer(completed.as_ref().unwrap_or(frame), &mut report)?;
            report.timings.push((STAGES[8], start.elapsed().as_secs_f64() * 1e3));
        }
        report.funnel.drop_many("appearance: no vector", self.describer.take_missing());
        Ok(report)
    }

    /// Steers after the target; stops without one.
    fn steer(&mut self, frame: &Frame, report: &mut FrameReport) -> Result<(), StepError> {
        let Some(steering) = &mut self.steering else { return Ok(()) };
        // A jump of the clock invalidates every position that the target lock and the command limiter
        // remember.
        if matches!(report.outcome, Outcome::ResetBackward { .. } | Outcome::ResetForward { .. }) {
            steering.reset();
        }
        let Steered { command, target, lock, cause, obstacles } =
            steering.steer(frame, &report.motion, &report.tracks, &report.joints())?;
        let not_finite = u64::from(command.reason == Reason::NotFinite);
        report.funnel.drop_many("command not finite", not_finite);
        report.target = target;
        report.lock = Some(lock);
        report.command = Some(command);
        report.cause = cause;
        report.obstacles = obstacles;
        Ok(())
    }
}

/// All that the answers of a plugin follow from, apart from the frames.
fn identity_of(resolved: &toml::Table, kind: &str, at: usize, around: &str) -> String {
    let section = resolved.get(kind).and_then(|sections| sections.get(at));
    let plugin = section.and_then(|section| section.get("plugin"));
    let config = section.and_then(|section| section.get("config"));
    format!("{kind} {at} {around} {plugin:?} {config:?}")
}
