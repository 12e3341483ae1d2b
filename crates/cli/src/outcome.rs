use std::fmt::Display;
use std::io;
use std::path::Path;

use tagalong_log::LogError;

/// How a command ended when it did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// All went well.
    Well,
    /// Finished, but part of the log was lost or could not be used.
    WithLoss,
    /// Finished, and found something bad.
    WithFindings,
    /// Stopped by this signal; what was written until then is valid.
    BySignal(u8),
}

impl Ended {
    /// The exit code.
    pub fn code(self) -> u8 {
        match self {
            Self::Well => 0,
            Self::WithLoss | Self::WithFindings => 3,
            Self::BySignal(signal) => 128u8.saturating_add(signal),
        }
    }
}

/// Why a command failed, as it is told to a person.
#[derive(Debug, PartialEq, Eq)]
pub struct Failure {
    /// The exit code.
    pub code: u8,
    /// What is wrong and what to do; empty if there is nobody to tell.
    pub message: String,
}

impl Failure {
    /// The work failed: exit code 1.
    pub fn failed(message: impl Display) -> Self {
        Self { code: 1, message: message.to_string() }
    }

    /// The user asked for something impossible: exit code 2.
    pub fn usage(message: impl Display) -> Self {
        Self { code: 2, message: message.to_string() }
    }

    /// Nobody reads our output any more (`| head`): end quietly.
    fn nobody_listens() -> Self {
        Self { code: 0, message: String::new() }
    }
}

impl From<LogError> for Failure {
    /// A log that cannot be used is exit code 1; settings that cannot are 2.
    fn from(error: LogError) -> Self {
        match error {
            LogError::Settings(_) => Self::usage(error),
            _ => Self::failed(error),
        }
    }
}

/// The result of a command.
pub type Outcome = Result<Ended, Failure>;

/// Makes a folder for results, and those above it.
///
/// # Errors
/// A place where that cannot be is the user's to change: exit code 2.
pub fn make_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| {
        let shown = folder.display();
        Failure::usage(format!("cannot make the folder {shown}: {error}; choose another with -o"))
    })
}

/// Makes the folder in which a file will lie.
///
/// # Errors
/// As [`make_folder`].
pub fn make_room_for(file: &Path) -> Result<(), Failure> {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).map_or(Ok(()), make_folder)
}

/// Spares a file that is there, unless it may be replaced.
///
/// # Errors
/// A file that is there: exit code 2.
pub fn spare(file: &Path, overwrite: bool) -> Result<(), Failure> {
    if file.exists() && !overwrite {
        let shown = file.display();
        let why = format!("{shown} exists; give another name with -o, or --overwrite");
        return Err(Failure::usage(why));
    }
    Ok(())
}

/// What is said where a signal ended the writing of a log.
pub const CUT_SHORT: &str = "stopped; the log is whole, but ends early";

/// Prints to stdout. A closed pipe is a quiet end.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let written =
        io::Write::write_all(&mut out, text.as_bytes()).and_then(|()| io::Write::flush(&mut out));
    written.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => Failure::nobody_listens(),
        _ => Failure::failed(format!("cannot write to stdout: {error}")),
    })
}

/// Says something to the person at the terminal.
pub fn say(text: &str) {
    // If stderr is gone there is nobody to tell.
    let _ = io::Write::write_all(&mut io::stderr().lock(), format!("{text}\n").as_bytes());
}
