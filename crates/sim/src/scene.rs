//! Scenes as TOML: everything on which a simulated log depends, including the seed.

use crate::bench_setting::FollowBench;
use crate::camera_settings::{CameraKind, CameraSettings};
use crate::posture::Posture;
use crate::room_settings::RoomSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::{ConfigError, check_settings};
use tagalong_core::settings;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

use crate::approach::{ApproachBy, ApproachSettings};
use crate::crowd::{Block, CrowdSettings, Walk};
use crate::daylight::Daylight;
use crate::faults::InjectedFault;
use crate::footprint;
use crate::furniture::Furniture;
use crate::laser::LaserSettings;
use crate::lidar::LidarSettings;
use crate::obstacle_sensors::{self, BumperSettings, RangeSettings, ScannerSettings};
use crate::path_variation::PathVariation;
use crate::person::Extra;
use crate::ramp::Ramp;
use crate::split::{SUBJECTS, Split};
use crate::variation::{Variant, one_scene};
use crate::webcam::WebcamSettings;

settings! {
    /// A scene. Lengths are in metres. The corner of the room is the origin, X runs along its
    /// length, Y along its width; angles turn from X towards Y.
    pub struct Scene {
        /// Purpose of the scene.
        pub about: String,
        /// Seed of all random numbers; it also determines for which purpose the log may be used,
        /// see [`Split`].
        pub seed: u64 = 1,
        /// Length of the log, s.
        #[schemars(range(min = 1e-6, max = 86_400.0))]
        pub duration_s: f64 = 10.0,
        /// Number of people with random clothes and paths, in addition to `people`.
        pub crowd: usize = 0,
        /// The room.
        pub room: RoomSettings,
        /// The light.
        pub light: LightSettings,
        /// The camera.
        pub camera: CameraSettings,
        /// The robot.
        pub robot: RobotSettings,
        /// Faults of the recording.
        pub faults: FaultSettings,
        /// A laser scanner on the robot, if it has one; `laser = {}` is one with default settings.
        pub laser: Option<LaserSettings>,
        /// A 3-D lidar on the robot, if it has one; `lidar = {}` is a spinning one of 16 rings.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub lidar: Option<LidarSettings>,
        /// Further laser scanners, as obstacle sources.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub lasers: Vec<ScannerSettings>,
        /// Sonars and infrared sensors.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub ranges: Vec<RangeSettings>,
        /// Bumpers.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub bumpers: Vec<BumperSettings>,
        /// Cameras mounted in the room.
        pub webcams: Vec<WebcamSettings>,
        /// Furniture.
        pub furniture: Vec<Furniture>,
        /// Wall blocks, which people with a walk other than `plain` avoid.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        #[schemars(length(max = 500))]
        pub blocks: Vec<Block>,
        /// People.
        pub people: Vec<PersonSettings>,
        /// Settings of people with a walk other than `plain`.
        #[serde(skip_serializing_if = "CrowdSettings::is_default")]
        pub reacting: CrowdSettings,
        /// A person or a trolley that moves towards the robot; none if left out.
        pub approach: Option<ApproachSettings>,
        /// Room, blocks and people as in the benchmark Follow-Bench.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub follow_bench: Option<FollowBench>,
        /// Variation of the path of the first person with the seed; without it the path is the same
        /// for all.
        #[serde(skip_serializing_if = "PathVariation::is_off")]
        pub variation: PathVariation,
    }
}

impl Scene {
    /// Reads a scene.
    ///
    /// # Errors
    /// An unknown key, a wrong type or an impossible value, with its position.
    pub fn parse(text: &str) -> Result<Self, ConfigError> {
        Self::parse_with(text, &Variant::default())
    }

