//! The doctor finds the problems of logs that were broken on purpose, and has no complaints about
//! good ones.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use serde_json::Value;
use tagalong_log::msgs::{CameraInfo, TFMessage};
use tempfile::TempDir;

use crate::common::broken::{self, Changes, reading};
use crate::common::{code, tagalong, text};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A good log: the first seconds of the sample scene.
fn good() -> &'static Path {
    static HOME: OnceLock<TempDir> = OnceLock::new();
    static LOG: OnceLock<PathBuf> = OnceLock::new();
    LOG.get_or_init(|| {
        let path = HOME.get_or_init(|| tempfile::tempdir().unwrap()).path().join("good.mcap");
        let scene = root().join("configs/scenes/sample.toml");
        let simulate = ["simulate", scene.to_str().unwrap(), "--set", "duration_s=3.2", "-o"];
        let drawn = tagalong().args(simulate).arg(&path).output().unwrap();
        assert_eq!(code(&drawn), 0, "{}", text(&drawn.stderr));
        path
    })
}

/// The exit code, and the diagnosis.
fn doctor(config: &Path, log: &Path, extra: &[&str]) -> (i32, Value) {
    let mut command = tagalong();
    command.arg("doctor").arg(config).arg(log).args(["--format", "json"]).args(extra);
    let output = command.output().unwrap();
    let said = serde_json::from_slice(&output.stdout);
    (code(&output), said.unwrap_or_else(|_| panic!("{}", text(&output.stderr))))
}

fn config() -> PathBuf {
    root().join("configs/depth-ekf.toml")
}

fn finding<'a>(said: &'a Value, id: &str) -> &'a Value {
    let findings = said["findings"].as_array().unwrap();
    findings.iter().find(|f| f["id"] == id).unwrap_or_else(|| panic!("no {id} in {said:#}"))
}

/// Findings that are worse than unknown.
fn complaints(said: &Value) -> Vec<&str> {
    let findings = said["findings"].as_array().unwrap().iter();
    let worse = findings.filter(|f| f["severity"] == "warn" || f["severity"] == "bad");
    worse.map(|f| f["id"].as_str().unwrap()).collect()
}

/// A log broken in one way, and the expected finding with a part of its remedy.
struct Case {
    name: &'static str,
    changes: Changes,
    /// Finding and severity: `depth: bad`.
    finding: &'static str,
    remedy: &'static str,
}

fn shifted(dx: i64, dy: i64) -> Changes {
    Changes {
        depth: Some(Box::new(move |all, width, x, y| reading(all, width, x - dx, y - dy))),
        ..Changes::default()
    }
}

fn scaled(factor: f64) -> Changes {
    Changes {
        depth: Some(Box::new(move |all, width, x, y| {
            (f64::from(reading(all, width, x, y)) * factor).round() as u16
        })),
        ..Changes::default()
    }
}

fn with_info(info: fn(&mut CameraInfo)) -> Changes {
    Changes { info: Some(info), ..Changes::default() }
}

fn with_tf(tf: fn(&mut TFMessage)) -> Changes {
    Changes { tf: Some(tf), ..Changes::default() }
}

fn grey(level: u8) -> Changes {
    Changes { grey_level: Some(level), ..Changes::default() }
}

fn with_stamp(stamp: fn(u64) -> u64) -> Changes {
    Changes { stamp: Some(stamp), ..Changes::default() }
}

fn with_depth_stamp(depth_stamp: fn(u64, u64) -> u64) -> Changes {
    Changes { depth_stamp: Some(depth_stamp), ..Changes::default() }
}

fn thinned(topic: &'static str, interval: u64) -> Changes {
    Changes { thinned: Some((topic, interval)), ..Changes::default() }
}

fn without(topics: &'static [&'static str]) -> Changes {
    Changes { without: topics, ..Changes::default() }
}

/// Turns every transform by an angle about an axis of the child.
fn turned(tf: &mut TFMessage, axis: usize, degrees: f64) {
    for transform in &mut tf.transforms {
        let pose = transform.transform.isometry().unwrap();
        let mut turn = nalgebra::Vector3::zeros();
        turn[axis] = degrees.to_radians();
        let turned = pose * nalgebra::UnitQuaternion::from_scaled_axis(turn);
        transform.transform = (&turned).into();
    }
}

/// Takes all numbers of a calibration away: K alone would be replaced by P.
fn uncalibrated(info: &mut CameraInfo) {
    info.k = [0.0; 9];
    info.p = [0.0; 12];
}

