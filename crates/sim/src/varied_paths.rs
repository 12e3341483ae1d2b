//! Paths of the followed person that differ from seed to seed, so that rides of a scene do not all
//! have the same path with different noise.

use tagalong_math::fingerprint;

use crate::random::Random;
use crate::scene::{RobotSettings, Scene};
use crate::split::Split;

/// Distance from furniture within which a way-point is not moved, m, because it leads through a
/// doorway or around a corner.
const FURNITURE_M: f64 = 1.0;
/// Minimum distance of a moved way-point from walls, and from the start of the robot, m.
const WALL_M: f64 = 0.5;
const ROBOT_M: f64 = 0.9;
/// Number of positions that are tried before a way-point keeps its own.
const TRIES: usize = 20;

impl Scene {
    /// Returns the scene with the paths for its seed, and without the settings of the variation.
    pub(crate) fn with_varied_paths(mut self) -> Self {
        let variation = std::mem::take(&mut self.variation);
        if variation.is_off() {
            return self;
        }
        let mut random = Random::new(self.seed, fingerprint("variation".bytes()) | 1 << 63);
        let is_mirrored = random.chance(0.5);
        if variation.path_jitter_m > 0.0 {
            self.jitter_first_path(variation.path_jitter_m, &mut random);
        }
        if variation.mirror && is_mirrored {
            self.mirror();
        }
        self
    }

    /// Moves the way-points of the first person.
    fn jitter_first_path(&mut self, jitter_m: f64, random: &mut Random) {
        let Some(mut person) = self.people.first().cloned() else { return };
        for point in &mut person.path {
            if self.is_near_furniture(*point) {
                continue;
            }
            for _ in 0..TRIES {
                let moved = point.map(|value| value + self.shift_m(jitter_m, random));
                if self.is_free_for_path(moved) {
                    *point = moved;
                    break;
                }
            }
        }
        self.people[0] = person;
    }

    /// Returns a shift that occurs in no other split, m.
    fn shift_m(&self, jitter_m: f64, random: &mut Random) -> f64 {
        jitter_m * (2.0 * Split::of(self.seed).share(random.uniform()) - 1.0)
    }

    fn is_near_furniture(&self, point: [f64; 2]) -> bool {
        self.furniture.iter().any(|piece| distance_m(piece.at, point) < FURNITURE_M)
    }

    fn is_free_for_path(&self, point: [f64; 2]) -> bool {
        let is_inside = (0..2).all(|k| (WALL_M..=self.room.size_m[k] - WALL_M).contains(&point[k]));
        is_inside
            && !self.is_near_furniture(point)
            && distance_m(self.robot.start, point) >= ROBOT_M
    }

    /// Mirrors the scene from left to right.
    fn mirror(&mut self) {
        let width_m = self.room.size_m[1];
        let RobotSettings { start, path, heading_deg, .. } = &mut self.robot;
        let of_people = self.people.iter_mut().flat_map(|person| &mut person.path);
        let of_furniture = self.furniture.iter_mut().map(|piece| &mut piece.at);
        for point in of_people.chain(of_furniture).chain(path).chain([start]) {
            point[1] = width_m - point[1];
        }
        for person in &mut self.people {
            person.offset[1] = -person.offset[1];
            person.heading_deg = person.heading_deg.map(|heading_deg| -heading_deg);
            person.spin_deg_per_s = -person.spin_deg_per_s;
        }
        for piece in &mut self.furniture {
            piece.heading_deg = -piece.heading_deg;
        }
        *heading_deg = -*heading_deg;
        if let Some(approach) = &mut self.approach {
            approach.bearing_deg = -approach.bearing_deg;
        }
    }
}

fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Variant;

    const TEXT: &str = "
[room]
size_m = [12.0, 10.0]
[robot]
start = [1.0, 2.0]
heading_deg = 30.0
[[furniture]]
kind = 'doorway'
at = [7.0, 6.0]
heading_deg = 90.0
[[people]]
path = [[3.0, 2.0], [6.0, 2.0], [7.0, 6.0], [11.4, 9.4]]
[[people]]
path = [[5.0, 4.0]]
heading_deg = 45.0
offset = [0.1, 0.2]
";

    fn scene(split: Split, number: u64, jitter_m: f64, mirror: bool) -> Scene {
        let variant = Variant::of_split(split, number)
            .with("variation.path_jitter_m", format!("{jitter_m:?}"))
            .with("variation.mirror", mirror);
        Scene::parse_with(TEXT, &variant).unwrap()
    }

    fn plain(number: u64) -> Scene {
        Scene::parse_with(TEXT, &Variant::of_split(Split::Test, number)).unwrap()
    }

    #[test]
    fn without_variation_the_scene_is_as_before() {
        assert_eq!(scene(Split::Test, 3, 0.0, false), plain(3));
        let text = toml::to_string(&scene(Split::Test, 3, 0.3, true)).unwrap();
        assert!(!text.contains("variation"), "a varied scene is not varied again: {text}");
        assert_eq!(Scene::parse(&text).unwrap(), scene(Split::Test, 3, 0.3, true));
    }

    #[test]
    fn way_points_move_off_furniture_alone_and_stay_in_the_room() {
        let before = plain(0);
        for number in 0..50 {
            let varied = scene(Split::Test, number, 0.3, false);
            let path = &varied.people[0].path;
            for (point, old) in path.iter().zip(&before.people[0].path) {
                let off_m = [0, 1].map(|k| (point[k] - old[k]).abs());
                assert!(off_m.iter().all(|off_m| *off_m <= 0.3), "{path:?}");
            }
            assert_ne!(path[0], before.people[0].path[0]);
            assert_eq!(path[2], [7.0, 6.0], "the doorway");
            assert!(path[3][0] <= 11.5 && path[3][1] <= 9.5, "{path:?}");
            assert_eq!(varied.people[1], before.people[1]);
            assert_eq!(varied.robot, before.robot);
            assert_ne!(path, &scene(Split::Test, number + 50, 0.3, false).people[0].path);
            let train = scene(Split::Train, number, 0.3, false);
            assert_ne!(path[0], train.people[0].path[0], "another split");
        }
    }

    #[test]
    fn half_of_the_seeds_are_mirrored_as_a_whole() {
        fn is_mirrored(scene: &Scene) -> bool {
            scene.robot.start == [1.0, 8.0]
        }

        let all: Vec<Scene> = (0..100).map(|k| scene(Split::Test, k, 0.0, true)).collect();
        let mirrored = all.iter().filter(|scene| is_mirrored(scene)).count();
        assert!((35..=65).contains(&mirrored), "{mirrored}");
        let one = all.iter().find(|scene| is_mirrored(scene)).unwrap();
        assert_eq!(one.robot.heading_deg, -30.0);
        assert_eq!((one.furniture[0].at, one.furniture[0].heading_deg), ([7.0, 4.0], -90.0));
        assert_eq!(one.people[0].path[1], [6.0, 8.0]);
        let other = &one.people[1];
        assert_eq!((other.heading_deg, other.offset), (Some(-45.0), [0.1, -0.2]));
    }

    #[test]
    fn impossible_variations_are_refused() {
        for text in [
            "[variation]\npath_jitter_m = 3.0",
            "[variation]\nmirror = true\n[light.day]\nwindows = 2",
        ] {
            let error = Scene::parse(text).unwrap_err().to_string();
            assert!(error.contains("variation."), "{error}");
        }
    }
}
