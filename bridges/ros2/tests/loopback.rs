//! The bridge and a simulated robot, two participants that communicate over UDP.
//!
//! If they cannot hear each other (no multicast, no loopback), the test reports that and is
//! skipped.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing test may panic")]

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle, sleep};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use clap::Parser;
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher,
    QosProfile,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use tagalong_core::Stamp;
use tagalong_geometry::{Camera, Lens};
use tagalong_log::msgs::{
    CameraInfo, Detection3DArray, Header, Image, Message, Odometry, Pose, PoseStamped, StringMsg,
    TFMessage, TransformStamped, TwistStamped,
};
use tagalong_ros2::{BridgeError, Options, Summary, run};
use tagalong_sim::{Event, OdometryReading, Scene, Shot, Simulation, Variant};

/// Returns a scene of a person that stands before the robot and then walks away slowly.
fn scene() -> Scene {
    let walk = Variant::default()
        .with("duration_s", 10.0)
        .with("people.0.path", "[[3.0, 2.0], [7.0, 2.0]]")
        .with("people.0.speed_mps", 0.4)
        .with("people.0.start_s", 3.0);
    Scene::parse_with(include_str!("../../../tests/scenes/small-room.toml"), &walk).unwrap()
}

/// Longest time between the last image and a command that moves: the validity of a command, a
/// control period, and the transmission.
const LAST_MOVE_S: f64 = 0.5 + 0.04 + 0.2;

/// Returns a domain that no other run of this test is likely to use.
fn domain(offset: u32) -> u16 {
    // Three domains per process, below the limit of 232.
    (100 + 3 * (std::process::id() % 40) + offset) as u16
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
        let topic = self.node.create_topic(&name(topic), kind(M::TYPE), &qos).unwrap();
        self.node.create_publisher(&topic, Some(qos)).unwrap()
    }

    /// Collects the messages of a topic until `stop`.
    fn collect<M>(&mut self, topic: &str, stop: &Arc<AtomicBool>) -> Collected<M>
    where
        M: Message + DeserializeOwned + Send + 'static,
    {
        let topic = self.node.create_topic(&name(topic), kind(M::TYPE), &reliable()).unwrap();
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
        }
    }

    /// Publishes a scene in real time; returns the time of the last image.
    fn play(&self, mut simulation: Simulation) -> Instant {
        self.fixed.publish(self.mount()).unwrap();
        let start = Instant::now();
        let at = |ns| sleep((start + Duration::from_nanos(ns)) - Instant::now());
        let mut last = start;
        while let Some(event) = simulation.next_event() {
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

fn bridge(domain: u16, stop: &Arc<AtomicBool>) -> JoinHandle<Result<Summary, BridgeError>> {
    let (options, stop) = (options(domain, "20"), Arc::clone(stop));
    thread::spawn(move || run(&options, &stop, &|sentence| eprintln!("bridge: {sentence}")))
}

/// Returns metres per second and radians per second.
fn speeds(command: &TwistStamped) -> [f64; 2] {
    [command.twist.linear.x, command.twist.angular.z]
}

#[test]
fn images_become_tracks_and_commands_and_silence_becomes_zero() {
    if !can_talk() {
        eprintln!("skipped: two participants do not hear each other here (no multicast?)");
        return;
    }
    let (stop, heard_all) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let simulation = Simulation::new(&scene(), 1);
    let mut robot = Robot::new(domain(0), simulation.camera());
    let tracks = robot.peer.collect::<Detection3DArray>("/people/tracks", &heard_all);
    let poses = robot.peer.collect::<PoseStamped>("/people/target_pose", &heard_all);
    let states = robot.peer.collect::<StringMsg>("/people/state", &heard_all);
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let bridge = bridge(domain(0), &stop);
    let last_image = robot.play(simulation);
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
    let from = Instant::now();
    let error = run(&options(domain(2), "1"), &stop, &|_| ()).unwrap_err();
    assert!(from.elapsed() < Duration::from_secs(10));
    assert_eq!(error.exit_code(), 1);
    let text = error.to_string();
    assert!(text.starts_with(&format!("`ROS domain {}` has no ", domain(2))), "{text}");
    assert!(text.contains("present:"), "{text}");
}