/// Moves the camera up by half a metre.
fn raise(tf: &mut TFMessage) {
    tf.transforms.iter_mut().for_each(|t| t.transform.translation.z += 0.5);
}

fn case(name: &'static str, changes: Changes, finding: &'static str, remedy: &'static str) -> Case {
    Case { name, changes, finding, remedy }
}

fn cases() -> Vec<Case> {
    vec![
        case("depth beside colour", shifted(-7, 2), "registration: bad", "depth_offset_px = ["),
        case("tenths of millimetres", scaled(10.0), "depth: bad", "depth_unit_m = 0.0001"),
        case("centimetres", scaled(0.1), "depth: bad", "depth_unit_m = 0.01"),
        case("half of the unit", scaled(0.5), "mount: bad", "depth_unit_m"),
        case("no readings", scaled(0.0), "depth: bad", "depth_topic"),
        case(
            "the calibration of half the size",
            with_info(|info| [0, 2, 4, 5].iter().for_each(|at: &usize| info.k[*at] *= 0.5)),
            "intrinsics: bad",
            "colour_info_topic",
        ),
        case(
            "the calibration of another size",
            with_info(|info| (info.width, info.height) = (640, 480)),
            "intrinsics: bad",
            "colour_info_topic",
        ),
        case("uncalibrated", with_info(uncalibrated), "intrinsics: bad", "REP 104"),
        case("tilted", with_tf(|tf| turned(tf, 0, 8.0)), "mount: bad", "pitch_down_deg"),
        case("rolled", with_tf(|tf| turned(tf, 2, 5.0)), "mount: warn", "roll_deg"),
        case("too high", with_tf(raise), "mount: bad", "height_m"),
        case("a body frame", with_tf(|tf| turned(tf, 0, 90.0)), "frames: bad", "[input.camera]"),
        case(
            "another robot frame",
            with_tf(|tf| tf.transforms.iter_mut().for_each(|t| t.header.frame_id = "base".into())),
            "frames: warn",
            "base_frame = \"base\"",
        ),
        case(
            "no transform to the camera",
            with_tf(|tf| tf.transforms.iter_mut().for_each(|t| t.child_frame_id = "laser".into())),
            "frames: warn",
            "[input.camera]",
        ),
        case("black", grey(3), "exposure: bad", "longer"),
        case("white", grey(255), "exposure: bad", "shorter"),
        case("late depth", with_depth_stamp(|_, at| at + 28_000_000), "skew: warn", "capture"),
        case(
            "a clock ahead",
            with_depth_stamp(|_, at| at + 300_000_000),
            "skew: bad",
            "stamps = \"recording\"",
        ),
        case("a lens that is assumed", without(&["camera_info"]), "mount: unknown", ""),
        case("a view that is assumed", without(&["camera_info"]), "heads: unknown", ""),
        case("two thirds of depth lost", thinned("aligned_depth", 3), "skew: ok", ""),
        case(
            "another clock",
            with_depth_stamp(|_, at| at + 600_000_000_000),
            "skew: bad",
            "stamps = \"recording\"",
        ),
        case(
            "a clock that jumps back",
            with_stamp(|at| if at > MIDDLE_NS { at - 5_000_000_000 } else { at }),
            "stamps: bad",
            "use_sim_time",
        ),
        case("stamps never set", with_stamp(|_| FIRST_NS), "stamps: warn", "header.stamp"),
        case(
            "a pause",
            with_stamp(|at| if at > MIDDLE_NS { at + 3_000_000_000 } else { at }),
            "stamps: warn",
            "reset_gap_s",
        ),
        case("one image a second", thinned("/camera/", 10), "rate: warn", "record 5 a second"),
        case("no depth", without(&["depth"]), "needs: bad", "depth_topic"),
        case(
            "no calibration",
            without(&["camera_info"]),
            "needs: bad",
            "record its topic with the images",
        ),
    ]
}

const FIRST_NS: u64 = crate::common::FIRST_NS;
const MIDDLE_NS: u64 = FIRST_NS + 1_200_000_000;

