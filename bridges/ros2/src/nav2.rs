//! Nav2's following server as the driver: a client of its action `FollowObject`.
//!
//! A separate thread gives the server a goal while the switch gives permission, frames arrive, and
//! a person is followed, and cancels it as soon as one of these conditions ends. It waits for no
//! frame, so a pipeline that is stuck ends the goal as well. A goal that ended unexpectedly is not
//! sent again automatically: the conditions have to end first and then hold again, through the
//! button or a person that is found again.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use ros2_client::action::{ActionClient, GoalId, GoalStatusEnum};
use ros2_client::{Message, RmwRequestId};
use serde::Serialize;
use tagalong::core::Reason;

use crate::wheels::{Driver, SwitchHandle};
use crate::{BridgeError, threads};

mod action;

pub(crate) use action::{Feedback, FollowGoal, FollowResult, HUMBLE, HumbleResult, NAV2, Outcome};

/// Time between two checks of the conditions and of the answers.
const TURN: Duration = Duration::from_millis(10);
/// Age of the last frame from which on the goal is cancelled.
const FRAMES: Duration = Duration::from_secs(1);
/// Maximum time to wait for the answer to a goal.
const ACCEPT: Duration = Duration::from_secs(3);
/// Maximum time without feedback, which the server sends fifty times a second.
const FEEDBACK: Duration = Duration::from_secs(2);
/// Time after which a cancellation that is not confirmed is sent again.
const CONFIRM: Duration = Duration::from_millis(500);
/// Maximum time to wait for a confirmation when the bridge ends.
const LAST_WAIT: Duration = Duration::from_secs(2);

/// Returns true for a stop of the pipeline that ends the goal: whatever would stop its own commands
/// stops those of the server as well. A missing target and a start-up are no danger and do not
/// count.
pub(crate) fn ends_goal(reason: Reason) -> bool {
    !reason.moves() && !matches!(reason, Reason::NoTarget | Reason::Settling)
}

/// State of the goal for callers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct GoalReport {
    /// State of the goal: that of the server while it follows.
    pub(crate) state: &'static str,
    /// Time for which the server has followed, s, according to its feedback.
    pub(crate) following_s: f64,
    /// Number of retries of the server.
    pub(crate) retries: u16,
    /// Reason why the last goal ended or was rejected.
    pub(crate) reason: Option<String>,
    /// True while the server has not confirmed that it ends the goal, so that the robot may still
    /// be driving.
    pub(crate) is_unconfirmed: bool,
}

/// State that is shared by the thread and its owner.
#[derive(Default)]
struct Shared {
    /// True once the server is gone from the network.
    is_gone: bool,
    /// Time of the last frame in which a person was followed.
    followed: Option<Instant>,
    report: GoalReport,
    /// Messages for the log.
    told: Vec<String>,
    quits: bool,
}

/// Client of the following server; it cancels its goal when it is dropped.
pub(crate) struct Follower {
    shared: Arc<Mutex<Shared>>,
    thread: Option<JoinHandle<()>>,
}

