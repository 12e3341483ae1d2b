//! Boxes with which tracks were recently observed, for associators that compare a detection with an
//! observation instead of a prediction.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Vector2;
use tagalong_core::{Track, TrackId};
use tagalong_geometry::Rect;

/// Box of a track at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observed {
    /// The detection's box.
    pub region: Rect,
    /// Time on the clock of the memory, s.
    pub time_s: f64,
    /// Frame on the count of the memory.
    frame: u64,
}

/// The last observations of each track.
///
/// The boxes stay where they were in the image: the motion of the camera since then is not
/// compensated, because an associator is not told of it.
#[derive(Clone, Debug)]
pub struct ObservationMemory {
    /// Age up to which observations are kept beside the last one, frames.
    span: u64,
    time_s: f64,
    frame: u64,
    tracks: BTreeMap<TrackId, VecDeque<Observed>>,
}

impl ObservationMemory {
    /// Creates a memory of the observations of the last `span` frames.
    pub fn new(span: u32) -> Self {
        Self { span: span.into(), time_s: 0.0, frame: 0, tracks: BTreeMap::new() }
    }

    /// Begins a frame, `dt_s` after the last one: tracks that ended are forgotten. A new track was
    /// observed in the last frame where it is expected now, because its filter knows no velocity.
    pub fn begin(&mut self, tracks: &[Track], dt_s: f64) {
        let before = (self.time_s, self.frame);
        self.time_s += dt_s;
        self.frame += 1;
        let mut old = std::mem::take(&mut self.tracks);
        for Track { id, estimate, .. } in tracks {
            self.tracks.insert(
                *id,
                old.remove(id).unwrap_or_else(|| {
                    let (time_s, frame) = before;
                    VecDeque::from([Observed { region: estimate.region, time_s, frame }])
                }),
            );
        }
    }

    /// Records the detection that a track got in this frame.
    pub fn record(&mut self, id: TrackId, region: Rect) {
        let Self { span, time_s, frame, .. } = *self;
        let Some(observed) = self.tracks.get_mut(&id) else { return };
        observed.push_back(Observed { region, time_s, frame });
        // The oldest one within the span is the one that velocities start from.
        while observed.front().is_some_and(|first| first.frame + span < frame) {
            observed.pop_front();
        }
    }

    /// Returns the last observation of a track.
    pub fn last(&self, id: TrackId) -> Option<Observed> {
        self.tracks.get(&id)?.back().copied()
    }

    /// Returns the direction in which a track moved between its last two observations that are
    /// `span` frames apart, or nearly, and the centre from which it did so; `None` for a track that
    /// was observed once, or stood still to the pixel.
    pub fn direction(&self, id: TrackId) -> Option<(Rect, Vector2<f64>)> {
        let observed = self.tracks.get(&id)?;
        let first = observed.front()?;
        let last = observed.back()?;
        let way = last.region.centre() - first.region.centre();
        way.try_normalize(1e-9).map(|unit| (first.region, unit))
    }

    /// Returns the box at which a track is expected now if it goes on with the mean velocity of its
    /// observations, in place and size; the last one for a track that was observed once.
    pub fn expected(&self, id: TrackId) -> Option<Rect> {
        let observed = self.tracks.get(&id)?;
        let first = observed.front()?;
        let last = observed.back()?;
        let passed_s = last.time_s - first.time_s;
        let ahead = if passed_s > 0.0 { (self.time_s - last.time_s) / passed_s } else { 0.0 };
        let from = first.region.centre();
        let to = last.region.centre();
        let centre = to + (to - from) * ahead;
        let [width, height] =
            [[first.region.width, last.region.width], [first.region.height, last.region.height]]
                .map(|[from, to]| (to + (to - from) * ahead).max(1.0));
        Some(Rect::new(centre.x - 0.5 * width, centre.y - 0.5 * height, width, height))
    }
}

#[cfg(test)]
mod tests {
    use tagalong_conformance::samples::track_in;

    use super::*;

    fn at(x: f64) -> Rect {
        Rect::new(x, 0.0, 10.0, 20.0)
    }

    fn track(x: f64) -> Track {
        track_in(1, at(x))
    }

    /// A memory of a track that goes 2 pixels a frame from x = 0, observed in frames 0 to `frames`.
    fn walked(span: u32, frames: u32) -> ObservationMemory {
        let mut memory = ObservationMemory::new(span);
        for frame in 1..=frames {
            memory.begin(&[track(0.0)], 0.1);
            memory.record(TrackId(1), at(2.0 * f64::from(frame)));
        }
        memory
    }

    #[test]
    fn a_new_track_was_observed_where_it_is_expected() {
        let mut memory = ObservationMemory::new(3);
        memory.begin(&[track(7.0)], 0.1);
        assert_eq!(memory.last(TrackId(1)).unwrap().region, at(7.0));
        assert_eq!(memory.expected(TrackId(1)), Some(at(7.0)));
        assert_eq!(memory.direction(TrackId(1)), None);
    }

    #[test]
    fn velocities_are_means_over_the_span() {
        let mut memory = walked(3, 8);
        memory.record(TrackId(1), at(16.0));
        let (from, unit) = memory.direction(TrackId(1)).unwrap();
        assert_eq!((from, unit), (at(10.0), Vector2::x()));
        memory.begin(&[track(0.0)], 0.1);
        memory.begin(&[track(0.0)], 0.1);
        let expected = memory.expected(TrackId(1)).unwrap();
        assert!((expected.x - 20.0).abs() < 1e-9, "two frames on: {expected:?}");
    }

    #[test]
    fn a_track_that_ended_is_forgotten() {
        let mut memory = walked(3, 2);
        memory.begin(&[], 0.1);
        assert_eq!(memory.last(TrackId(1)), None);
        memory.record(TrackId(1), at(0.0));
        assert_eq!(memory.last(TrackId(1)), None, "and nothing is recorded for it");
    }
}
