//! A running scene: the events that a robot would record, in the order of recording.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{
    Isometry2, Isometry3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3,
};
use tagalong_core::{Images, RgbImage, RightImage, WheelSpeeds};
use tagalong_geometry::{Camera, Panorama, Pinhole, Rect};

use crate::approach::Approacher;
use crate::behaviour::Walker;
use crate::body::Skeleton;
use crate::camera_settings::CameraKind;
use crate::crowd::Blocks;
use crate::faults::ScheduledFault;
use crate::furniture::{Furniture, FurnitureKind};
use crate::hits::HitImage;
use crate::laser::LaserSettings;
use crate::lidar::LidarSettings;
use crate::mirror::MirrorCamera;
use crate::obstacle::Obstacle;
use crate::obstacle_sensors::SensorReading;
use crate::posture::Posture;
use crate::random::Random;
use crate::render::{Visibility, WorldCamera};
use crate::robot::{Encoder, Robot};
use crate::room;
use crate::scene::Scene;
use crate::sensor::{DepthSensor, Exposure, Moment};
use crate::shape::Shape;
use crate::webcam::Webcam;
use crate::world::{Object, Stage, World};

mod crowd;
mod in_sight;
mod injector;
mod joints;
mod nearness;
mod sensing;
mod sight;
mod walkers;

pub use in_sight::CrowdView;
use injector::Injector;
pub use joints::Joint;
use joints::{Spot, joints};
use sensing::Sensing;
use sight::sight;
use walkers::{approaching_person, walkers};

/// Time step of people, robot and odometry, ns.
const STEP_NS: u64 = 20_000_000;
/// Minimum distance of people from the middle of the robot, m.
const ROBOT_M: f64 = 0.5;
/// Distance by which people expect the robot to move on, m.
const GOES_M: f64 = 0.6;
/// Number of directions of rays that measure the distance to objects around the robot, and their
/// heights, m.
const FEELERS: usize = 48;
const FEELERS_M: [f64; 4] = [0.15, 0.45, 0.8, 1.2];
/// Half the distance between the points on which the robot stands, m: it tilts gradually at the
/// ends of a ramp.
const STANDS_ON_M: f64 = 0.15;
/// Half the width of a person, m.
const BODY_M: f64 = 0.2;
/// Minimum number of points of an approacher that must be in view of a camera for it to count as
/// seen.
const LEAST_SPOTS: usize = 2;
/// Visible fraction below which no detector can be expected to find a person.
const LEAST_VISIBLE: f64 = 0.2;

/// Recorded event.
#[derive(Clone, Debug)]
pub enum Event {
    /// The odometry.
    Odometry(OdometryReading),
    /// The odometry is silent at a time when it would have published; a step of the simulation
    /// nevertheless.
    NoOdometry {
        /// Time since the start, ns.
        at_ns: u64,
    },
    /// An image, or a pair of them, with the truth.
    Shot(Box<Shot>),
    /// A reading of a further obstacle sensor.
    Sensor(SensorReading),
    /// An image of a camera in the room.
    Webcam(WebcamShot),
}

impl Event {
    /// Returns the time of a step of the simulation, since the start, ns; `None` for other events.
    pub fn step_ns(&self) -> Option<u64> {
        match self {
            Self::Odometry(reading) => Some(reading.at_ns),
            Self::NoOdometry { at_ns } => Some(*at_ns),
            Self::Shot(_) | Self::Sensor(_) | Self::Webcam(_) => None,
        }
    }
}

/// Images of a camera in the room; they are never lost or late.
#[derive(Clone, Debug)]
pub struct WebcamShot {
    /// Index of the camera, from 0 in the order of the scene.
    pub webcam: usize,
    /// Time since the start, ns.
    pub captured_ns: u64,
    /// The image.
    pub image: Arc<RgbImage>,
}

