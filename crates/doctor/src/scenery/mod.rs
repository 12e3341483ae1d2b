//! Objects that appear or disappear in the depth images of a log, independent of any pipeline.
//!
//! A point has come or gone if other views of the log look through its position. Furniture and
//! walls are there all the time; people are not, except those that never move. The odometry
//! compensates ego-motion, so that logs of a driving robot can be judged, too.

mod plan;
#[cfg(test)]
pub mod testing;
mod view;

use std::ops::RangeInclusive;

use nalgebra::{Point2, Point3};
pub use plan::{Blob, Plan};
use tagalong_geometry::{HALF_HEAD_M, Rect};
use tagalong_log::LogFrame;
use view::{Look, View};

/// Largest number of views that are kept, about 100 kB each.
const MOST_VIEWS: u64 = 400;

/// Number of views with which each view is compared.
const COMPARED: usize = 24;

/// Largest time between two views that are compared, s, because odometry drifts.
const COMPARED_S: f64 = 30.0;

/// Heights of the points that are used, m: those of people, without floor and ceiling.
const HEIGHTS_M: RangeInclusive<f64> = 0.5..=2.1;

/// Number and share of views through a point from which it has changed.
const MIN_THROUGH: u32 = 2;
const MIN_SHARE: f64 = 0.3;

/// Reduced depth images of a log.
pub struct Views {
    every: u64,
    views: Vec<View>,
}

/// Classified depth images of a log.
#[derive(Default)]
pub struct Scenery {
    /// One image for each view, in the order of time.
    pub moments: Vec<Moment>,
    /// Share of the points that came or went, of those whose place enough other views show; `None`
    /// without any.
    pub changed: Option<f64>,
}

/// Classified depth image.
pub struct Moment {
    /// Index of the frame.
    pub index: u64,
    /// Plan view of the points.
    pub plan: Plan,
    /// Person-sized groups of changed points.
    pub blobs: Vec<Blob>,
    view: View,
}

impl Views {
    /// Creates an empty collection for an expected number of frames.
    pub fn of(frames: u64) -> Self {
        Self { every: frames / MOST_VIEWS + 1, views: Vec::new() }
    }

    /// Adds the depth image of a frame if it is selected.
    pub fn take(&mut self, number: u64, item: &LogFrame) {
        if number.is_multiple_of(self.every) {
            self.views.extend(View::of(item));
        }
    }

    /// Compares the views with each other.
    pub fn judge(self) -> Scenery {
        let mut points = 0u64;
        let mut changed = 0u64;
        let plans: Vec<Plan> = (0..self.views.len())
            .map(|at| {
                let others = self.others(at);
                let mut plan = Plan::default();
                for point in self.views[at].points().filter(|p| HEIGHTS_M.contains(&p.z)) {
                    let (through, onto) = looks_at(&point, &others);
                    let is_changed = has_changed(through, onto);
                    plan.add(&point, is_changed);
                    // A view looks onto its own points, so that one more look is needed.
                    if through + onto > MIN_THROUGH {
                        points += 1;
                        changed += u64::from(is_changed);
                    }
                }
                plan
            })
            .collect();
        let judged = self.views.into_iter().zip(plans);
        let moments = judged.map(|(view, plan)| Moment {
            index: view.index,
            blobs: plan.blobs(&view),
            plan,
            view,
        });
        let share = (points > 0).then(|| changed as f64 / points as f64);
        Scenery { moments: moments.collect(), changed: share }
    }

    /// Returns some views close in time to one, spread evenly.
    fn others(&self, at: usize) -> Vec<&View> {
        let now = self.views[at].stamp;
        let near = self.views.iter();
        let near: Vec<&View> =
            near.filter(|view| view.stamp.seconds_since(now).abs() <= COMPARED_S).collect();
        let every = near.len() as f64 / COMPARED as f64;
        if every <= 1.0 {
            return near;
        }
        (0..COMPARED).map(|i| near[(i as f64 * every) as usize]).collect()
    }
}

impl Scenery {
    /// Returns the classified image of a frame.
    pub fn moment(&self, index: u64) -> Option<&Moment> {
        let at = self.moments.binary_search_by_key(&index, |moment| moment.index).ok()?;
        self.moments.get(at)
    }
}

impl Moment {
    /// Returns the distance from the camera and the bearing (positive to the left) of a position in
    /// the odometry frame, m and degrees.
    pub fn bearing_of(&self, place: Point2<f64>) -> (f64, f64) {
        self.view.bearing_of(place)
    }

    /// Returns the box of head and shoulders of a person-sized blob, pixels.
    pub fn upper_body(&self, blob: &Blob) -> Rect {
        self.view.upper_body(blob.place, blob.top_m - HALF_HEAD_M)
    }
}

