//! A robot whose scanner falls silent while its config requires scans.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use nalgebra::Isometry3;
use tagalong::config::NoSettings;
use tagalong::core::{Controller, Input, Inputs, Twist};
use tagalong::log::msgs::{LaserScan, TFMessage, TransformStamped, TwistStamped};
use tagalong_ros2::Options;
use tagalong_sim::{Event, LaserSettings, Scene, Shot, Simulation, Variant};

use crate::peers::*;
use crate::skill::http;

/// Age of a scan from which a frame is without one, and the time to the next frame.
const SCAN_AGE: Duration = Duration::from_millis(250 + 100);

/// Controller that drives ahead, and requires scans.
struct Scanned;

impl Controller for Scanned {
    fn inputs(&self) -> Inputs {
        Inputs::NONE.require(Input::Laser)
    }

    fn command(&mut self, _: &tagalong::core::Scene<'_>) -> Twist {
        Twist::new(0.2, 0.0)
    }
}

fn scan(robot: &Robot, laser: &LaserSettings, shot: &Shot) -> LaserScan {
    let first = laser.first_rad() as f32;
    let step = laser.step_rad() as f32;
    let ranges = shot.laser.clone().unwrap();
    LaserScan {
        header: robot.header(shot.captured_ns, "laser"),
        angle_min: first,
        angle_max: first + step * (ranges.len() - 1) as f32,
        angle_increment: step,
        range_min: laser.min_range_m as f32,
        range_max: laser.max_range_m as f32,
        ranges,
        ..LaserScan::default()
    }
}

/// The robot stands for frames without a scan, before its last command has expired, and drives on with
/// the next scan.
#[test]
#[ignore = "waits for messages for half a minute"]
fn frames_without_a_required_input_stop_the_robot_and_the_bridge_goes_on() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let with_laser = Variant::default()
        .with("duration_s", 30.0)
        .with("laser", "{}")
        .with("people.0.path", "[[3.0, 2.0], [7.0, 2.0]]")
        .with("people.0.speed_mps", 0.3)
        .with("people.0.start_s", 3.0);
    let scene = include_str!("../../../../tests/scenes/small-room.toml");
    let scene = Scene::parse_with(scene, &with_laser).unwrap();
    let simulation = Simulation::new(&scene, 1);
    let laser = simulation.laser().unwrap().clone();
    let mut robot = Robot::new(domain(17), simulation.camera());
    let commands = robot.peer.collect::<TwistStamped>("/cmd_vel", &heard_all);
    let array = "diagnostic_msgs/msg/DiagnosticArray";
    let told = robot.peer.collect_of::<DiagnosticArray>("/diagnostics", array, &heard_all);
    let scans = robot.peer.publisher::<LaserScan>("/scan", sensor());
    let mut registry = tagalong::builtin_registry();
    registry.controller("scanned", "needs scans", |_: NoSettings, _| Ok(Scanned));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
    let config = std::env::temp_dir().join(format!("tagalong-scanned-{}.toml", std::process::id()));
    let text = format!(
        "extends = '{}'\n[input]\nlaser_topic = '/scan'\n[controller]\nplugin = 'scanned'\n\
         [command_limiter]\ncheck_response = false\nvalid_s = 0.5\n",
        folder.join("depth-ekf.toml").canonicalize().unwrap().display()
    );
    std::fs::write(&config, text).unwrap();
    let address = format!("127.0.0.1:{}", 40_000 + std::process::id() % 20_000);
    let options = Options {
        config: config.clone(),
        http: Some(address.parse().unwrap()),
        ..options(domain(17), "20")
    };
    let (bridge, said) = bridge_with(options, registry, &stop);
    let hand = Hand::new(domain(17), &stop);
    let silent = Arc::new(AtomicBool::new(false));
    let is_silent = Arc::clone(&silent);
    let mount = TransformStamped {
        header: robot.header(0, "base_link"),
        child_frame_id: "laser".into(),
        transform: (&Isometry3::translation(0.0, 0.0, laser.height_m)).into(),
    };
    robot.fixed.publish(TFMessage { transforms: vec![mount] }).unwrap();
    let playing = thread::spawn(move || {
        robot.play_while(simulation, &|event| {
            if let Event::Shot(shot) = event
                && !is_silent.load(Ordering::Relaxed)
            {
                scans.publish(scan(&robot, &laser, shot)).unwrap();
            }
            true
        });
        robot
    });
    hand.let_go(&said);
    commands.wait_for_move("enabled");
    sleep(Duration::from_millis(500));

    silent.store(true, Ordering::Relaxed);
    wait_for(&said, "needs laser scans, which this frame does not have");
    // A control period and the transmission; the command itself would last for half a second.
    sleep(Duration::from_millis(40 + 100));
    let lacking = Instant::now();
    sleep(SCAN_AGE + Duration::from_millis(2500));
    assert!(!commands.moves_since(lacking), "no scans");
    let zeros = commands.so_far().iter().filter(|(at, _)| *at > lacking).count();
    assert!(zeros > 10, "{zeros}: silence is no stop");
    let (code, health) = http(&address, "GET", "healthz", "");
    assert!(code == 503 && health.contains("no frame for"), "{code} {health}");
    let statuses = told.so_far().into_iter().flat_map(|(_, array)| array.status);
    let mut warnings = statuses.filter(|status| status.level == 1).map(|status| status.message);
    assert!(warnings.any(|said| said == "the last frame has no laser scans: the robot stands"));

    silent.store(false, Ordering::Relaxed);
    commands.wait_for_move("scans are back");
    stop.store(true, Ordering::Relaxed);
    let summary = bridge.join().unwrap().unwrap();
    assert!(summary.counters["frames_without_required_input"] > 10, "{summary}");
    let warned =
        said.lock().unwrap().iter().filter(|line| line.ends_with("they are counted")).count();
    assert_eq!(warned, 1, "once");
    heard_all.store(true, Ordering::Relaxed);
    drop(playing.join().unwrap());
    std::fs::remove_file(config).unwrap();
}
