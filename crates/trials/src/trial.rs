use cpu_time::ThreadTime;
use nalgebra::Isometry2;
use tagalong_config::Registry;
use tagalong_core::{Funnel, Input, Inputs, Stamp};
use tagalong_eval::EvalError;
use tagalong_geometry::Camera;
use tagalong_pipeline::{FrameReport, Pipeline, StepError};
use tagalong_sim::{CameraKind, Furniture, Scene, Truth};
use tagalong_stereo::{StereoDepth, StereoSettings};

use crate::{Contender, Draw, SimulatedFrame};

/// Reason why a trial has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrialError {
    /// An invalid config, shown with the position of the mistake.
    #[error("{0}")]
    Config(String),
    /// A plugin rejected a frame, or panicked on it.
    #[error("{pipeline}, seed {seed}: {error}")]
    Step {
        /// The contender.
        pipeline: String,
        /// Seed of the scene.
        seed: u64,
        /// Cause.
        error: StepError,
    },
    /// A frame whose stereo pair gives no depth.
    #[error("no depth from the stereo pair: {0}")]
    Pair(String),
    /// Tracks that cannot be scored.
    #[error(transparent)]
    Eval(#[from] EvalError),
    /// The observer could not write the ride.
    #[error("{0}")]
    Witness(String),
    /// A sequence with given boxes that cannot be read.
    #[error("{0}")]
    Given(String),
    /// A worker thread died.
    #[error("a trial panicked; please report this")]
    Panicked,
}

/// Truth of one frame.
#[derive(Clone, Debug)]
pub struct Moment {
    /// Stamp of the frame.
    pub stamp: Stamp,
    /// All people.
    pub truth: Vec<Truth>,
    /// Pose of the robot in the odometry frame, according to the odometry, m and rad.
    pub odom_from_robot: Isometry2<f64>,
    /// True pose of the robot in the world, m and rad.
    pub world_from_robot: Isometry2<f64>,
}

/// Reports of one contender on a scene.
#[derive(Clone, Debug)]
pub struct Run {
    /// Name of the contender.
    pub pipeline: String,
    /// One report per frame, in the order of [`Trial::moments`].
    pub reports: Vec<FrameReport>,
    /// Processor time for them, without rendering, ms.
    pub worked_ms: f64,
}

/// One scene, and the reports of each contender on it.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Seed of the scene.
    pub seed: u64,
    /// The camera, as the pipelines know it.
    pub camera: Camera,
    /// Furniture; positions are in the world.
    pub furniture: Vec<Furniture>,
    /// The frames.
    pub moments: Vec<Moment>,
    /// The contenders, in the order in which they were named.
    pub runs: Vec<Run>,
}

impl Trial {
    /// Renders a scene and runs each contender on the same frames.
    ///
    /// # Errors
    /// An invalid config, or a plugin that fails.
    pub fn new(
        scene: &Scene,
        contenders: &[Contender],
        registry: &Registry,
        threads: usize,
    ) -> Result<Self, TrialError> {
        Self::prepared(scene, contenders, registry, threads, Ok)
    }

    /// Does the same as [`Trial::new`], with depth from a scene's stereo pairs, computed once for
    /// all contenders: their own `[stereo]` stages then have nothing to do.
    ///
    /// # Errors
    /// Also [`TrialError::Config`] for settings that cannot work, and
    /// [`TrialError::Pair`] for a frame without a pair.
    pub fn of_pairs(
        scene: &Scene,
        contenders: &[Contender],
        registry: &Registry,
        stereo: &StereoSettings,
    ) -> Result<Self, TrialError> {
        let settings = StereoSettings { threads: 1, ..stereo.clone() };
        let stereo = StereoDepth::new(settings);
        let mut stereo = stereo.map_err(|error| TrialError::Config(error.to_string()))?;
        Self::prepared(scene, contenders, registry, 1, |simulated: SimulatedFrame| {
            let depth = stereo.depth(&simulated.frame, &mut Funnel::default());
            let depth = depth.map_err(|error| TrialError::Pair(error.to_string()))?;
            Ok(SimulatedFrame { frame: simulated.frame.with_depth(depth), ..simulated })
        })
    }