    /// Reads one of the scenes that a text with a table `[vary]` describes. That table has dotted
    /// keys, and gives for each the source of its value:
    ///
    /// ```toml
    /// [vary]
    /// light.lux = { between = [50.0, 1000.0] }             # of whole numbers: both ends included
    /// room.floor = { one_of = ["planks", "tiles", "carpet"] }
    /// people.0.speed_mps = { in_turn = [0.6, 0.8, 1.0] }   # the seed's number counts
    /// people.1.look = { same_as = "people.0.look" }
    /// room.size_m.0 = { between = [7.0, 12.0], apart = true } # no value in two splits
    /// ```
    ///
    /// The same text and variant give the same scene; each key has its own random numbers.
    ///
    /// # Errors
    /// An unknown key, a wrong type or an impossible value, with its position.
    pub fn parse_with(text: &str, variant: &Variant) -> Result<Self, ConfigError> {
        let scene = one_scene(text, variant, |mut table, seed| {
            complete_camera(&mut table);
            let value = Spanned::new(0..0, DeValue::Table(table));
            let scene = Self::deserialize(ValueDeserializer::from(value))?;
            Ok(Self { seed, ..scene })
        })?;
        scene.check()?;
        Ok(scene.with_follow_bench().with_varied_paths())
    }

    /// Returns the number of people, including companions and crowd.
    pub fn number_of_people(&self) -> usize {
        let with_companions = self.people.iter().map(|p| 1 + p.companions);
        let comes = self.approach.iter().filter(|approach| approach.by == ApproachBy::Person);
        with_companions.fold(self.crowd + comes.count(), usize::saturating_add)
    }

    /// Returns the same room with each person alone in it for `each_s`, one after the other,
    /// starting at the time when the first of them enters.
    pub fn in_turn(&self, each_s: f64) -> Self {
        let mut scene = self.clone();
        let mut now_s = scene.people.first().map_or(0.0, |person| person.enters_s);
        for person in &mut scene.people {
            person.enters_s = now_s;
            now_s += each_s;
            person.leaves_s = Some(now_s);
        }
        scene.duration_s = now_s;
        scene
    }

    /// Returns the split, which is the purpose for which the log may be used.
    pub fn split(&self) -> Split {
        Split::of(self.seed)
    }

    /// Rejects further sensors that cannot work, and faults that cannot be injected.
    fn check_parts(&self) -> Result<(), String> {
        obstacle_sensors::problem(self).map_or(Ok(()), Err)?;
        self.check_faults()
    }

    fn check(&self) -> Result<(), ConfigError> {
        let camera = &self.camera;
        let rules = [
            (self.seed < Split::SEEDS_END, "seed must be below 3000000000"),
            (
                camera.max_depth_m > camera.min_depth_m,
                "camera.max_depth_m must be above min_depth_m",
            ),
            (
                camera.colour || camera.kind == CameraKind::Rgbd,
                "camera.colour = false needs camera.kind = \"rgbd\": it has depth besides",
            ),
            (
                camera.rolling_shutter_s == 0.0 || camera.kind != CameraKind::Panorama,
                "camera.rolling_shutter_s is not for camera.kind = \"panorama\"",
            ),
            (
                camera.depth_offset_s == 0.0 || camera.kind == CameraKind::Rgbd && camera.colour,
                "camera.depth_offset_s needs camera.kind = \"rgbd\" with colour",
            ),
            (self.number_of_people() <= 200, "there must be at most 200 people"),
            (
                self.people.iter().all(|p| !p.path.is_empty() || p.wander > 0),
                "every person needs a path of one point at least, or wander",
            ),
            (
                self.people.iter().all(|p| p.posture != Posture::Seated || !p.path.is_empty()),
                "a seated person needs a path of one point: the place of the chair",
            ),
            (
                self.people.iter().all(|p| p.leaves_s.is_none_or(|leaves_s| leaves_s > p.enters_s)),
                "leaves_s must be after enters_s",
            ),
            (
                self.people.iter().all(|p| p.subject.max(p.look) < Some(SUBJECTS)),
                "subject and look must be below 500",
            ),
        ];
        let laser = self.laser.iter().flat_map(LaserSettings::rules);
        let lidar = self.lidar.iter().flat_map(LidarSettings::rules);
        let ramp = self.room.ramp.iter().flat_map(Ramp::rules);
        let day = self.light.day.iter().flat_map(|day| day.rules(&self.room));
        let outline = footprint::rules(&self.robot.footprint);
        let has_sides = self.light.day.is_some() || !self.webcams.is_empty();
        let variation = self.variation.rules(has_sides);
        let parts = laser.chain(ramp).chain(day).chain(outline);
        let is_empty = self.number_of_people() == 0 && self.blocks.is_empty();
        let bench = self.follow_bench.iter().flat_map(|bench| bench.rules(is_empty));
        let parts = parts.chain(bench).chain(lidar);
        let parts = parts.chain(variation).chain(self.reacting.rules());
        let mut rules = rules.into_iter().chain(camera.mirror.rules()).chain(parts);
        match rules.find(|(holds, _)| !holds) {
            Some((_, message)) => Err(ConfigError::new(message)),
            None => check_settings(self)
                .map_err(|error| error.to_string())
                .and_then(|()| self.check_parts())
                .map_err(ConfigError::new),
        }
    }
}

