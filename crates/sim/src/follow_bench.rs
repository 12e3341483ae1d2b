//! Scenes of Follow-Bench, a benchmark for robots that follow a person among people: H. Ye et al.,
//! Follow-Bench: A unified motion planning benchmark for socially-aware robot person following,
//! arXiv 2509.10796. Layouts and speeds are those of the published scenes; the positions of people
//! and obstacles are drawn by the seed.

use std::f64::consts::{PI, TAU};

use nalgebra::Point2;
use tagalong_math::fingerprint;

use crate::bench_setting::{BenchSetting, FollowBench};
use crate::crowd::{Block, CrowdSettings};
use crate::random::Random;
use crate::scene::{AtEnd, PersonSettings, Scene};

/// Radius of the circle on which a circular crowd stands, m.
const CIRCLE_M: f64 = 5.0;
/// Minimum distance between neighbours along the circle, m.
const BESIDE_M: f64 = 0.7;
/// Minimum distance between people at the start, and from their points to blocks, m.
const APART_M: f64 = 0.8;
const OFF_BLOCK_M: f64 = 0.6;
/// Gap between obstacles of the clutter, wide enough for people and the robot, m.
const BETWEEN_M: f64 = 1.6;
/// Thickness of the walls of a corridor, and of the wall with the doorway, m.
const SIDE_M: f64 = 2.2;
const DOOR_WALL_M: f64 = 0.4;
/// Sides of the obstacles of the clutter, m.
const OBSTACLE_M: [f64; 2] = [0.75, 2.0];
/// Number of points to which a person in the clutter walks in turn.
const GOALS: usize = 20;
/// Number of positions that are tried before the last one is taken.
const TRIES: usize = 1000;
/// Outline of the benchmark's robot, m.
const FOOTPRINT_M: [[f64; 2]; 4] = [[0.35, 0.275], [-0.35, 0.275], [-0.35, -0.275], [0.35, -0.275]];
/// Distance of the robot behind the target at the start, m.
const BEHIND_M: f64 = 1.3;

impl Scene {
    /// Returns the scene with the layout and the people of its table `follow_bench`, and without that
    /// table.
    pub(crate) fn with_follow_bench(mut self) -> Self {
        let Some(bench) = self.follow_bench.take() else { return self };
        let random = Random::new(self.seed, fingerprint("follow-bench".bytes()) | 1 << 63);
        let mut maker = Maker { bench, random, scene: self };
        match maker.bench.setting {
            BenchSetting::Circular => maker.circular(),
            BenchSetting::Corridor => maker.corridor(),
            BenchSetting::Crossing => maker.crossing(),
            BenchSetting::Doorway => maker.doorway(),
            BenchSetting::Clutter => maker.clutter(),
        }
        maker.scene
    }
}

/// Builder of one scene.
struct Maker {
    bench: FollowBench,
    random: Random,
    scene: Scene,
}

/// Part of a room, from its lowest to its highest coordinates, m.
type Area = [[f64; 2]; 2];

impl Maker {
    /// Sets the room, the path of the target and the robot behind it.
    fn start(&mut self, size_m: [f64; 2], target: [[f64; 2]; 2], walk: (f64, f64)) {
        let (safe_distance_m, reached_m) = walk;
        let [from, to] = target;
        let scene = &mut self.scene;
        scene.room.size_m = size_m;
        scene.reacting = CrowdSettings { safe_distance_m, reached_m, ..CrowdSettings::default() };
        // Along the corridor or through the doorway, as in the published scenes.
        let is_along = (to[0] - from[0]).abs() > (to[1] - from[1]).abs();
        let ahead = if is_along { [BEHIND_M, 0.0] } else { [0.0, BEHIND_M] };
        scene.robot.start = [from[0] - ahead[0], from[1] - ahead[1]];
        scene.robot.heading_deg = if is_along { 0.0 } else { 90.0 };
        if scene.robot.footprint.is_empty() {
            scene.robot.footprint = FOOTPRINT_M.to_vec();
        }
        self.add_person(target.to_vec(), AtEnd::Stop);
    }

