//! Data of one frame from a moment.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry2, Point2, Point3};
use tagalong_app::frame_notes::{CandidateNote, DriveNote, FateNote, FrameNotes};
use tagalong_app::missed::is_telling;
use tagalong_app::remedies::Remedies;
use tagalong_geometry::{Camera, Rect};
use toml::Table;

use crate::page::data::{CandidateData, DriveData, DroppedData, FrameData, TestData, TrackData};
use crate::page::moment::{Moment, TrackState};

/// Largest number of points of a laser scan.
const SCAN_POINTS: usize = 240;

/// Returns all tests that dropped candidates, with the settings that decide them.
pub fn tests<'a>(
    notes: impl Iterator<Item = &'a FrameNotes>,
    config: &Table,
    remedies: &Remedies,
) -> BTreeMap<String, TestData> {
    let names: BTreeSet<&str> = notes.flat_map(dropping_tests).collect();
    let mut tests = BTreeMap::new();
    for name in names {
        let remedy = remedies.of_config(name, config);
        let settings = remedy.map_or_else(Vec::new, |remedy| remedy.lines(config));
        let why = remedies.sentence(name, config);
        // The page only compares stages.
        let stage = if is_telling(name) { 1 + remedies.stage(name, config) } else { 0 };
        tests.insert(name.to_owned(), TestData { settings, why, stage });
    }
    tests
}

fn dropping_tests(notes: &FrameNotes) -> impl Iterator<Item = &str> {
    let of_funnel = notes.dropped.iter().map(|dropped| dropped.test.as_str());
    of_funnel.chain(notes.candidates.iter().filter_map(dropping_test))
}

fn dropping_test(candidate: &CandidateNote) -> Option<&str> {
    match &candidate.fate {
        FateNote::Dropped(test) => Some(test),
        _ => None,
    }
}

/// Returns the data of a frame, without trails.
pub fn frame_data(moment: &Moment) -> FrameData {
    let notes = &moment.notes;
    FrameData {
        n: notes.frame,
        robot: notes.robot_odom,
        stale: notes.drive.as_ref().is_some_and(|drive| drive.shows_past),
        tracks: moment.tracks.iter().map(|track| track_data(track, notes.robot_odom[2])).collect(),
        found: notes.candidates.iter().map(candidate_data).collect(),
        dropped: dropped_data(notes),
        target: moment.target,
        drive: notes.drive.as_ref().map(drive_data),
    }
}

fn track_data(track: &TrackState, heading: f64) -> TrackData {
    let (sin, cos) = heading.sin_cos();
    let [forward, left] = track.velocity_robot_mps;
    let [x, y, z] = track.head_odom_m;
    TrackData {
        id: track.id,
        state: match (track.confirmed, track.seen, track.occluded) {
            (false, _, _) => "tentative",
            (true, true, _) => "seen",
            (true, false, true) => "hidden",
            (true, false, false) => "predicted",
        },
        box_px: track.upper_body_px.map(|v| rounded(v, 10.0)),
        at: [x, y].map(|v| rounded(v, 1e3)),
        v: [cos * forward - sin * left, sin * forward + cos * left].map(|v| rounded(v, 1e2)),
        z: rounded(z, 1e2),
        d: rounded(track.head_robot_m[0].hypot(track.head_robot_m[1]), 1e2),
        guess: track.distance_is_guessed,
        p: rounded(track.probability, 1e2),
        whole: None,
        trail: Vec::new(),
    }
}

fn candidate_data(note: &CandidateNote) -> CandidateData {
    let [x, y, _] = note.head_odom_m;
    let (track, starts) = match note.fate {
        FateNote::Matched(id) => (Some(id), false),
        FateNote::Started(id) => (Some(id), true),
        FateNote::Dropped(_) => (None, false),
    };
    CandidateData {
        box_px: note.box_px,
        at: [x, y],
        score: rounded(note.score, 1e2),
        by: note.source.clone(),
        test: dropping_test(note).map(str::to_owned),
        track,
        starts,
    }
}

