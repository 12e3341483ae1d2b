//! The social force model: a person is driven towards the wanted velocity and away from others and
//! walls.
//!
//! D. Helbing, P. Molnár, Social force model for pedestrian dynamics, Phys. Rev. E 51 (1995), with the
//! force between people as measured by M. Moussaïd, D. Helbing, S. Garnier, A. Johansson,
//! M. Combe, G. Theraulaz, Experimental study of the behavioural mechanisms underlying
//! self-organization in human crowds, Proc. R. Soc. B 276 (2009), equations 1 to 6.

use nalgebra::Vector2;

use super::{Agent, Around};

/// Time in which a person returns to the wanted velocity, s.
const RELAXATION_S: f64 = 0.54;
/// Strength of the force between two people, m/s², and the factors of its range.
const STRENGTH: f64 = 4.5;
const REACH_FACTOR: f64 = 0.35;
const TURN_FACTOR: f64 = 2.0;
const BRAKE_FACTOR: f64 = 3.0;
/// Weight of the relative velocity compared with the direction to the other.
const VELOCITY_WEIGHT: f64 = 2.0;
/// Bias of the angle to the other, with which people that meet head-on pass on the same side, as
/// the paper observed.
const SIDE_BIAS: f64 = 0.005;
/// Strength, m/s², and range, m, of the force from a wall.
const WALL_STRENGTH: f64 = 3.0;
const WALL_REACH_M: f64 = 0.1;

/// Returns the velocity at which a person aims: the present one plus the forces times the
/// relaxation time.
pub(super) fn velocity(me: &Agent, wanted: Vector2<f64>, around: &Around<'_>) -> Vector2<f64> {
    let others: Vector2<f64> = around.others.iter().map(|other| between(me, other)).sum();
    let things: Vector2<f64> =
        around.surfaces(&me.place).iter().filter_map(|at| from_wall(me, &(me.place - at))).sum();
    wanted + (others + things) * RELAXATION_S
}

/// Returns the force of another body, m/s².
pub(super) fn between(me: &Agent, other: &Agent) -> Vector2<f64> {
    let way = other.place - me.place;
    let Some(towards) = way.try_normalize(1e-9) else { return Vector2::zeros() };
    let interaction = (me.velocity - other.velocity) * VELOCITY_WEIGHT + towards;
    let Some(along) = interaction.try_normalize(1e-9) else { return Vector2::zeros() };
    let reach_m = REACH_FACTOR * interaction.norm();
    // Positive to the left: a person on the left is passed on its right.
    let angle_rad = along.perp(&towards).atan2(along.dot(&towards)) + SIDE_BIAS * reach_m;
    // The paper measured people with a radius of about 0.2 m; a wider body, such as a robot, acts
    // from farther away.
    let away_m = (way.norm() - (other.radius_m - me.radius_m)).max(0.0);
    let [brake, turn] = [BRAKE_FACTOR, TURN_FACTOR].map(|factor| {
        STRENGTH * (-away_m / reach_m - (factor * reach_m * angle_rad).powi(2)).exp()
    });
    let left = Vector2::new(-along.y, along.x);
    -along * brake - left * angle_rad.signum() * turn
}

/// Returns the force of a wall whose nearest point is at this offset, m/s².
fn from_wall(me: &Agent, away: &Vector2<f64>) -> Option<Vector2<f64>> {
    let direction = away.try_normalize(1e-9)?;
    // A body that touches a wall is not pushed harder the deeper it is pressed.
    let gap_m = (away.norm() - me.radius_m).max(0.0);
    Some(direction * WALL_STRENGTH * (-gap_m / WALL_REACH_M).exp())
}
