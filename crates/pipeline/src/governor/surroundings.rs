use nalgebra::{Point2, Point3, Vector3};
use tagalong_core::{Camera, DepthImage, Motion, Person, Track, TrackId};

use super::CorridorSettings;
use super::corridor::{Ahead, ahead, is_thing};

/// Columns of the image that are looked at.
const COLUMNS: usize = 160;
/// Things are remembered to this, m.
const CELL_M: f64 = 0.05;
/// So many points in a cell are no noise.
const ENOUGH: u16 = 3;
/// Depth cameras may see nothing that is nearer, m.
const BLIND_M: f64 = 0.8;
/// What stands in its place for so long is a thing; somebody who walks by is not.
const STANDS_S: f64 = 1.0;
/// From the torso of a person to the head, m.
const TORSO: Vector3<f64> = Vector3::new(0.0, 0.0, 0.35);
/// What people carry, draw along or push is this near to them, m, ...
const CARRIED_M: f64 = 0.8;
/// ... and stays where it is while they are slower than this, m/s.
const STAYS_MPS: f64 = 0.25;
/// What the image shows this far before a place hides the place, m.
const BEFORE_M: f64 = 0.2;

/// What is around the robot: what the depth image shows, and what it showed lately
/// and cannot show now, because it is beside the robot, below the image, too near
/// for the camera, or hidden.
#[derive(Default)]
pub(crate) struct Surroundings {
    seen: Vec<Point3<f64>>,
    /// Part of the image that has depth; `None` without a depth image.
    with_depth: Option<f64>,
    things: Vec<Thing>,
    grid: Grid,
}

/// Something that does not move.
struct Thing {
    /// Robot frame, m.
    at: Point3<f64>,
    /// How long it has been seen, s; the time does not count in which it may have
    /// stood there because of the person who is followed and stood beside it.
    seen_s: f64,
    /// How long it has not been seen, s.
    unseen_s: f64,
    /// Whom it was, if it is somebody: where a track was seen last.
    who: Option<TrackId>,
}

impl Surroundings {
    /// Takes in an image; the robot moved by `motion` since the last one. What is
    /// near the person who is followed is not remembered, nor is what does not stay
    /// where it is.
    pub(crate) fn look(
        &mut self,
        settings: &CorridorSettings,
        camera: &Camera,
        depth: Option<&DepthImage>,
        motion: &Motion,
        target: Option<&Person>,
    ) {
        self.see(settings, camera, depth);
        self.grid.count(settings, &self.seen);
        self.meet_again(settings, camera, depth, motion, target);
        self.remember(settings, target);
    }

    /// Other people who were seen are in the way where that was, until the camera
    /// sees past them or them elsewhere: somebody who steps before the robot is soon
    /// too near to be seen.
    pub(crate) fn meet(&mut self, tracks: &[Track], followed: Option<TrackId>) {
        for track in tracks.iter().filter(|track| track.seen) {
            self.things.retain(|thing| thing.who != Some(track.id));
            if Some(track.id) != followed {
                let at = track.estimate.person.position - TORSO;
                let who = Some(track.id);
                self.things.push(Thing { at, seen_s: STANDS_S, unseen_s: 0.0, who });
            }
        }
    }

    /// Everything was elsewhere.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// What is ahead on an arc, as [`ahead`]; `None` without a depth image.
    pub(crate) fn ahead(
        &self,
        settings: &CorridorSettings,
        curvature: f64,
        target: Option<Point2<f64>>,
    ) -> Option<Ahead> {
        if self.with_depth? < settings.min_seen {
            return Some(Ahead::Blind);
        }
        let seen = self.seen.iter().map(|point| (*point, 1));
        let unseen = self.things.iter().filter(|thing| thing.unseen_s > 0.0);
        let unseen = unseen.map(|thing| (thing.at, settings.min_points));
        Some(ahead(settings, seen.chain(unseen), curvature, target))
    }

