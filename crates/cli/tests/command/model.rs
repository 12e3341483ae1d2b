//! `tagalong model` on the hand-weighted networks.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::common::{code, messages_of, results_of, tagalong, text};

fn network(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "..", "network", "tests", "models", name].iter().collect()
}

/// Runs the command in a home folder, with the networks in its folder `data`.
fn run_at(home: &Path, arguments: &[&str]) -> Output {
    let mut command = tagalong();
    command.args(arguments).env("TAGALONG_HOME", home.join("data")).current_dir(home);
    command.output().unwrap()
}

/// The printed text of a command that ends well.
fn printed_at(home: &Path, arguments: &[&str]) -> String {
    let done = run_at(home, arguments);
    assert_eq!(code(&done), 0, "{arguments:?}: {}", text(&done.stderr));
    text(&done.stdout)
}

#[test]
fn a_network_is_described_by_the_config_that_runs_it() {
    let home = tempfile::tempdir().unwrap();
    fs::copy(network("nanodet.onnx"), home.path().join("net.onnx")).unwrap();
    let config = results_of(
        &tagalong().args(["model", "net.onnx"]).current_dir(home.path()).output().unwrap(),
    );
    for part in [
        "# inputs   `images` [1, 3, 64, 64]\n",
        "# outputs  `output` [1, 85, 34]\n",
        "# family   nanodet (NanoDet-Plus)\n",
        "BGR",
        &format!("model = \"{}\"\n", home.path().join("net.onnx").display()),
        "ms a call",
    ] {
        assert!(config.contains(part), "{part}: {config}");
    }
    fs::write(home.path().join("people.toml"), config).unwrap();
    let check =
        tagalong().args(["check", "people.toml"]).current_dir(home.path()).output().unwrap();
    assert_eq!(code(&check), 0, "{}", text(&check.stderr));
}

/// The config is in another folder than the one in which the command runs.
#[test]
fn a_config_that_is_written_runs_from_where_it_is() {
    let home = tempfile::tempdir().unwrap();
    let robot = home.path().join("robot");
    fs::create_dir_all(robot.join("models")).unwrap();
    fs::copy(network("nanodet.onnx"), robot.join("models/net.onnx")).unwrap();
    printed_at(home.path(), &["model", "robot/models/net.onnx", "-o", "robot/people.toml"]);
    let config = fs::read_to_string(robot.join("people.toml")).unwrap();
    assert!(config.contains("model = \"models/net.onnx\"\n"), "{config}");
    printed_at(home.path(), &["check", "robot/people.toml"]);
    fs::remove_file(robot.join("models/net.onnx")).unwrap();
    let why = text(&run_at(home.path(), &["check", "robot/people.toml"]).stderr);
    assert!(why.contains("robot/models/net.onnx`: cannot be read"), "{why}");
}

#[test]
fn known_networks_are_listed_with_their_licences() {
    let home = tempfile::tempdir().unwrap();
    let told = tagalong().args(["model", "--list"]).env("TAGALONG_HOME", home.path()).output();
    let told = text(&told.unwrap().stdout);
    for part in ["yolox-nano", "yolox_nano.onnx, 3.7 MB, Apache-2.0", "https://", "HOTA", "None is"]
    {
        assert!(told.contains(part), "{part}: {told}");
    }
}

