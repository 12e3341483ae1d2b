use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use nalgebra::{Isometry2, Isometry3};
use tagalong_core::{
    DepthImage, EgoMotion, Frame, Images, MAX_ODOMETRY_GAP_S, ObstacleData, ObstacleReading,
    ObstacleReadings, RangeReading, Stamp, WheelSpeeds, spatial_pose,
};
use tagalong_geometry::{Camera, Lens};
use tagalong_sim::{
    Event, OdometryReading, Scene, SensorData, SensorReading, Shot, Simulation, Truth,
};
use tagalong_vision::Unwrapping;

/// Standard deviation of odometry as a fraction of the travel; the default of
/// `[input] odometry_sigma` in the log reader.
pub const ODOMETRY_SIGMA: f64 = 0.02;
/// Number of frames by which an image may be late and still be sorted in, as in the log reader.
const REORDERED: usize = 3;
/// Time for which odometry is kept before the oldest waiting image, ns: longer than the delay of
/// any image.
const KEPT_NS: u64 = 1_000_000_000;
/// Number of readings of each further sensor that are kept, enough for a few seconds.
const KEPT_READINGS: usize = 256;

/// Input of a pipeline at one moment of a scene, with the truth at that moment.
pub struct SimulatedFrame {
    /// The frame.
    pub frame: Frame,
    /// All people.
    pub truth: Vec<Truth>,
    /// Pose of the robot in the odometry frame, according to the odometry, m and rad.
    pub odom_from_robot: Isometry2<f64>,
    /// True pose of the robot in the world, m and rad.
    pub world_from_robot: Isometry2<f64>,
}

/// Source of frames from a scene, equal to those of a recorded log.
pub struct Draw {
    simulation: Simulation,
    camera: Arc<Camera>,
    unwrapping: Unwrapping,
    odometry: BTreeMap<u64, Isometry2<f64>>,
    /// Waiting images by their stamps, ns.
    waiting: BTreeMap<u64, Shot>,
    patience: usize,
    previous: Option<(Stamp, Isometry2<f64>)>,
    calibration_changed: bool,
    /// Readings of the further sensors by name, the newest at the end.
    readings: BTreeMap<Arc<str>, VecDeque<SensorReading>>,
    index: u64,
}

/// Pose of the robot according to the odometry.
#[derive(Clone, Copy)]
struct KnownPose {
    odom_from_robot: Isometry2<f64>,
    /// Age of the odometry, s; infinite without odometry.
    age_s: f64,
}

impl Draw {
    /// Returns frames in the order of their stamps, as from a log; `threads` is the number of
    /// threads that render.
    pub fn new(scene: &Scene, threads: usize) -> Self {
        Self::with_patience(scene, threads, REORDERED)
    }

    /// Returns frames in the order in which they arrive, as on a robot, which may be steered
    /// between them.
    pub fn live(scene: &Scene, threads: usize) -> Self {
        Self::with_patience(scene, threads, 0)
    }

    fn with_patience(scene: &Scene, threads: usize, patience: usize) -> Self {
        let simulation = Simulation::new(scene, threads);
        Self {
            camera: Arc::new(seen_by(&simulation)),
            unwrapping: Unwrapping::default(),
            simulation,
            odometry: BTreeMap::new(),
            waiting: BTreeMap::new(),
            patience,
            previous: None,
            calibration_changed: false,
            readings: BTreeMap::new(),
            index: 0,
        }
    }

    /// Commands the wheels from now on; see [`Simulation::steer`].
    pub fn steer(&mut self, command: WheelSpeeds) {
        self.simulation.steer(command);
    }

    /// Returns the camera of all frames, as the pipelines know it.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns the running simulation.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Returns the next frame; `None` at the end of the scene.
    pub fn next_frame(&mut self) -> Option<SimulatedFrame> {
        self.next_frame_while(|_, _| None)
    }

    /// Returns the next frame, while a caller may steer until it arrives: `at_wheels` receives all
    /// events, and may command the wheels.
    pub fn next_frame_while(
        &mut self,
        mut at_wheels: impl FnMut(&Simulation, &Event) -> Option<WheelSpeeds>,
    ) -> Option<SimulatedFrame> {
        while self.waiting.len() <= self.patience {
            let event = self.simulation.next_event();
            if let Some(wheels) = event.as_ref().and_then(|e| at_wheels(&self.simulation, e)) {
                self.simulation.steer(wheels);
            }
            match event {
                Some(Event::Odometry(reading)) => self.hear(&reading),
                Some(Event::Shot(shot)) => drop(self.waiting.insert(shot.stamp_ns, *shot)),
                Some(Event::Sensor(reading)) => self.feel(reading),
                Some(Event::NoOdometry { .. } | Event::Webcam(_)) => {}
                None => break,
            }
        }
        let (_, shot) = self.waiting.pop_first()?;
        Some(self.simulated(shot))
    }

