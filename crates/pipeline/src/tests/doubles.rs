//! Scripted plugins: the test gives their answers.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use nalgebra::{Matrix3, Point3, SMatrix, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::Registry;
use tagalong_core::{
    Association, Associations, Associator, Capabilities, Controller, Detection, Detector,
    EgoMotion, Error, Estimate, Evidence, Filter, FilterRequirements, Frame, Funnel, Gate, Images,
    Input, Inputs, LaserScan, Likelihood, PerPerson, Person, PersonFilter, Query, Result, Scene,
    Stamp, Track, TrackId, Twist, Update, Verifier, WheelSpeeds,
};
use tagalong_geometry::{Camera, ImageBox, Pinhole};

use crate::{FrameReport, Pipeline};

/// Settings of every double.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Number of the script.
    pub script: usize,
    /// Name of the behaviour.
    pub how: String,
}

pub fn camera() -> Camera {
    Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0)
}

pub fn frame(index: u64, t_s: f64) -> Frame {
    with_eyes(bare_frame(index, t_s))
}

/// Returns a frame without any sensor.
pub fn bare_frame(index: u64, t_s: f64) -> Frame {
    let stamp = Stamp::from_nanos(1_000_000_000_000).plus_seconds(t_s);
    let motion = EgoMotion::at_rest(0.1);
    Frame::new(index, stamp, Arc::new(camera()), motion, Images::default())
}

/// Adds the scan of a laser in a hall: without a sensor of obstacles no robot moves.
pub fn with_eyes(frame: Frame) -> Frame {
    let scan = hall(frame.index, &[]);
    frame.with_laser(Some(scan))
}

/// Returns the scan of a laser that meets these points and the walls of a hall, with noise: a scan that
/// is the same again and again is frozen.
pub fn hall(index: u64, things: &[Point3<f64>]) -> LaserScan {
    let wall_m = 9.0 + 0.01 * (index % 5) as f64;
    let mut points = things.to_vec();
    for ray in 0..120 {
        let angle = f64::from(ray) * 3.0_f64.to_radians();
        points.push(Point3::new(wall_m * angle.cos(), wall_m * angle.sin(), 0.2));
    }
    LaserScan::of_points(points)
}

/// A person 1.6 m tall (to the head's centre) at a place on the floor.
pub fn person(x: f64, y: f64) -> Detection {
    let position = Point3::new(x, y, 1.6);
    Detection::new("script", position, Matrix3::identity() * 0.01, 1.0)
        .with_image(ImageBox::upper_body(camera().upper_body(&position)))
}

pub fn scored(score: f64, detection: Detection) -> Detection {
    detection.with_score(score)
}

type ScriptedDetections = BTreeMap<(usize, u64), Vec<Detection>>;
type Question = (usize, u64, Option<TrackId>);

/// Detections by script and frame, and a record of the calls.
#[derive(Clone, Default)]
pub struct World {
    seen: Arc<Mutex<ScriptedDetections>>,
    pub asked: Arc<Mutex<Vec<Question>>>,
    pub predicted: Arc<Mutex<Vec<EgoMotion>>>,
}

impl World {
    pub fn show(&self, script: usize, index: u64, detections: Vec<Detection>) {
        self.seen.lock().unwrap().insert((script, index), detections);
    }

    /// Script 0 for frames 1, 2, ...
    pub fn of(frames: impl IntoIterator<Item = Vec<Detection>>) -> Self {
        let world = Self::default();
        for (index, detections) in (1..).zip(frames) {
            world.show(0, index, detections);
        }
        world
    }

    pub fn registry(&self) -> Registry {
        let mut registry = Registry::default();
        let world = self.clone();
        registry.detector("script", "reads a script", move |config: Config, _| {
            Ok(Script { world: world.clone(), config })
        });
        registry.verifier("choosy", "doubts some", |config: Config, _| Ok(Choosy(config)));
        let world = self.clone();
        tagalong_associators::hungarian::register(&mut registry);
        tagalong_filters::image_kalman::register(&mut registry);
        tagalong_track_managers::m_of_n::register(&mut registry);
        registry.filter("steady", "believes what it saw", move |_: Config, _| {
            Ok(PerPerson::new(Steady(world.clone())))
        });
        registry.filter("odd", "makes mistakes", |config: Config, _| {
            Ok(Odd { config, ids: BTreeSet::new() })
        });
        registry.associator("weighing", "weighs", |config: Config, _| Ok(Weighs(config)));
        registry.controller("drive", "drives", |config: Config, _| Ok(Drive(config)));
        registry
    }

