//! The bridge and a simulated robot, two participants that communicate over UDP.
//!
//! If they cannot hear each other (no multicast, no loopback), the test reports that and is
//! skipped.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing test may panic")]

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, JoinHandle, sleep};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use clap::Parser;
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher,
    QosProfile,
};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use tagalong_config::Registry;
use tagalong_core::{Controller, Stamp, Twist};
use tagalong_geometry::{Camera, Lens, Pinhole};
use tagalong_log::msgs::{
    CameraInfo, Detection3DArray, Header, Image, Message, Odometry, Pose, PoseStamped, StringMsg,
    TFMessage, TransformStamped, TwistStamped,
};
use tagalong_ros2::{BridgeError, Options, Summary, run, run_with};
use tagalong_sim::{Event, OdometryReading, Scene, Shot, Simulation, Variant};

/// Returns a scene of so many seconds, of a person that stands before the robot and then walks away
/// slowly.
fn scene(seconds: f64) -> Scene {
    let walk = Variant::default()
        .with("duration_s", seconds)
        .with("people.0.path", "[[3.0, 2.0], [7.0, 2.0]]")
        .with("people.0.speed_mps", 0.3)
        .with("people.0.start_s", 3.0);
    Scene::parse_with(include_str!("../../../tests/scenes/small-room.toml"), &walk).unwrap()
}

/// Longest time between the last image and a command that moves: the validity of a command, a
/// control period, and the transmission.
const LAST_MOVE_S: f64 = 0.5 + 0.04 + 0.2;

/// Returns a domain that no other run of this test is likely to use.
fn domain(offset: u32) -> u16 {
    // Eight domains per process, below the limit of 232.
    (100 + 8 * (std::process::id() % 15) + offset) as u16
}

/// Returns a guard for a test that runs alone, or `None` where participants do not hear each other.
fn alone() -> Option<MutexGuard<'static, ()>> {
    static ONE: Mutex<()> = Mutex::new(());
    static TALK: OnceLock<bool> = OnceLock::new();
    let guard = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    if *TALK.get_or_init(can_talk) {
        return Some(guard);
    }
    eprintln!("skipped: two participants do not hear each other here (no multicast?)");
    None
}

/// `std_msgs/Bool`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Bool {
    data: bool,
}

/// `std_msgs/Empty`, with its one byte on the wire.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Empty {
    byte: u8,
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Deserialize)]
struct DiagnosticArray {
    #[expect(dead_code, reason = "it is on the wire")]
    header: Header,
    status: Vec<DiagnosticStatus>,
}

#[derive(Clone, Debug, Deserialize)]
struct DiagnosticStatus {
    level: u8,
    name: String,
    message: String,
    #[expect(dead_code, reason = "it is on the wire")]
    hardware_id: String,
    values: Vec<(String, String)>,
}

fn name(topic: &str) -> Name {
    Name::parse(topic).unwrap()
}

fn kind(message_type: &str) -> MessageTypeName {
    let (package, name) = message_type.split_once("/msg/").unwrap();
    MessageTypeName::new(package, name)
}

/// A participant other than the bridge.
struct Peer {
    node: Node,
}

fn reliable() -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::DEFAULT)
        .history(History::KeepLast { depth: 64 })
}

fn sensor() -> QosProfile {
    QosProfile::subscription_default()
}

impl Peer {
    fn join(domain: u16, name: &str) -> Self {
        let context = Context::with_options(ContextOptions::new().domain_id(domain)).unwrap();
        let name = NodeName::new("/", name).unwrap();
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        Self { node: context.new_node(name, options).unwrap() }
    }

    fn publisher<M: Message + Serialize>(&mut self, topic: &str, qos: QosProfile) -> Publisher<M> {
        self.publisher_of(topic, M::TYPE, qos)
    }

    fn publisher_of<M: Serialize>(
        &mut self,
        topic: &str,
        message_type: &str,
        qos: QosProfile,
    ) -> Publisher<M> {
        let topic = self.node.create_topic(&name(topic), kind(message_type), &qos).unwrap();
        self.node.create_publisher(&topic, Some(qos)).unwrap()
    }