    /// Adds a pose, unless it is not finite, as log readers do.
    fn hear(&mut self, reading: &OdometryReading) {
        let pose = reading.odom_from_robot;
        if pose.translation.vector.iter().any(|metres| !metres.is_finite()) {
            return;
        }
        self.odometry.insert(reading.stamp_ns, pose);
        self.forget_odometry(self.simulation.robot_clock_ns(reading.at_ns));
    }

    /// Drops odometry that is older than any image to come, except for the newest such reading: at
    /// low frame rates the images that wait to be sorted are old themselves.
    fn forget_odometry(&mut self, now_ns: u64) {
        let oldest_ns = self.waiting.keys().next().map_or(now_ns, |waits| now_ns.min(*waits));
        let least_ns = oldest_ns.saturating_sub(KEPT_NS);
        // If the odometry is silent, the old reading is all that is known.
        let last_before = self.odometry.range(..least_ns).next_back().map(|(at_ns, _)| *at_ns);
        self.odometry = self.odometry.split_off(&last_before.unwrap_or(least_ns));
    }

    /// Adds a reading of a further sensor.
    fn feel(&mut self, reading: SensorReading) {
        let readings = self.readings.entry(Arc::clone(&reading.name)).or_default();
        readings.push_back(reading);
        if readings.len() > KEPT_READINGS {
            readings.pop_front();
        }
    }

    /// Returns the newest reading of each further sensor, in the robot frame at a given time;
    /// `None` without such sensors.
    fn obstacle_readings(&self, stamp_ns: u64, here: &Isometry2<f64>) -> Option<ObstacleReadings> {
        let is_live = self.patience == 0;
        let mut newest = Vec::new();
        for (name, readings) in &self.readings {
            // On a robot, a bumper that was pressed after a late image counts as well.
            let known = readings.iter().rev().find(|of| is_live || of.stamp_ns <= stamp_ns);
            let Some(reading) = known else { continue };
            let then = self.known_pose(reading.stamp_ns).odom_from_robot;
            newest.push(ObstacleReading::new(
                Arc::clone(name),
                Stamp::from_nanos(reading.stamp_ns),
                stamp_ns.saturating_sub(reading.stamp_ns) as f64 * 1e-9,
                moved_along(&reading.data, &spatial_pose(&(here.inverse() * then))),
            ));
        }
        (!newest.is_empty()).then(|| ObstacleReadings(newest.into()))
    }

    /// Returns the pose from the newest odometry that is not later than a stamp.
    fn known_pose(&self, stamp_ns: u64) -> KnownPose {
        let newest = self.odometry.range(..=stamp_ns).next_back();
        newest.map_or(
            KnownPose { odom_from_robot: Isometry2::identity(), age_s: f64::INFINITY },
            |(at_ns, pose)| KnownPose {
                odom_from_robot: *pose,
                age_s: (stamp_ns - at_ns) as f64 * 1e-9,
            },
        )
    }

    fn simulated(&mut self, shot: Shot) -> SimulatedFrame {
        self.index += 1;
        let stamp = Stamp::from_nanos(shot.stamp_ns);
        // The odometry publishes at every step of the simulation, including this one.
        let pose = self.known_pose(shot.stamp_ns);
        let motion = self.motion(stamp, pose);
        let camera = Arc::clone(&self.camera);
        let scan = self.simulation.laser().zip(shot.laser.as_deref());
        let laser = scan.map(|(laser, ranges)| laser.scan(ranges).with_stamp(stamp));
        // As in log readers, the first calibration is used throughout, and a change is never taken
        // back.
        self.calibration_changed |= *shot.camera != *self.simulation.camera();
        let readings = self.obstacle_readings(shot.stamp_ns, &pose.odom_from_robot);
        let mut frame = Frame::new(self.index, stamp, camera, motion, self.as_logged(shot.images))
            .with_laser(laser)
            .with_changed_calibration(self.calibration_changed)
            .with_odometry_age(pose.age_s)
            .with_latency(self.latency_s(shot.stamp_ns, shot.arrived_ns));
        if let Some(readings) = readings {
            frame = frame.with_sensor(readings);
        }
        if let Some((lidar, points)) = self.simulation.lidar().zip(shot.lidar.as_deref()) {
            frame = frame.with_sensor(lidar.cloud(points));
        }
        SimulatedFrame {
            frame,
            truth: shot.truth,
            odom_from_robot: pose.odom_from_robot,
            world_from_robot: shot.world_from_robot,
        }
    }

