//! `tagalong train`: the same bytes for the same seed, a model that its plugin reads, and answers
//! to wrong usage.

use std::fs;
use std::path::Path;

use crate::common::{assert_same, code, messages_of, tagalong, text};

fn train(folder: &Path, arguments: &[&str]) -> std::process::Output {
    tagalong().current_dir(folder).arg("train").args(arguments).output().unwrap()
}

#[test]
#[cfg(feature = "train")]
fn the_same_seed_makes_the_same_model_and_card_and_the_model_works() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.toml", "b.toml"] {
        let output = train(folder.path(), &["svm-patch", "--quick", "--scenes", "4", "-o", name]);
        assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    }
    for ending in ["toml", "card.toml"] {
        let [first, second] = ["a", "b"].map(|name| folder.path().join(format!("{name}.{ending}")));
        assert_same(&first, &second);
    }
    let card = fs::read_to_string(folder.path().join("a.card.toml")).unwrap();
    let card: toml::Table = card.parse().unwrap();
    assert_eq!(card["scenes"].as_integer(), Some(4));
    assert!(card["fit"]["people"].as_integer().unwrap() > 0, "{card}");
    assert!(card["fit"]["others"].as_integer().unwrap() > 0, "{card}");
    let config = "[[detectors]]\nplugin = \"depth-template\"\n[filter]\nplugin = \"ekf\"\n\
                  [[verifiers]]\nplugin = \"svm-patch\"\nconfig = { model = \"a.toml\" }\n";
    fs::write(folder.path().join("with.toml"), config).unwrap();
    let check = tagalong().current_dir(folder.path()).args(["check", "with.toml"]).output();
    assert_eq!(code(&check.unwrap()), 0);
}

#[test]
#[cfg(not(feature = "train"))]
fn a_program_without_trainers_says_which_command_builds_them() {
    let folder = tempfile::tempdir().unwrap();
    let message = messages_of(&train(folder.path(), &["svm-patch", "--quick"]), 2);
    assert!(
        message.contains("cargo run --release --features train -- train svm-patch"),
        "{message}"
    );
}

#[test]
#[cfg(feature = "train")]
fn who_cannot_be_trained_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let said = messages_of(&train(folder.path(), &["ekf", "--quick"]), 2);
    assert!(said.contains("`ekf` cannot be trained"), "{said}");
}

#[test]
#[cfg(feature = "train")]
fn wrong_settings_are_named() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), "[training]\nfold = 3\n").unwrap();
    let said =
        messages_of(&train(folder.path(), &["svm-patch", "--quick", "--settings", "s.toml"]), 2);
    assert!(said.contains("did you mean `folds`?"), "{said}");
}

/// Scenes of a file take the place of random rooms, as other draws.
#[test]
#[cfg(feature = "train")]
fn a_verifier_is_trained_in_the_given_world() {
    let folder = tempfile::tempdir().unwrap();
    let world = "duration_s = 2.0\n[camera]\nrate_hz = 3.0\n[robot]\nstart = [1.0, 3.0]\n\
                 [[people]]\npath = [[4.0, 2.0], [3.6, 4.0]]\n\
                 [[furniture]]\nkind = \"cardboard-figure\"\nat = [4.5, 4.3]\nheading_deg = 190.0\n\
                 [[furniture]]\nkind = \"coat-stand\"\nat = [4.0, 1.2]\n";
    let proposes = "[[detectors]]\nplugin = \"depth-template\"\n\
                    config = { discover_cost = 0.3, boundary_margin_m = 0.2 }\n\
                    [filter]\nplugin = \"ekf\"\n";
    fs::write(folder.path().join("hall.toml"), world).unwrap();
    fs::write(folder.path().join("low.toml"), proposes).unwrap();
    let given = ["svm-patch", "--quick", "--scenes", "5", "-o", "a.toml", "--world", "hall.toml"];
    let output = train(folder.path(), &given);
    assert_eq!(code(&output), 2, "a world without a detector that proposes");
    assert!(text(&output.stderr).contains("--proposes"), "{}", text(&output.stderr));
    let output = train(folder.path(), &[&given[..], &["--proposes", "low.toml"]].concat());
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let card = fs::read_to_string(folder.path().join("a.card.toml")).unwrap();
    let card: toml::Table = card.parse().unwrap();
    assert_eq!(card["trained_on"].as_array().unwrap()[0].as_str(), Some("simulated hall"));
    let missing = ["svm-patch", "-o", "b.toml", "--world", "none.toml", "--proposes", "low.toml"];
    let said = messages_of(&train(folder.path(), &missing), 2);
    assert!(said.contains("none.toml"), "{said}");
}
