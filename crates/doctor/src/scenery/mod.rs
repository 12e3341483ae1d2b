//! Things that came or went in the depth images of a log, whatever a pipeline makes of them.
//!
//! A point has come or gone if other views of the log look through its place. Furniture and walls
//! were there all the time; people were not, but for those that never stir. Ego-motion is taken out
//! by the odometry, so that a driven log can be judged, too.

mod plan;
mod view;

use std::ops::RangeInclusive;

use nalgebra::{Point2, Point3};
pub use plan::{Blob, Plan};
use tagalong_log::LogFrame;
use view::{Look, View};

/// Most views that are kept: some 100 kB each.
const MOST_VIEWS: u64 = 400;

/// Views with which each one is compared.
const COMPARED: usize = 24;

/// Time between two views that are compared, at most, s: odometry drifts.
const COMPARED_S: f64 = 30.0;

/// Heights of the points that are used, m: people, but neither floor nor ceiling.
const HEIGHTS_M: RangeInclusive<f64> = 0.5..=2.1;

/// Number and share of views through a point that has changed.
const MIN_THROUGH: u32 = 2;
const MIN_SHARE: f64 = 0.3;

/// Reduced depth images of a log.
pub struct Views {
    every: u64,
    views: Vec<View>,
}

/// Judged depth images of a log.
#[derive(Default)]
pub struct Scenery {
    /// One for each view, by the time.
    pub moments: Vec<Moment>,
    /// Share of all points that came or went.
    pub changed: f64,
}

/// Judged depth image.
pub struct Moment {
    /// Index of the frame.
    pub index: u64,
    /// Points from above.
    pub plan: Plan,
    /// Groups of changed points of the size of a person.
    pub blobs: Vec<Blob>,
    view: View,
}

impl Views {
    /// Returns an empty collection for about so many frames.
    pub fn of(frames: u64) -> Self {
        Self { every: frames / MOST_VIEWS + 1, views: Vec::new() }
    }

    /// Takes the depth image of a frame if it is its turn.
    pub fn take(&mut self, number: u64, item: &LogFrame) {
        if number.is_multiple_of(self.every) {
            self.views.extend(View::of(item));
        }
    }

    /// Compares the views with each other.
    pub fn judge(self) -> Scenery {
        let (mut points, mut changed) = (0u64, 0u64);
        let plans: Vec<Plan> = (0..self.views.len())
            .map(|at| {
                let others = self.others(at);
                let mut plan = Plan::default();
                for point in self.views[at].points().filter(|p| HEIGHTS_M.contains(&p.z)) {
                    let is_changed = has_changed(&point, &others);
                    plan.add(&point, is_changed);
                    points += 1;
                    changed += u64::from(is_changed);
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
        Scenery { moments: moments.collect(), changed: changed as f64 / points.max(1) as f64 }
    }

    /// Returns some views near one in time, spread evenly.
    fn others(&self, at: usize) -> Vec<&View> {
        let now = self.views[at].stamp;
        let near = |view: &&View| view.stamp.seconds_since(now).abs() <= COMPARED_S;
        let near: Vec<&View> = self.views.iter().filter(near).collect();
        let every = near.len() as f64 / COMPARED as f64;
        if every <= 1.0 {
            return near;
        }
        (0..COMPARED).map(|i| near[(i as f64 * every) as usize]).collect()
    }
}

impl Scenery {
    /// Returns the judged image of a frame.
    pub fn moment(&self, index: u64) -> Option<&Moment> {
        let at = self.moments.binary_search_by_key(&index, |moment| moment.index).ok()?;
        self.moments.get(at)
    }
}

impl Moment {
    /// Returns the distance from the camera and the bearing (positive to the left) of a place of
    /// the odometry frame, m and degrees.
    pub fn bearing_of(&self, place: Point2<f64>) -> (f64, f64) {
        self.view.bearing_of(place)
    }
}

/// Returns true if other views look through a point.
fn has_changed(point: &Point3<f64>, others: &[&View]) -> bool {
    let (mut through, mut onto) = (0, 0);
    for view in others {
        match view.look_at(point) {
            Look::Through => through += 1,
            Look::Onto => onto += 1,
            Look::Unknown => {}
        }
    }
    through >= MIN_THROUGH && f64::from(through) >= MIN_SHARE * f64::from(through + onto)
}
