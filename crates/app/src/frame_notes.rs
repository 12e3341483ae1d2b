//! Notes of a run on one frame: every candidate with its position and its fate, and the tests that
//! dropped other candidates. A page needs them to explain why a person was missed.

use std::collections::BTreeSet;

use nalgebra::{Isometry2, Point3};
use serde::{Deserialize, Serialize};
use tagalong_core::{Dropped, Funnel, Measured};
use tagalong_geometry::{Camera, Rect};
use tagalong_pipeline::{
    Candidate, Fate, FrameReport, IdentityCorrection, IdentityDoubt, ObstaclePoint,
};

/// Topic of the notes in `tracks.mcap`, one JSON text per frame.
pub const FRAME_NOTES_TOPIC: &str = "/people/frames_json";

/// Notes on one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameNotes {
    /// Index of the frame in the log, from 1.
    pub frame: u64,
    /// Stamp of its image, ns.
    pub stamp_ns: u64,
    /// Columns and rows of the image.
    pub image_px: [usize; 2],
    /// Pose of the robot in the odometry frame: x, y in metres and heading in radians.
    pub robot_odom: [f64; 3],
    /// All detections, each with its fate.
    pub candidates: Vec<CandidateNote>,
    /// Tests that dropped candidates, in the order of the stages.
    pub dropped: Vec<DroppedNote>,
    /// IDs of the tracks that ended in this frame.
    pub ended: Vec<u32>,
    /// Tracks whose ID may be that of another person.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<DoubtNote>,
    /// IDs of earlier frames that this frame shows to be wrong.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corrections: Vec<CorrectionNote>,
    /// State of the target lock and the command, if the pipeline has a controller.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<DriveNote>,
}

/// Track whose ID may be that of another person.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DoubtNote {
    /// ID of the track.
    pub id: u32,
    /// IDs of the other people in question.
    pub others: Vec<u32>,
}

/// Two IDs that were exchanged.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CorrectionNote {
    /// First frame in which they were exchanged.
    pub since: u64,
    /// The two IDs.
    pub ids: [u32; 2],
}

/// State of the target lock, and the command for the wheels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveNote {
    /// Name of the lock's state, for example `locked`.
    pub lock: String,
    /// Meaning of the state, as a sentence.
    pub lock_about: String,
    /// Cause of the last change of state.
    pub why: String,
    /// Time since that change, s.
    pub since_s: f64,
    /// Probability that the followed track is the person.
    pub belief: Option<f64>,
    /// Name of the command's reason, for example `limited`.
    pub reason: String,
    /// Meaning of the reason, as a sentence.
    pub reason_about: String,
    /// The person, the position or the sensor that is the cause, with its distance and the limit;
    /// empty without one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub cause: String,
    /// True if the images are frozen and show an earlier time.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub shows_past: bool,
    /// Commanded speed, m/s.
    pub forward_mps: f64,
    /// Commanded turn rate, positive to the left, rad/s.
    pub turn_rps: f64,
    /// `drives` if the command is that of the controller, otherwise `slower` or `stands`; empty in
    /// runs of earlier versions.
    #[serde(default)]
    pub motion: String,
    /// Positions of fixed obstacles in the odometry frame, cm, alternating x and y.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub things_cm: Vec<i32>,
    /// Positions of people and of moving obstacles in the odometry frame, cm, alternating x and y.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub movers_cm: Vec<i32>,
}

/// Decimals to which a measured value is rounded.
const VALUE_DECIMALS: usize = 4;

/// Side of the grid cells for positions of obstacles, cm.
const CELL_CM: i32 = 10;

/// Detection with its fate.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CandidateNote {
    /// Upper-body square: x, y, width, height, pixels.
    pub box_px: [f64; 4],
    /// Centre of the head in the odometry frame, m.
    pub head_odom_m: [f64; 3],
    /// Log-odds that it is a person, including those of the verifiers.
    pub score: f64,
    /// Plugin that detected it.
    pub source: String,
    /// Its fate.
    pub fate: FateNote,
}

/// Fate of a detection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FateNote {
    /// It was associated with this track.
    Matched(u32),
    /// It started this track.
    Started(u32),
    /// This test dropped it.
    Dropped(String),
}

