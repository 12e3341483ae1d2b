//! Origin of a run: the paths of its log and its config.

use std::path::{Path, PathBuf, absolute};

use serde::{Deserialize, Serialize};
use tagalong_config::path_text;

/// Contents of `origin.json`, the only file of a run that depends on the folder of its log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Origin {
    /// Path of the log.
    #[serde(with = "path_text")]
    pub log: PathBuf,
    /// Path of the config, or the name of a built-in one; `None` if the program chose it.
    #[serde(with = "path_text::optional")]
    pub config: Option<PathBuf>,
}

impl Origin {
    /// Records the paths, independently of the current folder.
    pub fn of(log: &Path, config: Option<&Path>) -> Self {
        let config =
            config.map(|config| if config.exists() { whole(config) } else { config.into() });
        Self { log: whole(log), config }
    }
}

/// Returns the absolute path, or the path unchanged if the current folder is unknown.
fn whole(path: &Path) -> PathBuf {
    absolute(path).unwrap_or_else(|_| path.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_do_not_depend_on_the_current_folder() {
        let origin = Origin::of(Path::new("a/b.mcap"), Some(Path::new("depth-ekf")));
        assert!(origin.log.is_absolute() && origin.log.ends_with("a/b.mcap"), "{origin:?}");
        assert_eq!(origin.config, Some("depth-ekf".into()), "a built-in config has no path");
    }
}
