//! Open connections. One thread reads all requests and writes all answers without blocking. Only a
//! complete request gets its own thread, so that a client that sends or reads slowly only costs a
//! buffer.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use super::{Guard, Site};
use crate::http::{Incoming, Request, Response};

/// Largest number of open connections. For a further one, the connection that has waited longest is
/// closed, so that slow clients cannot lock others out. In a test both ends are file descriptors of
/// one process, whose usual limit is 1024.
pub(super) const CONNECTIONS: usize = if cfg!(test) { 200 } else { 512 };

/// Largest number of requests that are answered at the same time, each in a thread.
pub(super) const THREADS: usize = 32;

/// Largest number of connections that are accepted in one turn.
const ACCEPTED_IN_A_TURN: usize = 128;

/// Time limits for a client.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Longest wait for the next bytes of a request, or for a client to read the next bytes of an
    /// answer.
    pub(super) silence: Duration,
    /// Time for a whole request, and then for a free thread.
    pub(super) request: Duration,
    /// Time for a client to read a whole answer.
    pub(super) reading: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            silence: Duration::from_secs(5),
            request: Duration::from_secs(10),
            reading: Duration::from_secs(60),
        }
    }
}

/// Longest pause between two polls of a silent connection.
const LOOK: Duration = Duration::from_millis(50);

/// Largest number of parts of a request that are read in one turn.
const PARTS_IN_A_TURN: usize = 8;

/// Starts a thread.
pub(super) type StartThread = fn(Box<dyn FnOnce() + Send>) -> io::Result<()>;

/// All open connections of a server.
pub(super) struct Connections<S> {
    open: Vec<Connection>,
    /// Answers that were not sent at once.
    unsent: Receiver<Connection>,
    desk: Arc<Desk<S>>,
    start: StartThread,
}

/// State that the answering threads share.
struct Desk<S> {
    guard: Arc<Guard>,
    site: Arc<S>,
    unsent: Sender<Connection>,
    busy: Arc<AtomicUsize>,
}

impl<S: Site> Connections<S> {
    pub(super) fn new(guard: &Arc<Guard>, site: &Arc<S>, start: StartThread) -> Self {
        let (sender, unsent) = channel();
        let guard = Arc::clone(guard);
        let site = Arc::clone(site);
        let busy = Arc::default();
        let desk = Arc::new(Desk { guard, site, unsent: sender, busy });
        Self { open: Vec::new(), unsent, desk, start }
    }

    /// Accepts all waiting connections; returns true if there was one.
    pub(super) fn accept(&mut self, listener: &TcpListener) -> bool {
        for count in 0..ACCEPTED_IN_A_TURN {
            match listener.accept() {
                Ok((stream, _)) => self.take(stream),
                Err(error) => {
                    let is_passing = matches!(
                        error.kind(),
                        ErrorKind::WouldBlock
                            | ErrorKind::Interrupted
                            | ErrorKind::ConnectionAborted
                    );
                    // The process has no more file descriptors, so that the connection of a slow
                    // client is closed.
                    return count > 0 || !is_passing && self.close_oldest();
                }
            }
        }
        true
    }

    fn take(&mut self, stream: TcpStream) {
        let is_full = self.open.len() >= CONNECTIONS;
        if (is_full && !self.close_oldest()) || stream.set_nonblocking(true).is_err() {
            return;
        }
        self.open.push(Connection::new(stream, Work::Reading(Incoming::default())));
    }

    /// Closes the connection that has waited longest; returns false if all are being answered.
    fn close_oldest(&mut self) -> bool {
        fn is_slow(connection: &Connection) -> bool {
            !matches!(connection.work, Work::Whole(_))
        }

        let slow = self.open.iter().enumerate().filter(|(_, connection)| is_slow(connection));
        let oldest = slow.min_by_key(|(_, connection)| connection.since).map(|(at, _)| at);
        oldest.map(|at| self.open.swap_remove(at)).is_some()
    }

    /// Advances every connection as far as possible without waiting; returns true if one made
    /// progress.
    pub(super) fn turn(&mut self) -> bool {
        self.open.extend(self.unsent.try_iter());
        let now = Instant::now();
        let mut has_moved = false;
        for mut connection in std::mem::take(&mut self.open) {
            if !connection.is_due(now) {
                self.open.push(connection);
                continue;
            }
            let step = connection.go_on(now, &self.desk.guard);
            has_moved |= step != Step::Waits;
            match step {
                Step::Ends => {}
                Step::Waits | Step::Moves => self.keep_or_answer(connection),
            }
        }
        has_moved
    }

    fn keep_or_answer(&mut self, connection: Connection) {
        let has_room = self.desk.busy.load(Ordering::Acquire) < THREADS;
        match connection.work {
            Work::Whole(request) if has_room => self.answer(connection.stream, request),
            _ => self.open.push(connection),
        }
    }

    /// Answers a request in a new thread, or in this one if no thread can be started.
    fn answer(&self, stream: TcpStream, request: Request) {
        let seat = Seat::take(&self.desk.busy);
        let job = Job { stream, request, desk: Arc::clone(&self.desk), _seat: seat };
        // The job stays here until its thread runs: a thread that cannot start would drop it.
        let (hand_over, jobs) = channel::<Job<S>>();
        let started = (self.start)(Box::new(move || {
            if let Ok(job) = jobs.recv() {
                job.run();
            }
        }));
        let left =
            if started.is_ok() { hand_over.send(job).map_err(|unsent| unsent.0) } else { Err(job) };
        if let Err(job) = left {
            // A panic of the site must not end the server.
            let _ = catch_unwind(AssertUnwindSafe(|| job.run()));
        }
    }

