//! `tagalong simulate`: the logs it writes, and its answers to wrong scenes.

use std::fs;
use std::path::{Path, PathBuf};

use tagalong_geometry::ConicalMirror;
use tagalong_log::camera_info::CONICAL_MIRROR;
use tagalong_log::msgs::{CameraInfo, PoseStamped, TFMessage, decode};
use tagalong_log::{Limits, read_truth};
use tagalong_sim::Scene;

use crate::common::{code, messages_of, tagalong, text};

const SMALL: &str = "duration_s = 0.6\n[camera]\nwidth = 64\nheight = 48\n[faults]\ndropped = 0.0\n\
    [[people]]\npath = [[4.0, 3.0], [4.0, 5.0]]\n";

fn simulate(folder: &Path, arguments: &[&str]) -> std::process::Output {
    let mut command = tagalong();
    command.current_dir(folder).arg("simulate").args(arguments).output().unwrap()
}

/// Renders the scene `s.toml`, and returns the bytes of the log.
fn log_of(folder: &Path, name: &str, more: &[&str]) -> Vec<u8> {
    let output = simulate(folder, &[&["s.toml", "-o", name], more].concat());
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    fs::read(folder.join(name)).unwrap()
}

#[test]
fn the_same_scene_and_seed_are_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), SMALL).unwrap();
    let first = log_of(folder.path(), "a.mcap", &["--threads", "1"]);
    assert_eq!(first, log_of(folder.path(), "b.mcap", &["--threads", "3"]));
    assert_ne!(first, log_of(folder.path(), "c.mcap", &["--seed", "9"]));
    let truth = read_truth(&folder.path().join("a.mcap"), &Limits::default()).unwrap().unwrap();
    let person = &truth[0].people[0];
    assert_eq!((truth.len(), truth[0].people.len(), person.id), (6, 1, 1));
    let joints = &person.joints;
    let head = person.head_in_robot_m.unwrap();
    assert_eq!(joints.len(), 12);
    for [low, high] in [["left_ankle", "left_knee"], ["left_hip", "left_shoulder"]] {
        assert!(joints[low].in_robot_m[2] < joints[high].in_robot_m[2], "{low} below {high}");
    }
    let shoulder = &joints["right_shoulder"];
    assert!(shoulder.in_robot_m[2] < head[2] && shoulder.px.is_some());
    let inspected = tagalong().arg("inspect").arg(folder.path().join("a.mcap")).output().unwrap();
    let told = text(&inspected.stdout);
    assert!(told.contains("a pipeline can use: colour, depth, odometry"), "{told}");
}

#[test]
fn pictures_show_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), SMALL).unwrap();
    let output = simulate(folder.path(), &["s.toml", "--gallery", "pictures"]);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let pictures = fs::read_dir(folder.path().join("pictures")).unwrap().count();
    assert!((3..=6).contains(&pictures), "{pictures}");
}

#[test]
fn a_wrong_scene_is_told_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), "seed = 1\n[room]\nheigth_m = 3.0\n").unwrap();
    let told = messages_of(&simulate(folder.path(), &["s.toml"]), 2);
    assert!(told.contains("s.toml:3:1") && told.contains("did you mean `height_m`?"), "{told}");
    assert_eq!(code(&simulate(folder.path(), &["absent.toml"])), 2);
}

#[test]
fn a_split_and_settings_choose_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let varied = format!("{SMALL}[vary]\nlight.lux = {{ between = [50.0, 900.0] }}\n");
    fs::write(folder.path().join("s.toml"), varied).unwrap();
    let test = log_of(folder.path(), "a.mcap", &["--split", "test", "--seed", "1"]);
    assert_eq!(test, log_of(folder.path(), "b.mcap", &["--seed", "2000000001"]));
    assert_ne!(test, log_of(folder.path(), "c.mcap", &["--split", "train", "--seed", "1"]));
    log_of(
        folder.path(),
        "d.mcap",
        &["--set", "camera.kind=stereo", "--set", "people.0.speed_mps=0.5"],
    );
    let inspected = tagalong().arg("inspect").arg(folder.path().join("d.mcap")).output().unwrap();
    assert!(text(&inspected.stdout).contains("/camera/right/image_rect"));
    for (wrong, told) in [
        (["--set", "camera.knd=stereo"], "camera.knd=stereo: unknown field `knd`"),
        (["--set", "crowd"], "write KEY=VALUE"),
        (["--split", "tests"], "did you mean `test`?"),
    ] {
        let said = messages_of(&simulate(folder.path(), &[&["s.toml"][..], &wrong].concat()), 2);
        assert!(said.contains(told), "{said}");
    }
}