/// Returns the funnel without the regions of candidates, because the data of the candidates have
/// more detail.
fn dropped_data(notes: &FrameNotes) -> Vec<DroppedData> {
    let of_candidates: BTreeSet<&str> = notes.candidates.iter().filter_map(dropping_test).collect();
    notes
        .dropped
        .iter()
        .map(|dropped| {
            let mut data = DroppedData {
                test: dropped.test.clone(),
                n: dropped.count,
                ..DroppedData::default()
            };
            if !of_candidates.contains(dropped.test.as_str()) {
                data.boxes.clone_from(&dropped.boxes_px);
                data.values = dropped.measured.iter().map(|m| (m.at, m.value.in_words())).collect();
            }
            data
        })
        .collect()
}

fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts + 0.0
}

fn drive_data(note: &DriveNote) -> DriveData {
    DriveData {
        lock: [note.lock.clone(), note.lock_about.clone()],
        why: note.why.clone(),
        since: note.since_s,
        belief: note.belief,
        reason: [note.reason.clone(), note.reason_about.clone()],
        cause: note.cause.clone(),
        v: note.forward_mps,
        w: note.turn_rps,
        motion: note.motion.clone(),
        things: note.things_cm.clone(),
        movers: note.movers_cm.clone(),
    }
}

/// Adds the boxes of whole people to a frame.
pub fn add_whole_people(frame: &mut FrameData, camera: &Camera, odom_from_robot: &Isometry2<f64>) {
    for track in &mut frame.tracks {
        let floor = odom_from_robot.inverse_transform_point(&Point2::from(track.at));
        let [x, y, width, height] = track.box_px;
        let head = Point3::new(floor.x, floor.y, track.z);
        let whole = camera.whole_body(&Rect::new(x, y, width, height), &head);
        let sides = [whole.x, whole.y, whole.width, whole.height];
        track.whole = Some(sides.map(|v| rounded(v, 10.0)));
    }
}

/// Returns evenly chosen points of a scan in the odometry frame, cm.
pub fn scan_points(points: &[Point3<f64>], odom_from_robot: &Isometry2<f64>) -> Vec<i32> {
    let every = points.len().div_ceil(SCAN_POINTS).max(1);
    let chosen = points.iter().step_by(every).map(|point| odom_from_robot * point.xy());
    chosen.flat_map(|point| [point.x, point.y].map(|v| (100.0 * v).round() as i32)).collect()
}

/// Returns the directions of the left and right edge of the image, from the robot's heading.
pub fn view_edges(camera: &Camera) -> [f64; 2] {
    let middle = 0.5 * camera.height as f64;
    [0.0, camera.width as f64 - 1.0].map(|column| {
        let ray = camera.robot_from_camera.rotation * camera.ray(Point2::new(column, middle));
        let angle = ray.y.atan2(ray.x);
        (angle * 1e4).round() / 1e4
    })
}

/// Projects the past heads of the tracks of a frame into its image.
pub fn add_trails(
    past: &[&FrameData],
    frame: &mut FrameData,
    camera: &Camera,
    odom_from_robot: &Isometry2<f64>,
) {
    for track in frame.tracks.iter_mut().filter(|track| track.state == "seen") {
        let heads = past.iter().filter_map(|frame| frame.tracks.iter().find(|t| t.id == track.id));
        // A trail has no predicted positions, where the person may never have been.
        let heads = heads.filter(|t| t.state == "seen");
        let heads = heads.map(|t| {
            let floor = odom_from_robot.inverse_transform_point(&Point2::from(t.at));
            Point3::new(floor.x, floor.y, t.z)
        });
        let pixels = heads.filter_map(|head| camera.project(&head));
        track.trail = pixels.flat_map(|p| [p.x, p.y].map(|v| v.round() as i32)).collect();
    }
}

