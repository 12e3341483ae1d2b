//! Faults of the camera and of the switch, injected between two participants.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use ros2_client::qos::Durability;
use tagalong::log::msgs::{StringMsg, TwistStamped};
use tagalong_ros2::{ClockSource, Options};
use tagalong_sim::Simulation;

use crate::peers::*;
use crate::skill::http;

/// Validity of a command, a control period and the transmission.
const EXPIRED: Duration = Duration::from_millis(250 + 40 + 200);

/// Returns a free port of this process on loopback.
fn address(offset: u32) -> String {
    format!("127.0.0.1:{}", 20_000 + 4 * (std::process::id() % 10_000) + offset)
}

/// The camera repeats its last images, with their stamps, while odometry goes on.
fn repeat_images(clock: ClockSource, offset: u32) {
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(25.0), 1);
    let mut robot = Robot::new(domain(offset), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let address = address(offset % 4);
    let http_address = Some(address.parse().unwrap());
    let options = Options { clock, http: http_address, ..options(domain(offset), "20") };
    let registry = tagalong::builtin_registry();
    let (bridge, said) = bridge_with(options, registry, &stop);
    let hand = Hand::new(domain(offset), &stop);
    let repeats = Arc::clone(&robot.repeats);
    let playing = thread::spawn(move || (robot.play(simulation), robot).1);
    hand.let_go(&said);
    commands.wait_for_move("enabled");
    sleep(Duration::from_millis(500));

    *repeats.lock().unwrap() = Repeats::Images;
    sleep(Duration::from_millis(100) + EXPIRED);
    let expired = Instant::now();
    sleep(Duration::from_millis(3000));
    let (code, health) = http(&address, "GET", "healthz", "");
    assert!(code == 503 && health.contains("no frame for"), "{clock:?}: {code} {health}");
    assert!(!commands.moves_since(expired), "{clock:?}: images that are sent again are no frames");
    *repeats.lock().unwrap() = Repeats::Nothing;
    commands.wait_for_move("new images");
    assert_eq!(http(&address, "GET", "healthz", "").0, 200);

    stop.store(true, Ordering::Relaxed);
    bridge.join().unwrap().unwrap();
    heard_all.store(true, Ordering::Relaxed);
    drop(playing.join().unwrap());
    let stamps: Vec<_> = commands.finish().iter().map(|(_, c)| c.header.stamp()).collect();
    assert!(stamps.is_sorted(), "{clock:?}: the clock never goes back");
}

#[test]
#[ignore = "waits for messages for half a minute"]
fn images_that_are_sent_again_move_nothing_by_the_clock_of_the_machine() {
    let Some(_alone) = alone() else { return };
    repeat_images(ClockSource::System, 8);
}

#[test]
#[ignore = "waits for messages for half a minute"]
fn images_that_are_sent_again_move_nothing_by_the_time_of_arrival() {
    let Some(_alone) = alone() else { return };
    repeat_images(ClockSource::Arrival, 9);
}

/// The camera repeats its last picture with new stamps.
#[test]
#[ignore = "waits for messages for half a minute"]
fn the_same_picture_with_new_stamps_is_a_stop() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(25.0), 1);
    let mut robot = Robot::new(domain(10), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let states = robot.peer.collect::<StringMsg>("/people/state", &heard_all);
    let (bridge, said) = bridge(domain(10), &stop);
    let hand = Hand::new(domain(10), &stop);
    let repeats = Arc::clone(&robot.repeats);
    let playing = thread::spawn(move || (robot.play(simulation), robot).1);
    hand.let_go(&said);
    commands.wait_for_move("enabled");

    *repeats.lock().unwrap() = Repeats::Pictures;
    sleep(Duration::from_millis(1500));
    let frozen = Instant::now();
    sleep(Duration::from_millis(2000));
    assert!(!commands.moves_since(frozen), "a frozen camera");
    let told = states.so_far();
    assert!(told.iter().any(|(_, state)| state.data.starts_with("frozen;")), "{told:?}");

    stop.store(true, Ordering::Relaxed);
    bridge.join().unwrap().unwrap();
    heard_all.store(true, Ordering::Relaxed);
    drop(playing.join().unwrap());
}

