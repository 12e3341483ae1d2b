//! Lists of the public items of the library and of the crates that others build on, so that no
//! change of them goes unseen. They are made of the sources: nothing is built, and no nightly compiler is needed.

mod crate_items;
mod text;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use self::crate_items::CrateItems;
use crate::workspace::Workspace;

/// Folders of the crates below `crates`: the library, those that it re-exports, and those that
/// plugins and programs outside of this repository use.
const CRATES: &[&str] = &[
    "tagalong",
    "config",
    "core",
    "eval",
    "following",
    "geometry",
    "log",
    "math",
    "network",
    "pipeline",
    "sim",
    "stereo",
    "tracking",
    "vision",
];

/// Lines of each kind that a complaint shows.
const SHOWN: usize = 20;

/// Compares the public items of each crate with its list, or writes the lists.
///
/// # Errors
/// Sources that cannot be read, and, unless they are written, lists that differ.
pub fn check(workspace: &Workspace, write: bool) -> Result<()> {
    let mut complaints = Vec::new();
    for name in CRATES {
        let root = workspace.root().join("crates").join(name).join("src/lib.rs");
        let items = CrateItems::read(&root)?.public();
        let list = list(workspace, name);
        if write {
            fs::create_dir_all(list.parent().unwrap_or(workspace.root()))?;
            fs::write(&list, items.join("\n") + "\n")?;
            continue;
        }
        let known = read_list(&list)?;
        complaints
            .extend(differences(&known, &items).map(|difference| format!("{name}:\n{difference}")));
    }
    if complaints.is_empty() {
        return Ok(());
    }
    bail!(
        "public items differ from tests/api; `cargo xtask api --write` writes them anew:\n{}",
        complaints.join("\n")
    )
}

/// Reads a list of public items.
///
/// # Errors
/// A list that cannot be read: as an empty one it would report each item as added.
fn read_list(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| {
        let path = path.display();
        format!("cannot read {path}; `cargo xtask api --write` writes it anew")
    })
}

fn list(workspace: &Workspace, name: &str) -> PathBuf {
    workspace.root().join("tests/api").join(format!("{name}.txt"))
}

/// Returns the lines that were removed and added; `None` if there are none.
fn differences(known: &str, items: &[String]) -> Option<String> {
    let before: BTreeSet<&str> = known.lines().collect();
    let after: BTreeSet<&str> = items.iter().map(String::as_str).collect();
    let removed = before.difference(&after).take(SHOWN).map(|line| format!("- {line}"));
    let added = after.difference(&before).take(SHOWN).map(|line| format!("+ {line}"));
    let lines: Vec<String> = removed.chain(added).collect();
    (!lines.is_empty()).then(|| lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(folder: &Path, file: &str, text: &str) {
        let path = folder.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn public(files: &[(&str, &str)]) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        for (file, text) in files {
            write(folder.path(), file, text);
        }
        CrateItems::read(&folder.path().join("lib.rs")).unwrap().public()
    }

    #[test]
    fn items_of_private_modules_are_listed_where_they_are_re_exported() {
        let lib = "mod inner;\npub mod open;\npub use inner::{Kept as Named, deep::*};\n\
                   pub use nalgebra;\npub use other::Thing;\nfn private() {}\n";
        let inner = "pub mod deep;\npub struct Kept { pub a: f64, b: u8 }\npub struct Hidden;\n\
                     impl Kept { pub fn a(&self) -> f64 { self.a } fn b(&self) {} }\n\
                     impl Clone for Kept { fn clone(&self) -> Self { Self { ..*self } } }\n";
        let deep = "/// Words.\n#[derive(Debug)]\n#[non_exhaustive]\npub enum Deep { A(u8), B { x: f64 } }\n\
                    settings! { #[non_exhaustive]\npub struct Wishes { pub a: f64 = 0.5, pub b: u8 } }\n\
                    #[macro_export]\nmacro_rules! deepen { () => {} }\n\
                    #[cfg(test)]\nmod tests { pub fn unseen() {} }\n";
        let open = "pub const MOST: usize = 3;\npub(crate) const LEAST: usize = 1;\n\
                    pub trait Verb { const N: usize; fn act(&mut self, at: &[f64]) -> Option<u8> { None } }\n";
        let files =
            [("lib.rs", lib), ("inner/mod.rs", inner), ("inner/deep.rs", deep), ("open.rs", open)];
        let expected = [
            "impl Clone for Named",
            "impl Default for Wishes",
            "macro deepen!",
            "pub const open::MOST: usize",
            "pub enum Deep #[derive(Debug)] #[non_exhaustive]",
            "pub enum Deep: A(u8)",
            "pub enum Deep: B { x: f64 }",
            "pub mod open",
            "pub struct Named",
            "pub struct Named: a: f64",
            "pub struct Named: fn a(&self) -> f64",
            "pub struct Named: private fields",
            "pub struct Wishes #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)] #[non_exhaustive]",
            "pub struct Wishes: a: f64",
            "pub struct Wishes: b: u8",
            "pub trait open::Verb",
            "pub trait open::Verb: const N: usize",
            "pub trait open::Verb: fn act(&mut self, at: &[f64]) -> Option<u8> {..}",
            "pub use nalgebra",
            "pub use other::Thing",
        ];
        assert_eq!(public(&files), expected);
    }

    #[test]
    fn a_list_that_cannot_be_read_is_an_error_with_its_path() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("core.txt");
        let error = format!("{:#}", read_list(&path).unwrap_err());
        assert!(error.contains("core.txt") && error.contains("No such file"), "{error}");
        fs::write(&path, "pub mod a\n").unwrap();
        assert_eq!(read_list(&path).unwrap(), "pub mod a\n");
    }

    #[test]
    fn a_changed_argument_is_told() {
        fn items(text: &str) -> Vec<String> {
            public(&[("lib.rs", text)])
        }

        let known = items("pub fn step(time_s: f64) {}").join("\n");
        assert_eq!(differences(&known, &items("pub fn step(time_s: f64) { loop {} }")), None);
        let told = differences(&known, &items("pub fn step(time_s: f32) {}")).unwrap();
        assert_eq!(told, "- pub fn step(time_s: f64)\n+ pub fn step(time_s: f32)");
    }
}
