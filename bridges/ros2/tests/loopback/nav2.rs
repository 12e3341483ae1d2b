//! A following server as Nav2 has it, which is given goals.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle, sleep};
use std::time::{Duration, Instant};

use ros2_client::action::{
    ActionServerQosPolicies, GetResultResponse, GoalId, GoalInfo, GoalStatusEnum, SendGoalResponse,
};
use ros2_client::action_msgs::{CancelGoalResponse, CancelGoalResponseEnum};
use ros2_client::builtin_interfaces::Time;
use ros2_client::{ActionServer, ActionTypeName, Message, RmwRequestId, ServiceMapping};
use serde::{Deserialize, Serialize};
use tagalong::log::msgs::TwistStamped;
use tagalong_ros2::Options;
use tagalong_sim::Simulation;

use crate::peers::*;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Span {
    sec: i32,
    nanosec: u32,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Goal {
    pose_topic: String,
    tracked_frame: String,
    max_duration: Span,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Outcome {
    total_elapsed_time: Span,
    error_code: u16,
    num_retries: u16,
    error_msg: String,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Feedback {
    state: u16,
    following_time: Span,
    num_retries: u16,
}

impl Message for Goal {}
impl Message for Outcome {}
impl Message for Feedback {}

/// Behaviour of the server.
const OBEYS: u8 = 0;
const REFUSES: u8 = 1;
/// It ends the goal by an error.
const ABORTS: u8 = 2;
/// It answers no cancellation.
const IS_DEAF: u8 = 3;
/// It sends no feedback.
const IS_SILENT: u8 = 4;

/// Events at the server.
#[derive(Clone, Debug, PartialEq)]
enum Happened {
    Goal(String),
    Cancelled,
}

struct Server {
    mode: Arc<AtomicU8>,
    happened: Arc<Mutex<Vec<(Instant, Happened)>>>,
    thread: JoinHandle<()>,
}

type Action = ActionServer<Goal, Outcome, Feedback>;

impl Server {
    fn start(domain: u16, stop: &Arc<AtomicBool>) -> Self {
        let mut peer = Peer::join(domain, "following_server");
        let qos = ActionServerQosPolicies {
            goal_service: reliable(),
            result_service: reliable(),
            cancel_service: reliable(),
            feedback_publisher: reliable(),
            status_publisher: reliable(),
        };
        let kind = ActionTypeName::new("nav2_msgs", "FollowObject");
        let mapping = ServiceMapping::Enhanced;
        let action: Action =
            peer.node.create_action_server(mapping, &name("/follow_object"), &kind, qos).unwrap();
        let mode = Arc::new(AtomicU8::new(REFUSES));
        let happened = Arc::new(Mutex::new(Vec::new()));
        let theirs = Arc::clone(&mode);
        let log = Arc::clone(&happened);
        let stop = Arc::clone(stop);
        let thread = thread::spawn(move || {
            let _peer = peer;
            let mut goal: Option<GoalId> = None;
            let mut waiting: Option<RmwRequestId> = None;
            while !stop.load(Ordering::Relaxed) {
                let mode = theirs.load(Ordering::Relaxed);
                take_goals(&action, mode, &mut goal, &log);
                if let Ok(Some((request, _))) = action.receive_result_request() {
                    waiting = Some(request);
                }
                if mode != IS_DEAF && take_cancellation(&action, goal, &log) {
                    end(&action, waiting.take(), GoalStatusEnum::Canceled, Outcome::default());
                    goal = None;
                }
                if mode == ABORTS && goal.is_some() && waiting.is_some() {
                    let error_msg = "no pose".to_owned();
                    let outcome = Outcome { error_code: 902, error_msg, ..Outcome::default() };
                    end(&action, waiting.take(), GoalStatusEnum::Aborted, outcome);
                    goal = None;
                }
                if let Some(id) = goal.filter(|_| mode != IS_SILENT) {
                    let following_time = Span { sec: 3, nanosec: 0 };
                    let feedback = Feedback { state: 2, following_time, num_retries: 1 };
                    let _full = action.send_feedback(id, feedback);
                }
                sleep(Duration::from_millis(20));
            }
        });
        Self { mode, happened, thread }
    }

    fn set(&self, mode: u8) {
        self.mode.store(mode, Ordering::Relaxed);
    }

    fn since(&self, then: Instant) -> Vec<Happened> {
        let all = self.happened.lock().unwrap().clone();
        all.into_iter().filter(|(at, _)| *at > then).map(|(_, happened)| happened).collect()
    }

    /// Waits for something that happens after `then`.
    fn wait(&self, wanted: &Happened, then: Instant, patience: Duration) {
        while !self.since(then).contains(wanted) {
            assert!(then.elapsed() < patience, "{wanted:?} is not in {:?}", self.since(then));
            sleep(Duration::from_millis(10));
        }
    }
}

fn take_goals(
    action: &Action,
    mode: u8,
    goal: &mut Option<GoalId>,
    log: &Mutex<Vec<(Instant, Happened)>>,
) {
    if let Ok(Some((request, asked))) = action.receive_goal() {
        let accepted = mode != REFUSES;
        log.lock().unwrap().push((Instant::now(), Happened::Goal(asked.goal.pose_topic)));
        let answer = SendGoalResponse { accepted, stamp: Time::now() };
        action.send_goal_response(request, answer).unwrap();
        if accepted {
            *goal = Some(asked.goal_id);
        }
    }
}

/// Answers a cancellation, if one came; returns true if it was that of the goal.
fn take_cancellation(
    action: &Action,
    goal: Option<GoalId>,
    log: &Mutex<Vec<(Instant, Happened)>>,
) -> bool {
    let Ok(Some((request, _))) = action.receive_cancel_request() else { return false };
    log.lock().unwrap().push((Instant::now(), Happened::Cancelled));
    let goals_canceling: Vec<GoalInfo> =
        goal.into_iter().map(|goal_id| GoalInfo { goal_id, stamp: Time::ZERO }).collect();
    let return_code = if goals_canceling.is_empty() {
        CancelGoalResponseEnum::UnknownGoal
    } else {
        CancelGoalResponseEnum::None
    };
    let response = CancelGoalResponse { return_code, goals_canceling };
    action.send_cancel_response(request, response).unwrap();
    goal.is_some()
}

fn end(action: &Action, waiting: Option<RmwRequestId>, status: GoalStatusEnum, result: Outcome) {
    if let Some(request) = waiting {
        action.send_result(request, GetResultResponse { status, result }).unwrap();
    }
}

/// The server refuses, follows, gives up, falls silent, and is deaf; the hand presses and lets go.
#[test]
#[ignore = "waits for messages for a minute"]
fn nav2_has_a_goal_while_the_switch_is_held_and_zeros_go_out_when_it_is_cancelled() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let begun = Instant::now();
    let simulation = Simulation::new(&standing(90.0), 1);
    let mut robot = Robot::new(domain(16), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let options =
        Options { follow_object: Some("follow_object".into()), ..options(domain(16), "20") };
    let (bridge, said) = bridge_with(options, tagalong::builtin_registry(), &stop);
    let hand = Hand::new(domain(16), &stop);
    let server_stop = Arc::new(AtomicBool::new(false));
    let server = Server::start(domain(16), &server_stop);
    let ends = Arc::clone(&stop);
    let playing = thread::spawn(move || {
        robot.play_while(simulation, &|_| !ends.load(Ordering::Relaxed));
        robot
    });
    let goal = Happened::Goal("/people/target_pose".into());
    let soon = Duration::from_secs(15);
    wait_for(&said, "found the action follow_object (nav2_msgs/action/FollowObject)");
    assert!(server.since(begun).is_empty(), "no goal before a press");

    hand.let_go(&said);
    server.wait(&goal, begun, soon);
    wait_for(&said, "Nav2 refuses the goal");
    let refused = Instant::now();
    sleep(Duration::from_millis(1000));
    assert!(server.since(refused).is_empty(), "no other goal by itself");

    server.set(OBEYS);
    let pressed = Instant::now();
    hand.press_again();
    server.wait(&goal, pressed, soon);
    wait_for(&said, "Nav2: drives");
    sleep(Duration::from_millis(200));
    let drives = Instant::now();
    sleep(Duration::from_millis(1000));
    let beside = commands.so_far().iter().filter(|(at, _)| *at > drives).count();
    assert_eq!(beside, 0, "Nav2 alone drives");

    let released = Instant::now();
    hand.hold(false);
    server.wait(&Happened::Cancelled, released, Duration::from_millis(100 + 500 + 400));
    wait_for(&said, "Nav2 confirms the end of the goal");
    sleep(Duration::from_millis(300));
    let zeros = commands.so_far().iter().filter(|(at, _)| *at > released).count();
    assert!(zeros > 3, "a stop is told: {zeros}");

    server.set(ABORTS);
    let pressed = Instant::now();
    hand.hold(true);
    server.wait(&goal, pressed, soon);
    wait_for(&said, "Nav2 gives up: it does not detect the person (902), after 0 retries: no pose");
    let ended = Instant::now();
    sleep(Duration::from_millis(1000));
    assert!(server.since(ended).is_empty(), "no other goal by itself");

    server.set(IS_SILENT);
    let pressed = Instant::now();
    hand.press_again();
    server.wait(&goal, pressed, soon);
    wait_for(&said, "Nav2 is told to stop: no feedback from Nav2");
    server.wait(&Happened::Cancelled, pressed, soon);

    server.set(OBEYS);
    let pressed = Instant::now();
    hand.press_again();
    server.wait(&goal, pressed, soon);
    sleep(Duration::from_millis(500));
    server.set(IS_DEAF);
    hand.hold(false);
    wait_for(&said, "Nav2 does not confirm that it ends the goal");
    // Longer than zeros go on after a stop that is confirmed.
    sleep(Duration::from_millis(2500));
    let deaf = Instant::now();
    sleep(Duration::from_millis(300));
    let zeros = commands.so_far().iter().filter(|(at, _)| *at > deaf).count();
    assert!(zeros > 3, "zeros go on: {zeros}");
    server.set(OBEYS);
    server.wait(&Happened::Cancelled, deaf, soon);
    sleep(Duration::from_millis(2500));
    let confirmed = Instant::now();
    sleep(Duration::from_millis(300));
    let zeros = commands.so_far().iter().filter(|(at, _)| *at > confirmed).count();
    assert_eq!(zeros, 0, "they end");

    let pressed = Instant::now();
    hand.hold(true);
    server.wait(&goal, pressed, soon);
    sleep(Duration::from_millis(300));
    let ending = Instant::now();
    stop.store(true, Ordering::Relaxed);
    bridge.join().unwrap().unwrap();
    server.wait(&Happened::Cancelled, ending, soon);
    sleep(Duration::from_millis(300));
    assert!(!commands.moves_since(begun), "this program never drives");
    assert!(commands.so_far().last().unwrap().0 > ending, "a stop at the end");
    server_stop.store(true, Ordering::Relaxed);
    heard_all.store(true, Ordering::Relaxed);
    server.thread.join().unwrap();
    drop(playing.join().unwrap());
}