/// A second publisher at the switch: silent, in place of the hand, and gone. Before it, a `true` that
/// is kept for late readers.
#[test]
#[ignore = "waits for messages for half a minute"]
fn two_publishers_of_the_enable_are_a_stop_and_an_old_enable_moves_nothing() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(45.0), 1);
    let mut robot = Robot::new(domain(11), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let array = "diagnostic_msgs/msg/DiagnosticArray";
    let told = robot.peer.collect_of::<DiagnosticArray>("/diagnostics", array, &heard_all);
    let mut other = Peer::join(domain(11), "other");
    let kept = reliable().durability(Durability::TransientLocal);
    let kept = other.publisher_of::<Bool>("/people/enable", "std_msgs/msg/Bool", kept);
    kept.publish(Bool { data: true }).unwrap();

    let (bridge, said) = bridge(domain(11), &stop);
    let playing = thread::spawn(move || (robot.play(simulation), robot).1);
    let mut operator = Peer::join(domain(11), "operator");
    let reset = operator.publisher_of::<Empty>("/people/reset", "std_msgs/msg/Empty", reliable());
    wait_for(&said, "needs a reset");
    while !said.lock().unwrap().iter().any(|line| line.starts_with("not enabled")) {
        reset.publish(Empty { byte: 0 }).unwrap();
        sleep(Duration::from_millis(200));
    }
    sleep(Duration::from_millis(1000));
    assert!(commands.so_far().is_empty(), "an enable from before the bridge");
    drop((kept, other, reset, operator));
    wait_for(&said, "the publisher of people/enable is gone");

    let hand = Hand::new(domain(11), &stop);
    hand.reset_until_heard(&said);
    hand.hold(true);
    commands.wait_for_move("enabled");
    let mut rival = Peer::join(domain(11), "rival");
    let enable = rival.publisher_of::<Bool>("/people/enable", "std_msgs/msg/Bool", reliable());
    wait_for(&said, "more than one publisher of the enable");
    sleep(Duration::from_millis(200));
    let contested = Instant::now();
    sleep(Duration::from_millis(1200));
    hand.hold(false);
    hand.reset();
    for _ in 0..10 {
        enable.publish(Bool { data: true }).unwrap();
        sleep(Duration::from_millis(100));
    }
    assert!(!commands.moves_since(contested), "two publishers");
    wait_for(&said, "reset refused: 2 publishers on people/enable");
    let statuses = told.so_far().into_iter().flat_map(|(_, array)| array.status);
    let mut errors = statuses.filter(|status| status.level == 2).map(|status| status.message);
    assert!(errors.any(|message| message == "2 publishers of the enable: end all but one"));

    drop((enable, rival));
    hand.reset_until_heard(&said);
    let alone_again = Instant::now();
    sleep(Duration::from_millis(500));
    assert!(!commands.moves_since(alone_again), "not pressed");
    hand.hold(true);
    commands.wait_for_move("one publisher, reset and pressed");

    stop.store(true, Ordering::Relaxed);
    bridge.join().unwrap().unwrap();
    heard_all.store(true, Ordering::Relaxed);
    drop(playing.join().unwrap());
}

/// A bumper of the collision monitor is waited for, is pressed for a moment, and falls silent.
#[test]
#[ignore = "waits for messages for half a minute"]
fn a_bumper_that_is_pressed_or_silent_stops_the_robot() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(40.0), 1);
    let mut robot = Robot::new(domain(12), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let states = robot.peer.collect::<StringMsg>("/people/state", &heard_all);
    let bumper = robot.peer.publisher_of::<Bool>("/bumper", "std_msgs/msg/Bool", sensor());
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/driven-by-others.toml");
    let config = std::env::temp_dir().join(format!("tagalong-bumper-{}.toml", std::process::id()));
    let base = base.canonicalize().unwrap();
    let text = format!(
        "extends = '{}'\n[[collision_monitor.sources]]\nname = 'front'\ntype = 'bumper'\n\
         topic = '/bumper'\n",
        base.display()
    );
    std::fs::write(&config, text).unwrap();
    let options = Options { config: config.clone(), ..options(domain(12), "30") };
    let registry = tagalong::builtin_registry();
    let (bridge, said) = bridge_with(options, registry, &stop);
    let hand = Hand::new(domain(12), &stop);
    let playing = thread::spawn(move || (robot.play(simulation), robot).1);
    sleep(Duration::from_secs(4));
    let waits = said.lock().unwrap().iter().all(|line| !line.starts_with("reads "));
    assert!(waits, "it waits for the bumper: {:?}", said.lock().unwrap());

    let pressed = Arc::new(AtomicBool::new(false));
    let silent = Arc::new(AtomicBool::new(false));
    let is_pressed = Arc::clone(&pressed);
    let is_silent = Arc::clone(&silent);
    let ended = Arc::clone(&stop);
    let bumping = thread::spawn(move || {
        while !ended.load(Ordering::Relaxed) {
            if !is_silent.load(Ordering::Relaxed) {
                bumper.publish(Bool { data: is_pressed.load(Ordering::Relaxed) }).unwrap();
            }
            sleep(Duration::from_millis(50));
        }
    });
    hand.let_go(&said);
    commands.wait_for_move("the bumper is free");
    assert!(said.lock().unwrap().iter().any(|line| line.contains("/bumper")), "it is read");

    pressed.store(true, Ordering::Relaxed);
    sleep(Duration::from_millis(500));
    let contact = Instant::now();
    sleep(Duration::from_millis(700));
    assert!(!commands.moves_since(contact), "pressed");
    let told = states.so_far();
    assert!(told.iter().any(|(_, state)| state.data.starts_with("contact;")), "{told:?}");
    pressed.store(false, Ordering::Relaxed);
    commands.wait_for_move("the bumper is free again");

    silent.store(true, Ordering::Relaxed);
    // The age at which the source is silent, and a period of the camera.
    sleep(Duration::from_millis(500 + 100) + EXPIRED);
    let ceased = Instant::now();
    sleep(Duration::from_millis(700));
    assert!(!commands.moves_since(ceased), "silent");

    stop.store(true, Ordering::Relaxed);
    bridge.join().unwrap().unwrap();
    heard_all.store(true, Ordering::Relaxed);
    bumping.join().unwrap();
    drop(playing.join().unwrap());
    std::fs::remove_file(config).unwrap();
}