/// Pose and speed as the odometry measures them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryReading {
    /// Time since the start, ns.
    pub at_ns: u64,
    /// Time in the stamp of the message, ns; it differs if a clock is wrong.
    pub stamp_ns: u64,
    /// Pose of the robot in the odometry frame, m and rad.
    pub odom_from_robot: Isometry2<f64>,
    /// Forward speed, m/s.
    pub speed_mps: f64,
    /// Turn rate about the vertical, rad/s.
    pub turn_rate: f64,
    /// Encoders of the left and the right wheel.
    pub encoders: [Encoder; 2],
    /// Forward speed of the last command, m/s.
    pub commanded_mps: f64,
    /// Turn rate of the last command, rad/s.
    pub commanded_turn_rate: f64,
}

/// Images of the camera, and the truth at that time.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Time since the start, ns.
    pub captured_ns: u64,
    /// Time in the stamp of the message, ns; it differs if the robot's clock is wrong.
    pub stamp_ns: u64,
    /// Time at which it arrives and is written to the log, ns; not before it was captured.
    pub recorded_ns: u64,
    /// Time of arrival by the robot's clock, ns.
    pub arrived_ns: u64,
    /// Stamp of the depth image, ns: later by the offset of the camera.
    pub depth_ns: u64,
    /// The camera as the robot describes it at this time.
    pub camera: Arc<Camera>,
    /// Colour and depth, the grey images of a stereo pair, or the circular image
    /// of a mirror.
    pub images: Images,
    /// Ranges of the rays of a laser scanner, m, in the order of [`LaserSettings::directions`];
    /// `None` without a scanner.
    pub laser: Option<Vec<f32>>,
    /// Points of a 3-D lidar in its own frame, x forward and z up, m; `None` without a lidar.
    pub lidar: Option<Vec<[f32; 3]>>,
    /// All people.
    pub truth: Vec<Truth>,
    /// Pose of the robot in the world, m and rad.
    pub world_from_robot: Isometry2<f64>,
}

/// True position of one person.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// ID of the person, from 1.
    pub id: u16,
    /// Centre of the head in the robot frame, m.
    pub head_in_robot: Point3<f64>,
    /// Middle of the trunk in the robot frame, m.
    pub torso_in_robot: Point3<f64>,
    /// The upper-body square clipped to the image; `None` outside. For a panorama camera it is in
    /// the unwrapped image, where it may continue beyond the right edge (see [`Panorama`]).
    pub upper_body: Option<Rect>,
    /// The visible part, likewise.
    pub visible: Option<Rect>,
    /// Visible fraction of the upper body.
    pub visible_fraction: f64,
    /// Person that hides most of the rest.
    pub occluder: Option<u16>,
    /// True if the person is hardly visible: neither a miss nor a false positive.
    pub ignore: bool,
    /// Shoulders, elbows, wrists, hips, knees and ankles; empty if they are not known.
    pub joints: Vec<Joint>,
}

/// Free distance around a robot, m; negative means contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Distance to the nearest person; infinite if there is none.
    pub people_m: f64,
    /// Distance to the nearest piece of furniture or wall.
    pub things_m: f64,
}

/// A running scene. The same scene gives the same events, whatever the number of threads.
pub struct Simulation {
    scene: Scene,
    camera: Arc<Camera>,
    /// The camera with its true mount at the start ...
    first_camera: Camera,
    /// ... and at present.
    true_camera: Camera,
    injector: Injector,
    /// The mirror above the camera, if it is a panorama camera.
    mirror: Option<MirrorCamera>,
    sensing: Sensing,
    webcams: Vec<Webcam>,
    stage: Arc<Stage>,
    pieces: Vec<Furniture>,
    obstacles: Vec<Obstacle>,
    blocks: Blocks,
    walkers: Vec<Walker>,
    /// The last of the walkers, or a trolley.
    approacher: Option<Approacher>,
    robot: Robot,
    exposures: [Exposure; 2],
    /// Images of lenses that are reused, because allocating memory costs as much as part of the
    /// rendering.
    canvases: Vec<HitImage>,
    chance: Random,
    now_ns: u64,
    shots: u64,
    waiting: BTreeMap<(u64, u64), Event>,
    counter: u64,
    threads: usize,
}

