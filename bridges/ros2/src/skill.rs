//! Desk at which callers leave their requests: enroll, clear, status, health.
//!
//! Services and HTTP have their own threads; the pipeline belongs to another thread, which takes a
//! request between two frames. A status is a copy of that after the last frame, so that it is
//! available even while a frame takes long.

use std::fmt;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;
use tagalong::pipeline::{Enrollment, FollowStatus, Permission};

use crate::nav2::GoalReport;

/// Maximum time to wait for an answer of the pipeline.
const PATIENCE: Duration = Duration::from_secs(2);
/// Maximum number of waiting requests; further ones are rejected.
const WAITING: usize = 16;
/// Time without a frame from which on the bridge is unhealthy.
const SILENCE: Duration = Duration::from_secs(2);
/// Time in one frame from which on the pipeline counts as stuck.
pub(crate) const STUCK: Duration = Duration::from_millis(500);

/// Rejection while the node is not active, and reason for its latch.
pub(crate) const NOT_ACTIVE: &str = "the node is not active";

/// Change that a caller requests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verb {
    /// Follow the person of this request.
    Enroll(Enrollment),
    /// Follow no person.
    Clear,
}

impl fmt::Display for Verb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Clear => write!(f, "clear"),
            Self::Enroll(Enrollment { person, .. }) => write!(f, "enroll {person}"),
        }
    }
}

/// Request with the channel for its answer, which is a rejection in words or success.
pub(crate) struct Request {
    pub(crate) verb: Verb,
    pub(crate) answer: SyncSender<Result<(), String>>,
}

/// Rejection of a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The pipeline rejects it, for this reason.
    Refused(String),
    /// The pipeline did not answer in time.
    Busy(&'static str),
}

impl Refusal {
    /// Returns the reason in words.
    pub(crate) fn reason(&self) -> &str {
        match self {
            Self::Refused(reason) => reason,
            Self::Busy(reason) => reason,
        }
    }
}

/// State of the bridge for a caller.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BridgeStatus {
    /// State of following; null without a controller or before the first frame.
    #[serde(flatten)]
    pub(crate) follow: Option<FollowStatus>,
    /// Permission of the deadman's switch to move, in words.
    pub(crate) permission: Option<&'static str>,
    /// Reason why the robot cannot be enabled, in words: the enable has no publisher.
    pub(crate) note: Option<String>,
    /// Frames that the pipeline processed.
    pub(crate) frames: u64,
    /// Time since the last frame, s; null before the first.
    pub(crate) frame_age_s: Option<f64>,
    /// State of the managed node.
    pub(crate) lifecycle: &'static str,
    /// State of the goal of Nav2's following server; null if this program drives.
    pub(crate) nav2: Option<GoalReport>,
}

/// Health of the bridge.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Health {
    /// True while frames are processed and no fault stops the robot.
    pub(crate) ok: bool,
    /// Reason if not.
    pub(crate) reason: Option<String>,
    /// Reason why the robot cannot be enabled, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) note: Option<String>,
}

/// The desk; clones share the same state.
#[derive(Clone)]
pub(crate) struct Desk {
    requests: SyncSender<Request>,
    shared: Arc<Mutex<Shared>>,
}

#[derive(Default)]
struct Shared {
    follow: Option<FollowStatus>,
    permission: Option<Permission>,
    note: Option<String>,
    frames: u64,
    frame: Option<Instant>,
    /// End of the last iteration of the loop, which processes one frame.
    turn: Option<Instant>,
    /// True once the pipeline accepts requests.
    is_open: bool,
    lifecycle: &'static str,
    nav2: Option<GoalReport>,
}

impl Desk {
    /// Returns a desk, and the requests for the thread of the pipeline.
    pub(crate) fn new() -> (Self, Receiver<Request>) {
        let (requests, waiting) = sync_channel(WAITING);
        (Self { requests, shared: Arc::default() }, waiting)
    }

