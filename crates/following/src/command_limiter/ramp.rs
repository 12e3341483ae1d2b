//! Motion along one axis with limits of speed, acceleration and jerk.

/// Distance from the target below which it is reached; the change of the acceleration by it is
/// rounding error.
const REACHED: f64 = 1e-6;

/// Speed along an axis, and the acceleration of its last step; m/s and m/s², or rad/s and rad/s².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Axis {
    pub(super) speed: f64,
    pub(super) accel: f64,
}

/// Limits of an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct AxisLimits {
    /// Largest acceleration away from rest.
    pub(super) accel: f64,
    /// Largest deceleration towards rest.
    pub(super) decel: f64,
    /// Largest change of both in a second.
    pub(super) jerk: f64,
}

impl Axis {
    /// Returns the largest amount of the speed before its acceleration can be zero again.
    pub(super) fn peak(&self, limits: &AxisLimits) -> f64 {
        let grows = self.speed * self.accel > 0.0;
        let rise = if grows { self.accel * self.accel / (2.0 * limits.jerk) } else { 0.0 };
        self.speed.abs() + rise
    }

    /// Returns the motion `dt` seconds later, on the way to a speed.
    ///
    /// The acceleration is the largest that still fades to zero, at the limit of the jerk, by the time
    /// that the speed is reached: from the acceleration a it takes a²/2j of speed. So the speed passes
    /// the target only if that changed, and then by no more than this; a speed within bounds, on the
    /// way to one within them, stays within them.
    pub(super) fn towards(&self, target: f64, dt: f64, limits: &AxisLimits) -> Self {
        // Through rest, where the limits change.
        let target = if target * self.speed < 0.0 { 0.0 } else { target };
        let AxisLimits { accel, decel, jerk } = *limits;
        let (down, up) = match self.speed {
            speed if speed > 0.0 => (-decel, accel),
            speed if speed < 0.0 => (-accel, decel),
            _ => (-accel, accel),
        };
        let off = target - self.speed;
        // The positive root of a dt + a² / 2j = |off|, in the form that loses no digits.
        let root = (dt * dt + 2.0 * off.abs() / jerk).sqrt();
        let fades = if off == 0.0 { 0.0 } else { 2.0 * off.abs() / (root + dt) };
        let wanted = fades.copysign(off).clamp(down, up);
        let accel = wanted.clamp(self.accel - jerk * dt, self.accel + jerk * dt);
        let speed = self.speed + accel * dt;
        // A speed that is taken for reached keeps a trace of acceleration, which must not turn it round.
        let speed = if speed * target < 0.0 { 0.0 } else { speed };
        let next = Self { speed, accel };
        if (next.speed - target).abs() < REACHED { Self { speed: target, accel } } else { next }
    }

    /// Returns the motion `dt` seconds later that has this very speed, if the limits allow it and the
    /// amount of the speed stays below `most` and need not pass through rest; else that on the way to
    /// it. A target that changes slowly is met without delay.
    pub(super) fn track(&self, target: f64, dt: f64, limits: &AxisLimits, most: f64) -> Self {
        let next = Self { speed: target, accel: (target - self.speed) / dt };
        // By the speed before the step: one that ends at rest slows down, too.
        let slows = self.speed * next.accel < 0.0;
        let fades = next.accel * next.accel / (2.0 * limits.jerk) <= next.speed.abs();
        let is_allowed = dt > 0.0
            && next.speed * self.speed >= 0.0
            && next.accel.abs() <= if slows { limits.decel } else { limits.accel }
            && (next.accel - self.accel).abs() <= limits.jerk * dt
            && if slows { fades } else { next.peak(limits) <= most };
        if is_allowed { next } else { self.towards(target, dt, limits) }
    }

