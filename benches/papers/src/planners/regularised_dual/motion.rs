//! The motion of the robot over the horizon, and its improvement for given lines to the obstacles.

use nalgebra::{Point2, Rotation2, Vector2};

use super::program::{Program, Sum};
use super::separator::{Multiplier, Pose, Separator};

/// Time step, s, and number of steps of the horizon.
pub(super) const STEP_S: f64 = 0.1;
pub(super) const STEPS: usize = 10;
/// Least and largest distance kept from an obstacle, m.
const DISTANCES_M: [f64; 2] = [0.1, 1.0];
/// Weights of the way from the goal, of the speed below the wished one, and of the distance kept.
const GOAL: f64 = 10.0;
const SPEED: f64 = 1.0;
const DISTANCE: f64 = 10.0;
/// Penalties of a gap below the distance kept, and of the mismatch of directions.
const GAP: f64 = 200.0;
const MISMATCH: f64 = 1.0;

/// Poses, speeds and distances kept over the horizon.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Motion {
    /// Poses at the ends of the steps.
    pub(super) poses: [Pose; STEPS],
    /// Speed, m/s, and turn rate, rad/s, in each step.
    pub(super) speeds: [[f64; 2]; STEPS],
    /// Distance kept at the end of each step, m.
    pub(super) distances_m: [f64; STEPS],
}

/// Wishes of a motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aim {
    pub(super) goal: Point2<f64>,
    /// Heading, rad.
    pub(super) heading: f64,
    pub(super) speed_mps: f64,
}

/// Limits of a motion; speeds and turn rates in pairs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Largest absolute values.
    pub(super) most: [f64; 2],
    /// Least and largest values of the first step.
    pub(super) first: [[f64; 2]; 2],
    /// Largest change from one step to the next.
    pub(super) change: [f64; 2],
}

impl Motion {
    /// Returns the motion with these speeds from the origin on.
    pub(super) fn driven(speeds: [[f64; 2]; STEPS], distances_m: [f64; STEPS]) -> Self {
        let mut pose = Pose::default();
        let poses = speeds.map(|[speed_mps, turn_rate]| {
            pose.place += Rotation2::new(pose.heading) * Vector2::x() * speed_mps * STEP_S;
            pose.heading += turn_rate * STEP_S;
            pose
        });
        Self { poses, speeds, distances_m }
    }

    /// Returns the best motion with kinematics that are linear around this one, for the lines to each
    /// obstacle at each step; `None` if the solver fails.
    pub(super) fn improved(
        &self,
        aim: &Aim,
        limits: &Limits,
        separators: &[Vec<Separator>],
        multipliers: &[[Multiplier; STEPS]],
    ) -> Option<Self> {
        let mut program = Program::new((6 + separators.len()) * STEPS);
        for step in 0..STEPS {
            self.move_on(&mut program, step);
            limits.bound(&mut program, step);
            self.wish(&mut program, step, aim);
        }
        for (obstacle, (own, multipliers)) in separators.iter().zip(multipliers).enumerate() {
            for (step, separator) in own.iter().enumerate() {
                let short = Sum::of([((6 + obstacle) * STEPS + step, 1.0)]);
                self.keep_clear(&mut program, step, separator, &multipliers[step], short);
            }
        }
        let solution = program.solved()?;
        let mut motion = self.clone();
        for step in 0..STEPS {
            let place = [0, 1].map(|axis| solution[pose_at(step, axis)]);
            motion.poses[step] = Pose { place: place.into(), heading: solution[pose_at(step, 2)] };
            motion.speeds[step] = [0, 1].map(|which| solution[speed_at(step, which)]);
            motion.distances_m[step] = solution[distance_at(step)];
        }
        Some(motion)
    }