impl Simulation {
    /// Starts a scene. `threads` is the number of threads that render images.
    pub fn new(scene: &Scene, threads: usize) -> Self {
        // Each purpose has its own stream, so that one more chair does not change the gait of the
        // people.
        let mut pieces = scene.furniture.clone();
        pieces.extend(room::clutter(scene, &mut Random::new(scene.seed, 1)));
        pieces.extend(chairs(scene));
        let obstacles: Vec<Obstacle> = pieces.iter().flat_map(room::obstacles).collect();
        let mut fixed = vec![room::room(&scene.room)];
        let mut lamps = room::lamps(&scene.room, &scene.light);
        if let Some(day) = &scene.light.day {
            fixed.push(day.windows(&scene.room));
            lamps.extend(day.sun(&scene.room));
        }
        let ceiling_m = scene.room.height_m;
        let mut chance = Random::new(scene.seed, 8);
        fixed.extend(pieces.iter().map(|piece| {
            let floor_m = scene.room.floor_m(&piece.at.into());
            room::furniture(piece, ceiling_m - floor_m, &mut chance).raised(floor_m)
        }));
        fixed.extend(scene.blocks.iter().map(|block| block.solid(ceiling_m)));
        let mirror = (scene.camera.kind == CameraKind::Panorama)
            .then(|| MirrorCamera::new(&scene.camera, &mut Random::new(scene.seed, 6)));
        let camera = mirror
            .as_ref()
            .map_or_else(|| camera(scene), |mirror| mirror.camera(scene.camera.height_m));
        let mut walkers = walkers(scene, &obstacles, &mut Random::new(scene.seed, 3));
        walkers.extend(approaching_person(scene, &mut Random::new(scene.seed, 9)));
        let mut error = Random::new(scene.seed, 2);
        let true_camera = shaken(&camera, scene.camera.mount_error_deg, &mut error);
        Self {
            first_camera: true_camera.clone(),
            true_camera,
            camera: Arc::new(camera),
            injector: Injector::new(scene.scheduled_faults(), scene.seed),
            mirror,
            sensing: Sensing::new(scene),
            webcams: scene.webcams.iter().map(|webcam| Webcam::new(webcam, threads)).collect(),
            stage: Arc::new(Stage::new(fixed, lamps, scene.light.lux * scene.light.ambient)),
            walkers,
            approacher: scene.approach.as_ref().map(Approacher::new),
            pieces,
            obstacles,
            blocks: crowd::blocks(scene),
            robot: Robot::new(&scene.robot, Random::new(scene.seed, 4)),
            exposures: [Exposure::new(threads); 2],
            canvases: Vec::new(),
            chance: Random::new(scene.seed, 5),
            now_ns: 0,
            shots: 0,
            waiting: BTreeMap::new(),
            counter: 0,
            threads,
            scene: scene.clone(),
        }
    }

    /// Returns the camera as the log describes it; for a panorama camera the lens that looks up
    /// into the mirror.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns the mirror of a panorama camera as the log describes it, and the unwrapped image in
    /// which the truth gives regions.
    pub fn panorama(&self) -> Option<&Panorama> {
        self.mirror.as_ref().map(|mirror| &mirror.panorama)
    }

    /// Returns the 3-D lidar, if the robot has one.
    pub fn lidar(&self) -> Option<&LidarSettings> {
        self.scene.lidar.as_ref()
    }

    /// Returns the laser scanner, if the robot has one.
    pub fn laser(&self) -> Option<&LaserSettings> {
        self.scene.laser.as_ref()
    }

    /// Returns the cameras in the room; their `robot_from_camera` is their pose in the **world**.
    pub fn webcams(&self) -> impl Iterator<Item = &Camera> {
        self.webcams.iter().map(Webcam::camera)
    }

    /// Returns the furniture, including the random clutter; positions are in the world.
    pub fn furniture(&self) -> &[Furniture] {
        &self.pieces
    }

    /// Commands the wheels from now on: this closes the loop, and the path of the scene for the
    /// robot is ignored.
    pub fn steer(&mut self, command: WheelSpeeds) {
        self.robot.steer(self.now_ns as f64 * 1e-9, command);
    }

