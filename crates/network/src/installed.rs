//! Networks that a user has installed: ONNX files in the user's data folder, referred to by name.

use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};

/// Environment variable that names the folder of the user's data.
pub const DATA_FOLDER: &str = "TAGALONG_HOME";
/// Subfolder for networks.
const NETWORKS: &str = "networks";

/// Function that returns an environment variable by its name.
pub type Variables = fn(&str) -> Option<OsString>;

/// Returns the folder of installed networks: `networks` in the folder that `TAGALONG_HOME` names,
/// otherwise in `tagalong` of `XDG_DATA_HOME`, otherwise in `.local/share/tagalong` of the home
/// folder; `None` if none of them is known.
pub fn networks_folder() -> Option<PathBuf> {
    networks_folder_of(|name| std::env::var_os(name))
}

/// Returns the folder of installed networks for the given environment variables.
pub fn networks_folder_of(variable: Variables) -> Option<PathBuf> {
    let [own, shared, home] = [DATA_FOLDER, "XDG_DATA_HOME", "HOME"]
        .map(|name| variable(name).filter(|text| !text.is_empty()).map(PathBuf::from));
    // The XDG standard says that relative paths are to be ignored.
    let shared = shared.filter(|path| path.is_absolute());
    let data = own
        .or_else(|| Some(shared?.join("tagalong")))
        .or_else(|| Some(home?.join(".local/share/tagalong")))?;
    Some(data.join(NETWORKS))
}

/// Returns the file that the `model` of a config names: relative to the folder of the config or, if
/// there is no such file and `model` is a plain name, the installed network of this name. If
/// neither exists, the path in the folder of the config is returned.
pub fn model_file(folder: &Path, model: &str) -> PathBuf {
    let file = folder.join(model);
    if file.exists() || !is_name(model) {
        return file;
    }
    let installed = networks_folder().map(|networks| networks.join(format!("{model}.onnx")));
    installed.filter(|installed| installed.is_file()).unwrap_or(file)
}

/// Returns the names of the installed networks in alphabetical order.
pub(crate) fn installed_names() -> Vec<String> {
    let Some(folder) = networks_folder() else { return Vec::new() };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.extension().is_some_and(|ending| ending == "onnx") {
            names.extend(path.file_stem().and_then(|stem| stem.to_str()).map(str::to_owned));
        }
    }
    names.sort();
    names
}

/// Returns true for a text without folders and extension.
fn is_name(model: &str) -> bool {
    let path = Path::new(model);
    let mut parts = path.components();
    let is_one = matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None));
    is_one && path.extension().is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_is_that_of_the_user() {
        let share = Some("/users/ann/.local/share/tagalong/networks");
        let cases: [(Variables, Option<&str>); 5] = [
            (|name| (name == "HOME").then(|| "/users/ann".into()), share),
            (|name| (name != DATA_FOLDER).then(|| "/data".into()), Some("/data/tagalong/networks")),
            // A relative folder.
            (|name| (name == "XDG_DATA_HOME").then(|| "data".into()), None),
            // The folder of Tagalong before all others.
            (
                |name| Some(if name == DATA_FOLDER { "mine" } else { "/data" }.into()),
                Some("mine/networks"),
            ),
            // Empty variables.
            (|name| Some(if name == "HOME" { "/users/ann" } else { "" }.into()), share),
        ];
        for (variable, folder) in cases {
            assert_eq!(networks_folder_of(variable), folder.map(PathBuf::from));
        }
    }

    #[test]
    fn a_path_is_relative_to_the_config() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("plain"), "").unwrap();
        for model in ["people.onnx", "a/people", "plain", "not-installed", "/x/y.onnx"] {
            assert_eq!(model_file(folder.path(), model), folder.path().join(model), "{model}");
        }
    }

    #[test]
    fn a_name_has_neither_folder_nor_extension() {
        let names = ["yolox-nano", "yolox.onnx", "a/b", "..", "/a", ""].map(is_name);
        assert_eq!(names, [true, false, false, false, false, false]);
    }

    /// Runs itself again with a data folder: the environment is that of a process.
    #[test]
    fn a_plain_name_is_that_of_an_installed_network() {
        const TEST: &str = "installed::tests::a_plain_name_is_that_of_an_installed_network";
        const IS_INSIDE: &str = "TAGALONG_TEST_OF_INSTALLED_NETWORKS";
        let folder = tempfile::tempdir().expect("a folder");
        if std::env::var_os(IS_INSIDE).is_none() {
            let networks = folder.path().join(NETWORKS);
            std::fs::create_dir(&networks).expect("a folder within");
            std::fs::write(networks.join("people.onnx"), "").expect("a file");
            let program = std::env::current_exe().expect("the path of the tests");
            let mut again = std::process::Command::new(program);
            again.args(["--exact", TEST]).env(DATA_FOLDER, folder.path()).env(IS_INSIDE, "");
            let ran = again.output().expect("the tests run");
            assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stdout));
            return;
        }
        let networks = networks_folder().expect("the folder that is set");
        assert_eq!(installed_names(), ["people"]);
        assert_eq!(model_file(folder.path(), "people"), networks.join("people.onnx"));
        for other in ["others", "people.onnx"] {
            assert_eq!(model_file(folder.path(), other), folder.path().join(other));
        }
        let own = folder.path().join("people");
        std::fs::write(&own, "").expect("a file");
        assert_eq!(model_file(folder.path(), "people"), own, "the folder of the config first");
    }
}
