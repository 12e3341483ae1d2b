//! Closed loops: the contender's controller steers the robot through the scene.

mod approach;
mod crowd;
mod enable;
mod judge;
mod told;

use std::time::Duration;

use cpu_time::ThreadTime;

pub use approach::{ApproachJudge, ApproachWatch, Approached, Contact, Side, Touched};
pub use crowd::CrowdMeasures;
use enable::StuckEnable;
pub use judge::{Episode, ReasonShare, Ridden, RideJudge};
use tagalong_config::Registry;
use tagalong_core::{Command, Frame, Input, Reason, Stamp, WheelSpeeds};
use tagalong_pipeline::{FrameReport, Pipeline, SourceKind, Sources};
use tagalong_sim::{
    ApproachInView, ApproachState, Clearance, CrowdView, Event, ROBOT_RADIUS_M, Scene,
    ScheduledFault, Simulation,
};

use crate::trial::without_unused_colour;
use crate::{Contender, Draw, Moment, SimulatedFrame, TrialError};

/// Number of steps between two checks of the approacher's visibility.
const LOOKS_EVERY: usize = 5;

/// Observer of a ride, for example one that writes a log.
pub trait Witness {
    /// Receives an event that the robot recorded.
    fn event(&mut self, _event: &Event) {}

    /// Receives the state of the robot at a step of the simulation.
    fn tick(&mut self, _tick: &Tick) {}

    /// Receives a frame and the report of the pipeline on it.
    fn frame(&mut self, _drawn: &SimulatedFrame, _report: &FrameReport) {}

    /// Returns false to end the ride.
    fn goes_on(&self) -> bool {
        true
    }

    /// Returns true if the observer uses the images: colour images that neither it nor the pipeline
    /// uses are not rendered.
    fn uses_images(&self) -> bool {
        true
    }
}

/// No observer.
impl Witness for () {
    fn uses_images(&self) -> bool {
        false
    }
}

/// State of the robot at a step of the simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Time since the start, s.
    pub at_s: f64,
    /// True forward speed, m/s.
    pub speed_mps: f64,
    /// True turn rate, rad/s.
    pub turn_rate: f64,
    /// Free distance around the robot: around its footprint, or around a disc if the scene has
    /// none.
    pub clearance: Clearance,
    /// The robot among people; `None` in a scene whose people do not react.
    pub crowd: Option<CrowdView>,
    /// State of the approacher of the scene, once it is there.
    pub approach: Option<ApproachState>,
    /// Reason of the command in force; `None` while the enable does not permit any motion.
    pub reason: Option<Reason>,
    /// Effect of that command, as [`Command::effect`]; without one the robot is at rest.
    pub effect: &'static str,
}

impl Tick {
    /// Returns the maximum speed over ground of any point of the robot's body, m/s, from driving
    /// and turning.
    pub fn body_mps(&self) -> f64 {
        self.speed_mps.abs().max(self.turn_rate.abs() * ROBOT_RADIUS_M)
    }
}

/// Record of a scene in which a pipeline steered the robot.
#[derive(Clone, Debug, Default)]
pub struct Ride {
    /// Seed of the scene.
    pub seed: u64,
    /// Distance that the controller keeps from the person, m, if it keeps one.
    pub stand_off_m: Option<f64>,
    /// Truth of each frame.
    pub moments: Vec<Moment>,
    /// Report of the pipeline on each frame.
    pub reports: Vec<FrameReport>,
    /// Processor time of each step, ms; the only part that differs between two runs of the same
    /// ride.
    pub took_ms: Vec<f64>,
    /// States of the robot, step by step.
    pub ticks: Vec<Tick>,
    /// Sensors that had the approacher of the scene in view, every tenth of a second; the times are
    /// s since the start.
    pub in_view: Vec<(f64, ApproachInView)>,
    /// Faults that were injected.
    pub faults: Vec<ScheduledFault>,
}

impl Ride {
    /// Simulates a scene in which the contender's controller steers the robot. Images that come
    /// late are also late for the controller; between them the wheels get the command of
    /// [`Pipeline::command_at`] at each odometry message.
    ///
    /// # Errors
    /// A config that is invalid, has no controller or one without obstacle sensors, or names an
    /// obstacle source that the scene does not simulate; a plugin that fails.
    pub fn new(
        scene: &Scene,
        contender: &Contender,
        registry: &Registry,
        witness: &mut dyn Witness,
    ) -> Result<Self, TrialError> {
        Self::simulate(scene, contender, registry, witness, false)
    }

