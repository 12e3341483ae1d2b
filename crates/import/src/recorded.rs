//! Config for the detections that come with a sequence.

use std::path::Path;

use tagalong_app::outcome::Failure;
use toml::Table;

/// The shipped config, of which only a few lines are replaced.
const SHIPPED: &str = include_str!("../configs/recorded.toml");

/// Returns the config that tracks the whole bodies of a `det.txt`.
///
/// # Errors
/// A path that cannot be made absolute.
pub fn config(detections: &Path) -> Result<String, Failure> {
    let whole = detections.canonicalize().map_err(|error| {
        Failure::failed(format!("cannot read {}: {error}", detections.display()))
    })?;
    let mut root: Table = SHIPPED.parse().map_err(Failure::failed)?;
    // The boxes are in the file, and no setting is to be chosen here.
    root.remove("input");
    root.remove("tune");
    let detectors = root.get_mut("detectors").and_then(toml::Value::as_array_mut);
    for detector in detectors.into_iter().flatten() {
        if let Some(config) = detector.get_mut("config").and_then(toml::Value::as_table_mut) {
            config.insert("path".into(), whole.display().to_string().into());
            config.insert("body".into(), "full-box".into());
        }
    }
    let text = toml::to_string(&root).map_err(Failure::failed)?;
    Ok(format!(
        "# configs/recorded.toml for the detections of one sequence, whole bodies.\n\n{text}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_config_gets_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("det.txt");
        std::fs::write(&file, "").unwrap();
        let root: Table = config(&file).unwrap().parse().unwrap();
        let shipped: Table = SHIPPED.parse().unwrap();
        let detector = &root["detectors"][0]["config"];
        assert!(Path::new(detector["path"].as_str().unwrap()).is_absolute());
        assert_eq!(detector["body"].as_str(), Some("full-box"));
        assert_eq!(detector["min_score"], shipped["detectors"][0]["config"]["min_score"]);
        assert_eq!((root.get("filter"), root.get("input")), (shipped.get("filter"), None));
        assert!(config(&folder.path().join("none.txt")).is_err());
    }
}
