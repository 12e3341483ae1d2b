//! Built-in scenes, so that commands work outside of a clone.

use std::path::{Path, PathBuf};

/// Names and texts of scenes.
macro_rules! scenes {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../configs/scenes/", $name, ".toml")))),*]
    };
}

/// The scenes of `configs/scenes`.
const BUILT_IN: &[(&str, &str)] = scenes! {
    "among-circular" "among-clutter" "among-corridor" "among-crossing" "among-doorway" "approach"
    "behind-glass" "behind-glass-sonar" "cafeteria" "cafeteria-high" "cheap-laser" "coat-off"
    "corridor" "corridor-high" "crossing" "crossing-four" "crossing-hidden" "crossing-oblique"
    "crossing-parallel" "crossing-three" "crowd" "daylight" "demo" "empty-clutter" "empty-real"
    "follow-alike" "follow-around" "follow-between" "follow-child" "follow-coat-stand"
    "follow-corner" "follow-crowd" "follow-crowd-ten" "follow-doors" "follow-dropped" "follow-fast"
    "follow-gets-up" "follow-latency" "follow-passing" "follow-ramp" "follow-return-15"
    "follow-return-30" "follow-return-5" "follow-return-two" "follow-step-in" "follow-swap"
    "follow-tilt" "follow-turns" "following" "full-occlusion" "lidar-rings" "lidar-rosette"
    "light-changes" "mirrors" "office" "office-high" "omni-hat" "omni-moving" "omni-people"
    "omni-room" "sample" "square-walk" "static-high" "stereo-follow-passing" "stereo-hall"
    "turntable"
};

/// Folder of the named scenes.
const FOLDER: &str = "configs/scenes";

/// Returns the text of the built-in scene that a path names, either by its bare name or by the path
/// of its file in a clone.
pub fn built_in(path: &Path) -> Option<&'static str> {
    let shown = path.to_str()?;
    let file = shown.strip_prefix(FOLDER).and_then(|rest| rest.strip_prefix('/'));
    let name = file.map_or(Some(shown), |file| file.strip_suffix(".toml"))?;
    BUILT_IN.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Returns the paths of all built-in scenes whose names begin with `prefix`, as in a clone.
pub fn beginning_with(prefix: &str) -> Vec<PathBuf> {
    let names = BUILT_IN.iter().map(|(name, _)| *name).filter(|name| name.starts_with(prefix));
    names.map(|name| Path::new(FOLDER).join(format!("{name}.toml"))).collect()
}

/// Returns the names of all built-in scenes.
pub fn names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_scene_of_the_folder_is_built_in() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(FOLDER);
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let stems = files.map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned());
        let there: BTreeSet<String> = stems.collect();
        assert_eq!(there, names().map(str::to_owned).collect());
    }

    #[test]
    fn a_scene_is_found_by_its_name_and_by_its_path_in_a_clone() {
        assert!(built_in(Path::new("crossing")).is_some());
        assert_eq!(
            built_in(Path::new("configs/scenes/crossing.toml")),
            built_in(Path::new("crossing"))
        );
        assert_eq!(built_in(Path::new("elsewhere/crossing.toml")), None);
        assert!(beginning_with("follow-").iter().all(|path| built_in(path).is_some()));
    }
}
