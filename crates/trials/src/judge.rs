use nalgebra::{Isometry2, Point2};
use tagalong_core::Track;
use tagalong_eval::{
    Clear, Comparison, Frame, Match, Prepared, Region, Report, Role, Sequence, SetDistance,
    Similarity, Tally, Truth, View,
};
use tagalong_geometry::{Camera, Rect};
use tagalong_pipeline::FrameReport;

use crate::{Moment, Run, Trial, TrialError};

/// Rules for scoring: the people that count, and the comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judge {
    /// Measure of similarity: by positions on the floor, or by boxes in the image.
    pub similarity: Similarity,
    /// Distance beyond which a person is neither a miss nor a false positive, m.
    pub max_range_m: f64,
    /// If true, tracks that are only predicted count as reports as well.
    pub coasting: bool,
}

impl Default for Judge {
    fn default() -> Self {
        Self { similarity: Similarity::Metres, max_range_m: 6.0, coasting: false }
    }
}

/// Scores of a contender on a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judged {
    /// All counts; those of several trials are combined by [`Tally::combine`].
    pub tally: Tally,
    /// Errors of the matched positions in the robot frame, m.
    pub errors_in_robot_m: Vec<f64>,
    /// The same errors in the frame of the robot at the start, which includes the drift of the
    /// odometry that the pipeline used, m.
    pub errors_in_start_m: Vec<f64>,
}

impl Judge {
    /// Scores one contender.
    ///
    /// # Errors
    /// Tracks that cannot be scored.
    pub fn judge(&self, trial: &Trial, run: &Run) -> Result<Judged, TrialError> {
        let moments = processed(trial, run);
        let sequence = self.sequence(trial, &moments);
        // The same defaults as in `eval`, so that trials and logs are comparable.
        let comparison = Comparison::from(self.similarity);
        let tally = Tally::measure(&sequence, &comparison, &SetDistance::default())?;
        let prepared = Prepared::new(&sequence, &comparison)?;
        let (_, matches) = Clear::measure(&prepared);
        let [errors_in_robot_m, errors_in_start_m] = [false, true]
            .map(|in_start| errors_m(&moments, &sequence, &prepared, &matches, in_start));
        Ok(Judged { tally, errors_in_robot_m, errors_in_start_m })
    }

    fn sequence(&self, trial: &Trial, moments: &[(&Moment, &FrameReport)]) -> Sequence {
        let frames = moments.iter().map(|(moment, report)| self.frame(trial, moment, report));
        Sequence { name: format!("seed {}", trial.seed), frames: frames.collect() }
    }

    /// Returns the frame. If positions are compared, frames without a position do not count.
    fn frame(&self, trial: &Trial, moment: &Moment, report: &FrameReport) -> Frame {
        let by_box = self.similarity == Similarity::Iou;
        let truths = moment.truth.iter().map(|person| self.truth(person, &trial.camera));
        Frame {
            stamp_ns: moment.stamp.nanos() as i64,
            truths: truths.filter(|t| !by_box || t.region.is_some()).collect(),
            reports: self.reports(report, (trial.camera.width, trial.camera.height)),
            ignore_regions: Vec::new(),
        }
    }

    /// Returns the reports that count in a pipeline's report on a frame, for an image of this many
    /// columns and rows.
    pub fn reports(&self, report: &FrameReport, size: (usize, usize)) -> Vec<Report> {
        let by_box = self.similarity == Similarity::Iou;
        let tracks = report.tracks.iter().filter(|t| t.confirmed && (t.seen || self.coasting));
        let reports = tracks.map(|track| reported(track, size));
        reports.filter(|r| !by_box || r.region.is_some()).collect()
    }

    fn truth(&self, person: &tagalong_sim::Truth, camera: &Camera) -> Truth {
        let head = person.head_in_robot;
        let in_camera = camera.robot_from_camera.inverse_transform_point(&head);
        // Beyond the range both the person and the reports on it are left out.
        let far = head.x.hypot(head.y) > self.max_range_m;
        Truth {
            id: i64::from(person.id),
            region: person.upper_body.as_ref().map(region),
            floor_m: Some([head.x, head.y]),
            role: if person.ignore || far { Role::Ignored } else { Role::Counts },
            view: Some(View {
                visible: person.visible_fraction,
                distance_m: in_camera.coords.norm(),
            }),
        }
    }
}