#[test]
fn an_installed_network_has_a_name() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    let networks = home.join("data/networks");
    let file = network("yolox.onnx").display().to_string();
    let told = printed_at(home, &["model", "--install", &file, "--name", "blob-finder"]);
    assert!(told.contains("model = \"blob-finder\""), "{told}");
    let card = fs::read_to_string(networks.join("blob-finder.card.toml")).unwrap();
    let card: toml::Table = card.parse().unwrap();
    assert_eq!(
        (card["family"].as_str(), card["file"].as_str()),
        (Some("yolox"), Some("yolox.onnx"))
    );
    // A config names it, and it is a config by itself.
    let own = "[[detectors]]\nplugin = \"onnx\"\nconfig = { model = \"blob-finder\" }\n\
               [filter]\nplugin = \"image-kalman\"\n";
    fs::write(home.join("own.toml"), own).unwrap();
    for config in ["own.toml", "blob-finder", "blob-finder-depth", "network"] {
        printed_at(home, &["check", config]);
    }
    let other = network("yolov8.onnx").display().to_string();
    let taken = run_at(home, &["model", "--install", &other, "--name", "blob-finder"]);
    let why = text(&taken.stderr);
    assert!(why.contains("another network is installed as `blob-finder`"), "{why}");
    let named = text(&run_at(home, &["model", "blob-finder"]).stderr);
    assert!(named.contains("is installed already: ") && !named.contains("did you mean"), "{named}");
    // The same file again: what was edited stays, unless it is asked for.
    let again = ["model", "--install", &file, "--name", "blob-finder"];
    assert_eq!(code(&run_at(home, &again)), 0, "nothing was edited");
    let config = networks.join("blob-finder.toml");
    let edited = fs::read_to_string(&config).unwrap() + "# mine\n";
    fs::write(&config, &edited).unwrap();
    let kept = run_at(home, &again);
    let why = text(&kept.stderr);
    assert!(code(&kept) == 2 && why.contains("--overwrite"), "{why}");
    assert_eq!(fs::read_to_string(&config).unwrap(), edited);
    assert_eq!(code(&run_at(home, &[&again[..], &["--overwrite"]].concat())), 0);
    assert!(!fs::read_to_string(&config).unwrap().contains("# mine"));
    let odd = run_at(home, &["model", "--install", &other, "--name", "a/b"]);
    assert_eq!(code(&odd), 2, "{}", text(&odd.stderr));
    let builtin = run_at(home, &["model", "--install", &other, "--name", "mono"]);
    assert!(text(&builtin.stderr).contains("the name of a built-in config"));
    let twin = run_at(home, &["model", "--install", &other, "--name", "blob-finder-depth"]);
    assert_eq!(code(&twin), 2, "{}", text(&twin.stderr));
    let joined = fs::read_to_string(networks.join("blob-finder-depth.toml")).unwrap();
    let joined: toml::Table = joined.parse().unwrap();
    let plugins: Vec<_> =
        joined["detectors"].as_array().unwrap().iter().map(|d| d["plugin"].as_str()).collect();
    assert_eq!(plugins, [Some("onnx"), Some("depth-template"), Some("depth-net")]);
    let unknown = network("depth.onnx").display().to_string();
    assert_eq!(code(&run_at(home, &["model", "--install", &unknown])), 1);
    let list = text(&run_at(home, &["model", "--list"]).stdout);
    assert!(list.contains("blob-finder (taken for a log with colour alone)"), "{list}");
    // Mistyped names lead to it.
    fs::write(home.join("own.toml"), own.replace("blob-finder", "blob-findr")).unwrap();
    for config in ["own.toml", "blob-findr"] {
        let why = text(&run_at(home, &["check", config]).stderr);
        assert!(why.contains("did you mean `blob-finder`"), "{config}: {why}");
    }
}

#[test]
fn installed_networks_are_listed_and_removed_by_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    for (file, name) in [("yolox.onnx", "first"), ("yolov8.onnx", "second"), ("omz.onnx", "faces")]
    {
        let file = network(file).display().to_string();
        printed_at(home, &["model", "--install", &file, "--name", name]);
    }
    let list = printed_at(home, &["model", "--list"]);
    assert!(
        list.contains("second (taken for") && list.contains("faces (re-identification"),
        "{list}"
    );
    let said = messages_of(&run_at(home, &["model", "--remove", "secnd"]), 2);
    assert!(said.contains("did you mean `second`?"), "{said}");
    let told = printed_at(home, &["model", "--remove", "second"]);
    assert!(told.contains("`first` is now taken for a log with colour alone"), "{told}");
    for name in ["faces", "first"] {
        printed_at(home, &["model", "--remove", name]);
    }
    let left = fs::read_dir(home.join("data/networks")).unwrap().count();
    assert_eq!(left, 0, "no file stays behind");
}

