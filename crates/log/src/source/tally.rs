use std::collections::BTreeMap;

/// What was lost, skipped and found out, by name and in sentences.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) counters: BTreeMap<&'static str, u64>,
    pub(crate) notes: Vec<String>,
    pub(crate) lost: bool,
}

/// Sentences kept; what repeats is counted, not told.
const MAX_NOTES: usize = 40;

impl Tally {
    /// Counts something that is no loss.
    pub(crate) fn count(&mut self, name: &'static str) {
        self.add(name, 1);
    }

    /// Counts several at once; nothing if there are none.
    pub(crate) fn add(&mut self, name: &'static str, count: u64) {
        if count > 0 {
            *self.counters.entry(name).or_default() += count;
        }
    }

    /// Counts lost data, and says once per name what it was.
    pub(crate) fn lose(&mut self, name: &'static str, what: impl FnOnce() -> String) {
        self.lost = true;
        self.count(name);
        if self.counters.get(name) == Some(&1) {
            self.note(what());
        }
    }

    /// Says something once.
    pub(crate) fn note(&mut self, text: impl Into<String>) {
        let text = text.into();
        if self.notes.len() < MAX_NOTES && !self.notes.contains(&text) {
            self.notes.push(text);
        }
    }
}
