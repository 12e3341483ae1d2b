//! Optimal reciprocal collision avoidance: each of two bodies makes half of the change of velocity
//! that keeps them apart for a time, and takes the velocity nearest to the wanted one that all of
//! its half planes allow.
//!
//! J. van den Berg, S. J. Guy, M. Lin, D. Manocha, Reciprocal n-body collision avoidance, ISRR
//! 2009, sections 4 and 5. If the half planes allow no velocity, those of fixed objects are kept,
//! and the largest violation of the others is minimised (section 5.3).

use nalgebra::Vector2;

use super::{Agent, Around};

/// Distance beyond which bodies have no influence, m.
const NEIGHBOURS_M: f64 = 6.0;
/// Time in which bodies that are too close separate, s.
const PARTS_S: f64 = 0.5;
/// Time for which velocities are free of collisions with fixed objects, s: people pass close to
/// walls.
const THINGS_S: f64 = 0.5;
/// Rounding error, m/s.
const EPSILON: f64 = 1e-9;

/// Allowed velocities: those whose component along `normal` is at least `least`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HalfPlane {
    /// Direction of length one.
    pub normal: Vector2<f64>,
    /// Minimum of the component, m/s.
    pub least: f64,
}

impl HalfPlane {
    /// Returns the amount by which a velocity violates the half plane, m/s; negative inside of it.
    pub fn violation(&self, velocity: &Vector2<f64>) -> f64 {
        self.least - self.normal.dot(velocity)
    }

    /// Returns the direction along the edge.
    fn along(&self) -> Vector2<f64> {
        Vector2::new(self.normal.y, -self.normal.x)
    }
}

/// Returns the velocity nearest to the wanted one that avoids collisions.
pub(super) fn velocity(
    me: &Agent,
    wanted: Vector2<f64>,
    max_mps: f64,
    around: &Around<'_>,
) -> Vector2<f64> {
    let settings = around.settings;
    let mut planes: Vec<HalfPlane> =
        around.surfaces(&me.place).iter().filter_map(|at| beside(me, &(at - me.place))).collect();
    let standing = planes.len();
    let mut others: Vec<&Agent> = around
        .others
        .iter()
        .filter(|other| (other.place - me.place).norm() < NEIGHBOURS_M)
        .collect();
    // If rounding decides, the first half planes win: those of near bodies.
    others.sort_by(|a, b| {
        let [a, b] = [a, b].map(|other| (other.place - me.place).norm_squared());
        a.total_cmp(&b)
    });
    let margin_m = settings.safe_distance_m - settings.radius_m;
    planes.extend(others.iter().map(|other| reciprocal(me, other, margin_m, settings.horizon_s)));
    solve(&planes, standing, wanted, max_mps)
}

/// Returns the half plane of a point of a fixed object, at this offset from the body: with zero as
/// the velocity to keep, as in the paper, an allowed velocity always exists.
fn beside(me: &Agent, way: &Vector2<f64>) -> Option<HalfPlane> {
    let towards = way.try_normalize(1e-9)?;
    let gap_m = way.norm() - me.radius_m;
    let speed_mps = gap_m / if gap_m > 0.0 { THINGS_S } else { PARTS_S };
    Some(HalfPlane { normal: -towards, least: -speed_mps })
}

/// Returns the half plane of a body that is expected to do the other half of the avoidance.
fn reciprocal(me: &Agent, other: &Agent, margin_m: f64, horizon_s: f64) -> HalfPlane {
    let way = other.place - me.place;
    let relative = me.velocity - other.velocity;
    let radius_m = me.radius_m + other.radius_m + margin_m;
    let away2 = way.norm_squared();
    let is_apart = away2 > radius_m * radius_m;
    let time_s = if is_apart { horizon_s } else { PARTS_S };
    // From the centre of the disc that truncates the cone of colliding velocities.
    let from_disc = relative - way / time_s;
    let ahead = from_disc.dot(&way);
    let before_disc = ahead < 0.0 && ahead * ahead > radius_m * radius_m * from_disc.norm_squared();
    if !is_apart || before_disc {
        let normal = from_disc.try_normalize(1e-9).unwrap_or_else(|| opposite(&way));
        let change = normal * (radius_m / time_s - from_disc.norm());
        return half_of(me, normal, change);
    }
    let leg = (away2 - radius_m * radius_m).sqrt();
    let is_left = way.perp(&from_disc) > 0.0;
    let along = if is_left {
        Vector2::new(way.x * leg - way.y * radius_m, way.x * radius_m + way.y * leg) / away2
    } else {
        -Vector2::new(way.x * leg + way.y * radius_m, way.y * leg - way.x * radius_m) / away2
    };
    let change = along * relative.dot(&along) - relative;
    half_of(me, Vector2::new(-along.y, along.x), change)
}