#[test]
fn files_that_exist_are_replaced_on_request_alone() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    fs::copy(network("nanodet.onnx"), home.join("net.onnx")).unwrap();
    let writing = ["model", "net.onnx", "-o", "people.toml"];
    fs::write(home.join("people.toml"), "mine").unwrap();
    let said = messages_of(&run_at(home, &writing), 2);
    assert!(said.contains("people.toml exists"), "{said}");
    assert_eq!(fs::read_to_string(home.join("people.toml")).unwrap(), "mine");
    printed_at(home, &[&writing[..], &["--overwrite"]].concat());
    let said = messages_of(&run_at(home, &["model", "--export", "depth-net", "net.onnx"]), 2);
    assert!(said.contains("net.onnx exists"), "{said}");
}

/// A published network on a street: once installed, it is taken without a config or a threshold.
#[test]
fn an_installed_network_tracks_a_recorded_log() {
    let Some(file) = tagalong_conformance::testdata::find("networks/yolox_nano.onnx") else {
        return;
    };
    let Some(log) = tagalong_conformance::testdata::find("logs/TUD-Stadtmitte.mcap") else {
        return;
    };
    let home = tempfile::tempdir().unwrap();
    let told = printed_at(home.path(), &["model", "--install", file.to_str().unwrap()]);
    assert!(told.contains("licence Apache-2.0"), "{told}");
    let said = messages_of(&run_at(home.path(), &["run", log.to_str().unwrap(), "-o", "out"]), 0);
    assert!(said.contains("taking yolox-nano"), "{said}");
    let report = fs::read_to_string(home.path().join("out/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let with_person = report["frames"]["with_person"].as_u64().unwrap();
    assert!(with_person >= 170, "people are in all of 179 frames: {with_person}");
}

/// People pass a low camera, most of them without head or feet in the image.
#[test]
fn a_network_joined_with_depth_finds_people_close_by() {
    let find = tagalong_conformance::testdata::find;
    let Some(file) = find("networks/yolox_nano.onnx") else { return };
    let Some(log) = find("logs/lab2-camera1.mcap") else { return };
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    printed_at(home, &["model", "--install", file.to_str().unwrap()]);
    let truth = log.with_extension("people.csv");
    let truth = truth.to_str().unwrap();
    let log = log.to_str().unwrap();
    let chosen = text(&run_at(home, &["run", log, "-o", "by-itself"]).stderr);
    assert!(chosen.contains("tagalong run yolox-nano-depth LOG"), "{chosen}");
    let noted = printed_at(home, &["check", "yolox-nano-depth"]);
    assert!(!noted.contains("replace"), "nobody edited the config: {noted}");
    let [alone, joined] = ["depth-verified", "yolox-nano-depth"].map(|config| -> f64 {
        printed_at(home, &["run", config, log, "-o", config]);
        let scored = printed_at(home, &["eval", "--truth", truth, "--tracks", config]);
        let line = scored.lines().find(|line| line.starts_with("recall ")).unwrap();
        line.split_whitespace().last().unwrap().parse().unwrap()
    });
    assert!(alone < 0.6 && joined > 0.75, "{alone} {joined}");
}

#[test]
fn a_network_for_reidentification_is_described_by_its_section() {
    let home = tempfile::tempdir().unwrap();
    fs::copy(network("omz.onnx"), home.path().join("reid.onnx")).unwrap();
    let section = results_of(
        &tagalong().args(["model", "reid.onnx"]).current_dir(home.path()).output().unwrap(),
    );
    for part in [
        "re-identification: an embedding of 256 numbers per person",
        "128 x 256 pixels, stretched",
        "BGR",
        "ms a person",
        &format!("[appearance]\nmodel = \"{}\"", home.path().join("reid.onnx").display()),
    ] {
        assert!(section.contains(part), "{part}: {section}");
    }
    let plugins = "[[detectors]]\nplugin = \"depth-template\"\n[filter]\nplugin = \"ekf\"\n";
    fs::write(home.path().join("people.toml"), format!("{plugins}{section}")).unwrap();
    let check =
        tagalong().args(["check", "people.toml"]).current_dir(home.path()).output().unwrap();
    assert_eq!(code(&check), 0, "{}", text(&check.stderr));
}

#[test]
fn a_description_is_also_json() {
    let file = network("movenet.onnx");
    let told = tagalong().arg("model").arg(file).args(["--format", "json"]).output().unwrap();
    let told: serde_json::Value = serde_json::from_slice(&told.stdout).unwrap();
    assert_eq!(told["family"], "movenet");
    assert_eq!(told["inputs"][0]["shape"], serde_json::json!([1, 64, 64, 3]));
}

#[test]
fn a_file_without_a_family_is_described_and_fails_with_the_reason() {
    let home = tempfile::tempdir().unwrap();
    // The outputs of this family are known by their names.
    let mut other = fs::read(network("rf-detr.onnx")).unwrap();
    for at in 0..other.len() - 4 {
        if other[at..].starts_with(b"dets") {
            other[at] = b'b';
        }
    }
    fs::write(home.path().join("net.onnx"), other).unwrap();
    let told = tagalong().args(["model", "net.onnx"]).current_dir(home.path()).output().unwrap();
    assert_eq!(code(&told), 1);
    assert!(text(&told.stdout).contains("`bets` [1, 16, 4]"), "{}", text(&told.stdout));
    let why = text(&told.stderr);
    assert!(why.contains("net.onnx: no decoder fits") && why.contains("rf-detr:"), "{why}");
}

#[test]
fn files_that_are_no_networks_are_refused_by_name() {
    for (name, part) in [("none.onnx", "cannot be read"), ("yolox.json", "no ONNX file")] {
        let why = messages_of(&tagalong().arg("model").arg(network(name)).output().unwrap(), 1);
        assert!(why.contains(name) && why.contains(part), "{why}");
    }
}

#[test]
fn the_shipped_network_is_the_one_that_the_export_writes() {
    let home = tempfile::tempdir().unwrap();
    let export = ["model", "--export", "depth-net", "net.onnx", "--sample", "net.json"];
    let told = tagalong().args(export).current_dir(home.path()).output().unwrap();
    assert_eq!(code(&told), 0, "{}", text(&told.stderr));
    let models: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "..", "..", "configs", "models"].iter().collect();
    for (written, shipped) in
        [("net.onnx", "depth-net.onnx"), ("net.onnx.card.toml", "depth-net.onnx.card.toml")]
    {
        let same =
            fs::read(home.path().join(written)).unwrap() == fs::read(models.join(shipped)).unwrap();
        let renew = "tagalong model --export depth-net --overwrite configs/models/depth-net.onnx";
        assert!(same, "{shipped} is another one: run `{renew}`");
    }
    let card = fs::read_to_string(home.path().join("net.onnx.card.toml")).unwrap();
    let card: toml::Table = card.parse().unwrap();
    assert!(card["inputs"]["fine"].as_str().unwrap().starts_with("[1, 11, 128, 128]"));
    let sample = fs::read_to_string(home.path().join("net.json")).unwrap();
    let sample: serde_json::Value = serde_json::from_str(&sample).unwrap();
    assert_eq!(sample["outputs"]["head"]["shape"], serde_json::json!([1, 3, 64, 64]));
    let told = tagalong().args(["model", "net.onnx"]).current_dir(home.path()).output().unwrap();
    assert_eq!(code(&told), 1, "it takes no image");
    assert!(text(&told.stdout).contains("`fine` [1, 11, 128, 128]"), "{}", text(&told.stdout));
}

#[test]
fn an_export_takes_the_weights_of_a_model_file() {
    let home = tempfile::tempdir().unwrap();
    let models = "../../configs/models";
    let other = "../../benches/models/depth-net.without-lab2.toml";
    let file = home.path().join("net.onnx");
    for (weights, expected, words) in [(other, 0, ""), ("none.toml", 2, "none.toml")] {
        let told = tagalong()
            .args(["model", "--export", "depth-net", "--overwrite", "--weights", weights])
            .arg(&file)
            .output()
            .unwrap();
        let why = text(&told.stderr);
        assert!(code(&told) == expected && why.contains(words), "{weights}: {why}");
    }
    let shipped = fs::read(format!("{models}/depth-net.onnx")).unwrap();
    assert_ne!(fs::read(&file).unwrap(), shipped);
}

#[test]
fn plugins_without_a_network_export_none() {
    let why = messages_of(
        &tagalong().args(["model", "--export", "ekf", "net.onnx"]).output().unwrap(),
        2,
    );
    assert!(why.contains("`ekf` has no network to export; available: depth-net"), "{why}");
}
