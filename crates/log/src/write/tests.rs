use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::sync::Arc;

use nalgebra::{Isometry2, Point2, Vector2};
use tagalong_core::{Joint, Joints, Stamp, Track, TrackId, WheelSpeeds};

use super::mcap_tracks::McapTracks;
use super::testing::{camera, track};
use super::*;
use crate::msgs::{
    CameraInfo, Detection3DArray, ImageAnnotations, Marker, MarkerArray, PointCloud2, PoseStamped,
    SceneEntityDeletion, SceneUpdate, StringMsg, TFMessage, decode,
};

fn names() -> FrameNames {
    FrameNames { base: "base_link".into(), odom: "odom".into(), camera: "eye".into() }
}

/// Returns the joints of a track, all in one place.
fn joints_of(id: u32) -> (TrackId, Arc<Joints>) {
    let joints = [Joint { at: Point2::new(40.0, 50.0), score: 0.75 }; 17];
    (TrackId(id), Arc::new(Joints::new(joints)))
}

/// Passes a record of frame `index` (ten a second) to `use_it`.
fn with_record<T>(index: u64, tracks: &[Track], use_it: impl FnOnce(&FrameRecord<'_>) -> T) -> T {
    use_it(&FrameRecord {
        index,
        stamp: Stamp::from_nanos(1_700_000_000_000_000_000 + index * 100_000_000),
        camera: &camera(),
        odom_from_robot: &Isometry2::new(Vector2::new(0.1 * index as f64, 0.0), 0.0),
        is_odom_known: true,
        tracks,
        joints: &[],
        target: tracks.first().map(|track| track.id),
        command: Some(WheelSpeeds { left: 0.25, right: 0.5 }),
    })
}

fn log(dir: &Path, frames: u64, finish: bool) {
    let run = RunDir::create(dir, true, Path::new("nowhere.mcap")).unwrap();
    let mut log = TrackLog::create(run, names(), OutputSettings::default(), "seed = 1\n").unwrap();
    let mut tentative = track(13);
    tentative.confirmed = false;
    // Ten times the standard deviation of the other, which is a third of the distance.
    tentative.estimate.covariance *= 100.0;
    for index in 1..=frames {
        with_record(index, &[track(12), tentative.clone()], |r| log.write(r)).unwrap();
    }
    if finish {
        let texts = RunTexts { report: "{}\n", timings: "{}\n", origin: "{}\n" };
        log.finish(BTreeMap::from([("seed".into(), "1".into())]), &texts).unwrap();
    } else {
        std::mem::forget(log);
    }
}

fn read(bytes: &[u8], topic: &str) -> Vec<Vec<u8>> {
    let options = [mcap::read::Options::IgnoreEndMagic];
    mcap::MessageStream::new_with_options(bytes, options.into_iter().collect())
        .unwrap()
        .map_while(Result::ok)
        .filter(|message| message.channel.topic == topic)
        .map(|message| message.data.into_owned())
        .collect()
}

#[test]
fn the_log_carries_tracks_poses_transforms_and_the_config() {
    let home = tempfile::tempdir().unwrap();
    log(home.path(), 3, true);
    let bytes = fs::read(home.path().join("tracks.mcap")).unwrap();
    let arrays = read(&bytes, "/people/tracks");
    assert_eq!(arrays.len(), 3);
    let array: Detection3DArray = decode(&arrays[0]).unwrap();
    assert_eq!(array.header.frame_id, "base_link");
    let [person] = &array.detections[..] else { panic!("tentative tracks are not people") };
    assert_eq!(
        (person.id.as_str(), person.results[0].hypothesis.class_id.as_str()),
        ("12", "person")
    );
    assert_eq!(person.results[0].pose.covariance[1][1], 0.01);
    assert!(person.results[0].pose.covariance[5][5] > 99_999.0, "the heading is unknown");
    let pose: PoseStamped = decode(&read(&bytes, "/people/person_12")[2]).unwrap();
    assert_eq!((pose.header.frame_id.as_str(), pose.pose.position.x), ("odom", 3.3));
    assert_eq!(read(&bytes, "/people/target_pose").len(), 3);
    let tf: TFMessage = decode(&read(&bytes, "/tf")[0]).unwrap();
    let children: Vec<_> = tf.transforms.iter().map(|t| t.child_frame_id.as_str()).collect();
    assert_eq!(children, ["base_link", "eye", "person_12"]);
    let text: StringMsg = decode(&read(&bytes, "/people/tracks_json")[0]).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text.data).unwrap();
    assert_eq!(json["tracks"][1]["confirmed"], false);
    assert_eq!(json["tracks"][0].get("distance_is_guessed"), None);
    assert_eq!(json["tracks"][1]["distance_is_guessed"], true);
    assert_eq!(json["wheel_speeds_mps"], serde_json::json!([0.25, 0.5]));
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.attachment_indexes[0].name, "config.toml");
    assert_eq!(summary.metadata_indexes[0].name, "tagalong");
}

