use std::collections::BTreeMap;

/// Losses, skipped data and remarks, counted by name and described in sentences.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) counters: BTreeMap<&'static str, u64>,
    pub(crate) notes: Vec<String>,
    pub(crate) lost: bool,
    /// Description of the first loss, from which later ones may follow.
    pub(crate) first_loss: Option<String>,
}

/// Maximum number of stored sentences; repeated ones are only counted.
const MAX_NOTES: usize = 40;

impl Tally {
    /// Counts an event that is not a loss.
    pub(crate) fn count(&mut self, name: &'static str) {
        self.add(name, 1);
    }

    /// Counts several events at once; does nothing if there are none.
    pub(crate) fn add(&mut self, name: &'static str, count: u64) {
        if count > 0 {
            *self.counters.entry(name).or_default() += count;
        }
    }

    /// Counts lost data, and describes it once per name.
    pub(crate) fn lose(&mut self, name: &'static str, what: impl FnOnce() -> String) {
        self.lost = true;
        self.count(name);
        if self.counters.get(name) == Some(&1) {
            let what = what();
            self.first_loss.get_or_insert_with(|| what.clone());
            self.note(what);
        }
    }

    /// Describes lost data that is already counted.
    pub(crate) fn lose_counted(&mut self, what: String) {
        self.lost = true;
        self.note(what);
    }

    /// Counts an event that is not a loss, and describes it once per name.
    pub(crate) fn remark(&mut self, name: &'static str, what: impl FnOnce() -> String) {
        self.count(name);
        if self.counters.get(name) == Some(&1) {
            self.note(what());
        }
    }

    /// Adds a remark once.
    pub(crate) fn note(&mut self, text: impl Into<String>) {
        let text = text.into();
        if self.notes.len() < MAX_NOTES && !self.notes.contains(&text) {
            self.notes.push(text);
        }
    }
}
