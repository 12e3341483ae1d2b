//! The bridge and a simulated robot, two participants that communicate over UDP.
//!
//! If they cannot hear each other (no multicast, no loopback), the test reports that and is
//! skipped.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing test may panic")]

mod faults;
mod forecast;
mod lacking;
mod lidar;
mod lifecycle;
mod nav2;
mod peers;
mod skill;
mod video;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use peers::*;
use tagalong::config::NoSettings;
use tagalong::core::{Controller, Twist};
use tagalong::log::msgs::{
    Detection3DArray, Header, Marker, MarkerArray, Message, Odometry, People, PoseStamped,
    StringMsg, TFMessage, TwistStamped,
};
use tagalong_ros2::{Options, run};
use tagalong_sim::{Event, Simulation};

#[test]
#[ignore = "waits for messages for half a minute"]
fn images_become_tracks_and_commands_and_silence_becomes_zero() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(12.0), 1);
    let mut robot = Robot::new(domain(0), simulation.camera());
    let tracks = robot.peer.collect::<Detection3DArray>("/people/tracks", &heard_all);
    let poses = robot.peer.collect::<PoseStamped>("/people/target_pose", &heard_all);
    let states = robot.peer.collect::<StringMsg>("/people/state", &heard_all);
    let drawn = robot.peer.collect::<MarkerArray>("/people/markers", &heard_all);
    let frames = robot.peer.collect::<TFMessage>("/tf", &heard_all);
    let people = robot.peer.collect::<People>("/people", &heard_all);
    let grids = forecast::collect(&mut robot.peer, &heard_all);
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let (bridge, said) = bridge(domain(0), &stop);
    let hand = Hand::new(domain(0), &stop);
    let hands = thread::spawn(move || {
        hand.let_go(&said);
    });
    let last_image = robot.play(simulation);
    hands.join().unwrap();
    sleep(Duration::from_secs(3));
    let stopped = Instant::now();
    stop.store(true, Ordering::Relaxed);
    let summary = bridge.join().unwrap().unwrap();
    sleep(Duration::from_millis(300));
    heard_all.store(true, Ordering::Relaxed);
    let tracks = tracks.finish();
    let poses = poses.finish();
    let states = states.finish();
    let people = people.finish();
    forecast::check(&grids.finish(), &people);
    check_viewers(&drawn.finish(), &frames.finish(), &people);
    let commands = commands.finish();
    eprintln!("{summary}");

    assert!(summary.frames > 20, "{summary}");
    let people = tracks.iter().filter(|(_, array)| array.detections.len() == 1).count();
    assert!(people > 20, "one person in {people} of {} messages", tracks.len());
    assert!(poses.len() > 20, "{} poses", poses.len());
    let head = poses[0].1.pose.position;
    assert!((1.5..3.5).contains(&head.x) && head.y.abs() < 0.5, "{head:?}");
    assert!(states.iter().any(|(_, state)| state.data.contains("locked")), "{states:?}");

    assert!(commands.iter().all(|(_, c)| speeds(c).iter().all(|v| v.is_finite())));
    let moving = commands.iter().filter(|(_, command)| speeds(command) != [0.0, 0.0]);
    let last_move = moving.clone().map(|(at, _)| *at).max().expect("the robot is told to move");
    assert!(moving.count() > 20);
    let after_s = last_move.saturating_duration_since(last_image).as_secs_f64();
    eprintln!("the last command to move came {after_s:.3} s after the last image");
    assert!(after_s < LAST_MOVE_S, "{after_s} s");
    let zeros = commands.iter().filter(|(at, _)| *at > last_move && *at < stopped);
    let zeros: Vec<Instant> = zeros.map(|(at, _)| *at).collect();
    assert!(zeros.len() > 20, "{} zeros", zeros.len());
    let silent_s = (stopped - *zeros.last().unwrap()).as_secs_f64();
    assert!(silent_s > 0.3, "zeros cease so that others may drive: {silent_s} s");
    let farewell = commands.last().unwrap();
    assert!(farewell.0 > stopped && speeds(&farewell.1) == [0.0, 0.0], "the last command is zero");
}