impl Follower {
    /// Starts the thread; `pose_topic` is the full name of the topic with the target pose.
    ///
    /// # Errors
    /// [`BridgeError::Thread`].
    pub(crate) fn start<R>(
        client: ActionClient<FollowGoal, R, Feedback>,
        pose_topic: String,
        switch: SwitchHandle,
    ) -> Result<Self, BridgeError>
    where
        R: Message + Clone + Into<Outcome> + Send + 'static,
    {
        let shared = Arc::new(Mutex::new(Shared::default()));
        let theirs = Arc::clone(&shared);
        let thread = threads::start("the following server", move || {
            Worker { client, pose_topic, switch, shared: theirs, phase: Phase::Idle }.work();
        })?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Notes a frame, with true if a person is followed in it.
    pub(crate) fn note_frame(&self, follows: bool) {
        lock(&self.shared).followed = follows.then(Instant::now);
    }

    /// Notes whether the server is on the network.
    pub(crate) fn note_server(&self, is_there: bool) {
        lock(&self.shared).is_gone = !is_there;
    }

    /// Returns the state of the goal.
    pub(crate) fn report(&self) -> GoalReport {
        lock(&self.shared).report.clone()
    }

    /// Returns the messages since the last call.
    pub(crate) fn take_told(&self) -> Vec<String> {
        std::mem::take(&mut lock(&self.shared).told)
    }
}

impl Drop for Follower {
    fn drop(&mut self) {
        lock(&self.shared).quits = true;
        self.thread.take().map(JoinHandle::join);
    }
}

fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Goal that the server has accepted, or may have accepted.
#[derive(Clone, Copy)]
struct Goal {
    id: GoalId,
    request: RmwRequestId,
    sent: Instant,
    is_accepted: bool,
    /// Request for its result.
    result: Option<RmwRequestId>,
}

/// Answer of the server to a goal.
enum Answer {
    Accepted(Goal),
    Refused,
}

/// Cancellation of a goal.
#[derive(Clone, Copy)]
struct Cancellation {
    /// First request that was sent.
    first: Option<RmwRequestId>,
    /// Times of the last request and of the first one.
    sent: Instant,
    since: Instant,
    /// True if the conditions have to end before the next goal.
    holds: bool,
}

/// Progress of a goal.
#[derive(Clone, Copy)]
enum Phase {
    /// No goal.
    Idle,
    /// A goal ended unexpectedly; the conditions have to end before the next one.
    Held,
    /// The goal was sent.
    Asking { goal: Goal },
    /// The goal was accepted.
    Following { goal: Goal, heard: Instant },
    /// The goal is being cancelled.
    Cancelling { goal: Goal, cancellation: Cancellation },
}

struct Worker<R>
where
    R: Message + Clone + Into<Outcome> + 'static,
{
    client: ActionClient<FollowGoal, R, Feedback>,
    pose_topic: String,
    switch: SwitchHandle,
    shared: Arc<Mutex<Shared>>,
    phase: Phase,
}

impl<R> Worker<R>
where
    R: Message + Clone + Into<Outcome> + 'static,
{
    fn work(mut self) {
        let mut quits = None;
        loop {
            let wish = self.wish();
            let quitting = lock(&self.shared).quits;
            if quitting && quits.is_none() {
                quits = Some(Instant::now());
            }
            self.phase = self.turn(wish, quitting);
            self.drive();
            let is_over = quits.is_some_and(|since| {
                matches!(self.phase, Phase::Idle | Phase::Held) || since.elapsed() > LAST_WAIT
            });
            if is_over {
                return;
            }
            sleep(TURN);
        }
    }

    /// Returns the reason why the server must not follow, if there is one.
    fn wish(&self) -> Result<(), &'static str> {
        let permission = self.switch.permission();
        if !permission.is_granted() {
            return Err(permission.cause());
        }
        match lock(&self.shared).followed {
            None => Err("no person is followed"),
            Some(frame) if frame.elapsed() > FRAMES => Err("no frames"),
            Some(_) => Ok(()),
        }
    }

    /// Tells the wheels which node drives.
    fn drive(&self) {
        let is_unconfirmed = matches!(
            self.phase,
            Phase::Cancelling { cancellation, .. } if cancellation.since.elapsed() > CONFIRM
        );
        let driver = match self.phase {
            _ if is_unconfirmed => Driver::Unconfirmed,
            Phase::Idle | Phase::Held | Phase::Cancelling { .. } => Driver::Bridge,
            Phase::Asking { .. } | Phase::Following { .. } => Driver::Other,
        };
        self.switch.set_driver(driver);
        let mut shared = lock(&self.shared);
        if is_unconfirmed && !shared.report.is_unconfirmed {
            shared.told.push(
                "Nav2 does not confirm that it ends the goal: the robot may still drive; use its \
                 emergency stop"
                    .to_owned(),
            );
        }
        shared.report.is_unconfirmed = is_unconfirmed;
        match self.phase {
            Phase::Idle => shared.report.state = "no goal",
            Phase::Held => shared.report.state = "goal ended",
            Phase::Asking { .. } => shared.report.state = "goal sent",
            Phase::Cancelling { .. } => shared.report.state = "cancelling",
            Phase::Following { .. } => {}
        }
    }

