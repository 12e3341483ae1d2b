//! Participants other than the bridge: a simulated robot, a hand at the switch, listeners.

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
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use tagalong::config::Registry;
use tagalong::core::Stamp;
use tagalong::geometry::{Camera, Lens, Pinhole};
use tagalong::log::msgs::{
    CameraInfo, Header, Image, Message, Odometry, Pose, StringMsg, TFMessage, TransformStamped,
    Twist, TwistStamped,
};
use tagalong_ros2::{BridgeError, Options, Summary, run_with};
use tagalong_sim::{Event, OdometryReading, Scene, Shot, Simulation, Variant};

/// Returns a scene of so many seconds, of a person that stands before the robot and then walks away
/// slowly.
pub(crate) fn scene(seconds: f64) -> Scene {
    let walk = Variant::default()
        .with("duration_s", seconds)
        .with("people.0.path", "[[3.0, 2.0], [7.0, 2.0]]")
        .with("people.0.speed_mps", 0.3)
        .with("people.0.start_s", 3.0);
    Scene::parse_with(include_str!("../../../../tests/scenes/small-room.toml"), &walk).unwrap()
}

/// Returns a scene of so many seconds, of a person that stands before the robot.
pub(crate) fn standing(seconds: f64) -> Scene {
    let stands = Variant::default()
        .with("duration_s", seconds)
        .with("people.0.path", "[[3.0, 2.0], [7.0, 2.0]]")
        .with("people.0.start_s", seconds);
    Scene::parse_with(include_str!("../../../../tests/scenes/small-room.toml"), &stands).unwrap()
}

/// Longest time between the last image and a command that moves: the validity of a command, a
/// control period, and the transmission.
pub(crate) const LAST_MOVE_S: f64 = 0.5 + 0.04 + 0.2;

/// Returns a domain that no other run of this test is likely to use.
pub(crate) fn domain(offset: u32) -> u16 {
    // Eighteen domains per process, below the limit of 232.
    (100 + 18 * (std::process::id() % 7) + offset) as u16
}

/// Returns a guard for a test that runs alone, or `None` where participants do not hear each other.
pub(crate) fn alone() -> Option<MutexGuard<'static, ()>> {
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
pub(crate) struct Bool {
    pub(crate) data: bool,
}

/// `std_msgs/Empty`, with its one byte on the wire.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Empty {
    pub(crate) byte: u8,
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct DiagnosticArray {
    #[expect(dead_code, reason = "it is on the wire")]
    pub(crate) header: Header,
    pub(crate) status: Vec<DiagnosticStatus>,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct DiagnosticStatus {
    pub(crate) level: u8,
    pub(crate) name: String,
    pub(crate) message: String,
    #[expect(dead_code, reason = "it is on the wire")]
    pub(crate) hardware_id: String,
    pub(crate) values: Vec<(String, String)>,
}

pub(crate) fn name(topic: &str) -> Name {
    Name::parse(topic).unwrap()
}

pub(crate) fn kind(message_type: &str) -> MessageTypeName {
    let (package, name) = message_type.split_once("/msg/").unwrap();
    MessageTypeName::new(package, name)
}

/// A participant other than the bridge.
pub(crate) struct Peer {
    pub(crate) node: Node,
}

pub(crate) fn reliable() -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::DEFAULT)
        .history(History::KeepLast { depth: 64 })
}

pub(crate) fn sensor() -> QosProfile {
    QosProfile::subscription_default()
}

impl Peer {
    pub(crate) fn join(domain: u16, name: &str) -> Self {
        let context = Context::with_options(ContextOptions::new().domain_id(domain)).unwrap();
        let name = NodeName::new("/", name).unwrap();
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        Self { node: context.new_node(name, options).unwrap() }
    }

    pub(crate) fn publisher<M: Message + Serialize>(
        &mut self,
        topic: &str,
        qos: QosProfile,
    ) -> Publisher<M> {
        self.publisher_of(topic, M::TYPE, qos)
    }

    pub(crate) fn publisher_of<M: Serialize>(
        &mut self,
        topic: &str,
        message_type: &str,
        qos: QosProfile,
    ) -> Publisher<M> {
        let topic = self.node.create_topic(&name(topic), kind(message_type), &qos).unwrap();
        self.node.create_publisher(&topic, Some(qos)).unwrap()
    }