    /// Returns the motion after an emergency that set this speed: its acceleration is that of this step
    /// as far as the limits allow it and the axis can come to rest from it.
    pub(super) fn braked(&self, speed: f64, dt: f64, limits: &AxisLimits) -> Self {
        let most = limits.decel.min((2.0 * limits.jerk * speed.abs()).sqrt());
        let off = speed - self.speed;
        let accel = if dt > 0.0 { (off / dt).clamp(-most, most) } else { 0.0 };
        Self { speed, accel }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const LIMITS: AxisLimits = AxisLimits { accel: 0.5, decel: 1.0, jerk: 5.0 };

    /// Returns the motions on the way to a speed.
    fn way(from: Axis, target: f64, steps: usize) -> Vec<Axis> {
        std::iter::successors(Some(from), |axis| Some(axis.towards(target, 0.05, &LIMITS)))
            .take(steps + 1)
            .collect()
    }

    /// Speeds to reach, many of them rest or next to it.
    fn wish() -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), 0.0..1e-5_f64, 0.0..0.1_f64, 0.0..0.9_f64]
    }

    /// Time steps, many of them very short.
    fn step_s() -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), 0.0..1e-3_f64, Just(0.05), 0.0..0.2_f64]
    }

    #[test]
    fn a_speed_is_reached_without_passing_it() {
        let way = way(Axis::default(), 0.6, 60);
        assert_eq!(way[60].speed, 0.6);
        assert!(way.iter().all(|axis| axis.speed <= 0.6), "{way:?}");
        assert!(way.iter().any(|axis| axis.accel == LIMITS.accel), "the limit is used: {way:?}");
        assert!(way.windows(2).all(|pair| pair[0].speed <= pair[1].speed), "{way:?}");
    }

    #[test]
    fn acceleration_and_deceleration_differ_on_both_sides_of_rest() {
        for side in [1.0, -1.0] {
            let from = Axis { speed: 0.8 * side, accel: 0.0 };
            let slows = way(from, 0.0, 60);
            assert_eq!(slows[60].speed, 0.0);
            let hardest = slows.iter().map(|axis| -axis.accel * side).fold(0.0, f64::max);
            assert_eq!(hardest, LIMITS.decel);
            let turns = way(from, -0.5 * side, 100);
            assert_eq!(turns[100].speed, -0.5 * side);
            assert!(
                turns
                    .iter()
                    .filter(|axis| axis.speed * side < 0.0)
                    .all(|axis| { axis.accel.abs() <= LIMITS.accel + 1e-9 })
            );
        }
    }

    #[test]
    fn a_target_that_changes_slowly_is_met_without_delay() {
        let mut axis = Axis { speed: 0.8, accel: 0.0 };
        for step in 1..20 {
            let target = 0.8 - 0.005 * f64::from(step);
            axis = axis.track(target, 0.05, &LIMITS, 0.9);
            assert_eq!(axis.speed, target);
        }
        let leap = axis.track(0.2, 0.05, &LIMITS, 0.9);
        assert_eq!(leap, axis.towards(0.2, 0.05, &LIMITS));
        assert!(leap.accel >= axis.accel - LIMITS.jerk * 0.05 - 1e-9);
    }

    proptest! {
        /// Targets and time steps change at will.
        #[test]
        fn speed_acceleration_and_jerk_stay_within_their_limits(
            exact in any::<bool>(),
            steps in prop::collection::vec((-0.9..0.9_f64, 0.0..0.2_f64), 60)
        ) {
            let mut axis = Axis::default();
            for (target, dt) in steps {
                let next = if exact {
                    axis.track(target, dt, &LIMITS, 0.9)
                } else {
                    axis.towards(target, dt, &LIMITS)
                };
                prop_assert!(next.peak(&LIMITS) <= 0.9 + 1e-6, "{next:?}");
                prop_assert!(next.accel.abs() <= LIMITS.decel + 1e-9, "{next:?}");
                let change = (next.accel - axis.accel).abs();
                prop_assert!(change <= LIMITS.jerk * dt + 1e-9, "{axis:?} {next:?}");
                prop_assert!((next.speed - axis.speed - next.accel * dt).abs() < 2.0 * REACHED);
                axis = next;
            }
        }

        /// Without a wish to drive backwards the axis never does, whatever the way to each speed.
        #[test]
        fn an_axis_does_not_swing_through_rest(
            steps in prop::collection::vec((0..3_u8, wish(), step_s()), 60)
        ) {
            let mut axis = Axis::default();
            for (way, target, dt) in steps {
                let next = match way {
                    0 => axis.towards(target, dt, &LIMITS),
                    1 => axis.track(target, dt, &LIMITS, 0.9),
                    _ => axis.braked(target.min(axis.speed), dt, &LIMITS),
                };
                prop_assert!(next.speed >= 0.0, "{axis:?} {next:?}");
                axis = next;
            }
        }
    }
}
