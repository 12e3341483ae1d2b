//! A person or a trolley that moves towards the robot and does not avoid it.

use nalgebra::{Isometry2, Point2, Point3, Rotation2, Rotation3, Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

use crate::material::Material;
use crate::obstacle::Obstacle;
use crate::shape::{Form, Shape};
use crate::world::Object;

/// Half the width of a person, m.
const BODY_M: f64 = 0.2;
/// Minimum and maximum distance of the start from the robot, m.
const DISTANCE_M: [f64; 2] = [2.0, 6.0];
/// Distance to the middle of the robot at which the approacher stops, because it touches the robot,
/// m.
const TOUCHES_M: f64 = 0.2;
/// Minimum distance from walls, m.
const WALL_M: f64 = 0.35;
/// Minimum distance from the middle of other people, m.
const PERSON_M: f64 = 0.45;
/// Step of the bearing if there is no room at the wanted one, degrees.
const BEARING_STEP_DEG: f64 = 5.0;
/// Height of a trolley's body above the floor, on wheels, m.
const WHEELS_M: f64 = 0.08;

settings! {
    /// An approach: a person or a trolley appears near the robot and moves towards it.
    pub struct ApproachSettings {
        /// Kind of the approacher: `person` or `trolley`.
        pub by: ApproachBy = ApproachBy::Person,
        /// Time at which it appears and starts to move, s.
        #[schemars(range(min = 0.0, max = 86_400.0))]
        pub start_s: f64 = 2.0,
        /// Direction from the robot to its start, degrees, to the left of the robot's heading at
        /// that time. If a wall is too near, the nearest direction with enough room is taken.
        #[schemars(range(min = -360.0, max = 360.0))]
        pub bearing_deg: f64 = 0.0,
        /// Time in which it would reach a robot at rest, s. The speed times this is the distance of
        /// its start, limited to 2 to 6 m.
        #[schemars(range(min = 0.1, max = 60.0))]
        pub lead_s: f64 = 3.0,
        /// Speed, m/s.
        #[schemars(range(min = 0.05, max = 2.0))]
        pub speed_mps: f64 = 1.0,
        /// If true, it always turns to the robot; otherwise it keeps the direction to the robot's
        /// position at the start.
        pub aims: bool = true,
        /// Body height of a person, m; random if left out.
        #[schemars(range(min = 0.8, max = 2.2))]
        pub height_m: Option<f64>,
        /// Length, width and height of a trolley, m.
        #[schemars(inner(range(min = 0.1, max = 2.0)))]
        pub size_m: [f64; 3] = [0.7, 0.5, 1.0],
    }
}

/// Kind of an approacher.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum ApproachBy {
    /// A person.
    Person,
    /// A box on wheels.
    Trolley,
}

impl ApproachSettings {
    /// Returns the distance from the robot at which the approacher appears, m.
    pub fn distance_m(&self) -> f64 {
        (self.speed_mps * self.lead_s).clamp(DISTANCE_M[0], DISTANCE_M[1])
    }

    /// Returns the time at which the approacher reaches a robot at rest, s.
    pub fn arrives_s(&self) -> f64 {
        self.start_s + self.distance_m() / self.speed_mps
    }
}

/// State of the approacher at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApproachState {
    /// Free distance between the robot and the approacher, m; negative means contact.
    pub gap_m: f64,
    /// Direction of the approacher in the robot frame, rad, positive to the left.
    pub bearing_rad: f64,
    /// Speed over ground, m/s; 0 once it has stopped.
    pub speed_mps: f64,
}

/// Sensors that can see the approacher: it is in their field of view and not hidden.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ApproachInView {
    /// The camera, within the range of its depth.
    pub camera: bool,
    /// The laser scanner.
    pub laser: bool,
}

/// Phase of an approach.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Waits,
    Comes(Vector2<f64>),
    Stands,
}

/// The moving approacher.
#[derive(Clone, Debug)]
pub struct Approacher {
    settings: ApproachSettings,
    phase: Phase,
    /// Position, m.
    pub place: Point2<f64>,
    /// Heading, rad.
    pub heading_rad: f64,
}

