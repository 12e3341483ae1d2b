//! Suggestions for a mistyped or unusable path.

use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use tagalong_config::nearest;
use tagalong_log::LogFiles;

use crate::config_file::ConfigFile;
use crate::installed::installed_configs;
use crate::outcome::Failure;

/// Extensions of logs.
pub const LOG_ENDINGS: [&str; 3] = ["mcap", "db3", "bag"];

/// Magic bytes of MCAP files, of SQLite files and of ROS 1 bags.
const LOG_MAGICS: [&[u8]; 3] = [b"\x89MCAP", b"SQLite format 3\0", b"#ROSBAG"];
/// Length of the longest of [`LOG_MAGICS`], bytes.
const LONGEST_MAGIC: u64 = 16;

/// Returns "; did you mean `configs/depth-ekf.toml`?", or the names of the existing configs. A
/// single path that is not a config may also be a mistyped log.
pub fn config_hint(wanted: &Path) -> String {
    // A config has the extension `toml` or, if it is built in, none.
    let is_config = wanted.extension().is_none_or(|ending| ending == "toml");
    if let Some(log) = nearest_log(wanted).filter(|_| !is_config) {
        return format!("; did you mean the log `{}`?", log.display());
    }
    let folders = [wanted.parent().unwrap_or(Path::new("")).to_owned(), PathBuf::from("configs")];
    let files: Vec<PathBuf> = folders.iter().flat_map(|folder| toml_files(folder)).collect();
    let names: Vec<&str> = files.iter().filter_map(|f| f.file_stem()?.to_str()).collect();
    let stem = wanted.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    let built_in: Vec<&str> = ConfigFile::built_in_names().collect();
    let installed = installed_configs();
    if let Some(best) = nearest_installed(stem, &installed, names.iter().chain(&built_in).copied())
    {
        return format!("; did you mean `{best}`, which is an installed network?");
    }
    let best = nearest(stem, names.iter().chain(&built_in).copied());
    let Some(best) = best else {
        // If a folder was named, all of its files are candidates; many other folders contain
        // unrelated TOML files.
        let named = if folders[0].as_os_str().is_empty() { &[][..] } else { &names };
        let mut known: Vec<&str> = named.iter().chain(&built_in).copied().collect();
        known.extend(installed.iter().map(String::as_str));
        known.sort_unstable();
        known.dedup();
        return format!("; there are: {}", known.join(", "));
    };
    match files.iter().find(|f| f.file_stem().is_some_and(|s| s == best)) {
        Some(file) => format!("; did you mean `{}`?", file.display()),
        None => format!("; did you mean `{best}`, which is built in?"),
    }
}

/// Returns the problem and the remedy for a log or a network in place of a config; `None` for any
/// other path.
pub fn not_a_config(path: &Path) -> Option<String> {
    let shown = path.display();
    let ending = ending_of(path).unwrap_or_default();
    let is_log = if path.is_dir() {
        LogFiles::of(path).is_ok()
    } else {
        path.is_file() && (LOG_ENDINGS.contains(&ending.as_str()) || starts_as_log(path))
    };
    if is_log {
        return Some(format!("{shown} is a log, not a config: the order is CONFIG LOG"));
    }
    (ending == "onnx" && path.is_file()).then(|| {
        format!(
            "{shown} is a network, not a config: `tagalong model --install {shown}` makes a config of \
             it, and prints its name"
        )
    })
}

/// Returns true for a file that begins like those of recorders.
fn starts_as_log(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let mut start = Vec::new();
    let read = file.take(LONGEST_MAGIC).read_to_end(&mut start);
    read.is_ok() && LOG_MAGICS.iter().any(|magic| start.starts_with(magic))
}

/// Returns the config of an installed network whose name is most similar to a mistyped one; `None`
/// if that of another config is as similar.
fn nearest_installed<'a>(
    wanted: &str,
    installed: &'a [String],
    others: impl Iterator<Item = &'a str>,
) -> Option<&'a str> {
    // Of equally similar names the first one is taken.
    let best = nearest(wanted, others.chain(installed.iter().map(String::as_str)))?;
    installed.iter().map(String::as_str).find(|name| *name == best)
}

