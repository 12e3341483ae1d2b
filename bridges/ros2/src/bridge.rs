use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use tagalong::core::{Input, Stamp};
use tagalong::log::msgs::Header;
use tagalong::log::write::FrameRecord;
use tagalong::log::{LiveSource, LogFrame};
use tagalong::pipeline::{Enable, EnableSwitch, FrameReport, Permission, Pipeline, StepError};
use tagalong_view::Live;

use crate::diagnostics::{Diagnostics, Status};
use crate::inbox::{Arrival, Inbox, lasting};
use crate::nav2::{Follower, ends_goal};
use crate::network::{Ear, Network};
use crate::options::Setup;
use crate::publishers::Gate;
use crate::services;
use crate::skill::{Desk, Request, Verb};
use crate::stamps::{StampClock, system_time};
use crate::summary::Summary;
use crate::wheels::{CommandCounts, SwitchHandle, Wheels};
use crate::{BridgeError, Options};

mod enable;
mod nav2;
mod out;
mod wheels;

use enable::{change_of_publishers, nobody, remedy};
use out::Out;
use wheels::{drive, take_enable, tell_untimely};

pub(crate) use wheels::sources;

/// Maximum time to wait for messages before the end condition is checked.
pub(crate) const TURN: Duration = Duration::from_millis(50);
/// Time without a frame after which this is logged.
const SILENCE: Duration = Duration::from_secs(2);
/// Minimum time between two heartbeats, and between two checks for other publishers.
const BEAT: Duration = Duration::from_millis(100);
/// Reason for latching while the enable has more than one publisher.
const CONTESTED: &str = "more than one publisher of the enable";
/// Age on arrival above which a frame indicates clocks that disagree, s.
const OLD_S: f64 = 0.5;

/// A pipeline between input and output topics.
pub(crate) struct Bridge {
    network: Network,
    options: Options,
    diagnostics: Diagnostics,
    live: Option<Live>,
    pipeline: Pipeline,
    source: LiveSource,
    inbox: Arc<Inbox>,
    clock: Arc<StampClock>,
    /// Client of Nav2's following server, once that was found. Declared before the wheels, so that
    /// its goal ends before their last commands.
    follower: Option<Follower>,
    wheels: Option<Wheels>,
    gates: Gates,
    callers: Callers,
    out: Out,
    /// Maximum speed in the config, m/s.
    max_speed_mps: f64,
    /// Permission that was last reported.
    told: Option<Permission>,
    /// Number of notes of the source that were reported.
    noted: usize,
    /// Number of other command publishers that was last reported.
    rivals: usize,
    /// Number of reset publishers that was last reported.
    resets: usize,
    beat: Option<Instant>,
    base_frame: String,
    odom_frame: String,
    frames: u64,
    /// Frames that lacked an input of the pipeline, and what the newest frame lacks.
    lacking: u64,
    lacks: Option<Input>,
    heard: Instant,
    quiet: bool,
    /// True while frames have older stamps than earlier ones.
    went_back: bool,
    /// True if the Nav2 action cannot be used.
    is_refused: bool,
}

/// Desk for the requests of callers, and the requests that were left there.
pub(crate) struct Callers {
    pub(crate) desk: Desk,
    pub(crate) requests: Receiver<Request>,
}

/// State that outlives a bridge and is passed to the next one.
pub(crate) struct Surroundings {
    pub(crate) network: Network,
    pub(crate) inbox: Arc<Inbox>,
    pub(crate) clock: Arc<StampClock>,
    pub(crate) callers: Callers,
    pub(crate) live: Option<Live>,
}

/// Gates of the topics that control the switch.
struct Gates {
    enable: Arc<Gate>,
    reset: Arc<Gate>,
}

impl Gates {
    /// Creates the gates; messages count for as long as an enable is valid.
    fn new(lifespan: Duration) -> Self {
        Self { enable: Arc::new(Gate::new(lifespan)), reset: Arc::new(Gate::new(lifespan)) }
    }
}

