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

/// A log broken in one way, and the expected finding.
struct Case {
    name: &'static str,
    changes: Changes,
    id: &'static str,
    severity: &'static str,
    remedy: &'static str,
}

fn shifted(dx: i64, dy: i64) -> Changes {
    let depth = move |all: &[u16], width: usize, x, y| reading(all, width, x - dx, y - dy);
    Changes { depth: Some(Box::new(depth)), ..Changes::default() }
}

fn scaled(factor: f64) -> Changes {
    let depth = move |all: &[u16], width: usize, x, y| {
        (f64::from(reading(all, width, x, y)) * factor).round() as u16
    };
    Changes { depth: Some(Box::new(depth)), ..Changes::default() }
}

fn with_info(info: fn(&mut CameraInfo)) -> Changes {
    Changes { info: Some(info), ..Changes::default() }
}

fn with_tf(tf: fn(&mut TFMessage)) -> Changes {
    Changes { tf: Some(tf), ..Changes::default() }
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

fn cases() -> Vec<Case> {
    let case = |name, changes, id, severity, remedy| Case { name, changes, id, severity, remedy };
    vec![
        case("depth beside colour", shifted(-7, 2), "registration", "bad", "depth_offset_px = ["),
        case("tenths of millimetres", scaled(10.0), "depth", "bad", "depth_unit_m = 0.0001"),
        case("centimetres", scaled(0.1), "depth", "bad", "depth_unit_m = 0.01"),
        case("half of the unit", scaled(0.5), "mount", "bad", "depth_unit_m"),
        case("no readings", scaled(0.0), "depth", "bad", "depth_topic"),
        case(
            "the calibration of half the size",
            with_info(|info| {
                info.k[0] *= 0.5;
                info.k[2] *= 0.5;
                info.k[4] *= 0.5;
                info.k[5] *= 0.5;
            }),
            "intrinsics",
            "bad",
            "colour_info_topic",
        ),
        case(
            "the calibration of another size",
            with_info(|info| (info.width, info.height) = (640, 480)),
            "intrinsics",
            "bad",
            "colour_info_topic",
        ),
        case("uncalibrated", with_info(|info| info.k = [0.0; 9]), "intrinsics", "bad", "REP 104"),
        case("tilted", with_tf(|tf| turned(tf, 0, 8.0)), "mount", "bad", "pitch_down_deg"),
        case("rolled", with_tf(|tf| turned(tf, 2, 5.0)), "mount", "warn", "roll_deg"),
        case(
            "too high",
            with_tf(|tf| tf.transforms.iter_mut().for_each(|t| t.transform.translation.z += 0.5)),
            "mount",
            "bad",
            "height_m",
        ),
        case("a body frame", with_tf(|tf| turned(tf, 0, 90.0)), "frames", "bad", "[input.camera]"),
        case(
            "another robot frame",
            with_tf(|tf| tf.transforms.iter_mut().for_each(|t| t.header.frame_id = "base".into())),
            "frames",
            "warn",
            "base_frame = \"base\"",
        ),
        case(
            "no transform to the camera",
            with_tf(|tf| tf.transforms.iter_mut().for_each(|t| t.child_frame_id = "laser".into())),
            "frames",
            "warn",
            "[input.camera]",
        ),
        case(
            "black",
            Changes { grey_level: Some(3), ..Changes::default() },
            "exposure",
            "bad",
            "longer",
        ),
        case(
            "white",
            Changes { grey_level: Some(255), ..Changes::default() },
            "exposure",
            "bad",
            "shorter",
        ),
        case(
            "depth stamped late",
            Changes { depth_stamp: Some(|_, at| at + 28_000_000), ..Changes::default() },
            "skew",
            "warn",
            "capture",
        ),
        case(
            "two thirds of depth lost",
            Changes { thinned: Some(("aligned_depth", 3)), ..Changes::default() },
            "skew",
            "ok",
            "",
        ),
        case(
            "depth of another clock",
            Changes { depth_stamp: Some(|_, at| at + 600_000_000_000), ..Changes::default() },
            "skew",
            "bad",
            "capture",
        ),
        case(
            "a clock that jumps back",
            Changes {
                stamp: Some(
                    |at| if at > FIRST_NS + 1_200_000_000 { at - 5_000_000_000 } else { at },
                ),
                ..Changes::default()
            },
            "stamps",
            "bad",
            "use_sim_time",
        ),
        case(
            "a pause",
            Changes {
                stamp: Some(
                    |at| if at > FIRST_NS + 1_200_000_000 { at + 3_000_000_000 } else { at },
                ),
                ..Changes::default()
            },
            "stamps",
            "warn",
            "reset_gap_s",
        ),
        case(
            "one image a second",
            Changes { thinned: Some(("/camera/", 10)), ..Changes::default() },
            "rate",
            "warn",
            "record 5 images",
        ),
        case(
            "no depth",
            Changes { without: &["depth"], ..Changes::default() },
            "needs",
            "bad",
            "depth_topic",
        ),
        case(
            "no calibration",
            Changes { without: &["camera_info"], ..Changes::default() },
            "needs",
            "bad",
            "colour_info_topic",
        ),
    ]
}

const FIRST_NS: u64 = crate::common::FIRST_NS;

#[test]
fn what_was_broken_is_found() {
    let home = tempfile::tempdir().unwrap();
    let log = home.path().join("broken.mcap");
    let mut missed = Vec::new();
    for Case { name, changes, id, severity, remedy } in cases() {
        broken::write(good(), &log, &changes);
        let (code, said) = doctor(&config(), &log, &["--frames", "24"]);
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

#[test]
fn a_good_log_is_let_go() {
    let (code, said) = doctor(&config(), good(), &[]);
    assert_eq!((code, complaints(&said)), (0, Vec::new()), "{said:#}");
    let output = tagalong().arg("doctor").arg(config()).arg(good()).output().unwrap();
    let printed = text(&output.stdout);
    assert!(printed.contains("nothing to complain about"), "{printed}");
    for found in said["findings"].as_array().unwrap() {
        let (id, measured) = (found["id"].as_str().unwrap(), found["measured"].as_str().unwrap());
        assert!(printed.contains(id) && printed.contains(measured), "{id} is not printed");
    }
}

/// The remedy is a line of the config; with it the finding disappears.
#[test]
fn the_remedy_for_shifted_depth_cures_it() {
    let home = tempfile::tempdir().unwrap();
    let (log, cured) = (home.path().join("shifted.mcap"), home.path().join("cured.toml"));
    broken::write(good(), &log, &shifted(6, -5));
    let (_, said) = doctor(&config(), &log, &[]);
    let figures = &finding(&said, "registration")["figures"];
    let off = |name: &str| figures[name].as_f64().unwrap();
    assert!((off("offset_x_px") + 6.0).abs() <= 1.0, "{figures}");
    assert!((off("offset_y_px") - 5.0).abs() <= 1.0, "{figures}");
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
    let Some(um) = tagalong_testdata::find("logs/um.mcap") else { return };
    let (_, said) = doctor(&config(), &um, &[]);
    assert_eq!(finding(&said, "registration")["severity"], "ok", "{said:#}");
    let home = tempfile::tempdir().unwrap();
    let moved = home.path().join("moved.mcap");
    broken::write(&um, &moved, &shifted(-9, -3));
    let (code, said) = doctor(&config(), &moved, &[]);
    let found = finding(&said, "registration");
    assert_eq!((code, found["severity"].as_str()), (3, Some("bad")), "{said:#}");
    let x = found["figures"]["offset_x_px"].as_f64().unwrap();
    assert!((x - 9.0).abs() <= 2.0, "{found:#}");
}
