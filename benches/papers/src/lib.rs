//! Tables of the published systems, beside the results of Tagalong.
//!
//! A [`System`] is a published tracker; each of its [`Experiment`]s reproduces one table or figure
//! of its paper and returns [`Findings`]: tables with rows of published numbers and rows of
//! measured ones, and charts. The [`Lab`] provides the simulated scenes, the configs, and runs of
//! pipelines over many seeds.
//!
//! Scenes are simulated from the split `test`: settings and models are chosen on others. The same
//! seeds give the same tables on any number of threads, apart from times.
//!
//! To add a table, write a function `fn(&Lab) -> Result<Findings, ReproduceError>` in the file of
//! its system and name it in the system's list.

pub mod command;
mod draws;
mod findings;
mod forms;
mod given;
mod joint_particle;
mod lab;
mod laser;
mod omni_appearance;
mod planners;
mod printed;
mod real;
pub mod realism;
mod recognition;
mod recorded;
mod rgbd_compressive;
mod scatter;
mod stereo;
mod systems;
mod triangulate;
mod variant;
pub mod webcams;

use tagalong_config::Registry;

/// Registers all plugins of the workspace, those of the printed equations, and planners of others.
pub fn register(registry: &mut Registry) {
    tagalong_catalog::register(registry);
    printed::register(registry);
    planners::register(registry);
}

pub use findings::{Experiment, ExperimentFindings, Findings, Picture, System};
pub use lab::{Lab, Progress, ReproduceError, SimulatedScene, SimulatedScenes};
pub use systems::{SYSTEMS, system};
