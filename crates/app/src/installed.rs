//! Networks that the user has installed, with their configs.
//!
//! For each network, the folder of networks contains the file `NAME.onnx`, its config `NAME.toml`,
//! the config `NAME-depth.toml` that combines it with depth, and its card `NAME.card.toml`. The
//! file `default` names the network that is used for a log with colour alone.

use std::fs;
use std::path::{Path, PathBuf};

use tagalong_config::{FileLimit, read_text};
use tagalong_network::networks_folder;

/// Name of the config of the default network.
pub const NETWORK: &str = "network";
/// Table of networks that are known to work, as TOML. Its figures come from the command that it
/// names.
pub const KNOWN_NETWORKS: &str = include_str!("networks.toml");
/// File with the name of the default network.
const DEFAULT: &str = "default";
/// Config of the repository that combines the network in a file with depth.
const OF_A_FILE_AND_DEPTH: &str = "depth-network";
/// Configs of the repository that are not built in, because they run the network in a file.
const OF_A_FILE: [&str; 3] = ["colour-net", OF_A_FILE_AND_DEPTH, "onnx"];
/// Suffix of the name of a config that combines a network with depth.
pub const WITH_DEPTH: &str = "-depth";

/// Files of a network in a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NetworkFiles {
    /// The network.
    pub onnx: PathBuf,
    /// Config that runs it.
    pub config: PathBuf,
    /// Config that combines it with depth.
    pub depth_config: PathBuf,
    /// Card with its hash and licence.
    pub card: PathBuf,
    /// File with the name of the default network.
    pub default: PathBuf,
}

impl NetworkFiles {
    /// Returns the files of the network with this name.
    pub fn of(folder: &Path, name: &str) -> Self {
        Self {
            onnx: folder.join(format!("{name}.onnx")),
            config: folder.join(format!("{name}.toml")),
            depth_config: folder.join(format!("{name}{WITH_DEPTH}.toml")),
            card: folder.join(format!("{name}.card.toml")),
            default: folder.join(DEFAULT),
        }
    }
}

/// Returns the config of an installed network by its name; with the suffix [`WITH_DEPTH`] the
/// config that combines it with depth, and for [`NETWORK`] that of the default network. `None` if
/// there is none.
pub fn config_file(name: &str) -> Option<PathBuf> {
    config_in(&networks_folder()?, name)
}

fn config_in(folder: &Path, name: &str) -> Option<PathBuf> {
    let installed = installed_in(folder);
    if name == NETWORK {
        return Some(NetworkFiles::of(folder, &default_in(folder, &installed)?).config);
    }
    let network = name.strip_suffix(WITH_DEPTH).unwrap_or(name);
    let files = NetworkFiles::of(folder, installed.iter().find(|known| *known == network)?);
    let config = if network == name { files.config } else { files.depth_config };
    config.is_file().then_some(config)
}

/// Returns the remedy for a name of a network's config that does not exist; `None` for any other
/// name.
pub fn missing_network(name: &str) -> Option<String> {
    remedy(&installed_networks(), name)
}

fn remedy(installed: &[String], name: &str) -> Option<String> {
    let network = name.strip_suffix(WITH_DEPTH).unwrap_or(name);
    let is_installed = installed.iter().any(|known| known == network);
    if let Some(file) = known_file(network).filter(|_| !is_installed) {
        return Some(format!(
            "`{name}` runs a known network that is not installed: `tagalong model --install \
             {file}` installs it, and `tagalong model --list` says where to get the file"
        ));
    }
    if name != NETWORK && !OF_A_FILE.contains(&name) {
        return None;
    }
    let Some(first) = installed.first() else {
        return Some(format!(
            "`{name}` runs a neural network, and none is installed: `tagalong model --install FILE.onnx` \
             installs one, and `tagalong model --list` names some"
        ));
    };
    let with_depth = if name == OF_A_FILE_AND_DEPTH { WITH_DEPTH } else { "" };
    Some(format!(
        "`{name}` runs a neural network from a file, and is not built in: name an installed one, \
         such as `{first}{with_depth}`"
    ))
}

/// Returns the remedy for settings whose `model` is a known network that is not installed; `None`
/// if there is none.
pub fn missing_model(settings: &toml::Table) -> Option<String> {
    let installed = [installed_networks(), installed_embeddings()].concat();
    models(settings).into_iter().find_map(|model| {
        let is_missing = known_file(model).is_some() && !installed.iter().any(|it| it == model);
        is_missing.then(|| remedy(&installed, model))?
    })
}

/// Returns the values of all keys `model`, including those in nested tables.
fn models(settings: &toml::Table) -> Vec<&str> {
    let mut found = Vec::new();
    for (key, value) in settings {
        match value {
            toml::Value::String(name) if key == "model" => found.push(name.as_str()),
            toml::Value::Table(table) => found.extend(models(table)),
            toml::Value::Array(items) => {
                found.extend(items.iter().filter_map(toml::Value::as_table).flat_map(models));
            }
            _ => {}
        }
    }
    found
}