    /// Returns the injected faults.
    pub fn faults(&self) -> &[ScheduledFault] {
        self.injector.faults()
    }

    /// Returns the time on the robot's clock, which faults may change, at a time since the start,
    /// ns.
    pub fn robot_clock_ns(&self, at_ns: u64) -> u64 {
        self.injector.robot_clock_ns(at_ns)
    }

    /// Returns the next event that the robot records; `None` at the end of the scene.
    pub fn next_event(&mut self) -> Option<Event> {
        let end_ns = (self.scene.duration_s * 1e9) as u64;
        loop {
            // Late images wait until the time at which the log receives them.
            let due = self.waiting.first_key_value().is_some_and(|(key, _)| key.0 <= self.now_ns);
            if due || self.now_ns >= end_ns {
                return self.waiting.pop_first().map(|(_, event)| event);
            }
            self.step();
        }
    }

    fn step(&mut self) {
        let due_ns = (self.shots as f64 * 1e9 / self.scene.camera.rate_hz) as u64;
        let (now_s, dt) = (self.now_ns as f64 * 1e-9, STEP_NS as f64 * 1e-9);
        let leader = self.walkers.first().map(|walker| walker.stance.place);
        // The order within a step matters: a robot reads its wheels before the camera of the same
        // time.
        self.robot.set_faults(self.injector.wheels(self.now_ns));
        self.robot.decide(now_s, leader);
        self.appear(now_s);
        let reading = self.read_odometry();
        let heard = self.injector.hear(reading);
        self.record(self.now_ns, heard);
        // Before the camera, so that a frame has the readings of its own time.
        self.sense();
        if self.now_ns >= due_ns {
            self.shots += 1;
            self.shoot();
        }
        self.shoot_webcams();
        self.robot.step(now_s, dt);
        self.walk(now_s, dt);
        self.now_ns += STEP_NS;
    }

    fn record(&mut self, at_ns: u64, event: Event) {
        self.waiting.insert((at_ns, self.counter), event);
        self.counter += 1;
    }

    fn read_odometry(&self) -> OdometryReading {
        let (speed_mps, turn_rate) = self.robot.measured();
        let (commanded_mps, commanded_turn_rate) = self.robot.commanded();
        OdometryReading {
            at_ns: self.now_ns,
            stamp_ns: self.now_ns,
            odom_from_robot: self.robot.odometry,
            speed_mps,
            turn_rate,
            encoders: self.robot.encoders(),
            commanded_mps,
            commanded_turn_rate,
        }
    }

    fn shoot(&mut self) {
        let faults = &self.scene.faults;
        // Drawn for every image, so that a change of one fault does not change the others.
        let (dropped, late) = (self.chance.chance(faults.dropped), self.chance.chance(faults.late));
        let delay_ns = (self.chance.between(0.05, 0.15) * 1e9) as u64;
        if dropped || self.injector.drops(self.now_ns) {
            return;
        }
        self.true_camera = self.injector.mounted(&self.first_camera, self.now_ns);
        let recorded_ns = self.now_ns + if late { delay_ns } else { 0 };
        let taken = self.shot(recorded_ns);
        let shot = self.injector.deliver(taken);
        self.record(shot.recorded_ns, Event::Shot(Box::new(shot)));
    }

    fn shoot_webcams(&mut self) {
        let now_ns = self.now_ns;
        let due: Vec<usize> =
            (0..self.webcams.len()).filter(|i| self.webcams[*i].due(now_ns)).collect();
        if due.is_empty() {
            return;
        }
        let (world, _) = self.world();
        for webcam in due {
            // The seeds of webcams must differ from those of the robot's images, so that their
            // noise differs.
            let seed = self.scene.seed.rotate_left(20) ^ ((webcam as u64 + 1) << 40);
            let image = Arc::new(self.webcams[webcam].shoot(&world, seed));
            self.record(now_ns, Event::Webcam(WebcamShot { webcam, captured_ns: now_ns, image }));
        }
    }

