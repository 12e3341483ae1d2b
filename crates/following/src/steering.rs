use std::sync::Arc;

use tagalong_core::{
    Command, Controller, EgoMotion, Frame, Inputs, Joints, Reason, Scene, Stamp, Track, TrackId,
    Twist, WheelSpeeds,
};
use tagalong_tracking::{Guarded, StepError};
use tagalong_vision::Describer;

use crate::collision_monitor::CollisionMonitor;
use crate::command_limiter::{Aim, CommandLimiter, Wish};
use crate::skill::{View, before_any_frame};
use crate::target_lock::{Search, TargetLock};
use crate::{
    Base, Cause, ChoiceRule, Enrollment, EnrollmentError, FollowSettings, FollowStatus, LockReport,
    LockState, ObstaclePoint, Orders, RobotSettings, SearchSettings, TargetSettings,
};

/// Frames that must be processed after a reset before the robot may move.
const FRESH_FRAMES: u32 = 3;

/// Controller, target lock, and command limiter of the commands.
pub struct Steering {
    controller: Guarded<dyn Controller>,
    lock: TargetLock,
    /// Choice and search as in the config, whatever an enrollment says.
    configured: TargetSettings,
    search: Search,
    search_settings: SearchSettings,
    /// Last frame, in which an enrollment finds its person.
    view: Option<View>,
    status: FollowStatus,
    monitor: CollisionMonitor,
    limiter: CommandLimiter,
    robot: RobotSettings,
    fresh: u32,
    last: Option<Stamp>,
    /// Time since which a sensor is frozen.
    frozen_since: Option<Stamp>,
}

/// Result of one frame.
pub struct Steered {
    /// The command.
    pub command: Command,
    /// The target, if it is among the tracks.
    pub target: Option<TrackId>,
    /// The state of the target lock.
    pub lock: LockReport,
    /// Cause of the reason of the command, where a place, a frozen sensor or a fault is one.
    pub cause: Option<Cause>,
    /// Places that the collision monitor counted.
    pub obstacles: Vec<ObstaclePoint>,
}

impl Steering {
    /// Creates the steering by a controller, which is called `name` in reports. The target lock
    /// knows people by the describer.
    pub fn new(
        name: String,
        controller: Box<dyn Controller>,
        settings: FollowSettings,
        describer: Describer,
    ) -> Self {
        let FollowSettings { robot, command_limiter, collision_monitor, target } = settings;
        Self {
            controller: Guarded::new(name, controller),
            configured: target.clone(),
            view: None,
            status: View::default().status(
                &before_any_frame("no frame yet"),
                None,
                Reason::Settling.name(),
                None,
            ),
            search_settings: target.search.clone(),
            lock: TargetLock::new(target, describer),
            search: Search::default(),
            monitor: CollisionMonitor::new(collision_monitor, &robot),
            limiter: CommandLimiter::new(command_limiter, robot.clone()),
            robot,
            fresh: FRESH_FRAMES,
            last: None,
            frozen_since: None,
        }
    }

    /// Forgets all positions after a jump of the clock, and starts the wait of `FRESH_FRAMES`.
    pub fn reset(&mut self) {
        self.view = None;
        self.lock.reset();
        self.monitor.clear();
        self.fresh = 0;
    }

    /// Follows the person of a request from the next frame on, and forgets the previous one.
    ///
    /// # Errors
    /// [`EnrollmentError`], and the robot goes on as before.
    pub fn enroll(&mut self, enrollment: &Enrollment) -> Result<(), EnrollmentError> {
        let view = self.view.as_ref().ok_or(EnrollmentError::NoFrame)?;
        let settings = view.settings(enrollment, &self.configured)?;
        self.restart(settings, "enrolled");
        Ok(())
    }

    /// Forgets the person, and follows none until the next request: the robot slows down and stands.
    pub fn clear(&mut self) {
        let none =
            TargetSettings { track: None, choose: ChoiceRule::None, ..self.configured.clone() };
        self.restart(none, "cleared");
    }

    fn restart(&mut self, settings: TargetSettings, why: &'static str) {
        self.search = Search::default();
        self.search_settings = settings.search.clone();
        self.lock.restart(settings, why);
    }

    /// Stops the robot at a frame that leads to no command, until the next one that does.
    pub fn pass_over(&mut self, frame: &Frame) {
        self.limiter.withdraw(frame.stamp);
        self.status.command = Reason::Expired.name();
    }

    /// Limits the speed to this, m/s, beside all other limits, until the next call; infinite for no
    /// limit.
    pub fn allow_speed(&mut self, most_mps: f64) {
        self.limiter.allow_speed(most_mps);
    }

    /// Returns the state of the pursuit after the last frame.
    pub fn status(&self) -> FollowStatus {
        FollowStatus { fault: self.fault(), ..self.status.clone() }
    }

    /// Returns the distance that the controller keeps, m, if it keeps one.
    pub fn stand_off_m(&self) -> Option<f64> {
        self.controller.plugin().stand_off_m()
    }

    /// Returns true if the controller keeps the person beside the robot or behind it.
    pub fn leaves_view(&self) -> bool {
        self.controller.plugin().leaves_view()
    }

    /// Returns the controller's name and its inputs.
    pub fn inputs(&self) -> (&str, Inputs) {
        (self.controller.name(), self.controller.plugin().inputs())
    }

    /// Returns a copy of the source of commands, for a control loop in another thread.
    pub fn orders(&self) -> Orders {
        self.limiter.orders()
    }

