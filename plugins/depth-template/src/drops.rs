//! Positions that one scan drops: the count of all, and some of them with the values measured
//! there.

use tagalong_core::{Funnel, Measured};

use crate::candidates::tests_named;
use crate::people::Cell;
use crate::view::MetricImage;

/// Places of one test that are kept of a scan.
const MOST_PLACES: usize = 6;

/// Least distance between two of them, m: a head wide.
const APART_M: f64 = 0.2;

/// Tests that most places of an image fail.
const COMMON: [&str; 3] = [tests_named::VOLUME, tests_named::BOUNDARY, tests_named::WINDOW];

/// Test that a place failed.
#[derive(Clone, Copy, Debug)]
pub struct Failed {
    /// Name of the test.
    pub test: &'static str,
    /// Value against a setting, where the test is one of a single value.
    pub against: Option<Against>,
}

/// Value against a setting.
#[derive(Clone, Copy, Debug)]
pub struct Against {
    /// Name of the value.
    pub what: &'static str,
    /// The value.
    pub value: f64,
    /// Name and value of the setting.
    pub setting: (&'static str, f64),
}

/// Place in the reduced image that a test dropped.
#[derive(Clone, Debug)]
pub struct Place {
    /// Reduced pixel.
    pub x: i64,
    /// Its row.
    pub y: i64,
    /// Depth of the face, m.
    pub depth_m: f64,
    /// Values that were measured there.
    pub measured: Option<Measured>,
}

/// Places that one test dropped.
#[derive(Debug)]
struct Dropped {
    test: &'static str,
    count: u64,
    /// True for a test that most of an image fails: its last place alone is kept.
    is_common: bool,
    places: Vec<Place>,
}

/// Places dropped by the tests of one scan; their regions are worked out at the end.
#[derive(Debug, Default)]
pub struct Drops {
    entries: Vec<Dropped>,
}

impl Failed {
    /// Returns a test that is not one of a single value.
    pub const fn at(test: &'static str) -> Self {
        Self { test, against: None }
    }
}

impl Against {
    /// Returns the value with the setting that it breaks.
    pub fn measured(&self) -> Measured {
        Measured { what: self.what, value: self.value, limits: vec![self.setting] }
    }
}

impl Place {
    /// Returns true if a reduced pixel is at least so many pixels away, along a row or a column.
    fn is_apart(&self, x: i64, y: i64, apart: f64) -> bool {
        (self.x - x).abs().max((self.y - y).abs()) as f64 >= apart
    }
}

impl Drops {
    /// Counts a place that failed a test. Common tests keep the last one, the others several that are
    /// apart.
    pub fn add(&mut self, failed: Failed, view: &MetricImage, (x, y): (i64, i64), depth_m: f64) {
        let Failed { test, against } = failed;
        let at = self.entries.iter().position(|entry| entry.test == test).unwrap_or_else(|| {
            let is_common = COMMON.contains(&test);
            self.entries.push(Dropped { test, count: 0, is_common, places: Vec::new() });
            self.entries.len() - 1
        });
        let entry = &mut self.entries[at];
        entry.count += 1;
        if entry.is_common {
            entry.places.clear();
        } else {
            let apart = APART_M * view.px_per_m(depth_m);
            let is_apart = entry.places.iter().all(|kept| kept.is_apart(x, y, apart));
            // Those that `keep_apart` forgets must not take the room of others.
            let is_full = test != tests_named::REFINE && entry.places.len() == MOST_PLACES;
            if !is_apart || is_full {
                return;
            }
        }
        let measured = against.map(|against| against.measured());
        entry.places.push(Place { x, y, depth_m, measured });
    }

    /// Forgets the places of a test that are near one that passed: a person was found there. Of the
    /// others, the first ones are kept.
    pub fn keep_apart(&mut self, test: &str, view: &MetricImage, passed: &[Cell]) {
        let Some(entry) = self.entries.iter_mut().find(|entry| entry.test == test) else { return };
        entry.places.retain(|place| {
            let apart = 2.0 * APART_M * view.px_per_m(place.depth_m);
            passed.iter().all(|cell| place.is_apart(cell.x, cell.y, apart))
        });
        entry.places.truncate(MOST_PLACES);
    }

    /// Returns the kept places of a test.
    pub fn places_of(&mut self, test: &str) -> &mut [Place] {
        let entry = self.entries.iter_mut().find(|entry| entry.test == test);
        entry.map_or(&mut [], |entry| &mut entry.places)
    }

    /// Counts everything in the funnel.
    pub fn report(self, view: &MetricImage, funnel: &mut Funnel) {
        for Dropped { test, count, places, .. } in self.entries {
            funnel.drop_many(test, count - places.len() as u64);
            for Place { x, y, depth_m, measured } in places {
                let region = view.region(x as f64, y as f64, depth_m);
                match measured {
                    Some(measured) => funnel.drop_measured(test, region, measured),
                    None => funnel.drop_at(test, region),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Point3;
    use tagalong_core::DepthImage;
    use tagalong_geometry::{Camera, Pinhole};
    use tagalong_vision::RowSums;

    use super::*;

    #[test]
    fn places_at_a_person_who_was_found_take_no_room_from_others() {
        let camera = Camera::mounted(Pinhole::centred(60.0, 64, 48), 64, 48, 1.2, 0.0, 0.0);
        let rows = RowSums::new(&DepthImage::filled(64, 48, 3.0), 1);
        let view = MetricImage::new(&Arc::new(camera), &rows);
        let depth_m = 3.0;
        // Twenty pixels per metre: four are 0.2 m.
        let found: Vec<i64> = (0..=MOST_PLACES as i64).map(|at| 4 * at).collect();
        let mut drops = Drops::default();
        let mut passed = Vec::new();
        for x in &found {
            drops.add(Failed::at(tests_named::REFINE), &view, (*x, 0), depth_m);
            let head = Point3::new(3.0, 0.0, 1.6);
            passed.push(Cell { x: *x, y: 2, depth_m, cost: 0.1, head });
        }
        drops.add(Failed::at(tests_named::REFINE), &view, (20, 40), depth_m);
        drops.keep_apart(tests_named::REFINE, &view, &passed);
        let kept: Vec<_> =
            drops.places_of(tests_named::REFINE).iter().map(|p| (p.x, p.y)).collect();
        assert_eq!(kept, [(20, 40)]);
    }
}
