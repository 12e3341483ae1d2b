//! Free distance around the robot, and the approacher of a scene.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use nalgebra::{Isometry3, Point2, Point3, Vector2, Vector3};

use super::{BODY_M, Clearance, FEELERS, FEELERS_M, LEAST_SPOTS, Simulation};
use crate::approach::{ApproachBy, ApproachInView, ApproachState, Approacher, Surroundings};
use crate::footprint::{Gap, Outline};
use crate::shape::Shape;
use crate::slice::Slice;
use crate::world::{self, Object};

/// Directions of rays that measure the distance to objects.
static FEELS: LazyLock<[Vector3<f64>; FEELERS]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let angle = TAU * i as f64 / FEELERS as f64;
        Vector3::new(angle.cos(), angle.sin(), 0.0)
    })
});

impl Simulation {
    /// Returns the free distance around the robot at its present pose: around its footprint, or
    /// around a disc of this radius if the scene has none.
    pub fn clearance(&self, radius_m: f64) -> Clearance {
        let outline = self.outline(radius_m);
        Clearance {
            people_m: least_m(self.gaps_to_people(&outline)),
            things_m: least_m(self.gaps_to_things(&outline)),
        }
    }

    /// Returns the gaps between the robot and people.
    pub(super) fn gaps_to_people(&self, outline: &Outline<'_>) -> impl Iterator<Item = Gap> {
        let robot = Point2::from(self.robot.pose.translation.vector);
        self.present().map(move |(walker, _)| {
            let way = walker.stance.place - robot;
            let direction = way.try_normalize(1e-9).unwrap_or_else(Vector2::x);
            outline.gap(&self.robot.pose, &direction, way.norm(), BODY_M)
        })
    }

    /// Returns the gaps between the robot and furniture and walls, all around it.
    pub(super) fn gaps_to_things(&self, outline: &Outline<'_>) -> impl Iterator<Item = Gap> {
        let robot = Point2::from(self.robot.pose.translation.vector);
        let floor_m = self.scene.room.floor_m(&robot);
        let slices = FEELERS_M.map(|height_m| {
            let solids = self.stage.objects.iter().flat_map(|object| &object.shapes);
            let from = Point3::new(robot.x, robot.y, floor_m + height_m);
            Slice::new(solids, from, &Vector3::z())
        });
        let things = slices.into_iter().flat_map(move |slice| {
            FEELS.iter().map(move |ray| {
                let away_m = slice.first(ray).map_or(f64::INFINITY, |(t, _)| t);
                outline.gap(&self.robot.pose, &ray.xy(), away_m, 0.0)
            })
        });
        let trolleys = self.trolleys().map(move |trolley| {
            let way = trolley.place - robot;
            let direction = way.try_normalize(1e-9).unwrap_or_else(Vector2::x);
            outline.gap(&self.robot.pose, &direction, trolley.distance_m(&robot), 0.0)
        });
        things.chain(trolleys)
    }

    /// Returns the state of the approacher relative to a round robot of this radius; `None` before
    /// it appears, and in a scene without one.
    pub fn approach(&self, radius_m: f64) -> Option<ApproachState> {
        let approacher = self.approacher.as_ref().filter(|one| one.is_there())?;
        let robot = Point2::from(self.robot.pose.translation.vector);
        let own = self.robot.pose.inverse_transform_point(&approacher.place);
        Some(ApproachState {
            gap_m: approacher.distance_m(&robot) - radius_m,
            bearing_rad: own.y.atan2(own.x),
            speed_mps: approacher.speed_mps(),
        })
    }

    /// Returns which of the robot's sensors could see the approacher now.
    pub fn approach_in_view(&self) -> ApproachInView {
        let Some(approacher) = self.approacher.as_ref().filter(|one| one.is_there()) else {
            return ApproachInView::default();
        };
        let mut people = self.world().0.people;
        let of_person = approacher.by() == ApproachBy::Person;
        let own = people.iter().rposition(|object| object.person.is_some() == of_person);
        let Some(own) = own.map(|index| people.remove(index)) else {
            return ApproachInView::default();
        };
        let others: Vec<&Object> = self.stage.objects.iter().chain(&people).collect();
        let pose = self.world_from_robot(0.5);
        ApproachInView {
            camera: self.camera_reaches(&own, &others, &pose),
            laser: self.laser().is_some_and(|laser| laser.reaches(&own, &others, &pose)),
        }
    }