/// Checks what viewers and planners are told about the one person of the scene.
fn check_viewers(
    drawn: &[(Instant, MarkerArray)],
    frames: &[(Instant, TFMessage)],
    people: &[(Instant, People)],
) {
    let full = drawn.iter().filter(|(_, array)| array.markers.len() > 3);
    assert!(full.clone().count() > 20, "{} of {}", full.count(), drawn.len());
    let markers = &drawn.iter().rev().find(|(_, array)| array.markers.len() > 3).unwrap().1.markers;
    assert_eq!(markers[0].action, Marker::DELETE_ALL);
    let body = &markers[1];
    assert_eq!((body.shape, body.header.frame_id.as_str()), (Marker::CYLINDER, "odom"));
    let text = &markers[2].text;
    assert!(text.ends_with(" m") && text.starts_with(&body.id.to_string()), "{text}");
    assert!(markers.iter().any(|marker| marker.shape == Marker::LINE_LIST), "a trail");
    let last = &drawn.last().unwrap().1.markers;
    assert_eq!((last.len(), last[0].action), (1, Marker::DELETE_ALL), "removed at the end");

    assert!(frames.len() > 20, "{} transforms", frames.len());
    let frame = &frames[0].1.transforms[0];
    assert_eq!((frame.header.frame_id.as_str(), &*frame.child_frame_id), ("odom", "person_1"));
    let head = frame.transform.translation;
    assert!((1.5..3.5).contains(&head.x) && head.y.abs() < 0.5, "{head:?}");

    let mut known = people.iter().filter_map(|(_, array)| array.people.first());
    assert!(known.clone().count() > 20);
    let person = known.next_back().unwrap();
    assert_eq!((person.name.as_str(), person.position.z), ("1", 0.0));
    assert!((0.5..=1.0).contains(&person.reliability), "{person:?}");
}

#[test]
fn what_is_missing_is_named_and_the_wait_has_an_end() {
    let stop = Arc::new(AtomicBool::new(false));
    let has_ended = Arc::new(AtomicBool::new(false));
    let _alone = alone();
    let watchdog = {
        let stop = Arc::clone(&stop);
        let has_ended = Arc::clone(&has_ended);
        // A wait without an end would end well by this, instead of with an error.
        thread::spawn(move || {
            let from = Instant::now();
            while !has_ended.load(Ordering::Relaxed) && from.elapsed() < Duration::from_secs(120) {
                sleep(Duration::from_millis(50));
            }
            stop.store(true, Ordering::Relaxed);
        })
    };
    let told = std::sync::Mutex::new(Vec::new());
    let result = run(&options(domain(2), "1"), &stop, &|words| {
        told.lock().expect("no test panics with it").push(words.to_owned());
    });
    has_ended.store(true, Ordering::Relaxed);
    watchdog.join().unwrap();
    let error = result.unwrap_err();
    assert_eq!(error.exit_code(), 1);
    let text = error.to_string();
    assert!(text.starts_with(&format!("`ROS domain {}` has no ", domain(2))), "{text}");
    assert!(text.contains("present:"), "{text}");
    let told = told.into_inner().expect("no test panics with it");
    let hint = format!("no topic of another node is on ROS domain {}", domain(2));
    assert!(told.iter().any(|words| words.starts_with(&hint)), "{told:?}");
}

/// The deadman's switch on the network: before an enable, while it is repeated, after it ceases,
/// after `false`, and after a reset.
#[test]
#[ignore = "waits for messages for half a minute"]
fn the_robot_moves_while_the_switch_is_held_and_after_a_stop_only_after_a_reset_and_a_press() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(25.0), 1);
    let mut robot = Robot::new(domain(3), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let (bridge, said) = bridge(domain(3), &stop);
    let hand = Hand::new(domain(3), &stop);
    let playing = thread::spawn(move || robot.play(simulation));

    wait_for(&said, "needs a reset");
    hand.hold(true);
    sleep(Duration::from_millis(1500));
    assert!(commands.so_far().is_empty(), "a restart is no reset, and says nothing to the wheels");
    hand.reset_until_heard(&said);
    wait_for(&said, "release the enable and press it again");
    sleep(Duration::from_millis(1000));
    assert!(commands.so_far().is_empty(), "a button that is held through the reset moves nothing");
    hand.hold(false);
    sleep(Duration::from_millis(700));
    wait_for(&said, "not enabled");
    sleep(Duration::from_millis(1000));
    assert!(commands.so_far().is_empty(), "a reset is no enable");
    hand.hold(true);
    commands.wait_for_move("enabled");
    sleep(Duration::from_millis(500));

    hand.hold(false);
    // The last enable may be as old as a period of the hand; it holds half a second.
    sleep(Duration::from_millis(100 + 500 + 200));
    let expired = Instant::now();
    sleep(Duration::from_millis(500));
    assert!(!commands.moves_since(expired), "the enable was not repeated");
    let zeros = commands.so_far().iter().filter(|(at, _)| *at > expired).count();
    assert!(zeros > 5, "zeros are told: {zeros}");
    let pressed = Instant::now();
    hand.hold(true);
    commands.wait_for_move("held again");
    let first_mps = commands.first_speed_since(pressed);
    assert!(first_mps < 0.15, "from rest, however fast the unheard commands were: {first_mps}");

    hand.switch_off();
    sleep(Duration::from_millis(200));
    let off = Instant::now();
    sleep(Duration::from_millis(1500));
    assert!(!commands.moves_since(off), "a false latches, though true is repeated");
    wait_for(&said, "switched off");
    hand.reset_until_heard(&said);
    let reset = Instant::now();
    sleep(Duration::from_millis(1000));
    assert!(!commands.moves_since(reset), "the switch is held since before the reset");
    hand.press_again();
    commands.wait_for_move("reset, released and pressed");

    stop.store(true, Ordering::Relaxed);
    bridge.join().unwrap().unwrap();
    playing.join().unwrap();
    sleep(Duration::from_millis(300));
    heard_all.store(true, Ordering::Relaxed);
    assert_eq!(commands.finish().last().map(|(_, command)| speeds(command)), Some([0.0, 0.0]));
}