    /// Collects the messages of a topic until `stop`.
    fn collect<M>(&mut self, topic: &str, stop: &Arc<AtomicBool>) -> Collected<M>
    where
        M: Message + DeserializeOwned + Send + 'static,
    {
        self.collect_of(topic, M::TYPE, stop)
    }

    fn collect_of<M>(
        &mut self,
        topic: &str,
        message_type: &str,
        stop: &Arc<AtomicBool>,
    ) -> Collected<M>
    where
        M: DeserializeOwned + Send + 'static,
    {
        let topic = self.node.create_topic(&name(topic), kind(message_type), &reliable()).unwrap();
        let subscription = self.node.create_subscription::<M>(&topic, Some(reliable())).unwrap();
        let (stop, heard) = (Arc::clone(stop), Arc::new(Mutex::new(Vec::new())));
        let theirs = Arc::clone(&heard);
        let thread = thread::spawn(move || {
            while !stop.load(Ordering::Relaxed) {
                while let Ok(Some((message, _))) = subscription.take() {
                    theirs.lock().unwrap().push((Instant::now(), message));
                }
                sleep(Duration::from_millis(2));
            }
        });
        Collected { heard, thread }
    }
}

/// Messages with their times of arrival.
struct Collected<M> {
    heard: Arc<Mutex<Vec<(Instant, M)>>>,
    thread: JoinHandle<()>,
}

/// A hand at the switch, which enables ten times a second while it holds it.
struct Hand {
    holds: Arc<AtomicBool>,
    enable: Arc<Publisher<Bool>>,
    reset: Publisher<Empty>,
}

impl Hand {
    fn new(domain: u16, stop: &Arc<AtomicBool>) -> Self {
        let mut peer = Peer::join(domain, "hand");
        let enable = peer.publisher_of::<Bool>("/people/enable", "std_msgs/msg/Bool", reliable());
        let reset = peer.publisher_of("/people/reset", "std_msgs/msg/Empty", reliable());
        let (enable, holds) = (Arc::new(enable), Arc::new(AtomicBool::new(false)));
        let (theirs, held, stop) = (Arc::clone(&enable), Arc::clone(&holds), Arc::clone(stop));
        thread::spawn(move || {
            let _node = peer;
            while !stop.load(Ordering::Relaxed) {
                if held.load(Ordering::Relaxed) {
                    theirs.publish(Bool { data: true }).unwrap();
                }
                sleep(Duration::from_millis(100));
            }
        });
        Self { holds, enable, reset }
    }

    fn hold(&self, holds: bool) {
        self.holds.store(holds, Ordering::Relaxed);
    }

    fn reset(&self) {
        self.reset.publish(Empty { byte: 0 }).unwrap();
    }

    fn switch_off(&self) {
        self.enable.publish(Bool { data: false }).unwrap();
    }
}

/// Log messages of a bridge.
type Said = Arc<Mutex<Vec<String>>>;

/// Waits until the bridge has said these words.
fn wait_for(said: &Said, words: &str) {
    let deadline = Instant::now() + Duration::from_secs(30);
    while !said.lock().unwrap().iter().any(|line| line.contains(words)) {
        assert!(Instant::now() < deadline, "no `{words}` in {:?}", said.lock().unwrap());
        sleep(Duration::from_millis(10));
    }
}

impl<M: Clone> Collected<M> {
    fn so_far(&self) -> Vec<(Instant, M)> {
        self.heard.lock().unwrap().clone()
    }
}

impl Collected<TwistStamped> {
    /// Returns true if a command since then moves the robot.
    fn moves_since(&self, then: Instant) -> bool {
        self.so_far().iter().any(|(at, command)| *at > then && speeds(command) != [0.0, 0.0])
    }

    /// Waits until a command moves the robot.
    fn wait_for_move(&self, why: &str) {
        let from = Instant::now();
        while !self.moves_since(from) {
            assert!(from.elapsed() < Duration::from_secs(20), "nothing moves: {why}");
            sleep(Duration::from_millis(10));
        }
    }
}

