//! End of a command: exit codes, failures, and printing.

use std::borrow::Cow;
use std::fmt::Display;
use std::io;
use std::path::Path;

use tagalong_log::LogError;
use tagalong_log::write::WriteError;

/// End of a command that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// Success.
    Well,
    /// Finished, but part of the log was lost or could not be used.
    WithLoss,
    /// Finished, and found a serious problem.
    WithFindings,
    /// Stopped by this signal; the files written until then are valid.
    BySignal(u8),
}

impl Ended {
    /// Returns the end of a command that read a log, of which part may have been lost.
    pub fn with_loss(data_lost: bool) -> Self {
        if data_lost { Self::WithLoss } else { Self::Well }
    }

    /// Returns the exit code.
    pub fn code(self) -> u8 {
        match self {
            Self::Well => 0,
            Self::WithLoss | Self::WithFindings => 3,
            // The shell's convention for a process that a signal ended.
            Self::BySignal(signal) => 128u8.saturating_add(signal),
        }
    }
}

/// Reason of a failed command, as it is shown to the user.
#[derive(Debug, PartialEq, Eq)]
pub struct Failure {
    /// The exit code.
    pub code: u8,
    /// Message with the problem and the remedy; empty if there is no reader.
    pub message: String,
}

impl Failure {
    /// Returns the failure of a job: exit code 1.
    pub fn failed(message: impl Display) -> Self {
        Self { code: 1, message: message.to_string() }
    }

    /// Returns the failure of a request that cannot be fulfilled: exit code 2.
    pub fn usage(message: impl Display) -> Self {
        Self { code: 2, message: message.to_string() }
    }

    /// Returns the silent end after the reader of stdout is gone (`| head`).
    fn nobody_listens() -> Self {
        Self { code: 0, message: String::new() }
    }
}

impl From<WriteError> for Failure {
    /// Converts the error of writing results. A full disk is always reported as such.
    fn from(error: WriteError) -> Self {
        match error {
            full if full.is_disk_full() => disk_full(full),
            refusal if refusal.is_refusal() => Self::usage(refusal),
            failed => Self::failed(failed),
        }
    }
}

/// Returns the failure of a full disk, with the same message and exit code wherever it occurs.
fn disk_full(what: impl Display) -> Failure {
    Failure::failed(format!("the disk is full: {what}; make room, or choose another"))
}

/// Returns true for the error of a full disk.
fn is_full(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded)
}

/// Returns the failure for an output that cannot be created: the user may choose another (exit code
/// 2), unless the disk is full, which gives exit code 1 as at any later time.
pub fn refused(error: WriteError) -> Failure {
    if error.is_disk_full() { error.into() } else { Failure::usage(error) }
}

impl From<LogError> for Failure {
    /// Converts the error of a log: exit code 1 for a log that cannot be used, 2 for invalid
    /// settings.
    fn from(error: LogError) -> Self {
        match error {
            LogError::Settings(_)
            | LogError::WrongTopic { .. }
            | LogError::UnknownTopic { .. }
            | LogError::Source { .. } => Self::usage(error),
            _ => Self::failed(error),
        }
    }
}

/// Result of a command.
pub type Outcome = Result<Ended, Failure>;

/// Remedy for a folder of results that cannot be created.
pub const ANOTHER_OUTPUT: &str = "choose another with -o";

/// Creates a folder for results, with its parents.
///
/// # Errors
/// A folder that cannot be created there, which the user can change: exit code 2.
pub fn make_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| {
        let why = format!("cannot make the folder {}: {error}", folder.display());
        if is_full(&error) {
            disk_full(why)
        } else {
            Failure::usage(format!("{why}; {ANOTHER_OUTPUT}"))
        }
    })
}

/// Writes a whole file, and creates its folder.
///
/// # Errors
/// As for [`make_folder`]; a file that cannot be written: exit code 1.
pub fn write_file(path: &Path, content: impl AsRef<[u8]>) -> Result<(), Failure> {
    make_room_for(path)?;
    std::fs::write(path, content)
        .map_err(|source| WriteError::Io { path: path.to_owned(), source }.into())
}

/// Creates the parent folder of a file.
pub fn make_room_for(file: &Path) -> Result<(), Failure> {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).map_or(Ok(()), make_folder)
}

/// Refuses to replace an existing file unless `overwrite` is set.
///
/// # Errors
/// An existing file: exit code 2.
pub fn spare(file: &Path, overwrite: bool) -> Result<(), Failure> {
    if file.exists() && !overwrite {
        let shown = file.display();
        let why = format!("{shown} exists; give another name with -o, or --overwrite");
        return Err(Failure::usage(why));
    }
    Ok(())
}

/// Message after a signal ended the writing of a log.
pub const CUT_SHORT: &str = "stopped; the log is valid, but ends early";

/// Returns a text without the characters that control a terminal, because names in a log may come
/// from anywhere.
fn harmless(text: &str) -> Cow<'_, str> {
    fn steers(c: char) -> bool {
        // The second part changes the direction of writing.
        (c.is_control() && !matches!(c, '\n' | '\t'))
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    }

    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(
        text.chars()
            .map(|c| if steers(c) { c.escape_unicode().to_string() } else { c.to_string() })
            .collect(),
    )
}

/// Prints to stdout. A closed pipe ends the command silently.
///
/// # Errors
/// If stdout cannot be written: exit code 1.
pub fn print(text: &str) -> Result<(), Failure> {
    // Flushed here, so that a full disk or a closed pipe is noticed before the exit code is
    // determined.
    let mut out = io::stdout().lock();
    let written = io::Write::write_all(&mut out, harmless(text).as_bytes())
        .and_then(|()| io::Write::flush(&mut out));
    written.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => Failure::nobody_listens(),
        _ if is_full(&error) => disk_full(format!("cannot write to stdout: {error}")),
        _ => Failure::failed(format!("cannot write to stdout: {error}")),
    })
}

/// Prints a line to stderr.
pub fn say(text: &str) {
    // One write for the whole line, so that lines of several threads do not mix.
    let line = format!("{}\n", harmless(text));
    let _ = io::Write::write_all(&mut io::stderr().lock(), line.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_the_same_failure_early_and_late() {
        let [early, late] =
            [refused, Failure::from].map(|told| told(write_error(io::ErrorKind::StorageFull)));
        assert_eq!((early.code, &early), (1, &late));
        assert!(
            early.message.contains("the disk is full") && early.message.contains("out/tracks.mcap")
        );
        let printed = disk_full("cannot write out/tracks.mcap: no storage space");
        assert_eq!(early, printed, "a folder, a file and stdout have the same words");
        let denied = refused(write_error(io::ErrorKind::PermissionDenied));
        assert_eq!(denied.code, 2, "another folder helps");
        assert_eq!(Failure::from(write_error(io::ErrorKind::BrokenPipe)).code, 1);
    }

    /// The error of a file that cannot be written.
    fn write_error(kind: io::ErrorKind) -> WriteError {
        WriteError::Io { path: "out/tracks.mcap".into(), source: io::Error::from(kind) }
    }

    #[test]
    fn names_cannot_steer_a_terminal() {
        let plain = "Grüße\tan alle\n";
        assert!(matches!(harmless(plain), Cow::Borrowed(text) if text == plain));
        assert_eq!(harmless("/a\u{1b}[2J"), "/a\\u{1b}[2J");
        assert_eq!(harmless("b\r\u{9b}1m\u{202e}c"), "b\\u{d}\\u{9b}1m\\u{202e}c");
    }
}