/// Odometry pauses for two seconds while frames go on; later the calibration changes.
#[test]
#[ignore = "waits for messages for half a minute"]
fn odometry_that_stops_while_frames_go_on_stops_the_robot_and_another_calibration_ends_the_ride() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(25.0), 1);
    let mut robot = Robot::new(domain(4), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let (bridge, said) = bridge(domain(4), &stop);
    let hand = Hand::new(domain(4), &stop);
    let silent = Arc::new(AtomicBool::new(false));
    let zoomed = Arc::clone(&robot.zoomed);
    let is_silent = Arc::clone(&silent);
    let playing = thread::spawn(move || {
        robot.play_while(simulation, &|event| {
            !(matches!(event, Event::Odometry(_)) && is_silent.load(Ordering::Relaxed))
        })
    });
    hand.let_go(&said);
    commands.wait_for_move("enabled");
    sleep(Duration::from_millis(500));

    silent.store(true, Ordering::Relaxed);
    // Odometry is stale after half a second, which the next frame tells.
    sleep(Duration::from_millis(500 + 100 + 300));
    let stale = Instant::now();
    sleep(Duration::from_millis(700));
    assert!(!commands.moves_since(stale), "no odometry: frames alone move nothing");
    let zeros = commands.so_far().iter().filter(|(at, _)| *at > stale).count();
    assert!(zeros > 10, "{zeros}");
    silent.store(false, Ordering::Relaxed);
    commands.wait_for_move("odometry is back");

    zoomed.store(true, Ordering::Relaxed);
    let error = bridge.join().unwrap().unwrap_err();
    let text = error.to_string();
    assert!(text.contains("calibration of the camera changed (topic /camera/color"), "{text}");
    assert_eq!(error.exit_code(), 1);
    sleep(Duration::from_millis(300));
    assert_eq!(commands.so_far().last().map(|(_, command)| speeds(command)), Some([0.0, 0.0]));
    stop.store(true, Ordering::Relaxed);
    heard_all.store(true, Ordering::Relaxed);
    playing.join().unwrap();
}

/// Controller that drives ahead, and is stuck for a while once the flag is set.
pub(crate) struct Stuck(pub(crate) Arc<AtomicBool>);

/// Time for which it is stuck.
const STUCK: Duration = Duration::from_millis(3000);

impl Controller for Stuck {
    fn command(&mut self, _: &tagalong::core::Scene<'_>) -> Twist {
        if self.0.swap(false, Ordering::Relaxed) {
            sleep(STUCK);
        }
        Twist::new(0.2, 0.0)
    }
}

