use std::time::Instant;

use tagalong_core::{Funnel, TrackId};

use crate::Weighing;

/// Side results of the stages of one frame.
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

    /// Adds the time since the last stage to this one, and returns its result.
    pub(crate) fn timed<T>(&mut self, stage: &'static str, result: T) -> T {
        let now = Instant::now();
        self.timings.push((stage, (now - self.lap).as_secs_f64() * 1e3));
        self.lap = now;
        result
    }
}