#[test]
fn the_log_carries_what_viewers_draw() {
    let home = tempfile::tempdir().unwrap();
    log(home.path(), 2, true);
    let bytes = fs::read(home.path().join("tracks.mcap")).unwrap();
    let markers: MarkerArray = decode(&read(&bytes, "/people/markers")[1]).unwrap();
    let shapes: Vec<i32> = markers.markers.iter().map(|marker| marker.shape).collect();
    assert_eq!(markers.markers[0].action, Marker::DELETE_ALL);
    let drawn = [Marker::CYLINDER, Marker::TEXT, Marker::ARROW, Marker::LINE_LIST];
    assert_eq!(shapes[1..], drawn);
    assert!(markers.markers[1..].iter().all(|marker| marker.lifetime.sec == 1));
    let body = &markers.markers[1];
    assert_eq!((body.header.frame_id.as_str(), body.id), ("odom", 12));
    // The robot is at 0.2 m, the head 3 m ahead of it and 1.6 m high.
    assert_eq!((body.pose.position.x, body.scale.z), (3.2, 1.715));
    assert_eq!(markers.markers[2].text, "12 3.0 m");
    let tip = markers.markers[3].points[1];
    assert_eq!((tip.x, tip.y), (3.7, 0.25), "where the person is in a second");
    let trail = &markers.markers[4].points;
    assert_eq!(trail.iter().map(|at| at.x).collect::<Vec<_>>(), [3.1, 3.2], "of two frames");
    let scene: SceneUpdate = decode(&read(&bytes, "/people/scene")[1]).unwrap();
    assert_eq!(scene.deletions[0].extent, SceneEntityDeletion::ALL);
    let [person] = &scene.entities[..] else { panic!("tentative tracks are not drawn") };
    assert_eq!((person.id.as_str(), person.texts[0].text.as_str()), ("person_12", "12 3.0 m"));
    assert_eq!((person.cylinders.len(), person.arrows.len()), (1, 1));
    assert_eq!((person.lines.len(), person.lines[0].points.len()), (1, 2));
    let drawn: ImageAnnotations = decode(&read(&bytes, "/people/annotations")[1]).unwrap();
    assert_eq!((drawn.points[0].points.len(), drawn.texts[0].text.as_str()), (4, "12 3.0 m"));
    let bodies = read(&bytes, "/people/person_12/body");
    let [body] = &bodies[..] else { panic!("the transforms move it: it is written once") };
    let body: PointCloud2 = decode(body).unwrap();
    assert_eq!((body.header.frame_id.as_str(), body.width > 100), ("person_12", true));
    let info: CameraInfo = decode(&read(&bytes, "/camera/camera_info")[1]).unwrap();
    assert_eq!((info.header.frame_id.as_str(), info.width, info.k[0]), ("eye", 640, 525.0));
}