    /// Returns the time from the stamp of an image to its arrival on a robot, s; a log has none.
    fn latency_s(&self, stamp_ns: u64, arrived_ns: u64) -> Option<f64> {
        let is_live = self.patience == 0;
        is_live.then_some((arrived_ns as f64 - stamp_ns as f64) * 1e-9)
    }

    /// Converts images as a log does: depth is stored in millimetres, and circular images are
    /// unwrapped. The panorama of a simulation fits its images, so the unwrapping cannot fail.
    fn as_logged(&mut self, images: Images) -> Images {
        if let Some(panorama) = self.camera.panorama() {
            return self.unwrapping.apply(panorama, &images).unwrap_or(images);
        }
        // Recorded depth is in whole millimetres.
        fn round(depth: Arc<DepthImage>) -> Arc<DepthImage> {
            Arc::new(depth.map(|z| (1000.0 * z).round() * 0.001))
        }
        Images { depth: images.depth.map(round), ..images }
    }

    /// Returns the motion since the previous frame; none for a frame that is older than that one.
    fn motion(&mut self, stamp: Stamp, here: KnownPose) -> EgoMotion {
        // An image that is older than the last one has no motion since then.
        let before = self.previous.filter(|(then, _)| *then < stamp);
        if before.is_some() || self.previous.is_none() {
            self.previous = Some((stamp, here.odom_from_robot));
        }
        let Some((then, pose)) = before else { return EgoMotion::at_rest(0.0) };
        let dt = stamp.seconds_since(then);
        if here.age_s > MAX_ODOMETRY_GAP_S {
            return EgoMotion::unknown(dt);
        }
        EgoMotion::between(&pose, &here.odom_from_robot, dt, ODOMETRY_SIGMA)
    }
}

/// Returns the data of a further sensor, transformed to the robot frame of another moment.
fn moved_along(data: &SensorData, now_from_then: &Isometry3<f64>) -> ObstacleData {
    match data {
        SensorData::Scan { scanner, ranges } => {
            let mount = now_from_then * scanner.robot_from_scanner();
            ObstacleData::Scan(scanner.scan(mount, ranges))
        }
        SensorData::Range { reading, .. } => ObstacleData::Range(RangeReading {
            robot_from_sensor: now_from_then * reading.robot_from_sensor,
            ..*reading
        }),
        SensorData::Bumper(is_pressed) => ObstacleData::Bumper(*is_pressed),
    }
}

/// Returns the camera of the frames: that of the log, with the circular image of a mirror
/// unwrapped.
fn seen_by(simulation: &Simulation) -> Camera {
    let camera = simulation.camera().clone();
    match simulation.panorama() {
        Some(panorama) => Camera {
            lens: Lens::Panorama(*panorama),
            width: panorama.columns,
            height: panorama.rows,
            ..camera
        },
        None => camera,
    }
}

#[cfg(test)]
mod tests {
    use tagalong_core::LaserScan;
    use tagalong_sim::{FaultKind, FaultSettings, InjectedFault, LaserSettings, Variant};

    use super::*;

    const SCENE: &str = "seed = 3\nduration_s = 4.0\n[camera]\nwidth = 32\nheight = 24\n\
        rate_hz = 20.0\n[robot]\npath = [[6.0, 4.0]]\n[faults]\nlate = 0.4\ndropped = 0.2\n\
        [[people]]\npath = [[4.0, 3.0], [4.0, 1.0]]\n";

    fn simulated(mut draw: Draw) -> Vec<SimulatedFrame> {
        std::iter::from_fn(|| draw.next_frame()).collect()
    }

    fn stamps(all: &[SimulatedFrame]) -> Vec<u64> {
        all.iter().map(|simulated| simulated.frame.stamp.nanos() / 1_000_000).collect()
    }

