//! Where tests find recorded data, and what they do without.
//!
//! Recordings of people are not part of this repository: they lie beside it, in
//! `../shared/data`. A test that needs some asks [`find`], and ends early where they are
//! absent. That is said on the terminal, past the capture of `cargo test`, so that a test
//! that passed and a test that skipped can be told apart; and where [`REQUIRE`] is set to
//! `1`, it fails.
//!
//! ```no_run
//! let Some(log) = tagalong_testdata::find("logs/um.mcap") else { return };
//! ```

use std::io::Write;
use std::path::{Path, PathBuf};

/// The environment variable that makes a skip a failure where it is `1`.
pub const REQUIRE: &str = "TAGALONG_REQUIRE_DATA";

/// Returns the path of a file or folder of the recorded data, named from `../shared/data`;
/// `None`, after a message, where it is absent.
///
/// # Panics
/// Where it is absent and [`REQUIRE`] is `1`.
pub fn find(name: &str) -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let is_required = std::env::var_os(REQUIRE).is_some_and(|value| value == "1");
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    match look_for(&root.join(name), &test, is_required) {
        Ok(path) => Some(path),
        Err(said) => {
            // Not `eprintln!`, which `cargo test` keeps to itself. Where nobody listens,
            // nothing is lost.
            std::io::stderr().write_all(said.as_bytes()).ok();
            None
        }
    }
}

/// Returns the path, or what to say.
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
