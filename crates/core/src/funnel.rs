use crate::Rect;

/// How many candidates one test dropped, and one of them to look at.
#[derive(Clone, Debug, PartialEq)]
pub struct Dropped {
    /// The test, in the words of the plugin's README.
    pub test: &'static str,
    /// Candidates dropped by it.
    pub count: u64,
    /// Where the last one was, if the stage knows.
    pub example: Option<Rect>,
}

/// The rejection funnel: which test dropped how many candidates.
///
/// It answers the question asked most often of a person tracker, "why does it
/// detect nobody?". Every stage writes into it; the entries keep the order in
/// which tests first dropped something, which is the order of the stages.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Funnel {
    entries: Vec<Dropped>,
}

impl Funnel {
    /// Records one dropped candidate and where it was.
    pub fn drop_at(&mut self, test: &'static str, region: Rect) {
        self.add(test, 1, Some(region));
    }

    /// Records `count` dropped candidates.
    pub fn drop_many(&mut self, test: &'static str, count: u64) {
        if count > 0 {
            self.add(test, count, None);
        }
    }

    /// Adds everything of `other`.
    pub fn merge(&mut self, other: &Self) {
        for entry in &other.entries {
            self.add(entry.test, entry.count, entry.example);
        }
    }

    /// The entries, first test first.
    pub fn entries(&self) -> &[Dropped] {
        &self.entries
    }

    /// Candidates dropped by `test`.
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