    fn scene() -> Scene {
        Scene::parse(SCENE).unwrap()
    }

    #[test]
    fn late_frames_are_in_order_in_a_log_and_not_on_a_robot() {
        fn sorted(all: &[SimulatedFrame]) -> bool {
            all.windows(2).all(|p| p[0].frame.stamp < p[1].frame.stamp)
        }

        let log = simulated(Draw::new(&scene(), 1));
        let live = simulated(Draw::live(&scene(), 1));
        assert!(sorted(&log), "{:?}", stamps(&log));
        assert!(!sorted(&live), "{:?}", stamps(&live));
        assert!(log.len() == live.len() && log.len() < 80);
    }

    #[test]
    fn images_that_wait_for_longer_than_odometry_is_kept_have_their_motion() {
        let slow = Scene::parse(&SCENE.replace("rate_hz = 20.0", "rate_hz = 2.0")).unwrap();
        let (driven, jumped) = simulated(Draw::new(&slow, 1)).iter().fold((0.0, 0.0), |sums, d| {
            let step: f64 = d.frame.motion.forward.hypot(d.frame.motion.left);
            (sums.0 + step, step.max(sums.1))
        });
        assert!(driven > 0.3 && jumped < 0.6, "{driven} {jumped}");
    }

    #[test]
    fn motions_add_up_to_the_odometry() {
        for draw in [Draw::new(&scene(), 1), Draw::live(&scene(), 1)] {
            let all = simulated(draw);
            let sum =
                all.iter().fold(all[0].odom_from_robot, |pose, d| pose * d.frame.motion.isometry());
            let last = all.iter().max_by_key(|d| d.frame.stamp).unwrap();
            assert!(
                (sum.translation.vector - last.odom_from_robot.translation.vector).norm() < 1e-9
            );
            assert!(sum.translation.vector.norm() > 0.3, "{sum}");
        }
    }

    #[test]
    fn a_steered_robot_goes_where_it_is_told() {
        let mut draw = Draw::live(&scene(), 1);
        let mut last = Isometry2::identity();
        while let Some(simulated) = draw.next_frame() {
            last = simulated.world_from_robot;
            draw.steer(WheelSpeeds { left: -0.2, right: -0.2 });
        }
        assert!(last.translation.x < 0.85, "{last}");
    }

    /// Frames on a robot, all of them in time, with a fault from 1 s to 3 s.
    fn broken(kind: FaultKind) -> Vec<SimulatedFrame> {
        let mut scene = scene();
        scene.faults = FaultSettings {
            dropped: 0.0,
            late: 0.0,
            inject: vec![InjectedFault::new(kind).at(1.0).lasting(2.0)],
        };
        simulated(Draw::live(&scene, 1))
    }

    fn at_s(simulated: &SimulatedFrame) -> f64 {
        simulated.frame.stamp.nanos() as f64 * 1e-9
    }

    fn moved_m(simulated: &SimulatedFrame) -> f64 {
        simulated.frame.motion.forward.hypot(simulated.frame.motion.left)
    }

    #[test]
    fn odometry_that_says_nothing_grows_old_and_the_motion_is_unknown() {
        for kind in
            [FaultKind::OdometrySilent, FaultKind::NanOdometry, FaultKind::OdometryLateStamps]
        {
            let all = broken(kind);
            assert_eq!(all.len(), 80);
            for one in &all {
                let since_s = at_s(one) - 0.98;
                let age_s = if (1.0..3.0).contains(&at_s(one)) { since_s } else { 0.0 };
                let frame = &one.frame;
                assert!((frame.odometry_age_s - age_s).abs() < 1e-6, "{kind} {}", at_s(one));
                let motion = &frame.motion;
                assert!([motion.forward, motion.left, motion.turn].iter().all(|m| m.is_finite()));
                if age_s > 0.0 {
                    assert!(moved_m(one) < 0.02, "{kind} {}", at_s(one));
                }
                if age_s > MAX_ODOMETRY_GAP_S {
                    assert!(motion.covariance[(0, 0)] > 1e-3, "anything may have happened");
                }
            }
        }
        let mut scene = scene();
        scene.faults.inject.push(InjectedFault::new(FaultKind::OdometrySilent).at(0.0));
        let first = Draw::live(&scene, 1).next_frame().unwrap();
        assert_eq!(first.frame.odometry_age_s, f64::INFINITY);
    }

