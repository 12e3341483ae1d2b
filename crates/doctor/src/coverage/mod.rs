//! Coverage: shapes that come and go in a log, compared with the tracks of a pipeline.

mod course;

use nalgebra::Point2;
use serde::Serialize;

pub use course::{Course, STILL_S};
use course::{Life, Lives, Moment, Placed};

use super::scenery::{self, Blob, Scenery};

/// Largest distance of a track from a person-sized blob that it explains, m.
const EXPLAINS_M: f64 = 0.5;

/// Distance around a track within which points have to come or go, m, and the share of them that
/// has to.
const STIRS_M: f64 = 0.4;
const STIRS_SHARE: f64 = 0.15;

/// Figures of a pipeline on a log without truth.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Coverage {
    /// True if there are depth images for the comparison.
    pub has_depth: bool,
    /// Number of frames that the pipeline processed.
    pub frames: usize,
    /// Number of frames in which a confirmed track was seen.
    pub frames_with_people: usize,
    /// Confirmed tracks that left their first position.
    pub moving: usize,
    /// Confirmed tracks that never did.
    pub still: usize,
    /// Confirmed tracks whose motion is uncertain.
    pub unclear: usize,
    /// Boxes: confirmed tracks that were seen, summed over all frames.
    pub boxes: usize,
    /// Boxes of tracks that never moved.
    pub still_boxes: usize,
    /// Boxes at positions where nothing ever comes or goes; if the depth image does not show the
    /// position, boxes of tracks that never moved.
    pub idle_boxes: usize,
    /// Person-sized blobs that come and go, summed over all frames with depth.
    pub blobs: usize,
    /// Such blobs without a track.
    pub unexplained: usize,
    /// Number of frames with an unexplained blob.
    pub frames_unexplained: usize,
    /// Example of an unexplained blob.
    pub example: Option<Example>,
    /// Frames with unexplained blobs, those with the most first.
    #[serde(skip)]
    pub missed_frames: Vec<u64>,
    /// Mean time per frame, ms.
    #[serde(skip)]
    pub frame_ms: f64,
}

/// Position of an unexplained blob.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Example {
    /// Index of the frame.
    pub frame: u64,
    /// Distance from the camera on the floor, m.
    pub range_m: f64,
    /// Bearing, positive to the left, degrees.
    pub bearing_deg: f64,
    /// Height of its highest point, m.
    pub top_m: f64,
}

impl Coverage {
    /// Compares the tracks of a pipeline with the shapes that come and go.
    pub fn of(course: &Course, scenery: &Scenery) -> Self {
        let has_depth = !scenery.moments.is_empty();
        let mut out = Self { has_depth, frames: course.moments.len(), ..Self::default() };
        out.frame_ms = course.spent_ms / out.frames.max(1) as f64;
        let lives = course.lives();
        out.add_tracks(&lives);
        let mut missed: Vec<(usize, u64)> = Vec::new();
        for moment in &course.moments {
            let seen = scenery.moment(moment.index);
            out.add_boxes(moment, &lives, seen);
            missed.extend(seen.map(|seen| (out.add_blobs(moment, seen), moment.index)));
        }
        missed.retain(|(count, _)| *count > 0);
        // The sort is stable: of equal frames the earlier one comes first.
        missed.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        out.frames_unexplained = missed.len();
        out.missed_frames = missed.into_iter().map(|(_, index)| index).collect();
        out
    }

    /// Counts the tracks by their motion.
    fn add_tracks(&mut self, lives: &Lives) {
        for life in lives.values() {
            match life {
                Life::Moved => self.moving += 1,
                Life::Still => self.still += 1,
                Life::Unclear => self.unclear += 1,
            }
        }
    }

    /// Counts the boxes of a frame, those of tracks that never moved, and those at idle positions.
    fn add_boxes(&mut self, moment: &Moment, lives: &Lives, seen: Option<&scenery::Moment>) {
        let boxes = self.boxes;
        for track in moment.tracks.iter().filter(|track| track.seen) {
            let is_still = lives.get(&track.id) == Some(&Life::Still);
            let share = seen.and_then(|seen| seen.plan.changed_share(track.place, STIRS_M));
            let is_idle = share.map_or(is_still, |share| share < STIRS_SHARE);
            self.boxes += 1;
            self.still_boxes += usize::from(is_still);
            self.idle_boxes += usize::from(is_idle);
        }
        self.frames_with_people += usize::from(self.boxes > boxes);
    }

    /// Compares the tracks of a frame with the blobs in its depth image; returns the number of blobs
    /// without a track.
    fn add_blobs(&mut self, moment: &Moment, seen: &scenery::Moment) -> usize {
        self.blobs += seen.blobs.len();
        let missed: Vec<&Blob> = unexplained(moment, seen).collect();
        self.unexplained += missed.len();
        let examples = missed.iter().map(|blob| {
            let (range_m, bearing_deg) = seen.bearing_of(blob.place);
            Example { frame: moment.index, range_m, bearing_deg, top_m: blob.top_m }
        });
        // The nearest one is the easiest to see in the picture of its frame.
        self.example =
            self.example.into_iter().chain(examples).min_by(|a, b| a.range_m.total_cmp(&b.range_m));
        missed.len()
    }

