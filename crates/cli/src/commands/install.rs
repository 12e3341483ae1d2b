use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::json;
use sha2::{Digest, Sha256};
use tagalong_app::config_file::ConfigFile;
use tagalong_app::installed::{
    NetworkFiles, WITH_DEPTH, default_network, installed_embeddings, installed_networks,
};
use tagalong_app::outcome::{
    ANOTHER_OUTPUT, Ended, Failure, Outcome, make_folder, print, write_file,
};
use tagalong_config::{FileLimit, nearest, read_bytes, read_text};
use tagalong_network::{About, DATA_FOLDER, Limits, networks_folder};

use super::model::{Known, NetworkConfig, as_text};
use super::networks::{self, KnownNetwork};

/// Start of the line of a config with the time of a call.
const TIME: &str = "# time ";

/// Network that a user installs.
pub(super) struct Install<'a> {
    /// The ONNX file.
    pub(super) file: &'a Path,
    /// Name, if the user gives one.
    pub(super) name: Option<&'a str>,
    pub(super) about: &'a About,
    /// The family, or the length of a vector, after a first call.
    pub(super) known: &'a Known<'a>,
    /// Replace configs that were edited.
    pub(super) overwrite: bool,
}

impl Install<'_> {
    /// Copies the file into the folder of the user, with its config and its card.
    ///
    /// # Errors
    /// A name that is no plain word, or that another network has; a config that was edited, without
    /// `overwrite`; files that cannot be read or written.
    pub(super) fn run(&self) -> Outcome {
        let bytes = read_network(self.file)
            .map_err(|why| Failure::failed(format!("{}: {why}", self.file.display())))?;
        let sha256 = hash_of(&bytes);
        let published = networks::known_by_hash(&sha256);
        let name = self.name_or(published)?;
        let folder = folder()?;
        let files = NetworkFiles::of(&folder, &name);
        check_free(&files.onnx, &name, &sha256)?;
        let configs = self.configs(&files);
        for (path, text) in &configs {
            if !self.overwrite && is_edited(path, text) {
                let shown = path.display();
                return Err(Failure::usage(format!(
                    "{shown} was edited, or written by another version: --overwrite replaces it, and \
                     another --name keeps it"
                )));
            }
        }
        make_own_folder(&folder)?;
        write_own(&files.onnx, &bytes)?;
        write_own(&files.card, self.card(&name, &sha256, bytes.len(), published))?;
        let mut out = format!("installed: {}\n", files.onnx.display());
        match self.known {
            Known::Detector(known) => {
                for (path, text) in configs {
                    write_own(path, text)?;
                }
                write_own(&files.default, format!("{name}\n"))?;
                let family = known.family.networks();
                let ms = known.call_ms;
                let _ = writeln!(out, "family {} ({family}), {ms:.0} ms a call", known.family);
                let _ = writeln!(out, "`tagalong run LOG` takes it for a log with colour alone");
                let _ = writeln!(
                    out,
                    "`tagalong run {name}{WITH_DEPTH} LOG` joins it with depth, if a log has both"
                );
                let _ = writeln!(out, "a config names it: model = \"{name}\"");
            }
            Known::Embedding(known) => {
                let numbers = known.numbers;
                let ms = known.call_ms;
                let _ = writeln!(out, "re-identification, {numbers} numbers, {ms:.0} ms a person");
                let _ = writeln!(out, "a config names it: [appearance] model = \"{name}\"");
            }
        }
        if let Some(network) = published {
            let _ = writeln!(out, "licence {}: {}", network.licence, network.published);
        }
        print(&out)?;
        Ok(Ended::Well)
    }

    /// Returns the configs of the network with their texts; none for re-identification.
    fn configs<'b>(&self, files: &'b NetworkFiles) -> Vec<(&'b Path, String)> {
        if matches!(self.known, Known::Embedding(_)) {
            return Vec::new();
        }
        let file = PathBuf::from(files.onnx.file_name().unwrap_or_default());
        let mut configs = Vec::new();
        for (path, config) in
            [(&files.config, NetworkConfig::Colour), (&files.depth_config, NetworkConfig::Depth)]
        {
            configs.push((&**path, as_text(&file, self.about, Some(self.known), config)));
        }
        configs
    }

    fn name_or(&self, published: Option<&KnownNetwork>) -> Result<String, Failure> {
        let name = match (self.name, published) {
            (Some(name), _) => name.to_owned(),
            (None, Some(network)) => network.name.clone(),
            (None, None) => name_of(self.file),
        };
        let is_plain =
            name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
        if name.ends_with(WITH_DEPTH) {
            return Err(Failure::usage(format!(
                "the end of `{name}` is reserved for the config that joins a network with depth: \
                 give another --name"
            )));
        }
        if ConfigFile::built_in_names().any(|builtin| builtin == name) {
            return Err(Failure::usage(format!(
                "`{name}` is the name of a built-in config, which `run` takes: give another --name"
            )));
        }
        if name.is_empty() || !is_plain {
            return Err(Failure::usage(format!(
                "the name of a network has lower-case letters, digits and `-` only, unlike \
                 `{name}`: give another --name"
            )));
        }
        Ok(name)
    }

    fn card(
        &self,
        name: &str,
        sha256: &str,
        bytes: usize,
        published: Option<&KnownNetwork>,
    ) -> String {
        let file = self.file.file_name().unwrap_or_default().to_string_lossy();
        // A string of JSON is one of TOML; writing to a string cannot fail.
        let mut card = format!("name = {}\nfile = {}\n", json!(name), json!(file));
        let _ = write!(card, "bytes = {bytes}\nsha256 = \"{sha256}\"\n");
        match self.known {
            Known::Detector(known) => {
                let _ = writeln!(card, "family = \"{}\"", known.family);
                let _ = writeln!(card, "input = [{}, {}]", known.input.width, known.input.height);
            }
            Known::Embedding(known) => {
                let _ = writeln!(card, "numbers = {}", known.numbers);
            }
        }
        if let Some(network) = published {
            let _ = writeln!(card, "licence = {}", json!(network.licence));
            let _ = writeln!(card, "published = {}", json!(network.published));
        }
        card
    }
}