    fn shot(&mut self, recorded_ns: u64) -> Shot {
        let (world, uppers) = self.world();
        // The middle of the exposure, because truth and scan are those of the middle row.
        let pose = self.world_from_robot(0.5);
        let (seen, truth) = match &self.mirror {
            Some(mirror) => self.in_mirror(mirror, &world, &uppers, &pose),
            None => {
                let canvas = self.canvas();
                self.in_lens(canvas, &world, &uppers, &pose)
            }
        };
        let images = match self.scene.camera.kind {
            CameraKind::Rgbd => self.rgbd(&seen),
            CameraKind::Stereo => self.stereo(&world, &seen),
            CameraKind::Panorama => self.circle(&seen),
        };
        if self.mirror.is_none() {
            self.canvases.push(seen);
        }
        let laser =
            self.laser().map(|laser| laser.measure(&world, &pose, self.moment(0, 1.0).seed));
        let lidar = self
            .lidar()
            .map(|lidar| lidar.measure(&world, &pose, self.shots, self.moment(0, 1.0).seed));
        let (captured_ns, world_from_robot) = (self.now_ns, self.robot.pose);
        Shot {
            captured_ns,
            stamp_ns: captured_ns,
            recorded_ns,
            arrived_ns: recorded_ns,
            depth_ns: captured_ns + (self.scene.camera.depth_offset_s * 1e9) as u64,
            camera: self.injector.described(&self.camera, captured_ns),
            images,
            laser,
            lidar,
            truth,
            world_from_robot,
        }
    }

    /// Yields the people in the room, with their IDs.
    fn present(&self) -> impl Iterator<Item = (&Walker, u16)> {
        let now_s = self.now_ns as f64 * 1e-9;
        self.walkers.iter().zip(1..).filter(move |(walker, _)| walker.is_there(now_s))
    }

    /// Returns the world at present, and the number of upper-body solids of each person.
    fn world(&self) -> (World, Vec<usize>) {
        let mut people = Vec::new();
        let mut uppers = Vec::new();
        for (walker, id) in self.present() {
            let skeleton = self.skeleton(walker);
            let (shapes, upper) = walker.person.shapes(&skeleton);
            people.push(Object::new(shapes, Some(id), true));
            uppers.push(upper);
        }
        people.extend(
            self.trolleys().map(|trolley| trolley.trolley(self.scene.room.floor_m(&trolley.place))),
        );
        (World::new(&self.stage, people), uppers)
    }

    /// Returns the skeleton of a person standing on the floor.
    fn skeleton(&self, walker: &Walker) -> Skeleton {
        let floor_m = self.scene.room.floor_m(&walker.stance.place);
        Skeleton::new(&walker.person.build, &walker.stance).raised(floor_m)
    }