#[test]
fn every_shipped_scene_can_be_read_and_says_what_it_is_for() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../configs/scenes");
    let mut scenes = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        let scene = Scene::parse(&text).map_err(|error| error.render("scene", &text));
        assert!(!scene.unwrap().about.is_empty(), "{}", path.display());
        scenes += 1;
    }
    assert!(scenes >= 10);
}

const OMNI: &str = "duration_s = 0.6\n[camera]\nkind = \"panorama\"\nwidth = 96\nheight = 96\n\
    rate_hz = 5.0\nheight_m = 1.55\n[camera.mirror]\nangle_error_deg = 0.0\n\
    [faults]\ndropped = 0.0\nlate = 0.0\n[robot]\nstart = [4.0, 3.0]\n[[people]]\npath = [[2.0, 3.0]]\nextras = [\"green-hat\"]\n\
    [[webcams]]\nat = [0.2, 0.3]\nwidth = 32\nheight = 24\n[[webcams]]\nwidth = 32\nheight = 24\n";

/// The first message of a topic.
fn first(log: &[u8], topic: &str) -> Vec<u8> {
    let messages = mcap::MessageStream::new(log).unwrap();
    let found = messages.map(Result::unwrap).find(|message| message.channel.topic == topic);
    found.unwrap_or_else(|| panic!("{topic} is not in the log")).data.into_owned()
}

#[test]
fn a_mirror_and_webcams_are_in_the_log_as_they_are_described() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), OMNI).unwrap();
    let output = simulate(folder.path(), &["s.toml", "-o", "a.mcap"]);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let path = folder.path().join("a.mcap");
    let log = fs::read(&path).unwrap();

    let info: CameraInfo = decode(&first(&log, "/camera/color/camera_info")).unwrap();
    assert_eq!(info.distortion_model, CONICAL_MIRROR);
    let shape: [f64; 4] = info.d[..].try_into().unwrap();
    assert!(ConicalMirror::new(info.k[0], [info.k[2], info.k[5]], shape).is_some());
    assert!((shape[0] - 67.5_f64.to_radians()).abs() < 1e-9);

    let mounts = first(&log, "/truth/tf_static");
    let mounts: TFMessage = decode(&mounts).unwrap();
    let place = mounts.transforms[0].transform.translation;
    assert_eq!((mounts.transforms.len(), place.x, place.y, place.z), (2, 0.2, 0.3, 2.2));
    let robot = first(&log, "/truth/robot");
    let robot: PoseStamped = decode(&robot).unwrap();
    assert_eq!((robot.pose.position.x, robot.pose.position.y), (4.0, 3.0));
    let webcam: CameraInfo = decode(&first(&log, "/webcam_2/camera_info")).unwrap();
    assert_eq!((webcam.width, webcam.header.frame_id.as_str()), (32, "webcam_2_optical_frame"));
    assert!(!first(&log, "/webcam_1/image_raw/compressed").is_empty());

    let truth = read_truth(&path, &Limits::default()).unwrap().unwrap();
    let [x, _, width, _] = truth[0].people[0].upper_body_px.unwrap();
    let shoulder = &truth[0].people[0].joints["left_shoulder"];
    assert!(x < 480.0 && x + width > 475.0, "behind the robot: {x} {width}");
    // The square goes on beyond the seam, a pixel does not.
    let beyond = shoulder.px.unwrap()[0] + 480.0;
    assert!(shoulder.in_sight && (480.0..x + width).contains(&beyond), "{beyond} {x} {width}");
}

#[test]
fn pictures_of_a_mirror_show_the_panorama_and_the_webcams() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), OMNI).unwrap();
    let output = simulate(folder.path(), &["s.toml", "--gallery", "pictures"]);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let sizes = fs::read_dir(folder.path().join("pictures")).unwrap().map(|entry| {
        let path = entry.unwrap().path();
        let reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).unwrap()));
        let info = reader.read_info().unwrap();
        (info.info().width, info.info().height)
    });
    let mut sizes: Vec<_> = sizes.collect();
    sizes.sort_unstable();
    sizes.dedup();
    assert_eq!(sizes, [(64, 24), (480 + 96, 120)]);
}