    fn add_person(&mut self, path: Vec<[f64; 2]>, at_end: AtEnd) {
        let walk = self.bench.walk;
        let person = PersonSettings { path, at_end, walk, speed_mps: 1.5, ..Default::default() };
        self.scene.people.push(person);
    }

    fn add_block(&mut self, at: [f64; 2], size_m: [f64; 2]) {
        self.scene.blocks.push(Block { at, size_m, heading_deg: 0.0 });
    }

    fn width_m(&self, usual_m: f64) -> f64 {
        self.bench.width_m.unwrap_or(usual_m)
    }

    /// Returns a random point of an area that is not in a block.
    fn point(&mut self, area: &Area) -> [f64; 2] {
        self.point_that(area, |_, _| true)
    }

    /// Returns a random point of an area that is not in a block and not near the start of anyone
    /// else.
    fn start_point(&mut self, area: &Area) -> [f64; 2] {
        self.point_that(area, |scene, point| {
            let starts = scene.people.iter().map(|person| person.path[0]);
            starts.chain([scene.robot.start]).all(|start| distance_m(start, point) > APART_M)
        })
    }

    fn point_that(&mut self, area: &Area, is_good: impl Fn(&Scene, [f64; 2]) -> bool) -> [f64; 2] {
        let mut point = [0.0; 2];
        for _ in 0..TRIES {
            let [low, high] = area;
            point = [0, 1].map(|axis| self.random.between(low[axis], high[axis]));
            let at = Point2::from(point);
            let is_off = self.scene.blocks.iter().all(|block| block.gap_m(&at) > OFF_BLOCK_M);
            if is_off && is_good(&self.scene, point) {
                break;
            }
        }
        point
    }

    fn circular(&mut self) {
        fn at(angle: f64) -> [f64; 2] {
            [15.0 + CIRCLE_M * angle.cos(), 15.0 + CIRCLE_M * angle.sin()]
        }

        self.start([30.0, 30.0], [[8.0, 15.0], [28.0, 15.0]], (0.5, 2.0));
        let people = self.bench.people;
        // Uniform on the circle under the condition that neighbours keep the distance: the rest of
        // the circle is divided at random, and then the gaps are inserted.
        let apart_rad = BESIDE_M.min(TAU * CIRCLE_M / people.max(1) as f64) / CIRCLE_M;
        let rest_rad = TAU - apart_rad * people as f64;
        let turn_rad = self.random.between(0.0, TAU);
        let mut shares: Vec<f64> =
            (0..people).map(|_| self.random.between(0.0, rest_rad)).collect();
        shares.sort_by(f64::total_cmp);
        for (i, share) in shares.into_iter().enumerate() {
            let angle = turn_rad + share + apart_rad * i as f64;
            self.add_person(vec![at(angle), at(angle + PI)], AtEnd::Return);
        }
    }

    fn corridor(&mut self) {
        let width_m = self.width_m(5.6);
        let across_m = width_m + 2.0 * SIDE_M;
        let middle = 0.5 * across_m;
        for at in [0.5 * SIDE_M, across_m - 0.5 * SIDE_M] {
            self.add_block([20.0, at], [40.0, SIDE_M]);
        }
        self.start([40.0, across_m], [[8.0, middle], [38.5, middle]], (0.5, 2.0));
        let sides = [SIDE_M + 0.8, across_m - SIDE_M - 0.8];
        let near: Area = [[3.0, sides[0]], [15.0, sides[1]]];
        let far: Area = [[24.0, sides[0]], [33.0, sides[1]]];
        for _ in 0..self.bench.people {
            let is_ahead = self.random.chance(0.5);
            let [from, to] = if is_ahead { [near, far] } else { [far, near] };
            let path = vec![self.start_point(&from), self.point(&to)];
            self.add_person(path, AtEnd::Return);
        }
    }

