//! Exceptions.

use std::fmt::Display;

use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use tagalong_app::outcome::Failure;

create_exception!(
    tagalong,
    TagalongError,
    PyRuntimeError,
    "A log that cannot be used, a plugin that failed, or a disk that is full."
);
create_exception!(
    tagalong,
    ConfigError,
    PyValueError,
    "A config, or an argument, that cannot be used; shown with its line and the remedy."
);

/// Exit code for wrong usage and invalid configs.
const USAGE: u8 = 2;

/// Returns the exception for a failed command.
pub fn raised(failure: impl Into<Failure>) -> PyErr {
    let failure = failure.into();
    match failure.code {
        USAGE => ConfigError::new_err(failure.message),
        _ => TagalongError::new_err(failure.message),
    }
}

/// Returns the exception for work that failed.
pub fn failed(why: impl Display) -> PyErr {
    TagalongError::new_err(why.to_string())
}

/// Returns the exception for an argument with an invalid value.
pub fn wrong(why: impl Display) -> PyErr {
    PyValueError::new_err(why.to_string())
}
