use tagalong_core::EgoMotion;

/// A longer pause between frames counts as this one, s: speeds must not jump after it.
const LONGEST_STEP_S: f64 = 0.5;

/// Returns the time since the previous frame, 0 to half a second.
pub fn step_s(motion: &EgoMotion) -> f64 {
    if motion.dt > 0.0 { motion.dt.min(LONGEST_STEP_S) } else { 0.0 }
}

/// Returns the weight of a target that was last seen `unseen_s` ago: 1 up to half of `max_unseen_s`,
/// and from there on less, down to 0.
pub fn coasting_weight(unseen_s: f64, max_unseen_s: f64) -> f64 {
    let left = 2.0 * (1.0 - unseen_s / max_unseen_s);
    // Not by `clamp`, which would pass NaN on to the wheels.
    if left > 0.0 { left.min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_loses_its_weight_in_the_second_half() {
        let weights = [0.0, 1.0, 1.5, 2.0, 9.0].map(|unseen_s| coasting_weight(unseen_s, 2.0));
        assert_eq!(weights, [1.0, 1.0, 0.5, 0.0, 0.0]);
        assert_eq!(coasting_weight(f64::NAN, 2.0), 0.0);
        assert_eq!(coasting_weight(0.0, 0.0), 0.0);
    }

    #[test]
    fn steps_are_neither_negative_nor_long() {
        assert_eq!(
            [0.1, 0.5, 7.0, -1.0, f64::NAN].map(|dt| step_s(&EgoMotion::at_rest(dt))),
            [0.1, 0.5, 0.5, 0.0, 0.0]
        );
    }
}