/// Surroundings of an approacher.
pub struct Surroundings<'a> {
    /// The robot in the world.
    pub robot: Isometry2<f64>,
    /// Length and width of the room, m.
    pub room_m: [f64; 2],
    /// Furniture.
    pub obstacles: &'a [Obstacle],
    /// Positions of the other people.
    pub people: Vec<Point2<f64>>,
}

impl Approacher {
    /// Creates an approacher that has not appeared yet.
    pub fn new(settings: &ApproachSettings) -> Self {
        Self {
            settings: settings.clone(),
            phase: Phase::Waits,
            place: Point2::origin(),
            heading_rad: 0.0,
        }
    }

    /// Returns the kind of the approacher.
    pub fn by(&self) -> ApproachBy {
        self.settings.by
    }

    /// Returns true once the approacher is in the room.
    pub fn is_there(&self) -> bool {
        self.phase != Phase::Waits
    }

    /// Returns the speed over ground, m/s.
    pub fn speed_mps(&self) -> f64 {
        if let Phase::Comes(_) = self.phase { self.settings.speed_mps } else { 0.0 }
    }

    /// Places the approacher in the room when it is time.
    pub fn appear(&mut self, now_s: f64, around: &Surroundings<'_>) {
        if self.phase != Phase::Waits || now_s < self.settings.start_s {
            return;
        }
        self.place = self.start(around);
        let way = Point2::from(around.robot.translation.vector) - self.place;
        self.phase = Phase::Comes(way.try_normalize(1e-6).unwrap_or_else(Vector2::x));
        self.heading_rad = way.y.atan2(way.x);
    }

    /// Returns the position in the room that is nearest to the wanted bearing and far enough away
    /// from the robot.
    fn start(&self, around: &Surroundings<'_>) -> Point2<f64> {
        let wanted_m = self.settings.distance_m();
        let heading_rad = around.robot.rotation.angle();
        let robot = Point2::from(around.robot.translation.vector);
        let steps = (180.0 / BEARING_STEP_DEG) as i32;
        let mut best = (f64::NEG_INFINITY, robot);
        for step in 0..=2 * steps {
            // 0, 1, -1, 2, -2, ...: the nearest bearing with enough room is found first.
            let turns = if step % 2 == 1 { (step + 1) / 2 } else { -step / 2 };
            let off_rad = (f64::from(turns) * BEARING_STEP_DEG).to_radians();
            let bearing_rad = self.settings.bearing_deg.to_radians() + off_rad;
            let way = Rotation2::new(heading_rad + bearing_rad) * Vector2::x();
            let mut place = within(robot + way * wanted_m, around.room_m);
            place = self.outside(place, around);
            let distance_m = (place - robot).norm();
            if distance_m >= DISTANCE_M[0] {
                return place;
            }
            if distance_m > best.0 {
                best = (distance_m, place);
            }
        }
        best.1
    }

    /// Moves the approacher by a time step.
    pub fn step(&mut self, dt: f64, around: &Surroundings<'_>) {
        let Phase::Comes(ahead) = self.phase else { return };
        let robot = Point2::from(around.robot.translation.vector);
        if self.distance_m(&robot) <= TOUCHES_M {
            self.phase = Phase::Stands;
            return;
        }
        let aimed = (robot - self.place).try_normalize(1e-6).filter(|_| self.settings.aims);
        let way = aimed.unwrap_or(ahead);
        let wanted = self.place + way * (self.settings.speed_mps * dt);
        let place = within(wanted, around.room_m);
        self.heading_rad = way.y.atan2(way.x);
        // An approacher that missed the robot ends at a wall.
        self.phase = if place == wanted { Phase::Comes(way) } else { Phase::Stands };
        self.place = self.outside(place, around);
    }