impl<M> Collected<M> {
    fn finish(self) -> Vec<(Instant, M)> {
        self.thread.join().unwrap();
        std::mem::take(&mut *self.heard.lock().unwrap())
    }
}

/// Returns true if two participants hear each other at all.
fn can_talk() -> bool {
    let stop = Arc::new(AtomicBool::new(false));
    let (mut one, mut other) = (Peer::join(domain(1), "one"), Peer::join(domain(1), "other"));
    let publisher = one.publisher::<StringMsg>("/hello", reliable());
    let heard = other.collect::<StringMsg>("/hello", &stop);
    let deadline = Instant::now() + Duration::from_secs(15);
    while heard.heard.lock().unwrap().is_empty() && Instant::now() < deadline {
        let _sent = publisher.publish(StringMsg { data: "hello".into() });
        sleep(Duration::from_millis(100));
    }
    stop.store(true, Ordering::Relaxed);
    !heard.finish().is_empty()
}

/// Topics of a simulated robot.
struct Robot {
    peer: Peer,
    colour: Publisher<Image<'static>>,
    depth: Publisher<Image<'static>>,
    info: Publisher<CameraInfo>,
    odometry: Publisher<Odometry>,
    fixed: Publisher<TFMessage>,
    camera: Camera,
    /// Time of the clock at the start of the scene.
    epoch: Stamp,
    /// True once the calibration is another one.
    zoomed: Arc<AtomicBool>,
}

impl Robot {
    fn new(domain: u16, camera: &Camera) -> Self {
        let mut peer = Peer::join(domain, "robot");
        let latched = reliable().durability(Durability::TransientLocal);
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
        Self {
            colour: peer.publisher("/camera/color/image_raw", sensor()),
            depth: peer.publisher("/camera/aligned_depth_to_color/image_raw", sensor()),
            info: peer.publisher("/camera/color/camera_info", sensor()),
            odometry: peer.publisher("/odom", reliable()),
            fixed: peer.publisher("/tf_static", latched),
            peer,
            camera: camera.clone(),
            epoch: Stamp::from_nanos(since.as_nanos() as u64),
            zoomed: Arc::default(),
        }
    }

    /// Publishes a scene in real time; returns the time of the last image.
    fn play(&self, simulation: Simulation) -> Instant {
        self.play_while(simulation, &|_| true)
    }

    /// Publishes the events of a scene for which `is_sent` is true in real time; returns the time of
    /// the last image.
    fn play_while(&self, mut simulation: Simulation, is_sent: &dyn Fn(&Event) -> bool) -> Instant {
        self.fixed.publish(self.mount()).unwrap();
        let start = Instant::now();
        let at = |ns| sleep((start + Duration::from_nanos(ns)) - Instant::now());
        let mut last = start;
        while let Some(event) = simulation.next_event() {
            if !is_sent(&event) {
                continue;
            }
            match event {
                Event::Odometry(reading) => {
                    at(reading.at_ns);
                    self.odometry.publish(self.odometry(&reading)).unwrap();
                }
                Event::Shot(shot) => {
                    at(shot.captured_ns);
                    self.shoot(&shot);
                    last = Instant::now();
                }
                Event::Webcam(_) => {}
            }
        }
        last
    }

    fn header(&self, at_ns: u64, frame: &str) -> Header {
        Header::new(Stamp::from_nanos(self.epoch.nanos() + at_ns), frame)
    }

    fn mount(&self) -> TFMessage {
        let transform = TransformStamped {
            header: self.header(0, "base_link"),
            child_frame_id: "camera".into(),
            transform: (&self.camera.robot_from_camera).into(),
        };
        TFMessage { transforms: vec![transform] }
    }

    fn odometry(&self, reading: &OdometryReading) -> Odometry {
        let at = reading.odom_from_robot;
        let mut odometry = Odometry {
            header: self.header(reading.at_ns, "odom"),
            child_frame_id: "base_link".into(),
            ..Odometry::default()
        };
        let turn = 0.5 * at.rotation.angle();
        let pose: &mut Pose = &mut odometry.pose.pose;
        (pose.position.x, pose.position.y) = (at.translation.x, at.translation.y);
        (pose.orientation.z, pose.orientation.w) = turn.sin_cos();
        odometry
    }

