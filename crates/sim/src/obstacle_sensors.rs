//! Further obstacle sensors on the robot: laser scanners, sonars, infrared sensors, bumpers.

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Rotation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{LaserScan, RangeReading, settings};
use tagalong_math::{fingerprint, number_at};

use crate::laser::LaserSettings;
use crate::random::normal_at;
use crate::scene::Scene;
use crate::world::World;

/// Number of rings of rays around the axis of a cone, and of rays in the first ring; each further
/// ring has that many more.
const RINGS: u32 = 3;
const RAYS_OF_RING: u32 = 6;

/// Kind of a range sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RangeKind {
    /// Ultrasound: glass and mirrors are ordinary surfaces; large smooth surfaces at an oblique
    /// angle reflect the sound away.
    #[default]
    Sonar,
    /// Light: it passes through glass, and mirrors reflect it.
    Infrared,
}

settings! {
    /// A range sensor on the robot: the distance to the nearest surface within a cone.
    pub struct RangeSettings {
        /// Name of its source in `[[collision_monitor.sources]]`.
        pub name: String,
        /// Kind of the sensor.
        pub kind: RangeKind = RangeKind::Sonar,
        /// Position on the robot: forward, left and up, m, and the direction, degrees to the left.
        pub mount: [f64; 4] = [0.2, 0.0, 0.25, 0.0],
        /// Angle of the cone, degrees.
        pub field_of_view_deg: f64 = 30.0,
        /// Minimum distance that is measured, m.
        pub min_range_m: f64 = 0.05,
        /// Maximum distance that is measured, m.
        pub max_range_m: f64 = 4.0,
        /// Standard deviation of a distance, m.
        pub sigma_m: f64 = 0.01,
        /// Readings per second.
        pub rate_hz: f64 = 10.0,
    }
}

settings! {
    /// A bumper on the robot: pressed while the robot touches an object within an arc.
    pub struct BumperSettings {
        /// Name of its source in `[[collision_monitor.sources]]`.
        pub name: String,
        /// Directions that it covers, degrees to the left, from its right end to its left end.
        pub arc_deg: [f64; 2] = [-90.0, 90.0],
        /// Readings per second.
        pub rate_hz: f64 = 50.0,
    }
}

/// A laser scanner on the robot in addition to `laser`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ScannerSettings {
    /// Name of its source in `[[collision_monitor.sources]]`.
    pub name: String,
    /// Position on the robot: forward, left and up, m, and the direction, degrees to the left.
    pub mount: [f64; 4],
    /// Number of rays per scan.
    pub rays: usize,
    /// Field of view around its direction, degrees; 360 is a full turn.
    pub field_of_view_deg: f64,
    /// Minimum range that is measured, m.
    pub min_range_m: f64,
    /// Maximum range that is measured, m.
    pub max_range_m: f64,
    /// Standard deviation of a range, m.
    pub sigma_m: f64,
    /// Scans per second.
    pub rate_hz: f64,
}

impl Default for ScannerSettings {
    fn default() -> Self {
        let usual = LaserSettings::default();
        Self {
            name: String::new(),
            mount: [0.0, 0.0, usual.height_m, 0.0],
            rays: usual.rays,
            field_of_view_deg: usual.field_of_view_deg,
            min_range_m: usual.min_range_m,
            max_range_m: usual.max_range_m,
            sigma_m: usual.sigma_m,
            rate_hz: 10.0,
        }
    }
}

/// Newest reading of a further obstacle sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorReading {
    /// Name of the sensor.
    pub name: Arc<str>,
    /// Time since the start, ns.
    pub at_ns: u64,
    /// The same time in the stamp of the message, ns.
    pub stamp_ns: u64,
    /// The reading.
    pub data: SensorData,
}

/// Data of a further obstacle sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum SensorData {
    /// Ranges of a scanner.
    Scan {
        /// The scanner.
        scanner: Arc<ScannerSettings>,
        /// Ranges of its rays, m, from right to left.
        ranges: Vec<f32>,
    },
    /// Distance of a range sensor.
    Range {
        /// The sensor.
        sensor: Arc<RangeSettings>,
        /// The distance, m.
        reading: RangeReading,
    },
    /// True while a bumper is pressed.
    Bumper(bool),
}

