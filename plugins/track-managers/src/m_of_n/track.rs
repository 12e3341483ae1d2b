use tagalong_core::{Observation, TrackHealth};

use crate::m_of_n::Config;

/// Counts of one track.
#[derive(Clone, Debug)]
pub(crate) struct TrackCount {
    pub(crate) score: f64,
    pub(crate) confirmed: bool,
    pub(crate) observation: Observation,
    /// For how long, and how often in a row, it should have been seen and was not.
    pub(crate) missed_s: f64,
    pub(crate) misses: u32,
    /// Hits (1) and misses (0) of the last frames, newest in the lowest bit.
    recent: u32,
}

impl TrackCount {
    /// Starts to count a track with the score of its first detection.
    pub(crate) fn new(score: f64, settings: &Config) -> Self {
        Self {
            score,
            confirmed: score >= settings.confirm_score || settings.confirm_hits <= 1,
            observation: Observation::Started,
            missed_s: 0.0,
            misses: 0,
            recent: 1,
        }
    }

    pub(crate) fn health(&self) -> TrackHealth {
        TrackHealth::new(self.confirmed, self.score)
    }

    /// Adds the observation of the track in one frame, `dt_s` after the last one.
    pub(crate) fn observe(&mut self, observation: Observation, dt_s: f64, settings: &Config) {
        self.observation = observation;
        match observation {
            Observation::Detected { log_odds } => self.hit(Some(log_odds), dt_s, settings),
            Observation::Updated => self.hit(None, dt_s, settings),
            Observation::Missed => self.miss(dt_s, settings),
            Observation::NotSearched => self.missed_s += dt_s,
            Observation::Occluded => self.clear_misses(),
            // `Started`, `OutOfView`, and what a later version adds, are no evidence.
            _ => {}
        }
    }

    fn hit(&mut self, log_odds: Option<f64>, dt_s: f64, settings: &Config) {
        self.clear_misses();
        self.remember(true, settings);
        if let Some(log_odds) = log_odds {
            self.score += settings.score_weight * (log_odds - self.score);
            self.confirmed |= log_odds >= settings.confirm_score;
        }
        let is_likely = self.score >= settings.start_score;
        self.confirmed |= is_likely && self.has_enough_hits(dt_s, settings);
    }

    fn has_enough_hits(&self, dt_s: f64, settings: &Config) -> bool {
        let far_apart = settings.confirm_apart_s > 0.0 && dt_s >= settings.confirm_apart_s;
        let twice_in_a_row = self.recent & 0b11 == 0b11;
        self.recent.count_ones() >= settings.confirm_hits || far_apart && twice_in_a_row
    }

    fn miss(&mut self, dt_s: f64, settings: &Config) {
        self.missed_s += dt_s;
        self.misses = self.misses.saturating_add(1);
        self.remember(false, settings);
        if self.score > settings.miss_score {
            self.score += settings.score_weight * (settings.miss_score - self.score);
        }
    }

    fn clear_misses(&mut self) {
        self.missed_s = 0.0;
        self.misses = 0;
    }

    fn remember(&mut self, hit: bool, settings: &Config) {
        let window = u32::MAX >> (32 - settings.confirm_within.clamp(1, 32));
        self.recent = (self.recent << 1 | u32::from(hit)) & window;
    }

    /// Returns the test by which the track ends, if it does, `unseen_s` after its last support.
    pub(crate) fn end_test(&self, unseen_s: f64, settings: &Config) -> Option<&'static str> {
        if self.observation == Observation::Started {
            return None;
        }
        if self.score < settings.drop_score {
            return Some("track: score");
        }
        if !self.confirmed && self.misses >= settings.tentative_misses {
            return Some("track: not confirmed");
        }
        let (over, test) = match self.observation {
            Observation::Occluded => {
                (unseen_s > settings.occluded_drop_after_s, "track: hidden too long")
            }
            Observation::OutOfView => {
                (unseen_s > settings.left_drop_after_s, "track: left the image")
            }
            Observation::Missed | Observation::NotSearched => {
                let long = self.missed_s > settings.drop_after_s
                    || unseen_s > settings.occluded_drop_after_s;
                (long && self.misses >= settings.drop_after_misses, "track: not seen")
            }
            _ => (false, ""),
        };
        over.then_some(test)
    }
}