    fn prepared(
        scene: &Scene,
        contenders: &[Contender],
        registry: &Registry,
        threads: usize,
        mut prepare: impl FnMut(SimulatedFrame) -> Result<SimulatedFrame, TrialError>,
    ) -> Result<Self, TrialError> {
        let mut lanes = Lane::all(scene, contenders, registry)?;
        let all = lanes.iter().map(|lane| lane.pipeline.inputs());
        let inputs = all.reduce(Inputs::union).unwrap_or(Inputs::NONE);
        let mut draw = Draw::new(&without_unused_colour(scene, inputs, false), threads);
        let furniture = draw.simulation().furniture().to_vec();
        let camera = draw.camera().clone();
        let mut moments = Vec::new();
        while let Some(simulated) = draw.next_frame() {
            let simulated = prepare(simulated)?;
            lanes.iter_mut().try_for_each(|lane| lane.step(&simulated))?;
            moments.push(Moment::of(simulated));
        }
        let runs = lanes.into_iter().map(|lane| lane.run).collect();
        Ok(Self { seed: scene.seed, camera, furniture, moments, runs })
    }
}

/// Returns the scene without colour images if no pipeline uses them: they take more than half of
/// the time of an image with depth, and affect nothing else.
pub(crate) fn without_unused_colour(scene: &Scene, inputs: Inputs, are_images_used: bool) -> Scene {
    let mut scene = scene.clone();
    let camera = &mut scene.camera;
    let may_lack_colour = camera.kind == CameraKind::Rgbd && camera.depth_offset_s == 0.0;
    if may_lack_colour && !are_images_used && !inputs.uses(Input::Colour) {
        camera.colour = false;
    }
    scene
}

impl Moment {
    pub(crate) fn of(simulated: SimulatedFrame) -> Self {
        let SimulatedFrame { frame, truth, odom_from_robot, world_from_robot } = simulated;
        Self { stamp: frame.stamp, truth, odom_from_robot, world_from_robot }
    }
}

/// A pipeline while it processes the frames.
struct Lane {
    pipeline: Pipeline,
    seed: u64,
    run: Run,
}

impl Lane {
    fn new(scene: &Scene, contender: &Contender, registry: &Registry) -> Result<Self, TrialError> {
        let pipeline = contender.pipeline(registry, scene.seed)?;
        let run = Run { pipeline: contender.name.clone(), reports: Vec::new(), worked_ms: 0.0 };
        Ok(Self { pipeline, seed: scene.seed, run })
    }

    fn all(
        scene: &Scene,
        contenders: &[Contender],
        registry: &Registry,
    ) -> Result<Vec<Self>, TrialError> {
        contenders.iter().map(|contender| Self::new(scene, contender, registry)).collect()
    }

    fn step(&mut self, simulated: &SimulatedFrame) -> Result<(), TrialError> {
        let before = ThreadTime::now();
        let report = self.pipeline.step(&simulated.frame).map_err(|error| TrialError::Step {
            pipeline: self.run.pipeline.clone(),
            seed: self.seed,
            error,
        })?;
        self.run.worked_ms += 1e3 * before.elapsed().as_secs_f64();
        self.run.reports.push(report);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_pairs(kind: &str, stereo: &StereoSettings) -> Result<Trial, TrialError> {
        let text = format!(
            "duration_s = 0.3\n[camera]\nkind = \"{kind}\"\nwidth = 64\nheight = 48\n\
             [[people]]\npath = [[3.0, 4.0]]\n"
        );
        Trial::of_pairs(&Scene::parse(&text).unwrap(), &[], &Registry::default(), stereo)
    }

    #[test]
    fn depth_comes_from_pairs_and_from_nothing_else() {
        let stereo = StereoSettings::default();
        assert!(!of_pairs("stereo", &stereo).unwrap().moments.is_empty());
        let error = of_pairs("rgbd", &stereo).unwrap_err();
        assert!(matches!(error, TrialError::Pair(_)), "{error}");
        let wrong = StereoSettings { window: 4, ..stereo };
        let error = of_pairs("stereo", &wrong).unwrap_err();
        assert!(matches!(error, TrialError::Config(_)), "{error}");
    }

    #[test]
    fn colours_are_left_out_where_nobody_looks_at_them() {
        fn renders_colour(settings: &str, inputs: Inputs, are_images_used: bool) -> bool {
            let scene = Scene::parse(&format!("duration_s = 1.0\n{settings}")).unwrap();
            without_unused_colour(&scene, inputs, are_images_used).camera.colour
        }

        let depth = Inputs::NONE.require(Input::Depth);
        assert!(!renders_colour("", depth, false));
        assert!(renders_colour("", depth.accept(Input::Colour), false));
        assert!(renders_colour("", depth, true), "a log of the ride has its images");
        // Scenes that may not be without.
        assert!(renders_colour("[camera]\ndepth_offset_s = 0.01\n", depth, false));
        assert!(renders_colour("[camera]\nkind = \"stereo\"\n", depth, false));
    }
}
