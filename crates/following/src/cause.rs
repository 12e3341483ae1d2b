//! Cause of a stop or of a lower speed, by name and with its distance.

use std::fmt;

use nalgebra::Point2;
use tagalong_core::{Reason, Track, TrackId};

use crate::collision_monitor::{Allowance, CollisionMonitor};

/// Distance from a track within which a place is that of the person, m.
const OF_PERSON_M: f64 = 0.4;

/// Cause of the reason of a command.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Cause {
    /// A place that limits the speed.
    Place(PlaceCause),
    /// A sensor that is frozen.
    Sensor {
        /// Name of the sensor.
        name: String,
        /// True if the stop lasts until a person has checked the robot and resets it.
        needs_reset: bool,
        /// True if the images show an earlier time: so do boxes and places of people.
        shows_past: bool,
    },
    /// The fault that was latched first, which holds until the robot is armed again.
    Fault(&'static str),
}

/// Place that limits the speed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PlaceCause {
    /// The person there, if it is a tracked one.
    pub track: Option<TrackId>,
    /// True if that is the followed person.
    pub is_target: bool,
    /// The place in the robot frame, m.
    pub at: Point2<f64>,
    /// Distance of it from the outline of the robot, m.
    pub distance_m: f64,
    /// Distance below which the robot is slower, or does not drive, m; `None` for a place inside a
    /// polygon of the settings.
    pub limit_m: Option<f64>,
}

impl Cause {
    /// Finds the cause of a reason: among the allowances that were asked for, in their order, or
    /// among the sensors, or the latched fault.
    pub(crate) fn of(
        reason: Reason,
        fault: Option<&'static str>,
        asked: &[Allowance],
        monitor: &CollisionMonitor,
        tracks: &[Track],
        target: Option<TrackId>,
    ) -> Option<Self> {
        if reason == Reason::Fault {
            return fault.map(Self::Fault);
        }
        if reason == Reason::Frozen {
            let (name, needs_reset) = monitor.frozen_sensor()?;
            return Some(Self::Sensor { name, needs_reset, shows_past: monitor.shows_past() });
        }
        let is_person = match reason {
            Reason::Near | Reason::TooClose => true,
            Reason::Obstacle | Reason::Blocked => false,
            _ => return None,
        };
        // The polygons stop and slow down whatever the path allows.
        if let Some((at, distance_m)) = monitor.place_in_zone(reason) {
            return Some(
                Self::at_place(at, distance_m, None, is_person, tracks).for_target(target),
            );
        }
        let stops = !reason.moves();
        let why = asked.iter().filter(|it| reason == if stops { it.stops } else { it.slower });
        let place = why.filter_map(|allowed| allowed.by).next()?;
        let limit_m = if stops { place.stop_m } else { place.slower_m };
        let limit_m = Some(limit_m);
        let cause = Self::at_place(place.at, place.distance_m, limit_m, is_person, tracks);
        Some(cause.for_target(target))
    }

    /// Notes whether the person at the place is the followed one.
    fn for_target(self, target: Option<TrackId>) -> Self {
        match self {
            Self::Place(place) => {
                let is_target = place.track.is_some() && place.track == target;
                Self::Place(PlaceCause { is_target, ..place })
            }
            other => other,
        }
    }

    fn at_place(
        at: Point2<f64>,
        distance_m: f64,
        limit_m: Option<f64>,
        is_person: bool,
        tracks: &[Track],
    ) -> Self {
        let mut nearest: Option<(TrackId, f64)> = None;
        for track in tracks.iter().filter(|track| is_person && track.confirmed) {
            let away_m = (track.estimate.person.position.xy() - at).norm();
            if away_m <= OF_PERSON_M && nearest.is_none_or(|(_, least_m)| away_m < least_m) {
                nearest = Some((track.id, away_m));
            }
        }
        let track = nearest.map(|(id, _)| id);
        Self::Place(PlaceCause { track, is_target: false, at, distance_m, limit_m })
    }
}

/// In words that follow the sentence of the reason.
impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Place(place) => place.fmt(f),
            Self::Sensor { name, needs_reset: true, .. } => {
                write!(f, "{name}; the robot stands until a reset: check the sensor first")
            }
            Self::Sensor { name, needs_reset: false, .. } => {
                write!(f, "{name}; the robot stands until it delivers new readings")
            }
            Self::Fault(why) => f.write_str(why),
        }
    }
}

impl fmt::Display for PlaceCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.track {
            Some(id) if self.is_target => write!(f, "the followed person {id}")?,
            Some(id) => write!(f, "person {id}")?,
            None => {
                let side = if self.at.y < 0.0 { "right" } else { "left" };
                let way = if self.at.x < 0.0 { "behind" } else { "ahead" };
                let [x, y] = [self.at.x.abs(), self.at.y.abs()];
                write!(f, "the place {x:.1} m {way}, {y:.1} m to the {side}")?;
            }
        }
        write!(f, ", {:.2} m from the edge of the robot, ", self.distance_m.max(0.0))?;
        match self.limit_m {
            Some(limit_m) => write!(f, "limit {limit_m:.2} m"),
            None => f.write_str("inside a zone of the settings"),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use tagalong_conformance::target;

    use super::*;

    #[test]
    fn a_person_is_named_by_the_track_and_a_thing_by_its_place() {
        let track = target(1.3, 0.1, Vector2::zeros()).with_id(TrackId(3)).with_confirmed(true);
        let at = Point2::new(1.1, 0.1);
        let person = Cause::at_place(at, 0.84, Some(1.5), true, std::slice::from_ref(&track));
        assert_eq!(person.to_string(), "person 3, 0.84 m from the edge of the robot, limit 1.50 m");
        let followed = person.clone().for_target(Some(TrackId(3))).to_string();
        assert!(followed.starts_with("the followed person 3, 0.84 m from the edge"), "{followed}");
        assert_eq!(person.clone().for_target(Some(TrackId(4))), person);
        let thing = Cause::at_place(at, 0.84, None, false, &[track]);
        assert_eq!(
            thing.to_string(),
            "the place 1.1 m ahead, 0.1 m to the left, 0.84 m from the edge of the robot, \
             inside a zone of the settings"
        );
    }

    #[test]
    fn a_frozen_sensor_says_whether_a_reset_is_needed() {
        for (needs_reset, words) in [
            (true, "the robot stands until a reset: check the sensor first"),
            (false, "the robot stands until it delivers new readings"),
        ] {
            let name = "the depth image".to_owned();
            let cause = Cause::Sensor { name, needs_reset, shows_past: true };
            assert_eq!(cause.to_string(), format!("the depth image; {words}"));
        }
    }
}