    fn shoot(&self, shot: &Shot) {
        let header = self.header(shot.captured_ns, "camera");
        let colour = shot.images.colour.as_ref().unwrap().pixels().as_flattened().to_vec();
        let depth = shot.images.depth.as_ref().unwrap();
        let depth = depth.pixels().iter().flat_map(|z| z.to_le_bytes()).collect();
        self.info.publish(self.calibration(&header)).unwrap();
        self.colour.publish(self.image(&header, "rgb8", 3, colour)).unwrap();
        self.depth.publish(self.image(&header, "32FC1", 4, depth)).unwrap();
    }

    fn image(&self, header: &Header, encoding: &str, bytes: u32, data: Vec<u8>) -> Image<'static> {
        let (width, height) = (self.camera.width as u32, self.camera.height as u32);
        let (encoding, step) = (encoding.into(), bytes * width);
        let (header, is_bigendian) = (header.clone(), 0);
        // The message borrows its data, and a leak in a test does no harm.
        Image { header, height, width, encoding, is_bigendian, step, data: data.leak() }
    }

    fn calibration(&self, header: &Header) -> CameraInfo {
        let Lens::Pinhole(lens) = self.camera.lens else { panic!("a pinhole camera") };
        let zoom = if self.zoomed.load(Ordering::Relaxed) { 1.2 } else { 1.0 };
        let lens = Pinhole { fx: zoom * lens.fx, fy: zoom * lens.fy, ..lens };
        let size = (self.camera.width, self.camera.height);
        CameraInfo::of_lens(header, &lens, size, 0.0)
    }
}

fn options(domain: u16, wait_s: &str) -> Options {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/depth-ekf-follow.toml");
    let domain = domain.to_string();
    let config = config.to_str().unwrap();
    Options::parse_from(["tagalong-ros2", config, "--domain", &domain, "--wait", wait_s])
}

type Ended = JoinHandle<Result<Summary, BridgeError>>;

fn bridge(domain: u16, stop: &Arc<AtomicBool>) -> (Ended, Said) {
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    bridge_with(options(domain, "20"), registry, stop)
}

fn bridge_with(options: Options, registry: Registry, stop: &Arc<AtomicBool>) -> (Ended, Said) {
    let (stop, said) = (Arc::clone(stop), Said::default());
    let theirs = Arc::clone(&said);
    let ended = thread::spawn(move || {
        run_with(&options, &registry, &stop, &|sentence| {
            eprintln!("bridge: {sentence}");
            theirs.lock().unwrap().push(sentence.to_owned());
        })
    });
    (ended, said)
}

/// Returns metres per second and radians per second.
fn speeds(command: &TwistStamped) -> [f64; 2] {
    [command.twist.linear.x, command.twist.angular.z]
}

#[test]
fn images_become_tracks_and_commands_and_silence_becomes_zero() {
    let Some(_alone) = alone() else { return };
    let (stop, heard_all) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let simulation = Simulation::new(&scene(12.0), 1);
    let mut robot = Robot::new(domain(0), simulation.camera());
    let tracks = robot.peer.collect::<Detection3DArray>("/people/tracks", &heard_all);
    let poses = robot.peer.collect::<PoseStamped>("/people/target_pose", &heard_all);
    let states = robot.peer.collect::<StringMsg>("/people/state", &heard_all);
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let (bridge, said) = bridge(domain(0), &stop);
    let hand = Hand::new(domain(0), &stop);
    let hands = thread::spawn(move || {
        wait_for(&said, "needs a reset");
        hand.reset();
        hand.hold(true);
    });
    let last_image = robot.play(simulation);
    hands.join().unwrap();
    sleep(Duration::from_secs(3));
    let stopped = Instant::now();
    stop.store(true, Ordering::Relaxed);
    let summary = bridge.join().unwrap().unwrap();
    sleep(Duration::from_millis(300));
    heard_all.store(true, Ordering::Relaxed);
    let (tracks, poses, states) = (tracks.finish(), poses.finish(), states.finish());
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
    let moves = |command: &TwistStamped| speeds(command) != [0.0, 0.0];
    let moving = commands.iter().filter(|(_, command)| moves(command));
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
    assert!(farewell.0 > stopped && !moves(&farewell.1), "the last command is zero");
}

