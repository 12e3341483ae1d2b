//! The program and the pipelines of Tagalong as the Python module `tagalong._tagalong`.
//!
//! `python/tagalong/__init__.py` is the public module, and `_tagalong.pyi` beside it has the types.
//! Images are checked and copied once, into the memory layout of a frame; the GIL is released while
//! a pipeline, a log or a run works.

mod arrays;
mod camera;
mod commands;
mod doubts;
mod errors;
mod frames;
mod pipeline;
mod report;

use pyo3::prelude::*;

/// Pipelines, cameras, logs, and the commands of the program.
#[pymodule]
mod _tagalong {
    #[pymodule_export]
    use super::camera::PyCamera;
    #[pymodule_export]
    use super::commands::{main, run, scores};
    #[pymodule_export]
    use super::errors::{ConfigError, TagalongError};
    #[pymodule_export]
    use super::frames::{PyFrame, PyFrames};
    #[pymodule_export]
    use super::pipeline::PyPipeline;
    #[pymodule_export]
    use super::report::{PyCommand, PyReport, PyTrack};
    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