    fn turn(&mut self, wish: Result<(), &'static str>, quits: bool) -> Phase {
        let wish = if quits { Err("the bridge ends") } else { wish };
        match self.phase {
            Phase::Idle if wish.is_ok() => self.ask(),
            Phase::Held if wish.is_err() => Phase::Idle,
            Phase::Idle | Phase::Held => self.phase,
            Phase::Asking { goal } => self.await_answer(goal, wish),
            Phase::Following { goal, heard } => self.follow(goal, heard, wish),
            Phase::Cancelling { goal, cancellation } => self.await_end(goal, cancellation),
        }
    }

    fn ask(&self) -> Phase {
        // Feedback of an earlier goal is useless, but must not stay in the queue.
        while let Ok(Some(_)) = self.client.feedback_subscription().take() {}
        let goal = FollowGoal::of_topic(&self.pose_topic);
        match self.client.send_goal(goal) {
            Ok((request, id)) => {
                self.tell(format!("Nav2 is given the goal {}", self.pose_topic));
                let sent = Instant::now();
                Phase::Asking { goal: Goal { id, request, sent, is_accepted: false, result: None } }
            }
            Err(error) => self.hold(format!("the goal cannot be sent: {error:?}")),
        }
    }

    fn await_answer(&self, goal: Goal, wish: Result<(), &'static str>) -> Phase {
        match self.answer(goal) {
            Some(Answer::Accepted(goal)) => {
                self.tell("Nav2 follows".to_owned());
                return Phase::Following { goal, heard: Instant::now() };
            }
            Some(Answer::Refused) => return self.hold("Nav2 refuses the goal".to_owned()),
            None => {}
        }
        match wish {
            Err(cause) => self.cancel(goal, cause, false),
            // The goal may still be accepted later.
            Ok(()) if goal.sent.elapsed() > ACCEPT => {
                self.cancel(goal, "Nav2 does not answer", true)
            }
            Ok(()) => Phase::Asking { goal },
        }
    }

    /// Returns the answer of the server to a goal, if it has arrived.
    fn answer(&self, goal: Goal) -> Option<Answer> {
        // An answer that cannot be decoded counts as none.
        let response = self.client.receive_goal_response(goal.request).ok()??;
        if !response.accepted {
            return Some(Answer::Refused);
        }
        let result = self.client.request_result(goal.id).ok();
        Some(Answer::Accepted(Goal { is_accepted: true, result, ..goal }))
    }

    fn follow(&self, goal: Goal, heard: Instant, wish: Result<(), &'static str>) -> Phase {
        let mut heard = heard;
        // The server sends none for a goal that was preempted, or when the server is gone.
        while let Ok(Some(feedback)) = self.client.receive_feedback(goal.id) {
            heard = Instant::now();
            self.note(&feedback);
        }
        if let Some(sentence) = self.ended(goal) {
            return self.hold(sentence);
        }
        match wish {
            Err(cause) => self.cancel(goal, cause, false),
            Ok(()) if heard.elapsed() > FEEDBACK => {
                self.cancel(goal, "no feedback from Nav2", true)
            }
            Ok(()) => Phase::Following { goal, heard },
        }
    }

    /// Returns how the goal ended, if it has ended.
    fn ended(&self, goal: Goal) -> Option<String> {
        let (status, result) = self.client.receive_result(goal.result?).ok()??;
        let outcome: Outcome = result.into();
        Some(match status {
            GoalStatusEnum::Succeeded => {
                format!("Nav2 has followed for {:.1} s", outcome.elapsed_s)
            }
            GoalStatusEnum::Canceled => "Nav2 has cancelled the goal".to_owned(),
            _ => format!("Nav2 gives up: {outcome}"),
        })
    }

