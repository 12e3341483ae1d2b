//! Scenes that need no file, so that commands work outside of a clone.

use std::path::{Path, PathBuf};

/// Names of the scenes of `configs/scenes`, with their texts.
const BUILT_IN: [(&str, &str); 66] = [
    ("among-circular", include_str!("../configs/scenes/among-circular.toml")),
    ("among-clutter", include_str!("../configs/scenes/among-clutter.toml")),
    ("among-corridor", include_str!("../configs/scenes/among-corridor.toml")),
    ("among-crossing", include_str!("../configs/scenes/among-crossing.toml")),
    ("among-doorway", include_str!("../configs/scenes/among-doorway.toml")),
    ("approach", include_str!("../configs/scenes/approach.toml")),
    ("behind-glass", include_str!("../configs/scenes/behind-glass.toml")),
    ("behind-glass-sonar", include_str!("../configs/scenes/behind-glass-sonar.toml")),
    ("cafeteria", include_str!("../configs/scenes/cafeteria.toml")),
    ("cafeteria-high", include_str!("../configs/scenes/cafeteria-high.toml")),
    ("cheap-laser", include_str!("../configs/scenes/cheap-laser.toml")),
    ("coat-off", include_str!("../configs/scenes/coat-off.toml")),
    ("corridor", include_str!("../configs/scenes/corridor.toml")),
    ("corridor-high", include_str!("../configs/scenes/corridor-high.toml")),
    ("crossing", include_str!("../configs/scenes/crossing.toml")),
    ("crossing-four", include_str!("../configs/scenes/crossing-four.toml")),
    ("crossing-hidden", include_str!("../configs/scenes/crossing-hidden.toml")),
    ("crossing-oblique", include_str!("../configs/scenes/crossing-oblique.toml")),
    ("crossing-parallel", include_str!("../configs/scenes/crossing-parallel.toml")),
    ("crossing-three", include_str!("../configs/scenes/crossing-three.toml")),
    ("crowd", include_str!("../configs/scenes/crowd.toml")),
    ("daylight", include_str!("../configs/scenes/daylight.toml")),
    ("demo", include_str!("../configs/scenes/demo.toml")),
    ("empty-clutter", include_str!("../configs/scenes/empty-clutter.toml")),
    ("empty-real", include_str!("../configs/scenes/empty-real.toml")),
    ("follow-alike", include_str!("../configs/scenes/follow-alike.toml")),
    ("follow-around", include_str!("../configs/scenes/follow-around.toml")),
    ("follow-between", include_str!("../configs/scenes/follow-between.toml")),
    ("follow-child", include_str!("../configs/scenes/follow-child.toml")),
    ("follow-coat-stand", include_str!("../configs/scenes/follow-coat-stand.toml")),
    ("follow-corner", include_str!("../configs/scenes/follow-corner.toml")),
    ("follow-crowd", include_str!("../configs/scenes/follow-crowd.toml")),
    ("follow-crowd-ten", include_str!("../configs/scenes/follow-crowd-ten.toml")),
    ("follow-doors", include_str!("../configs/scenes/follow-doors.toml")),
    ("follow-dropped", include_str!("../configs/scenes/follow-dropped.toml")),
    ("follow-fast", include_str!("../configs/scenes/follow-fast.toml")),
    ("follow-gets-up", include_str!("../configs/scenes/follow-gets-up.toml")),
    ("follow-latency", include_str!("../configs/scenes/follow-latency.toml")),
    ("follow-passing", include_str!("../configs/scenes/follow-passing.toml")),
    ("follow-ramp", include_str!("../configs/scenes/follow-ramp.toml")),
    ("follow-return-15", include_str!("../configs/scenes/follow-return-15.toml")),
    ("follow-return-30", include_str!("../configs/scenes/follow-return-30.toml")),
    ("follow-return-5", include_str!("../configs/scenes/follow-return-5.toml")),
    ("follow-return-two", include_str!("../configs/scenes/follow-return-two.toml")),
    ("follow-step-in", include_str!("../configs/scenes/follow-step-in.toml")),
    ("follow-swap", include_str!("../configs/scenes/follow-swap.toml")),
    ("follow-tilt", include_str!("../configs/scenes/follow-tilt.toml")),
    ("follow-turns", include_str!("../configs/scenes/follow-turns.toml")),
    ("following", include_str!("../configs/scenes/following.toml")),
    ("full-occlusion", include_str!("../configs/scenes/full-occlusion.toml")),
    ("lidar-rings", include_str!("../configs/scenes/lidar-rings.toml")),
    ("lidar-rosette", include_str!("../configs/scenes/lidar-rosette.toml")),
    ("light-changes", include_str!("../configs/scenes/light-changes.toml")),
    ("mirrors", include_str!("../configs/scenes/mirrors.toml")),
    ("office", include_str!("../configs/scenes/office.toml")),
    ("office-high", include_str!("../configs/scenes/office-high.toml")),
    ("omni-hat", include_str!("../configs/scenes/omni-hat.toml")),
    ("omni-moving", include_str!("../configs/scenes/omni-moving.toml")),
    ("omni-people", include_str!("../configs/scenes/omni-people.toml")),
    ("omni-room", include_str!("../configs/scenes/omni-room.toml")),
    ("sample", include_str!("../configs/scenes/sample.toml")),
    ("square-walk", include_str!("../configs/scenes/square-walk.toml")),
    ("static-high", include_str!("../configs/scenes/static-high.toml")),
    ("stereo-follow-passing", include_str!("../configs/scenes/stereo-follow-passing.toml")),
    ("stereo-hall", include_str!("../configs/scenes/stereo-hall.toml")),
    ("turntable", include_str!("../configs/scenes/turntable.toml")),
];

/// Folder that the names stand for.
const FOLDER: &str = "configs/scenes";

/// Returns the text of the built-in scene that a path names: by its name alone, or as the file that
/// it is in a clone.
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
