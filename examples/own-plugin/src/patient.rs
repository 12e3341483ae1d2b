//! A track manager: confirms at once, and ends a track that was unseen for too long.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{
    Initiation, ObservedTrack, TrackChanges, TrackHealth, TrackId, TrackManager, Unassociated,
};

/// Settings of `own-patient`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// A track ends when it was not seen for longer than this, s.
    pub patience_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { patience_s: 2.0 }
    }
}

/// Track manager with one rule.
pub struct OwnPatient(pub Config);

impl TrackManager for OwnPatient {
    fn initiate(&mut self, _: TrackId, new: &Unassociated<'_>) -> Initiation {
        let log_odds = new.detection.score;
        if new.discovered && log_odds >= self.start_log_odds() {
            Initiation::Start(TrackHealth::new(true, log_odds))
        } else {
            Initiation::Drop("score")
        }
    }

    fn manage(&mut self, tracks: &[ObservedTrack<'_>]) -> TrackChanges {
        let unseen = tracks.iter().filter(|t| t.track.unseen_s > self.0.patience_s);
        let ends = unseen.map(|t| (t.track.id, "track: not seen")).collect();
        TrackChanges::new(Vec::new(), ends)
    }
}