    /// Returns true if the camera sees some of these solids in its image, within the range of its
    /// depth, with nothing in front of them.
    fn camera_reaches(&self, own: &Object, others: &[&Object], pose: &Isometry3<f64>) -> bool {
        let camera = &self.true_camera;
        let settings = &self.scene.camera;
        let eye = pose * camera.robot_from_camera * Point3::origin();
        let spots = own.shapes.iter().flat_map(Shape::spots);
        let seen = spots.filter(|spot| {
            let in_robot = pose.inverse_transform_point(spot);
            let in_camera = camera.robot_from_camera.inverse_transform_point(&in_robot);
            let is_within = (settings.min_depth_m..=settings.max_depth_m).contains(&in_camera.z);
            let size = [camera.width as f64, camera.height as f64];
            let in_image = camera.project_from_camera(&in_camera).is_some_and(|pixel| {
                (0.0..size[0]).contains(&pixel.x) && (0.0..size[1]).contains(&pixel.y)
            });
            let way = spot - eye;
            is_within
                && in_image
                && way.try_normalize(1e-6).is_some_and(|ray| {
                    world::distance(others.iter().copied(), &eye, &ray) > way.norm()
                })
        });
        seen.take(LEAST_SPOTS).count() == LEAST_SPOTS
    }

    /// Returns true if the last of the walkers is the approacher.
    pub(super) fn person_approaches(&self) -> bool {
        self.approacher.as_ref().is_some_and(|one| one.by() == ApproachBy::Person)
    }

    /// Returns the approacher if it is a trolley in the room.
    pub(super) fn trolleys(&self) -> impl Iterator<Item = &Approacher> {
        let there = self.approacher.iter().filter(|one| one.is_there());
        there.filter(|one| one.by() == ApproachBy::Trolley)
    }

    /// Lets the approacher appear when it is time.
    pub(super) fn appear(&mut self, now_s: f64) {
        self.move_approacher(0.0, |approacher, around| approacher.appear(now_s, around));
    }

    /// Moves the approacher by a time step.
    pub(super) fn approach_robot(&mut self, dt: f64) {
        self.move_approacher(dt, |approacher, around| approacher.step(dt, around));
    }

    /// Moves the approacher, and the walker that is its body.
    fn move_approacher(&mut self, dt: f64, by: impl FnOnce(&mut Approacher, &Surroundings<'_>)) {
        let others = self.walkers.len() - usize::from(self.person_approaches());
        let now_s = self.now_ns as f64 * 1e-9;
        let Some(approacher) = &mut self.approacher else { return };
        let there = self.walkers[..others].iter().filter(|walker| walker.is_there(now_s));
        let around = Surroundings {
            robot: self.robot.pose,
            room_m: self.scene.room.size_m,
            obstacles: &self.obstacles,
            people: there.map(|walker| walker.stance.place).collect(),
        };
        by(approacher, &around);
        if let Some(body) = self.walkers.get_mut(others).filter(|_| approacher.is_there()) {
            let speed_mps = approacher.speed_mps();
            body.carry(approacher.place, approacher.heading_rad, speed_mps, dt);
        }
    }

    /// Returns the robot's forward speed over ground, m/s.
    pub fn speed_mps(&self) -> f64 {
        self.robot.speed_mps()
    }

    /// Returns the robot's turn rate, rad/s.
    pub fn turn_rate(&self) -> f64 {
        self.robot.turn_rate()
    }
}

/// Returns the least of the distances, m; infinite without any.
fn least_m(gaps: impl Iterator<Item = Gap>) -> f64 {
    gaps.map(|gap| gap.distance_m).fold(f64::INFINITY, f64::min)
}
