//! A manager that configures, activates, deactivates, cleans up and shuts down the node.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use ros2_client::{Client, Message};
use serde::{Deserialize, Serialize};
use tagalong::config::NoSettings;
use tagalong::log::msgs::{Detection3DArray, TwistStamped};
use tagalong_ros2::Options;
use tagalong_sim::Simulation;

use crate::Stuck;
use crate::peers::*;
use crate::skill::{SpeedLimit, TriggerRequest, call, call_once, client};

/// `lifecycle_msgs/State` and `lifecycle_msgs/Transition`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Named {
    id: u8,
    label: String,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct StateResponse {
    current_state: Named,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct ChangeRequest {
    transition: Named,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct ChangeResponse {
    success: bool,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Description {
    transition: Named,
    start_state: Named,
    goal_state: Named,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Transitions {
    transitions: Vec<Description>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Event {
    timestamp: u64,
    description: Description,
}

impl Message for StateResponse {}
impl Message for ChangeRequest {}
impl Message for ChangeResponse {}
impl Message for Transitions {}

/// Manager of the node.
struct Manager {
    _peer: Peer,
    state: Client<TriggerRequest, StateResponse>,
    transitions: Client<TriggerRequest, Transitions>,
    change: Client<ChangeRequest, ChangeResponse>,
}

impl Manager {
    fn new(domain: u16) -> Self {
        let mut peer = Peer::join(domain, "manager");
        let package = "lifecycle_msgs";
        let state = client(&mut peer, "/tagalong/get_state", package, "GetState");
        let name = "/tagalong/get_available_transitions";
        let transitions = client(&mut peer, name, package, "GetAvailableTransitions");
        let change = client(&mut peer, "/tagalong/change_state", package, "ChangeState");
        let manager = Self { _peer: peer, state, transitions, change };
        // A request that changes nothing, until the two know each other.
        assert!(!call(&manager.change, &ChangeRequest::of(99, "")).success);
        manager
    }

    fn state(&self) -> (u8, String) {
        let Named { id, label } = call(&self.state, &TriggerRequest { byte: 0 }).current_state;
        (id, label)
    }

    fn change(&self, id: u8, label: &str) -> bool {
        let request = ChangeRequest::of(id, label);
        let answer = call_once(&self.change, &request, Duration::from_secs(10));
        answer.expect("an answer").success
    }

    fn transitions(&self) -> Vec<u8> {
        let answer = call(&self.transitions, &TriggerRequest { byte: 0 });
        answer.transitions.into_iter().map(|found| found.transition.id).collect()
    }
}

impl ChangeRequest {
    fn of(id: u8, label: &str) -> Self {
        Self { transition: Named { id, label: label.to_owned() } }
    }
}

/// Checks that the robot is told to stop after `then`, and nothing more from `silent` on.
fn stands(commands: &Collected<TwistStamped>, then: Instant, silent: Instant) {
    let after: Vec<_> = commands.so_far().into_iter().filter(|(at, _)| *at > then).collect();
    assert!(!after.is_empty(), "a stop is told");
    let last = after.last().unwrap();
    assert_eq!(speeds(&last.1), [0.0, 0.0], "the last command is zero");
    assert!(last.0 < silent, "then nothing: {:?} late", last.0 - silent);
}

#[test]
#[ignore = "waits for messages for a minute"]
fn a_manager_leads_the_node_and_what_ends_its_work_stops_the_robot() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&standing(70.0), 1);
    let mut robot = Robot::new(domain(14), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let tracks = robot.peer.collect::<Detection3DArray>("/people/tracks", &heard_all);
    let kind = "lifecycle_msgs/msg/TransitionEvent";
    let events = robot.peer.collect_of::<Event>("/tagalong/transition_event", kind, &heard_all);
    let options = Options { lifecycle: true, ..options(domain(14), "20") };
    let (bridge, said) = bridge_with(options, tagalong::builtin_registry(), &stop);
    wait_for(&said, "a manager has to configure");
    let manager = Manager::new(domain(14));
    let mut zones = Peer::join(domain(14), "zones");
    let limits = "nav2_msgs/msg/SpeedLimit";
    let limit = zones.publisher_of::<SpeedLimit>("/speed_limit", limits, reliable());
    let hand = Hand::new(domain(14), &stop);
    let ends = Arc::clone(&stop);
    let playing = thread::spawn(move || {
        robot.start_now();
        robot.play_while(simulation, &|_| !ends.load(Ordering::Relaxed));
        robot
    });

    assert_eq!(manager.state(), (1, "unconfigured".into()));
    assert!(!manager.change(3, "activate"), "not configured");
    assert!(manager.change(0, "configure"));
    assert_eq!(manager.state(), (2, "inactive".into()));
    assert_eq!(manager.transitions(), [2, 3, 6]);
    sleep(Duration::from_millis(1500));
    assert!(tracks.so_far().is_empty() && commands.so_far().is_empty(), "inactive");

    assert!(manager.change(3, ""));
    assert_eq!(manager.state(), (3, "active".into()));
    hand.let_go(&said);
    commands.wait_for_move("active, reset and pressed");
    assert!(!manager.change(2, "cleanup"), "not while it is active");
    commands.wait_for_move("a refusal changes nothing");

    let asked = Instant::now();
    assert!(manager.change(4, "deactivate"));
    assert_eq!(manager.state().0, 2);
    let silent = asked + Duration::from_millis(500);
    sleep(Duration::from_millis(1500));
    let quiet = tracks.so_far().len();
    stands(&commands, asked, silent);
    sleep(Duration::from_millis(500));
    assert_eq!(tracks.so_far().len(), quiet, "nothing is tracked");
    limit.publish(SpeedLimit::of(0.05)).unwrap();
    sleep(Duration::from_millis(500));

    assert!(manager.change(3, "activate"));
    let active = Instant::now();
    sleep(Duration::from_millis(1500));
    assert!(!commands.moves_since(active), "the hand holds since before");
    assert!(tracks.so_far().len() > quiet + 3, "it tracks again");
    hand.reset_until_heard(&said);
    hand.press_again();
    commands.wait_for_move("active again, reset and pressed");
    wait_for(&said, "speed limit: 0.05 m/s");
    sleep(Duration::from_millis(700));
    let fastest = commands.so_far().into_iter().filter(|(at, _)| *at > active);
    let fastest = fastest.map(|(_, command)| command.twist.linear.x).fold(0.0, f64::max);
    assert!(fastest <= 0.05 + 1e-9, "the limit came while it was inactive: {fastest}");

    assert!(manager.change(4, "") && manager.change(2, ""));
    assert_eq!(manager.state(), (1, "unconfigured".into()));
    assert!(manager.change(1, "") && manager.change(3, ""), "a second life");
    hand.hold(false);
    sleep(Duration::from_millis(3000));
    hand.reset_until_heard(&said);
    hand.hold(true);
    commands.wait_for_move("configured and active once more");
    let asked = Instant::now();
    assert!(manager.change(0, "shutdown"), "while it drives");
    assert_eq!(manager.state(), (4, "finalized".into()));
    assert!(!manager.change(1, "configure"), "there is no way back");
    let silent = asked + Duration::from_millis(700);
    sleep(Duration::from_millis(1000));
    stands(&commands, asked, silent);

    stop.store(true, Ordering::Relaxed);
    let summary = bridge.join().unwrap().unwrap();
    assert!(summary.frames > 20 && summary.told.zeros > 5, "{summary}");
    sleep(Duration::from_millis(300));
    heard_all.store(true, Ordering::Relaxed);
    let events = events.finish();
    let passed: Vec<u8> = events.iter().map(|(_, e)| e.description.transition.id).collect();
    let all = [1, 10, 3, 30, 4, 40, 3, 30, 4, 40, 2, 20, 1, 10, 3, 30, 7, 50];
    assert_eq!(passed, all, "each transition is told");
    let Event { timestamp, description } = &events[4].1;
    assert_eq!((description.start_state.id, description.goal_state.id), (3, 14));
    assert!(*timestamp > 1_700_000_000_000_000_000);
    drop(playing.join().unwrap());
}

/// A node that activates itself; its pipeline is stuck in a frame when a manager deactivates it. Then
/// an error of the pipeline.
#[test]
#[ignore = "waits for messages for half a minute"]
fn a_stuck_pipeline_is_deactivated_at_once() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&standing(40.0), 1);
    let mut robot = Robot::new(domain(15), simulation.camera());
    let zoomed = Arc::clone(&robot.zoomed);
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let is_stuck = Arc::new(AtomicBool::new(false));
    let mut registry = tagalong::builtin_registry();
    let flag = Arc::clone(&is_stuck);
    registry.controller("stuck", "is stuck", move |_: NoSettings, _| Ok(Stuck(Arc::clone(&flag))));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
    let config = std::env::temp_dir().join(format!("tagalong-managed-{}.toml", std::process::id()));
    let base = folder.join("depth-ekf.toml").canonicalize().unwrap();
    let text = format!(
        "extends = '{}'\n[controller]\nplugin = 'stuck'\n[command_limiter]\ncheck_response = false\n",
        base.display()
    );
    std::fs::write(&config, text).unwrap();
    let options = Options { config: config.clone(), ..options(domain(15), "20") };
    let (bridge, said) = bridge_with(options, registry, &stop);
    let manager = Manager::new(domain(15));
    let hand = Hand::new(domain(15), &stop);
    let ends = Arc::clone(&stop);
    let playing = thread::spawn(move || {
        robot.start_now();
        robot.play_while(simulation, &|_| !ends.load(Ordering::Relaxed));
        robot
    });
    assert_eq!(manager.state(), (3, "active".into()), "by itself");
    hand.let_go(&said);
    commands.wait_for_move("enabled");

    is_stuck.store(true, Ordering::Relaxed);
    let set = Instant::now();
    // The controller takes the flag back when it is stuck.
    while is_stuck.load(Ordering::Relaxed) {
        assert!(set.elapsed() < Duration::from_secs(20), "no frame came");
        sleep(Duration::from_millis(5));
    }
    let asked = Instant::now();
    assert!(manager.change(4, "deactivate"), "after the frame");
    assert!(asked.elapsed() > Duration::from_secs(1), "it was stuck: {:?}", asked.elapsed());
    // Without the request zeros would go on for two seconds.
    stands(&commands, asked, asked + Duration::from_millis(500));

    assert!(manager.change(3, "activate"));
    hand.reset_until_heard(&said);
    hand.press_again();
    commands.wait_for_move("active again");
    zoomed.store(true, Ordering::Relaxed);
    let error = bridge.join().unwrap().unwrap_err();
    assert!(error.to_string().contains("calibration of the camera changed"), "{error}");
    sleep(Duration::from_millis(300));
    assert_eq!(commands.so_far().last().map(|(_, command)| speeds(command)), Some([0.0, 0.0]));
    stop.store(true, Ordering::Relaxed);
    heard_all.store(true, Ordering::Relaxed);
    drop(playing.join().unwrap());
    std::fs::remove_file(config).unwrap();
}