    fn crossing(&mut self) {
        let width_m = self.width_m(4.8);
        let side_m = 0.5 * (40.0 - width_m);
        for x in [0.5 * side_m, 40.0 - 0.5 * side_m] {
            for y in [0.5 * side_m, 40.0 - 0.5 * side_m] {
                self.add_block([x, y], [side_m, side_m]);
            }
        }
        self.start([40.0, 40.0], [[8.0, 20.0], [38.5, 20.0]], (0.4, 2.0));
        let half_m = 0.5 * width_m - 0.8;
        let around = [20.0 - half_m, 20.0 + half_m];
        let arms: [Area; 4] = [
            [[4.0, around[0]], [13.0, around[1]]],
            [[27.0, around[0]], [36.0, around[1]]],
            [[around[0], 4.0], [around[1], 13.0]],
            [[around[0], 27.0], [around[1], 36.0]],
        ];
        let middle: Area = [[around[0]; 2], [around[1]; 2]];
        for _ in 0..self.bench.people {
            let from = self.random.below(4) as usize;
            let to = (from + 1 + self.random.below(3) as usize) % 4;
            let path =
                vec![self.start_point(&arms[from]), self.point(&middle), self.point(&arms[to])];
            self.add_person(path, AtEnd::Return);
        }
    }

    fn doorway(&mut self) {
        let wall_m = 0.5 * (40.0 - self.width_m(2.8));
        for x in [0.5 * wall_m, 40.0 - 0.5 * wall_m] {
            self.add_block([x, 10.0], [wall_m, DOOR_WALL_M]);
        }
        let target = [5.0, 16.0].map(|y| [self.random.between(10.0, 31.0), y]);
        self.start([40.0, 20.0], target, (0.4, 1.0));
        // Through the doorway, whatever the motion along the wall is.
        let [x, y] = self.scene.people[0].path[0];
        self.scene.robot.start = [x, y - BEHIND_M];
        self.scene.robot.heading_deg = 90.0;
        for _ in 0..self.bench.people {
            let from = self.start_point(&[[10.0, 4.5], [31.0, 5.5]]);
            let to = self.point(&[[10.0, 15.5], [31.0, 16.5]]);
            self.add_person(vec![from, to], AtEnd::Stop);
        }
    }

    fn clutter(&mut self) {
        let target = [[8.0, 15.0], [28.0, 15.0]];
        self.start([30.0, 30.0], target, (0.5, 2.0));
        let keep_free = [target[0], target[1], self.scene.robot.start];
        for _ in 0..self.bench.obstacles {
            let size_m = [0, 1].map(|_| self.random.between(OBSTACLE_M[0], OBSTACLE_M[1]));
            let reach_m = 0.5 * size_m[0].hypot(size_m[1]);
            let at = self.point_that(&[[2.5; 2], [27.5; 2]], |scene, point| {
                let place = Point2::from(point);
                let is_off =
                    scene.blocks.iter().all(|block| block.gap_m(&place) > reach_m + BETWEEN_M);
                is_off && keep_free.iter().all(|free| distance_m(*free, point) > reach_m + 1.0)
            });
            let place = Point2::from(at);
            // If the last try is too near to another block, the obstacle is left out.
            if self.scene.blocks.iter().all(|block| block.gap_m(&place) > reach_m) {
                self.add_block(at, size_m);
            }
        }
        let room: Area = [[1.5; 2], [28.5; 2]];
        for _ in 0..self.bench.people {
            let mut path = vec![self.start_point(&room)];
            path.extend((1..GOALS).map(|_| self.point(&room)));
            self.add_person(path, AtEnd::Return);
        }
    }
}

fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Split, Variant};

    const SETTINGS: [(&str, usize); 5] =
        [("circular", 30), ("corridor", 28), ("crossing", 26), ("doorway", 14), ("clutter", 40)];

    fn scene(setting: &str, people: usize, number: u64) -> Scene {
        let variant = Variant::of_split(Split::Test, number)
            .with("follow_bench.setting", setting)
            .with("follow_bench.people", people);
        Scene::parse_with("[camera]\nwidth = 8\nheight = 8\n", &variant).unwrap()
    }

    #[test]
    fn every_setting_has_its_people_apart_and_off_blocks() {
        for (setting, people) in SETTINGS {
            for number in 0..5 {
                let scene = scene(setting, people, number);
                assert_eq!(scene.people.len(), people + 1, "{setting}");
                assert_eq!(scene, self::scene(setting, people, number), "{setting}: by seed");
                assert_ne!(scene.people, self::scene(setting, people, number + 9).people);
                let starts: Vec<[f64; 2]> = scene.people.iter().map(|one| one.path[0]).collect();
                for (i, start) in starts.iter().enumerate() {
                    let others = starts[..i].iter().map(|other| distance_m(*other, *start));
                    let least_m = others.fold(f64::INFINITY, f64::min);
                    assert!(least_m > 0.6, "{setting} {number}: {least_m}");
                }
                for point in scene.people.iter().flat_map(|person| &person.path) {
                    let at = Point2::from(*point);
                    let is_inside =
                        (0..2).all(|k| (0.3..scene.room.size_m[k] - 0.3).contains(&point[k]));
                    let is_off = scene.blocks.iter().all(|block| block.gap_m(&at) > 0.3);
                    assert!(is_inside && is_off, "{setting} {number}: {point:?}");
                }
            }
        }
    }

    #[test]
    fn layouts_are_those_of_the_published_scenes() {
        fn block(at: [f64; 2], size_m: [f64; 2]) -> Block {
            Block { at, size_m, heading_deg: 0.0 }
        }

        fn near(a: &Block, b: &Block) -> bool {
            distance_m(a.at, b.at) < 1e-9 && distance_m(a.size_m, b.size_m) < 1e-9
        }

        let corridor = scene("corridor", 4, 1);
        let corridor_blocks = [block([20.0, 1.1], [40.0, 2.2]), block([20.0, 8.9], [40.0, 2.2])];
        assert!(corridor.blocks.iter().zip(&corridor_blocks).all(|(a, b)| near(a, b)));
        assert!(distance_m(corridor.robot.start, [6.7, 5.0]) < 1e-9);
        let crossing = scene("crossing", 2, 1);
        assert!(near(&crossing.blocks[0], &block([8.8, 8.8], [17.6, 17.6])));
        let doorway = scene("doorway", 2, 1);
        assert!(near(&doorway.blocks[1], &block([30.7, 10.0], [18.6, 0.4])));
        assert_eq!(doorway.robot.heading_deg, 90.0);
        let circle = scene("circular", 10, 1);
        for person in &circle.people[1..] {
            let middle = [0, 1].map(|k| 0.5 * (person.path[0][k] + person.path[1][k]));
            assert!(distance_m(middle, [15.0, 15.0]) < 1e-9);
            assert!((distance_m(person.path[0], middle) - CIRCLE_M).abs() < 1e-9);
        }
    }

    #[test]
    fn a_made_scene_is_not_made_again_and_impossible_ones_are_refused() {
        let made = scene("clutter", 5, 3);
        assert!(made.blocks.len() > 15 && made.follow_bench.is_none(), "{}", made.blocks.len());
        let text = toml::to_string(&made).unwrap();
        assert_eq!(Scene::parse(&text).unwrap(), made);
        for text in [
            "[follow_bench]\npeople = 41",
            "[follow_bench]\nwidth_m = 0.5",
            "[follow_bench]\n[[people]]\nwander = 2",
        ] {
            let error = Scene::parse(text).unwrap_err().to_string();
            assert!(error.contains("follow_bench"), "{error}");
        }
    }
}