impl RangeSettings {
    /// Returns the pose in the robot frame; the sensor looks along its x axis.
    pub fn robot_from_sensor(&self) -> Isometry3<f64> {
        pose(self.mount)
    }

    fn rules(&self) -> [(bool, &'static str); 3] {
        [
            (is_mount(&self.mount), "ranges: mount must be numbers within 3 m of the robot"),
            (
                (1.0..=120.0).contains(&self.field_of_view_deg),
                "ranges: field_of_view_deg must be in 1 to 120",
            ),
            (
                are_ranges([self.min_range_m, self.max_range_m, self.sigma_m]),
                "ranges: ranges must grow from 0 to 100 at most, and sigma_m be in 0 to 1",
            ),
        ]
    }

    /// Measures the distance; the noise depends on the seed.
    pub(crate) fn measure(
        &self,
        world: &World,
        world_from_robot: &Isometry3<f64>,
        seed: u64,
    ) -> RangeReading {
        let robot_from_sensor = self.robot_from_sensor();
        let world_from_sensor = world_from_robot * robot_from_sensor;
        let eye = world_from_sensor * Point3::origin();
        let slice = world.slice(eye, &(world_from_sensor.rotation * Vector3::z()));
        let mut nearest_m = f64::INFINITY;
        for ray in rays(self.field_of_view_deg.to_radians()) {
            let ray = world_from_sensor.rotation * ray;
            let met_m = match self.kind {
                RangeKind::Sonar => world.echo(&eye, &ray),
                RangeKind::Infrared => world.distance(&slice, &ray),
            };
            nearest_m = nearest_m.min(met_m);
        }
        let measured_m = nearest_m + self.sigma_m * normal_at(seed, fingerprint(self.name.bytes()));
        // REP 117: infinity if there is nothing, minus infinity if it is too near.
        let range_m = match measured_m {
            metres if metres > self.max_range_m => f64::INFINITY,
            metres if metres < self.min_range_m => f64::NEG_INFINITY,
            metres => metres,
        };
        RangeReading {
            robot_from_sensor,
            field_of_view_rad: self.field_of_view_deg.to_radians(),
            min_m: self.min_range_m,
            max_m: self.max_range_m,
            range_m,
        }
    }
}

impl BumperSettings {
    fn rules(&self) -> [(bool, &'static str); 1] {
        let [from, to] = self.arc_deg;
        let is_arc = (-360.0..=360.0).contains(&from) && from < to && to - from <= 360.0;
        [(is_arc, "bumpers: arc_deg must grow by at most 360, from -360 at least")]
    }
}

impl ScannerSettings {
    /// Returns the pose in the robot frame; ray 0 is that on the right.
    pub fn robot_from_scanner(&self) -> Isometry3<f64> {
        pose(self.mount)
    }

    /// Returns the scanner at the height of its mount, as a scanner above the middle of the robot.
    pub fn laser(&self) -> LaserSettings {
        LaserSettings {
            rays: self.rays,
            field_of_view_deg: self.field_of_view_deg,
            height_m: self.mount[2],
            min_range_m: self.min_range_m,
            max_range_m: self.max_range_m,
            sigma_m: self.sigma_m,
            sigma_per_m: 0.0,
        }
    }

    /// Returns the scan with these ranges, with the scanner at a pose in the robot frame.
    pub fn scan(&self, robot_from_scanner: Isometry3<f64>, ranges: &[f32]) -> LaserScan {
        let laser = self.laser();
        let limits_m = [self.min_range_m, self.max_range_m];
        let ranges = ranges.iter().copied().map(f64::from);
        LaserScan::of_ranges(
            robot_from_scanner,
            laser.first_rad(),
            laser.step_rad(),
            limits_m,
            ranges,
        )
    }