/// Returns the numbers of views that look through a point, and onto it.
fn looks_at(point: &Point3<f64>, others: &[&View]) -> (u32, u32) {
    let mut through = 0;
    let mut onto = 0;
    for view in others {
        match view.look_at(point) {
            Look::Through => through += 1,
            Look::Onto => onto += 1,
            Look::Unknown => {}
        }
    }
    (through, onto)
}

/// Returns true if enough views look through a point, of those that look through or onto it.
fn has_changed(through: u32, onto: u32) -> bool {
    through >= MIN_THROUGH && f64::from(through) >= MIN_SHARE * f64::from(through + onto)
}

#[cfg(test)]
mod tests {
    use super::testing::{PILLAR, Room, Thing};
    use super::*;

    fn blobs(scenery: &Scenery) -> usize {
        scenery.moments.iter().map(|moment| moment.blobs.len()).sum()
    }

    #[test]
    fn walkers_come_and_go_and_pillars_do_not() {
        let scenery = Room::default().with(Thing::walking()).seen(40, 0.0).judge();
        let found = blobs(&scenery);
        assert!((35..=42).contains(&found), "{found}");
        for moment in &scenery.moments {
            for blob in &moment.blobs {
                assert!((blob.place.x - 3.0).abs() < 0.3, "the walker is 3 m away: {blob:?}");
                assert!((1.4..1.85).contains(&blob.top_m), "{blob:?}");
                // Its box in the image of 160 columns is on the side of the walker.
                let (_, bearing_deg) = moment.bearing_of(blob.place);
                let box_px = moment.upper_body(blob);
                let right_px = box_px.centre().x - 79.5;
                assert!(box_px.area() > 100.0, "{box_px:?}");
                assert!(
                    right_px.abs() < 4.0 || (right_px < 0.0) == (bearing_deg > 0.0),
                    "{box_px:?}"
                );
            }
        }
        assert_eq!(blobs(&Room::default().seen(40, 0.0).judge()), 0);
        assert!(scenery.changed.unwrap() < 0.3, "{:?}", scenery.changed);
    }

    #[test]
    fn the_place_of_a_pillar_is_idle_and_that_of_a_walker_is_not() {
        let scenery = Room::default().with(Thing::walking()).seen(40, 0.0).judge();
        let first = &scenery.moments[2];
        let walker = Thing::walking().place(0.2);
        let shares = [PILLAR, walker].map(|place| first.plan.changed_share(place, 0.4).unwrap());
        assert!(shares[0] < 0.05 && shares[1] > 0.5, "{shares:?}");
        assert_eq!(first.plan.changed_share(Point2::new(1.5, 6.0), 0.4), None, "out of view");
    }

    /// With odometry the pillar is static; without it everything seems to move.
    #[test]
    fn ego_motion_is_taken_out() {
        let known = Room::default().seen(40, 0.3).judge();
        assert!(known.changed.unwrap() < 0.05, "{:?}", known.changed);
        assert_eq!(blobs(&known), 0);
        let unknown = Room { odometry: false, ..Room::default() }.seen(40, 0.3).judge();
        assert!(unknown.changed.unwrap() > 0.2, "{:?}", unknown.changed);
    }

    #[test]
    fn things_of_another_size_are_no_people() {
        for (width_m, top_m) in [(1.6, 1.7), (0.1, 1.7), (0.5, 0.9)] {
            // The board is fast, because the middle of a slow wide board hides the wall nearly all
            // the time.
            let start = Point2::new(3.0, 4.0);
            let thing = Thing { start, speed_mps: 2.0, width_m, top_m };
            let scenery = Room::default().with(thing).seen(40, 0.0).judge();
            for moment in &scenery.moments {
                let place = thing.place(0.1 * (moment.index - 1) as f64);
                // Cut by the image border, a wide board is as narrow as a person.
                assert!(place.y.abs() >= 0.9 || moment.blobs.is_empty(), "{thing:?}");
            }
        }
    }

    #[test]
    fn without_other_views_nothing_is_known_of_changes() {
        assert_eq!(Views::of(1).judge().changed, None);
        assert_eq!(Room::default().seen(2, 0.0).judge().changed, None);
        assert_eq!(Room::default().seen(3, 0.0).judge().changed, Some(0.0));
    }

    #[test]
    fn of_many_frames_some_are_kept() {
        let mut views = Views::of(MOST_VIEWS * 3);
        (0..9).for_each(|number| views.take(number, &Room::default().frame(number, 0.0)));
        assert_eq!(views.judge().moments.len(), 3);
    }
}
