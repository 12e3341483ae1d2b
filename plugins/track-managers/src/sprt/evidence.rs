use nalgebra::Point2;
use tagalong_core::{EgoMotion, Observation, Track, TrackHealth};

use crate::sprt::Config;
use crate::sprt::looks::Looks;

/// Standard deviations of its position by which a track must be away from its start to have
/// moved.
const MOVED_SIGMAS: f64 = 3.0;
/// Places at which a track must have been to have moved: what a detector finds now at one end of a
/// thing and now at the other has two.
const MOVED_PLACES: usize = 3;
/// Sightings in a row away from the start that a moving track must have: the detection of a person
/// who passes a thing may go to the track of the thing once.
const MOVED_SIGHTINGS: u32 = 2;

/// The evidence gathered for one track.
#[derive(Clone, Debug, Default)]
pub(crate) struct Evidence {
    pub(crate) confirmed: bool,
    pub(crate) moved: bool,
    /// Looks at the track.
    looks: Looks,
    /// Log-odds against a person at the place where the track started.
    clutter: f64,
    /// Where it started, in the robot's present frame, m.
    start: Point2<f64>,
    /// Sightings in a row away from the start.
    away: u32,
    age_s: f64,
    /// Time for which it was seen without having moved, s.
    still_s: f64,
    /// Time for which it has been less likely a person than not, without having moved, s.
    doubted_s: f64,
    /// Time for which it was seen by the filter alone, s.
    unverified_s: f64,
    missed_s: f64,
    misses: u32,
}

impl Evidence {
    /// Starts with a first look at a place for which there is evidence against a person.
    pub(crate) fn new(look: f64, at: Point2<f64>, clutter: f64, config: &Config) -> Self {
        let mut looks = Looks::default();
        looks.add(at, look, config);
        let mut new = Self { looks, clutter, start: at, ..Self::default() };
        new.confirmed = new.log_odds(config) >= config.confirm_log_odds;
        new
    }

    pub(crate) fn health(&self, config: &Config) -> TrackHealth {
        TrackHealth::new(self.confirmed, self.log_odds(config))
    }

    /// Returns the log-odds that the track is a person.
    pub(crate) fn log_odds(&self, config: &Config) -> f64 {
        let looks = self.looks.log_odds(config) - self.clutter;
        let known = (looks + self.motion_log_odds(config)).min(config.max_log_odds);
        let unverified = config.unverified_log_odds * self.unverified_s;
        known + unverified + config.miss_log_odds * f64::from(self.misses)
    }

    /// Returns the evidence of the track's motion, or of its absence.
    fn motion_log_odds(&self, config: &Config) -> f64 {
        if !self.moved {
            return (config.still_log_odds * self.still_s).max(config.max_still);
        }
        // A person who stops goes on looking like a person. A track that changed over to a thing
        // does not, and the looks at the person before speak against the thing.
        let stayed = (self.looks.stayed_s() / config.undecided_s).min(1.0);
        config.moved_log_odds - stayed * config.usual * self.looks.usual(config.max_look).max(0.0)
    }

    /// Returns the looks at the track.
    pub(crate) fn looks(&self) -> &Looks {
        &self.looks
    }

    /// Moves what is remembered into the robot's new frame.
    pub(crate) fn predict(&mut self, motion: &EgoMotion, config: &Config) {
        self.start = motion.apply_to_point(self.start);
        self.looks.predict(motion, config);
        self.age_s += motion.dt;
    }

    /// Adds what a frame says. `clutter` are log-odds against a person at the track's place.
    pub(crate) fn add(
        &mut self,
        track: &Track,
        observation: Observation,
        clutter: f64,
        dt_s: f64,
        config: &Config,
    ) {
        match observation {
            Observation::Detected { log_odds } => {
                self.clear_misses();
                self.unverified_s = 0.0;
                let at = track.estimate.person.position.xy();
                self.looks.add(at, log_odds - clutter, config);
            }
            Observation::Updated => {
                self.clear_misses();
                self.unverified_s += dt_s;
            }
            Observation::Occluded => self.clear_misses(),
            Observation::Missed => {
                self.missed_s += dt_s;
                self.misses = self.misses.saturating_add(1);
            }
            Observation::NotSearched => self.missed_s += dt_s,
            // `Started`, `OutOfView`, and what a later version adds, are no evidence.
            _ => {}
        }
        if track.seen {
            // A lost track that takes a thing beside it has not walked there.
            let is_thing =
                matches!(observation, Observation::Detected { log_odds } if log_odds <= clutter);
            if !is_thing {
                self.add_motion(track, config);
            }
            self.still_s += if self.moved { 0.0 } else { dt_s };
        }
        let log_odds = self.log_odds(config);
        if self.moved || log_odds >= config.start_log_odds {
            self.doubted_s = 0.0;
        } else if matches!(observation, Observation::Detected { .. }) {
            self.doubted_s += dt_s;
        }
        self.confirmed |= log_odds >= config.confirm_log_odds;
    }

    /// Notes that the track moved, once.
    fn add_motion(&mut self, track: &Track, config: &Config) {
        let covariance = &track.estimate.covariance;
        let sigma = (covariance[(0, 0)] + covariance[(1, 1)]).max(0.0).sqrt();
        let way = (track.estimate.person.position.xy() - self.start).norm();
        let is_away = way > config.moved_m.max(MOVED_SIGMAS * sigma);
        self.away = if is_away { self.away.saturating_add(1) } else { 0 };
        self.moved |= self.away >= MOVED_SIGHTINGS && self.looks.places() >= MOVED_PLACES;
    }

    fn clear_misses(&mut self) {
        self.missed_s = 0.0;
        self.misses = 0;
    }

    /// Returns the test by which the track ends, if it does.
    pub(crate) fn end_test(
        &self,
        observation: Observation,
        unseen_s: f64,
        config: &Config,
    ) -> Option<&'static str> {
        if observation == Observation::Started {
            return None;
        }
        if self.log_odds(config) < config.end_log_odds {
            return Some(if self.moved { "track: evidence" } else { NEVER_MOVED });
        }
        if !self.confirmed && self.misses >= config.tentative_misses {
            return Some("track: not confirmed");
        }
        let is_undecided = !self.confirmed && !self.moved && self.age_s > config.undecided_s;
        if is_undecided || self.doubted_s > config.doubted_s {
            return Some(NEVER_MOVED);
        }
        let (limit_s, test) = match observation {
            Observation::Occluded => (config.occluded_drop_after_s, "track: hidden too long"),
            Observation::OutOfView => (config.left_drop_after_s, "track: left the image"),
            Observation::Missed if self.missed_s > config.drop_after_s => (0.0, "track: not seen"),
            Observation::NotSearched => (config.occluded_drop_after_s, "track: not seen"),
            _ => return None,
        };
        (unseen_s > limit_s).then_some(test)
    }
}

/// The test of a track that did not move and was not proven otherwise.
pub(crate) const NEVER_MOVED: &str = "track: never moved";
