//! A robot that sees people with a 3-D lidar alone.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use nalgebra::Isometry3;
use tagalong::log::msgs::{Detection3DArray, PointCloud2, TFMessage, TransformStamped};
use tagalong_ros2::Options;
use tagalong_sim::{Event, Scene, Simulation, Variant};

use crate::peers::*;

/// Points become frames and tracks; the camera of the robot publishes nothing.
#[test]
#[ignore = "waits for messages for half a minute"]
fn points_of_a_lidar_become_tracks() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let with_lidar = Variant::default().with("duration_s", 12.0).with("lidar", "{}");
    let scene = include_str!("../../../../tests/scenes/small-room.toml");
    let scene = Scene::parse_with(scene, &with_lidar).unwrap();
    let mut simulation = Simulation::new(&scene, 1);
    let height_m = simulation.lidar().unwrap().height_m;
    let mut robot = Robot::new(domain(13), simulation.camera());
    let points = robot.peer.publisher::<PointCloud2<'_>>("/points", sensor());
    let tracks = robot.peer.collect::<Detection3DArray>("/people/tracks", &heard_all);
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/lidar.toml");
    let options = Options { config, ..options(domain(13), "20") };
    let (bridge, said) = bridge_with(options, tagalong::builtin_registry(), &stop);

    let mount = TransformStamped {
        header: robot.header(0, "base_link"),
        child_frame_id: "lidar".into(),
        transform: (&Isometry3::translation(0.0, 0.0, height_m)).into(),
    };
    robot.fixed.publish(TFMessage { transforms: vec![mount] }).unwrap();
    let start = Instant::now();
    while let Some(event) = simulation.next_event() {
        match event {
            Event::Odometry(reading) => {
                sleep((start + Duration::from_nanos(reading.at_ns)) - Instant::now());
                robot.odometry.publish(robot.odometry(&reading)).unwrap();
            }
            Event::Shot(shot) => {
                sleep((start + Duration::from_nanos(shot.captured_ns)) - Instant::now());
                let header = robot.header(shot.captured_ns, "lidar");
                let cloud = PointCloud2::of_points(header, shot.lidar.as_ref().unwrap());
                points.publish(cloud).unwrap();
            }
            Event::NoOdometry { .. } | Event::Sensor(_) | Event::Webcam(_) => {}
        }
    }
    sleep(Duration::from_millis(500));
    stop.store(true, Ordering::Relaxed);
    let summary = bridge.join().unwrap().unwrap();
    heard_all.store(true, Ordering::Relaxed);
    let tracks = tracks.finish();

    let said = said.lock().unwrap();
    assert!(said.iter().any(|line| line.starts_with("reads ") && line.contains("/points")));
    assert!(summary.frames > 20, "{summary}");
    assert_eq!(summary.traffic["/points"].malformed, 0, "{summary}");
    let mut seen = tracks.iter().filter(|(_, array)| array.detections.len() == 1);
    assert!(seen.clone().count() > 20, "a person in {} of {}", seen.count(), tracks.len());
    let (_, array) = seen.next_back().unwrap();
    let place = array.detections[0].bbox.center.position;
    // The person walks from 2.2 m to 2.8 m ahead.
    assert!((1.9..3.2).contains(&place.x) && place.y.abs() < 0.5, "{place:?}");
}
