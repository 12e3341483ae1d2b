//! Positions of the confirmed tracks of a pipeline over a log.

use std::collections::BTreeMap;

use nalgebra::{Isometry2, Point2};
use tagalong_core::Stamp;
use tagalong_math::median;
use tagalong_pipeline::FrameReport;

/// Confirmed track in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// ID of the track.
    pub id: u32,
    /// Position on the floor, odometry frame, m.
    pub place: Point2<f64>,
    /// Distance from the robot, m.
    pub range_m: f64,
    /// Standard deviation of the position, m.
    pub sigma_m: f64,
    /// True if there is evidence for it in this frame.
    pub seen: bool,
}

/// Confirmed tracks of one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Index of the frame.
    pub index: u64,
    /// Time of the frame.
    pub stamp: Stamp,
    /// The tracks.
    pub tracks: Vec<Placed>,
}

/// Confirmed tracks of all frames.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// The frames in order.
    pub moments: Vec<Moment>,
    /// Time of the pipeline, ms.
    pub spent_ms: f64,
}

/// Motion of a track over its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Life {
    /// The track left its first position.
    Moved,
    /// The track stayed within the noise for long enough.
    Still,
    /// The track is too short, or its positions are too uncertain.
    Unclear,
}

/// Motion of the tracks, by their IDs.
pub type Lives = BTreeMap<u32, Life>;

/// Least duration of a track that counts as static, s.
pub const STILL_S: f64 = 3.0;

/// Distance from the first position that counts as motion, m, and its growth with the distance from
/// the robot, because the noise of depth grows.
const MOVED_M: f64 = 0.4;
const MOVED_GROWTH: f64 = 0.03;

/// Number of frames up to which all of them are used.
const SHORT: usize = 6;

/// Uncertainty of a position above which motion cannot be detected, m.
const MAX_SIGMA_M: f64 = 0.5;

impl Course {
    /// Adds the report of a frame.
    pub fn take(&mut self, report: &FrameReport, odom_from_robot: &Isometry2<f64>) {
        self.spent_ms += report.timings.iter().map(|(_, ms)| ms).sum::<f64>();
        let confirmed = report.tracks.iter().filter(|track| track.confirmed);
        let placed = confirmed.map(|track| {
            let in_robot = track.estimate.person.position.xy();
            let covariance = &track.estimate.covariance;
            Placed {
                id: track.id.0,
                place: odom_from_robot * in_robot,
                range_m: in_robot.coords.norm(),
                sigma_m: covariance[(0, 0)].max(covariance[(1, 1)]).max(0.0).sqrt(),
                seen: track.seen,
            }
        });
        self.moments.push(Moment {
            index: report.index,
            stamp: report.stamp,
            tracks: placed.collect(),
        });
    }

    /// Returns the motion of each track.
    pub fn lives(&self) -> Lives {
        let mut seen: BTreeMap<u32, Vec<(Stamp, Placed)>> = BTreeMap::new();
        for moment in &self.moments {
            for track in moment.tracks.iter().filter(|track| track.seen) {
                seen.entry(track.id).or_default().push((moment.stamp, *track));
            }
        }
        seen.iter().map(|(id, track)| (*id, life(track))).collect()
    }
}

/// Returns the median of the values; 0 if there are none.
fn middle(part: &[(Stamp, Placed)], value: impl Fn(&Placed) -> f64) -> f64 {
    median(part.iter().map(|(_, placed)| value(placed))).unwrap_or(0.0)
}

fn middle_place(part: &[(Stamp, Placed)]) -> Point2<f64> {
    Point2::new(middle(part, |placed| placed.place.x), middle(part, |placed| placed.place.y))
}

/// Classifies the motion of a track from the frames in which it was seen.
fn life(seen: &[(Stamp, Placed)]) -> Life {
    let noise_m = MOVED_M + MOVED_GROWTH * middle(seen, |placed| placed.range_m);
    let home = middle_place(seen);
    // The median of three frames in a row, so that a single outlier is not taken for motion. Short
    // tracks of slow cameras have too few frames for this.
    let length = if seen.len() < SHORT { 1 } else { 3 };
    let farthest =
        seen.windows(length).map(|part| (middle_place(part) - home).norm()).fold(0.0, f64::max);
    let is_rough = middle(seen, |placed| placed.sigma_m) > MAX_SIGMA_M;
    let ends = seen.first().zip(seen.last());
    let lasted_s = ends.map_or(0.0, |((first, _), (last, _))| last.seconds_since(*first));
    match () {
        () if is_rough => Life::Unclear,
        () if farthest > noise_m => Life::Moved,
        () if lasted_s >= STILL_S => Life::Still,
        () => Life::Unclear,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a track that is seen ten times a second at these positions along the x axis, m.
    fn walk(places: &[f64]) -> Life {
        let mut seen = Vec::new();
        for (i, x) in places.iter().enumerate() {
            let stamp = Stamp::default().plus_seconds(0.1 * i as f64);
            let place = Point2::new(*x, 1.0);
            seen.push((stamp, Placed { id: 1, place, range_m: 3.0, sigma_m: 0.05, seen: true }));
        }
        life(&seen)
    }

    #[test]
    fn a_track_that_stays_within_the_noise_never_moved() {
        let jitter: Vec<f64> = (0..60).map(|i| 3.0 + 0.1 * f64::from(i % 3 - 1)).collect();
        assert_eq!(walk(&jitter), Life::Still);
        assert_eq!(walk(&jitter[..20]), Life::Unclear, "two seconds are too short");
        let mut wild = jitter.clone();
        wild[30] = 5.0;
        assert_eq!(walk(&wild), Life::Still, "one wild frame is no motion");
    }

    #[test]
    fn a_track_that_goes_somewhere_at_some_time_moved() {
        let steps: Vec<f64> = (0..60).map(|i| f64::from(i.min(10)) * 0.1).collect();
        assert_eq!(walk(&steps), Life::Moved);
        assert_eq!(walk(&[0.0, 0.7, 1.4]), Life::Moved, "however short");
    }

    #[test]
    fn rough_places_tell_nothing() {
        let rough =
            Placed { id: 1, place: Point2::new(3.0, 0.0), range_m: 3.0, sigma_m: 2.0, seen: true };
        let seen: Vec<_> =
            (0..20).map(|i| (Stamp::default().plus_seconds(f64::from(i)), rough)).collect();
        assert_eq!(life(&seen), Life::Unclear);
    }
}