    /// Returns true if no connection is open.
    pub(super) fn is_empty(&self) -> bool {
        self.open.is_empty() && self.desk.busy.load(Ordering::Acquire) == 0
    }

    /// Closes the connections whose requests are incomplete.
    pub(super) fn close_unread(&mut self) {
        self.open.retain(|connection| !matches!(connection.work, Work::Reading(_)));
    }
}

/// Complete request with its connection, which waits for an answer.
struct Job<S> {
    stream: TcpStream,
    request: Request,
    desk: Arc<Desk<S>>,
    _seat: Seat,
}

impl<S: Site> Job<S> {
    fn run(self) {
        let Self { stream, request, desk, _seat } = self;
        let answer = desk.guard.answer(&request, &*desk.site);
        let bytes = answer.into_bytes(request.method == "HEAD");
        let mut connection = Connection::new(stream, Work::Writing { bytes, sent: 0 });
        // Most answers fit into the buffers of the system.
        if connection.go_on(Instant::now(), &desk.guard) != Step::Ends {
            // A server that has ended sends nothing more.
            let _ = desk.unsent.send(connection);
        }
    }
}

/// Connection of one client.
struct Connection {
    stream: TcpStream,
    work: Work,
    /// Start of this work.
    since: Instant,
    /// Time of the last progress.
    moved: Instant,
    /// Time of the last poll.
    looked: Instant,
}

/// State of a connection.
enum Work {
    /// The request is incomplete.
    Reading(Incoming),
    /// The request waits for a thread.
    Whole(Request),
    /// The answer is being sent.
    Writing { bytes: Vec<u8>, sent: usize },
}

/// Result of one turn of a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// No byte was read or written.
    Waits,
    /// Bytes were read or written.
    Moves,
    /// The connection is finished.
    Ends,
}

impl Connection {
    fn new(stream: TcpStream, work: Work) -> Self {
        let now = Instant::now();
        Self { stream, work, since: now, moved: now, looked: now }
    }

    /// Returns true if it is time for a poll; silent connections are polled less often.
    fn is_due(&self, now: Instant) -> bool {
        let silence = now.saturating_duration_since(self.moved);
        now.saturating_duration_since(self.looked) >= (silence / 8).min(LOOK)
    }

    fn go_on(&mut self, now: Instant, guard: &Guard) -> Step {
        self.looked = now;
        match &mut self.work {
            Work::Reading(_) => self.read(now, guard),
            Work::Whole(_) if now.saturating_duration_since(self.since) > guard.limits.request => {
                self.refuse(
                    now,
                    guard.limits,
                    Response::refusal(503, "all threads are busy; try again"),
                )
            }
            Work::Whole(_) => Step::Waits,
            Work::Writing { .. } => self.write(now, guard.limits),
        }
    }

    fn read(&mut self, now: Instant, guard: &Guard) -> Step {
        let mut part = [0; 4096];
        let mut step = Step::Waits;
        for _ in 0..PARTS_IN_A_TURN {
            let Work::Reading(incoming) = &mut self.work else { break };
            match self.stream.read(&mut part) {
                Ok(0) => {
                    return self.refuse(
                        now,
                        guard.limits,
                        Response::refusal(400, "the request is cut off"),
                    );
                }
                Ok(count) => {
                    (step, self.moved) = (Step::Moves, now);
                    match incoming.take(&part[..count], guard.body_bytes) {
                        Ok(None) => {}
                        Ok(Some(request)) => self.admit(now, guard, request),
                        Err(refusal) => return self.refuse(now, guard.limits, refusal),
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(_) => return Step::Ends,
            }
        }
        let is_late = now.saturating_duration_since(self.since) > guard.limits.request
            || now.saturating_duration_since(self.moved) > guard.limits.silence;
        if is_late && matches!(self.work, Work::Reading(_)) {
            return self.refuse(
                now,
                guard.limits,
                Response::refusal(408, "the request came too slowly"),
            );
        }
        step
    }

    /// Handles a complete request; a refusal needs no thread.
    fn admit(&mut self, now: Instant, guard: &Guard, request: Request) {
        let refusal = guard.admit(&request).err();
        self.since = now;
        self.work = match refusal {
            None => Work::Whole(request),
            Some(refusal) => {
                let bytes = refusal.into_bytes(request.method == "HEAD");
                Work::Writing { bytes, sent: 0 }
            }
        };
    }

    fn refuse(&mut self, now: Instant, limits: Limits, refusal: Response) -> Step {
        (self.since, self.moved) = (now, now);
        self.work = Work::Writing { bytes: refusal.into_bytes(false), sent: 0 };
        self.write(now, limits)
    }

    fn write(&mut self, now: Instant, limits: Limits) -> Step {
        let Work::Writing { bytes, sent } = &mut self.work else { return Step::Waits };
        let mut step = Step::Waits;
        while *sent < bytes.len() {
            match self.stream.write(&bytes[*sent..]) {
                // A browser that has disconnected needs no answer.
                Ok(0) => return Step::Ends,
                Ok(count) => {
                    *sent += count;
                    (step, self.moved) = (Step::Moves, now);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    let is_late = now.saturating_duration_since(self.moved) > limits.silence
                        || now.saturating_duration_since(self.since) > limits.reading;
                    return if is_late { Step::Ends } else { step };
                }
                Err(_) => return Step::Ends,
            }
        }
        Step::Ends
    }
}

/// Slot of one answer, which is also released if its thread panics.
struct Seat(Arc<AtomicUsize>);

impl Seat {
    fn take(busy: &Arc<AtomicUsize>) -> Self {
        busy.fetch_add(1, Ordering::AcqRel);
        Self(Arc::clone(busy))
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}
