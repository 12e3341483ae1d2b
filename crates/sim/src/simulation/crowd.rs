//! Steps of the people of a scene.

use nalgebra::{Point2, Vector2};

use super::{GOES_M, ROBOT_M, Simulation};
use crate::behaviour::{Walker, hidden_by, lead_of, others, play_tricks};
use crate::crowd::{Agent, Around, Blocks, part_bodies};
use crate::footprint::{Outline, ROBOT_RADIUS_M};
use crate::obstacle::Obstacle;
use crate::scene::Scene;

/// Distance of routes from blocks in addition to the radius of a body, m, so that two streams have
/// room at a shared corner.
const MARGIN_M: f64 = 0.15;
/// For a person with the plain walk, a block is a round obstacle of this radius, m, at its nearest
/// point.
const BLOCK_M: f64 = 0.2;

/// Returns the blocks of a scene.
pub(super) fn blocks(scene: &Scene) -> Blocks {
    Blocks::new(&scene.blocks, scene.room.size_m, scene.reacting.radius_m + MARGIN_M)
}

impl Simulation {
    /// Moves all people by a time step.
    pub(super) fn walk(&mut self, now_s: f64, dt: f64) {
        let robot = Point2::from(self.robot.pose.translation.vector);
        // Tricks depend on the positions of all people before any of them moves.
        let hidden = hidden_by(&self.walkers, &robot);
        play_tricks(&mut self.walkers, &hidden, now_s);
        let ways: Vec<_> = (0..self.walkers.len())
            .map(|i| (lead_of(&self.walkers, i), others(&self.walkers, i, now_s)))
            .collect();
        // The state before any of them moves, so that the order of people does not matter.
        let agents: Vec<Option<Agent>> = self.agents(now_s);
        let ahead = self.robot.pose.rotation * Vector2::new(GOES_M, 0.0);
        let furniture = self.obstacles.len();
        // The robot is an obstacle only for this step, because it moves.
        self.obstacles.push(Obstacle { at: robot, radius_m: ROBOT_M, ahead });
        let steps = self.walkers.len() - usize::from(self.person_approaches());
        for (i, (lead, others)) in ways.iter().enumerate().take(steps) {
            let walker = &mut self.walkers[i];
            if walker.reacts() {
                let others: Vec<Agent> =
                    (0..agents.len()).filter(|j| *j != i).filter_map(|j| agents[j]).collect();
                let around = Around {
                    others: &others,
                    obstacles: &self.obstacles[..furniture],
                    blocks: &self.blocks,
                    settings: &self.scene.reacting,
                };
                walker.react(now_s, dt, lead.as_ref(), &around, i);
            } else if self.blocks.is_empty() {
                walker.step(now_s, dt, lead.as_ref(), others, &self.obstacles);
            } else {
                let mut obstacles = self.obstacles.clone();
                let nearest = self.blocks.nearest(&walker.stance.place);
                obstacles.extend(nearest.map(|at| Obstacle::standing(at, BLOCK_M)));
                walker.step(now_s, dt, lead.as_ref(), others, &obstacles);
            }
        }
        self.obstacles.pop();
        self.part(now_s, steps);
        self.approach_robot(dt);
    }

    /// Returns the bodies of all people, `None` for those that are not in the room, and the robot.
    fn agents(&self, now_s: f64) -> Vec<Option<Agent>> {
        if !self.walkers.iter().any(Walker::reacts) {
            return Vec::new();
        }
        let radius_m = self.scene.reacting.radius_m;
        let people = self.walkers.iter();
        let people = people.map(|one| one.is_there(now_s).then(|| one.agent(radius_m)));
        let robot = Agent {
            place: Point2::from(self.robot.pose.translation.vector),
            velocity: self.robot.pose.rotation * Vector2::new(self.robot.speed_mps(), 0.0),
            radius_m: self.circumradius_m(),
        };
        people.chain([Some(robot)]).collect()
    }

    /// Returns the radius of the circle around the robot's middle that encloses it, m.
    pub(super) fn circumradius_m(&self) -> f64 {
        match self.outline(ROBOT_RADIUS_M) {
            Outline::Disc(radius_m) => radius_m,
            Outline::Polygon(corners) => {
                corners.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max)
            }
        }
    }

    /// Moves reacting people out of other people and out of blocks.
    fn part(&mut self, now_s: f64, steps: usize) {
        if !self.walkers.iter().any(Walker::reacts) {
            return;
        }
        let present: Vec<usize> = (0..steps).filter(|i| self.walkers[*i].is_there(now_s)).collect();
        let mut bodies: Vec<(Point2<f64>, f64)> = present
            .iter()
            .map(|i| &self.walkers[*i])
            .map(|walker| (walker.stance.place, if walker.gives_way() { 1.0 } else { 0.0 }))
            .collect();
        let radius_m = self.scene.reacting.radius_m;
        part_bodies(&mut bodies, radius_m);
        for (i, (place, part)) in present.into_iter().zip(bodies) {
            if part > 0.0 {
                let place = self.blocks.outside(&place, radius_m);
                self.walkers[i].place_at(place);
            }
        }
    }
}

#[cfg(test)]
mod tests;