    fn cancel(&self, goal: Goal, cause: &str, holds: bool) -> Phase {
        self.tell(format!("Nav2 is told to stop: {cause}"));
        lock(&self.shared).report.reason = Some(cause.to_owned());
        let now = Instant::now();
        let first = self.client.cancel_goal(goal.id).ok();
        let cancellation = Cancellation { first, sent: now, since: now, holds };
        Phase::Cancelling { goal, cancellation }
    }

    fn await_end(&self, goal: Goal, cancellation: Cancellation) -> Phase {
        let mut goal = goal;
        let mut cancellation = cancellation;
        let mut is_due = cancellation.sent.elapsed() > CONFIRM;
        if !goal.is_accepted {
            match self.answer(goal) {
                // The cancellation may have overtaken the goal.
                Some(Answer::Accepted(accepted)) => {
                    goal = accepted;
                    is_due = true;
                }
                Some(Answer::Refused) => {
                    return self.confirm("Nav2 refuses the goal", cancellation);
                }
                None => {}
            }
        }
        if self.is_cancelled(goal, cancellation.first) || self.ended(goal).is_some() {
            return self.confirm("Nav2 confirms the end of the goal", cancellation);
        }
        if lock(&self.shared).is_gone {
            return self.confirm("the following server is gone", cancellation);
        }
        if is_due {
            let request = self.client.cancel_goal(goal.id).ok();
            cancellation.first = cancellation.first.or(request);
            cancellation.sent = Instant::now();
        }
        Phase::Cancelling { goal, cancellation }
    }

    /// Returns true if a request to cancel the goal, the first or a later one, was answered such
    /// that the goal ends.
    fn is_cancelled(&self, goal: Goal, first: Option<RmwRequestId>) -> bool {
        let Some(first) = first else { return false };
        while let Ok(Some((request, response))) = self.client.cancel_client().receive_response() {
            let is_ours = request.writer_gid == first.writer_gid
                && request.sequence_number >= first.sequence_number;
            let ends = match response.return_code as i8 {
                // Rejected.
                1 => false,
                // Unknown goal: a goal without an answer may still be on its way.
                2 => goal.is_accepted || goal.sent.elapsed() > ACCEPT,
                // Cancelled, or already ended.
                _ => true,
            };
            if is_ours && ends {
                return true;
            }
        }
        false
    }

    fn confirm(&self, sentence: &str, cancellation: Cancellation) -> Phase {
        self.tell(sentence.to_owned());
        if cancellation.holds { Phase::Held } else { Phase::Idle }
    }

    fn note(&self, feedback: &Feedback) {
        let mut shared = lock(&self.shared);
        let state = feedback.state_name();
        if shared.report.state != state {
            shared.told.push(format!("Nav2: {state}"));
        }
        shared.report.state = state;
        shared.report.following_s = feedback.following_time.seconds();
        shared.report.retries = feedback.num_retries;
        shared.report.reason = None;
    }

    fn hold(&self, sentence: String) -> Phase {
        lock(&self.shared).report.reason = Some(sentence.clone());
        self.tell(format!(
            "{sentence}; the next goal is sent when the enable is released and pressed, or when \
             the person is found again"
        ));
        Phase::Held
    }

    fn tell(&self, sentence: String) {
        lock(&self.shared).told.push(sentence);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stops_the_pipeline_ends_the_goal() {
        for reason in
            [Reason::Blocked, Reason::TooClose, Reason::Frozen, Reason::Contact, Reason::Silent]
        {
            assert!(ends_goal(reason), "{reason}");
        }
        for reason in
            [Reason::Follow, Reason::Near, Reason::Slow, Reason::NoTarget, Reason::Settling]
        {
            assert!(!ends_goal(reason), "{reason}");
        }
    }
}