impl Default for FateNote {
    fn default() -> Self {
        Self::Dropped(String::new())
    }
}

/// Test of the funnel in one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DroppedNote {
    /// Name of the test.
    pub test: String,
    /// Number of candidates, windows or pixels that it dropped.
    pub count: u64,
    /// Boxes of the first of these that have a region in the image, pixels.
    pub boxes_px: Vec<[f64; 4]>,
    /// Values because of which some of these boxes were dropped.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<MeasuredNote>,
}

/// Value because of which a box was dropped.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredNote {
    /// Index of the box in `boxes_px`.
    pub at: usize,
    /// The value and its limits.
    #[serde(flatten)]
    pub value: MeasuredValue,
}

/// Value of a candidate, and the settings that it violates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredValue {
    /// Name of the value.
    pub what: String,
    /// The value.
    pub value: f64,
    /// Settings with their values, beginning with that of the test.
    pub limits: Vec<(String, f64)>,
}

impl MeasuredValue {
    fn of(measured: &Measured) -> Self {
        let limits = measured.limits.iter().map(|(name, limit)| ((*name).to_owned(), *limit));
        Self {
            what: measured.what.to_owned(),
            value: rounded(measured.value, 1e4),
            limits: limits.collect(),
        }
    }

    /// Returns the value compared with its limits, for example `cost 0.47 > refine_cost 0.4`.
    pub fn in_words(&self) -> String {
        let limits: Vec<String> = self
            .limits
            .iter()
            .map(|(setting, limit)| {
                let sign = if self.is_above(*limit) { ">" } else { "<" };
                format!("{sign} {setting} {limit}")
            })
            .collect();
        format!("{} {} {}", self.what, self.shown(), limits.join(" and "))
    }

    /// Returns the value with two decimals, or with as many more as it takes to differ from its
    /// limits; without decimals if it is a count.
    fn shown(&self) -> String {
        if is_whole(self.value) && self.limits.iter().all(|(_, limit)| is_whole(*limit)) {
            return self.value.to_string();
        }
        for decimals in 2..VALUE_DECIMALS {
            let text = format!("{:.decimals$}", self.value);
            if self.limits.iter().all(|(_, limit)| format!("{limit:.decimals$}") != text) {
                return text;
            }
        }
        format!("{:.VALUE_DECIMALS$}", self.value)
    }

    /// Returns true if a limit must rise for the candidate to pass.
    pub fn is_above(&self, limit: f64) -> bool {
        self.value >= limit
    }
}

impl FrameNotes {
    /// Extracts the notes from the report of a frame.
    pub fn of(report: &FrameReport, camera: &Camera, odom_from_robot: &Isometry2<f64>) -> Self {
        let at = odom_from_robot.translation;
        Self {
            frame: report.index,
            stamp_ns: report.stamp.nanos(),
            image_px: [camera.width, camera.height],
            robot_odom: [at.x, at.y, odom_from_robot.rotation.angle()].map(|v| rounded(v, 1e4)),
            candidates: report
                .candidates
                .iter()
                .map(|candidate| CandidateNote::of(candidate, camera, odom_from_robot))
                .collect(),
            dropped: dropped(&report.funnel),
            ended: report.ended.iter().map(|id| id.0).collect(),
            doubts: report.doubts.iter().map(DoubtNote::of).collect(),
            corrections: report.corrections.iter().map(CorrectionNote::of).collect(),
            drive: DriveNote::of(report, odom_from_robot),
        }
    }
}

impl DoubtNote {
    fn of(doubt: &IdentityDoubt) -> Self {
        Self { id: doubt.track.0, others: doubt.others.iter().map(|id| id.0).collect() }
    }
}

impl CorrectionNote {
    fn of(correction: &IdentityCorrection) -> Self {
        Self { since: correction.since, ids: correction.ids.map(|id| id.0) }
    }
}

