use std::collections::BTreeMap;

use tagalong_core::{
    EgoMotion, Initiation, ObservedTrack, Result, TrackChanges, TrackHealth, TrackId, TrackManager,
    Unassociated,
};

use crate::m_of_n::Config;
use crate::m_of_n::clutter::ClutterMap;
use crate::m_of_n::track::TrackCount;

/// The track manager.
pub struct MOfN {
    config: Config,
    counts: BTreeMap<TrackId, TrackCount>,
    clutter: ClutterMap,
    /// Time between the last two frames, s.
    dt_s: f64,
}

impl MOfN {
    /// Creates a manager without tracks.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        config.check()?;
        Ok(Self { config, counts: BTreeMap::new(), clutter: ClutterMap::default(), dt_s: 0.0 })
    }

    /// Returns the test that a candidate fails, or its log-odds.
    fn judge(&mut self, candidate: &Unassociated<'_>) -> std::result::Result<f64, &'static str> {
        let Unassociated { detection, detector_log_odds, discovered, .. } = *candidate;
        let start_score = self.config.start_score;
        let log_odds = if discovered {
            self.clutter.add_evidence(detection, &self.config)
        } else {
            detection.score
        };
        if log_odds < start_score {
            let alone = detection.score < start_score;
            let by_detector = detector_log_odds < start_score;
            return Err(match (alone, by_detector) {
                (true, true) => "score",
                (true, false) => "verifier",
                (false, _) => "doubt",
            });
        }
        if discovered { Ok(log_odds) } else { Err("no track fits") }
    }

    /// Observes all tracks, and returns those that end by themselves.
    fn observe(&mut self, tracks: &[ObservedTrack<'_>]) -> Vec<(TrackId, &'static str)> {
        let mut ends = Vec::new();
        for ObservedTrack { track, observation, .. } in tracks {
            let Some(count) = self.counts.get_mut(&track.id) else { continue };
            count.observe(*observation, self.dt_s, &self.config);
            let test = count.end_test(track.unseen_s, &self.config);
            ends.extend(test.map(|test| (track.id, test)));
        }
        ends
    }
}

impl TrackManager for MOfN {
    fn start_log_odds(&self) -> f64 {
        self.config.start_score
    }

    fn predict(&mut self, motion: &EgoMotion) {
        self.dt_s = motion.dt;
        self.clutter.predict(motion, &self.config);
    }

    fn initiate(&mut self, id: TrackId, candidate: &Unassociated<'_>) -> Initiation {
        match self.judge(candidate) {
            Ok(log_odds) => {
                let count = TrackCount::new(log_odds, &self.config);
                let health = count.health();
                self.counts.insert(id, count);
                Initiation::Start(health)
            }
            Err(test) => Initiation::Drop(test),
        }
    }

    fn manage(&mut self, tracks: &[ObservedTrack<'_>]) -> TrackChanges {
        let ends = self.observe(tracks);
        let health = self.counts.iter().map(|(id, count)| (*id, count.health())).collect();
        TrackChanges::new(health, ends)
    }

    /// The older track takes over the confirmation.
    fn merge(&mut self, kept: TrackId, ended: TrackId) -> Option<TrackHealth> {
        let confirmed = self.counts.get(&ended)?.confirmed;
        let count = self.counts.get_mut(&kept)?;
        count.confirmed |= confirmed;
        Some(count.health())
    }

    fn stop(&mut self, id: TrackId) {
        self.counts.remove(&id);
    }

    fn reset(&mut self) {
        self.clutter.clear();
    }
}