impl Bridge {
    pub(crate) fn new(
        options: &Options,
        setup: Setup,
        source: LiveSource,
        surroundings: Surroundings,
    ) -> Result<Self, BridgeError> {
        let Surroundings { mut network, inbox, clock, callers, live } = surroundings;
        let base_frame = source.facts().robot_frame;
        let out = Out::new(options, &mut network)?;
        let switch = setup.pipeline.enable_switch();
        let gates = Gates::new(switch.map_or(EnableSwitch::CEILING, |switch| switch.timeout()));
        let wheels = match switch {
            Some(switch) => {
                Some(drive(options, &setup, switch, &base_frame, &mut network, &clock)?)
            }
            None => None,
        };
        let publisher =
            network.publisher_of(&options.diagnostics, "diagnostic_msgs/msg/DiagnosticArray")?;
        let diagnostics = Diagnostics::start(publisher, Arc::clone(&clock))?;
        Ok(Self {
            max_speed_mps: setup.robot.max_speed_mps,
            network,
            options: options.clone(),
            diagnostics,
            live,
            follower: None,
            pipeline: setup.pipeline,
            source,
            inbox,
            clock,
            wheels,
            gates,
            callers,
            out,
            told: None,
            noted: 0,
            rivals: 0,
            resets: 0,
            beat: None,
            base_frame,
            odom_frame: setup.input.odom_frame,
            frames: 0,
            lacking: 0,
            lacks: None,
            heard: Instant::now(),
            quiet: false,
            went_back: false,
            is_refused: false,
        })
    }

    pub(crate) fn tell_topics(&self, tell: &dyn Fn(&str)) {
        let topics: Vec<_> = self.source.topics().collect();
        tell(&format!("reads {}", topics.join(", ")));
        if self.wheels.is_none() {
            tell("the config has no controller: no commands");
        }
        for caution in self.pipeline.cautions(None) {
            tell(&format!("warning: {caution}"));
        }
        self.tell_action(tell);
    }

    /// Subscribes to the topics that enable, stop and reset the robot; only with a controller.
    pub(crate) fn listen_to_switch(&mut self) -> Result<Vec<Ear>, BridgeError> {
        let Some(wheels) = &self.wheels else { return Ok(Vec::new()) };
        let Options { enable, reset, .. } = &self.options;
        let inbox = &self.inbox;
        let switch = wheels.switch();
        let gate = Arc::clone(&self.gates.enable);
        let enable = self.network.listen_to_enable(enable, inbox, move |origin| {
            take_enable(&switch, &gate, origin);
        })?;
        let switch = wheels.switch();
        let gate = Arc::clone(&self.gates.reset);
        let topic = reset.clone();
        let theirs = Arc::clone(inbox);
        // A reset also clears the fault of the pipeline, in the thread that owns it. It is stamped
        // with its time of publication, so that a stop that arrives in between is not cleared.
        let reset = self.network.listen_to_reset(reset, inbox, move |origin| {
            let Ok(age) = gate.admit(origin, Instant::now(), system_time()) else { return };
            let published = switch.now().saturating_sub(age);
            let nanos = u64::try_from(published.as_nanos()).unwrap_or(u64::MAX);
            theirs.push(&topic, nanos.to_le_bytes().to_vec(), 1);
        })?;
        let topic = &self.options.speed_limit;
        let theirs = Arc::clone(inbox);
        let key = topic.clone();
        let max_speed_mps = self.max_speed_mps;
        // Only the newest limit applies.
        let limit = self.network.listen_to_speed_limit(topic, inbox, move |limit| {
            theirs.push(&key, limit.mps(max_speed_mps).to_le_bytes().to_vec(), 1);
        })?;
        Ok(vec![enable, reset, limit])
    }

    /// Offers the requests of callers as services; only with a controller.
    pub(crate) fn offer_services(&mut self) -> Result<Vec<Ear>, BridgeError> {
        if self.wheels.is_none() {
            return Ok(Vec::new());
        }
        services::offer(&mut self.network, self.options.rmw, &self.callers.desk)
    }

    /// Returns the switch of the wheels; `None` without wheels.
    pub(crate) fn switch(&self) -> Option<SwitchHandle> {
        self.wheels.as_ref().map(Wheels::switch)
    }

    /// Notes that the node is not active; its switch is already latched.
    pub(crate) fn rest(&mut self) {
        self.diagnostics.rest();
        self.out.clear();
        // A robot that is activated again must report again what it needs.
        self.told = None;
    }

    /// Prepares for working after a rest, in which speed limits and static transforms may have come.
    pub(crate) fn resume(&mut self, tell: &dyn Fn(&str)) {
        for Arrival { topic, arrival_ns, message } in
            lasting(self.inbox.take(Duration::ZERO), &self.options.speed_limit)
        {
            if topic == self.options.speed_limit {
                self.limit_speed(&message, tell);
            } else {
                self.source.take_at(&topic, &message, arrival_ns);
            }
        }
        if let Some(switch) = self.switch() {
            switch.resume();
        }
    }