    /// Simulates a ride as [`Ride::new`] does, for a pipeline that is given the positions of
    /// people, see [`Contender::told`]: each frame has, as recorded detections, the positions of
    /// all people within range of the laser scanner and in free sight, and the track of the first
    /// of them is enrolled.
    pub fn told(
        scene: &Scene,
        contender: &Contender,
        registry: &Registry,
        witness: &mut dyn Witness,
    ) -> Result<Self, TrialError> {
        Self::simulate(scene, contender, registry, witness, true)
    }

    fn simulate(
        scene: &Scene,
        contender: &Contender,
        registry: &Registry,
        witness: &mut dyn Witness,
        is_told: bool,
    ) -> Result<Self, TrialError> {
        let mut pipeline = contender.pipeline(registry, scene.seed)?;
        if !pipeline.has_controller() {
            let message = format!("{} has no [controller]: nothing can follow", contender.name);
            return Err(TrialError::Config(message));
        }
        Self::check_sensors(scene, &pipeline, &contender.name)?;
        // The simulated base executes the commands.
        pipeline.set_driving(true);
        let scene = &without_unused_colour(scene, pipeline.inputs(), witness.uses_images());
        let mut draw = Draw::live(scene, 1);
        let mut ride = Self {
            seed: scene.seed,
            stand_off_m: pipeline.stand_off_m(),
            faults: draw.simulation().faults().to_vec(),
            ..Self::default()
        };
        let mut enable = StuckEnable::of(&ride.faults);
        // Time at which the last frame that led to a command was passed on.
        let mut framed = Stamp::default();
        while let Some(simulated) =
            ride.next_frame(&mut draw, &pipeline, framed, (&mut enable, witness))
        {
            let simulated =
                if is_told { told::tell(draw.simulation(), simulated) } else { simulated };
            let may_move = ride.may_move(&mut enable);
            pipeline.set_driving(may_move);
            if ride.reports.is_empty() {
                let missing = pipeline.check_sources(sources(&simulated.frame));
                missing.map_err(|why| TrialError::Config(format!("{}: {why}", contender.name)))?;
            }
            // Processor time, because a busy machine must not change a table.
            let before = ThreadTime::now();
            let report = pipeline.step(&simulated.frame);
            ride.took_ms.push(before.elapsed().as_secs_f64() * 1e3);
            let report = report.map_err(|error| {
                let pipeline = contender.name.clone();
                TrialError::Step { pipeline, seed: scene.seed, error }
            })?;
            // Between frames `command_at` steers; this is the new command.
            if let Some(command) = report.command {
                framed = ride.now();
                draw.steer(if may_move { command.wheels } else { WheelSpeeds::STOP });
            }
            if is_told {
                told::tell_target(&mut pipeline, &simulated, &report);
            }
            witness.frame(&simulated, &report);
            ride.moments.push(Moment::of(simulated));
            ride.reports.push(report);
        }
        Ok(ride)
    }

    /// Rejects a pipeline that requires a laser scanner if the robot of the scene has none, or that
    /// has an obstacle source that the robot does not have.
    ///
    /// # Errors
    /// [`TrialError::Config`] names the sensor and the remedy.
    pub fn check_sensors(scene: &Scene, pipeline: &Pipeline, name: &str) -> Result<(), TrialError> {
        if pipeline.inputs().requires(Input::Laser) && scene.laser.is_none() {
            return Err(TrialError::Config(format!(
                "{name}: it requires laser scans, and the robot of the scene has no laser scanner; add \
                 it with `--set 'laser={{}}'`"
            )));
        }
        Self::check_obstacle_sources(scene, pipeline, name)
    }