#[cfg(test)]
mod tests_of_data {
    use nalgebra::Vector2;
    use tagalong_app::frame_notes::{DroppedNote, MeasuredNote, MeasuredValue};
    use tagalong_config::{Registry, Remedy};
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.6, 0.0, 0.0)
    }

    #[test]
    fn a_test_comes_with_the_setting_that_decides_it() {
        let mut moment = Moment::default();
        moment.notes.dropped =
            vec![DroppedNote { test: "head width".into(), count: 3, ..DroppedNote::default() }];
        let config = toml::from_str(
            "[[detectors]]\nplugin = 'd'\n[detectors.config]\nmin_head_width_m = 0.1\n",
        )
        .unwrap();
        let mut registry = Registry::default();
        registry.remedies(
            "d",
            &[Remedy { test: "head width", settings: &["min_head_width_m"], look: "hats" }],
        );
        let tests = tests([&moment.notes].into_iter(), &config, &Remedies::new(&registry));
        let lines = &tests["head width"].settings;
        assert!(lines.iter().any(|line| line.contains("min_head_width_m = 0.1")), "{lines:?}");
        assert!(
            tests["head width"].why.ends_with("min_head_width_m = 0.1 (d): hats"),
            "{:?}",
            tests["head width"]
        );
    }

    #[test]
    fn velocities_are_turned_into_the_odometry_frame() {
        let track = TrackState {
            confirmed: true,
            velocity_robot_mps: [1.0, 0.0],
            head_robot_m: [3.0, 4.0, 1.6],
            distance_is_guessed: true,
            ..TrackState::default()
        };
        let data = track_data(&track, std::f64::consts::FRAC_PI_2);
        assert_eq!((data.v, data.d, data.state), ([0.0, 1.0], 5.0, "predicted"));
        assert!(data.guess);
    }

    #[test]
    fn a_frame_of_a_frozen_camera_is_stale() {
        let mut moment = Moment::default();
        for (shows_past, text) in [(true, Some(true)), (false, None)] {
            moment.notes.drive = Some(DriveNote { shows_past, ..DriveNote::default() });
            let data = serde_json::to_value(frame_data(&moment)).unwrap();
            assert_eq!(data.get("stale").map(|stale| stale == true), text);
        }
    }

    #[test]
    fn places_of_candidates_are_not_shown_twice() {
        fn note(test: &str) -> DroppedNote {
            let limits = vec![("most".to_owned(), 0.4)];
            let value = MeasuredValue { what: "cost".into(), value: 0.5, limits };
            DroppedNote {
                test: test.into(),
                count: 1,
                boxes_px: vec![[1.0, 2.0, 3.0, 4.0]],
                measured: vec![MeasuredNote { at: 0, value }],
            }
        }

        let mut notes = FrameNotes::default();
        let fate = FateNote::Dropped("verifier".into());
        notes.candidates = vec![CandidateNote { fate, ..CandidateNote::default() }];
        notes.dropped = vec![note("verifier"), note("head width")];
        let [verifier, width] = &dropped_data(&notes)[..] else { panic!("{notes:?}") };
        assert!(verifier.boxes.is_empty() && verifier.values.is_empty());
        assert_eq!((width.boxes.len(), width.values[&0].as_str()), (1, "cost 0.50 > most 0.4"));
    }

    #[test]
    fn the_edges_of_the_view_are_left_and_right() {
        let [left, right] = view_edges(&camera());
        assert!((left - 0.5686).abs() < 0.01 && (right + 0.5686).abs() < 0.01, "{left} {right}");
    }

    #[test]
    fn scans_are_thinned_and_moved_into_the_odometry_frame() {
        let points: Vec<Point3<f64>> =
            (0..1000).map(|i| Point3::new(f64::from(i), 0.0, 0.2)).collect();
        let turned = Isometry2::new(Vector2::new(1.0, 0.0), std::f64::consts::FRAC_PI_2);
        let shown = scan_points(&points, &turned);
        assert!(shown.len() <= 2 * SCAN_POINTS, "{}", shown.len());
        assert_eq!(shown[..4], [100, 0, 100, 500]);
    }
}