/// Returns the TOML files of a folder, by name.
pub fn toml_files(folder: &Path) -> Vec<PathBuf> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let Ok(files) = files_in(here) else { return Vec::new() };
    files
        .iter()
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .filter_map(|path| path.file_name())
        // In a Rust workspace, `Cargo.toml` is the only TOML file that is never a config.
        .filter(|name| *name != "Cargo.toml")
        .map(|name| folder.join(name))
        .collect()
}

/// Rejects a path that cannot be a log, with a remedy.
///
/// # Errors
/// A missing file, the folder of a run, or a directory that is not one log.
pub fn check_log_path(path: &Path) -> Result<(), Failure> {
    let shown = path.display();
    if !path.exists() {
        return Err(Failure::failed(format!("{shown}: no such file{}", log_hint(path))));
    }
    if is_run(path) {
        return Err(Failure::usage(format!(
            "{shown} is a run, not a log: `tagalong view {shown}` shows it"
        )));
    }
    if path.is_dir() {
        // Accepts a folder whose files are the parts of one log.
        let Err(error) = LogFiles::of(path) else { return Ok(()) };
        let message = match mcap_files(path).unwrap_or_default().first() {
            Some(file) => {
                format!("{shown} is a directory; give a file in it, for example {}", file.display())
            }
            None if has_images(path) => format!(
                "{shown} is a folder of images; `tagalong import images {shown} --fps 15 --view 69` \
                 makes a log of it (frames per second, and angle of view in degrees)"
            ),
            None => error.to_string(),
        };
        return Err(Failure::failed(message));
    }
    Ok(())
}

/// Returns true for the folder of a run, as `tagalong run` writes it.
pub fn is_run(folder: &Path) -> bool {
    ["tracks.mcap", "report.json"].iter().all(|name| folder.join(name).is_file())
}

/// Returns the runs in a folder, by name; empty for a path that is not a folder.
pub fn runs_in(folder: &Path) -> Vec<PathBuf> {
    let mut runs = files_in(folder).unwrap_or_default();
    runs.retain(|path| is_run(path));
    runs
}

/// Returns the MCAP files of a folder, by name.
///
/// # Errors
/// A folder that cannot be read.
pub fn mcap_files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = files_in(folder)?;
    files.retain(|path| path.extension().is_some_and(|ending| ending == "mcap"));
    Ok(files)
}

/// Returns true for a folder with an image that `tagalong import images` reads.
fn has_images(folder: &Path) -> bool {
    fn is_image(ending: &str) -> bool {
        ["jpg", "jpeg", "png"].contains(&ending)
    }

    let files = files_in(folder).unwrap_or_default();
    files.iter().any(|file| ending_of(file).is_some_and(|ending| is_image(&ending)))
}

fn log_hint(wanted: &Path) -> String {
    nearest_log(wanted)
        .map_or(String::new(), |best| format!("; did you mean `{}`?", best.display()))
}

/// Returns the log in the same folder whose name is most similar to that of a missing file.
fn nearest_log(wanted: &Path) -> Option<PathBuf> {
    nearest_file(wanted, |ending| LOG_ENDINGS.contains(&ending))
}

/// Returns "; did you mean `LOG.people.csv`?" for a missing file; empty if no file in its folder
/// has a similar name.
pub fn file_hint(wanted: &Path) -> String {
    nearest_file(wanted, |_| true)
        .map_or(String::new(), |best| format!("; did you mean `{}`?", best.display()))
}

/// Returns the file with an accepted extension whose name is most similar to that of a missing file
/// in the same folder.
fn nearest_file(wanted: &Path, accepts: impl Fn(&str) -> bool) -> Option<PathBuf> {
    let folder = wanted.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let files = files_in(folder).unwrap_or_default();
    let accepted = files.iter().filter(|file| accepts(&ending_of(file).unwrap_or_default()));
    let names: Vec<&str> = accepted.filter_map(|file| file.file_name()?.to_str()).collect();
    let best = nearest(wanted.file_name()?.to_str()?, names)?;
    Some(wanted.with_file_name(best))
}

