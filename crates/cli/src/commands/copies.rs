//! Copies of logs.

use std::fs;
use std::path::{Path, PathBuf};

use tagalong_app::outcome::{Failure, spare};

/// Returns the file of a copy: the one that is named, or `LOG-KIND.mcap` in the current
/// folder, where other commands write, too: the folder of a log may be read-only.
///
/// # Errors
/// A file that exists without `overwrite`, and the log itself.
pub(super) fn copy_of(
    log: &Path,
    named: Option<&Path>,
    kind: &str,
    overwrite: bool,
) -> Result<PathBuf, Failure> {
    let copy = named.map_or_else(|| name_of(log, kind), Path::to_owned);
    check_place(&copy, log, "log", overwrite)?;
    Ok(copy)
}

/// Refuses a place of a copy: a file that exists without `overwrite`, and the original itself, which is
/// named by its kind.
///
/// # Errors
/// Such a place.
pub(super) fn check_place(
    copy: &Path,
    original: &Path,
    kind: &str,
    overwrite: bool,
) -> Result<(), Failure> {
    spare(copy, overwrite)?;
    if same_file(copy, original) {
        let why = format!("the copy would replace the {kind} itself; name another file");
        return Err(Failure::usage(why));
    }
    Ok(())
}

/// Returns the name of a copy.
fn name_of(log: &Path, kind: &str) -> PathBuf {
    let mut name = log.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{kind}.mcap"));
    name.into()
}

fn same_file(a: &Path, b: &Path) -> bool {
    // A copy that does not exist yet is no file at all.
    fs::canonicalize(a).is_ok_and(|a| fs::canonicalize(b).is_ok_and(|b| a == b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_without_a_name_is_made_in_the_current_folder() {
        let copy = copy_of(Path::new("data/robot.mcap"), None, "altered", false).unwrap();
        assert_eq!(copy, Path::new("robot-altered.mcap"));
    }
}