    /// Moves the things into the robot's new frame, and forgets where the camera
    /// sees past, what did not stand there for long, and what is out of view for
    /// too long.
    fn meet_again(
        &mut self,
        settings: &CorridorSettings,
        camera: &Camera,
        depth: Option<&DepthImage>,
        motion: &Motion,
        target: Option<&Person>,
    ) {
        let grid = &self.grid;
        self.things.retain_mut(|Thing { at, seen_s, unseen_s, .. }| {
            let moved = motion.apply_to_point(at.xy());
            *at = Point3::new(moved.x, moved.y, at.z);
            if !is_near(settings, at) {
                return false;
            }
            if grid.is_something(at) {
                let carried = target.is_some_and(|person| may_carry(person, at));
                *seen_s += if carried { 0.0 } else { motion.dt };
                *unseen_s = 0.0;
                return true;
            }
            *unseen_s += motion.dt;
            if depth.is_some_and(|depth| is_too_near(camera, depth, at)) {
                *seen_s = STANDS_S;
            }
            let stands = *seen_s >= STANDS_S && *unseen_s <= settings.memory_s;
            stands && !depth.is_some_and(|depth| shows(camera, depth, at))
        });
    }

    fn see(&mut self, settings: &CorridorSettings, camera: &Camera, depth: Option<&DepthImage>) {
        self.seen.clear();
        self.with_depth = depth.map(|depth| {
            let step = depth.width().div_ceil(COLUMNS).max(1);
            let (mut looked, mut read) = (0_u32, 0_u32);
            for y in (0..depth.height()).step_by(step) {
                let row = depth.row(y);
                for x in (0..depth.width()).step_by(step) {
                    looked += 1;
                    let z = f64::from(row[x]);
                    if !(z > 0.0 && z.is_finite()) {
                        continue;
                    }
                    read += 1;
                    let point = camera.back_project(Point2::new(x as f64, y as f64), z);
                    if is_near(settings, &point) && is_thing(settings, &point) {
                        self.seen.push(point);
                    }
                }
            }
            f64::from(read) / f64::from(looked.max(1))
        });
    }

    fn remember(&mut self, settings: &CorridorSettings, target: Option<&Person>) {
        self.things.iter().for_each(|thing| self.grid.clear_around(&thing.at));
        for at in &self.seen {
            let is_of = |person: &Person| far_m(person, at) < settings.target_radius_m;
            if self.grid.is_full(at) && !target.is_some_and(is_of) {
                self.grid.clear_around(at);
                self.things.push(Thing { at: *at, seen_s: 0.0, unseen_s: 0.0, who: None });
            }
        }
    }
}

/// Points in each cell of a grid around the robot, and a border of one cell.
#[derive(Default)]
struct Grid {
    points: Vec<u16>,
    side: usize,
}

impl Grid {
    fn count(&mut self, settings: &CorridorSettings, seen: &[Point3<f64>]) {
        self.side = 2 * (reach_m(settings) / CELL_M).ceil() as usize + 3;
        self.points.clear();
        self.points.resize(self.side * self.side, 0);
        for at in seen {
            let cell = self.cell(at);
            self.points[cell] = self.points[cell].saturating_add(1);
        }
    }

    /// The cell of a place within reach.
    fn cell(&self, at: &Point3<f64>) -> usize {
        let of = |metres: f64| {
            let cell = (metres / CELL_M + self.side as f64 / 2.0) as usize;
            cell.clamp(1, self.side - 2)
        };
        of(at.x) * self.side + of(at.y)
    }

    fn around(&self, at: &Point3<f64>) -> [usize; 9] {
        let (cell, side) = (self.cell(at), self.side);
        std::array::from_fn(|i| cell + (i / 3) * side + i % 3 - side - 1)
    }

    fn is_full(&self, at: &Point3<f64>) -> bool {
        self.points[self.cell(at)] >= ENOUGH
    }