    /// Rejects a pipeline with an obstacle source that the robot of the scene does not have:
    /// without a reading of it the robot would never move.
    ///
    /// # Errors
    /// [`TrialError::Config`] names the source and the remedy.
    fn check_obstacle_sources(
        scene: &Scene,
        pipeline: &Pipeline,
        name: &str,
    ) -> Result<(), TrialError> {
        for source in pipeline.obstacle_sources() {
            let mut names: Vec<&str> = Vec::new();
            let key = match source.kind {
                SourceKind::Scan => {
                    names.extend(scene.lasers.iter().map(|laser| &*laser.name));
                    Some("lasers")
                }
                SourceKind::Range => {
                    names.extend(scene.ranges.iter().map(|range| &*range.name));
                    Some("ranges")
                }
                SourceKind::Bumper => {
                    names.extend(scene.bumpers.iter().map(|bumper| &*bumper.name));
                    Some("bumpers")
                }
                // The simulated robot has one depth camera, which needs no section.
                SourceKind::Depth => None,
            };
            if names.contains(&&*source.name) {
                continue;
            }
            let wanted = &source.name;
            let remedy = match key {
                Some(key) if names.is_empty() => {
                    format!("add it with `--set '{key}=[{{name=\"{wanted}\"}}]'`")
                }
                Some(key) => format!("add `[[{key}]]` with `name = \"{wanted}\"` to the scene"),
                None => "a simulated robot has no second depth camera".into(),
            };
            return Err(TrialError::Config(format!(
                "{name}: the robot of the scene lacks the source `{wanted}` of [[collision_monitor.sources]], \
                 without which it never moves; {remedy}, or leave the source out of the config"
            )));
        }
        Ok(())
    }

    /// Returns the time of the last step of the simulation, s.
    fn now_s(&self) -> f64 {
        self.ticks.last().map_or(0.0, |tick| tick.at_s)
    }

    /// Returns the time of the last step of the simulation.
    fn now(&self) -> Stamp {
        Stamp::default().plus_seconds(self.now_s())
    }

    /// Returns true if the enable permits motion at the last step of the simulation.
    fn may_move(&self, enable: &mut Option<StuckEnable>) -> bool {
        enable.as_mut().is_none_or(|enable| enable.is_granted(self.now_s()))
    }

    fn next_frame(
        &mut self,
        draw: &mut Draw,
        pipeline: &Pipeline,
        framed: Stamp,
        (enable, witness): (&mut Option<StuckEnable>, &mut dyn Witness),
    ) -> Option<SimulatedFrame> {
        if !witness.goes_on() {
            return None;
        }
        draw.next_frame_while(|simulation, event| {
            witness.event(event);
            // The wheels request commands at each step, even if the odometry is silent.
            let at_ns = event.step_ns()?;
            let since_frame = Stamp::from_nanos(at_ns).seconds_since(framed);
            let now = Stamp::from_nanos(simulation.robot_clock_ns(at_ns));
            let is_granted =
                enable.as_mut().is_none_or(|enable| enable.is_granted(at_ns as f64 * 1e-9));
            let command = command(pipeline, now, since_frame).filter(|_| is_granted);
            let tick = tick(simulation, at_ns, command);
            self.look(simulation, &tick);
            witness.tick(&tick);
            self.ticks.push(tick);
            if is_granted { command.map(|command| command.wheels) } else { Some(WheelSpeeds::STOP) }
        })
    }

    /// Records, every few steps, which sensors have the approacher in view.
    fn look(&mut self, simulation: &Simulation, tick: &Tick) {
        if tick.approach.is_some() && self.ticks.len().is_multiple_of(LOOKS_EVERY) {
            self.in_view.push((tick.at_s, simulation.approach_in_view()));
        }
    }
}

/// Returns the data of a simulated frame; its robot always has odometry.
fn sources(frame: &Frame) -> Sources {
    let right = frame.right().is_ok();
    let laser = frame.laser().is_some();
    Sources { depth: frame.depth().is_ok(), right, laser, odometry: true }
}

fn tick(simulation: &Simulation, at_ns: u64, command: Option<Command>) -> Tick {
    Tick {
        at_s: at_ns as f64 * 1e-9,
        speed_mps: simulation.speed_mps(),
        turn_rate: simulation.turn_rate(),
        clearance: simulation.clearance(ROBOT_RADIUS_M),
        crowd: simulation.crowd_view(),
        approach: simulation.approach(ROBOT_RADIUS_M),
        reason: command.map(|command| command.reason),
        effect: command.map_or("stands", |command| command.effect()),
    }
}

fn command(pipeline: &Pipeline, now: Stamp, since_frame_s: f64) -> Option<Command> {
    let since_frame = Duration::from_secs_f64(since_frame_s.max(0.0));
    pipeline.command_after(now, since_frame)
}
