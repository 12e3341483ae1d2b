use tagalong_geometry::Rect;

use crate::Detection;

/// Number of candidates that one test dropped, with one example.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Dropped {
    /// Name of the test, as in the plugin's README.
    pub test: &'static str,
    /// Candidates dropped by it.
    pub count: u64,
    /// Region of the last one, if known.
    pub example: Option<Rect>,
    /// Regions of the first ones that have one, at most [`MAX_PLACES`].
    pub places: Vec<Rect>,
    /// Values that some of them were dropped for, by the position of the region in `places`.
    pub measured: Vec<(usize, Measured)>,
}

/// Value of a dropped candidate, and the settings that it breaks.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Name of the value, for example `cost`.
    pub what: &'static str,
    /// The value.
    pub value: f64,
    /// Settings that it is beyond, with their values: that of the test first, then those that the same
    /// value would break later.
    pub limits: Vec<(&'static str, f64)>,
}

/// Largest number of regions that are kept of one test: enough for what is dropped near a person,
/// and a bound for tests that look at every pixel.
pub const MAX_PLACES: usize = 48;

/// Names of the tests of the tracker and of track managers. A detector gives its tests other names,
/// as in `"depth-net: peak"`: the settings that decide a test are found by its name.
pub const TRACKER_TESTS: [&str; 15] = [
    "associator",
    "association not possible",
    "clutter",
    "doubt",
    "filter",
    "gate",
    "no track fits",
    "no track numbers left",
    "not the best detection",
    "rather a new person",
    "same person",
    "score",
    "too many detections",
    "tracked already",
    "verifier",
];

/// Rejection funnel: the number of candidates that each test dropped.
///
/// It explains a frame without detections. Every stage writes into it; the entries keep the order
/// in which tests first dropped a candidate, which is the order of the stages.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Funnel {
    entries: Vec<Dropped>,
}

impl Funnel {
    /// Records one dropped candidate and its region.
    pub fn drop_at(&mut self, test: &'static str, region: Rect) {
        self.add(test, 1, Some(region));
    }

    /// Records one dropped candidate, its region, and the value that it was dropped for.
    pub fn drop_measured(&mut self, test: &'static str, region: Rect, measured: Measured) {
        self.add(test, 1, Some(region));
        let entry = self.entry(test);
        let last = entry.places.len() - 1;
        if entry.places[last] == region && entry.measured.last().is_none_or(|one| one.0 < last) {
            entry.measured.push((last, measured));
        }
    }

    /// Records one dropped detection, with its rectangle if it has a box in the image.
    pub fn drop_detection(&mut self, test: &'static str, detection: &Detection) {
        self.add(test, 1, detection.rect());
    }

    /// Records `count` dropped candidates.
    pub fn drop_many(&mut self, test: &'static str, count: u64) {
        if count > 0 {
            self.add(test, count, None);
        }
    }

    /// Adds the entries of `other`.
    pub fn merge(&mut self, other: &Self) {
        for entry in &other.entries {
            let own = self.entry(entry.test);
            own.count += entry.count;
            own.example = entry.example.or(own.example);
            let known = own.places.len();
            own.places.extend(entry.places.iter().take(MAX_PLACES - known));
            for (at, measured) in &entry.measured {
                if known + at < own.places.len() {
                    own.measured.push((known + at, measured.clone()));
                }
            }
        }
    }

    /// Returns the entries, in the order of their first drop.
    pub fn entries(&self) -> &[Dropped] {
        &self.entries
    }

    /// Returns the number of candidates dropped by `test`.
    pub fn count(&self, test: &str) -> u64 {
        self.entries.iter().find(|e| e.test == test).map_or(0, |e| e.count)
    }

    fn add(&mut self, test: &'static str, count: u64, region: Option<Rect>) {
        let entry = self.entry(test);
        entry.count += count;
        entry.example = region.or(entry.example);
        if entry.places.len() < MAX_PLACES {
            entry.places.extend(region);
        }
    }

    /// Returns the entry of a test, a new one if it has none.
    fn entry(&mut self, test: &'static str) -> &mut Dropped {
        let index = self.entries.iter().position(|e| e.test == test).unwrap_or_else(|| {
            let places = Vec::new();
            let measured = Vec::new();
            self.entries.push(Dropped { test, count: 0, example: None, places, measured });
            self.entries.len() - 1
        });
        &mut self.entries[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Rect {
        Rect::new(x, 0.0, 1.0, 1.0)
    }

    #[test]
    fn drops_are_counted_by_test_in_the_order_of_the_stages() {
        let mut funnel = Funnel::default();
        funnel.drop_at("small", at(1.0));
        funnel.drop_many("dark", 3);
        funnel.drop_at("small", at(2.0));
        funnel.drop_many("never", 0);
        let tests: Vec<_> = funnel.entries().iter().map(|e| (e.test, e.count)).collect();
        assert_eq!(tests, [("small", 2), ("dark", 3)]);
        assert_eq!((funnel.count("small"), funnel.count("never")), (2, 0));
        assert_eq!(funnel.entries()[0].example, Some(at(2.0)), "the last one that was dropped");
        assert_eq!(funnel.entries()[0].places, [at(1.0), at(2.0)]);
    }

    #[test]
    fn the_first_places_are_kept_up_to_a_bound() {
        let mut sum = Funnel::default();
        let mut frame = Funnel::default();
        (0..MAX_PLACES + 5).for_each(|x| frame.drop_at("small", at(x as f64)));
        sum.drop_at("small", at(-1.0));
        sum.merge(&frame);
        let places = &sum.entries()[0].places;
        assert_eq!((places.len(), places[0], places[1]), (MAX_PLACES, at(-1.0), at(0.0)));
        assert_eq!(sum.count("small"), MAX_PLACES as u64 + 6);
        assert_eq!(sum.entries()[0].example, Some(at(MAX_PLACES as f64 + 4.0)));
    }

    #[test]
    fn measured_values_stay_with_their_places() {
        fn cost(value: f64) -> Measured {
            Measured { what: "cost", value, limits: vec![("most_cost", 0.4)] }
        }

        let mut frame = Funnel::default();
        frame.drop_at("bad", at(1.0));
        frame.drop_measured("bad", at(2.0), cost(0.5));
        let mut sum = Funnel::default();
        sum.drop_measured("bad", at(0.0), cost(0.6));
        sum.merge(&frame);
        let entry = &sum.entries()[0];
        assert_eq!((entry.count, entry.places.len()), (3, 3));
        assert_eq!(entry.measured, [(0, cost(0.6)), (2, cost(0.5))]);
        (0..MAX_PLACES).for_each(|x| sum.drop_measured("bad", at(x as f64), cost(0.7)));
        sum.merge(&frame);
        let entry = &sum.entries()[0];
        assert_eq!(entry.measured.last(), Some(&(MAX_PLACES - 1, cost(0.7))), "no room for more");
        assert_eq!(entry.measured.len(), MAX_PLACES - 1);
    }

    #[test]
    fn funnels_of_several_frames_add_up() {
        let mut sum = Funnel::default();
        let mut frame = Funnel::default();
        sum.drop_at("small", at(1.0));
        frame.drop_many("small", 4);
        frame.drop_at("dark", at(5.0));
        sum.merge(&frame);
        assert_eq!((sum.count("small"), sum.count("dark")), (5, 1));
        assert_eq!(sum.entries()[0].example, Some(at(1.0)), "an example is kept");
        assert_eq!(sum.entries()[1].example, Some(at(5.0)));
    }
}
