use nalgebra::{Point2, Vector2};

/// A round thing that people walk around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstacle {
    /// Where it stands, m.
    pub at: Point2<f64>,
    /// Its radius, m.
    pub radius_m: f64,
    /// Velocity with which it moves, if it moves, m: a blocked walker goes round behind it.
    pub ahead: Vector2<f64>,
}

impl Obstacle {
    /// A thing that stays where it is.
    pub fn standing(at: Point2<f64>, radius_m: f64) -> Self {
        Self { at, radius_m, ahead: Vector2::zeros() }
    }
}
