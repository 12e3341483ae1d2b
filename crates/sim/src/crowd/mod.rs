//! People that react to each other, to the robot, to blocks and to furniture according to a
//! published crowd model, instead of the plain walk.

mod block;
mod orca;
mod route;
mod social_force;

use nalgebra::{Point2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

pub use block::Block;
pub(crate) use route::Blocks;

use crate::obstacle::Obstacle;

/// Walking model of a person.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Walk {
    /// Along the path, with repulsion from people and furniture nearby.
    #[default]
    Plain,
    /// Social force model: M. Moussaïd, D. Helbing et al., Experimental study of the behavioural
    /// mechanisms underlying self-organization in human crowds, Proc. R. Soc. B 276 (2009).
    SocialForce,
    /// Optimal reciprocal collision avoidance: J. van den Berg et al., Reciprocal n-body collision
    /// avoidance, ISRR 2009.
    Orca,
}

impl Walk {
    /// Returns true for the plain walk.
    pub(crate) fn is_plain(&self) -> bool {
        *self == Self::Plain
    }
}

settings! {
    /// Settings of all people with the walks `social-force` and `orca`.
    pub struct CrowdSettings {
        /// Radius of a body, m.
        #[schemars(range(min = 0.1, max = 0.6))]
        pub radius_m: f64 = 0.3,
        /// Distance between the centre of a person and the body of another, m; used by `orca`.
        #[schemars(range(max = 2.0))]
        pub safe_distance_m: f64 = 0.5,
        /// Maximum acceleration, m/s².
        #[schemars(range(min = 0.1, max = 20.0))]
        pub acceleration_mps2: f64 = 1.0,
        /// Time for which velocities are free of collisions with others, s; used by `orca`.
        #[schemars(range(min = 0.2, max = 20.0))]
        pub horizon_s: f64 = 2.0,
        /// Distance within which a point of the path counts as reached, m.
        #[schemars(range(min = 0.1, max = 5.0))]
        pub reached_m: f64 = 0.5,
    }
}

impl CrowdSettings {
    /// Returns true if all settings have their defaults.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the conditions on the settings, each with the message for a violation.
    pub(crate) fn rules(&self) -> [(bool, &'static str); 1] {
        [(
            self.radius_m <= self.safe_distance_m,
            "reacting.safe_distance_m must be reacting.radius_m at least",
        )]
    }
}

/// A body that moves on the floor, as others perceive it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Agent {
    /// Position, m.
    pub place: Point2<f64>,
    /// Velocity, m/s.
    pub velocity: Vector2<f64>,
    /// Radius, m.
    pub radius_m: f64,
}

/// Everything to which a person reacts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around<'a> {
    /// The other people, and the robot.
    pub others: &'a [Agent],
    /// Furniture.
    pub obstacles: &'a [Obstacle],
    /// Blocks, and the walls of the room.
    pub blocks: &'a Blocks,
    /// Settings of the walk.
    pub settings: &'a CrowdSettings,
}

impl Around<'_> {
    /// Returns the nearest point of each fixed object for a body at this position: those of blocks
    /// and walls, and those of furniture.
    fn surfaces(&self, place: &Point2<f64>) -> Vec<Point2<f64>> {
        let round = self.obstacles.iter().filter_map(|thing| {
            let way = place - thing.at;
            Some(thing.at + way.try_normalize(1e-9)? * thing.radius_m)
        });
        self.blocks.nearest(place).chain(round).collect()
    }

    /// Returns the velocity of a person with the wanted velocity `wanted`, at most `max_mps` fast.
    pub fn velocity(
        &self,
        walk: Walk,
        me: &Agent,
        wanted: Vector2<f64>,
        max_mps: f64,
    ) -> Vector2<f64> {
        match walk {
            Walk::Plain => wanted,
            Walk::SocialForce => social_force::velocity(me, wanted, self).cap_magnitude(max_mps),
            Walk::Orca => orca::velocity(me, wanted, max_mps, self),
        }
    }
}

/// Separates overlapping bodies, because bodies are solid: each is moved in proportion to its
/// share, and those with share 0 stay in place.
pub(crate) fn part_bodies(bodies: &mut [(Point2<f64>, f64)], radius_m: f64) {
    const ROUNDS: usize = 10;
    for _ in 0..ROUNDS {
        for second in 1..bodies.len() {
            for first in 0..second {
                let way = bodies[second].0 - bodies[first].0;
                let overlap_m = 2.0 * radius_m - way.norm();
                let parts = bodies[first].1 + bodies[second].1;
                if overlap_m <= 0.0 || parts == 0.0 {
                    continue;
                }
                let aside = way.try_normalize(1e-9).unwrap_or_else(Vector2::x) * overlap_m / parts;
                let part = bodies[first].1;
                bodies[first].0 -= aside * part;
                let part = bodies[second].1;
                bodies[second].0 += aside * part;
            }
        }
    }
}

#[cfg(test)]
mod tests;