/// Removes an installed network with its configs and its card.
///
/// # Errors
/// A name that no installed network has (exit code 2), files that cannot be removed.
pub(super) fn remove(name: &str) -> Outcome {
    let folder = folder()?;
    let mut installed = installed_networks();
    installed.extend(installed_embeddings());
    if !installed.iter().any(|known| known == name) {
        let hint = match nearest(name, installed.iter().map(String::as_str)) {
            Some(best) => format!("; did you mean `{best}`?"),
            None if installed.is_empty() => "; none is installed".into(),
            None => format!("; installed: {}", installed.join(", ")),
        };
        return Err(Failure::usage(format!("no network is installed as `{name}`{hint}")));
    }
    let was_default = default_network().as_deref() == Some(name);
    let NetworkFiles { onnx, config, depth_config, card, default } =
        NetworkFiles::of(&folder, name);
    // The network last: until then an interrupted removal can be repeated.
    for file in [&card, &depth_config, &config, &onnx] {
        delete(file)?;
    }
    let mut out = format!("removed: {}\n", onnx.display());
    if was_default {
        delete(&default)?;
        let _ = match default_network() {
            Some(next) => writeln!(out, "`{next}` is now taken for a log with colour alone"),
            None => writeln!(out, "no network is left for a log with colour alone"),
        };
    }
    print(&out)?;
    Ok(Ended::Well)
}

/// Deletes a file, if it is there.
fn delete(file: &Path) -> Result<(), Failure> {
    match fs::remove_file(file) {
        Err(why) if why.kind() != io::ErrorKind::NotFound => {
            Err(Failure::failed(format!("cannot remove {}: {why}", file.display())))
        }
        _ => Ok(()),
    }
}

/// Returns the folder of installed networks.
fn folder() -> Result<PathBuf, Failure> {
    networks_folder().ok_or_else(|| {
        Failure::failed(format!("no folder for networks is known: set {DATA_FOLDER} to one"))
    })
}

/// Makes the folder of installed networks. No option names it.
fn make_own_folder(folder: &Path) -> Result<(), Failure> {
    make_folder(folder).map_err(|why| Failure {
        message: why.message.replace(
            ANOTHER_OUTPUT,
            &format!("set the variable {DATA_FOLDER} to a folder that can be written"),
        ),
        ..why
    })
}

/// Writes a file into the folder of installed networks.
fn write_own(path: &Path, content: impl AsRef<[u8]>) -> Result<(), Failure> {
    write_file(path, content).map_err(|why| Failure {
        message: format!("{}; {DATA_FOLDER} can name another folder for networks", why.message),
        ..why
    })
}

/// Returns true for a file whose text is another one than that which was written into it.
fn is_edited(path: &Path, written: &str) -> bool {
    // The time of a call is another one each time.
    fn lasting(text: &str) -> Vec<&str> {
        text.lines().filter(|line| !line.starts_with(TIME)).collect()
    }

    let Ok(present) = read_text(path, FileLimit::Config) else { return path.exists() };
    lasting(&present) != lasting(written)
}

/// Refuses a name that another network has.
fn check_free(file: &Path, name: &str, sha256: &str) -> Result<(), Failure> {
    match read_network(file) {
        Ok(present) if hash_of(&present) != sha256 => Err(Failure::failed(format!(
            "another network is installed as `{name}` ({}): give another --name, or `tagalong model --remove {name}` first",
            file.display()
        ))),
        _ => Ok(()),
    }
}

/// Reads the bytes of a network.
///
/// # Errors
/// A file that cannot be read, or that is larger than networks may be.
pub(super) fn read_network(file: &Path) -> io::Result<Vec<u8>> {
    read_bytes(file, FileLimit::Bytes(Limits::default().file_bytes))
}

/// Returns the SHA-256 of bytes in hexadecimal digits.
pub(super) fn hash_of(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the name of a file as that of a network: `yolox-s` of `YOLOX_s.onnx`.
fn name_of(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_config_is_edited_where_more_than_the_time_of_a_call_differs() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("net.toml");
        assert!(!is_edited(&path, "a = 1\n"), "a file that is not there");
        fs::write(&path, "# time     3.1 ms a call\na = 1\n").unwrap();
        assert!(!is_edited(&path, "# time     2.9 ms a call\na = 1\n"));
        assert!(is_edited(&path, "# time     3.1 ms a call\na = 2\n"));
    }

    #[test]
    fn a_folder_that_cannot_be_made_names_its_variable() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("file"), "").unwrap();
        let why = make_own_folder(&home.path().join("file/networks")).unwrap_err().message;
        assert!(why.contains(DATA_FOLDER) && !why.contains("-o"), "{why}");
        // A folder in the place of the file cannot be written either.
        let why = write_own(home.path(), "").unwrap_err().message;
        assert!(why.contains(DATA_FOLDER), "{why}");
    }

    #[test]
    fn a_file_gives_a_plain_name() {
        assert_eq!(name_of(Path::new("models/YOLOX_s.v2.onnx")), "yolox-s-v2");
    }
}
