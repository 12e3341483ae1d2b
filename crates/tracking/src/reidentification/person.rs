//! Memory of one person.

use std::collections::BTreeSet;

use nalgebra::{Point2, Vector2};
use tagalong_core::{EgoMotion, TrackId};
use tagalong_vision::{Appearance, Gallery};

use super::ReidentificationSettings;

/// First appearances that are never forgotten.
const KEPT: usize = 4;
/// Distance beyond the largest speed that a person may have moved, m.
const REACH_M: f64 = 0.6;

/// A person, with a track or without.
#[derive(Clone, Debug)]
pub(crate) struct Person {
    /// Number that the person is reported with.
    pub(crate) number: TrackId,
    gallery: Gallery,
    /// Sum of the heights of the head, m, and their number.
    heights: (f64, f64),
    /// Where the person was seen last, robot frame, m; `None` after a jump of the clock.
    place: Option<Point2<f64>>,
    /// Velocity at that time, m/s.
    velocity: Vector2<f64>,
    /// Time since then, s.
    ago_s: f64,
}

impl Person {
    pub(crate) fn new(number: TrackId, place: Point2<f64>) -> Self {
        let gallery = Gallery::default();
        let heights = (0.0, 0.0);
        let velocity = Vector2::zeros();
        Self { number, gallery, heights, place: Some(place), velocity, ago_s: 0.0 }
    }

    /// Moves the memory into the robot's new frame.
    pub(crate) fn predict(&mut self, motion: &EgoMotion) {
        self.place = self.place.map(|place| motion.apply_to_point(place));
        self.velocity = motion.apply_to_velocity(self.velocity);
        self.ago_s += motion.dt;
    }

    /// Forgets the place, which is not known after a pause in which the robot may have moved.
    pub(crate) fn lose_place(&mut self, pause_s: f64) {
        self.place = None;
        self.ago_s += pause_s;
    }

    /// Records that the person was seen at a place, with a velocity.
    pub(crate) fn see(&mut self, place: Point2<f64>, velocity: Vector2<f64>) {
        self.place = Some(place);
        self.velocity = velocity;
        self.ago_s = 0.0;
    }

    pub(crate) fn learn(&mut self, appearance: Appearance) {
        self.heights = (self.heights.0 + appearance.height_m, self.heights.1 + 1.0);
        self.gallery.add(appearance, KEPT);
    }

    /// Returns true once the appearance of the person is known.
    pub(crate) fn is_known(&self) -> bool {
        !self.gallery.is_empty()
    }

    pub(crate) fn is_forgotten(&self, settings: &ReidentificationSettings) -> bool {
        self.ago_s > settings.remember_s
    }

    /// Returns the mean difference of appearances from those of the person.
    pub(crate) fn difference(&self, appearances: &[Appearance]) -> Option<f64> {
        let all: Vec<f64> = appearances
            .iter()
            .filter_map(|appearance| self.gallery.nearest(appearance)?.mean())
            .collect();
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    }

    /// Returns true if the person can be this tall.
    pub(crate) fn fits_height(
        &self,
        appearances: &[Appearance],
        settings: &ReidentificationSettings,
    ) -> bool {
        let sum: f64 = appearances.iter().map(|appearance| appearance.height_m).sum();
        let height_m = sum / appearances.len() as f64;
        (height_m - self.heights.0 / self.heights.1).abs() <= settings.max_height_m
    }

    /// Returns true if the person can have been at a place this long ago: not farther away than at
    /// the largest speed, and without turning faster than people do.
    pub(crate) fn reaches(
        &self,
        place: Point2<f64>,
        since_s: f64,
        settings: &ReidentificationSettings,
    ) -> bool {
        let Some(last) = self.place else { return true };
        let time_s = (self.ago_s - since_s).max(0.0);
        let coasted = last + self.velocity * time_s;
        let turn_m = 0.5 * settings.max_acceleration_mps2 * time_s * time_s;
        (place - last).norm() <= REACH_M + settings.max_speed_mps * time_s
            && (place - coasted).norm() <= REACH_M + turn_m
    }
}

/// Knowledge of a track beside the person that it is taken for.
#[derive(Clone, Debug)]
pub(crate) struct Identity {
    pub(crate) person: Person,
    /// Latest appearances that are not yet certain to be of this person: of a new track, and after
    /// other tracks were near.
    pub(crate) unsure: Vec<Appearance>,
    /// Where the track started, robot frame, m.
    pub(crate) start: Point2<f64>,
    /// Time since the track started, s.
    pub(crate) age_s: f64,
    /// True until a new track is known to be a new person, or one who came back.
    pub(crate) is_new: bool,
    /// True once the track was reported.
    pub(crate) reported: bool,
    /// Numbers of the people with whom the track may have changed over.
    pub(crate) rivals: BTreeSet<TrackId>,
    /// Index of the first frame of which the number may be wrong: that of the start or, with rivals,
    /// the one after the last contact.
    pub(crate) unsure_since: u64,
}

impl Identity {
    pub(crate) fn new(track: TrackId, place: Point2<f64>, frame: u64) -> Self {
        Self {
            person: Person::new(track, place),
            unsure: Vec::new(),
            start: place,
            age_s: 0.0,
            is_new: true,
            reported: false,
            rivals: BTreeSet::new(),
            unsure_since: frame,
        }
    }

    /// Takes in an appearance: into the memory of the person if it is certain whose it is.
    pub(crate) fn add(&mut self, appearance: Appearance) {
        if self.is_new || !self.rivals.is_empty() {
            self.unsure.push(appearance);
        } else {
            self.person.learn(appearance);
        }
    }

    /// Returns the difference of an appearance from the nearest one of the track's person; `None` if
    /// there is none to compare.
    pub(crate) fn difference(&self, appearance: &Appearance) -> Option<f64> {
        // The appearances of a new track are its own; those after a contact may be of another person.
        let unsure: &[Appearance] = if self.is_new { &self.unsure } else { &[] };
        let known = self.person.gallery.nearest(appearance).and_then(|nearest| nearest.mean());
        let new = unsure.iter().filter_map(|own| own.difference(appearance).mean());
        known.into_iter().chain(new).min_by(f64::total_cmp)
    }

    /// Decides that the track is of its person.
    pub(crate) fn settle(&mut self) {
        self.is_new = false;
        self.rivals.clear();
        for appearance in std::mem::take(&mut self.unsure) {
            self.person.learn(appearance);
        }
    }
}