    /// Tells whether the base executes the commands from now on. Only then can they be compared with
    /// the odometry: a base that does something else, or responds too late, is a fault. A base that begins
    /// to execute them starts from rest.
    pub fn set_driving(&mut self, is_driving: bool) {
        self.limiter.set_driving(is_driving);
    }

    /// Returns the reason why the robot stands until [`Steering::arm`], if it does.
    pub fn fault(&self) -> Option<&'static str> {
        self.limiter.fault()
    }

    /// Stops the robot until [`Steering::arm`].
    pub fn disarm(&mut self, why: &'static str) {
        self.limiter.latch(why);
    }

    /// Lets the robot move again after a fault.
    pub fn arm(&mut self) {
        self.limiter.arm();
        self.monitor.arm();
    }

    /// Returns the command for a frame, and the target; `motion` is the robot's since the last
    /// frame that was processed, `joints` are those of tracks in this frame.
    ///
    /// # Errors
    /// The controller panicked, or the network that describes people failed.
    pub fn steer(
        &mut self,
        frame: &Frame,
        motion: &EgoMotion,
        tracks: &[Track],
        joints: &[(TrackId, Arc<Joints>)],
    ) -> Result<Steered, StepError> {
        // Checked first: a fault is latched before this frame's command is made.
        self.limiter.check_motion(frame);
        let settled = self.is_settled();
        let lock = self.lock.update(frame, motion, tracks, joints, settled);
        let lock = lock.map_err(|error| StepError::of_stage("[appearance]", frame, error))?;
        let followed = self.lock.followed();
        let target = tracks.iter().find(|track| Some(track.id) == followed);
        let twist = self.ask(frame, tracks, target)?;
        // After the lock, because points of the target are no obstacles.
        self.monitor.update(frame, motion, tracks, followed);
        let (wheels, aim) = self.aim(twist, tracks);
        let wish = Wish {
            wheels,
            stamp: frame.stamp,
            aim,
            stop: self.monitor.stop_reason(self.limiter.patience_s()),
            slowdown: self.monitor.slowdown(),
            settled,
            pause_s: self.last.map_or(0.0, |last| frame.stamp.seconds_since(last)),
        };
        self.last = Some(frame.stamp);
        // The allowances are noted, to name the cause of the command.
        let mut asked = Vec::new();
        let command = self.limiter.limit(&wish, |path, speed, braking| {
            let allowed = self.monitor.allowance(path, speed, braking);
            asked.push(allowed);
            allowed
        });
        let target = target.map(|track| track.id);
        let cause = Cause::of(command.reason, self.fault(), &asked, &self.monitor, tracks, target);
        // The search learns only now that its wish was blocked; it reacts in the next frame.
        let is_blocked =
            matches!(command.reason, Reason::Blocked | Reason::TooClose | Reason::Unknown);
        self.search.add_block(is_blocked, motion.dt);
        let view = View::new(tracks, &frame.camera, frame.stamp);
        let lock = self.lock_by_sensors(lock, cause.as_ref(), frame.stamp);
        self.status = view.status(&lock, target, command.reason.name(), self.fault());
        self.view = Some(view);
        Ok(Steered { command, target, lock, cause, obstacles: self.monitor.obstacles() })
    }

    /// Returns the report of the lock as the sensors let it be believed.
    fn lock_by_sensors(
        &mut self,
        lock: LockReport,
        cause: Option<&Cause>,
        now: Stamp,
    ) -> LockReport {
        let Some(Cause::Sensor { needs_reset, .. }) = cause else {
            self.frozen_since = None;
            return lock;
        };
        let since = *self.frozen_since.get_or_insert(now);
        lock.of_frozen_sensor(*needs_reset, now.seconds_since(since))
    }

    fn ask(
        &mut self,
        frame: &Frame,
        tracks: &[Track],
        target: Option<&Track>,
    ) -> Result<Twist, StepError> {
        // A controller plans around people; a tentative track may be noise.
        let confirmed: Vec<Track> = tracks.iter().filter(|t| t.confirmed).cloned().collect();
        let scene = Scene::new(frame, &confirmed, self.robot.wheels(), self.robot.max_speed_mps)
            .with_target(target);
        self.controller.ask(frame.index, |controller| controller.command(&scene))
    }

    /// Chooses the wheel speeds and their purpose: the controller's wish while a target is
    /// followed, the search's while it is lost.
    fn aim(&mut self, twist: Twist, tracks: &[Track]) -> (WheelSpeeds, Aim) {
        match self.lock.state() {
            LockState::Initial => (WheelSpeeds::STOP, Aim::Nobody),
            LockState::Lost => match self.look_for(tracks) {
                Some(twist) => (self.robot.wheels().wheels(twist), Aim::Search),
                None => (WheelSpeeds::STOP, Aim::Nobody),
            },
            state => {
                self.search = Search::default();
                let drive = self.robot.wheels();
                let wheels = match self.robot.base {
                    // Its limits are those of speed and turn rate, not of a wheel.
                    Base::Holonomic => drive.wheels(twist),
                    _ => drive.wheels_within(twist, self.robot.max_speed_mps),
                };
                (wheels, if state.doubts() { Aim::Perhaps } else { Aim::Person })
            }
        }
    }

    fn look_for(&mut self, tracks: &[Track]) -> Option<Twist> {
        let last = self.lock.last_seen()?;
        let lost_s = self.lock.since_s();
        let candidate = self.lock.candidate(tracks);
        self.search.wish(&self.search_settings, last, candidate, lost_s)
    }

    /// Counts a frame; returns true once enough frames were processed since the last reset.
    fn is_settled(&mut self) -> bool {
        self.fresh = self.fresh.saturating_add(1);
        self.fresh > FRESH_FRAMES
    }
}