    /// Returns a position moved out of furniture and other people, so that it slides along their
    /// edges.
    fn outside(&self, place: Point2<f64>, around: &Surroundings<'_>) -> Point2<f64> {
        let half_m = match self.settings.by {
            ApproachBy::Person => 0.0,
            ApproachBy::Trolley => 0.5 * self.settings.size_m[1],
        };
        let people = around.people.iter().map(|at| (*at, PERSON_M));
        let things = around.obstacles.iter().map(|thing| (thing.at, thing.radius_m));
        let mut place = place;
        for (at, radius_m) in people.chain(things) {
            let away = place - at;
            let least_m = radius_m + half_m;
            if let Some(out) = away.try_normalize(1e-6).filter(|_| away.norm() < least_m) {
                place = at + out * least_m;
            }
        }
        place
    }

    /// Returns the distance of the approacher's surface from a point, m; negative inside.
    pub fn distance_m(&self, point: &Point2<f64>) -> f64 {
        let away = point - self.place;
        match self.settings.by {
            ApproachBy::Person => away.norm() - BODY_M,
            ApproachBy::Trolley => {
                let own = Rotation2::new(-self.heading_rad) * away;
                let [length, width, _] = self.settings.size_m;
                let off = own.abs() - Vector2::new(0.5 * length, 0.5 * width);
                off.map(|side| side.max(0.0)).norm() + off.max().min(0.0)
            }
        }
    }

    /// Returns the solids of a trolley on a floor of this height, m.
    pub fn trolley(&self, floor_m: f64) -> Object {
        let [length, width, height] = self.settings.size_m;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.heading_rad);
        let foot = Point3::new(self.place.x, self.place.y, floor_m);
        let above_m = (height - WHEELS_M).max(0.02);
        let half = Vector3::new(length, width, above_m) * 0.5;
        let body = Vector3::new(0.0, 0.0, WHEELS_M + half.z);
        let paint = Material::plain([0.24, 0.27, 0.33]);
        let mut shapes = vec![Shape::new(Form::Block(half), foot + turn * body, turn, paint)];
        let wheel = Form::Ellipsoid(Vector3::repeat(0.5 * WHEELS_M));
        for (x, y) in [(0.4, 0.4), (0.4, -0.4), (-0.4, 0.4), (-0.4, -0.4)] {
            let at = Vector3::new(x * length, y * width, 0.5 * WHEELS_M);
            shapes.push(Shape::new(wheel, foot + turn * at, turn, Material::plain([0.05; 3])));
        }
        Object::new(shapes, None, true)
    }
}

/// Returns the position nearest to a point that keeps the distance from the walls.
fn within(point: Point2<f64>, room_m: [f64; 2]) -> Point2<f64> {
    Point2::new(off_walls(point.x, room_m[0]), off_walls(point.y, room_m[1]))
}