    /// Processes frames until `is_over`.
    pub(crate) fn work(
        &mut self,
        is_over: &dyn Fn() -> bool,
        tell: &dyn Fn(&str),
    ) -> Result<(), BridgeError> {
        self.callers.desk.open();
        // Silence before the work started does not count.
        (self.heard, self.quiet) = (Instant::now(), false);
        while !is_over() {
            for Arrival { topic, arrival_ns, message } in self.inbox.take(TURN) {
                match topic {
                    topic if topic == self.options.reset => self.reset(&message, tell),
                    topic if topic == self.options.speed_limit => self.limit_speed(&message, tell),
                    topic => self.source.take_at(&topic, &message, arrival_ns),
                }
            }
            self.serve_callers(tell);
            self.check_calibration()?;
            // Only the newest frame, because a slow pipeline must not fall behind the robot.
            match self.source.newest_frame() {
                Some(found) => self.step(found, tell)?,
                None => self.look_for_silence(tell)?,
            }
            self.report_state(tell);
        }
        Ok(())
    }

    /// Answers the requests that were left at the desk.
    fn serve_callers(&mut self, tell: &dyn Fn(&str)) {
        while let Ok(Request { verb, answer }) = self.callers.requests.try_recv() {
            let done = match verb {
                Verb::Enroll(enrollment) => self.pipeline.enroll(&enrollment),
                Verb::Clear => {
                    self.pipeline.clear();
                    Ok(())
                }
            };
            let done = done.map_err(|refusal| refusal.to_string());
            tell(&match &done {
                Ok(()) => format!("{verb}"),
                Err(reason) => format!("{verb}: refused: {reason}"),
            });
            // If the caller is gone, the answer is not needed.
            let _gone = answer.send(done);
        }
    }

    /// Ends the run if the calibration of a camera is no longer valid, because the positions of people
    /// and obstacles would be wrong.
    fn check_calibration(&self) -> Result<(), BridgeError> {
        let changes = self.source.counters().get("camera_info_changes").copied().unwrap_or(0);
        if changes == 0 || self.wheels.is_none() {
            return Ok(());
        }
        let topic = self.source.changed_calibration().unwrap_or_default();
        Err(BridgeError::Calibration(topic.to_owned()))
    }

    /// Reports notes of the source, changes of the permission to move and other command publishers,
    /// and publishes the heartbeat.
    fn report_state(&mut self, tell: &dyn Fn(&str)) {
        if self.beat.is_some_and(|beat| beat.elapsed() < BEAT) {
            return;
        }
        self.beat = Some(Instant::now());
        self.source.notes().iter().skip(self.noted).for_each(|note| tell(note));
        self.noted = self.source.notes().len();
        if self.wheels.is_some() {
            self.look_at_publishers(tell);
            self.look_at_follower(tell);
        }
        let permission = self.wheels.as_ref().map(|wheels| wheels.switch().permission());
        if let Some(permission) = permission.filter(|now| Some(*now) != self.told) {
            let remedy = remedy(permission, self.gates.enable.discovered(), &self.options);
            tell(&format!("{}{remedy}", permission.cause()));
            self.told = Some(permission);
        }
        let enables = self.gates.enable.discovered();
        let note = permission.and_then(|now| nobody(now, enables, &self.options.enable));
        self.callers.desk.turn(permission, self.pipeline.fault(), note);
        let header = Header::new(self.clock.now(), "tagalong");
        self.out.beat(header);
        self.diagnostics.update(Status {
            frames: self.frames,
            frame_since: None,
            heard: self.heard,
            permission,
            fault: self.pipeline.fault(),
            rivals: self.rivals,
            enable_publishers: enables,
            untimely: self.gates.enable.untimely() + self.gates.reset.untimely(),
            malformed: self.inbox.traffic().values().map(|topic| topic.malformed).sum(),
            lacks: self.lacks,
            is_resting: false,
            driver: self.driver_state(),
        });
    }

