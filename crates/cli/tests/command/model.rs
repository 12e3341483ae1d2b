//! `tagalong model` on the hand-weighted networks.

use std::fs;
use std::path::PathBuf;

use crate::common::{code, tagalong, text};

fn network(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "..", "network", "tests", "models", name].iter().collect()
}

#[test]
fn a_network_is_described_by_the_config_that_runs_it() {
    let home = tempfile::tempdir().unwrap();
    fs::copy(network("nanodet.onnx"), home.path().join("net.onnx")).unwrap();
    let told = tagalong().args(["model", "net.onnx"]).current_dir(home.path()).output().unwrap();
    assert_eq!(code(&told), 0, "{}", text(&told.stderr));
    let config = text(&told.stdout);
    for part in [
        "# inputs   `images` [1, 3, 64, 64]\n",
        "# outputs  `output` [1, 85, 34]\n",
        "# family   nanodet (NanoDet-Plus)\n",
        "BGR",
        "model = \"net.onnx\"",
        "ms a call",
    ] {
        assert!(config.contains(part), "{part}: {config}");
    }
    fs::write(home.path().join("people.toml"), config).unwrap();
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
        let told = tagalong().arg("model").arg(network(name)).output().unwrap();
        assert_eq!(code(&told), 1);
        let why = text(&told.stderr);
        assert!(why.contains(name) && why.contains(part), "{why}");
    }
}