    #[test]
    fn a_scan_has_the_stamp_of_its_frame_also_one_that_repeats_itself() {
        let mut scene = scene();
        scene.laser = Some(LaserSettings::default());
        let freeze = InjectedFault::new(FaultKind::FreezeLaser).at(1.0).lasting(2.0);
        scene.faults = FaultSettings { dropped: 0.0, late: 0.0, inject: vec![freeze] };
        let mut repeated = 0;
        let mut before: Option<LaserScan> = None;
        for one in simulated(Draw::live(&scene, 1)) {
            let scan = one.frame.laser().unwrap().clone();
            assert_eq!(scan.stamp, Some(one.frame.stamp), "{}", at_s(&one));
            repeated += usize::from(before.is_some_and(|before| before.points == scan.points));
            before = Some(scan);
        }
        assert!((35..=41).contains(&repeated), "two seconds of frames: {repeated}");
    }

    #[test]
    fn frozen_odometry_is_new_and_stands_still() {
        fn inside(one: &&SimulatedFrame) -> bool {
            (1.1..3.0).contains(&at_s(one))
        }

        let all = broken(FaultKind::OdometryFrozen);
        assert!(all.iter().all(|one| one.frame.odometry_age_s == 0.0));
        assert!(all.iter().filter(inside).all(|one| moved_m(one) == 0.0));
        let places = all.iter().filter(inside).map(|one| one.world_from_robot.translation.x);
        let first = places.clone().next().unwrap();
        assert!(places.last().unwrap() - first > 0.3, "the robot drives on");
        assert!(
            all.iter()
                .filter(|one| (0.5..1.0).contains(&at_s(one)) || at_s(one) >= 3.0)
                .all(|one| moved_m(one) > 0.0)
        );
    }

    #[test]
    fn the_latency_is_that_from_the_stamp_to_the_arrival() {
        for one in broken(FaultKind::Delay) {
            let late_s = if (1.0..3.0).contains(&at_s(&one)) { 1.5 } else { 0.0 };
            assert!((one.frame.latency_s.unwrap() - late_s).abs() < 1e-9, "{}", at_s(&one));
        }
        // Both of stamp and arrival are times of the clock that jumps.
        for one in broken(FaultKind::ClockForward) {
            assert!(one.frame.latency_s.unwrap().abs() < 1e-9, "{}", at_s(&one));
        }
        let late = simulated(Draw::live(&scene(), 1));
        assert!(late.iter().any(|one| one.frame.latency_s.unwrap() > 0.04));
        let log = simulated(Draw::new(&scene(), 1));
        assert!(log.iter().all(|one| one.frame.latency_s.is_none()), "a log has no such clock");
    }

    #[test]
    fn a_calibration_that_changed_stays_changed() {
        for kind in [FaultKind::CalibrationChanged, FaultKind::MountMoved] {
            for one in broken(kind) {
                assert_eq!(one.frame.calibration_changed, at_s(&one) >= 1.0, "{kind}");
            }
        }
        assert!(broken(FaultKind::MountKnocked).iter().all(|one| !one.frame.calibration_changed));
    }

    #[test]
    fn broken_images_are_those_of_the_frames() {
        for one in broken(FaultKind::BlankDepth) {
            let is_blank = one.frame.depth().unwrap().pixels().iter().all(|z| z.is_nan());
            assert_eq!(is_blank, (1.0..3.0).contains(&at_s(&one)));
        }
        let resent = broken(FaultKind::Resend);
        // The image before the fault, and the forty that it takes the place of.
        assert_eq!(resent.iter().filter(|one| (0.9..1.0).contains(&at_s(one))).count(), 42);
        let stamps: Vec<f64> = resent.iter().map(at_s).collect();
        assert!(stamps[20..60].iter().all(|stamp_s| *stamp_s == stamps[19]), "{stamps:?}");
        assert!(broken(FaultKind::Drop).len() == 40);
    }

    /// Readings of one source in each frame, with their ages.
    fn readings_of(all: &[SimulatedFrame], name: &str) -> Vec<(f64, ObstacleData)> {
        all.iter()
            .filter_map(|one| {
                let readings = one.frame.sensor::<ObstacleReadings>().ok()?.clone();
                let reading = readings.0.iter().find(|reading| &*reading.source == name)?.clone();
                Some((reading.age_s, reading.data))
            })
            .collect()
    }

