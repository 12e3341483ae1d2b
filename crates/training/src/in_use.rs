//! Pipelines for which a verifier is trained: one for colour and depth, one for stereo pairs.

use std::path::Path;

use tagalong_app::outcome::Failure;
use tagalong_config::{FileLimit, Registry, read_text};
use tagalong_pipeline::Pipeline;
use tagalong_sim::CameraKind;
use tagalong_stereo::StereoSettings;
use toml::{Table, Value};

const RGBD: &str = include_str!("../configs/depth-ekf.toml");
const STEREO: &str = include_str!("../configs/stereo-verified.toml");
/// Changes of the config for collecting candidates.
const PROPOSING: &str = include_str!("proposing.toml");

/// Config of the pipeline, without verifiers and controller.
pub struct InUse {
    config: Table,
    /// True if the thresholds are lowered, so that more candidates are proposed.
    is_lowered: bool,
}

impl InUse {
    /// Returns the config for a kind of camera.
    ///
    /// # Errors
    /// A config that is not TOML.
    pub fn of(kind: CameraKind) -> Result<Self, Failure> {
        let text = if kind == CameraKind::Stereo { STEREO } else { RGBD };
        let config = text.parse().map_err(Failure::failed)?;
        Ok(Self { config: without_verifiers(config), is_lowered: true })
    }

    /// Returns the config of a file, with its own thresholds, for any camera.
    ///
    /// # Errors
    /// A file that cannot be read or is not TOML.
    pub fn as_it_is(path: &Path) -> Result<Self, Failure> {
        Ok(Self { config: without_verifiers(read_table(path)?), is_lowered: false })
    }

    /// Returns the settings for depth from a stereo pair.
    ///
    /// # Errors
    /// Invalid settings.
    pub fn stereo(&self) -> Result<StereoSettings, Failure> {
        let settings = self.config.get("stereo").cloned().unwrap_or_else(|| Table::new().into());
        settings.try_into().map_err(Failure::failed)
    }

    /// Returns the config with its own thresholds.
    pub fn plain(&self) -> String {
        self.config.to_string()
    }

    /// Returns the config with a verifier.
    pub fn verified(&self, plugin: &str, settings: Table) -> String {
        let verifier = Table::from_iter([
            ("plugin".to_owned(), Value::from(plugin)),
            ("config".to_owned(), settings.into()),
        ]);
        let mut config = self.config.clone();
        config.insert("verifiers".to_owned(), vec![verifier].into());
        config.to_string()
    }

    /// Returns the config with thresholds so low that it proposes many candidates.
    ///
    /// # Errors
    /// A config without a detector.
    pub fn proposing(&self) -> Result<String, Failure> {
        let mut low: Table = PROPOSING.parse().map_err(Failure::failed)?;
        let mut config = self.config.clone();
        if !self.is_lowered {
            low.remove("detector");
        }
        let detector = config
            .get_mut("detectors")
            .and_then(|all| all.get_mut(0))
            .and_then(Value::as_table_mut)
            .ok_or_else(|| Failure::failed("the config in use has no detector"))?;
        let settings = detector.entry("config").or_insert_with(|| Table::new().into());
        if let (Some(settings), Some(Value::Table(low))) =
            (settings.as_table_mut(), low.remove("detector"))
        {
            settings.extend(low);
        }
        config.extend(low);
        Ok(config.to_string())
    }
}

/// Reads a file of TOML; a failure names the file.
pub(super) fn read_table(path: &Path) -> Result<Table, Failure> {
    let text = read_text(path, FileLimit::Config).map_err(|error| error.to_string());
    text.and_then(|text| text.parse().map_err(|error: toml::de::Error| error.to_string()))
        .map_err(|why| Failure::usage(format!("{}: {why}", path.display())))
}

/// Builds a pipeline from the text of its config.
///
/// # Errors
/// A mistake in the config: exit code 2.
pub fn pipeline(text: &str, registry: &Registry) -> Result<Pipeline, Failure> {
    Ok(Pipeline::builder(registry).from_toml(text)?)
}

fn without_verifiers(mut config: Table) -> Table {
    config.retain(|key, _| key != "verifiers" && key != "controller");
    config
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_config_of_a_file_proposes_what_it_proposes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("own.toml");
        let text = "[[detectors]]\nplugin = \"depth-template\"\n\
            config = { discover_cost = 0.1 }\n[[verifiers]]\nplugin = \"svm-patch\"\n";
        fs::write(&path, text).unwrap();
        let proposing: Table =
            InUse::as_it_is(&path).unwrap().proposing().unwrap().parse().unwrap();
        let cost = proposing["detectors"][0]["config"]["discover_cost"].as_float();
        assert_eq!(cost, Some(0.1));
        assert!(!proposing.contains_key("verifiers") && proposing.contains_key("manager"));
        let failure = InUse::as_it_is(&folder.path().join("none.toml")).err().unwrap();
        assert!(failure.message.contains("none.toml"), "{}", failure.message);
    }

    #[test]
    fn what_proposes_is_the_detector_in_use_with_lower_thresholds() {
        fn of(text: String) -> Value {
            let config: Table = text.parse().unwrap();
            let settings = config["detectors"][0].get("config").cloned();
            settings.unwrap_or_else(|| Table::new().into())
        }

        fn cost(config: &Value) -> Option<f64> {
            config.get("discover_cost").and_then(Value::as_float)
        }

        for kind in [CameraKind::Rgbd, CameraKind::Stereo] {
            let in_use = InUse::of(kind).unwrap();
            let plain = of(in_use.plain());
            let low = of(in_use.proposing().unwrap());
            assert!(cost(&low) > cost(&plain).or(Some(0.16)));
            assert_eq!(low.get("even_cost"), plain.get("even_cost"), "{kind:?}");
        }
    }

    #[test]
    fn pairs_are_matched_as_they_are_in_use() {
        let stereo = InUse::of(CameraKind::Stereo).unwrap().stereo().unwrap();
        assert_ne!(stereo, StereoSettings::default());
        assert_eq!(
            InUse::of(CameraKind::Rgbd).unwrap().stereo().unwrap(),
            StereoSettings::default()
        );
    }

    #[test]
    fn a_verifier_is_added_to_none() {
        let in_use = InUse::of(CameraKind::Stereo).unwrap();
        assert!(!in_use.plain().contains("verifiers"));
        let text = in_use.verified("svm-patch", Table::new());
        assert_eq!(
            text.parse::<Table>().unwrap()["verifiers"][0]["plugin"].as_str(),
            Some("svm-patch")
        );
    }
}
