//! Closed loops: the contender's controller drives the robot through the scene.

mod judge;

use std::time::Instant;

pub use judge::{Episode, Ridden, RideJudge};
use tagalong_config::Registry;
use tagalong_core::{Stamp, WheelSpeeds};
use tagalong_pipeline::{FrameReport, Pipeline};
use tagalong_sim::{Clearance, Event, Scene, Simulation};

use crate::{Contender, Draw, Drawn, Moment, TrialError};

/// The robot's body is a disc of this radius, m: somewhat more than the robot of
/// the papers, which is 0.38 m wide and 0.47 m long.
const RADIUS_M: f64 = 0.25;

/// Somebody who watches a ride, to write it down, say.
pub trait Witness {
    /// Something that the robot recorded.
    fn event(&mut self, _event: &Event) {}

    /// What the pipeline made of a frame.
    fn frame(&mut self, _drawn: &Drawn, _report: &FrameReport) {}

    /// False ends the ride.
    fn goes_on(&self) -> bool {
        true
    }
}

/// Nobody watches.
impl Witness for () {}

/// The robot at a step of the simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Since the start, s.
    pub at_s: f64,
    /// True forward speed, m/s.
    pub speed_mps: f64,
    /// How much room it has.
    pub clearance: Clearance,
}

/// A scene in which a pipeline drove the robot.
#[derive(Clone, Debug)]
pub struct Ride {
    /// Seed of the scene.
    pub seed: u64,
    /// The distance that the controller keeps from the person, m, if it keeps one.
    pub stand_off_m: Option<f64>,
    /// What is true of each frame.
    pub moments: Vec<Moment>,
    /// What the pipeline made of it.
    pub reports: Vec<FrameReport>,
    /// How long that took, ms; the only part that differs between two rides.
    pub took_ms: Vec<f64>,
    /// The robot, step by step.
    pub ticks: Vec<Tick>,
}

impl Ride {
    /// Draws a scene in which the contender's controller drives the robot. Images
    /// that come late are late for it, too; between them the wheels get what [`Pipeline::command_at`] says, as often as
    /// the odometry speaks.
    ///
    /// # Errors
    /// A config that is wrong or has no controller, or a plugin that fails.
    pub fn new(
        scene: &Scene,
        contender: &Contender,
        registry: &Registry,
        witness: &mut dyn Witness,
    ) -> Result<Self, TrialError> {
        let mut pipeline = contender.pipeline(registry, scene.seed)?;
        if !pipeline.has_controller() {
            let message = format!("{} has no [controller]: nothing can follow", contender.name);
            return Err(TrialError::Config(message));
        }
        let mut draw = Draw::live(scene, 1);
        let mut ride = Self {
            seed: scene.seed,
            stand_off_m: pipeline.stand_off_m(),
            moments: Vec::new(),
            reports: Vec::new(),
            took_ms: Vec::new(),
            ticks: Vec::new(),
        };
        let failed =
            |error| TrialError::Step { pipeline: contender.name.clone(), seed: scene.seed, error };
        while let Some(drawn) = ride.next_frame(&mut draw, &pipeline, witness) {
            let start = Instant::now();
            let report = pipeline.step(&drawn.frame).map_err(failed)?;
            ride.took_ms.push(start.elapsed().as_secs_f64() * 1e3);
            if let Some(command) = report.command {
                draw.steer(command.wheels);
            }
            witness.frame(&drawn, &report);
            ride.moments.push(Moment::of(drawn));
            ride.reports.push(report);
        }
        Ok(ride)
    }

    fn next_frame(
        &mut self,
        draw: &mut Draw,
        pipeline: &Pipeline,
        witness: &mut dyn Witness,
    ) -> Option<Drawn> {
        if !witness.goes_on() {
            return None;
        }
        draw.next_frame_while(|simulation, event| {
            witness.event(event);
            let Event::Odometry(reading) = event else { return None };
            self.ticks.push(tick(simulation, reading.at_ns));
            command(pipeline, Stamp::from_nanos(reading.at_ns))
        })
    }
}

fn tick(simulation: &Simulation, at_ns: u64) -> Tick {
    Tick {
        at_s: at_ns as f64 * 1e-9,
        speed_mps: simulation.speed_mps(),
        clearance: simulation.clearance(RADIUS_M),
    }
}

fn command(pipeline: &Pipeline, now: Stamp) -> Option<WheelSpeeds> {
    pipeline.command_at(now).map(|command| command.wheels)
}