    /// Returns the pose of the robot's body in the world while a part of the image is exposed, from
    /// the upper edge, 0, to the lower, 1; it pitches when it brakes.
    fn world_from_robot(&self, part: f64) -> Isometry3<f64> {
        // A rolling shutter exposes the rows one after the other, around the middle one.
        let since_middle = (part - 0.5) * self.scene.camera.rolling_shutter_s;
        let planar = self.robot.pose_after(since_middle);
        let nod = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.robot.nod_rad());
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), planar.rotation.angle());
        let at = Point2::from(planar.translation.vector);
        let [before_m, at_m, behind_m] = [STANDS_ON_M, 0.0, -STANDS_ON_M]
            .map(|dx| self.scene.room.floor_m(&(at + Vector2::new(dx, 0.0))));
        let rise = before_m - behind_m;
        // A rising floor lifts the nose of a robot that moves along the room.
        let slope =
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -rise.atan2(2.0 * STANDS_ON_M));
        Isometry3::from_parts(Translation3::new(at.x, at.y, at_m), slope * yaw * nod)
    }

    fn moment(&self, eye: u64, gain: f64) -> Moment {
        let turned = self.robot.turn_rate() * self.scene.camera.exposure_s;
        let seed = self.scene.seed.rotate_left(20) ^ (self.shots << 2) ^ eye;
        Moment { seed, smear_px: turned * self.camera.focal_px(), gain }
    }

    /// Returns an image buffer to reuse.
    fn canvas(&mut self) -> HitImage {
        let Camera { width, height, .. } = self.true_camera;
        self.canvases.pop().unwrap_or_else(|| HitImage::nothing(width, height))
    }

    /// Returns the image of the depth camera, if it is taken later than that of the colour camera.
    fn seen_later(&mut self) -> Option<HitImage> {
        let offset_s = self.scene.camera.depth_offset_s;
        if offset_s == 0.0 {
            return None;
        }
        // The depth image is taken later, so the world is moved forward and back again.
        let (robot, walkers) = (self.robot.clone(), self.walkers.clone());
        let approacher = self.approacher.clone();
        let now_s = self.now_ns as f64 * 1e-9;
        self.robot.step(now_s, offset_s);
        self.walk(now_s, offset_s);
        let (world, _) = self.world();
        let mut seen = self.canvas();
        self.draw_over(&mut seen, &world, &self.true_camera, false);
        (self.robot, self.walkers) = (robot, walkers);
        self.approacher = approacher;
        Some(seen)
    }

    /// Renders the view of a camera of the robot into an existing image.
    fn draw_over(&self, seen: &mut HitImage, world: &World, camera: &Camera, lit: bool) {
        let view = WorldCamera { world, camera, pose: &|part| self.world_from_robot(part), lit };
        view.draw_over(seen, self.threads);
    }

    fn rgbd(&mut self, seen: &HitImage) -> Images {
        let later = self.seen_later();
        let settings = &self.scene.camera;
        let sensor = DepthSensor {
            focal_px: self.camera.focal_px(),
            baseline_m: settings.baseline_m,
            range_m: [settings.min_depth_m, settings.max_depth_m],
        };
        let moment = self.moment(0, 1.0);
        let depth = Some(Arc::new(sensor.measure(
            later.as_ref().unwrap_or(seen),
            moment.seed,
            self.threads,
        )));
        let lit = settings.colour;
        self.canvases.extend(later);
        let colour = lit.then(|| Arc::new(self.exposures[0].colour(seen, &moment)));
        Images { colour, depth, ..Images::default() }
    }

    /// Returns the circular image of a panorama camera; the motion blur of a turning robot is not
    /// rendered.
    fn circle(&mut self, seen: &HitImage) -> Images {
        // A turn blurs along circles, which the blur along rows cannot represent.
        let moment = Moment { smear_px: 0.0, ..self.moment(0, 1.0) };
        let colour = self.exposures[0].colour(seen, &moment);
        Images { colour: Some(Arc::new(colour)), ..Images::default() }
    }

    fn stereo(&mut self, world: &World, left: &HitImage) -> Images {
        let mut camera = self.true_camera.clone();
        // A fifth of a pixel is the usual error of rectification.
        let tilt = 0.2 / camera.focal_px();
        let aside = Translation3::new(self.scene.camera.baseline_m, 0.0, 0.0);
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), tilt);
        camera.robot_from_camera *= Isometry3::from_parts(aside, tilt);
        let mut right = self.canvas();
        self.draw_over(&mut right, world, &camera, true);
        // The two sensors of a pair never expose exactly alike.
        let moments = [self.moment(0, 1.0), self.moment(1, 1.03)];
        let grey = self.exposures[0].grey(left, &moments[0]);
        let image = self.exposures[1].grey(&right, &moments[1]);
        self.canvases.push(right);
        let right = RightImage { image, baseline_m: self.scene.camera.baseline_m };
        Images { grey: Some(Arc::new(grey)), right: Some(Arc::new(right)), ..Images::default() }
    }

    fn in_lens(
        &self,
        mut seen: HitImage,
        world: &World,
        uppers: &[usize],
        pose: &Isometry3<f64>,
    ) -> (HitImage, Vec<Truth>) {
        let (camera, lit) = (&self.true_camera, self.scene.camera.colour);
        let view = WorldCamera { world, camera, pose: &|part| self.world_from_robot(part), lit };
        view.draw_over(&mut seen, self.threads);
        let truth = self.truth(
            (world, uppers, pose),
            |of, skeleton| sight(&view, &seen, of, skeleton),
            |id, joint| joints::in_lens(&view, &seen, id, joint),
        );
        (seen, truth)
    }

    fn in_mirror(
        &self,
        mirror: &MirrorCamera,
        world: &World,
        uppers: &[usize],
        pose: &Isometry3<f64>,
    ) -> (HitImage, Vec<Truth>) {
        let world_from_camera = pose * self.true_camera.robot_from_camera;
        let seen = mirror.draw(world, &world_from_camera, self.threads);
        let truth = self.truth(
            (world, uppers, pose),
            |of, skeleton| mirror.sight(&seen, &world_from_camera, of, &skeleton.head),
            |id, joint| joints::in_mirror(mirror, &seen, &world_from_camera, id, joint),
        );
        (seen, truth)
    }

    /// Returns the truth. `sight` returns the appearance of a person's upper body: the region from
    /// its position, and its visible part; `spot` does so for a joint.
    fn truth(
        &self,
        (world, uppers, pose): (&World, &[usize], &Isometry3<f64>),
        sight: impl Fn((u16, &[Shape]), &Skeleton) -> (Option<Rect>, Visibility),
        spot: impl Fn(u16, &Point3<f64>) -> Spot,
    ) -> Vec<Truth> {
        let people = world.people.iter().filter_map(|o| Some((o.person?, o)));
        let walkers = self.present().map(|(walker, _)| walker).zip(uppers);
        let truth = people.zip(walkers).map(|((id, object), (walker, upper))| {
            let skeleton = self.skeleton(walker);
            let torso = nalgebra::center(&skeleton.pelvis, &skeleton.chest);
            let (upper_body, seen) = sight((id, &object.shapes[..*upper]), &skeleton);
            Truth {
                id,
                head_in_robot: pose.inverse_transform_point(&skeleton.head),
                torso_in_robot: pose.inverse_transform_point(&torso),
                upper_body,
                visible: seen.bounds_px.map(|[x, y, r, b]| Rect::new(x, y, r - x, b - y)),
                visible_fraction: seen.fraction,
                occluder: seen.occluder,
                ignore: seen.fraction < LEAST_VISIBLE,
                joints: joints(&skeleton, pose, |joint| spot(id, joint)),
            }
        });
        truth.collect()
    }
}