    /// Counts the publishers on the switch topics and on the command topic, and reports messages
    /// that were ignored for that reason.
    fn look_at_publishers(&mut self, tell: &dyn Fn(&str)) {
        let Options { enable, reset, command, .. } = &self.options;
        let [enables, resets, rivals] = self.network.others_on([enable, reset, command]);
        let before = self.gates.enable.discovered();
        if let Some(change) = change_of_publishers(before, enables, enable) {
            tell(&change);
        }
        self.gates.enable.set_discovered(enables);
        self.gates.reset.set_discovered(resets);
        if enables > 1 {
            self.hold_contested();
        }
        tell_untimely(&self.gates.enable, "`true`", enable, tell);
        tell_untimely(&self.gates.reset, "message", reset, tell);
        // With `--follow-object`, Nav2 is supposed to publish commands.
        let rivals = if self.options.follow_object.is_some() { 0 } else { rivals };
        if rivals > self.rivals {
            tell(&format!(
                "{rivals} other publishers of commands on {command}: the robot gets commands from \
                 several nodes; let one of them publish elsewhere (`--command`), and let a \
                 multiplexer choose"
            ));
        }
        self.rivals = rivals;
        if resets > 1 && self.resets <= 1 {
            tell(&format!(
                "{resets} publishers on {reset}: messages on it are ignored; end all but one \
                 (`ros2 topic info --verbose` names them)"
            ));
        }
        self.resets = resets;
    }

    /// Latches the switch while its enable has more than one publisher.
    fn hold_contested(&self) {
        let Some(switch) = self.wheels.as_ref().map(Wheels::switch) else { return };
        if switch.permission() != Permission::Latched(CONTESTED) {
            switch.take(Enable::Fault(CONTESTED), switch.now());
        }
    }

    /// Runs the pipeline on a frame and publishes the results.
    fn step(&mut self, mut found: LogFrame, tell: &dyn Fn(&str)) -> Result<(), BridgeError> {
        (self.heard, self.quiet) = (Instant::now(), false);
        let timing = self.clock.record_frame(found.frame.stamp);
        if self.frames == 0 {
            self.compare_clocks(found.frame.stamp, tell);
        }
        self.tell_old_stamps(timing.back_s, tell);
        found.frame = found.frame.with_latency(Some(timing.latency_s));
        // Before the step, so that the command of this frame is already a stop.
        if found.frame.odometry_jumped {
            self.disarm("odometry jumped", tell);
        }
        self.diagnostics.begin_frame();
        // If Nav2 drives, the base does not execute the commands of the pipeline.
        let is_driving = self.options.follow_object.is_none()
            && self.switch().is_some_and(|switch| switch.permission().is_granted())
            && !found.odom_stale;
        self.pipeline.set_driving(is_driving);
        let known = self.pipeline.fault();
        let report = self.pipeline.step(&found.frame);
        if let Some(cause) = self.pipeline.fault().filter(|cause| Some(*cause) != known) {
            self.latch(cause, tell);
        }
        // A robot with stale odometry must not move, but may again afterwards. One that is enabled has to
        // wait for the next frame: commands that the base did not execute may be of full speed.
        self.obey(is_driving);
        // Returned only now, so that the wheels are informed of a failed step.
        if let Err(error @ StepError::Lacks { input, .. }) = &report {
            self.lacks = Some(*input);
            self.pass_over(error, tell);
            return Ok(());
        }
        let report = report?;
        self.lacks = None;
        self.frames += 1;
        let status = self.pipeline.status();
        if let Some(follower) = &self.follower {
            let follows = status.as_ref().is_some_and(|status| status.follows);
            let stands = report.command.is_some_and(|command| ends_goal(command.reason));
            let is_well = !found.odom_stale && self.pipeline.fault().is_none();
            follower.note_frame(follows && is_well && !stands);
        }
        self.callers.desk.frame(status, self.frames);
        self.publish(&found, &report);
        if let Some(live) = &self.live {
            live.offer(&found.frame, &found.odom_from_robot, &report);
        }
        Ok(())
    }

    /// Counts a frame that lacks an input, and tells it of the first one; the wheels have stopped.
    fn pass_over(&mut self, error: &StepError, tell: &dyn Fn(&str)) {
        self.lacking += 1;
        if let Some(follower) = &self.follower {
            follower.note_frame(false);
        }
        if self.lacking == 1 {
            tell(&format!(
                "warning: {error}: the robot stops for each such frame; they are counted"
            ));
        }
    }

    fn obey(&self, may_move: bool) {
        if let Some(wheels) = &self.wheels {
            // If Nav2 drives, this program publishes nothing but stops.
            let may_move = may_move && self.options.follow_object.is_none();
            wheels.obey(self.pipeline.orders().filter(|_| may_move));
        }
    }

    /// Publishes the results.
    fn publish(&mut self, found: &LogFrame, report: &FrameReport) {
        // Without odometry the frame `odom` does not exist, and a viewer could not place a person
        // in it.
        let world = if self.source.has_odometry() { &self.odom_frame } else { &self.base_frame };
        let record = FrameRecord {
            index: report.index,
            stamp: report.stamp,
            camera: &found.frame.camera,
            odom_from_robot: &found.odom_from_robot,
            is_odom_known: true,
            tracks: &report.tracks,
            joints: &report.joints(),
            target: report.target,
            command: report.command.map(|command| command.wheels),
        };
        self.out.publish(&found.frame, &record, report, &self.base_frame, world);
    }

