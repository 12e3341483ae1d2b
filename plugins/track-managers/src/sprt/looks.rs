//! Observations of one track, by the positions of the track and of the robot.

use nalgebra::Point2;
use tagalong_core::EgoMotion;

use crate::sprt::Config;

/// Most looks that are kept; the oldest one is forgotten.
const MOST: usize = 32;
/// A track that was elsewhere, or not seen, for longer did not stay, s.
const PAUSE_S: f64 = 1.0;
/// Weight of a repetition: detections of one thing from one place err alike.
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
    /// Log-odds that are part of [`Looks::past`].
    counted: f64,
    /// Time between the first and the last of them, as far as the track stayed, s.
    stayed_s: f64,
}

impl Look {
    /// Returns the mean log-odds, at most `most` for or against.
    fn mean(&self, most: f64) -> f64 {
        (self.sum / self.count).clamp(-most, most)
    }

    /// Returns the log-odds of all detections together: the mean, and a part of it for each
    /// repetition.
    fn log_odds(&self, config: &Config) -> f64 {
        let weight = (1.0 + REPETITION * (self.count - 1.0)).min(config.repeated);
        weight * self.mean(config.max_look)
    }

    /// Returns the log-odds that are not yet part of [`Looks::past`].
    fn news(&self, config: &Config) -> f64 {
        self.log_odds(config) - self.counted
    }
}

/// Looks at one track. Detections of a thing that stands still, seen by a camera that stands still,
/// err alike: they are one look, and count little more than their mean. Independent looks add up,
/// within bounds, and fade with time: a track may change over from a person to a thing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Looks {
    all: Vec<Look>,
    /// Index of the latest one.
    latest: usize,
    /// Time since the latest one, s.
    ago_s: f64,
    /// Faded sum of the log-odds of earlier looks.
    past: f64,
}

impl Looks {
    /// Moves all places into the robot's new frame, and lets the evidence fade.
    pub(crate) fn predict(&mut self, motion: &EgoMotion, config: &Config) {
        let fade = (-motion.dt / config.look_s).exp();
        for look in &mut self.all {
            look.at = motion.apply_to_point(look.at);
            look.robot = motion.apply_to_point(look.robot);
            look.counted *= fade;
        }
        self.past *= fade;
        self.ago_s += motion.dt;
    }

    /// Adds the log-odds of a detection at a place: to the nearest look, or as a new one.
    pub(crate) fn add(&mut self, at: Point2<f64>, log_odds: f64, config: &Config) {
        let near = self
            .all
            .iter()
            .enumerate()
            .map(|(index, look)| (index, (look.at - at).norm().max(look.robot.coords.norm())));
        let near = near.filter(|(_, away_m)| *away_m < config.new_look_m);
        let nearest = near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index);
        if nearest != Some(self.latest) {
            self.close_latest(config);
        }
        let stayed = nearest == Some(self.latest) && self.ago_s <= PAUSE_S;
        self.latest = nearest.unwrap_or_else(|| self.open(at));
        let look = &mut self.all[self.latest];
        look.sum += log_odds;
        look.count += 1.0;
        look.stayed_s += if stayed { self.ago_s } else { 0.0 };
        self.ago_s = 0.0;
    }

    /// Makes the latest look part of the past.
    fn close_latest(&mut self, config: &Config) {
        let most = config.max_log_odds;
        let fade = self.fade(config);
        if let Some(look) = self.all.get_mut(self.latest) {
            // As much as `log_odds` told last: what faded during a pause does not come back.
            let told = fade * look.news(config);
            self.past = (self.past + told).clamp(-most, most);
            look.counted += told;
        }
    }

    /// Returns the part of the latest look's news that has not faded.
    fn fade(&self, config: &Config) -> f64 {
        (-self.ago_s / config.look_s).exp()
    }

    /// Opens a look, and returns its index.
    fn open(&mut self, at: Point2<f64>) -> usize {
        if self.all.len() == MOST {
            self.all.remove(0);
        }
        let robot = Point2::origin();
        let look = Look { at, robot, sum: 0.0, count: 0.0, counted: 0.0, stayed_s: 0.0 };
        self.all.push(look);
        self.all.len() - 1
    }

    /// Returns the evidence of all looks, log-odds.
    pub(crate) fn log_odds(&self, config: &Config) -> f64 {
        let fade = self.fade(config);
        let news = self.all.get(self.latest).map_or(0.0, |look| look.news(config));
        self.past + fade * news
    }

    /// Returns the mean over all looks but the latest one; 0 without any.
    pub(crate) fn usual(&self, most: f64) -> f64 {
        let others = self.all.iter().enumerate().filter(|(index, _)| *index != self.latest);
        let sum: f64 = others.map(|(_, look)| look.mean(most)).sum();
        sum / (self.all.len() as f64 - 1.0).max(1.0)
    }

    /// Returns the time for which the latest look was repeated, s.
    pub(crate) fn stayed_s(&self) -> f64 {
        self.all.get(self.latest).map_or(0.0, |look| look.stayed_s)
    }

    /// Returns the number of different places of the robot and the track.
    pub(crate) fn places(&self) -> usize {
        self.all.len()
    }

    /// Returns the places of the track with the mean log-odds there.
    pub(crate) fn by_place(&self) -> impl Iterator<Item = (Point2<f64>, f64)> + '_ {
        self.all.iter().map(|look| (look.at, look.sum / look.count))
    }
}
