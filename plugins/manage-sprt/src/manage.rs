use std::collections::BTreeMap;

use tagalong_core::{
    EgoMotion, Initiation, ObservedTrack, Result, Track, TrackChanges, TrackHealth, TrackId,
    TrackManager, Unassociated,
};

use crate::Config;
use crate::clutter::ClutterMap;
use crate::evidence::{Evidence, NEVER_MOVED};

/// The track manager.
pub struct Sprt {
    config: Config,
    evidence: BTreeMap<TrackId, Evidence>,
    clutter: ClutterMap,
    /// Time between the last two frames, s.
    dt_s: f64,
}

impl Sprt {
    /// Creates a manager without tracks.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        config.check()?;
        let (evidence, clutter) = (BTreeMap::new(), ClutterMap::default());
        Ok(Self { config, evidence, clutter, dt_s: 0.0 })
    }

    /// Remembers the place of an ended track as clutter, as far as it was disproved.
    fn add_clutter(&mut self, track: &Track, test: &str) {
        let Config { clutter_m, max_clutter, max_look, end_log_odds, .. } = self.config;
        let against = match test {
            NEVER_MOVED => max_look,
            "track: evidence" => -end_log_odds,
            _ => return,
        };
        let at = track.estimate.person.position.xy();
        self.clutter.add(at, against, clutter_m, max_clutter);
    }
}

impl TrackManager for Sprt {
    fn start_log_odds(&self) -> f64 {
        self.config.start_log_odds
    }

    fn predict(&mut self, motion: &EgoMotion) {
        self.dt_s = motion.dt;
        self.clutter.predict(motion, self.config.clutter_s);
        self.evidence.values_mut().for_each(|evidence| evidence.predict(motion));
    }

    fn initiate(&mut self, id: TrackId, candidate: &Unassociated<'_>) -> Initiation {
        let Unassociated { detection, detector_log_odds, discovered } = *candidate;
        let start_log_odds = self.config.start_log_odds;
        if detection.score < start_log_odds {
            let by_detector = detector_log_odds < start_log_odds;
            return Initiation::Drop(if by_detector { "score" } else { "verifier" });
        }
        if !discovered {
            return Initiation::Drop("no track fits");
        }
        let at = detection.position.xy();
        let against = self.clutter.against(&at, self.config.clutter_m);
        let look = detection.score.min(self.config.max_look);
        if look - against < start_log_odds {
            return Initiation::Drop("clutter");
        }
        let evidence = Evidence::new(look - against, at, &self.config);
        let health = evidence.health();
        self.evidence.insert(id, evidence);
        Initiation::Start(health)
    }

    fn manage(&mut self, tracks: &[ObservedTrack<'_>]) -> TrackChanges {
        let mut changes = TrackChanges::default();
        for ObservedTrack { track, observation } in tracks {
            let Some(evidence) = self.evidence.get_mut(&track.id) else { continue };
            evidence.add(track, *observation, self.dt_s, &self.config);
            changes.health.push((track.id, evidence.health()));
            let test = evidence.end_test(*observation, track.unseen_s, &self.config);
            if let Some(test) = test {
                changes.ends.push((track.id, test));
                self.add_clutter(track, test);
            }
        }
        changes
    }

    /// The older track takes over the confirmation.
    fn merge(&mut self, kept: TrackId, ended: TrackId) -> Option<TrackHealth> {
        let younger = self.evidence.get(&ended)?.clone();
        let older = self.evidence.get_mut(&kept)?;
        older.confirmed |= younger.confirmed;
        older.moved |= younger.moved;
        Some(older.health())
    }

    fn stop(&mut self, id: TrackId) {
        self.evidence.remove(&id);
    }

    fn reset(&mut self) {
        self.clutter.clear();
    }
}
