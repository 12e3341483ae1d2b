//! Second pass over the files of a log, one after the other.

use std::sync::Arc;

use super::assembly::Messages;
use crate::packed::LogFile;
use crate::scan::{LogPart, Scan};
use crate::walk::Message;
use crate::walker::LogWalker;
use crate::{Limits, LogError};

/// Messages of all files of a log, in the order of recording.
pub(super) struct PartsWalker {
    scan: Arc<Scan>,
    limits: Limits,
    walker: LogWalker<LogFile>,
    /// Number of files that have been opened.
    opened: usize,
    /// Bytes of the files that are finished.
    finished_bytes: u64,
    /// Damage of the files that are finished.
    faults: Vec<String>,
}

impl PartsWalker {
    /// Opens the first file.
    ///
    /// # Errors
    /// A file that cannot be opened or is not MCAP.
    pub(super) fn new(scan: &Arc<Scan>, limits: &Limits) -> Result<Self, LogError> {
        let first = scan.parts.first().ok_or_else(|| LogError::Open {
            path: scan.path.clone(),
            source: std::io::ErrorKind::NotFound.into(),
        })?;
        Ok(Self {
            walker: open_part(first, limits)?,
            scan: Arc::clone(scan),
            limits: limits.clone(),
            opened: 1,
            finished_bytes: 0,
            faults: Vec::new(),
        })
    }

    /// Returns the number of bytes that have been read.
    pub(super) fn position(&self) -> u64 {
        self.finished_bytes + self.walker.position()
    }

    /// Returns true if some part of the files could not be used.
    pub(super) fn data_lost(&self) -> bool {
        self.walker.data_lost() || !self.faults.is_empty()
    }

    /// Describes the damage.
    pub(super) fn notes(&self) -> String {
        let faults = self.faults.iter().chain(self.walker.notes());
        faults.map(String::as_str).collect::<Vec<_>>().join("; ")
    }

    /// Continues with the next file; returns false if there is none. A file that vanished since the
    /// first pass is a fault, and reading continues behind it.
    fn open_next(&mut self) -> bool {
        let Some(part) = self.scan.parts.get(self.opened) else { return false };
        // Incremented before the file is opened, so that one that fails is not tried again.
        self.opened += 1;
        match open_part(part, &self.limits) {
            Ok(walker) => {
                let finished = std::mem::replace(&mut self.walker, walker);
                self.finished_bytes += finished.position();
                if finished.data_lost() {
                    self.faults.extend(finished.notes().iter().cloned());
                }
            }
            Err(error) => self.faults.push(error.to_string()),
        }
        true
    }
}

impl Messages for PartsWalker {
    fn next_message(&mut self) -> Option<Message<'_>> {
        // An empty file is not the end of the log.
        while !self.walker.advance() && self.open_next() {}
        self.walker.message()
    }
}

fn open_part(part: &LogPart, limits: &Limits) -> Result<LogWalker<LogFile>, LogError> {
    let walker = LogWalker::open(&part.path, limits)?;
    Ok(walker.knowing(part.channels.iter().cloned()))
}
