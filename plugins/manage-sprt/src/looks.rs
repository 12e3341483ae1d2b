//! Looks at one track, by the places of the track and of the robot.

use nalgebra::Point2;
use tagalong_core::EgoMotion;

use crate::Config;

/// Most looks that are kept; the oldest ones are merged.
const MOST: usize = 32;

/// A track that was elsewhere, or not seen, for longer did not stay, s.
const PAUSE_S: f64 = 1.0;

/// What a repetition counts: detections of one thing from one place err alike.
const REPETITION: f64 = 0.1;

/// Repeated looks at a track from one place, at one place.
#[derive(Clone, Copy, Debug)]
struct Look {
    /// Where the track was, in the robot's present frame, m.
    at: Point2<f64>,
    /// Where the robot was, in its present frame, m.
    robot: Point2<f64>,
    /// Sum of the log-odds, and their number.
    sum: f64,
    count: f64,
    /// Time since the last of them, s.
    ago_s: f64,
    /// Time between the first and the last of them, as far as the track stayed, s.
    stayed_s: f64,
}

impl Look {
    fn mean(&self) -> f64 {
        self.sum / self.count
    }

    /// Returns the log-odds of all detections together: the mean, and a part of it for each
    /// repetition, up to `repeated` times the mean.
    fn log_odds(&self, most: f64, repeated: f64) -> f64 {
        let weight = (1.0 + REPETITION * (self.count - 1.0)).min(repeated);
        weight * self.mean().clamp(-most, most)
    }
}

/// Looks at one track. Detections of a thing that stands still, seen by a camera that stands still,
/// err alike: they are one look, and count little more than their mean. Independent looks add up,
/// and fade with time: a track may have changed over from a person to a thing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Looks {
    all: Vec<Look>,
}

impl Looks {
    /// Moves all places into the robot's new frame.
    pub(crate) fn predict(&mut self, motion: &EgoMotion) {
        for look in &mut self.all {
            look.at = motion.apply_to_point(look.at);
            look.robot = motion.apply_to_point(look.robot);
            look.ago_s += motion.dt;
        }
    }

    /// Adds the log-odds of a detection at a place: to the nearest look within `new_look_m`, or as a
    /// new one.
    pub(crate) fn add(&mut self, at: Point2<f64>, log_odds: f64, new_look_m: f64) {
        let away = |look: &Look| (look.at - at).norm().max(look.robot.coords.norm());
        let nearest = self.all.iter_mut().min_by(|a, b| away(a).total_cmp(&away(b)));
        match nearest.filter(|look| away(look) < new_look_m) {
            Some(look) => {
                look.sum += log_odds;
                look.count += 1.0;
                look.stayed_s += if look.ago_s <= PAUSE_S { look.ago_s } else { 0.0 };
                look.ago_s = 0.0;
            }
            None => {
                let (robot, sum) = (Point2::origin(), log_odds);
                let look = Look { at, robot, sum, count: 1.0, ago_s: 0.0, stayed_s: 0.0 };
                self.all.push(look);
                if self.all.len() > MOST {
                    self.all.remove(0);
                }
            }
        }
    }

    /// Returns the sum over independent looks, faded with time.
    pub(crate) fn log_odds(&self, config: &Config) -> f64 {
        let faded = |look: &Look| (-look.ago_s / config.look_s).exp();
        let all = self.all.iter();
        all.map(|look| faded(look) * look.log_odds(config.max_look, config.repeated)).sum()
    }

    /// Returns the mean over all looks, each at most `most`, without the latest one; 0 without any.
    pub(crate) fn usual(&self, most: f64) -> f64 {
        let latest = self.latest().map_or(0.0, |look| look.mean().clamp(-most, most));
        let sum: f64 = self.all.iter().map(|look| look.mean().clamp(-most, most)).sum();
        (sum - latest) / (self.all.len() as f64 - 1.0).max(1.0)
    }

    /// Returns the time for which the latest look was repeated, s.
    pub(crate) fn stayed_s(&self) -> f64 {
        self.latest().map_or(0.0, |look| look.stayed_s)
    }

    fn latest(&self) -> Option<&Look> {
        self.all.iter().min_by(|a, b| a.ago_s.total_cmp(&b.ago_s))
    }

    /// Returns the number of different places of the robot and the track.
    pub(crate) fn places(&self) -> usize {
        self.all.len()
    }

    /// Returns the places of the track with the mean log-odds there.
    pub(crate) fn by_place(&self) -> impl Iterator<Item = (Point2<f64>, f64)> + '_ {
        self.all.iter().map(|look| (look.at, look.mean()))
    }
}