    pub fn pipeline(&self, config: &str) -> Pipeline {
        match Pipeline::builder(&self.registry()).from_toml(config) {
            Ok(pipeline) => pipeline,
            Err(error) => panic!("{error}"),
        }
    }

    /// Runs `frames` frames at intervals of `dt_s`.
    pub fn run(&self, config: &str, frames: u64, dt_s: f64) -> Vec<FrameReport> {
        let mut pipeline = self.pipeline(config);
        (1..=frames).map(|i| pipeline.step(frame(i, i as f64 * dt_s)).unwrap()).collect()
    }
}

/// A discovering script and the steady filter.
pub const PLAIN: &str = "
    [[detectors]]
    plugin = 'script'
    [filter]
    plugin = 'steady'
";

struct Script {
    world: World,
    config: Config,
}

impl Detector for Script {
    fn capabilities(&self) -> Capabilities {
        let inputs = match self.config.how.as_str() {
            "depth" => Inputs::NONE.require(Input::Depth),
            "perhaps depth" => Inputs::NONE.accept(Input::Depth),
            _ => Inputs::NONE,
        };
        let mut capabilities = Capabilities::new(inputs);
        capabilities.discovers = self.config.how != "track";
        capabilities.tracks = self.config.how != "discover";
        capabilities.weighs = self.config.how == "weigh";
        capabilities
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let script = self.config.script;
        let track = match query {
            Query::Track(track) => Some(*track),
            Query::Discover { .. } => None,
        };
        self.world.asked.lock().unwrap().push((script, frame.index, track.map(|t| t.id)));
        match self.config.how.as_str() {
            "panic" => panic!("out of {}", "ideas"),
            "depth" | "forgets to declare" => drop(frame.depth()?),
            "perhaps depth" if frame.depth().is_ok() => return Ok(Vec::new()),
            "picky" => funnel.drop_many("too small", 2),
            _ => {}
        }
        let seen = self.world.seen.lock().unwrap();
        let mut found = seen.get(&(script, frame.index)).cloned().unwrap_or_default();
        if let Some(track) = track.filter(|_| self.config.how != "far") {
            let here = track.estimate.person.position;
            found.retain(|d| (d.position - here).norm() < 0.5);
        }
        Ok(found)
    }

    fn remembers(&self) -> bool {
        self.config.how != "picky"
    }

    fn likelihood(&self) -> Option<&dyn Likelihood> {
        (self.config.how == "weigh").then_some(self as &dyn Likelihood)
    }
}

impl Likelihood for Script {
    fn log_likelihood(&self, _: &Frame, scene: &[Person]) -> Result<f64> {
        Ok(scene.len() as f64)
    }
}

/// Verifier that rejects every candidate left of the middle.
struct Choosy(Config);

impl Verifier for Choosy {
    fn inputs(&self) -> Inputs {
        Inputs::NONE
    }

    fn log_odds(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        match self.0.how.as_str() {
            "nan" => Ok(f64::NAN),
            "panic" => panic!("no"),
            "panic at 21" if frame.index == 21 => panic!("no"),
            "once" => Ok(if frame.index == 8 { -2.5 } else { 0.5 }),
            "fail" => Err(Error::Other("has no opinion".into())),
            _ => Ok(if candidate.position.y > 0.0 { -4.0 } else { 0.0 }),
        }
    }
}

/// Constant velocity, learned from the last two detections.
struct Steady(World);

#[derive(Clone)]
struct State {
    person: Person,
    age_s: f64,
}

impl PersonFilter for Steady {
    type State = State;

