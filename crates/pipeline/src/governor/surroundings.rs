use nalgebra::{Point2, Point3};
use tagalong_core::{Camera, DepthImage, Motion};

use super::CorridorSettings;
use super::corridor::{Ahead, ahead, is_thing};

/// Columns of the image that are looked at.
const COLUMNS: usize = 160;
/// Things are remembered to this, m.
const CELL_M: f64 = 0.05;
/// So many points in a cell are no noise.
const ENOUGH: u16 = 3;
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
    remembered: Vec<Thing>,
    /// Points in each cell of a grid around the robot.
    cells: Vec<u16>,
}

/// Something that was seen; robot frame, m.
struct Thing {
    at: Point3<f64>,
    ago_s: f64,
}

impl Surroundings {
    /// Takes in an image; the robot moved by `motion` since the last one. What is
    /// near somebody, robot frame, m, moves and is not remembered.
    pub(crate) fn look(
        &mut self,
        settings: &CorridorSettings,
        camera: &Camera,
        depth: Option<&DepthImage>,
        motion: &Motion,
        people: impl Iterator<Item = Point2<f64>> + Clone,
    ) {
        self.forget(settings, camera, depth, motion);
        self.see(settings, camera, depth);
        self.remember(settings, people);
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
        let remembered = self.remembered.iter().map(|thing| (thing.at, settings.min_points));
        Some(ahead(settings, seen.chain(remembered), curvature, target))
    }

    /// Moves what is remembered into the robot's new frame. What the camera sees
    /// again, or sees past, need not be remembered.
    fn forget(
        &mut self,
        settings: &CorridorSettings,
        camera: &Camera,
        depth: Option<&DepthImage>,
        motion: &Motion,
    ) {
        self.remembered.retain_mut(|Thing { at, ago_s }| {
            let moved = motion.apply_to_point(at.xy());
            *at = Point3::new(moved.x, moved.y, at.z);
            *ago_s += motion.dt;
            let is_seen = depth.is_some_and(|depth| shows(camera, depth, at));
            *ago_s <= settings.memory_s && is_near(settings, at) && !is_seen
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

    fn remember(
        &mut self,
        settings: &CorridorSettings,
        people: impl Iterator<Item = Point2<f64>> + Clone,
    ) {
        let side = 2 * (reach_m(settings) / CELL_M).ceil() as usize + 1;
        let cell = |at: &Point3<f64>| {
            let of = |metres: f64| (metres / CELL_M + side as f64 / 2.0) as usize;
            of(at.x).min(side - 1) * side + of(at.y).min(side - 1)
        };
        self.cells.clear();
        self.cells.resize(side * side, 0);
        self.remembered.iter().for_each(|thing| self.cells[cell(&thing.at)] = ENOUGH);
        for at in &self.seen {
            let points = &mut self.cells[cell(at)];
            *points = points.saturating_add(1);
            let near = |person| nalgebra::distance(&at.xy(), &person) < settings.target_radius_m;
            if *points == ENOUGH && !people.clone().any(near) {
                self.remembered.push(Thing { at: *at, ago_s: 0.0 });
            }
        }
    }
}

/// True if the image shows this place, or what is behind it.
fn shows(camera: &Camera, depth: &DepthImage, at: &Point3<f64>) -> bool {
    let seen_m = camera.project(at).and_then(|pixel| {
        let (x, y) = (pixel.x.round(), pixel.y.round());
        depth.get(x as i64, y as i64)
    });
    seen_m.is_some_and(|z| {
        let z = f64::from(z);
        z.is_finite() && z > 0.0 && z > camera.depth_of(at) - BEFORE_M
    })
}

fn is_near(settings: &CorridorSettings, at: &Point3<f64>) -> bool {
    at.xy().coords.norm() < reach_m(settings)
}

fn reach_m(settings: &CorridorSettings) -> f64 {
    settings.range_m + settings.front_m
}

#[cfg(test)]
mod tests {
    use tagalong_core::{Distortion, Pinhole};

    use super::*;

    /// A camera 1 m high that sees 90 degrees across and 67 degrees up and down.
    fn camera() -> Camera {
        let lens = Pinhole { fx: 40.0, fy: 40.0, cx: 39.5, cy: 29.5, distortion: Distortion::None };
        Camera::mounted(lens, 80, 60, 1.0, 0.0, 0.0)
    }

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

    /// Drives straight towards a box at `from_m`, and on until it is `to_m` away.
    fn approach(y: f64, from_m: f64, to_m: f64, memory_s: f64, someone: bool) -> Option<Ahead> {
        let settings = CorridorSettings { memory_s, ..CorridorSettings::default() };
        let mut surroundings = Surroundings::default();
        let steps = ((from_m - to_m) / 0.05).round() as usize;
        for step in 0..=steps {
            let x = from_m - 0.05 * step as f64;
            let forward = if step == 0 { 0.0 } else { 0.05 };
            let motion = Motion { forward, ..Motion::at_rest(0.1) };
            let people = someone.then_some(Point2::new(x, y));
            let depth = with_box(x, y);
            surroundings.look(&settings, &camera(), Some(&depth), &motion, people.into_iter());
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
        surroundings.look(&settings, &camera(), Some(&depth), &still, std::iter::empty());
        let on = Motion { forward: 0.6, ..still };
        surroundings.look(&settings, &camera(), Some(&with_box(9.0, 0.0)), &on, std::iter::empty());
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
            surroundings.look(&settings, &camera(), Some(&depth), &still, std::iter::empty());
            surroundings.ahead(&settings, 0.0, None)
        };
        assert!(is_at(look(1.5), 1.3));
        assert_eq!(look(9.0), Some(Ahead::Free));
    }

    #[test]
    fn without_depth_there_is_nothing_to_say_and_an_empty_image_is_blind() {
        let settings = CorridorSettings::default();
        let mut surroundings = Surroundings::default();
        let still = Motion::at_rest(0.1);
        surroundings.look(&settings, &camera(), None, &still, std::iter::empty());
        assert_eq!(surroundings.ahead(&settings, 0.0, None), None);
        let empty = DepthImage::from_fn(80, 60, |_, _| f32::NAN);
        surroundings.look(&settings, &camera(), Some(&empty), &still, std::iter::empty());
        assert_eq!(surroundings.ahead(&settings, 0.0, None), Some(Ahead::Blind));
    }
}
