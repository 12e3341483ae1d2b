//! The built-in log: two simulated people walk past each other in front of a slowly moving robot.
//! It is used if the user gives no log.

use std::path::Path;

use tagalong_app::threads::threads;
use tagalong_log::write::WriteError;
use tagalong_sim::{Scene, Simulation};

use crate::record;

const SCENE: &str = include_str!("../configs/scenes/sample.toml");

/// Simulates the log and writes it to `path`.
///
/// # Errors
/// [`WriteError`] if the file cannot be written.
#[expect(clippy::expect_used, reason = "the scene is part of the program, and a test reads it")]
pub fn write(path: &Path) -> Result<(), WriteError> {
    let scene = Scene::parse(SCENE).expect("the built-in scene is right");
    record(Simulation::new(&scene, threads(None)), &scene, path, &|| true).map(|_| ())
}