#[test]
fn what_was_broken_is_found() {
    let home = tempfile::tempdir().unwrap();
    let log = home.path().join("broken.mcap");
    let mut missed = Vec::new();
    for Case { name, changes, finding: expected, remedy } in cases() {
        broken::write(good(), &log, &changes);
        let (code, said) = doctor(&config(), &log, &["--frames", "24", "--settings", "never"]);
        let (id, severity) = expected.split_once(": ").unwrap();
        let found = finding(&said, id);
        let told = found["remedy"].as_str().unwrap_or_default();
        if found["severity"] != severity || !told.contains(remedy) {
            missed.push(format!("{name}: not `{severity}` with `{remedy}`, but {found:#}"));
        }
        let is_bad = said["findings"].as_array().unwrap().iter().any(|f| f["severity"] == "bad");
        assert_eq!(code, if is_bad { 3 } else { 0 }, "{name}");
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Of outlines and shapes that depth does not show, nothing is concluded where depth itself is in doubt.
#[test]
fn from_depth_in_doubt_nothing_is_concluded() {
    let home = tempfile::tempdir().unwrap();
    let log = home.path().join("doubtful.mcap");
    let other_clock = with_depth_stamp(|_, at| at + 600_000_000_000);
    let mono = root().join("configs/mono.toml");
    for (changes, config, ids, why) in [
        (scaled(10.0), config(), &["missed"][..], "the unit of depth is in doubt"),
        (scaled(0.0), config(), &["registration"], "depth has no reading"),
        (other_clock, mono, &["registration"], "the depth is not used"),
    ] {
        broken::write(good(), &log, &changes);
        let (_, said) = doctor(&config, &log, &["--frames", "24", "--settings", "never"]);
        for id in ids {
            let measured = finding(&said, id)["measured"].as_str().unwrap();
            assert_eq!(measured, format!("not known: {why}"), "{id}");
        }
    }
}

#[test]
fn a_good_log_is_let_go() {
    let (code, said) = doctor(&config(), good(), &[]);
    assert_eq!((code, complaints(&said)), (0, Vec::new()), "{said:#}");
    // Of topics that are not used, nothing is said.
    let skipped = finding(&said, "skipped");
    assert_eq!(skipped["measured"], "no message of the topics used was left out");
    let output = tagalong().arg("doctor").arg(config()).arg(good()).output().unwrap();
    let printed = text(&output.stdout);
    assert!(printed.contains("no problem found"), "{printed}");
    for found in said["findings"].as_array().unwrap() {
        let id = found["id"].as_str().unwrap();
        let measured = found["measured"].as_str().unwrap();
        assert!(printed.contains(id) && printed.contains(measured), "{id} is not printed");
    }
}

/// The remedy is a line of the config; with it the finding disappears.
#[test]
fn the_remedy_for_shifted_depth_cures_it() {
    let home = tempfile::tempdir().unwrap();
    let log = home.path().join("shifted.mcap");
    let cured = home.path().join("cured.toml");
    broken::write(good(), &log, &shifted(6, -5));
    let (_, said) = doctor(&config(), &log, &[]);
    let figures = &finding(&said, "registration")["figures"];
    for (name, offset_px) in [("offset_x_px", -6.0), ("offset_y_px", 5.0)] {
        assert!((figures[name].as_f64().unwrap() - offset_px).abs() <= 1.0, "{figures}");
    }
    let remedy = finding(&said, "registration")["remedy"].as_str().unwrap();
    let line = remedy.lines().last().unwrap().replace("[input] ", "[input]\n");
    let text = std::fs::read_to_string(config()).unwrap();
    std::fs::write(&cured, format!("{text}\n{line}\n")).unwrap();
    let (code, said) = doctor(&cured, &log, &[]);
    assert_eq!((code, complaints(&said)), (0, Vec::new()), "{said:#}");
}

#[test]
fn each_test_of_the_funnel_has_its_settings_and_its_pictures() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("pictures");
    let (_, said) = doctor(&config(), good(), &["-o", folder.to_str().unwrap()]);
    let drops = said["funnel"].as_array().unwrap();
    assert!(drops.len() > 3, "{said:#}");
    let width = drops.iter().find(|drop| drop["test"] == "head width").unwrap();
    let settings = width["settings"].to_string();
    assert!(settings.contains("max_head_width_m = "), "{settings}");
    assert!(settings.contains("depth-template"), "{settings}");
    for drop in drops {
        let Some(path) = drop["pictures"].as_str() else { continue };
        let picture = image::open(path).unwrap();
        assert!(picture.width() > 144 && picture.height() > 144, "{path}");
    }
    assert!(drops.iter().any(|drop| drop["pictures"].is_string()));
    // The folder is the user's: its files stay.
    let again = tagalong().arg("doctor").arg(config()).arg(good()).arg("-o").arg(&folder).output();
    assert_eq!(code(&again.unwrap()), 2);
}

/// The real logs that were corrected are right, and the same logs with their depth moved back by 9
/// pixels are not.
#[test]
fn real_logs_are_registered_and_moved_ones_are_not() {
    let Some(um) = tagalong_conformance::testdata::find("logs/um.mcap") else { return };
    let home = tempfile::tempdir().unwrap();
    let [start, moved] = ["start.mcap", "moved.mcap"].map(|name| home.path().join(name));
    broken::write(&um, &start, &Changes { first_s: Some(4.0), ..Changes::default() });
    let (_, said) = doctor(&config(), &start, &[]);
    assert_eq!(finding(&said, "registration")["severity"], "ok", "{said:#}");
    broken::write(&start, &moved, &shifted(-9, -3));
    let (code, said) = doctor(&config(), &moved, &[]);
    let found = finding(&said, "registration");
    assert_eq!((code, found["severity"].as_str()), (3, Some("bad")), "{said:#}");
    let x = found["figures"]["offset_x_px"].as_f64().unwrap();
    assert!((x - 9.0).abs() <= 2.0, "{found:#}");
}

/// Simulates a scene, without the topics whose names have a part.
fn simulated(home: &Path, scene: &str, without: &'static [&'static str]) -> PathBuf {
    broken::simulated(home, scene, &Changes { without, ..Changes::default() })
}