    /// Measures the ranges of the rays, m; the noise depends on the seed.
    pub(crate) fn measure(
        &self,
        world: &World,
        world_from_robot: &Isometry3<f64>,
        seed: u64,
    ) -> Vec<f32> {
        let laser = LaserSettings { height_m: 0.0, ..self.laser() };
        let seed = number_at(seed, fingerprint(self.name.bytes()));
        laser.measure(world, &(world_from_robot * self.robot_from_scanner()), seed)
    }
}

/// Returns the reason why the further sensors of a scene cannot work, if there is one.
pub(crate) fn problem(scene: &Scene) -> Option<String> {
    let of_ranges = scene.ranges.iter().flat_map(RangeSettings::rules);
    let of_bumpers = scene.bumpers.iter().flat_map(BumperSettings::rules);
    let mut rules: Vec<(bool, &'static str)> = of_ranges.chain(of_bumpers).collect();
    for scanner in &scene.lasers {
        rules.push((
            is_mount(&scanner.mount),
            "lasers: mount must be numbers within 3 m of the robot",
        ));
        rules.extend(scanner.laser().rules());
    }
    let names = names(scene);
    let rates = scene.ranges.iter().map(|range| range.rate_hz);
    let rates = rates.chain(scene.bumpers.iter().map(|bumper| bumper.rate_hz));
    let mut rates = rates.chain(scene.lasers.iter().map(|laser| laser.rate_hz));
    rules.push((
        rates.all(|hz| (0.1..=50.0).contains(&hz)),
        "rate_hz of ranges, bumpers and lasers must be in 0.1 to 50",
    ));
    if let Some((_, message)) = rules.iter().find(|(holds, _)| !holds) {
        return Some((*message).to_owned());
    }
    let mut known = BTreeSet::new();
    for name in names {
        let is_named =
            !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !is_named {
            let needed = "each of ranges, bumpers and lasers needs a name of letters, digits and _";
            return Some(format!("{needed}, not `{name}`"));
        }
        if !known.insert(name) {
            return Some(format!("two of ranges, bumpers and lasers are called `{name}`"));
        }
    }
    None
}

/// Returns the names of all further sensors.
fn names(scene: &Scene) -> impl Iterator<Item = &str> {
    let of_ranges = scene.ranges.iter().map(|range| &range.name[..]);
    let of_bumpers = scene.bumpers.iter().map(|bumper| &bumper.name[..]);
    of_ranges.chain(of_bumpers).chain(scene.lasers.iter().map(|laser| &laser.name[..]))
}

fn pose([x, y, z, left_deg]: [f64; 4]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), left_deg.to_radians());
    Isometry3::from_parts(Vector3::new(x, y, z).into(), turn)
}

fn is_mount(mount: &[f64; 4]) -> bool {
    let [x, y, z, left_deg] = mount;
    x.hypot(*y) <= 3.0 && (0.0..=3.0).contains(z) && left_deg.is_finite()
}

fn are_ranges([min_m, max_m, sigma_m]: [f64; 3]) -> bool {
    0.0 <= min_m && min_m < max_m && max_m <= 100.0 && (0.0..=1.0).contains(&sigma_m)
}

/// Returns the directions of the rays of a cone around X.
fn rays(opening_rad: f64) -> impl Iterator<Item = Vector3<f64>> {
    let rings = (1..=RINGS).flat_map(move |ring| {
        let off_rad = 0.5 * opening_rad * f64::from(ring) / f64::from(RINGS);
        let count = ring * RAYS_OF_RING;
        (0..count).map(move |ray| {
            let around_rad = TAU * f64::from(ray) / f64::from(count);
            let tilted = Vector3::new(off_rad.cos(), off_rad.sin(), 0.0);
            Rotation3::from_axis_angle(&Vector3::x_axis(), around_rad) * tilted
        })
    });
    std::iter::once(Vector3::x()).chain(rings)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::furniture::{Furniture, FurnitureKind};
    use crate::material::Material;
    use crate::random::Random;
    use crate::room::furniture;
    use crate::shape::{Form, Shape};
    use crate::world::{Object, Stage};

    /// A wall of glass at 2 m, turned by so much, and a person at 3 m behind it.
    fn world(kind: FurnitureKind, turned_deg: f64) -> World {
        let heading_deg = 180.0 + turned_deg;
        let piece = Furniture { kind, at: [2.0, 0.0], heading_deg };
        let made = furniture(&piece, 2.8, &mut Random::new(1, 8));
        let form = Form::Ellipsoid(Vector3::repeat(0.3));
        let at = Point3::new(3.3, 0.0, 0.5);
        let ball = Shape::new(form, at, Rotation3::identity(), Material::plain([0.5; 3]));
        let stage = Stage::new(vec![made], Vec::new(), 100.0);
        World::new(&Arc::new(stage), vec![Object::new(vec![ball], Some(1), true)])
    }

    fn sensor(kind: RangeKind, field_of_view_deg: f64) -> RangeSettings {
        RangeSettings {
            name: "front".into(),
            kind,
            mount: [0.2, 0.0, 0.5, 0.0],
            field_of_view_deg,
            sigma_m: 0.0,
            ..RangeSettings::default()
        }
    }

    fn measured(sensor: &RangeSettings, world: &World) -> f64 {
        sensor.measure(world, &Isometry3::identity(), 1).range_m
    }

    #[test]
    fn a_sonar_sees_glass_and_mirrors_and_infrared_goes_through() {
        let glass = world(FurnitureKind::GlassWall, 0.0);
        let sonar = measured(&sensor(RangeKind::Sonar, 30.0), &glass);
        assert!((sonar - 1.8).abs() < 0.02, "{sonar}");
        let infrared = measured(&sensor(RangeKind::Infrared, 4.0), &glass);
        assert!((infrared - 2.8).abs() < 0.02, "{infrared}");
        let mirror = measured(&sensor(RangeKind::Sonar, 30.0), &world(FurnitureKind::Mirror, 0.0));
        assert!((mirror - 1.8).abs() < 0.02, "{mirror}");
    }

    #[test]
    fn a_smooth_wall_sends_the_sound_of_a_narrow_sonar_away() {
        let sonar = sensor(RangeKind::Sonar, 10.0);
        let slanted = measured(&sonar, &world(FurnitureKind::GlassWall, 20.0));
        assert!((1.6..1.9).contains(&slanted), "{slanted}");
        assert_eq!(measured(&sonar, &world(FurnitureKind::GlassWall, 55.0)), f64::INFINITY);
        // The cone of a wide one reaches to where the wall faces it.
        let wide = sensor(RangeKind::Sonar, 80.0);
        assert!(measured(&wide, &world(FurnitureKind::GlassWall, 55.0)).is_finite());
    }

    #[test]
    fn ranges_beyond_the_limits_are_infinite() {
        let glass = world(FurnitureKind::GlassWall, 0.0);
        let short = RangeSettings { max_range_m: 1.5, ..sensor(RangeKind::Sonar, 30.0) };
        assert_eq!(measured(&short, &glass), f64::INFINITY);
        let far = RangeSettings { min_range_m: 2.0, ..sensor(RangeKind::Sonar, 30.0) };
        assert_eq!(measured(&far, &glass), f64::NEG_INFINITY);
    }

    #[test]
    fn a_mount_says_where_a_sensor_looks() {
        let glass = world(FurnitureKind::GlassWall, 0.0);
        let back =
            RangeSettings { mount: [-0.2, 0.0, 0.5, 180.0], ..sensor(RangeKind::Sonar, 30.0) };
        assert_eq!(measured(&back, &glass), f64::INFINITY);
        let turned = Isometry3::rotation(Vector3::z() * PI);
        let range_m = back.measure(&glass, &turned, 1).range_m;
        assert!((range_m - 1.8).abs() < 0.02, "{range_m}");
    }

    #[test]
    fn rays_fill_the_cone() {
        let all: Vec<Vector3<f64>> = rays(0.5).collect();
        assert_eq!(all.len(), 1 + 6 + 12 + 18);
        assert!(all.iter().all(|ray| ray.angle(&Vector3::x()) < 0.25 + 1e-9));
        let widest = all.iter().map(|ray| ray.angle(&Vector3::x())).fold(0.0, f64::max);
        assert!((widest - 0.25).abs() < 1e-9);
    }

    #[test]
    fn sensors_without_a_name_or_with_the_same_are_refused() {
        fn refused(text: &str) -> String {
            Scene::parse(text).unwrap_err().to_string()
        }

        assert!(refused("[[ranges]]\n").contains("needs a name"));
        let twice = "[[ranges]]\nname = \"front\"\n[[bumpers]]\nname = \"front\"\n";
        assert!(refused(twice).contains("are called `front`"));
        let wide = "[[ranges]]\nname = \"front\"\nfield_of_view_deg = 0.0\n";
        assert!(refused(wide).contains("field_of_view_deg"));
        let arc = "[[bumpers]]\nname = \"front\"\narc_deg = [90.0, -90.0]\n";
        assert!(refused(arc).contains("arc_deg"));
        assert!(Scene::parse("[[lasers]]\nname = \"rear\"\nrate_hz = nan\n").is_err());
    }
}
