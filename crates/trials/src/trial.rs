use nalgebra::Isometry2;
use tagalong_core::{Camera, Registry, Stamp};
use tagalong_eval::EvalError;
use tagalong_pipeline::{FrameReport, Pipeline, StepError};
use tagalong_sim::{Scene, Truth};

use crate::{Contender, Draw, Drawn};

/// Why a trial has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrialError {
    /// A config that is wrong, shown with the place of the mistake.
    #[error("{0}")]
    Config(String),
    /// A plugin refused a frame, or panicked on it.
    #[error("{pipeline}, seed {seed}: {error}")]
    Step {
        /// The contender.
        pipeline: String,
        /// Seed of the scene.
        seed: u64,
        /// What happened.
        error: StepError,
    },
    /// Tracks that cannot be scored.
    #[error(transparent)]
    Eval(#[from] EvalError),
    /// Whoever watched could not write it down.
    #[error("{0}")]
    Witness(String),
    /// A thread that works on trials died.
    #[error("a trial panicked; please report this")]
    Panicked,
}

/// What is true of one frame.
#[derive(Clone, Debug)]
pub struct Moment {
    /// Stamp of the frame.
    pub stamp: Stamp,
    /// Everybody.
    pub truth: Vec<Truth>,
    /// The robot in the odometry frame, as it believes, m and rad.
    pub odom_from_robot: Isometry2<f64>,
    /// The robot in the world, as it is, m and rad.
    pub world_from_robot: Isometry2<f64>,
}

/// What one contender said about a scene.
#[derive(Clone, Debug)]
pub struct Run {
    /// Name of the contender.
    pub pipeline: String,
    /// One report a frame, in the order of [`Trial::moments`].
    pub reports: Vec<FrameReport>,
}

/// One scene, and what each contender said about it.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Seed of the scene.
    pub seed: u64,
    /// The camera, as the pipelines believe it to be.
    pub camera: Camera,
    /// The frames.
    pub moments: Vec<Moment>,
    /// The contenders, in the order in which they were named.
    pub runs: Vec<Run>,
}

impl Trial {
    /// Draws a scene and takes each contender over the same frames.
    ///
    /// # Errors
    /// A config that is wrong, or a plugin that fails.
    pub fn new(
        scene: &Scene,
        contenders: &[Contender],
        registry: &Registry,
        threads: usize,
    ) -> Result<Self, TrialError> {
        let mut draw = Draw::new(scene, threads);
        let mut lanes = Lane::all(scene, contenders, registry)?;
        let mut moments = Vec::new();
        let mut camera = None;
        while let Some(drawn) = draw.next_frame() {
            lanes.iter_mut().try_for_each(|lane| lane.step(&drawn))?;
            camera.get_or_insert_with(|| Camera::clone(&drawn.frame.camera));
            moments.push(Moment::of(drawn));
        }
        Ok(Self::of(scene, camera, moments, lanes))
    }

    fn of(scene: &Scene, camera: Option<Camera>, moments: Vec<Moment>, lanes: Vec<Lane>) -> Self {
        let camera =
            camera.unwrap_or_else(|| tagalong_sim::Simulation::new(scene, 1).camera().clone());
        let runs = lanes.into_iter().map(|lane| lane.run).collect();
        Self { seed: scene.seed, camera, moments, runs }
    }
}

impl Moment {
    pub(crate) fn of(drawn: Drawn) -> Self {
        let Drawn { frame, truth, odom_from_robot, world_from_robot } = drawn;
        Self { stamp: frame.stamp, truth, odom_from_robot, world_from_robot }
    }
}

/// A pipeline on its way through the frames.
struct Lane {
    pipeline: Pipeline,
    seed: u64,
    run: Run,
}

impl Lane {
    fn new(scene: &Scene, contender: &Contender, registry: &Registry) -> Result<Self, TrialError> {
        let pipeline = contender.pipeline(registry, scene.seed)?;
        let run = Run { pipeline: contender.name.clone(), reports: Vec::new() };
        Ok(Self { pipeline, seed: scene.seed, run })
    }

    fn all(
        scene: &Scene,
        contenders: &[Contender],
        registry: &Registry,
    ) -> Result<Vec<Self>, TrialError> {
        contenders.iter().map(|contender| Self::new(scene, contender, registry)).collect()
    }

    fn step(&mut self, drawn: &Drawn) -> Result<(), TrialError> {
        let report = self.pipeline.step(&drawn.frame).map_err(|error| TrialError::Step {
            pipeline: self.run.pipeline.clone(),
            seed: self.seed,
            error,
        })?;
        self.run.reports.push(report);
        Ok(())
    }
}