#[test]
fn people_of_planners_are_on_the_floor_with_their_velocity_over_ground() {
    let at = Stamp::from_nanos(7);
    let mut tentative = track(13);
    tentative.confirmed = false;
    let record = FrameRecord {
        index: 1,
        stamp: at,
        camera: &camera(),
        // The robot looks along Y.
        odom_from_robot: &Isometry2::new(Vector2::new(1.0, 0.0), std::f64::consts::FRAC_PI_2),
        is_odom_known: true,
        tracks: &[track(12), tentative],
        joints: &[],
        target: None,
        command: None,
    };
    let array = people(&record, "odom");
    assert_eq!((array.header.frame_id.as_str(), array.header.stamp()), ("odom", at));
    let [person] = &array.people[..] else { panic!("tentative tracks are not people") };
    assert_eq!((person.name.as_str(), person.position.z), ("12", 0.0));
    assert!((person.position.x - 0.5).abs() < 1e-9 && (person.position.y - 3.0).abs() < 1e-9);
    assert!((person.velocity.x - 0.25).abs() < 1e-9 && (person.velocity.y - 0.5).abs() < 1e-9);
    assert!((person.reliability - 1.0 / (1.0 + (-2.0_f64).exp())).abs() < 1e-12);
    let frames = person_transforms(&record, "odom").transforms;
    assert_eq!((frames.len(), frames[0].child_frame_id.as_str()), (1, "person_12"));
    assert_eq!(no_markers(at, "odom").markers[0].action, Marker::DELETE_ALL);
}

#[test]
fn images_are_passed_through_as_they_are() {
    let mut log = McapTracks::new(Cursor::new(Vec::new()), names(), "").unwrap();
    log.write_image(Stamp::from_nanos(5), b"jpeg of a frame").unwrap();
    assert_eq!(log.images(), 1);
    log.finish(BTreeMap::new()).unwrap();
}