    /// Collects the messages of a topic until `stop`.
    pub(crate) fn collect<M>(&mut self, topic: &str, stop: &Arc<AtomicBool>) -> Collected<M>
    where
        M: Message + DeserializeOwned + Send + 'static,
    {
        self.collect_of(topic, M::TYPE, stop)
    }

    pub(crate) fn collect_of<M>(
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
        let stop = Arc::clone(stop);
        let heard = Arc::new(Mutex::new(Vec::new()));
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
pub(crate) struct Collected<M> {
    pub(crate) heard: Arc<Mutex<Vec<(Instant, M)>>>,
    pub(crate) thread: JoinHandle<()>,
}

/// A hand at the switch, which enables ten times a second while it holds it.
pub(crate) struct Hand {
    pub(crate) holds: Arc<AtomicBool>,
    pub(crate) enable: Arc<Publisher<Bool>>,
    pub(crate) reset: Publisher<Empty>,
}

impl Hand {
    pub(crate) fn new(domain: u16, stop: &Arc<AtomicBool>) -> Self {
        let mut peer = Peer::join(domain, "hand");
        let enable = peer.publisher_of::<Bool>("/people/enable", "std_msgs/msg/Bool", reliable());
        let reset = peer.publisher_of("/people/reset", "std_msgs/msg/Empty", reliable());
        let enable = Arc::new(enable);
        let holds = Arc::new(AtomicBool::new(false));
        let theirs = Arc::clone(&enable);
        let held = Arc::clone(&holds);
        let stop = Arc::clone(stop);
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

    pub(crate) fn hold(&self, holds: bool) {
        self.holds.store(holds, Ordering::Relaxed);
    }

    pub(crate) fn reset(&self) {
        self.reset.publish(Empty { byte: 0 }).unwrap();
    }

    /// Resets, again until the bridge has said so (the first message may come before the two know each
    /// other), and holds the switch.
    pub(crate) fn let_go(&self, said: &Said) {
        wait_for(said, "needs a reset");
        self.reset_until_heard(said);
        self.hold(true);
    }

    /// Resets until the bridge says so once more.
    pub(crate) fn reset_until_heard(&self, said: &Said) {
        let before = resets(said);
        let deadline = Instant::now() + Duration::from_secs(30);
        while resets(said) == before {
            assert!(Instant::now() < deadline, "no reset in {:?}", said.lock().unwrap());
            self.reset();
            sleep(Duration::from_millis(200));
        }
    }

    /// Lets go of the switch for longer than an enable holds, and presses it again.
    pub(crate) fn press_again(&self) {
        self.hold(false);
        sleep(Duration::from_millis(100 + 500 + 100));
        self.hold(true);
    }

    pub(crate) fn switch_off(&self) {
        self.enable.publish(Bool { data: false }).unwrap();
    }
}

/// Log messages of a bridge.
pub(crate) type Said = Arc<Mutex<Vec<String>>>;

/// Returns the number of resets of which the bridge has said that they count.
fn resets(said: &Said) -> usize {
    said.lock().unwrap().iter().filter(|line| *line == "reset").count()
}

/// Waits until the bridge has said these words.
pub(crate) fn wait_for(said: &Said, words: &str) {
    let deadline = Instant::now() + Duration::from_secs(30);
    while !said.lock().unwrap().iter().any(|line| line.contains(words)) {
        assert!(Instant::now() < deadline, "no `{words}` in {:?}", said.lock().unwrap());
        sleep(Duration::from_millis(10));
    }
}

impl<M: Clone> Collected<M> {
    pub(crate) fn so_far(&self) -> Vec<(Instant, M)> {
        self.heard.lock().unwrap().clone()
    }
}

/// A command, with or without a header.
pub(crate) trait Command: Clone {
    fn twist(&self) -> &Twist;
}

impl Command for Twist {
    fn twist(&self) -> &Twist {
        self
    }
}

impl Command for TwistStamped {
    fn twist(&self) -> &Twist {
        &self.twist
    }
}

impl<C: Command> Collected<C> {
    /// Returns true if a command since then moves the robot.
    pub(crate) fn moves_since(&self, then: Instant) -> bool {
        self.so_far().iter().any(|(at, command)| *at > then && speeds(command) != [0.0, 0.0])
    }

    /// Returns the speed ahead of the first command since then that moves the robot, m/s; 0 without
    /// one.
    pub(crate) fn first_speed_since(&self, then: Instant) -> f64 {
        for (at, command) in self.so_far() {
            if at > then && speeds(&command) != [0.0, 0.0] {
                return command.twist().linear.x;
            }
        }
        0.0
    }

    /// Waits until a command moves the robot.
    pub(crate) fn wait_for_move(&self, why: &str) {
        let from = Instant::now();
        while !self.moves_since(from) {
            assert!(from.elapsed() < Duration::from_secs(20), "nothing moves: {why}");
            sleep(Duration::from_millis(10));
        }
    }
}

impl<M> Collected<M> {
    pub(crate) fn finish(self) -> Vec<(Instant, M)> {
        self.thread.join().unwrap();
        std::mem::take(&mut *self.heard.lock().unwrap())
    }
}

/// Returns true if two participants hear each other at all.
pub(crate) fn can_talk() -> bool {
    let stop = Arc::new(AtomicBool::new(false));
    let mut one = Peer::join(domain(1), "one");
    let mut other = Peer::join(domain(1), "other");
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

/// Repetition of the last images in place of new ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Repeats {
    /// New images are published.
    #[default]
    Nothing,
    /// The last images are published again as they were, with their stamps.
    Images,
    /// The last images are published again with new stamps.
    Pictures,
}

/// Returns the time of the clock of the machine.
fn now() -> Stamp {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    Stamp::from_nanos(since.as_nanos() as u64)
}

/// Topics of a simulated robot.
pub(crate) struct Robot {
    pub(crate) peer: Peer,
    pub(crate) colour: Publisher<Image<'static>>,
    pub(crate) depth: Publisher<Image<'static>>,
    pub(crate) info: Publisher<CameraInfo>,
    pub(crate) odometry: Publisher<Odometry>,
    pub(crate) fixed: Publisher<TFMessage>,
    pub(crate) camera: Camera,
    /// Time of the clock at the start of the scene.
    pub(crate) epoch: Stamp,
    /// True once the calibration is another one.
    pub(crate) zoomed: Arc<AtomicBool>,
    /// Images that the camera repeats.
    pub(crate) repeats: Arc<Mutex<Repeats>>,
}

impl Robot {
    pub(crate) fn new(domain: u16, camera: &Camera) -> Self {
        let mut peer = Peer::join(domain, "robot");
        let latched = reliable().durability(Durability::TransientLocal);
        Self {
            colour: peer.publisher("/camera/color/image_raw", sensor()),
            depth: peer.publisher("/camera/aligned_depth_to_color/image_raw", sensor()),
            info: peer.publisher("/camera/color/camera_info", sensor()),
            odometry: peer.publisher("/odom", reliable()),
            fixed: peer.publisher("/tf_static", latched),
            peer,
            camera: camera.clone(),
            epoch: now(),
            zoomed: Arc::default(),
            repeats: Arc::default(),
        }
    }

    /// Lets the scene start now, after a wait for other nodes: old frames move nothing.
    pub(crate) fn start_now(&mut self) {
        self.epoch = now();
    }

    /// Publishes a scene in real time; returns the time of the last image.
    pub(crate) fn play(&self, simulation: Simulation) -> Instant {
        self.play_while(simulation, &|_| true)
    }

    /// Publishes the events of a scene for which `is_sent` is true in real time; returns the time of
    /// the last image.
    pub(crate) fn play_while(
        &self,
        mut simulation: Simulation,
        is_sent: &dyn Fn(&Event) -> bool,
    ) -> Instant {
        self.fixed.publish(self.mount()).unwrap();
        let start = Instant::now();
        let mut last = start;
        let mut repeated: Option<Shot> = None;
        while let Some(event) = simulation.next_event() {
            if !is_sent(&event) {
                continue;
            }
            match event {
                Event::Odometry(reading) => {
                    sleep(start + Duration::from_nanos(reading.at_ns) - Instant::now());
                    self.odometry.publish(self.odometry(&reading)).unwrap();
                }
                Event::Shot(shot) => {
                    sleep(start + Duration::from_nanos(shot.captured_ns) - Instant::now());
                    let repeats = *self.repeats.lock().unwrap();
                    match repeated.as_mut().filter(|_| repeats != Repeats::Nothing) {
                        Some(shown) if repeats == Repeats::Images => self.shoot(shown),
                        Some(shown) => {
                            shown.captured_ns = shot.captured_ns;
                            self.shoot(shown);
                        }
                        None => {
                            self.shoot(&shot);
                            repeated = Some(*shot);
                        }
                    }
                    last = Instant::now();
                }
                Event::NoOdometry { .. } | Event::Sensor(_) | Event::Webcam(_) => {}
            }
        }
        last
    }

    pub(crate) fn header(&self, at_ns: u64, frame: &str) -> Header {
        Header::new(Stamp::from_nanos(self.epoch.nanos() + at_ns), frame)
    }

    pub(crate) fn mount(&self) -> TFMessage {
        let transform = TransformStamped {
            header: self.header(0, "base_link"),
            child_frame_id: "camera".into(),
            transform: (&self.camera.robot_from_camera).into(),
        };
        TFMessage { transforms: vec![transform] }
    }

    pub(crate) fn odometry(&self, reading: &OdometryReading) -> Odometry {
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

    pub(crate) fn shoot(&self, shot: &Shot) {
        let header = self.header(shot.captured_ns, "camera");
        let colour = shot.images.colour.as_ref().unwrap().pixels().as_flattened().to_vec();
        let depth = shot.images.depth.as_ref().unwrap();
        let depth = depth.pixels().iter().flat_map(|z| z.to_le_bytes()).collect();
        self.info.publish(self.calibration(&header)).unwrap();
        self.colour.publish(self.image(&header, "rgb8", 3, colour)).unwrap();
        self.depth.publish(self.image(&header, "32FC1", 4, depth)).unwrap();
    }

    pub(crate) fn image(
        &self,
        header: &Header,
        encoding: &str,
        bytes: u32,
        data: Vec<u8>,
    ) -> Image<'static> {
        let width = self.camera.width as u32;
        let height = self.camera.height as u32;
        let encoding = encoding.into();
        let step = bytes * width;
        let header = header.clone();
        let is_bigendian = 0;
        // The message borrows its data, and a leak in a test does no harm.
        Image { header, height, width, encoding, is_bigendian, step, data: data.leak() }
    }

    pub(crate) fn calibration(&self, header: &Header) -> CameraInfo {
        let Lens::Pinhole(lens) = self.camera.lens else { panic!("a pinhole camera") };
        let zoom = if self.zoomed.load(Ordering::Relaxed) { 1.2 } else { 1.0 };
        let lens = Pinhole { fx: zoom * lens.fx, fy: zoom * lens.fy, ..lens };
        let size = (self.camera.width, self.camera.height);
        CameraInfo::of_lens(header, &lens, size, 0.0)
    }
}

pub(crate) fn options(domain: u16, wait_s: &str) -> Options {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/driven-by-others.toml");
    let domain = domain.to_string();
    let config = config.to_str().unwrap();
    Options::parse_from(["tagalong-ros2", config, "--domain", &domain, "--wait", wait_s])
}

pub(crate) type Ended = JoinHandle<Result<Summary, BridgeError>>;

pub(crate) fn bridge(domain: u16, stop: &Arc<AtomicBool>) -> (Ended, Said) {
    let registry = tagalong::builtin_registry();
    bridge_with(options(domain, "20"), registry, stop)
}

pub(crate) fn bridge_with(
    options: Options,
    registry: Registry,
    stop: &Arc<AtomicBool>,
) -> (Ended, Said) {
    let stop = Arc::clone(stop);
    let said = Said::default();
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
pub(crate) fn speeds(command: &impl Command) -> [f64; 2] {
    [command.twist().linear.x, command.twist().angular.z]
}
