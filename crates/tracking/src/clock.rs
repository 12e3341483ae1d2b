use std::collections::VecDeque;

use tagalong_core::{EgoMotion, Frame, Funnel, Stamp};

use crate::{ClockSettings, Outcome};

/// Number of frame periods from which the usual one is computed.
const PERIODS: usize = 9;
/// Least number of known periods for a usual one.
const MIN_PERIODS: usize = 3;

/// Decision about a frame.
pub(crate) enum Tick {
    /// The frame is not processed.
    Skip(Outcome),
    /// The frame is processed; without a motion, tracks cannot be predicted to it.
    Go(Outcome, Option<EgoMotion>),
}

/// Decides by its stamp if a frame is processed, and over which motion the tracks are predicted to
/// it.
pub(crate) struct Clock {
    settings: ClockSettings,
    last: Option<Stamp>,
    /// Motion of the frames that were skipped.
    pending: Option<EgoMotion>,
    periods: VecDeque<f64>,
}

impl Clock {
    pub(crate) fn new(settings: ClockSettings) -> Self {
        Self { settings, last: None, pending: None, periods: VecDeque::new() }
    }

    pub(crate) fn tick(&mut self, frame: &Frame, funnel: &mut Funnel) -> Tick {
        let motion = self.whole_motion(frame, funnel);
        let outcome = self.outcome(frame.stamp);
        match outcome {
            Outcome::Duplicate => funnel.drop_many("frame: duplicate", 1),
            Outcome::OutOfOrder => funnel.drop_many("frame: out of order", 1),
            _ => return self.go(frame.stamp, outcome, motion),
        }
        // The robot moved during a skipped frame, too, so its motion is added to that of the next
        // one.
        self.pending = Some(motion);
        Tick::Skip(outcome)
    }

    /// Passes over a frame that is refused: the robot moved during it, too.
    pub(crate) fn pass(&mut self, frame: &Frame) {
        self.pending = Some(self.whole_motion(frame, &mut Funnel::default()));
    }

    fn go(&mut self, stamp: Stamp, outcome: Outcome, motion: EgoMotion) -> Tick {
        let dt = self.last.map(|last| stamp.seconds_since(last)).filter(|dt| *dt > 0.0);
        self.last = Some(stamp);
        self.pending = None;
        if let Some(dt) = dt {
            self.periods.push_back(dt);
            if self.periods.len() > PERIODS {
                self.periods.pop_front();
            }
        }
        // A jump of the clock leaves the time step unknown, and with it the prediction.
        match outcome {
            Outcome::ResetBackward { .. } | Outcome::ResetForward { .. } => Tick::Go(outcome, None),
            _ => Tick::Go(outcome, dt.map(|dt| EgoMotion { dt, ..motion })),
        }
    }

    /// Returns the motion since the last processed frame.
    fn whole_motion(&self, frame: &Frame, funnel: &mut Funnel) -> EgoMotion {
        let mut motion = frame.motion;
        // One number that is not finite would spread to the states of all tracks.
        if !is_finite(&motion) {
            funnel.drop_many("motion not finite", 1);
            motion = EgoMotion::at_rest(0.0);
        }
        self.pending.map_or(motion, |pending| pending.then(&motion))
    }

    fn outcome(&self, stamp: Stamp) -> Outcome {
        let Some(last) = self.last else { return Outcome::Tracked };
        let by_s = stamp.seconds_since(last);
        // A slow camera may exceed the limits in every frame, so three usual periods are never a
        // gap.
        let usual = 3.0 * self.usual_period_s();
        if stamp == last {
            Outcome::Duplicate
        } else if by_s < -self.settings.max_back_s {
            Outcome::ResetBackward { by_s: -by_s }
        } else if by_s < 0.0 {
            Outcome::OutOfOrder
        } else if by_s > self.settings.reset_gap_s.max(usual) {
            Outcome::ResetForward { by_s }
        } else if by_s > self.settings.max_gap_s.max(usual) && usual > 0.0 {
            Outcome::Gap { by_s }
        } else {
            Outcome::Tracked
        }
    }

    /// Returns the median time between frames; 0 while too few are known.
    fn usual_period_s(&self) -> f64 {
        if self.periods.len() < MIN_PERIODS {
            return 0.0;
        }
        tagalong_math::median(self.periods.iter().copied()).unwrap_or(0.0)
    }
}

