//! Candidate paths, each a control law with a changed beginning, and the cheapest of them.

use std::f64::consts::PI;

use nalgebra::{Isometry2, Vector2};
use tagalong_core::Twist;

use super::config::Config;
use super::cost::{Tally, wanted_m};
use super::law::{Goal, wish};
use super::scenery::{STEPS, Scenery};

/// Changes of the turn rate, rad/s, to the side to which the law turns.
const TURNS: [f64; 9] = [0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6, 0.9, -0.9];
/// Factors on the speed.
const SPEEDS: [f64; 5] = [1.0, 0.75, 0.5, 0.25, 0.0];
/// Times for which a change holds, s.
const TIMES_S: [f64; 3] = [0.8, 1.6, 3.0];
/// The same for a robot with several places to choose from.
const FEW_TURNS: [f64; 5] = [0.0, 0.3, -0.3, 0.7, -0.7];
const FEW_SPEEDS: [f64; 3] = [1.0, 0.5, 0.0];
const FEW_TIMES_S: [f64; 2] = [1.0, 2.5];
/// Angle to the side of a place ahead of the person, rad, to which a robot may go instead.
const INSTEAD_RAD: f64 = 0.9;
/// Cost of another place than that of the settings, and of driving slower than the law: ties go to
/// the law.
const INSTEAD_COST: f64 = 0.05;
const SLOWER_COST: f64 = 0.05;
/// Saving of the way that was taken last: two of nearly the same cost must not alternate.
const KEPT_SAVING: f64 = 0.03;

/// Beginning of a way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Beginning {
    goal: Goal,
    /// Change of the turn rate to the side to which the law turns, rad/s.
    turn: f64,
    /// Factor on the speed.
    part: f64,
    until_s: f64,
    cost: f64,
}

/// Limits of the robot, and its state at the beginning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    pub(super) max_mps: f64,
    pub(super) half_separation_m: f64,
    /// Speed at the beginning, m/s.
    pub(super) speed_mps: f64,
    /// Part of the wish that a target which was not seen lately is worth.
    pub(super) trust: f64,
}

/// All ways, and the one that was taken last.
#[derive(Clone, Debug)]
pub(super) struct Planner {
    goal: Goal,
    ways: Vec<Beginning>,
    last: Option<usize>,
}

impl Planner {
    pub(super) fn new(config: &Config) -> Self {
        let goal = config.angle_rad().map_or(Goal::Facing, Goal::Beside);
        let mut ways = Vec::new();
        match goal {
            Goal::Facing => add(&mut ways, config, (goal, 0.0), (&TURNS, &SPEEDS, &TIMES_S)),
            Goal::Beside(angle) => {
                let few = (&FEW_TURNS[..], &FEW_SPEEDS[..], &FEW_TIMES_S[..]);
                add(&mut ways, config, (goal, 0.0), few);
                for instead in places_instead(angle) {
                    add(&mut ways, config, (instead, INSTEAD_COST), few);
                }
            }
        }
        Self { goal, ways, last: None }
    }

    /// Forgets the way that was taken last.
    pub(super) fn clear(&mut self) {
        self.last = None;
    }

    /// Returns the first velocity of the cheapest way.
    pub(super) fn plan(&mut self, config: &Config, scenery: &Scenery, drive: &Drive) -> Twist {
        // Changes to the side of the turn come first, so that ties do not turn away from the person.
        let start = Isometry2::identity();
        let nominal = wish(config, scenery, self.goal, &start, &scenery.person[0], drive.max_mps);
        let wanted_m = wanted_m(config, scenery);
        let side = if nominal.angular_rps < 0.0 { -1.0 } else { 1.0 };
        let mut least = f64::INFINITY;
        let mut best = None;
        for number in self.last.into_iter().chain(0..self.ways.len()) {
            let saving = if self.last == Some(number) { KEPT_SAVING } else { 0.0 };
            let way = &self.ways[number];
            let driven = self.driven(config, scenery, drive, (way, side, wanted_m), least + saving);
            if let Some((cost, first)) = driven.filter(|(cost, _)| cost - saving < least) {
                least = cost - saving;
                best = Some((number, first));
            }
        }
        self.last = best.map(|(number, _)| number);
        best.map_or(Twist::STOP, |(_, first)| first)
    }

