use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tagalong_log::{FrameSource, LogFrame};

use crate::outcome::Failure;
use crate::signals::Signals;

/// Frames that are decoded ahead; each holds its images.
const AHEAD: usize = 2;

/// How long a reader that hangs on its input is waited for.
const PATIENCE: Duration = Duration::from_millis(500);

/// A frame, and how much of the log is read, 0 to 1.
pub struct Item {
    /// The frame.
    pub frame: LogFrame,
    /// The part of the log that is read.
    pub progress: f64,
}

/// The frames of a log, decoded here or in a thread of their own.
pub enum Frames {
    /// One after the other.
    Here(Box<FrameSource>),
    /// Ahead of the pipeline.
    Ahead(Receiver<Item>, JoinHandle<FrameSource>),
}

impl Frames {
    /// Reads ahead if there is more than one thread.
    pub fn new(source: FrameSource, threads: usize) -> Self {
        if threads < 2 {
            return Self::Here(Box::new(source));
        }
        let (sender, receiver) = sync_channel(AHEAD);
        Self::Ahead(receiver, thread::spawn(move || read_all(source, &sender)))
    }

    /// The next frame; `None` at the end, or when somebody wants to stop.
    pub fn next(&mut self, signals: &Signals) -> Option<Item> {
        loop {
            if signals.received().is_some() {
                return None;
            }
            match self {
                Self::Here(source) => return read_one(source),
                // A reader that waits for a slow pipe must not keep us from
                // noticing a signal.
                Self::Ahead(items, _) => match items.recv_timeout(Duration::from_millis(50)) {
                    Err(RecvTimeoutError::Timeout) => {}
                    received => return received.ok(),
                },
            }
        }
    }

    /// The source, with what it counted; `None` if it hangs on its input.
    ///
    /// # Errors
    /// If the reader panicked.
    pub fn finish(self) -> Result<Option<FrameSource>, Failure> {
        let (items, reader) = match self {
            Self::Here(source) => return Ok(Some(*source)),
            Self::Ahead(items, reader) => (items, reader),
        };
        drop(items);
        let waiting = Instant::now();
        while !reader.is_finished() && waiting.elapsed() < PATIENCE {
            thread::sleep(Duration::from_millis(2));
        }
        if !reader.is_finished() {
            return Ok(None);
        }
        let broken = |_| Failure::failed("the log reader failed; please report this with the log");
        reader.join().map(Some).map_err(broken)
    }
}

fn read_one(source: &mut FrameSource) -> Option<Item> {
    let frame = source.next_frame()?;
    Some(Item { frame, progress: source.progress() })
}

fn read_all(mut source: FrameSource, sender: &SyncSender<Item>) -> FrameSource {
    while let Some(item) = read_one(&mut source) {
        if sender.send(item).is_err() {
            break;
        }
    }
    source
}