/// A coat stand nearby, and a person walking past behind it.
const PASSING: &str = "
seed = 3
duration_s = 5.0
[room]
size_m = [8.0, 6.0]
[camera]
width = 320
height = 240
field_of_view_deg = 62.0
[robot]
start = [0.8, 3.0]
[[furniture]]
kind = 'coat-stand'
at = [3.2, 3.6]
heading_deg = 180.0
[[people]]
path = [[4.4, 4.6], [4.4, 1.2]]
speed_mps = 0.7
";

/// `nearest-thing` tracks the coat stand and nothing else.
#[test]
fn a_tracked_thing_and_an_untracked_person_are_criticised() {
    let home = tempfile::tempdir().unwrap();
    let log = simulated(home.path(), PASSING, &[]);
    let config = crate::common::config(home.path(), "");
    let pictures = home.path().join("pictures");
    let output = crate::common::own_plugin()
        .args(["doctor", "--format", "json", "-o"])
        .arg(&pictures)
        .args([&config, &log])
        .output()
        .unwrap();
    let said: Value = serde_json::from_slice(&output.stdout).expect("a diagnosis");
    assert_eq!(code(&output), 3, "{said:#}");
    let still = finding(&said, "still");
    assert_eq!(still["severity"], "bad", "{still:#}");
    assert_eq!(still["figures"]["still_tracks"], 1.0, "{still:#}");
    assert!(still["measured"].as_str().unwrap().contains("1 of 1 track never moved"), "{still:#}");
    let missed = finding(&said, "missed");
    assert_eq!(missed["severity"], "bad", "{missed:#}");
    assert!(missed["measured"].as_str().unwrap().contains("m away"), "{missed:#}");
    // Other settings and configs were tried, and the best finds the walker.
    let told = missed["remedy"].as_str().unwrap();
    assert!(told.contains("(another config)"), "{told}");
    let first = &said["alternatives"][0]["coverage"];
    assert!(first["unexplained"].as_u64() < said["coverage"]["unexplained"].as_u64(), "{said:#}");
    let frames = std::fs::read_dir(pictures.join("frames")).unwrap().count();
    assert!((3..=13).contains(&frames), "{frames} pictures");
}

#[test]
fn without_a_config_each_pipeline_that_fits_is_tried() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("checkup");
    let mut doctor = tagalong();
    doctor.arg("doctor").arg(good()).env("TAGALONG_HOME", home.path());
    let printed = text(&doctor.output().unwrap().stdout);
    let output = doctor.args(["--format", "json", "-o"]).arg(&folder).output().unwrap();
    let said: Value = serde_json::from_slice(&output.stdout).expect("a diagnosis");
    let rows = said["pipelines"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|row| row["config"].as_str().unwrap()).collect();
    assert_eq!(names, ["depth-verified", "depth-alone", "depth-net-ekf", "mono"]);
    let taken: Vec<bool> = rows.iter().map(|row| row["taken"].as_bool().unwrap()).collect();
    assert_eq!(taken, [true, false, false, false]);
    assert_eq!(rows[0]["coverage"]["moving"], 2, "{said:#}");
    for name in names {
        let pictures = std::fs::read_dir(folder.join(name)).unwrap().count();
        assert!(pictures >= 5, "{name}: {pictures} pictures");
    }
    assert!(printed.contains("depth-verified (taken by `run`)"), "{printed}");
    assert!(printed.contains("`tagalong run` takes depth-verified, because"), "{printed}");
    let network = said["network"].as_str().unwrap();
    assert!(network.contains("`tagalong model --install FILE.onnx` installs one"), "{network}");
    assert!(printed.contains(&format!("  no network is among them: {network}\n")), "{printed}");
}