    /// Clears stops and faults that are not newer than the message, unless the enable has more than
    /// one publisher.
    fn reset(&mut self, data: &[u8], tell: &dyn Fn(&str)) {
        let enables = self.gates.enable.discovered();
        if enables > 1 {
            let enable = &self.options.enable;
            tell(&format!("reset refused: {enables} publishers on {enable}; end all but one"));
            return;
        }
        let nanos = <[u8; 8]>::try_from(data).map_or(0, u64::from_le_bytes);
        self.pipeline.arm();
        if let Some(wheels) = &self.wheels {
            wheels.switch().take(Enable::Reset, Duration::from_nanos(nanos));
            tell("reset");
        }
    }

    /// Applies a speed limit of a planner.
    fn limit_speed(&mut self, data: &[u8], tell: &dyn Fn(&str)) {
        let most_mps = <[u8; 8]>::try_from(data).map_or(0.0, f64::from_le_bytes);
        self.pipeline.allow_speed(most_mps);
        tell(&if most_mps.is_finite() {
            format!("speed limit: {most_mps:.2} m/s")
        } else {
            "no speed limit other than that of the config".to_owned()
        });
    }

    fn disarm(&mut self, why: &'static str, tell: &dyn Fn(&str)) {
        self.pipeline.disarm(why);
        self.obey(false);
        self.latch(why, tell);
    }

    /// Latches the switch, so that only a reset clears the fault.
    fn latch(&self, why: &'static str, tell: &dyn Fn(&str)) {
        if let Some(switch) = self.wheels.as_ref().map(Wheels::switch) {
            switch.take(Enable::Fault(why), switch.now());
            tell(&format!("fault: {why}"));
        }
    }

    fn compare_clocks(&self, stamp: Stamp, tell: &dyn Fn(&str)) {
        let old_s = self.clock.now().seconds_since(stamp);
        if !(-OLD_S..=OLD_S).contains(&old_s) {
            tell(&format!(
                "the first frame is {old_s:.1} s old by this machine's clock: commands will \
                 have expired before they are given; synchronise the clocks, or use \
                 `--clock arrival` for simulated time and replayed logs"
            ));
        }
    }

    /// Reports once that stamps went back: the clock does not go back, so no command of these
    /// frames is valid.
    fn tell_old_stamps(&mut self, back_s: f64, tell: &dyn Fn(&str)) {
        let went_back = back_s > 0.0;
        if went_back && !self.went_back {
            tell(&format!(
                "the stamps of the images went back by {back_s:.1} s: the robot stands until they \
                 are newer than before; restart the bridge if a simulation or a log was restarted"
            ));
        }
        self.went_back = went_back;
    }

    /// Reports once why there are no frames.
    fn look_for_silence(&mut self, tell: &dyn Fn(&str)) -> Result<(), BridgeError> {
        if let Some(misfit) = self.source.misfit().filter(|_| self.frames == 0) {
            return Err(misfit.into());
        }
        if self.heard.elapsed() > SILENCE && !self.quiet {
            self.quiet = true;
            let so_far = self.summary();
            tell(&format!("no frame for {} s; until now: {so_far}", SILENCE.as_secs()));
            self.source.notes().iter().for_each(|note| tell(note));
        }
        Ok(())
    }

    fn summary(&self) -> Summary {
        let mut counters = self.source.counters().clone();
        if self.lacking > 0 {
            counters.insert("frames_without_required_input", self.lacking);
        }
        Summary {
            frames: self.frames,
            traffic: self.inbox.traffic(),
            counters,
            told: CommandCounts::default(),
        }
    }

    /// Stops the robot; returns the counts and the state that outlives the bridge, such as the
    /// network, which must outlast the last command.
    pub(crate) fn finish(mut self) -> (Summary, Surroundings) {
        // The goal is cancelled while the wheels still send zeros.
        self.follower.take();
        self.out.clear();
        let summary = self.summary();
        let told = self.wheels.map(Wheels::finish).unwrap_or_default();
        let Self { network, inbox, clock, callers, live, .. } = self;
        let surroundings = Surroundings { network, inbox, clock, callers, live };
        (Summary { told, ..summary }, surroundings)
    }
}