impl DriveNote {
    fn of(report: &FrameReport, odom_from_robot: &Isometry2<f64>) -> Option<Self> {
        let lock = report.lock.as_ref()?;
        let command = report.command?;
        let twist = command.told_twist();
        Some(Self {
            lock: lock.state.name().to_owned(),
            lock_about: lock.state.about().to_owned(),
            why: lock.why.to_owned(),
            since_s: rounded(lock.since_s, 1e2),
            belief: lock.belief.map(|belief| rounded(belief, 1e3)),
            reason: command.reason.name().to_owned(),
            reason_about: command.about(),
            cause: report.cause.as_ref().map(ToString::to_string).unwrap_or_default(),
            shows_past: report.shows_past(),
            forward_mps: rounded(twist.linear_mps, 1e3),
            turn_rps: rounded(twist.angular_rps, 1e3),
            motion: command.effect().to_owned(),
            things_cm: cells_cm(&report.obstacles, false, odom_from_robot),
            movers_cm: cells_cm(&report.obstacles, true, odom_from_robot),
        })
    }
}

fn is_whole(value: f64) -> bool {
    value.fract() == 0.0
}

/// Returns the centres of the cells with moving or with fixed obstacles, each once.
fn cells_cm(
    obstacles: &[ObstaclePoint],
    moves: bool,
    odom_from_robot: &Isometry2<f64>,
) -> Vec<i32> {
    let mut cells = BTreeSet::new();
    for obstacle in obstacles.iter().filter(|obstacle| obstacle.moves == moves) {
        let at = odom_from_robot * obstacle.at;
        let cell = [at.x, at.y].map(|m| (100.0 * m / f64::from(CELL_CM)).floor() as i32);
        cells.insert(cell);
    }
    cells.into_iter().flatten().map(|cell| cell * CELL_CM + CELL_CM / 2).collect()
}

impl CandidateNote {
    fn of(candidate: &Candidate, camera: &Camera, odom_from_robot: &Isometry2<f64>) -> Self {
        let detection = &candidate.detection;
        let head: Point3<f64> = detection.position;
        let floor = odom_from_robot * head.xy();
        Self {
            box_px: corners(&detection.rect_in(camera)),
            head_odom_m: [floor.x, floor.y, head.z].map(|v| rounded(v, 1e3)),
            score: rounded(detection.score, 1e3),
            source: detection.source.to_owned(),
            fate: match candidate.fate {
                Fate::Matched(id) => FateNote::Matched(id.0),
                Fate::Started(id) => FateNote::Started(id.0),
                Fate::Dropped(test) => FateNote::Dropped(test.to_owned()),
            },
        }
    }
}

fn dropped(funnel: &Funnel) -> Vec<DroppedNote> {
    funnel.entries().iter().map(dropped_note).collect()
}

fn dropped_note(entry: &Dropped) -> DroppedNote {
    let mut boxes_px = Vec::new();
    let mut notes = Vec::new();
    let mut measured = entry.measured.iter().peekable();
    for (at, rect) in entry.places.iter().enumerate() {
        let own = measured.next_if(|(place, _)| *place == at);
        // A region without an area gives no information about the position.
        if rect.area() > 0.0 {
            let at = boxes_px.len();
            boxes_px.push(corners(rect));
            notes.extend(own.map(|(_, own)| MeasuredNote { at, value: MeasuredValue::of(own) }));
        }
    }
    DroppedNote { test: entry.test.to_owned(), count: entry.count, boxes_px, measured: notes }
}

fn corners(rect: &Rect) -> [f64; 4] {
    [rect.x, rect.y, rect.width, rect.height].map(|v| rounded(v, 10.0))
}

