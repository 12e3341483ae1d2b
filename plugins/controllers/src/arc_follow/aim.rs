use nalgebra::{Point2, Vector2};
use tagalong_core::{EgoMotion, Person};

/// Where the target is in robot axes when the wheels answer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aim {
    /// Distance on the floor, m.
    pub(crate) range_m: f64,
    /// Angle from straight ahead, rad, counter-clockwise, -pi to pi.
    pub(crate) bearing: f64,
    /// Sine of the bearing; zero at the origin.
    pub(crate) sine: f64,
    /// Speed at which the person goes away from the robot's place, over ground, m/s.
    pub(crate) receding_mps: f64,
}

impl Aim {
    /// The person after the robot's motion to come, during which they keep
    /// their velocity. `None` if they are nowhere.
    pub(crate) fn new(person: &Person, to_come: &EgoMotion) -> Option<Self> {
        let is_known = is_finite(person.velocity.as_slice());
        let walks = if is_known { person.velocity } else { Vector2::zeros() };
        let place = to_come.apply_to_point(person.position.xy() + walks * to_come.dt);
        Self::at(place, to_come.apply_to_velocity(walks))
    }

    /// A place that moves.
    pub(crate) fn at(place: Point2<f64>, velocity: Vector2<f64>) -> Option<Self> {
        let range_m = place.x.hypot(place.y);
        if !range_m.is_finite() {
            return None;
        }
        // At the origin there is no direction; straight ahead is as good as any.
        let towards = if range_m > 0.0 { place.coords / range_m } else { Vector2::x() };
        Some(Self {
            range_m,
            bearing: place.y.atan2(place.x),
            sine: towards.y,
            receding_mps: velocity.dot(&towards),
        })
    }
}

fn is_finite(numbers: &[f64]) -> bool {
    numbers.iter().all(|n| n.is_finite())
}