/// Returns the entries of a folder, by name.
///
/// # Errors
/// A folder that cannot be read.
fn files_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder)?.flatten().map(|entry| entry.path()).collect();
    // The order of directory entries depends on the file system.
    files.sort();
    Ok(files)
}

/// Returns the extension of a file in lower case.
fn ending_of(file: &Path) -> Option<String> {
    Some(file.extension()?.to_str()?.to_lowercase())
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
    fn a_mistyped_name_of_an_installed_network_is_answered_with_it() {
        let installed = ["yolox-nano-depth", "yolox-nano", "depth-nekf"].map(str::to_owned);
        for (wanted, best) in [
            ("yolox-nan", Some("yolox-nano")),
            ("yolo-nano-depth", Some("yolox-nano-depth")),
            // A config is nearer.
            ("depth-ekff", None),
            ("zzz", None),
        ] {
            let configs = ["depth-ekf"].into_iter();
            assert_eq!(nearest_installed(wanted, &installed, configs), best, "{wanted}");
        }
    }

    #[test]
    fn a_log_and_a_network_in_the_place_of_a_config_are_named() {
        let home = tempfile::tempdir().unwrap();
        let files: [(&str, &[u8], &str); 4] = [
            ("net.onnx", b"x", "`tagalong model --install "),
            ("robot.mcap", b"", "the order is CONFIG LOG"),
            ("copy", b"\x89MCAP0\r\n", "the order is CONFIG LOG"),
            ("ros1", b"#ROSBAG V2.0\n", "the order is CONFIG LOG"),
        ];
        for (name, start, expected) in files {
            let path = home.path().join(name);
            assert_eq!(not_a_config(&path), None, "a missing file is mistyped");
            fs::write(&path, start).unwrap();
            let why = not_a_config(&path).unwrap();
            assert!(why.contains(name) && why.contains(expected), "{why}");
        }
        let config = home.path().join("own.toml");
        fs::write(&config, "seed = 1\n").unwrap();
        assert_eq!(not_a_config(&config), None);
    }

    #[test]
    fn a_mistyped_ending_of_a_log_is_answered_with_the_log() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("robot.mcap"), "").unwrap();
        let hint = config_hint(&home.path().join("robot.mpac"));
        assert!(hint.contains("did you mean the log") && hint.contains("robot.mcap"), "{hint}");
        let hint = config_hint(&home.path().join("robot"));
        assert!(!hint.contains("robot.mcap"), "a name without an ending is a config: {hint}");
    }

    #[test]
    fn a_mistyped_file_is_answered_with_the_nearest_of_its_folder() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("robot.people.csv"), "").unwrap();
        let hint = file_hint(&home.path().join("robot.peopl.csv"));
        assert!(hint.ends_with("robot.people.csv`?"), "{hint}");
        assert_eq!(file_hint(&home.path().join("zzz")), "");
    }

    #[test]
    fn a_folder_of_images_is_answered_with_the_import() {
        let home = tempfile::tempdir().unwrap();
        let why = check_log_path(home.path()).unwrap_err().message;
        assert!(why.contains("it holds no .mcap and no .db3"), "{why}");
        fs::write(home.path().join("1.JPG"), "").unwrap();
        let why = check_log_path(home.path()).unwrap_err().message;
        assert!(why.contains("`tagalong import images "), "{why}");
    }

    #[test]
    fn the_folder_of_a_run_is_no_log() {
        let home = tempfile::tempdir().unwrap();
        fs::write(home.path().join("tracks.mcap"), "x").unwrap();
        assert!(check_log_path(home.path()).is_ok(), "a folder of one file is one log");
        fs::write(home.path().join("report.json"), "{}").unwrap();
        let failure = check_log_path(home.path()).unwrap_err();
        assert!(failure.message.contains("is a run, not a log: `tagalong view "), "{failure:?}");
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
