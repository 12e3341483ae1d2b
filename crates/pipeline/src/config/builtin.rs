//! Configs that are built into the program.

use std::io::{self, ErrorKind};
use std::path::Path;

use super::document::Document;

/// Names and texts of configs.
macro_rules! configs {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../configs/", $name, ".toml")))),*]
    };
}

/// Configs that need no file: all of the folder but those with a model in a file of its own.
const BUILT_IN: &[(&str, &str)] = configs! {
    "depth-alone"
    "depth-color-ekf"
    "depth-ekf"
    "depth-ekf-follow"
    "depth-jpda"
    "depth-laser"
    "depth-net-ekf"
    "depth-sprt"
    "depth-svm-ekf"
    "depth-two-stage"
    "depth-verified"
    "follow-arc"
    "follow-depth"
    "follow-low"
    "follow-sonar"
    "joint-particle"
    "laser-follow"
    "laser-legs"
    "lidar"
    "mono"
    "naive"
    "omni-appearance"
    "omni-ekf"
    "omni-rich"
    "particle-verified"
    "recorded"
    "recorded-observation-centric"
    "rgbd-compressive"
    "rgbd-ekf"
    "stereo-ekf"
    "stereo-follow"
    "stereo-particle"
    "stereo-street"
    "stereo-svm-ekf"
    "stereo-verified"
};

/// Configs of the folder that are not built in, because they run the network of a file.
pub(super) const OF_A_FILE: [&str; 3] = ["colour-net", "depth-network", "onnx"];

/// Folder of the configs of robots.
const ROBOTS_FOLDER: &str = "robots/";

/// Configs of robots, by the names of their files.
const ROBOTS: &[(&str, &str)] = &[
    ("turtlebot3", include_str!("../../configs/robots/turtlebot3.toml")),
    ("turtlebot4", include_str!("../../configs/robots/turtlebot4.toml")),
];

/// Returns all built-in configs with their names.
fn all() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    BUILT_IN.iter().chain(ROBOTS)
}

/// Returns the names of the built-in configs.
pub(super) fn builtin_names() -> impl Iterator<Item = &'static str> {
    all().map(|(name, _)| *name)
}

/// Returns the text of a built-in config with those that it extends; `None` if there is none of this
/// name.
pub(super) fn builtin_text(name: &str) -> Option<String> {
    let text = text_alone(name)?;
    let whole = Document::read_builtin(text).and_then(Document::into_flat_text);
    Some(whole.unwrap_or_else(|_| text.to_owned()))
}

/// Returns the text of a built-in config; those of robots may have the name of their folder before
/// their own.
fn text_alone(name: &str) -> Option<&'static str> {
    match name.strip_prefix(ROBOTS_FOLDER) {
        Some(robot) => text_among(ROBOTS.iter(), robot),
        None => text_among(all(), name),
    }
}

fn text_among<'a>(
    mut configs: impl Iterator<Item = &'a (&'static str, &'static str)>,
    name: &str,
) -> Option<&'static str> {
    configs.find(|(builtin, _)| *builtin == name).map(|(_, text)| *text)
}

/// Returns the text of the built-in config that has the name of a file: `NAME.toml`, or
/// `robots/NAME.toml`.
pub(super) fn text_of_file(file: &str) -> Option<&'static str> {
    text_alone(file.strip_suffix(".toml")?)
}

/// Returns the text of a config that a built-in one extends: it is built in, too.
pub(super) fn read_base(path: &Path) -> io::Result<String> {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy());
    let base = stem.and_then(|stem| text_alone(&stem));
    base.map(str::to_owned).ok_or_else(|| ErrorKind::NotFound.into())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn all_configs_of_the_folder_are_built_in_but_those_with_a_model_of_their_own() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
        let mut left_out = Vec::new();
        let robots = fs::read_dir(folder.join("robots")).unwrap();
        for entry in fs::read_dir(folder).unwrap().chain(robots) {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
            let is_config = path.extension().is_some_and(|extension| extension == "toml");
            if is_config && builtin_text(&stem).is_none() {
                left_out.push(stem);
            }
        }
        left_out.sort();
        assert_eq!(left_out, OF_A_FILE);
    }

    #[test]
    fn robots_have_their_folder_before_their_name_and_others_do_not() {
        assert_eq!(builtin_text("robots/turtlebot4"), builtin_text("turtlebot4"));
        assert_eq!(builtin_text("robots/follow-low"), None);
        assert_eq!(text_of_file("robots/turtlebot4"), None);
    }

    #[test]
    fn configs_of_robots_have_what_they_extend() {
        let text = builtin_text("turtlebot4").unwrap();
        assert!(text.contains("clear-follow") && text.contains("footprint"), "{text}");
    }
}