/// Rounds to a fraction of one; the result is never a negative zero.
fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts + 0.0
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point2, Vector2};
    use tagalong_core::{Detection, Stamp, TrackId};
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0)
    }

    fn candidate(fate: Fate) -> Candidate {
        let position = Point3::new(2.0, 0.0, 1.6);
        let covariance = Matrix3::identity();
        let source = "eyes";
        Candidate { detection: Detection::new(source, position, covariance, 1.23456), fate }
    }

    #[test]
    fn notes_name_each_fate_and_the_places_of_the_tests() {
        let mut report = FrameReport::new(7, Stamp::from_nanos(9));
        report.candidates =
            vec![candidate(Fate::Matched(TrackId(3))), candidate(Fate::Dropped("verifier"))];
        report.funnel.drop_at("head width", Rect::new(1.04, 2.0, 3.0, 4.0));
        report.funnel.drop_at("head width", Rect::default());
        let measured = Measured { what: "width", value: 0.41, limits: vec![("widest_m", 0.36)] };
        report.funnel.drop_measured("head width", Rect::new(5.0, 2.0, 3.0, 4.0), measured);
        report.funnel.drop_many("score", 5);
        report.ended = vec![TrackId(2)];
        report.doubts = vec![IdentityDoubt { track: TrackId(3), others: vec![TrackId(4)] }];
        report.corrections = vec![IdentityCorrection { since: 5, ids: [TrackId(3), TrackId(4)] }];
        let turned = Isometry2::new(Vector2::new(1.0, 0.0), std::f64::consts::FRAC_PI_2);
        let notes = FrameNotes::of(&report, &camera(), &turned);
        assert_eq!((notes.frame, notes.stamp_ns, notes.image_px), (7, 9, [640, 480]));
        assert_eq!(notes.candidates[0].fate, FateNote::Matched(3));
        assert_eq!(notes.candidates[1].fate, FateNote::Dropped("verifier".into()));
        assert_eq!(notes.candidates[0].head_odom_m, [1.0, 2.0, 1.6], "turned left, then moved");
        assert_eq!(notes.candidates[0].score, 1.235);
        assert!(notes.candidates[0].box_px[2] > 10.0, "without a box the place is projected");
        assert_eq!(notes.dropped[0].count, 3);
        assert_eq!(notes.dropped[0].boxes_px, [[1.0, 2.0, 3.0, 4.0], [5.0, 2.0, 3.0, 4.0]]);
        let [measured] = &notes.dropped[0].measured[..] else { panic!("{notes:?}") };
        assert_eq!(
            (measured.at, measured.value.in_words().as_str()),
            (1, "width 0.41 > widest_m 0.36")
        );
        assert_eq!((notes.dropped[1].count, notes.dropped[1].boxes_px.len()), (5, 0));
        assert_eq!(notes.ended, [2]);
        assert_eq!(notes.doubts, [DoubtNote { id: 3, others: vec![4] }]);
        assert_eq!(notes.corrections, [CorrectionNote { since: 5, ids: [3, 4] }]);
    }

    #[test]
    fn a_value_is_written_so_that_it_differs_from_its_limit() {
        for (what, value, setting, limit, words) in [
            ("cost", 0.4712, "refine_cost", 0.4, "cost 0.47 > refine_cost 0.4"),
            ("cost", 0.3012, "discover_cost", 0.3, "cost 0.301 > discover_cost 0.3"),
            ("width", 0.0898, "min_width_m", 0.09, "width 0.0898 < min_width_m 0.09"),
            ("cells", 1.0, "min_cells", 2.0, "cells 1 < min_cells 2"),
            ("body", 0.0, "min_body", 0.5, "body 0.00 < min_body 0.5"),
        ] {
            let limits = vec![(setting.to_owned(), limit)];
            let told = MeasuredValue { what: what.to_owned(), value, limits };
            assert_eq!(told.in_words(), words);
        }
    }

    #[test]
    fn obstacles_are_noted_by_cell_in_the_odometry_frame() {
        fn point(x: f64, moves: bool) -> ObstaclePoint {
            ObstaclePoint { at: Point2::new(x, 0.02), moves }
        }

        let obstacles = [point(1.01, false), point(1.06, false), point(2.0, true)];
        let turned = Isometry2::new(Vector2::new(1.0, 0.0), std::f64::consts::FRAC_PI_2);
        assert_eq!(cells_cm(&obstacles, false, &turned), [95, 105], "two readings of one cell");
        assert_eq!(cells_cm(&obstacles, true, &turned), [95, 205]);
    }

    #[test]
    fn notes_survive_their_text() {
        let mut report = FrameReport::new(1, Stamp::from_nanos(1));
        report.candidates = vec![candidate(Fate::Started(TrackId(1)))];
        let notes = FrameNotes::of(&report, &camera(), &Isometry2::identity());
        let text = serde_json::to_string(&notes).unwrap();
        assert!(text.contains(r#""fate":{"started":1}"#), "{text}");
        assert_eq!(serde_json::from_str::<FrameNotes>(&text).unwrap(), notes);
    }
}
