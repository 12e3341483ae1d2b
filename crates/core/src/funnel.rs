use tagalong_geometry::Rect;

use crate::Detection;

/// Number of candidates that one test dropped, with one example.
#[derive(Clone, Debug, PartialEq)]
pub struct Dropped {
    /// Name of the test, as in the plugin's README.
    pub test: &'static str,
    /// Candidates dropped by it.
    pub count: u64,
    /// Region of the last one, if known.
    pub example: Option<Rect>,
}

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
            self.add(entry.test, entry.count, entry.example);
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

    fn add(&mut self, test: &'static str, count: u64, example: Option<Rect>) {
        match self.entries.iter_mut().find(|e| e.test == test) {
            Some(entry) => {
                entry.count += count;
                entry.example = example.or(entry.example);
            }
            None => self.entries.push(Dropped { test, count, example }),
        }
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
    }

    #[test]
    fn funnels_of_several_frames_add_up() {
        let (mut sum, mut frame) = (Funnel::default(), Funnel::default());
        sum.drop_at("small", at(1.0));
        frame.drop_many("small", 4);
        frame.drop_at("dark", at(5.0));
        sum.merge(&frame);
        assert_eq!((sum.count("small"), sum.count("dark")), (5, 1));
        assert_eq!(sum.entries()[0].example, Some(at(1.0)), "an example is kept");
        assert_eq!(sum.entries()[1].example, Some(at(5.0)));
    }
}