    /// True if there is something here, or one cell away.
    fn is_something(&self, at: &Point3<f64>) -> bool {
        self.around(at).iter().any(|cell| self.points[*cell] >= ENOUGH)
    }

    fn clear_around(&mut self, at: &Point3<f64>) {
        self.around(at).iter().for_each(|cell| self.points[*cell] = 0);
    }
}

/// True if the image shows no depth at this place, which is nearer than cameras see.
fn is_too_near(camera: &Camera, depth: &DepthImage, at: &Point3<f64>) -> bool {
    let seen_m = depth_at(camera, depth, at);
    camera.depth_of(at) < BLIND_M && seen_m.is_some_and(|z| !(z.is_finite() && z > 0.0))
}

/// What the image says at a place, m; `None` outside of the image.
fn depth_at(camera: &Camera, depth: &DepthImage, at: &Point3<f64>) -> Option<f64> {
    let pixel = camera.project(at)?;
    depth.get(pixel.x.round() as i64, pixel.y.round() as i64).map(f64::from)
}

/// True if the image shows this place, or what is behind it.
fn shows(camera: &Camera, depth: &DepthImage, at: &Point3<f64>) -> bool {
    let before_m = camera.depth_of(at) - BEFORE_M;
    depth_at(camera, depth, at).is_some_and(|z| z.is_finite() && z > 0.0 && z > before_m)
}

fn far_m(person: &Person, at: &Point3<f64>) -> f64 {
    nalgebra::distance(&person.position.xy(), &at.xy())
}

fn may_carry(person: &Person, at: &Point3<f64>) -> bool {
    far_m(person, at) < CARRIED_M && person.velocity.norm() < STAYS_MPS
}

fn is_near(settings: &CorridorSettings, at: &Point3<f64>) -> bool {
    at.xy().coords.norm() < reach_m(settings)
}