#[test]
fn what_is_missing_is_named_and_the_wait_has_an_end() {
    let stop = AtomicBool::new(false);
    let _alone = alone();
    let from = Instant::now();
    let error = run(&options(domain(2), "1"), &stop, &|_| ()).unwrap_err();
    assert!(from.elapsed() < Duration::from_secs(10));
    assert_eq!(error.exit_code(), 1);
    let text = error.to_string();
    assert!(text.starts_with(&format!("`ROS domain {}` has no ", domain(2))), "{text}");
    assert!(text.contains("present:"), "{text}");
}

/// The deadman's switch on the network: before an enable, while it is repeated, after it ceases,
/// after `false`, and after a reset.
#[test]
fn the_robot_moves_while_the_switch_is_held_and_after_a_stop_only_after_a_reset() {
    let Some(_alone) = alone() else { return };
    let (stop, heard_all) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
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
    hand.hold(false);
    sleep(Duration::from_millis(700));
    hand.reset();
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
    hand.hold(true);
    commands.wait_for_move("held again");

    hand.switch_off();
    sleep(Duration::from_millis(200));
    let off = Instant::now();
    sleep(Duration::from_millis(1500));
    assert!(!commands.moves_since(off), "a false latches, though true is repeated");
    wait_for(&said, "switched off");
    hand.reset();
    commands.wait_for_move("reset, and the switch is held");

    stop.store(true, Ordering::Relaxed);
    bridge.join().unwrap().unwrap();
    playing.join().unwrap();
    sleep(Duration::from_millis(300));
    heard_all.store(true, Ordering::Relaxed);
    assert_eq!(commands.finish().last().map(|(_, command)| speeds(command)), Some([0.0, 0.0]));
}