/// A pipeline that is stuck in one frame, another publisher of commands, and bytes that are no
/// message of their type: the robot stands, and the diagnostics tell.
#[test]
#[ignore = "waits for messages for half a minute"]
fn a_stuck_pipeline_stands_and_rivals_and_malformed_messages_are_told() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(30.0), 1);
    let mut robot = Robot::new(domain(5), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let array = "diagnostic_msgs/msg/DiagnosticArray";
    let told = robot.peer.collect_of::<DiagnosticArray>("/diagnostics", array, &heard_all);
    let beats =
        robot.peer.collect_of::<Header>("/people/heartbeat", "std_msgs/msg/Header", &heard_all);
    let drawn = robot.peer.collect::<MarkerArray>("/people/markers", &heard_all);
    let is_stuck = Arc::new(AtomicBool::new(false));
    let mut registry = tagalong::builtin_registry();
    let flag = Arc::clone(&is_stuck);
    registry.controller("stuck", "is stuck", move |_: NoSettings, _| Ok(Stuck(Arc::clone(&flag))));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
    let config = std::env::temp_dir().join(format!("tagalong-stuck-{}.toml", std::process::id()));
    let base = folder.join("depth-ekf.toml").canonicalize().unwrap();
    let text = format!(
        "extends = '{}'\n[controller]\nplugin = 'stuck'\n[command_limiter]\ncheck_response = false\n",
        base.display()
    );
    std::fs::write(&config, text).unwrap();
    let address = format!("127.0.0.1:{}", 40_000 + std::process::id() % 20_000);
    let http = Some(address.parse().unwrap());
    let markers = String::new();
    let options = Options { config: config.clone(), http, markers, ..options(domain(5), "20") };
    let (bridge, said) = bridge_with(options, registry, &stop);
    let hand = Hand::new(domain(5), &stop);
    let junk = robot.peer.publisher_of::<u8>("/odom", Odometry::TYPE, reliable());
    let playing = thread::spawn(move || (robot.play(simulation), robot).1);
    hand.let_go(&said);
    commands.wait_for_move("enabled");

    assert_eq!(skill::http(&address, "GET", "healthz", "").0, 200);

    is_stuck.store(true, Ordering::Relaxed);
    // The command of the last frame expires a quarter of a second after its stamp.
    sleep(Duration::from_millis(250 + 100 + 300));
    let expired = Instant::now();
    sleep(Duration::from_millis(400));
    let (code, health) = skill::http(&address, "GET", "healthz", "");
    assert!(code == 503 && health.contains("one frame takes "), "{code} {health}");
    sleep(Duration::from_millis(1500));
    assert!(!commands.moves_since(expired), "stuck");
    let statuses = statuses_of(&told);
    let mut errors = statuses.iter().filter(|status| status.level == 2);
    assert!(errors.any(|status| status.message.contains("one frame takes")), "{statuses:?}");
    commands.wait_for_move("no longer stuck");

    junk.publish(7).unwrap();
    let mut rival = Peer::join(domain(5), "rival");
    let _rival = rival.publisher::<TwistStamped>("/cmd_vel", reliable());
    wait_for(&said, "1 other publishers of commands on cmd_vel");
    sleep(Duration::from_millis(1500));
    let last = statuses_of(&told).pop().unwrap();
    assert_eq!((last.level, last.name.as_str()), (1, "tagalong: follow"));
    for key in ["other publishers of commands", "malformed messages"] {
        let value = last.values.iter().find(|(name, _)| name == key).map(|(_, v)| v.as_str());
        assert_eq!(value, Some("1"), "{key}: {last:?}");
    }
    assert!(beats.so_far().len() > 20);

    stop.store(true, Ordering::Relaxed);
    let summary = bridge.join().unwrap().unwrap();
    assert_eq!(summary.traffic["/odom"].malformed, 1, "{summary}");
    assert!(summary.to_string().contains("1 malformed"), "{summary}");
    heard_all.store(true, Ordering::Relaxed);
    assert!(drawn.finish().is_empty(), "no topic, no markers");
    drop(playing.join().unwrap());
    std::fs::remove_file(config).unwrap();
}

/// All statuses that were told so far.
fn statuses_of(told: &Collected<DiagnosticArray>) -> Vec<DiagnosticStatus> {
    told.so_far().into_iter().flat_map(|(_, array)| array.status).collect()
}

#[test]
#[ignore = "waits for messages for half a minute"]
fn a_controller_without_odometry_is_refused_and_tells_the_wheels_nothing() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(9.0), 1);
    let mut robot = Robot::new(domain(6), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let registry = tagalong::builtin_registry();
    let (bridge, _) = bridge_with(options(domain(6), "6"), registry, &stop);
    robot.play_while(simulation, &|event| !matches!(event, Event::Odometry(_)));
    let error = bridge.join().unwrap().unwrap_err();
    assert_eq!(error.exit_code(), 1);
    let text = error.to_string();
    assert!(text.contains("no odometry") && text.contains("odometry = \"none\""), "{text}");
    heard_all.store(true, Ordering::Relaxed);
    assert!(commands.finish().is_empty());
}
