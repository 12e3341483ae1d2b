//! Positions of objects that are not people, in the robot frame, moved along with the world.

use nalgebra::Point2;
use tagalong_core::EgoMotion;

/// Clutter that counts for less, log-odds, is forgotten.
const FAINT: f64 = 0.05;

#[derive(Clone, Debug)]
struct ClutterCell {
    at: Point2<f64>,
    /// Evidence against a person when the thing was seen last, log-odds above 0.
    against: f64,
    /// Part of it that is left, 0 to 1.
    left: f64,
}

/// Evidence against persons, by place.
#[derive(Clone, Debug, Default)]
pub(crate) struct ClutterMap {
    places: Vec<ClutterCell>,
}

impl ClutterMap {
    /// Moves all places into the robot's new frame, and lets them fade with a time constant, s.
    pub(crate) fn predict(&mut self, motion: &EgoMotion, time_constant_s: f64) {
        let faded = (-motion.dt / time_constant_s).exp();
        for place in &mut self.places {
            place.at = motion.apply_to_point(place.at);
            place.left *= faded;
        }
        self.places.retain(|place| place.against * place.left > FAINT);
    }

    /// Returns how much speaks against a person at a place.
    pub(crate) fn against(&self, at: &Point2<f64>, within_m: f64) -> f64 {
        let near = self.places.iter().filter(|place| (place.at - at).norm() <= within_m);
        near.map(|place| place.against * place.left).fold(0.0, f64::max)
    }

    /// Notes that the thing at a place is still there.
    pub(crate) fn renew(&mut self, at: &Point2<f64>, within_m: f64) {
        let near = self.places.iter_mut().filter(|place| (place.at - at).norm() <= within_m);
        near.for_each(|place| place.left = 1.0);
    }

    /// Adds a place with evidence against persons.
    pub(crate) fn add(&mut self, at: Point2<f64>, against: f64, within_m: f64) {
        // Half the radius: so that places beside each other do not leave a gap.
        let near = self.places.iter_mut().filter(|place| (place.at - at).norm() <= 0.5 * within_m);
        let nearest = near.min_by(|a, b| (a.at - at).norm().total_cmp(&(b.at - at).norm()));
        match nearest {
            Some(place) => {
                (place.against, place.left) = ((place.against * place.left).max(against), 1.0);
            }
            None => self.places.push(ClutterCell { at, against, left: 1.0 }),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.places.clear();
    }
}