fn reach_m(settings: &CorridorSettings) -> f64 {
    settings.range_m + settings.front_m
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, Vector2};
    use tagalong_core::{Distortion, Estimate, Pinhole};

    use super::*;

    /// A camera 1 m high that sees 90 degrees across and 67 degrees up and down.
    fn camera() -> Camera {
        let lens = Pinhole { fx: 40.0, fy: 40.0, cx: 39.5, cy: 29.5, distortion: Distortion::None };
        Camera::mounted(lens, 80, 60, 1.0, 0.0, 0.0)
    }

    /// So many frames are enough to know that something stands, at 10 a second.
    const WAIT: usize = 12;

    /// A wall at 6 m and a box 0.4 m wide and 0.6 m high, its front at (x, y).
    fn with_box(x: f64, y: f64) -> DepthImage {
        let camera = camera();
        DepthImage::from_fn(80, 60, |u, v| {
            let at = camera.back_project(Point2::new(u as f64, v as f64), x);
            let hit = (at.y - y).abs() < 0.2 && at.z < 0.6;
            let floor = camera.back_project(Point2::new(u as f64, v as f64), 1.0);
            let floor_m = if floor.z < 1.0 { 1.0 / (1.0 - floor.z) } else { 6.0 };
            if hit && x < floor_m { x as f32 } else { floor_m.min(6.0) as f32 }
        })
    }

    fn person(x: f64, y: f64, forward_mps: f64) -> Person {
        Person { position: Point3::new(x, y, 1.6), velocity: Vector2::new(forward_mps, 0.0) }
    }

    /// Waits before a box at `from_m`, then drives straight towards it, until it is
    /// `to_m` away.
    fn approach(y: f64, from_m: f64, to_m: f64, memory_s: f64, someone: bool) -> Option<Ahead> {
        let settings = CorridorSettings { memory_s, ..CorridorSettings::default() };
        let mut surroundings = Surroundings::default();
        let steps = ((from_m - to_m) / 0.05).round() as usize;
        for step in (0..WAIT).map(|_| 0).chain(1..=steps) {
            let x = from_m - 0.05 * step as f64;
            let forward = if step == 0 { 0.0 } else { 0.05 };
            let motion = Motion { forward, ..Motion::at_rest(0.1) };
            let people = someone.then(|| person(x, y, 0.0));
            let depth = with_box(x, y);
            surroundings.look(&settings, &camera(), Some(&depth), &motion, people.as_ref());
        }
        surroundings.ahead(&settings, 0.0, None)
    }

    fn is_at(ahead: Option<Ahead>, metres: f64) -> bool {
        matches!(ahead, Some(Ahead::Something(at)) if (at - metres).abs() < 0.1)
    }

    #[test]
    fn a_low_thing_that_sank_below_the_image_is_still_there() {
        assert!(is_at(approach(0.0, 1.5, 1.2, 8.0, false), 1.0), "in view");
        let near = approach(0.0, 1.5, 0.5, 8.0, false);
        assert!(is_at(near, 0.3), "{near:?}");
        assert_eq!(approach(0.0, 1.5, 0.5, 0.0, false), Some(Ahead::Free), "without memory");
    }

    #[test]
    fn a_thing_beside_the_robot_is_in_the_way_of_a_bend() {
        let settings = CorridorSettings::default();
        let mut surroundings = Surroundings::default();
        let depth = with_box(1.0, 0.7);
        let still = Motion::at_rest(0.1);
        for _ in 0..WAIT {
            surroundings.look(&settings, &camera(), Some(&depth), &still, None);
        }
        let on = Motion { forward: 0.6, ..still };
        surroundings.look(&settings, &camera(), Some(&with_box(9.0, 0.0)), &on, None);
        assert_eq!(surroundings.ahead(&settings, 0.0, None), Some(Ahead::Free));
        let bend = surroundings.ahead(&settings, 1.2, None);
        assert!(matches!(bend, Some(Ahead::Something(at)) if at < 0.6), "{bend:?}");
    }

    #[test]
    fn people_are_not_remembered_and_what_is_gone_is_forgotten() {
        assert_eq!(approach(0.0, 1.5, 0.5, 8.0, true), Some(Ahead::Free));
        let settings = CorridorSettings::default();
        let mut surroundings = Surroundings::default();
        let mut look = |x| {
            let (depth, still) = (with_box(x, 0.0), Motion::at_rest(0.1));
            surroundings.look(&settings, &camera(), Some(&depth), &still, None);
            surroundings.ahead(&settings, 0.0, None)
        };
        assert!(is_at(look(1.5), 1.3));
        assert_eq!(look(9.0), Some(Ahead::Free));
    }

    /// Somebody whose head is above the image walks through the way, half a metre
    /// before the robot: only the legs were seen, and they are no thing.
    #[test]
    fn who_walks_by_is_not_remembered() {
        let settings = CorridorSettings::default();
        let mut surroundings = Surroundings::default();
        let mut seen = 0;
        for step in 0..=30 {
            let y = -1.5 + 0.1 * f64::from(step);
            let depth = if step < 15 { with_box(1.2, y) } else { with_box(9.0, 0.0) };
            let forward = if step < 15 { 0.0 } else { 0.05 };
            let motion = Motion { forward, ..Motion::at_rest(0.1) };
            surroundings.look(&settings, &camera(), Some(&depth), &motion, None);
            let ahead = surroundings.ahead(&settings, 0.0, None);
            seen += u32::from(matches!(ahead, Some(Ahead::Something(_))));
        }
        assert!(seen >= 3, "{seen}");
        assert_eq!(surroundings.ahead(&settings, 0.0, None), Some(Ahead::Free));
    }

    /// A suitcase stands behind somebody, and is gone with them when the robot is so
    /// near that it would be below the image; a box that they walk past is not.
    #[test]
    fn what_stands_beside_whoever_stands_may_be_carried_away() {
        let settings = CorridorSettings::default();
        for (speed_mps, expected_m) in [(0.0, None), (0.6, Some(0.3))] {
            let mut surroundings = Surroundings::default();
            let person = person(1.7, 0.3, speed_mps);
            let mut look = |x: f64, forward, target: Option<&Person>| {
                let motion = Motion { forward, ..Motion::at_rest(0.1) };
                surroundings.look(&settings, &camera(), Some(&with_box(x, 0.0)), &motion, target);
                surroundings.ahead(&settings, 0.0, None)
            };
            (0..WAIT).for_each(|_| _ = look(1.2, 0.0, Some(&person)));
            let near = look(0.5, 0.7, None);
            let gone = look(9.0, 0.0, None);
            match expected_m {
                None => assert_eq!(gone, Some(Ahead::Free), "{near:?}"),
                Some(metres) => assert!(is_at(gone, metres), "{gone:?}"),
            }
        }
    }

    fn track(x: f64, y: f64) -> Track {
        let region = camera().upper_body(&Point3::new(x, y, 1.6));
        let estimate =
            Estimate { person: person(x, y, 0.0), covariance: SMatrix::identity(), region };
        Track {
            id: TrackId(2),
            estimate,
            seen: true,
            occluded: false,
            confirmed: true,
            age: 9,
            unseen_s: 0.0,
            score: 1.0,
        }
    }

    #[test]
    fn whoever_stepped_before_the_robot_is_there_until_they_are_seen_elsewhere() {
        let settings = CorridorSettings::default();
        let mut surroundings = Surroundings::default();
        let mut look = |forward, seen: Option<Track>, followed| {
            let motion = Motion { forward, ..Motion::at_rest(0.1) };
            let depth = with_box(9.0, 0.0);
            surroundings.look(&settings, &camera(), Some(&depth), &motion, None);
            surroundings.meet(seen.as_slice(), followed);
            surroundings.ahead(&settings, 0.0, None)
        };
        look(0.0, Some(track(0.6, 0.1)), None);
        let near = look(0.3, None, None);
        assert!(matches!(near, Some(Ahead::Something(at)) if at < 0.2), "{near:?}");
        assert_eq!(look(0.0, Some(track(0.5, 0.9)), None), Some(Ahead::Free));
        look(0.0, Some(track(0.3, 0.1)), None);
        assert_eq!(look(0.0, Some(track(0.3, 0.1)), Some(TrackId(2))), Some(Ahead::Free));
    }

    /// The camera sees nothing nearer than half a metre: there the image is empty.
    #[test]
    fn who_came_too_near_to_be_seen_is_still_there() {
        let settings = CorridorSettings::default();
        let mut surroundings = Surroundings::default();
        let mut look = |x: f64, blind: bool| {
            let seen = with_box(x, 0.0);
            let depth = DepthImage::from_fn(80, 60, |u, v| {
                let middle = (30..50).contains(&u);
                if blind && middle { f32::NAN } else { seen.row(v)[u] }
            });
            let motion = Motion::at_rest(0.1);
            surroundings.look(&settings, &camera(), Some(&depth), &motion, None);
            surroundings.ahead(&settings, 0.0, None)
        };
        assert!(is_at(look(0.75, false), 0.55));
        assert!(is_at(look(9.0, true), 0.55), "hidden");
        assert_eq!(look(9.0, false), Some(Ahead::Free), "gone");
    }

    #[test]
    fn without_depth_there_is_nothing_to_say_and_an_empty_image_is_blind() {
        let settings = CorridorSettings::default();
        let mut surroundings = Surroundings::default();
        let still = Motion::at_rest(0.1);
        surroundings.look(&settings, &camera(), None, &still, None);
        assert_eq!(surroundings.ahead(&settings, 0.0, None), None);
        let empty = DepthImage::from_fn(80, 60, |_, _| f32::NAN);
        surroundings.look(&settings, &camera(), Some(&empty), &still, None);
        assert_eq!(surroundings.ahead(&settings, 0.0, None), Some(Ahead::Blind));
    }
}
