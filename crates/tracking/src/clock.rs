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