    /// Accepts requests from now on.
    pub(crate) fn open(&self) {
        self.lock().is_open = true;
    }

    /// Rejects requests, until [`Desk::open`], in this state of the node.
    pub(crate) fn close(&self, lifecycle: &'static str) {
        // Earlier data says nothing about the present state of the bridge.
        *self.lock() = Shared { lifecycle, ..Shared::default() };
    }

    /// Sets the state of the goal of the following server.
    pub(crate) fn set_goal(&self, report: GoalReport) {
        self.lock().nav2 = Some(report);
    }

    /// Sets the state after a frame.
    pub(crate) fn frame(&self, follow: Option<FollowStatus>, frames: u64) {
        let mut shared = self.lock();
        (shared.follow, shared.frames, shared.frame) = (follow, frames, Some(Instant::now()));
    }

    /// Sets the state after an iteration of the loop, and after a request; `note` is the reason why
    /// the robot cannot be enabled.
    pub(crate) fn turn(
        &self,
        permission: Option<Permission>,
        fault: Option<&'static str>,
        note: Option<String>,
    ) {
        let mut shared = self.lock();
        (shared.permission, shared.turn) = (permission, Some(Instant::now()));
        shared.note = note;
        if let Some(follow) = &mut shared.follow {
            follow.fault = fault;
        }
    }

    fn check_open(&self) -> Result<(), Refusal> {
        let shared = self.lock();
        match shared.lifecycle {
            _ if shared.is_open => Ok(()),
            "" | "active" => Err(Refusal::Busy("still waiting for the topics of the robot")),
            _ => Err(Refusal::Busy(NOT_ACTIVE)),
        }
    }

    /// Passes a request to the pipeline and waits for its answer.
    pub(crate) fn ask(&self, verb: Verb) -> Result<(), Refusal> {
        self.check_open()?;
        let (answer, answered) = sync_channel(1);
        self.requests.try_send(Request { verb, answer }).map_err(|error| match error {
            TrySendError::Full(_) => Refusal::Busy("too many requests are waiting"),
            TrySendError::Disconnected(_) => Refusal::Busy("the bridge ends"),
        })?;
        match answered.recv_timeout(PATIENCE) {
            Ok(answer) => answer.map_err(Refusal::Refused),
            Err(_) => Err(Refusal::Busy("the pipeline is stuck in a frame: it may answer later")),
        }
    }

    /// Returns the state after the last frame.
    pub(crate) fn status(&self) -> BridgeStatus {
        let shared = self.lock();
        BridgeStatus {
            follow: shared.follow.clone(),
            permission: shared.permission.map(Permission::cause),
            note: shared.note.clone(),
            frames: shared.frames,
            frame_age_s: shared.frame.map(|at| at.elapsed().as_secs_f64()),
            lifecycle: shared.lifecycle,
            nav2: shared.nav2.clone(),
        }
    }

