use nalgebra::Point2;
use tagalong_core::{EgoMotion, Observation, Track, TrackHealth};

use crate::Config;

/// Standard deviations of its position by which a track must be away from its start to have
/// moved.
const MOVED_SIGMAS: f64 = 3.0;

/// The evidence gathered for one track.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    pub(crate) log_odds: f64,
    pub(crate) confirmed: bool,
    pub(crate) moved: bool,
    /// Where it started, in the robot's present frame, m.
    start: Point2<f64>,
    /// Where it was at the last look that counted in full, and where the robot was then, both
    /// in the robot's present frame, m.
    look: (Point2<f64>, Point2<f64>),
    age_s: f64,
    missed_s: f64,
    misses: u32,
}

impl Evidence {
    /// Starts with a first look.
    pub(crate) fn new(log_odds: f64, at: Point2<f64>, config: &Config) -> Self {
        let log_odds = log_odds.min(config.max_look);
        Self {
            log_odds,
            confirmed: log_odds >= config.confirm_log_odds,
            moved: false,
            start: at,
            look: (at, Point2::origin()),
            age_s: 0.0,
            missed_s: 0.0,
            misses: 0,
        }
    }

    pub(crate) fn health(&self) -> TrackHealth {
        TrackHealth { confirmed: self.confirmed, log_odds: self.log_odds }
    }

    /// Moves the remembered places into the robot's new frame.
    pub(crate) fn predict(&mut self, motion: &EgoMotion) {
        self.start = motion.apply_to_point(self.start);
        self.look = (motion.apply_to_point(self.look.0), motion.apply_to_point(self.look.1));
        self.age_s += motion.dt;
    }

    /// Adds the evidence of a frame.
    pub(crate) fn add(
        &mut self,
        track: &Track,
        observation: Observation,
        dt_s: f64,
        config: &Config,
    ) {
        match observation {
            Observation::Detected { log_odds } => self.add_look(track, log_odds, config),
            Observation::Updated => self.clear_misses(),
            Observation::Missed => {
                self.missed_s += dt_s;
                self.misses = self.misses.saturating_add(1);
                self.log_odds += config.miss_log_odds;
            }
            Observation::NotSearched => self.missed_s += dt_s,
            Observation::Occluded => self.clear_misses(),
            Observation::Started | Observation::OutOfView => {}
        }
        self.add_motion(track, config);
        self.log_odds = self.log_odds.min(config.max_log_odds);
        self.confirmed |= self.log_odds >= config.confirm_log_odds;
    }

    fn add_look(&mut self, track: &Track, log_odds: f64, config: &Config) {
        self.clear_misses();
        let at = track.estimate.person.position.xy();
        let (place, robot) = self.look;
        let is_new =
            (at - place).norm() >= config.new_look_m || robot.coords.norm() >= config.new_look_m;
        let weight = if is_new { 1.0 } else { config.same_look };
        if is_new {
            self.look = (at, Point2::origin());
        }
        self.log_odds += weight * log_odds.clamp(-config.max_look, config.max_look);
    }

    /// Notes that the track moved, once.
    fn add_motion(&mut self, track: &Track, config: &Config) {
        let covariance = &track.estimate.covariance;
        let sigma = (covariance[(0, 0)] + covariance[(1, 1)]).max(0.0).sqrt();
        let way = (track.estimate.person.position.xy() - self.start).norm();
        if track.seen && !self.moved && way > config.moved_m.max(MOVED_SIGMAS * sigma) {
            self.moved = true;
            self.log_odds += config.moved_log_odds;
        }
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
        if self.log_odds < config.end_log_odds {
            return Some("track: evidence");
        }
        if !self.confirmed && self.misses >= config.tentative_misses {
            return Some("track: not confirmed");
        }
        if !self.confirmed && !self.moved && self.age_s > config.undecided_s {
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