    fn start(&self, detection: &Detection) -> State {
        let person = Person { position: detection.position, velocity: Vector2::zeros() };
        State { person, age_s: 0.0 }
    }

    fn predict(&self, state: &mut State, motion: &EgoMotion) {
        self.0.predicted.lock().unwrap().push(*motion);
        state.age_s += motion.dt;
        let step = state.person.velocity * motion.dt;
        state.person.position += nalgebra::Vector3::new(step.x, step.y, 0.0);
    }

    fn correct(&self, state: &mut State, detection: &Detection, _: &Camera) -> Update {
        let off = (detection.position - state.person.position).xy();
        state.person.velocity += 0.5 * off / state.age_s.max(0.01);
        state.person.position = detection.position;
        state.age_s = 0.0;
        Update::new(Some((off.norm_squared(), 3)))
    }

    fn estimate(&self, state: &State, camera: &Camera) -> Estimate {
        Estimate::new(
            state.person,
            SMatrix::identity() * (0.02 + 0.3 * state.age_s),
            camera.upper_body(&state.person.position),
        )
    }
}

/// A filter with one fault.
struct Odd {
    config: Config,
    ids: BTreeSet<TrackId>,
}

impl Filter for Odd {
    fn requirements(&self) -> FilterRequirements {
        let none = FilterRequirements::new(Inputs::NONE);
        match self.config.how.as_str() {
            "boxes" => none.with_image_box(),
            "weighs" => none.with_likelihood().with_search(),
            _ => none,
        }
    }

    fn start(&mut self, id: TrackId, _: &Detection, _: &Camera) {
        assert!(self.config.how != "panic", "cannot start {id}");
        self.ids.insert(id);
    }

    fn predict(&mut self, _: &EgoMotion, _: &Camera) {}

    fn update(&mut self, _: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        let nis = Some((f64::NAN, 3));
        Ok([(TrackId(4711), Update::new(nis))].into())
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        let (x, variance) = match self.config.how.as_str() {
            "nan" => (f64::NAN, 1.0),
            "negative" => (3.0, -1.0),
            _ => (3.0, 1.0),
        };
        let mut estimates = BTreeMap::new();
        if self.config.how == "forgets" {
            return estimates;
        }
        for id in &self.ids {
            let position = Point3::new(x, f64::from(id.0), 1.6);
            let person = Person { position, velocity: Vector2::zeros() };
            let covariance = SMatrix::identity() * variance;
            estimates.insert(*id, Estimate::new(person, covariance, camera.upper_body(&position)));
        }
        estimates
    }

    fn stop(&mut self, id: TrackId) {
        self.ids.remove(&id);
    }
}

/// Gives each track the first detection, with a weight; or impossible pairs.
struct Weighs(Config);

impl Associator for Weighs {
    fn fits(&self, _: &Track, _: &Detection, _: &Gate) -> bool {
        true
    }

    fn associate(&mut self, tracks: &[Track], found: &[Detection], _: &Gate) -> Associations {
        fn pair(track: usize, detection: usize, weight: f64) -> Association {
            Association::new(track, detection, weight)
        }

        let pairs = match self.0.how.as_str() {
            "impossible" => vec![pair(7, 0, 1.0), pair(0, 9, 1.0), pair(0, 0, f64::NAN)],
            weight => (0..tracks.len().min(found.len()))
                .map(|track| pair(track, track, weight.parse().unwrap()))
                .collect(),
        };
        Associations::new(pairs)
    }
}

struct Drive(Config);

impl Controller for Drive {
    fn command(&mut self, scene: &Scene<'_>) -> Twist {
        let wheels = match self.0.how.as_str() {
            "panic at 21" if scene.frame.index == 21 => panic!("which way?"),
            "nan" => WheelSpeeds { left: f64::NAN, right: 0.0 },
            "panic" => panic!("which way?"),
            _ => WheelSpeeds { left: 2.0, right: 4.0 },
        };
        scene.wheels.twist(wheels)
    }

    fn stand_off_m(&self) -> Option<f64> {
        self.0.how.strip_prefix("keeps ")?.parse().ok()
    }
}