/// Returns the coordinate nearest to this one that keeps the distance from the walls along one side
/// of a room, m.
fn off_walls(at_m: f64, side_m: f64) -> f64 {
    at_m.clamp(WALL_M.min(0.5 * side_m), (side_m - WALL_M).max(0.5 * side_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(robot: Isometry2<f64>) -> Surroundings<'static> {
        Surroundings { robot, room_m: [12.0, 12.0], obstacles: &[], people: Vec::new() }
    }

    fn middle(yaw: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(6.0, 6.0), yaw)
    }

    /// Lets the robot drive along Y from the middle while something approaches; returns the least
    /// distance of its surface from the robot's middle, m.
    fn least_m(settings: &ApproachSettings, robot_mps: f64) -> f64 {
        let mut one = Approacher::new(settings);
        let mut least_m = f64::INFINITY;
        for step in 0..500 {
            let now_s = f64::from(step) * 0.02;
            let mut robot = middle(0.0);
            robot.translation.y += robot_mps * now_s;
            one.appear(now_s, &around(robot));
            one.step(0.02, &around(robot));
            if one.is_there() {
                least_m = least_m.min(one.distance_m(&Point2::from(robot.translation.vector)));
            }
        }
        least_m
    }

    #[test]
    fn an_approacher_appears_at_its_bearing_and_distance() {
        for bearing_deg in [0.0, 77.0, 180.0, 301.0] {
            let settings = ApproachSettings { bearing_deg, ..ApproachSettings::default() };
            let mut one = Approacher::new(&settings);
            one.appear(1.98, &around(middle(0.7)));
            assert!(!one.is_there());
            one.appear(2.0, &around(middle(0.7)));
            let own = middle(0.7).inverse_transform_point(&one.place);
            let off = (own.y.atan2(own.x) - bearing_deg.to_radians()).sin();
            assert!(off.abs() < 1e-9 && (own.coords.norm() - 3.0).abs() < 1e-9, "{own}");
        }
    }

    #[test]
    fn before_a_wall_it_comes_from_the_nearest_side_with_room() {
        let settings = ApproachSettings { bearing_deg: 180.0, ..ApproachSettings::default() };
        let mut one = Approacher::new(&settings);
        let robot = Isometry2::new(Vector2::new(1.0, 6.0), 0.0);
        one.appear(2.0, &around(robot));
        let own = robot.inverse_transform_point(&one.place);
        assert!(own.coords.norm() >= 2.0 && own.x < 0.0 && one.place.x >= WALL_M, "{own}");
    }

    #[test]
    fn it_touches_a_robot_at_rest_and_stands_there() {
        for by in [ApproachBy::Person, ApproachBy::Trolley] {
            let settings = ApproachSettings { by, ..ApproachSettings::default() };
            let least = least_m(&settings, 0.0);
            assert!(least <= TOUCHES_M && least > TOUCHES_M - 0.03, "{by:?}: {least}");
        }
    }

    #[test]
    fn only_one_that_aims_meets_a_robot_that_drives_on() {
        let settings = ApproachSettings { bearing_deg: 20.0, ..ApproachSettings::default() };
        assert!(least_m(&settings, 0.5) <= TOUCHES_M);
        let straight = ApproachSettings { aims: false, ..settings };
        assert!(least_m(&straight, 0.5) > 0.5);
        assert!(least_m(&straight, 0.0) <= TOUCHES_M);
    }

    #[test]
    fn the_surface_of_a_trolley_is_that_of_its_box() {
        let settings = ApproachSettings { by: ApproachBy::Trolley, ..ApproachSettings::default() };
        let mut one = Approacher::new(&settings);
        one.heading_rad = std::f64::consts::FRAC_PI_2;
        for (x, y, wanted_m) in [(0.0, 1.35, 1.0), (1.25, 0.0, 1.0), (0.25 + 0.3, 0.35 + 0.4, 0.5)]
        {
            let away_m = one.distance_m(&Point2::new(x, y));
            assert!((away_m - wanted_m).abs() < 1e-9, "{x} {y}: {away_m}");
        }
        assert!(one.distance_m(&Point2::origin()) < -0.2);
        let shapes = one.trolley(0.0).shapes;
        let top = shapes.iter().map(|s| s.origin.z + s.extent(&Vector3::z())).fold(0.0, f64::max);
        assert!((top - 1.0).abs() < 1e-9, "{top}");
    }

    #[test]
    fn it_goes_along_furniture_and_other_people() {
        let settings = ApproachSettings { bearing_deg: 0.0, ..ApproachSettings::default() };
        let mut one = Approacher::new(&settings);
        let thing = [Obstacle::standing(Point2::new(7.5, 6.05), 0.4)];
        let person = Point2::new(6.9, 5.4);
        for step in 0..600 {
            let around =
                Surroundings { obstacles: &thing, people: vec![person], ..around(middle(0.0)) };
            one.appear(f64::from(step) * 0.02, &around);
            one.step(0.02, &around);
            let free = !one.is_there() || (one.place - thing[0].at).norm() > 0.399;
            assert!(free, "{}", one.place);
        }
        assert!(one.distance_m(&Point2::new(6.0, 6.0)) <= TOUCHES_M, "{}", one.place);
    }
}