/// Returns the frames that the pipeline processed.
fn processed<'a>(trial: &'a Trial, run: &'a Run) -> Vec<(&'a Moment, &'a FrameReport)> {
    let all = trial.moments.iter().zip(&run.reports);
    all.filter(|(_, report)| report.outcome.is_processed()).collect()
}

fn reported(track: &Track, (width, height): (usize, usize)) -> Report {
    let visible = track.estimate.region.clipped(width, height);
    let head = track.estimate.person.position;
    Report {
        id: i64::from(track.id.0),
        region: (visible.area() > 0.0).then(|| region(&visible)),
        floor_m: Some([head.x, head.y]),
        score: track.score,
    }
}

fn region(rect: &Rect) -> Region {
    Region::new(rect.x, rect.y, rect.width, rect.height)
}

/// Returns the errors of the matches. In the frame of the start, the truth uses the robot's real
/// motion, and the report the ego-motion that the pipeline estimated.
fn errors_m(
    moments: &[(&Moment, &FrameReport)],
    sequence: &Sequence,
    prepared: &Prepared,
    matches: &[Vec<Match>],
    in_start: bool,
) -> Vec<f64> {
    let Some((first, _)) = moments.first() else { return Vec::new() };
    let home = first.world_from_robot.inverse();
    let mut believed_home = Isometry2::identity();
    let mut errors = Vec::new();
    for (at, (moment, report)) in moments.iter().enumerate() {
        believed_home *= report.motion.isometry();
        let of = &sequence.frames[at];
        let frame = &prepared.frames[at];
        let (real, believed) = if in_start {
            (home * moment.world_from_robot, believed_home)
        } else {
            (Isometry2::identity(), Isometry2::identity())
        };
        errors.extend(matches[at].iter().filter_map(|m| {
            let truth = of.truths[frame.truth_at[m.row as usize] as usize].floor_m?;
            let report = of.reports[frame.track_at[m.col as usize] as usize].floor_m?;
            let truth = real * Point2::from(truth);
            let report = believed * Point2::from(report);
            Some(nalgebra::distance(&truth, &report))
        }));
    }
    errors
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use tagalong_core::EgoMotion;

    use super::*;
    use crate::testing::trial;

    fn judged(judge: Judge, trial: &Trial) -> Judged {
        judge.judge(trial, &trial.runs[0]).unwrap()
    }

    #[test]
    fn places_and_boxes_are_scored() {
        let trial = trial(&[&[(3.0, 0.0, 1.0); 10]], &[(1, &[Some((3.0, 0.1)); 10])]);
        let in_metres = judged(Judge::default(), &trial);
        assert_eq!(in_metres.tally.scores().mota, Some(1.0));
        assert!(in_metres.errors_in_robot_m.iter().all(|e| (e - 0.1).abs() < 1e-12));
        let by_box = judged(Judge { similarity: Similarity::Iou, ..Judge::default() }, &trial);
        assert_eq!(by_box.tally.scores().mota, Some(1.0));
        assert!(by_box.tally.scores().motp.unwrap() < 0.9);
    }

    #[test]
    fn who_is_far_away_counts_neither_way() {
        let far: [_; 10] = [(7.0, 0.0, 1.0); 10];
        let track: [_; 10] = [Some((7.0, 0.0)); 10];
        for tracks in [vec![(1, track.as_slice())], vec![]] {
            let scores = judged(Judge::default(), &trial(&[&far], &tracks)).tally.scores();
            assert_eq!((scores.truths, scores.fp), (0, 0));
        }
    }

    #[test]
    fn drift_shows_in_the_frame_of_the_start_alone() {
        let mut trial = trial(&[&[(3.0, 0.0, 1.0); 10]], &[(1, &[Some((3.0, 0.0)); 10])]);
        for (at, moment) in trial.moments.iter_mut().enumerate() {
            moment.world_from_robot = Isometry2::new(Vector2::new(5.0, at as f64), 0.3);
        }
        let (sin, cos) = 0.3f64.sin_cos();
        for report in &mut trial.runs[0].reports[1..] {
            report.motion =
                EgoMotion { forward: 0.9 * sin, left: 0.9 * cos, ..EgoMotion::at_rest(0.1) };
        }
        let judged = judged(Judge::default(), &trial);
        assert!(judged.errors_in_robot_m.iter().all(|e| *e < 1e-12));
        assert!((judged.errors_in_start_m[9] - 0.9).abs() < 1e-9);
    }
}
