//! Closed loop: images are rendered from the pose to which the controller has driven the robot.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing test may panic")]

use std::path::Path;
use std::sync::Arc;

use nalgebra::Isometry2;
use tagalong_core::{EgoMotion, Frame, Stamp, TrackId};
use tagalong_geometry::Camera;
use tagalong_pipeline::Pipeline;
use tagalong_sim::{Event, Scene, Shot, Simulation, Truth, Variant};

/// Returns a scene with a person that walks ahead and around a bend at 0.7 m/s.
fn scene() -> Scene {
    let walk = Variant::default()
        .with("duration_s", 11.0)
        .with("people.0.path", "[[3.0, 2.0], [6.0, 2.0], [9.0, 5.5]]")
        .with("people.0.speed_mps", 0.7)
        .with("people.0.start_s", 1.0);
    Scene::parse_with(include_str!("../scenes/small-room.toml"), &walk).unwrap()
}

/// Converts the recordings of a robot to the frames of a pipeline.
struct Recorder {
    camera: Arc<Camera>,
    odometry: Isometry2<f64>,
    last: Option<(u64, Isometry2<f64>)>,
    frames: u64,
}

impl Recorder {
    fn new(camera: &Camera) -> Self {
        let camera = Arc::new(camera.clone());
        Self { camera, odometry: Isometry2::identity(), last: None, frames: 0 }
    }

    fn frame(&mut self, shot: &Shot) -> Frame {
        let now = (shot.captured_ns, self.odometry);
        let (before_ns, before) = self.last.replace(now).unwrap_or(now);
        let dt = (shot.captured_ns - before_ns) as f64 * 1e-9;
        let motion = EgoMotion::between(&before, &self.odometry, dt, 0.02);
        self.frames += 1;
        let stamp = Stamp::from_nanos(1_000_000_000 + shot.captured_ns);
        Frame::new(self.frames, stamp, Arc::clone(&self.camera), motion, shot.images.clone())
    }
}

fn pipeline() -> Pipeline {
    let registry = tagalong_catalog::registry();
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let text = std::fs::read_to_string(configs.join("depth-ekf-follow.toml")).unwrap();
    Pipeline::builder(&registry).folder(&configs).from_toml(&text).unwrap()
}

/// One frame of the run.
struct Step {
    at_s: f64,
    target: Option<TrackId>,
    person: Truth,
    world_from_robot: Isometry2<f64>,
}

fn follow() -> Vec<Step> {
    let mut pipeline = pipeline();
    let mut simulation = Simulation::new(&scene(), 2);
    let mut recorder = Recorder::new(simulation.camera());
    let mut steps = Vec::new();
    while let Some(event) = simulation.next_event() {
        match event {
            Event::Odometry(reading) => recorder.odometry = reading.odom_from_robot,
            Event::NoOdometry { .. } | Event::Sensor(_) | Event::Webcam(_) => {}
            Event::Shot(shot) => {
                let report = pipeline.step(recorder.frame(&shot)).unwrap();
                simulation.steer(report.command.unwrap().wheels);
                steps.push(Step {
                    at_s: shot.captured_ns as f64 * 1e-9,
                    target: report.target,
                    person: shot.truth[0].clone(),
                    world_from_robot: shot.world_from_robot,
                });
            }
        }
    }
    steps
}

#[test]
fn the_robot_stays_with_a_person_who_walks() {
    let steps = follow();
    assert!(steps.len() > 100, "{} frames", steps.len());
    for Step { at_s, target, person, .. } in &steps {
        let head = person.head_in_robot;
        let range_m = head.x.hypot(head.y);
        let bearing = head.y.atan2(head.x).to_degrees();
        assert!((1.5..2.4).contains(&range_m), "{range_m} m away after {at_s} s");
        assert!(bearing.abs() < 15.0, "{bearing} degrees aside after {at_s} s");
        // In the first second the track is not confirmed yet.
        assert!(*at_s < 1.0 || *target == Some(TrackId(1)), "{target:?} after {at_s} s");
    }
    let way = steps[0].world_from_robot.inverse() * steps[steps.len() - 1].world_from_robot;
    assert!(way.translation.x > 4.0 && way.rotation.angle() > 0.5, "stands still: {way}");
}
