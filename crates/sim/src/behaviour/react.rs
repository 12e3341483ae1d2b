//! Steps of people that react to others according to a crowd model.

use nalgebra::{Point2, Rotation2, Vector2};

use super::{Lead, Walker};
use crate::crowd::{Agent, Around, Blocks};
use crate::scene::AtEnd;

/// Maximum angular error of the walking direction, rad: without it, people that meet in perfect
/// symmetry would wait for each other for ever.
const MISSES_RAD: f64 = 0.03;
/// A person whose progress, as a fraction of the wanted speed, is this low for this time, s, steps
/// back to the right by this angle, rad, for some time, s. Otherwise a crowd could jam in an arch
/// for ever. The patience of people differs by up to the last of these times, s.
const JAMMED: f64 = 0.3;
const JAMMED_S: f64 = 1.5;
const MORE_PATIENT_S: f64 = 3.0;
const STEPS_BACK_S: f64 = 1.5;
const STEPS_BACK_RAD: f64 = 2.2;

impl Walker {
    /// Returns true if the person walks according to a crowd model.
    pub fn reacts(&self) -> bool {
        !self.settings.walk.is_plain()
    }

    /// Returns true if the person may give way to others; a seated one does not.
    pub fn gives_way(&self) -> bool {
        self.reacts() && self.stance.seated == 0.0
    }

    /// Returns true if the person has reached the end of the path, and stays there.
    pub fn has_arrived(&self) -> bool {
        self.settings.path.len() > 1 && self.ahead >= self.settings.path.len()
    }

    /// Returns the body as others perceive it.
    pub fn agent(&self, radius_m: f64) -> Agent {
        Agent { place: self.stance.place, velocity: self.velocity, radius_m }
    }

    /// Moves the person by a time step among others; `number` is the index of the person in the
    /// scene.
    pub fn react(
        &mut self,
        now_s: f64,
        dt: f64,
        lead: Option<&Lead>,
        around: &Around<'_>,
        number: usize,
    ) {
        let settings = around.settings;
        self.look_ahead(now_s, settings.reached_m);
        let wanted = match lead {
            Some(lead) => self.follow(lead),
            None if now_s < self.waits_until_s => Vector2::zeros(),
            None => {
                let wanted = self.towards_goal(around.blocks);
                let jam_rad = self.jam_rad(&wanted, number, dt);
                Rotation2::new(MISSES_RAD * (2.0 * share(number) - 1.0) - jam_rad) * wanted
            }
        };
        let me = self.agent(settings.radius_m);
        let max_mps = self.settings.speed_mps.max(wanted.norm());
        let chosen = if self.gives_way() {
            around.velocity(self.settings.walk, &me, wanted, max_mps)
        } else {
            Vector2::zeros()
        };
        let change = chosen - self.velocity;
        self.velocity += change.cap_magnitude(settings.acceleration_mps2 * dt);
        self.stance.place += self.velocity * dt;
        self.stance.speed_mps = self.velocity.norm();
        self.stay_outside(around.obstacles);
        self.finish_step(now_s, dt, lead);
    }

    /// Returns the angle by which a person without progress turns to the right, rad. The time for
    /// which an obstacle has blocked the walker is negative while they step back.
    fn jam_rad(&mut self, wanted: &Vector2<f64>, number: usize, dt: f64) -> f64 {
        if self.held_up_s < 0.0 {
            self.held_up_s = (self.held_up_s + dt).min(0.0);
            return STEPS_BACK_RAD;
        }
        let is_jammed = self.velocity.dot(wanted) < JAMMED * wanted.norm_squared();
        let change_s = if is_jammed { dt } else { -dt };
        self.held_up_s = (self.held_up_s + change_s).max(0.0);
        if self.held_up_s > JAMMED_S + MORE_PATIENT_S * share(number) {
            self.held_up_s = -STEPS_BACK_S;
        }
        0.0
    }

    /// Moves the body to a free position.
    pub fn place_at(&mut self, place: Point2<f64>) {
        self.stance.place = place;
    }

    /// Returns the wanted velocity: straight to the goal or, if blocks are in the way, to the next
    /// corner on the way around them.
    fn towards_goal(&mut self, blocks: &Blocks) -> Vector2<f64> {
        let Some(goal) = self.settings.path.get(self.ahead).map(|goal| Point2::from(*goal)) else {
            return Vector2::zeros();
        };
        let next = self.next_turn(goal, blocks);
        let way = next - self.stance.place;
        let is_last =
            self.ahead + 1 == self.settings.path.len() && self.settings.at_end == AtEnd::Stop;
        let speed_mps = if is_last && next == goal {
            self.settings.speed_mps.min(1.2 * way.norm())
        } else {
            self.settings.speed_mps
        };
        way.try_normalize(1e-6).unwrap_or_default() * speed_mps
    }

    /// Returns the point to walk to on the way to a goal; a route is kept until a block is on it.
    fn next_turn(&mut self, goal: Point2<f64>, blocks: &Blocks) -> Point2<f64> {
        let place = self.stance.place;
        if blocks.is_empty() || blocks.is_free(&place, &goal) {
            self.turns.clear();
            return goal;
        }
        while self.turns.len() > 1 && blocks.is_free(&place, &self.turns[1]) {
            self.turns.remove(0);
        }
        let is_known = self.turns.last() == Some(&goal)
            && self.turns.first().is_some_and(|next| blocks.is_free(&place, next));
        if !is_known {
            self.turns = blocks.route(&place, &goal);
        }
        self.turns.first().copied().unwrap_or(goal)
    }
}

/// Returns a number from 0 to 1 that differs for each index, spread evenly by the golden ratio.
fn share(number: usize) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    (number as f64 * GOLDEN).fract()
}
