use nalgebra::{Point2, Vector2};

/// A round object that people walk around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstacle {
    /// Position, m.
    pub at: Point2<f64>,
    /// Radius, m.
    pub radius_m: f64,
    /// Velocity if it moves, m/s: a blocked walker passes behind it.
    pub ahead: Vector2<f64>,
}

impl Obstacle {
    /// Creates an object that does not move.
    pub fn standing(at: Point2<f64>, radius_m: f64) -> Self {
        Self { at, radius_m, ahead: Vector2::zeros() }
    }
}
