//! Copies of logs that lie beside them.

use std::fs;
use std::path::{Path, PathBuf};

use tagalong_app::outcome::{Failure, spare};

/// Returns the file of a copy: the one that is named, or `LOG-KIND.mcap` beside the log.
///
/// # Errors
/// A file that exists without `overwrite`, and the log itself.
pub(super) fn copy_of(
    log: &Path,
    named: Option<&Path>,
    kind: &str,
    overwrite: bool,
) -> Result<PathBuf, Failure> {
    let copy = named.map_or_else(|| beside(log, kind), Path::to_owned);
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

fn beside(log: &Path, kind: &str) -> PathBuf {
    let mut name = log.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{kind}.mcap"));
    log.with_file_name(name)
}

fn same_file(a: &Path, b: &Path) -> bool {
    // A copy that does not exist yet is no file at all.
    fs::canonicalize(a).is_ok_and(|a| fs::canonicalize(b).is_ok_and(|b| a == b))
}