/// Returns the file name of a known network.
fn known_file(name: &str) -> Option<String> {
    let table: toml::Table = toml::from_str(KNOWN_NETWORKS).ok()?;
    let networks = table.get("network")?.as_array()?;
    let named = networks.iter().find(|it| it.get("name").and_then(|it| it.as_str()) == Some(name));
    named?.get("file")?.as_str().map(str::to_owned)
}

/// Returns the names of the installed networks that have a config, in alphabetical order.
pub fn installed_networks() -> Vec<String> {
    networks_folder().map(|folder| installed_in(&folder)).unwrap_or_default()
}

/// Returns the names of the installed networks without a config, which are those for
/// re-identification, in alphabetical order.
pub fn installed_embeddings() -> Vec<String> {
    networks_folder().map(|folder| onnx_files(&folder, false)).unwrap_or_default()
}

/// Returns the names of all configs of installed networks.
pub fn installed_configs() -> Vec<String> {
    let mut names = Vec::new();
    for name in installed_networks() {
        names.push(format!("{name}{WITH_DEPTH}"));
        names.push(name);
    }
    names
}

/// Returns the name of the network that is used for a log with colour alone.
pub fn default_network() -> Option<String> {
    let folder = networks_folder()?;
    default_in(&folder, &installed_in(&folder))
}

fn installed_in(folder: &Path) -> Vec<String> {
    onnx_files(folder, true)
}

/// Returns the names of the networks in a folder that have a config, or of those that have none.
fn onnx_files(folder: &Path, with_config: bool) -> Vec<String> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut names = Vec::new();
    for entry in entries.flatten() {
        let path = entry.path();
        let is_network = path.extension().is_some_and(|ending| ending == "onnx");
        if is_network && path.with_extension("toml").is_file() == with_config {
            names.extend(path.file_stem().and_then(|stem| stem.to_str()).map(str::to_owned));
        }
    }
    names.sort();
    names
}

/// Returns the network that the file `default` names, or otherwise the first one.
fn default_in(folder: &Path, installed: &[String]) -> Option<String> {
    let named = read_text(&folder.join(DEFAULT), FileLimit::Config).unwrap_or_default();
    let named = installed.iter().find(|name| *name == named.trim());
    named.or(installed.first()).cloned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_is_found_by_its_name_and_the_default_one_without() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path();
        assert_eq!(config_in(&folder.join("none"), NETWORK), None);
        for name in ["yolox", "movenet"] {
            let files = NetworkFiles::of(folder, name);
            fs::write(files.onnx, "").unwrap();
            fs::write(files.config, "").unwrap();
        }
        fs::write(folder.join("alone.onnx"), "").unwrap();
        assert_eq!(config_in(folder, "yolox"), Some(folder.join("yolox.toml")));
        assert_eq!(config_in(folder, "alone"), None, "an embedding has no config");
        assert_eq!(
            config_in(folder, "yolox-depth"),
            None,
            "a network that was installed before there were any"
        );
        let with_depth = folder.join("yolox-depth.toml");
        fs::write(&with_depth, "").unwrap();
        assert_eq!(config_in(folder, "yolox-depth"), Some(with_depth));
        assert_eq!(config_in(folder, "other-depth"), None);
        assert_eq!(config_in(folder, NETWORK), Some(folder.join("movenet.toml")), "the first");
        fs::write(folder.join(DEFAULT), "yolox\n").unwrap();
        assert_eq!(config_in(folder, NETWORK), Some(folder.join("yolox.toml")));
        fs::write(folder.join(DEFAULT), "removed").unwrap();
        assert_eq!(config_in(folder, NETWORK), Some(folder.join("movenet.toml")));
        assert_eq!(installed_in(folder), ["movenet", "yolox"]);
        assert_eq!(onnx_files(folder, false), ["alone"]);
    }

    #[test]
    fn a_known_network_that_is_not_installed_is_told_apart_from_a_mistyped_name() {
        for name in ["yolox-nano", "yolox-nano-depth"] {
            let why = remedy(&["other".to_owned()], name).unwrap();
            assert!(why.contains("`tagalong model --install yolox_nano.onnx`"), "{why}");
        }
        assert_eq!(remedy(&[], "yolox-nan"), None);
        assert_eq!(remedy(&["yolox-nano".to_owned()], "yolox-nano-depth"), None);
    }

    #[test]
    fn a_model_is_found_in_any_table_of_a_config() {
        let text = "model = 'a'\nnamed = 'b'\n[appearance]\nmodel = 'c'\n[[detectors]]\n\
                    [detectors.config]\nmodel = 'd'\n";
        assert_eq!(models(&text.parse().unwrap()), ["c", "d", "a"]);
    }

    #[test]
    fn the_name_of_a_config_for_networks_leads_to_one_that_is_installed() {
        assert_eq!(remedy(&[], "depth-ekf"), None);
        for name in ["colour-net", "depth-network", "onnx", NETWORK] {
            let none = remedy(&[], name).unwrap();
            assert!(none.contains(name) && none.contains("`tagalong model --install"), "{none}");
        }
        let installed = ["movenet".to_owned()];
        let named = remedy(&installed, "colour-net").unwrap();
        assert!(named.contains("`movenet`"), "{named}");
        let named = remedy(&installed, "depth-network").unwrap();
        assert!(named.contains("`movenet-depth`"), "{named}");
    }
}
