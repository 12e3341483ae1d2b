//! Positions at which candidates were rejected before.
//!
//! A coat stand that was rejected in twenty frames is not a person because one frame is classified
//! wrongly. The log-odds of all candidates at one position are accumulated, and decay, like those
//! of a track (P4, section II-C, has neither).

use nalgebra::Point2;
use tagalong_core::{Detection, EgoMotion};

use crate::m_of_n::Config;

/// ClutterMap fade out below this, log-odds.
const FAINT: f64 = 0.05;

/// Where candidates were rejected, in the frame of the robot.
#[derive(Clone, Debug, Default)]
pub(crate) struct ClutterMap {
    places: Vec<ClutterCell>,
}

#[derive(Clone, Debug)]
struct ClutterCell {
    at: Point2<f64>,
    /// Sum of the evidence, below zero.
    log_odds: f64,
}

impl ClutterMap {
    /// The robot moves on, time passes.
    pub(crate) fn predict(&mut self, motion: &EgoMotion, settings: &Config) {
        let faded = (-motion.dt / settings.doubt_s).exp();
        for place in &mut self.places {
            place.at = motion.apply_to_point(place.at);
            place.log_odds *= faded;
        }
        self.places.retain(|place| place.log_odds < -FAINT);
    }

    /// The log-odds that a newcomer is a person, with all that was said of the place
    /// before. Below `start_score` they are remembered.
    pub(crate) fn add_evidence(&mut self, detection: &Detection, settings: &Config) -> f64 {
        if settings.doubt_s <= 0.0 {
            return detection.score;
        }
        let at = detection.position.xy();
        let before = self.take(&at, settings.doubt_m);
        let sum = detection.score + before;
        if sum < settings.start_score {
            let log_odds = sum.max(-settings.doubt_limit);
            self.places.push(ClutterCell { at, log_odds });
        }
        sum
    }

    /// Forgets everything: the clock jumped, the robot may be anywhere.
    pub(crate) fn clear(&mut self) {
        self.places.clear();
    }

    /// Removes and returns the evidence at the nearest place within a radius, m.
    fn take(&mut self, at: &Point2<f64>, radius_m: f64) -> f64 {
        let places = self.places.iter().enumerate();
        let near = places
            .map(|(index, place)| (index, (place.at - at).norm()))
            .filter(|(_, off_m)| *off_m <= radius_m);
        match near.min_by(|(_, a), (_, b)| a.total_cmp(b)) {
            Some((index, _)) => self.places.swap_remove(index).log_odds,
            None => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::m_of_n::tests::{person, scored};

    fn settings() -> Config {
        Config { doubt_s: 2.0, ..Config::default() }
    }

    #[test]
    fn what_was_said_of_a_place_adds_up_to_a_limit() {
        let mut clutter = ClutterMap::default();
        let until_the_limit = [(-2.0, -2.0), (-3.0, -5.0), (-4.0, -9.0)];
        // From -6 on.
        let afterwards = [(4.0, -2.0), (1.0, -1.0), (3.0, 2.0), (3.0, 3.0)];
        for (score, expected) in until_the_limit.into_iter().chain(afterwards) {
            let said = clutter.add_evidence(&scored(score, person(3.0, 0.0)), &settings());
            assert_eq!(said, expected, "{score}");
        }
    }

    #[test]
    fn each_newcomer_is_judged_alone_unless_the_config_says_otherwise() {
        let mut clutter = ClutterMap::default();
        let alone = Config::default();
        for score in [-5.0, -5.0, 1.0] {
            assert_eq!(clutter.add_evidence(&scored(score, person(3.0, 0.0)), &alone), score);
        }
    }

    #[test]
    fn a_place_stays_where_it_is_while_the_robot_turns_and_drives() {
        let mut clutter = ClutterMap::default();
        clutter.add_evidence(&scored(-4.0, person(3.0, 0.0)), &settings());
        let turn = std::f64::consts::FRAC_PI_2;
        let motion = EgoMotion { forward: 1.0, turn, ..EgoMotion::at_rest(0.0) };
        clutter.predict(&motion, &settings());
        assert_eq!(
            clutter.clone().add_evidence(&person(3.0, 0.0), &settings()),
            1.0,
            "another place"
        );
        assert_eq!(clutter.add_evidence(&person(0.0, -2.0), &settings()), -3.0);
    }

    #[test]
    fn clutter_fade() {
        let mut clutter = ClutterMap::default();
        clutter.add_evidence(&scored(-4.0, person(3.0, 0.0)), &settings());
        clutter.predict(&EgoMotion::at_rest(2.0), &settings());
        let log_odds = clutter.clone().add_evidence(&person(3.0, 0.0), &settings());
        assert!((log_odds - (1.0 - 4.0 / std::f64::consts::E)).abs() < 1e-12, "{log_odds}");
        clutter.predict(&EgoMotion::at_rest(20.0), &settings());
        assert!(clutter.places.is_empty());
    }

    #[test]
    fn each_place_is_doubted_by_itself() {
        let mut clutter = ClutterMap::default();
        clutter.add_evidence(&scored(-4.0, person(3.0, 0.0)), &settings());
        clutter.add_evidence(&scored(-2.0, person(3.0, 0.5)), &settings());
        assert_eq!(
            [0.0, 0.2, 0.29, 0.81]
                .map(|y| clutter.clone().add_evidence(&person(3.0, y), &settings())),
            [-3.0, -3.0, -1.0, 1.0],
            "the nearest counts"
        );
        clutter.clear();
        assert_eq!(clutter.add_evidence(&person(3.0, 0.0), &settings()), 1.0);
    }

    #[test]
    fn who_is_believed_after_all_leaves_no_doubt() {
        let mut clutter = ClutterMap::default();
        clutter.add_evidence(&scored(-1.0, person(3.0, 0.0)), &settings());
        assert_eq!(clutter.add_evidence(&scored(1.0, person(3.0, 0.0)), &settings()), 0.0);
        assert_eq!(clutter.add_evidence(&scored(1.0, person(3.0, 0.0)), &settings()), 1.0);
    }

    #[test]
    fn a_candidate_at_the_bound_is_not_remembered() {
        let mut clutter = ClutterMap::default();
        let settings = Config { start_score: -1.0, ..settings() };
        for _ in 0..2 {
            let seen = scored(-1.0, person(3.0, 0.0));
            assert_eq!(clutter.add_evidence(&seen, &settings), -1.0);
        }
    }

    #[test]
    fn faint_clutter_are_forgotten() {
        let mut clutter = ClutterMap::default();
        clutter.add_evidence(&scored(-0.06, person(3.0, 0.0)), &settings());
        clutter.predict(&EgoMotion::at_rest(0.1), &settings());
        assert_eq!(clutter.places.len(), 1);
        clutter.predict(&EgoMotion::at_rest(0.5), &settings());
        assert!(clutter.places.is_empty());
    }
}