    /// Returns the cost of a way and its first velocity; `None` as soon as it costs more than `most`.
    fn driven(
        &self,
        config: &Config,
        scenery: &Scenery,
        drive: &Drive,
        (way, side, wanted_m): (&Beginning, f64, f64),
        most: f64,
    ) -> Option<(f64, Twist)> {
        let step_s = scenery.step_s;
        let mut pose = Isometry2::identity();
        let mut speed_mps = drive.speed_mps;
        let mut tally = Tally::new(way.cost, wanted_m);
        let mut first = Twist::STOP;
        for step in 0..STEPS {
            let person = &scenery.person[step];
            let asked = wish(config, scenery, way.goal, &pose, person, drive.max_mps);
            let is_changed = (step as f64) * step_s < way.until_s;
            let wanted = if is_changed { changed(config, way, side, asked) } else { asked };
            let wanted = Twist::new(
                wanted.linear_mps.min(drive.trust * drive.max_mps),
                drive.trust * wanted.angular_rps,
            );
            if step == 0 {
                first = wanted;
            }
            // The outer wheel has a limit, too.
            let rim_mps = wanted.angular_rps.abs() * drive.half_separation_m;
            let reached = wanted.linear_mps.min((drive.max_mps - rim_mps).max(0.0));
            let least = speed_mps - config.max_deceleration * step_s;
            let fastest = speed_mps + config.max_acceleration * step_s;
            speed_mps = reached.clamp(least, fastest).max(0.0);
            pose *= arc(speed_mps, wanted.angular_rps, step_s);
            tally.add(config, scenery, self.goal, step, (&pose, speed_mps));
            if tally.cost(config) >= most {
                return None;
            }
        }
        Some((tally.cost(config), first))
    }
}

/// Returns other places for a robot that cannot be at an angle: nearer to the track of the person,
/// behind the person, and behind the person facing them.
fn places_instead(angle: f64) -> [Goal; 3] {
    if angle == 0.0 {
        // Neither side is nearer.
        return [Goal::Beside(INSTEAD_RAD), Goal::Beside(-INSTEAD_RAD), Goal::Facing];
    }
    let behind = PI.copysign(angle);
    [Goal::Beside(0.5 * (angle + behind)), Goal::Beside(behind), Goal::Facing]
}

fn add(
    ways: &mut Vec<Beginning>,
    config: &Config,
    (goal, cost): (Goal, f64),
    (turns, speeds, times_s): (&[f64], &[f64], &[f64]),
) {
    for part in speeds {
        for turn in turns {
            for until_s in times_s {
                let is_law = *part == 1.0 && *turn == 0.0;
                // The law without a change needs no time for which it holds.
                if is_law && *until_s != times_s[0] {
                    continue;
                }
                let change = config.turn_weight * turn.abs() + SLOWER_COST * (1.0 - part);
                let cost = cost + change;
                ways.push(Beginning { goal, turn: *turn, part: *part, until_s: *until_s, cost });
            }
        }
    }
}

fn changed(config: &Config, way: &Beginning, side: f64, asked: Twist) -> Twist {
    let limit = config.max_turn_rate;
    let turn = (asked.angular_rps + side * way.turn).clamp(-limit, limit);
    Twist::new(way.part * asked.linear_mps, turn)
}

/// Returns the motion of a robot at a speed and a turn rate for some seconds.
fn arc(speed_mps: f64, turn_rate: f64, seconds: f64) -> Isometry2<f64> {
    let turn = turn_rate * seconds;
    let half = 0.5 * turn;
    // The chord of a short arc is its length; the quotient would be 0 / 0.
    let chord = speed_mps * seconds * if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
    Isometry2::new(Vector2::new(half.cos(), half.sin()) * chord, turn)
}