    #[test]
    fn further_sensors_are_in_the_frames_by_their_names() {
        let sensors = "[[ranges]]\nname = \"sonar\"\nrate_hz = 4.0\nsigma_m = 0.0\n\
            [[bumpers]]\nname = \"bumper\"\n[[lasers]]\nname = \"rear\"\n\
            mount = [-0.2, 0.0, 0.3, 180.0]\nrays = 91\nfield_of_view_deg = 90.0\n";
        let text = format!("{SCENE}{sensors}");
        for draw in [Draw::live, Draw::new] {
            let all = simulated(draw(&Scene::parse(&text).unwrap(), 1));
            let sonar = readings_of(&all, "sonar");
            assert_eq!(sonar.len(), all.len());
            assert!(sonar.iter().all(|(age_s, _)| (0.0..0.27).contains(age_s)));
            assert!(sonar.iter().any(|(age_s, _)| *age_s > 0.1));
            for (age_s, data) in &sonar {
                let ObstacleData::Range(reading) = data else { panic!("{data:?}") };
                assert_eq!(reading.max_m, 4.0);
                // The robot has driven on since an old reading, and was not there yet at a late frame.
                let x = reading.robot_from_sensor.translation.x;
                let late_s = if *age_s > 0.0 { 0.0 } else { 0.15 };
                assert!(x < 0.201 + 0.6 * late_s && x > 0.199 - 0.6 * age_s, "{x} {age_s}");
            }
            assert!(matches!(readings_of(&all, "bumper")[9].1, ObstacleData::Bumper(false)));
            let ObstacleData::Scan(scan) = &readings_of(&all, "rear")[0].1 else { panic!() };
            assert!(scan.points.len() > 80 && scan.points.iter().all(|point| point.x < -0.2));
        }
        let none = simulated(Draw::live(&scene(), 1));
        assert!(none.iter().all(|one| one.frame.sensor::<ObstacleReadings>().is_err()));
    }

    #[test]
    fn a_further_sensor_that_falls_silent_grows_old() {
        let mut scene = Scene::parse(&format!("{SCENE}[[bumpers]]\nname = \"bumper\"\n")).unwrap();
        scene.faults.inject.push(InjectedFault::new(FaultKind::DropSensors).at(1.0));
        let all = simulated(Draw::live(&scene, 1));
        let ages: Vec<f64> = readings_of(&all, "bumper").iter().map(|reading| reading.0).collect();
        assert_eq!(ages.len(), all.len());
        assert!(ages.iter().fold(0.0, |most: f64, age_s| most.max(*age_s)) > 2.9);
    }

    /// Frames of a robot that drives straight ahead in the scene of the glass wall, each with the room
    /// to things and the nearest range of its sonars, m.
    fn driven_at_glass(seed: u64, heading_deg: f64) -> Vec<(f64, f64)> {
        let text = include_str!("../configs/scenes/behind-glass-sonar.toml");
        let variant = Variant::of_seed(seed)
            .with("camera.width", 16)
            .with("camera.height", 12)
            .with("robot.heading_deg", format!("{heading_deg:?}"));
        let mut draw = Draw::live(&Scene::parse_with(text, &variant).unwrap(), 1);
        let mut frames = Vec::new();
        while let Some(one) = draw.next_frame() {
            draw.steer(WheelSpeeds { left: 0.4, right: 0.4 });
            let readings = one.frame.sensor::<ObstacleReadings>().unwrap();
            let nearest_m = readings
                .0
                .iter()
                .map(|reading| match reading.data {
                    ObstacleData::Range(reading) => reading.range_m,
                    _ => f64::INFINITY,
                })
                .fold(f64::INFINITY, f64::min);
            frames.push((draw.simulation().clearance(0.25).things_m, nearest_m));
        }
        frames
    }

    #[test]
    fn forward_sonars_see_the_pane_before_the_robot_touches_it() {
        for (seed, heading_deg) in [(1, 0.0), (2, 8.0), (3, -8.0), (4, 0.0)] {
            let frames = driven_at_glass(seed, heading_deg);
            let contact = frames.iter().position(|frame| frame.0 < 0.0).unwrap();
            let near = frames[..contact].iter().filter(|frame| frame.0 < 0.7);
            let seen = near.clone().filter(|frame| frame.1 < frame.0 + 0.3).count();
            assert!(
                seen >= 8 && seen == near.count(),
                "{seed}: {:?}",
                &frames[contact - 20..contact]
            );
        }
    }
}