/// Returns the direction away from another body; an arbitrary one if both are at the same position.
fn opposite(way: &Vector2<f64>) -> Vector2<f64> {
    way.try_normalize(1e-9).map_or_else(Vector2::x, |towards| -towards)
}

/// Returns the half plane of a body that makes half of a change of the relative velocity.
fn half_of(me: &Agent, normal: Vector2<f64>, change: Vector2<f64>) -> HalfPlane {
    HalfPlane { normal, least: normal.dot(&(me.velocity + 0.5 * change)) }
}

/// Returns the allowed velocity nearest to the wanted one or, if there is none, the one that
/// minimises the largest violation of the half planes after the first `standing`, which are always
/// kept.
pub(super) fn solve(
    planes: &[HalfPlane],
    standing: usize,
    wanted: Vector2<f64>,
    max_mps: f64,
) -> Vector2<f64> {
    match nearest(planes, Goal::Nearest(wanted), max_mps) {
        Ok(velocity) => velocity,
        Err(failed) => least_violation(planes, standing, failed, max_mps),
    }
}

/// Criterion for the best velocity.
#[derive(Clone, Copy)]
enum Goal {
    /// Nearest to this one.
    Nearest(Vector2<f64>),
    /// Farthest in this direction of length one.
    Farthest(Vector2<f64>),
}

impl Goal {
    /// Returns the best velocity without half planes.
    fn free(self, max_mps: f64) -> Vector2<f64> {
        match self {
            Self::Nearest(wanted) => wanted.cap_magnitude(max_mps),
            Self::Farthest(direction) => direction * max_mps,
        }
    }
}

/// A velocity that a half plane rejected, and the index of that half plane.
struct Failed {
    velocity: Vector2<f64>,
    plane: usize,
}

/// Solves the linear program in the plane by adding one half plane after the other.
fn nearest(planes: &[HalfPlane], goal: Goal, max_mps: f64) -> Result<Vector2<f64>, Failed> {
    let mut velocity = goal.free(max_mps);
    for (plane, half_plane) in planes.iter().enumerate() {
        if half_plane.violation(&velocity) > EPSILON {
            // The best allowed velocity is then on the edge of this half plane.
            let on_edge = best_on_edge(half_plane, &planes[..plane], goal, max_mps);
            velocity = on_edge.ok_or(Failed { velocity, plane })?;
        }
    }
    Ok(velocity)
}

/// Returns the best velocity on the edge of a half plane within the half planes before it; `None`
/// if the edge has no allowed velocity.
fn best_on_edge(
    edge: &HalfPlane,
    before: &[HalfPlane],
    goal: Goal,
    max_mps: f64,
) -> Option<Vector2<f64>> {
    let half2 = max_mps * max_mps - edge.least * edge.least;
    if half2 < 0.0 {
        return None;
    }
    let foot = edge.normal * edge.least;
    let along = edge.along();
    let mut low = -half2.sqrt();
    let mut high = half2.sqrt();
    for plane in before {
        let slope = plane.normal.dot(&along);
        let needed = plane.violation(&foot);
        if slope.abs() < EPSILON {
            if needed > EPSILON {
                return None;
            }
        } else if slope > 0.0 {
            low = low.max(needed / slope);
        } else {
            high = high.min(needed / slope);
        }
    }
    if low > high {
        return None;
    }
    let best = match goal {
        Goal::Nearest(wanted) => wanted.dot(&along).clamp(low, high),
        Goal::Farthest(direction) if direction.dot(&along) > 0.0 => high,
        Goal::Farthest(_) => low,
    };
    Some(foot + along * best)
}

/// Returns the velocity that minimises the largest violation of the half planes of bodies.
fn least_violation(
    planes: &[HalfPlane],
    standing: usize,
    failed: Failed,
    max_mps: f64,
) -> Vector2<f64> {
    let mut velocity = failed.velocity;
    if failed.plane < standing {
        // Only rounding can exclude the velocity zero here, or a body that is pressed into a
        // corner.
        return Vector2::zeros();
    }
    let mut worst = 0.0;
    for (number, plane) in planes.iter().enumerate().skip(failed.plane) {
        if plane.violation(&velocity) <= worst + EPSILON {
            continue;
        }
        // Velocities at which no earlier half plane is violated by more than this one.
        let mut tighter: Vec<HalfPlane> = planes[..standing].to_vec();
        for other in &planes[standing..number] {
            let between = other.normal - plane.normal;
            let length = between.norm();
            if length > EPSILON {
                let least = (other.least - plane.least) / length;
                tighter.push(HalfPlane { normal: between / length, least });
            }
        }
        if let Ok(found) = nearest(&tighter, Goal::Farthest(plane.normal), max_mps) {
            velocity = found;
        }
        worst = plane.violation(&velocity);
    }
    velocity
}