    /// Returns the health of the bridge.
    pub(crate) fn health(&self) -> Health {
        let shared = self.lock();
        let fault = shared.follow.as_ref().and_then(|follow| follow.fault);
        let stuck = shared.turn.map(|at| at.elapsed()).filter(|since| *since > STUCK);
        let is_unconfirmed = shared.nav2.as_ref().is_some_and(|goal| goal.is_unconfirmed);
        let reason = match (stuck, shared.frame, fault) {
            _ if !["", "active"].contains(&shared.lifecycle) => {
                Some(format!("the node is {}", shared.lifecycle))
            }
            _ if is_unconfirmed => Some("Nav2 does not confirm that it stops".to_owned()),
            (Some(since), ..) => Some(format!("one frame takes {:.1} s", since.as_secs_f64())),
            (_, None, _) => Some("no frame yet".to_owned()),
            (_, Some(at), _) if at.elapsed() > SILENCE => {
                Some(format!("no frame for {:.1} s", at.elapsed().as_secs_f64()))
            }
            (.., Some(fault)) => Some(format!("fault: {fault}")),
            _ => None,
        };
        Health { ok: reason.is_none(), reason, note: shared.note.clone() }
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use tagalong::pipeline::Choice;

    use super::*;

    #[test]
    fn a_request_waits_for_the_pipeline_and_brings_its_answer_back() {
        let (desk, requests) = Desk::new();
        let before = desk.ask(Verb::Clear).unwrap_err();
        assert_eq!(before.reason(), "still waiting for the topics of the robot");
        desk.open();
        let pipeline = thread::spawn(move || {
            let answers = [Ok(()), Err("no person".to_owned())];
            let verbs = answers.map(|answer| {
                let request = requests.recv().unwrap();
                request.answer.send(answer).unwrap();
                request.verb
            });
            (verbs, requests)
        });
        let nearest = Verb::Enroll(Enrollment::of(Choice::Nearest));
        assert_eq!(desk.ask(Verb::Clear), Ok(()));
        assert_eq!(desk.ask(nearest), Err(Refusal::Refused("no person".into())));
        let (verbs, requests) = pipeline.join().unwrap();
        assert_eq!(verbs, [Verb::Clear, nearest]);
        // The pipeline is stuck, and then gone.
        let stuck = desk.ask(Verb::Clear).unwrap_err();
        assert!(stuck.reason().contains("stuck in a frame"), "{stuck:?}");
        drop(requests);
        assert_eq!(desk.ask(Verb::Clear), Err(Refusal::Busy("the bridge ends")));
    }

    #[test]
    fn a_node_that_is_not_active_refuses_requests_and_is_not_well() {
        let (desk, _requests) = Desk::new();
        desk.open();
        desk.frame(None, 1);
        desk.turn(Some(Permission::NotEnabled), None, None);
        desk.close("inactive");
        assert_eq!(desk.ask(Verb::Clear).unwrap_err().reason(), NOT_ACTIVE);
        assert_eq!(desk.health().reason.as_deref(), Some("the node is inactive"));
        let status = desk.status();
        assert_eq!((status.permission, status.frames, status.lifecycle), (None, 0, "inactive"));
        desk.close("active");
        let waits = desk.ask(Verb::Clear).unwrap_err();
        assert_eq!(waits.reason(), "still waiting for the topics of the robot");
        assert_eq!(desk.health().reason.as_deref(), Some("no frame yet"));
        desk.open();
        desk.frame(None, 2);
        desk.turn(Some(Permission::NotEnabled), None, None);
        assert!(desk.health().ok);
        desk.set_goal(GoalReport { is_unconfirmed: true, ..GoalReport::default() });
        assert_eq!(desk.health().reason.as_deref(), Some("Nav2 does not confirm that it stops"));
    }

    #[test]
    fn the_bridge_is_well_while_frames_come() {
        let (desk, _requests) = Desk::new();
        assert_eq!(desk.health().reason.as_deref(), Some("no frame yet"));
        desk.frame(None, 1);
        desk.turn(Some(Permission::NotEnabled), None, None);
        assert_eq!(desk.health(), Health { ok: true, reason: None, note: None });
        assert_eq!(desk.status().permission, Some("not enabled"));
        let nobody = Some("nobody publishes people/enable".to_owned());
        desk.turn(Some(Permission::NotEnabled), None, nobody.clone());
        assert_eq!(desk.health(), Health { ok: true, reason: None, note: nobody.clone() });
        assert_eq!(desk.status().note, nobody);
        desk.turn(Some(Permission::NotEnabled), None, None);
        thread::sleep(STUCK + Duration::from_millis(50));
        assert!(desk.health().reason.unwrap().starts_with("one frame takes 0."), "stuck");
        thread::sleep(SILENCE - STUCK);
        desk.turn(Some(Permission::NotEnabled), None, None);
        assert!(desk.health().reason.unwrap().starts_with("no frame for 2."));
    }
}