#[test]
fn joints_are_in_the_log_and_in_a_file_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let run = RunDir::create(dir.path(), true, Path::new("nowhere.mcap")).unwrap();
    let mut log = TrackLog::create(run, names(), OutputSettings::default(), "seed = 1\n").unwrap();
    let joints = [joints_of(12)];
    with_record(1, &[track(12), track(13)], |record| log.write(record)).unwrap();
    with_record(2, &[track(12), track(13)], |record| {
        log.write(&FrameRecord { joints: &joints, ..*record })
    })
    .unwrap();
    let texts = RunTexts { report: "{}", timings: "{}", origin: "{}" };
    log.finish(BTreeMap::new(), &texts).unwrap();
    let table = fs::read_to_string(dir.path().join("joints.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 17, "a header, and one track of one frame");
    assert!(table.contains(",2,12,left_wrist,40.0,50.0,0.750\n"), "{table}");
    let bytes = fs::read(dir.path().join("tracks.mcap")).unwrap();
    let json = read(&bytes, "/people/tracks_json");
    let text = String::from_utf8_lossy(&json[1]).into_owned();
    assert!(text.contains(r#""left_wrist":[40.0,50.0,0.75]"#), "{text}");
    assert!(text.contains(r#""raised_hand":false"#), "{text}");
    assert!(!String::from_utf8_lossy(&json[0]).contains("joints"));
    let drawn = read(&bytes, "/people/annotations");
    // Twelve lines with two ends of two numbers each.
    assert!(
        drawn[1].len() >= drawn[0].len() + 12 * 2 * 16,
        "{} {}",
        drawn[1].len(),
        drawn[0].len()
    );
}

#[test]
fn corrected_ids_are_in_a_file_of_their_own_where_it_is_asked_for() {
    let ids = [false, true].map(|is_wanted| {
        let dir = tempfile::tempdir().unwrap();
        let run = RunDir::create(dir.path(), true, Path::new("nowhere.mcap")).unwrap();
        let log = TrackLog::create(run, names(), OutputSettings::default(), "").unwrap();
        let mut log = if is_wanted { log.with_smoothed() } else { log };
        for index in 1..=3 {
            with_record(index, &[track(12)], |record| log.write(record)).unwrap();
        }
        log.correct(2, 3, [12, 13].map(TrackId));
        let texts = RunTexts { report: "{}", timings: "{}", origin: "{}" };
        log.finish(BTreeMap::new(), &texts).unwrap();
        let files = ["tracks.csv", "tracks-smoothed.csv"].map(|name| dir.path().join(name));
        files.map(|path| fs::read_to_string(path).ok().map(|text| first_cells(&text)))
    });
    let live = Some(vec!["1,12".to_owned(), "2,12".to_owned(), "3,12".to_owned()]);
    let smoothed = Some(vec!["1,12".to_owned(), "2,13".to_owned(), "3,12".to_owned()]);
    assert_eq!(ids, [[live.clone(), None], [live, smoothed]]);
}

/// Returns the frame and the ID of each row.
fn first_cells(table: &str) -> Vec<String> {
    let rows = table.lines().map(|row| row.split(',').take(2).collect::<Vec<_>>().join(","));
    rows.collect()
}

#[test]
fn two_runs_give_the_same_bytes() {
    let a = tempfile::tempdir().unwrap();
    let b = tempfile::tempdir().unwrap();
    log(a.path(), 25, true);
    log(b.path(), 25, true);
    for name in ["tracks.mcap", "tracks.csv", "tracks-metres.csv"] {
        let [a, b] = [&a, &b].map(|home| fs::read(home.path().join(name)).unwrap());
        assert_eq!(a, b, "{name}");
    }
}

#[test]
fn a_killed_run_loses_at_most_a_second() {
    let home = tempfile::tempdir().unwrap();
    log(home.path(), 35, false);
    assert!(!home.path().join("tracks.mcap").exists(), "a final name is a whole file");
    let bytes = fs::read(home.path().join("tracks.mcap.partial")).unwrap();
    let kept = read(&bytes, "/people/tracks").len();
    assert!((26..=35).contains(&kept), "kept {kept} of 35");
    let csv = fs::read_to_string(home.path().join("tracks.csv.partial")).unwrap();
    assert!(csv.lines().count() >= 26 && csv.ends_with('\n'), "{csv}");
}

#[test]
fn a_clock_that_jumps_back_still_flushes() {
    let home = tempfile::tempdir().unwrap();
    let run = RunDir::create(home.path(), false, Path::new("nowhere.mcap")).unwrap();
    let mut log = TrackLog::create(run, names(), OutputSettings::default(), "").unwrap();
    for index in [100, 10, 11, 12] {
        with_record(index, &[track(1)], |r| log.write(r)).unwrap();
    }
    std::mem::forget(log);
    let csv = fs::read_to_string(home.path().join("tracks.csv.partial")).unwrap();
    assert_eq!(csv.lines().count(), 2);
}

/// Disk that is full after `room` bytes.
struct SmallDisk {
    room: usize,
    file: Cursor<Vec<u8>>,
}

impl Write for SmallDisk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.file.position() as usize + bytes.len() > self.room {
            return Err(io::Error::from(io::ErrorKind::StorageFull));
        }
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for SmallDisk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Returns the length of the file, or the error of a full disk.
fn write_to_disk(room: usize) -> mcap::McapResult<usize> {
    let disk = SmallDisk { room, file: Cursor::default() };
    let mut log = McapTracks::new(disk, names(), "seed = 1\n")?;
    for index in 1..=12 {
        with_record(index, &[track(index as u32)], |r| log.write(r))?;
        log.flush()?;
    }
    log.finish(BTreeMap::new())?;
    Ok(0)
}

#[test]
fn a_full_disk_is_an_error_wherever_it_fills() {
    assert!(write_to_disk(1 << 20).is_ok());
    let smallest = (0..1 << 20).step_by(37).find(|room| write_to_disk(*room).is_ok()).unwrap();
    assert!(smallest > 5_000, "the file is longer than {smallest} bytes");
    for room in (0..smallest).step_by(37 * 16) {
        assert!(write_to_disk(room).is_err(), "{room} bytes of room were enough");
    }
}

#[test]
fn people_beyond_the_limit_of_topics_are_still_in_the_list() {
    let mut log = McapTracks::new(Cursor::new(Vec::new()), names(), "").unwrap();
    let many: Vec<Track> = (0..10_010).map(track).collect();
    with_record(1, &many, |r| log.write(r)).unwrap();
    assert_eq!(log.topics(), 10_000);
    log.finish(BTreeMap::new()).unwrap();
}