fn camera(scene: &Scene) -> Camera {
    let settings = &scene.camera;
    let f = 0.5 * settings.width as f64 / (0.5 * settings.field_of_view_deg.to_radians()).tan();
    let lens = Pinhole::centred(f, settings.width, settings.height);
    let pitch = settings.pitch_down_deg.to_radians();
    Camera::mounted(lens, settings.width, settings.height, settings.height_m, pitch, 0.0)
}

/// Returns the camera as it is really mounted, with errors relative to the pose in the log.
fn shaken(camera: &Camera, degrees: f64, random: &mut Random) -> Camera {
    // Clamped at two standard deviations, because a worse mount would be noticed and corrected.
    let [angles, shift] = [0, 1]
        .map(|_| Vector3::from([0, 1, 2].map(|_| degrees * random.normal().clamp(-2.0, 2.0))));
    let turn = Rotation3::new(angles.map(f64::to_radians));
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    let off = Isometry3::from_parts(Translation3::from(shift * 0.01), turn);
    Camera { robot_from_camera: camera.robot_from_camera * off, ..camera.clone() }
}

/// Returns a chair for each seated person.
fn chairs(scene: &Scene) -> impl Iterator<Item = Furniture> {
    let seated = scene.people.iter().filter(|p| p.posture == Posture::Seated);
    seated.map(|person| Furniture {
        kind: FurnitureKind::Chair,
        at: [0, 1].map(|axis| person.path[0][axis] + person.offset[axis]),
        heading_deg: person.heading_deg.unwrap_or(0.0),
    })
}

#[cfg(test)]
mod tests;
