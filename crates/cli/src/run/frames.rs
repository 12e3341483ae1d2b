use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tagalong_app::outcome::Failure;
use tagalong_app::signals::Signals;
use tagalong_log::{FrameSource, LogFrame};

/// Frames that are decoded ahead; each holds its images.
const AHEAD: usize = 2;

/// Longest wait for a reader that hangs on its input.
const PATIENCE: Duration = Duration::from_millis(500);

/// Frame with the reading progress.
pub struct Item {
    /// The frame.
    pub frame: LogFrame,
    /// Part of the log that is read, 0 to 1.
    pub progress: f64,
}

/// Frames of a log, decoded here or in a separate thread.
pub enum Frames {
    /// One after the other.
    Here(Box<FrameSource>),
    /// Ahead of the pipeline.
    Ahead(Receiver<Item>, JoinHandle<Option<FrameSource>>),
}

impl Frames {
    /// Reads ahead if there is more than one thread, and the system starts another.
    pub fn new(source: FrameSource, threads: usize) -> Self {
        if threads < 2 {
            return Self::Here(Box::new(source));
        }
        // Bounded, because each waiting frame holds its images.
        let (sender, receiver) = sync_channel(AHEAD);
        // The source stays here until the thread runs: one that cannot start would drop it.
        let (hand_over, sources) = channel();
        let reader = thread::Builder::new()
            .name("reader".into())
            .spawn(move || sources.recv().ok().map(|source| read_all(source, &sender)));
        let Ok(reader) = reader else { return Self::Here(Box::new(source)) };
        match hand_over.send(source) {
            Ok(()) => Self::Ahead(receiver, reader),
            Err(unsent) => Self::Here(Box::new(unsent.0)),
        }
    }

    /// Returns the next frame; `None` at the end, or after a stop signal.
    pub fn next(&mut self, signals: &Signals) -> Option<Item> {
        loop {
            if signals.received().is_some() {
                return None;
            }
            match self {
                Self::Here(source) => return read_one(source),
                // A reader that waits for a slow pipe must not keep us from noticing a signal.
                Self::Ahead(items, _) => match items.recv_timeout(Duration::from_millis(50)) {
                    Err(RecvTimeoutError::Timeout) => {}
                    received => return received.ok(),
                },
            }
        }
    }

    /// Returns the source, with its counters; `None` if it hangs on its input.
    ///
    /// # Errors
    /// If the reader panicked.
    pub fn finish(self) -> Result<Option<FrameSource>, Failure> {
        let (items, reader) = match self {
            Self::Here(source) => return Ok(Some(*source)),
            Self::Ahead(items, reader) => (items, reader),
        };
        // Without a receiver, a reader that waits to send gives up.
        drop(items);
        let waiting = Instant::now();
        while !reader.is_finished() && waiting.elapsed() < PATIENCE {
            thread::sleep(Duration::from_millis(2));
        }
        if !reader.is_finished() {
            return Ok(None);
        }
        reader
            .join()
            .map_err(|_| Failure::failed("the log reader failed; please report this with the log"))
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
