use std::time::Instant;

use tagalong_core::{Funnel, TrackId};

use crate::Weighing;

/// What the stages of one frame leave behind beside their results.
pub(crate) struct StageLog {
    pub(crate) funnel: Funnel,
    pub(crate) nis: Vec<(TrackId, f64, u32)>,
    pub(crate) ended: Vec<TrackId>,
    pub(crate) weighing: Weighing,
    pub(crate) timings: Vec<(&'static str, f64)>,
    lap: Instant,
}

impl StageLog {
    pub(crate) fn new() -> Self {
        Self {
            funnel: Funnel::default(),
            nis: Vec::new(),
            ended: Vec::new(),
            weighing: Weighing::default(),
            timings: Vec::new(),
            lap: Instant::now(),
        }
    }

    /// Counts the time since the last stage for this one, and hands its result on.
    pub(crate) fn timed<T>(&mut self, stage: &'static str, result: T) -> T {
        let now = Instant::now();
        self.timings.push((stage, (now - self.lap).as_secs_f64() * 1e3));
        self.lap = now;
        result
    }
}