    /// Demands that the pose after a step is that before it, moved by the speeds.
    fn move_on(&self, program: &mut Program, step: usize) {
        let before = if step == 0 { Pose::default() } else { self.poses[step - 1] };
        let [speed_mps, _] = self.speeds[step];
        let along = Rotation2::new(before.heading) * Vector2::x();
        let aside = Vector2::new(-along.y, along.x) * speed_mps * STEP_S;
        for axis in 0..3 {
            let mut change = Sum::of([(pose_at(step, axis), -1.0)]);
            if step > 0 {
                change = change.plus(1.0, &Sum::of([(pose_at(step - 1, axis), 1.0)]));
            }
            if axis == 2 {
                change = change.plus(STEP_S, &Sum::of([(speed_at(step, 1), 1.0)]));
            } else {
                change = change.plus(along[axis] * STEP_S, &Sum::of([(speed_at(step, 0), 1.0)]));
                // The heading before the first step is that of now.
                if step > 0 {
                    let turned = Sum::of([(pose_at(step - 1, 2), 1.0)]);
                    change = change.plus(aside[axis], &turned.plus_constant(-before.heading));
                }
            }
            program.zero(change);
        }
    }

    fn wish(&self, program: &mut Program, step: usize, aim: &Aim) {
        let heading = self.poses[step].heading + wrapped(aim.heading - self.poses[step].heading);
        for (axis, wished) in [aim.goal.x, aim.goal.y, heading].into_iter().enumerate() {
            let off = Sum::of([(pose_at(step, axis), 1.0)]).plus_constant(-wished);
            program.square(GOAL, &off);
        }
        let below = Sum::of([(speed_at(step, 0), 1.0)]).plus_constant(-aim.speed_mps);
        program.square(SPEED, &below);
        let distance = Sum::of([(distance_at(step), 1.0)]);
        program.cost(-DISTANCE, &distance);
        program.between(&distance, DISTANCES_M[0], DISTANCES_M[1]);
    }

    /// Keeps the distance from an obstacle after a step, except for what is short.
    fn keep_clear(
        &self,
        program: &mut Program,
        step: usize,
        separator: &Separator,
        multiplier: &Multiplier,
        short: Sum,
    ) {
        let place = [0, 1].map(|axis| (pose_at(step, axis), separator.normal[axis]));
        let gap = Sum::of(place).plus_constant(multiplier.gap - separator.offset_m);
        let distance = Sum::of([(distance_at(step), 1.0)]);
        program.square(0.5 * GAP, &short);
        program.positive(gap.plus(-1.0, &distance).plus(1.0, &short));
        program.positive(short);
        // The mismatch, linear around the heading of this motion.
        let heading = self.poses[step].heading;
        let mismatch = separator.mismatch(heading) + multiplier.mismatch;
        let by_turn = separator.mismatch_by_turn(heading);
        for axis in 0..2 {
            let turned = Sum::of([(pose_at(step, 2), by_turn[axis])]);
            let sum = turned.plus_constant(mismatch[axis] - by_turn[axis] * heading);
            program.square(0.5 * MISMATCH, &sum);
        }
    }
}

impl Limits {
    fn bound(&self, program: &mut Program, step: usize) {
        for which in 0..2 {
            let speed = Sum::of([(speed_at(step, which), 1.0)]);
            if step == 0 {
                let [least, most] = self.first[which];
                program.between(&speed, least, most);
                continue;
            }
            program.between(&speed, -self.most[which], self.most[which]);
            let before = Sum::of([(speed_at(step - 1, which), 1.0)]);
            let change = self.change[which];
            program.between(&speed.plus(-1.0, &before), -change, change);
        }
    }
}

/// Returns the angle in -pi to pi.
pub(super) fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

/// Returns the number of a variable: x, y and heading at the end of a step.
fn pose_at(step: usize, axis: usize) -> usize {
    3 * step + axis
}

/// Returns the number of a variable: speed or turn rate in a step.
fn speed_at(step: usize, which: usize) -> usize {
    3 * STEPS + 2 * step + which
}

/// Returns the number of a variable: distance kept at the end of a step.
fn distance_at(step: usize) -> usize {
    5 * STEPS + step
}
