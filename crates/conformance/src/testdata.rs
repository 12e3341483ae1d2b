//! Access of tests to recorded data.
//!
//! Recordings of people are not part of this repository: they are beside it, in `../shared/data`. A
//! test that needs some calls [`find`], and returns early if they are absent. A message on the
//! terminal, which bypasses the capture of `cargo test`, distinguishes a skipped test from a passed
//! one; if [`REQUIRE`] is set to `1`, the test fails instead.
//!
//! ```no_run
//! let Some(log) = tagalong_conformance::testdata::find("logs/um.mcap") else { return };
//! ```

use std::io::Write;
use std::path::{Path, PathBuf};

/// Environment variable that turns a skip into a failure if it is `1`.
pub const REQUIRE: &str = "TAGALONG_REQUIRE_DATA";

/// Returns the path of a file or folder of the recorded data, relative to `../shared/data`; `None`,
/// after a message, if it is absent.
///
/// # Panics
/// If it is absent and [`REQUIRE`] is `1`.
pub fn find(name: &str) -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let is_required = std::env::var_os(REQUIRE).is_some_and(|value| value == "1");
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    match look_for(&root.join(name), &test, is_required) {
        Ok(path) => Some(path),
        Err(said) => {
            // Not `eprintln!`, which `cargo test` captures. A closed terminal is no reason to fail.
            std::io::stderr().write_all(said.as_bytes()).ok();
            None
        }
    }
}

/// Returns the path, or a message that it is absent.
#[expect(clippy::panic, reason = "a skip that is not allowed fails the test")]
fn look_for(path: &Path, test: &str, is_required: bool) -> Result<PathBuf, String> {
    if path.exists() {
        return Ok(path.to_owned());
    }
    let shown = path.display();
    if is_required {
        panic!("{test} needs {shown}, which is not there; {REQUIRE}=1 allows no skip");
    }
    Err(format!("skipped: {test} needs {shown}, which is not there\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_is_found() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        assert_eq!(look_for(here, "this", true), Ok(here.to_owned()));
    }

    #[test]
    fn a_skip_names_the_test_and_the_file() {
        let said = look_for(Path::new("nowhere/um.mcap"), "the test of um", false);
        let said = said.err().unwrap_or_default();
        assert!(said.starts_with("skipped: the test of um needs nowhere/um.mcap"), "{said}");
    }

    #[test]
    #[should_panic(expected = "TAGALONG_REQUIRE_DATA=1 allows no skip")]
    fn a_skip_that_is_not_allowed_fails() {
        look_for(Path::new("nowhere/um.mcap"), "the test of um", true).ok();
    }
}