    /// Returns the share of the blobs that a track explains; `None` without blobs.
    pub fn found(&self) -> Option<f64> {
        (self.blobs > 0).then(|| 1.0 - self.unexplained as f64 / self.blobs as f64)
    }

    /// Returns the share of boxes at which nothing ever comes or goes.
    pub fn idle(&self) -> f64 {
        self.idle_boxes as f64 / self.boxes.max(1) as f64
    }

    /// Returns a score for ranking settings, 0 to 1: the F1 measure with blobs that come and go
    /// instead of people, and boxes at which nothing ever does as false positives. It is only an
    /// estimate: people that never move count as false.
    pub fn worth(&self) -> f64 {
        let found = (self.blobs - self.unexplained) as f64;
        let wrong = (self.unexplained + self.idle_boxes) as f64;
        2.0 * found / (2.0 * found + wrong).max(1.0)
    }

    /// Returns the mean number of boxes per frame.
    pub fn boxes_a_frame(&self) -> f64 {
        self.boxes as f64 / self.frames.max(1) as f64
    }
}

/// Returns the blobs of a frame that no track explains.
pub fn unexplained<'a>(
    moment: &Moment,
    seen: &'a scenery::Moment,
) -> impl Iterator<Item = &'a Blob> {
    seen.blobs.iter().filter(|blob| !is_explained(blob.place, &moment.tracks))
}

fn is_explained(blob: Point2<f64>, tracks: &[Placed]) -> bool {
    tracks.iter().any(|track| (track.place - blob).norm() <= EXPLAINS_M)
}

/// Alternative setting and its figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// Line of a config, or the name of another config.
    pub change: String,
    /// Figures with it.
    pub coverage: Coverage,
}

#[cfg(test)]
mod tests {
    use tagalong_core::Stamp;

    use super::*;
    use crate::scenery::testing::{PILLAR, Room, Thing};

    const FRAMES: u64 = 40;

    /// Tracks at given positions over time, in all frames.
    fn course(tracks: &[&dyn Fn(f64) -> Point2<f64>]) -> Course {
        let moments = (0..FRAMES).map(|number| {
            let seconds = 0.1 * number as f64;
            let tracks = (1..).zip(tracks).map(|(id, place)| {
                let place = place(seconds);
                Placed { id, place, range_m: place.coords.norm(), sigma_m: 0.05, seen: true }
            });
            let stamp = Stamp::default().plus_seconds(seconds);
            Moment { index: number + 1, stamp, tracks: tracks.collect() }
        });
        Course { moments: moments.collect(), spent_ms: 80.0 }
    }

    fn scenery() -> Scenery {
        Room::default().with(Thing::walking()).seen(FRAMES, 0.0).judge()
    }

    #[test]
    fn a_tracked_pillar_and_an_untracked_walker_are_told() {
        let found = Coverage::of(&course(&[&|_| PILLAR]), &scenery());
        assert_eq!((found.moving, found.still, found.unclear), (0, 1, 0));
        assert_eq!((found.boxes, found.still_boxes), (40, 40));
        assert_eq!((found.frames, found.frames_with_people), (40, 40));
        assert!(found.idle() > 0.8, "{found:?}");
        assert!(found.found().unwrap() < 0.2, "{found:?}");
        assert!(found.worth() < 0.2, "{found:?}");
        assert_eq!(found.frames_unexplained, found.missed_frames.len());
        assert_eq!(found.frame_ms, 2.0);
        let example = found.example.unwrap();
        assert!((example.range_m - 3.0).abs() < 0.3, "{example:?}");
        // Frames count from one, and the walker crosses the middle after 1.8 s.
        let side = 0.9 - 0.05 * (example.frame - 1) as f64;
        assert_eq!(example.bearing_deg > 0.0, side > 0.0, "{example:?}");
    }

    #[test]
    fn a_track_of_the_walker_explains_it() {
        let walker = Thing::walking();
        let found = Coverage::of(&course(&[&|seconds| walker.place(seconds)]), &scenery());
        assert_eq!((found.moving, found.still), (1, 0));
        assert!(found.found().unwrap() > 0.95 && found.idle() < 0.05, "{found:?}");
        assert!(found.worth() > 0.95, "{found:?}");
        let aside = nalgebra::Vector2::new(0.0, 0.8);
        let beside = course(&[&|seconds| walker.place(seconds) + aside]);
        let found = Coverage::of(&beside, &scenery());
        assert!(found.found().unwrap() < 0.2, "a track 0.8 m beside explains nothing: {found:?}");
    }

    #[test]
    fn without_depth_the_motion_of_tracks_is_all_there_is() {
        let found = Coverage::of(&course(&[&|_| PILLAR]), &Scenery::default());
        assert_eq!((found.found(), found.idle()), (None, 1.0));
        assert!(!found.has_depth && found.boxes_a_frame() == 1.0);
    }
}