/// Every setting that is tried differs from the present one.
#[test]
fn other_settings_are_tried_where_that_is_asked_for() {
    let (_, said) = doctor(&config(), good(), &["--settings", "always"]);
    let tried = said["alternatives"].as_array().unwrap();
    let changes: Vec<&str> = tried.iter().map(|one| one["change"].as_str().unwrap()).collect();
    assert!(changes.contains(&"[manager.config] confirm_hits = 3"), "{changes:?}");
    assert!(changes.contains(&"[manager] plugin = \"manage-sprt\""), "{changes:?}");
    assert!(changes.contains(&"depth-verified (another config)"), "{changes:?}");
    for present in ["confirm_hits = 2", "discover_cost = 0.16 ", "depth-ekf (", "min_body = 0.7 "] {
        assert!(!changes.iter().any(|change| change.contains(present)), "{changes:?}");
    }
    let (_, said) = doctor(&config(), good(), &["--settings", "never"]);
    assert_eq!(said["alternatives"], Value::Array(vec![]));
}

/// A robot with a scanner alone, which drives.
const SCANNER: &str = "
seed = 5
duration_s = 4.0
[room]
size_m = [9.0, 6.0]
[camera]
width = 64
height = 48
[robot]
start = [0.8, 3.0]
path = [[6.0, 3.0]]
speed_mps = 0.5
[laser]
[[people]]
path = [[4.0, 4.4], [4.0, 1.5]]
speed_mps = 0.6
";

#[test]
fn a_scanner_that_drives_without_odometry_is_told_by_its_rays() {
    let home = tempfile::tempdir().unwrap();
    let log = simulated(home.path(), SCANNER, &["/camera", "/odom"]);
    let (_, said) = doctor(&root().join("configs/laser-legs.toml"), &log, &[]);
    let driven = finding(&said, "odometry");
    let measured = driven["measured"].as_str().unwrap();
    assert!(driven["severity"] != "ok", "{driven:#}");
    assert!(measured.contains("% of the rays change by more than 0.2 m in a second"), "{driven:#}");
}

#[test]
fn of_a_laser_log_lasers_are_spoken_of() {
    let home = tempfile::tempdir().unwrap();
    let log = simulated(home.path(), SCANNER, &["/camera"]);
    let (code, said) = doctor(&config(), &log, &[]);
    assert_eq!(code, 3, "{said:#}");
    let needs = finding(&said, "needs")["remedy"].as_str().unwrap();
    assert!(needs.contains("laser-legs"), "{needs}");
    let driven = finding(&said, "odometry");
    assert!(driven["measured"].as_str().unwrap().contains("m driven"), "{driven:#}");
    let metres = driven["figures"]["driven_m"].as_f64().unwrap();
    assert!((1.5..2.1).contains(&metres), "{driven:#}");
    let (_, said) = doctor(&root().join("configs/laser-legs.toml"), &log, &[]);
    let laser = finding(&said, "laser");
    assert_eq!(laser["severity"], "ok", "{laser:#}");
    assert!(laser["measured"].as_str().unwrap().contains("scans a second"), "{laser:#}");
    let read = finding(&said, "frames-read")["measured"].as_str().unwrap();
    assert!(read.contains("scans"), "{read}");
    assert!(!said["findings"].as_array().unwrap().iter().any(|f| f["id"] == "suits"), "{said:#}");
}

#[test]
fn a_config_for_robots_with_odometry_is_not_for_a_log_without() {
    let home = tempfile::tempdir().unwrap();
    let log = simulated(home.path(), SCANNER, &["/camera", "/odom", "/tf"]);
    let (code, said) = doctor(&root().join("configs/laser-legs.toml"), &log, &[]);
    let suits = finding(&said, "suits");
    assert_eq!((code, suits["severity"].as_str()), (3, Some("bad")), "{said:#}");
    assert!(suits["measured"].as_str().unwrap().contains("no odometry"), "{suits:#}");
    let (_, said) = doctor(&root().join("configs/laser-follow.toml"), &log, &[]);
    assert!(!said["findings"].as_array().unwrap().iter().any(|f| f["id"] == "suits"), "{said:#}");
}