/// Defaults of a stereo pair.
const STEREO: [(&str, &str); 4] =
    [("width", "512"), ("height", "384"), ("field_of_view_deg", "100.0"), ("baseline_m", "0.12")];

/// Gives a camera for which only the kind is set the usual settings of that kind.
fn complete_camera(root: &mut DeTable<'_>) {
    let Some(DeValue::Table(camera)) = root.get_mut("camera").map(Spanned::get_mut) else { return };
    if camera.get("kind").and_then(|kind| kind.get_ref().as_str()) != Some("stereo") {
        return;
    }
    for (key, value) in STEREO {
        if let (false, Ok(value)) = (camera.contains_key(key), DeValue::parse(value)) {
            camera.insert(Spanned::new(0..0, key.into()), value);
        }
    }
}

settings! {
    /// The light.
    pub struct LightSettings {
        /// Illuminance of the floor below a lamp, lx.
        pub lux: f64 = 350.0,
        /// Number of lamps along the room.
        pub lamps: usize = 2,
        /// Ambient light as a fraction of `lux`.
        pub ambient: f64 = 0.35,
        /// Windows and the sun; without it the room has no windows.
        pub day: Option<Daylight>,
    }
}

settings! {
    /// The robot and its path.
    pub struct RobotSettings {
        /// Start position, m.
        pub start: [f64; 2] = [1.0, 3.0],
        /// Heading at the start, degrees.
        pub heading_deg: f64 = 0.0,
        /// Corners of its outline, robot frame, m; if left out, it is a disc with a radius of 0.25
        /// m.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub footprint: Vec<[f64; 2]>,
        /// Points to which it drives one after the other; without any, the robot is at rest.
        pub path: Vec<[f64; 2]>,
        /// If above 0, the robot follows the first person of the scene at this distance, m, and
        /// ignores the path.
        #[schemars(range(min = 0.0, max = 20.0))]
        pub behind_m: f64 = 0.0,
        /// Speed, m/s.
        pub speed_mps: f64 = 0.5,
        /// Half the distance between the wheels, m.
        pub half_separation_m: f64 = 0.167,
        /// Nominal radius of the wheels, as the odometry assumes, m.
        #[schemars(range(min = 0.005, max = 1.0))]
        pub wheel_radius_m: f64 = 0.0975,
        /// Number of encoder ticks per turn of a wheel.
        #[schemars(range(min = 1))]
        pub ticks_per_turn: u32 = 4096,
        /// Time constant of the wheel speeds, s.
        pub response_s: f64 = 0.2,
        /// Time from a command to its effect, s.
        pub latency_s: f64 = 0.1,
        /// Standard deviation of the radius of each wheel and of their distance as
        /// fractions; unknown to the odometry.
        pub wheel_bias: f64 = 0.005,
        /// Standard deviation of a wheel's slip as a fraction of its travel in one
        /// step of the odometry.
        pub slip: f64 = 0.02,
    }
}

settings! {
    /// Faults of the recording.
    pub struct FaultSettings {
        /// Fraction of images that are lost.
        pub dropped: f64 = 0.01,
        /// Fraction of images that are recorded late, up to 0.15 s.
        pub late: f64 = 0.02,
        /// Faults that begin at a given time.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub inject: Vec<InjectedFault>,
    }
}

/// Behaviour of a person when the robot cannot see them for the first time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Trick {
    /// No special behaviour.
    #[default]
    None,
    /// Turns round and goes back.
    TurnBack,
    /// Stops behind the occluding person for `hide_s`.
    Stop,
    /// Exchanges paths with the occluding person.
    Swap,
}

/// Behaviour of a person at the end of the path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AtEnd {
    /// Stays there.
    #[default]
    Stop,
    /// Goes back the same way, repeatedly.
    Return,
    /// Continues to the first point, repeatedly.
    Loop,
}

