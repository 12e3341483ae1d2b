use std::collections::VecDeque;

use tagalong_core::{Frame, Funnel, Motion, Stamp};

use crate::{ClockSettings, Outcome};

/// Frame periods that the usual one is taken from.
const PERIODS: usize = 9;
/// So many periods must be known before there is a usual one.
const MIN_PERIODS: usize = 3;

/// What to do with a frame.
pub(crate) enum Tick {
    /// Nothing.
    Skip(Outcome),
    /// Process it; without a motion, tracks cannot be predicted to it.
    Go(Outcome, Option<Motion>),
}

/// Decides by its stamp whether a frame is processed, and over what motion the
/// tracks are predicted to it.
pub(crate) struct Clock {
    settings: ClockSettings,
    last: Option<Stamp>,
    /// Motion of frames that were skipped.
    pending: Option<Motion>,
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
        self.pending = Some(motion);
        Tick::Skip(outcome)
    }

    fn go(&mut self, stamp: Stamp, outcome: Outcome, motion: Motion) -> Tick {
        let dt = self.last.map(|last| stamp.seconds_since(last)).filter(|dt| *dt > 0.0);
        self.last = Some(stamp);
        self.pending = None;
        if let Some(dt) = dt {
            self.periods.push_back(dt);
            if self.periods.len() > PERIODS {
                self.periods.pop_front();
            }
        }
        match outcome {
            Outcome::ResetBackward { .. } | Outcome::ResetForward { .. } => Tick::Go(outcome, None),
            _ => Tick::Go(outcome, dt.map(|dt| Motion { dt, ..motion })),
        }
    }

    /// The motion since the last processed frame.
    fn whole_motion(&self, frame: &Frame, funnel: &mut Funnel) -> Motion {
        let mut motion = frame.motion;
        if !is_finite(&motion) {
            funnel.drop_many("motion not finite", 1);
            motion = Motion::at_rest(0.0);
        }
        self.pending.map_or(motion, |pending| pending.then(&motion))
    }

    fn outcome(&self, stamp: Stamp) -> Outcome {
        let Some(last) = self.last else { return Outcome::Tracked };
        let by_s = stamp.seconds_since(last);
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

    /// Median time between frames; 0 while too few are known.
    fn usual_period_s(&self) -> f64 {
        let mut periods: Vec<f64> = self.periods.iter().copied().collect();
        if periods.len() < MIN_PERIODS {
            return 0.0;
        }
        periods.sort_by(f64::total_cmp);
        periods[periods.len() / 2]
    }
}

fn is_finite(motion: &Motion) -> bool {
    [motion.dt, motion.forward, motion.left, motion.turn].iter().all(|v| v.is_finite())
        && motion.covariance.iter().all(|v| v.is_finite())
}
