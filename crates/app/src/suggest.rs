//! Suggestions for a mistyped or unusable path.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use tagalong_config::nearest;
use tagalong_log::LogFiles;

use crate::config_file::ConfigFile;
use crate::outcome::Failure;

/// Returns "; did you mean `configs/depth-ekf.toml`?", or the names of the configs that there are.
pub fn config_hint(wanted: &Path) -> String {
    let folders = [wanted.parent().unwrap_or(Path::new("")).to_owned(), PathBuf::from("configs")];
    let files: Vec<PathBuf> = folders.iter().flat_map(|folder| toml_files(folder)).collect();
    let names: Vec<&str> = files.iter().filter_map(|f| f.file_stem()?.to_str()).collect();
    let stem = wanted.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    let built_in: Vec<&str> = ConfigFile::built_in_names().collect();
    let best = nearest(stem, names.iter().chain(&built_in).copied());
    let Some(best) = best else {
        // Of a folder that was named all files may be meant; TOML files lie about in many others.
        let named = if folders[0].as_os_str().is_empty() { &[][..] } else { &names };
        let mut known: Vec<&str> = named.iter().chain(&built_in).copied().collect();
        known.sort_unstable();
        known.dedup();
        return format!("; there are: {}", known.join(", "));
    };
    match files.iter().find(|f| f.file_stem().is_some_and(|s| s == best)) {
        Some(file) => format!("; did you mean `{}`?", file.display()),
        None => format!("; did you mean `{best}`, which is built in?"),
    }
}

/// Returns the TOML files of a folder, by name.
pub fn toml_files(folder: &Path) -> Vec<PathBuf> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let Ok(entries) = fs::read_dir(here) else { return Vec::new() };
    let mut files: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| folder.join(entry.file_name()))
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        // In a Rust workspace, `Cargo.toml` is the only TOML file that is never a config.
        .filter(|path| path.file_name().is_none_or(|n| n != "Cargo.toml"))
        .collect();
    // The order of a directory depends on the file system.
    files.sort();
    files
}

/// Refuses a path that cannot be a log, with a remedy.
///
/// # Errors
/// A missing file, or a directory that is not one log.
pub fn check_log_path(path: &Path) -> Result<(), Failure> {
    let shown = path.display();
    if !path.exists() {
        return Err(Failure::failed(format!("{shown}: no such file{}", log_hint(path))));
    }
    if path.is_dir() {
        // Accepts a folder whose files are the parts of one log.
        let Err(error) = LogFiles::of(path) else { return Ok(()) };
        let hint = match mcap_files(path).unwrap_or_default().first() {
            Some(file) => format!("give a file in it, for example {}", file.display()),
            None => format!("and {error}"),
        };
        return Err(Failure::failed(format!("{shown} is a directory; {hint}")));
    }
    Ok(())
}

/// Returns the MCAP files of a folder, by name.
///
/// # Errors
/// A folder that cannot be read.
pub fn mcap_files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder)?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "mcap"))
        .collect();
    files.sort();
    Ok(files)
}

fn log_hint(wanted: &Path) -> String {
    let folder = wanted.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let files = mcap_files(folder).unwrap_or_default();
    let names: Vec<&str> = files.iter().filter_map(|f| f.file_name()?.to_str()).collect();
    let name = wanted.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    nearest(name, names).map_or(String::new(), |best| {
        format!("; did you mean `{}`?", wanted.with_file_name(best).display())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_config_is_answered_with_the_nearest_file() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("depth-ekf.toml"), "").unwrap();
        fs::write(home.path().join("other.toml"), "").unwrap();
        let hint = config_hint(&home.path().join("dept-ekf.toml"));
        assert!(hint.contains("did you mean") && hint.contains("depth-ekf.toml"), "{hint}");
        let hint = config_hint(&home.path().join("zzzzzzzz.toml"));
        assert!(hint.contains(", depth-ekf, ") && hint.contains(", other, "), "{hint}");
        let hint = config_hint(&home.path().join("follow-lov.toml"));
        assert!(hint.contains("did you mean `follow-low`"), "{hint}");
    }

    #[test]
    fn a_directory_and_a_missing_log_are_answered_with_what_is_there() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("robot.mcap"), "x").unwrap();
        assert!(check_log_path(home.path()).is_ok(), "a folder of one file is one log");
        fs::write(home.path().join("other.mcap"), "x").unwrap();
        let failure = check_log_path(home.path()).unwrap_err();
        assert!(failure.message.contains("other.mcap"), "{}", failure.message);
        let failure = check_log_path(&home.path().join("robto.mcap")).unwrap_err();
        assert!(failure.message.contains("did you mean"), "{}", failure.message);
        assert_eq!(failure.code, 1);
    }
}