settings! {
    /// A person.
    pub struct PersonSettings {
        /// Points to walk through; the first is the start.
        pub path: Vec<[f64; 2]>,
        /// Number of further points after the path, which the seed chooses: anywhere in the room,
        /// away from furniture and the robot's start.
        #[schemars(range(max = 1000))]
        pub wander: usize = 0,
        /// Walking model.
        #[serde(skip_serializing_if = "Walk::is_plain")]
        pub walk: Walk = Walk::Plain,
        /// Preferred speed, m/s.
        #[schemars(range(min = 0.0, max = 2.0))]
        pub speed_mps: f64 = 1.1,
        /// Time until which the person stands, s.
        pub start_s: f64 = 0.0,
        /// Rest at each point of the path on every visit, s; none beyond the end of the list.
        #[schemars(inner(range(min = 0.0, max = 3600.0)))]
        pub rest_s: Vec<f64>,
        /// Time before which the person is not in the room, s: a detector that learns the
        /// appearance of the empty room needs to see it.
        pub enters_s: f64 = 0.0,
        /// Time at which the person leaves the room, s; never if left out.
        pub leaves_s: Option<f64>,
        /// Behaviour at the end of the path.
        pub at_end: AtEnd = AtEnd::Stop,
        /// Behaviour when hidden.
        pub trick: Trick = Trick::None,
        /// Time for which the trick `stop` stays hidden, s.
        pub hide_s: f64 = 3.0,
        /// Offset of the whole path, m.
        pub offset: [f64; 2] = [0.0; 2],
        /// Posture.
        pub posture: Posture = Posture::Upright,
        /// Number of others that walk along, 0.6 to 1 m apart; they count as separate people.
        #[schemars(range(max = 3))]
        pub companions: usize = 0,
        /// Direction of the face at the start, degrees; the walking direction if left out.
        pub heading_deg: Option<f64>,
        /// Turn rate on the spot, degrees per second.
        pub spin_deg_per_s: f64 = 0.0,
        /// Body height, m; random if left out.
        pub height_m: Option<f64>,
        /// Index in the pool of people that the seed's split has, 0 to 499; random if left out.
        pub subject: Option<u64>,
        /// Index of the person of the pool whose clothes are worn; the own clothes if left out.
        pub look: Option<u64>,
        /// Additional clothes and carried objects; random if left out.
        pub extras: Option<Vec<Extra>>,
        /// Time at which the person takes off a coat, s: until then a coat in the colours of
        /// another person's clothes covers the own ones. No coat if left out.
        #[schemars(range(min = 0.0, max = 86400.0))]
        pub coat_off_s: Option<f64>,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_key_is_named_with_its_line_and_the_right_one() {
        let text = "seed = 3\n[room]\nwalpaper = true\n";
        let error = Scene::parse(text).unwrap_err().render("s.toml", text);
        assert!(error.starts_with("s.toml:3:1"), "{error}");
        assert!(error.contains("did you mean `wallpaper`?"), "{error}");
    }

    #[test]
    fn in_turn_everybody_has_the_room_for_themselves() {
        let text = "[[people]]\nwander = 2\nenters_s = 9.0\n[[people]]\nwander = 2\n";
        let scene = Scene::parse(text).unwrap().in_turn(20.0);
        fn times(person: &PersonSettings) -> (f64, Option<f64>) {
            (person.enters_s, person.leaves_s)
        }
        let times: Vec<_> = scene.people.iter().map(times).collect();
        assert_eq!(times, [(9.0, Some(29.0)), (29.0, Some(49.0))]);
        assert_eq!(scene.duration_s, 49.0);
    }

    #[test]
    fn impossible_values_are_refused() {
        for text in [
            "duration_s = 0.0",
            "[camera]\nwidth = 0",
            "[[people]]\nspeed_mps = 1.0",
            "[[people]]\nwander = 1001",
            "[[people]]\nwander = 3\nposture = \"seated\"",
            "[[people]]\nwander = 3\nenters_s = 4.0\nleaves_s = 4.0",
            "[camera]\nkind = \"stereo\"\ncolour = false",
        ] {
            assert!(Scene::parse(text).is_err(), "{text}");
        }
        assert_eq!(Scene::parse("").unwrap(), Scene::default());
    }
}
