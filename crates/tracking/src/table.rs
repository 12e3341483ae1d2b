//! Table of the tracks, with the data of each other than the filter's state.

use std::collections::BTreeMap;

use tagalong_core::{Estimate, Observation, Track, TrackHealth, TrackId};
use tagalong_geometry::Camera;

use crate::occlusion::range_m;

/// Data of one track.
#[derive(Clone, Debug)]
struct Record {
    health: TrackHealth,
    /// Index of the detector that found the track last.
    detector: usize,
    observation: Observation,
    age: u32,
    unseen_s: f64,
}

/// All tracks of a tracker. Numbers rise, and are never used twice.
#[derive(Default)]
pub(crate) struct TrackTable {
    records: BTreeMap<TrackId, Record>,
    started: u32,
}

impl TrackTable {
    pub(crate) fn ids(&self) -> Vec<TrackId> {
        self.records.keys().copied().collect()
    }

    pub(crate) fn tentative_ids(&self) -> Vec<TrackId> {
        let tentative = self.records.iter().filter(|(_, record)| !record.health.confirmed);
        tentative.map(|(id, _)| *id).collect()
    }

    pub(crate) fn contains(&self, id: TrackId) -> bool {
        self.records.contains_key(&id)
    }

    /// Returns the number of the next track; `None` when all numbers are used up.
    pub(crate) fn next_id(&self) -> Option<TrackId> {
        self.started.checked_add(1).map(TrackId)
    }

    /// Starts the track [`TrackTable::next_id`].
    pub(crate) fn start(&mut self, id: TrackId, health: TrackHealth, detector: usize) {
        self.started = id.0;
        let observation = Observation::Started;
        let record = Record { health, detector, observation, age: 0, unseen_s: 0.0 };
        self.records.insert(id, record);
    }

    pub(crate) fn end(&mut self, id: TrackId) {
        self.records.remove(&id);
    }

    /// Advances the age of all tracks.
    pub(crate) fn age(&mut self, dt_s: f64) {
        for record in self.records.values_mut() {
            record.age = record.age.saturating_add(1);
            record.unseen_s += dt_s;
        }
    }

    /// Records the observation of a track, and the detector that found it, if any.
    pub(crate) fn observe(&mut self, id: TrackId, observed: Observation, by: Option<usize>) {
        let Some(record) = self.records.get_mut(&id) else { return };
        record.observation = observed;
        record.detector = by.unwrap_or(record.detector);
        if observed.is_supported() {
            record.unseen_s = 0.0;
        }
    }

    pub(crate) fn set_health(&mut self, id: TrackId, health: TrackHealth) {
        if let Some(record) = self.records.get_mut(&id) {
            record.health = health;
        }
    }

    pub(crate) fn observation(&self, id: TrackId) -> Option<Observation> {
        self.records.get(&id).map(|record| record.observation)
    }

    /// Returns true for a confirmed track.
    pub(crate) fn is_confirmed(&self, id: TrackId) -> bool {
        self.records.get(&id).is_some_and(|record| record.health.confirmed)
    }

    /// Returns the detector that found a track last.
    pub(crate) fn detector(&self, id: TrackId) -> Option<usize> {
        self.records.get(&id).map(|record| record.detector)
    }

    /// Returns the tracks in excess of `most`, lowest scores first, and of equal ones the youngest
    /// first.
    pub(crate) fn too_many(&self, most: usize) -> Vec<TrackId> {
        let records = self.records.iter();
        let mut all: Vec<_> = records.map(|(id, record)| (record.health.log_odds, *id)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let excess = all.len().saturating_sub(most);
        all.into_iter().take(excess).map(|(_, id)| id).collect()
    }

    /// Returns the tracks of these estimates, from near to far.
    pub(crate) fn tracks(
        &self,
        estimates: BTreeMap<TrackId, Estimate>,
        camera: &Camera,
    ) -> Vec<Track> {
        let mut tracks: Vec<Track> =
            estimates.into_iter().filter_map(|(id, estimate)| self.track(id, estimate)).collect();
        tracks.sort_by(|a, b| {
            let a_m = range_m(&a.estimate.person.position, camera);
            let b_m = range_m(&b.estimate.person.position, camera);
            a_m.total_cmp(&b_m).then(a.id.cmp(&b.id))
        });
        tracks
    }

    fn track(&self, id: TrackId, estimate: Estimate) -> Option<Track> {
        let record = self.records.get(&id)?;
        Some(
            Track::new(id, estimate, record.health.log_odds)
                .with_seen(record.observation.is_supported())
                .with_occluded(record.observation == Observation::Occluded)
                .with_confirmed(record.health.confirmed)
                .with_age(record.age)
                .with_unseen_s(record.unseen_s),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEALTH: TrackHealth = TrackHealth::new(false, 1.0);

    #[test]
    fn a_number_is_never_used_twice() {
        let mut table = TrackTable::default();
        for expected in 1..=3 {
            let id = table.next_id().unwrap();
            assert_eq!(id, TrackId(expected));
            table.start(id, HEALTH, 0);
            table.end(id);
        }
        let mut full = TrackTable { started: u32::MAX, ..TrackTable::default() };
        assert_eq!(full.next_id(), None);
        full.end(TrackId(1));
        assert!(full.ids().is_empty());
    }

    #[test]
    fn tentative_tracks_are_those_that_are_not_confirmed() {
        let mut table = TrackTable::default();
        for confirmed in [false, true, false] {
            let id = table.next_id().unwrap();
            table.start(id, TrackHealth::new(confirmed, 1.0), 0);
        }
        assert_eq!(table.tentative_ids(), [TrackId(1), TrackId(3)]);
    }

    #[test]
    fn the_lowest_scores_are_too_many_and_of_equals_the_youngest() {
        let mut table = TrackTable::default();
        for log_odds in [1.0, 3.0, 1.0, 2.0] {
            let id = table.next_id().unwrap();
            table.start(id, TrackHealth::new(false, log_odds), 0);
        }
        assert_eq!(table.too_many(2), [TrackId(3), TrackId(1)]);
        assert_eq!(table.too_many(4), []);
    }

    #[test]
    fn only_support_ends_the_time_unseen() {
        let mut table = TrackTable::default();
        table.start(TrackId(1), HEALTH, 2);
        for observation in [Observation::Missed, Observation::Occluded, Observation::OutOfView] {
            table.age(0.5);
            table.observe(TrackId(1), observation, None);
        }
        let record = &table.records[&TrackId(1)];
        assert_eq!((record.age, record.unseen_s, record.detector), (3, 1.5, 2));
        table.observe(TrackId(1), Observation::Detected { log_odds: 1.0 }, Some(4));
        let record = &table.records[&TrackId(1)];
        assert_eq!((record.unseen_s, record.detector), (0.0, 4));
    }
}
