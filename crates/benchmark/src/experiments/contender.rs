use tagalong_app::config_file::ConfigFile;
use tagalong_app::misfit::{Traits, misfit_note};
use tagalong_pipeline::Suits;
use tagalong_sim::{CameraKind, Scene};
use tagalong_trials::Contender;

/// Returns a config as a contender of trials.
pub fn contender(file: &ConfigFile) -> Contender {
    let folder = file.folder().to_owned();
    Contender { folder, ..Contender::new(file.stem(), file.whole_text()) }
}

/// Returns a note on a config and the scenes, by name, for which it is not suitable; `None` if it
/// suits all.
pub fn unsuited<'a>(
    config: &str,
    suits: &Suits,
    scenes: impl Iterator<Item = (&'a str, &'a Scene)>,
) -> Option<String> {
    let mut unsuited: Vec<(String, Vec<String>)> = Vec::new();
    for (name, scene) in scenes {
        let misfits = traits(scene).misfits(suits);
        // Among the variants of a scene, the first that does not fit represents all.
        match unsuited.iter_mut().find(|(other, _)| other == name) {
            Some((_, known)) if known.is_empty() => *known = misfits,
            Some(_) => {}
            None => unsuited.push((name.to_owned(), misfits)),
        }
    }
    misfit_note(config, &unsuited)
}

/// Returns the properties of a scene that `[suits]` can refer to.
fn traits(scene: &Scene) -> Traits {
    let camera = &scene.camera;
    let is_pair = camera.kind == CameraKind::Stereo;
    Traits {
        camera_height_m: Some(camera.height_m),
        pitch_down_deg: Some(camera.pitch_down_deg),
        baseline_m: is_pair.then_some(camera.baseline_m),
        has_odometry: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_config_for_other_cameras_has_one_note_for_all_its_scenes() {
        let low = Scene::parse("[camera]\nheight_m = 0.3\n").unwrap();
        let usual = Scene::parse("[camera]\nheight_m = 1.2\n").unwrap();
        let scenes = [("low", &usual), ("low", &low), ("low", &low), ("usual", &usual)];
        let suits = Suits { camera_height_m: Some([0.9, 2.0]), ..Suits::default() };
        let note = unsuited("depth", &suits, scenes.into_iter()).unwrap();
        assert_eq!(note.matches("0.30 m high").count(), 1, "{note}");
        assert!(!note.contains("usual"), "{note}");
        assert_eq!(unsuited("any", &Suits::default(), scenes.into_iter()), None);
    }
}
