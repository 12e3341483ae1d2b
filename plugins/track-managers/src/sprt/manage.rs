use std::collections::BTreeMap;

use tagalong_core::{
    EgoMotion, Initiation, ObservedTrack, Result, TrackChanges, TrackHealth, TrackId, TrackManager,
    Unassociated,
};

use crate::sprt::Config;
use crate::sprt::clutter::ClutterMap;
use crate::sprt::evidence::{Evidence, NEVER_MOVED};

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
        let evidence = BTreeMap::new();
        let clutter = ClutterMap::default();
        Ok(Self { config, evidence, clutter, dt_s: 0.0 })
    }

    /// Remembers as clutter the places of a track that never moved: what it showed there is no
    /// evidence for a person.
    fn add_clutter(&mut self, evidence: &Evidence) {
        let Config { clutter_m, min_clutter, max_clutter, .. } = self.config;
        for (at, look) in evidence.looks().by_place() {
            let against = (look + min_clutter).clamp(min_clutter, max_clutter);
            self.clutter.add(at, against, clutter_m);
        }
    }
}

impl TrackManager for Sprt {
    fn start_log_odds(&self) -> f64 {
        self.config.start_log_odds
    }

    fn predict(&mut self, motion: &EgoMotion) {
        self.dt_s = motion.dt;
        self.clutter.predict(motion, self.config.clutter_s);
        let config = &self.config;
        self.evidence.values_mut().for_each(|evidence| evidence.predict(motion, config));
    }

    fn initiate(&mut self, id: TrackId, candidate: &Unassociated<'_>) -> Initiation {
        let Unassociated { detection, detector_log_odds, discovered, .. } = *candidate;
        let start_log_odds = self.config.start_log_odds;
        if detection.score < start_log_odds {
            let by_detector = detector_log_odds < start_log_odds;
            return Initiation::Drop(if by_detector { "score" } else { "verifier" });
        }
        let at = detection.position.xy();
        let against = self.clutter.against(&at, self.config.clutter_m);
        // What a search near a lost track finds is mostly that person, or the thing they disappeared
        // behind: it must be believed at once to be somebody else.
        if !discovered && detection.score - against < self.config.confirm_log_odds {
            return Initiation::Drop("no track fits");
        }
        if detection.score - against < start_log_odds {
            self.clutter.renew(&at, self.config.clutter_m);
            return Initiation::Drop("clutter");
        }
        let evidence = Evidence::new(detection.score, at, against, &self.config);
        let health = evidence.health(&self.config);
        self.evidence.insert(id, evidence);
        Initiation::Start(health)
    }

    fn manage(&mut self, tracks: &[ObservedTrack<'_>]) -> TrackChanges {
        let mut changes = TrackChanges::default();
        for ObservedTrack { track, observation, .. } in tracks {
            let at = track.estimate.person.position.xy();
            let clutter = self.clutter.against(&at, self.config.clutter_m);
            let Some(evidence) = self.evidence.get_mut(&track.id) else { continue };
            evidence.add(track, *observation, clutter, self.dt_s, &self.config);
            changes.health.push((track.id, evidence.health(&self.config)));
            let test = evidence.end_test(*observation, track.unseen_s, &self.config);
            let Some(test) = test else { continue };
            changes.ends.push((track.id, test));
            if test == NEVER_MOVED {
                let evidence = evidence.clone();
                self.add_clutter(&evidence);
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
        Some(older.health(&self.config))
    }

    fn stop(&mut self, id: TrackId) {
        self.evidence.remove(&id);
    }

    fn reset(&mut self) {
        self.clutter.clear();
    }
}