/// Images that are all skipped are no good log, whatever else is fine.
#[test]
fn images_that_make_no_frames_are_told() {
    let home = tempfile::tempdir().unwrap();
    let log = home.path().join("apart.mcap");
    broken::write(
        good(),
        &log,
        &Changes { depth_stamp: Some(|_, at| at + 600_000_000_000), ..Changes::default() },
    );
    let (code, said) = doctor(&config(), &log, &[]);
    let read = finding(&said, "frames-read");
    assert_eq!((code, read["severity"].as_str()), (3, Some("bad")), "{said:#}");
    let measured = read["measured"].as_str().unwrap();
    assert!(measured.contains("0 frames of 32 images; colour without depth 32"), "{measured}");
    assert!(!measured.contains("chunks"), "{measured}");
    let told = read["remedy"].as_str().unwrap();
    assert!(
        told.contains("32 of 32 frames got no image of ") && told.contains("another clock"),
        "{told}"
    );
    assert!(!told.contains("pose of the camera"), "what is no loss: {told}");
    assert!(!said["findings"].as_array().unwrap().iter().any(|f| f["id"] == "missed"), "{said:#}");
}

/// A config that states its cameras is not for another one.
#[test]
fn a_camera_outside_of_the_stated_range_is_told() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("stated.toml");
    let [low, high] = ["[0.2, 0.6]", "[0.9, 2.4]"].map(|range| {
        let text = "[[detectors]]\nplugin = 'depth-template'\nroles = ['track', 'discover']\n\
                    [filter]\nplugin = 'ekf'\n[suits]\ncamera_height_m = ";
        std::fs::write(&path, format!("{text}{range}\n")).unwrap();
        let (_, said) = doctor(&path, good(), &["--settings", "never"]);
        finding(&said, "suits").clone()
    });
    assert_eq!(low["severity"], "bad", "{low:#}");
    assert!(low["measured"].as_str().unwrap().starts_with("not for this camera: 1.20 m high"));
    assert_eq!(high["severity"], "ok");
}

#[test]
fn of_a_part_of_the_log_the_whole_is_told() {
    let (_, said) = doctor(&config(), good(), &["--frames", "24", "--settings", "never"]);
    let read = finding(&said, "frames-read")["measured"].as_str().unwrap();
    assert_eq!(read, "24 frames of the first 24 images of the 32 in the log, see `--frames`");
}

/// The baseline of a pair decides between the two configs for pairs, and a log without odometry is tracked
/// all the same where the program chooses.
#[test]
fn a_wide_pair_gets_the_config_for_wide_pairs() {
    let home = tempfile::tempdir().unwrap();
    for (baseline_m, fits, other) in
        [(0.12, "stereo-verified", "stereo-street"), (0.5, "stereo-street", "stereo-verified")]
    {
        let scene = format!(
            "seed = 5\nduration_s = 0.3\n[room]\nsize_m = [9.0, 6.0]\n[camera]\nkind = 'stereo'\n\
             baseline_m = {baseline_m}\nwidth = 160\nheight = 120\n[robot]\nstart = [0.8, 3.0]\n\
             [[people]]\npath = [[4.0, 4.4], [4.0, 1.5]]\nspeed_mps = 0.6\n"
        );
        let log = simulated(home.path(), &scene, &["/odom"]);
        let arguments = ["--format", "json", "--settings", "never"];
        let output = tagalong().arg("doctor").arg(&log).args(arguments).output();
        let said: Value = serde_json::from_slice(&output.unwrap().stdout).expect("a diagnosis");
        let rows = said["pipelines"].as_array().unwrap();
        let names: Vec<&str> = rows.iter().map(|row| row["config"].as_str().unwrap()).collect();
        assert!(names.contains(&fits) && !names.contains(&other), "{baseline_m} m: {names:?}");
        let needs = finding(&said, "needs");
        assert_eq!(needs["severity"], "warn", "{needs:#}");
        assert!(needs["measured"].as_str().unwrap().contains("no odometry"), "{needs:#}");
        let (code, said) = doctor(&root().join(format!("configs/{fits}.toml")), &log, &[]);
        assert_eq!((code, &finding(&said, "needs")["severity"]), (3, &"bad".into()), "{said:#}");
    }
}