/// Odometry pauses for two seconds while frames go on; later the calibration changes.
#[test]
fn odometry_that_stops_while_frames_go_on_stops_the_robot_and_another_calibration_ends_the_ride() {
    let Some(_alone) = alone() else { return };
    let (stop, heard_all) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let simulation = Simulation::new(&scene(25.0), 1);
    let mut robot = Robot::new(domain(4), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let (bridge, said) = bridge(domain(4), &stop);
    let hand = Hand::new(domain(4), &stop);
    let (silent, zoomed) = (Arc::new(AtomicBool::new(false)), Arc::clone(&robot.zoomed));
    let is_silent = Arc::clone(&silent);
    let playing = thread::spawn(move || {
        robot.play_while(simulation, &|event| {
            !(matches!(event, Event::Odometry(_)) && is_silent.load(Ordering::Relaxed))
        })
    });
    wait_for(&said, "needs a reset");
    hand.reset();
    hand.hold(true);
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
struct Stuck(Arc<AtomicBool>);

/// Time for which it is stuck.
const STUCK: Duration = Duration::from_millis(3000);

#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct NoSettings {}

impl Controller for Stuck {
    fn command(&mut self, _: &tagalong_core::Scene<'_>) -> Twist {
        if self.0.swap(false, Ordering::Relaxed) {
            sleep(STUCK);
        }
        Twist::new(0.2, 0.0)
    }
}

/// A pipeline that is stuck in one frame, another publisher of commands, and bytes that are no
/// message of their type: the robot stands, and the diagnostics tell.
#[test]
fn a_stuck_pipeline_stands_and_rivals_and_malformed_messages_are_told() {
    let Some(_alone) = alone() else { return };
    let (stop, heard_all) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let simulation = Simulation::new(&scene(30.0), 1);
    let mut robot = Robot::new(domain(5), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let array = "diagnostic_msgs/msg/DiagnosticArray";
    let told = robot.peer.collect_of::<DiagnosticArray>("/diagnostics", array, &heard_all);
    let beats =
        robot.peer.collect_of::<Header>("/people/heartbeat", "std_msgs/msg/Header", &heard_all);
    let is_stuck = Arc::new(AtomicBool::new(false));
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    let flag = Arc::clone(&is_stuck);
    registry.controller("stuck", "is stuck", move |_: NoSettings, _| Ok(Stuck(Arc::clone(&flag))));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
    let config = std::env::temp_dir().join(format!("tagalong-stuck-{}.toml", std::process::id()));
    let base = folder.join("depth-ekf.toml").canonicalize().unwrap();
    let text = format!("extends = '{}'\n[controller]\nplugin = 'stuck'\n", base.display());
    std::fs::write(&config, text).unwrap();
    let options = Options { config: config.clone(), ..options(domain(5), "20") };
    let (bridge, said) = bridge_with(options, registry, &stop);
    let hand = Hand::new(domain(5), &stop);
    let junk = robot.peer.publisher_of::<u8>("/odom", Odometry::TYPE, reliable());
    let playing = thread::spawn(move || (robot.play(simulation), robot).1);
    wait_for(&said, "needs a reset");
    hand.reset();
    hand.hold(true);
    commands.wait_for_move("enabled");

    is_stuck.store(true, Ordering::Relaxed);
    // The command of the last frame expires a quarter of a second after its stamp.
    sleep(Duration::from_millis(250 + 100 + 300));
    let expired = Instant::now();
    sleep(Duration::from_millis(1900));
    assert!(!commands.moves_since(expired), "stuck");
    let stuck = |message: &DiagnosticStatus| {
        message.level == 2 && message.message.contains("one frame takes")
    };
    let statuses = |told: &Collected<DiagnosticArray>| -> Vec<DiagnosticStatus> {
        told.so_far().into_iter().flat_map(|(_, array)| array.status).collect()
    };
    assert!(statuses(&told).iter().any(stuck), "{:?}", statuses(&told));
    commands.wait_for_move("no longer stuck");

    junk.publish(7).unwrap();
    let mut rival = Peer::join(domain(5), "rival");
    let _rival = rival.publisher::<TwistStamped>("/cmd_vel", reliable());
    wait_for(&said, "1 other publishers of commands on cmd_vel");
    sleep(Duration::from_millis(1500));
    let last = statuses(&told).pop().unwrap();
    assert_eq!((last.level, last.name.as_str()), (1, "tagalong: follow"));
    let value =
        |key: &str| last.values.iter().find(|(name, _)| name == key).map(|(_, v)| v.clone());
    assert_eq!(value("other publishers of commands").as_deref(), Some("1"), "{last:?}");
    assert_eq!(value("malformed messages").as_deref(), Some("1"), "{last:?}");
    assert!(beats.so_far().len() > 20);

    stop.store(true, Ordering::Relaxed);
    let summary = bridge.join().unwrap().unwrap();
    assert_eq!(summary.traffic["/odom"].malformed, 1, "{summary}");
    assert!(summary.to_string().contains("1 malformed"), "{summary}");
    heard_all.store(true, Ordering::Relaxed);
    drop(playing.join().unwrap());
    std::fs::remove_file(config).unwrap();
}

#[test]
fn a_controller_without_odometry_is_refused_and_tells_the_wheels_nothing() {
    let Some(_alone) = alone() else { return };
    let (stop, heard_all) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let simulation = Simulation::new(&scene(9.0), 1);
    let mut robot = Robot::new(domain(6), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    let (bridge, _) = bridge_with(options(domain(6), "6"), registry, &stop);
    robot.play_while(simulation, &|event| !matches!(event, Event::Odometry(_)));
    let error = bridge.join().unwrap().unwrap_err();
    assert_eq!(error.exit_code(), 1);
    let text = error.to_string();
    assert!(text.contains("no odometry") && text.contains("odometry = \"none\""), "{text}");
    heard_all.store(true, Ordering::Relaxed);
    assert!(commands.finish().is_empty());
}