fn is_finite(motion: &EgoMotion) -> bool {
    [motion.dt, motion.forward, motion.left, motion.turn].iter().all(|v| v.is_finite())
        && motion.covariance.iter().all(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::one;
    use tagalong_core::Images;
    use tagalong_geometry::Camera;

    use super::*;

    /// Returns a frame at a time, s, after a step of the robot, m.
    fn frame(t_s: f64, forward: f64) -> Frame {
        let stamp = Stamp::from_nanos(1_000_000_000_000).plus_seconds(t_s);
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.05) };
        Frame::new(1, stamp, Arc::new(Camera::blind(one())), motion, Images::default())
    }

    fn clock() -> Clock {
        Clock::new(ClockSettings::default())
    }

    /// Returns the name of the outcome of the last frame, and its time, ms.
    fn last(times_s: &[f64]) -> (&'static str, f64) {
        let mut clock = clock();
        let mut outcome = Outcome::Tracked;
        for t_s in times_s {
            outcome = match clock.tick(&frame(*t_s, 0.0), &mut Funnel::default()) {
                Tick::Skip(outcome) | Tick::Go(outcome, _) => outcome,
            };
        }
        match outcome {
            Outcome::Tracked => ("tracked", 0.0),
            Outcome::Duplicate => ("duplicate", 0.0),
            Outcome::OutOfOrder => ("out of order", 0.0),
            Outcome::Gap { by_s } => ("gap", (1e3 * by_s).round()),
            Outcome::ResetBackward { by_s } => ("back", (1e3 * by_s).round()),
            Outcome::ResetForward { by_s } => ("ahead", (1e3 * by_s).round()),
        }
    }

    /// Returns the outcome of a frame after a pause that follows frames with these periods.
    fn after(periods_s: &[f64], pause_s: f64) -> (&'static str, f64) {
        let mut times_s = vec![0.0];
        for period_s in periods_s.iter().chain([&pause_s]) {
            times_s.push(times_s[times_s.len() - 1] + period_s);
        }
        last(&times_s)
    }

    #[test]
    fn an_old_frame_is_late_or_the_clock_was_set_back() {
        assert_eq!(last(&[1.0, 1.0]), ("duplicate", 0.0));
        assert_eq!(last(&[1.0, 0.95]), ("out of order", 0.0));
        assert_eq!(last(&[1.0, 0.9]), ("out of order", 0.0), "by the largest time");
        assert_eq!(last(&[1.0, 0.89]), ("back", 110.0));
    }

    #[test]
    fn a_pause_is_a_gap_and_a_long_one_a_jump() {
        let usual = [0.1; 4];
        assert_eq!(after(&usual, 0.45), ("tracked", 0.0));
        assert_eq!(after(&usual, 0.6), ("gap", 600.0));
        assert_eq!(after(&usual, 0.95), ("ahead", 950.0));
        assert_eq!(after(&[], 0.95), ("ahead", 950.0));
    }

    #[test]
    fn three_usual_periods_are_no_pause() {
        assert_eq!(after(&[0.4; 4], 1.15), ("tracked", 0.0));
        assert_eq!(after(&[0.4; 4], 1.25), ("ahead", 1250.0));
        assert_eq!(after(&[0.1; 2], 0.6), ("tracked", 0.0), "the usual period is not known yet");
        assert_eq!(after(&[0.1; 3], 0.6), ("gap", 600.0));
    }

    /// The median of nine.
    #[test]
    fn a_camera_that_became_slower_is_slow_after_five_frames() {
        let mut periods_s = vec![0.1; 20];
        periods_s.extend([0.4; 4]);
        assert_eq!(after(&periods_s, 0.6), ("gap", 600.0));
        periods_s.push(0.4);
        assert_eq!(after(&periods_s, 0.6), ("tracked", 0.0));
    }

    /// Returns the motion over which the tracks are predicted to a frame.
    fn motion_to(clock: &mut Clock, frame: &Frame, funnel: &mut Funnel) -> Option<EgoMotion> {
        match clock.tick(frame, funnel) {
            Tick::Skip(_) => None,
            Tick::Go(_, motion) => motion,
        }
    }

    #[test]
    fn the_motion_of_a_skipped_frame_is_not_lost_and_its_time_is_that_of_the_stamps() {
        let mut clock = clock();
        let mut funnel = Funnel::default();
        assert_eq!(motion_to(&mut clock, &frame(0.0, 0.01), &mut funnel), None, "the first frame");
        assert_eq!(motion_to(&mut clock, &frame(0.0, 0.03), &mut funnel), None);
        assert_eq!(motion_to(&mut clock, &frame(-0.05, 0.05), &mut funnel), None);
        let motion = motion_to(&mut clock, &frame(0.1, 0.04), &mut funnel).unwrap();
        assert!((motion.forward - 0.12).abs() < 1e-12, "{motion:?}");
        assert!((motion.dt - 0.1).abs() < 1e-9, "{motion:?}");
        let motion = motion_to(&mut clock, &frame(0.2, 0.04), &mut funnel).unwrap();
        assert!((motion.forward - 0.04).abs() < 1e-12, "{motion:?}");
        assert_eq!(motion_to(&mut clock, &frame(9.0, 0.04), &mut funnel), None, "a jump");
        let counts = ["frame: duplicate", "frame: out of order"].map(|test| funnel.count(test));
        assert_eq!(counts, [1, 1]);
    }

    #[test]
    fn a_motion_that_is_no_number_counts_as_rest() {
        let mut clock = clock();
        let mut funnel = Funnel::default();
        clock.tick(&frame(0.0, 0.0), &mut funnel);
        let mut uncertain = frame(0.1, 0.04);
        uncertain.motion.covariance[(0, 1)] = f64::INFINITY;
        for (t_s, odd) in [(0.1, uncertain), (0.2, frame(0.2, f64::NAN))] {
            let motion = motion_to(&mut clock, &odd, &mut funnel).unwrap();
            assert_eq!((motion.forward, motion.covariance[(0, 1)]), (0.0, 0.0), "{t_s}");
        }
        assert_eq!(funnel.count("motion not finite"), 2);
    }
}
