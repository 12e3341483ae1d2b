//! Packages of the crates, as a registry would get them, and a crate of a stranger that uses them.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};

use crate::metadata::Metadata;
use crate::workspace::{Workspace, copy_file, remove_folder, succeed};

/// Examples of the library that the stranger builds.
const EXAMPLES: &[&str] = &["follow", "log_to_tracks", "own_arrays", "own_detector", "own_sensor"];
/// Those of them that need no file.
const RUNNABLE: &[&str] = &["own_arrays", "own_detector", "own_sensor"];
/// Folder of the library among the packages.
const LIBRARY: &str = "tagalong";

/// Packages every crate and unpacks the packages into a folder outside of the repository. There a
/// crate that depends on all of them checks the examples of the library, and with them every
/// package: `cargo package` would build each of them for itself. With `run`, the examples are built
/// and run.
///
/// # Errors
/// A crate that cannot be packaged, and a package that lacks a part of its crate.
pub fn try_out(workspace: &Workspace, run: bool) -> Result<()> {
    let target = target(workspace);
    let packages = target.join("package");
    remove_folder(&packages)?;
    eprintln!("package: every crate is packaged");
    let mut cargo = Command::new("cargo");
    cargo.args(["package", "--workspace", "--no-verify", "--allow-dirty", "--quiet"]);
    let metadata = Metadata::of(workspace)?;
    for package in metadata.members(workspace.root()).values().filter(|it| it.is_private()) {
        cargo.args(["--exclude", &package.name]);
    }
    succeed(cargo.current_dir(workspace.root()).env("CARGO_TARGET_DIR", &target))?;
    let stranger = env::temp_dir().join(format!("tagalong-stranger-{}", std::process::id()));
    remove_folder(&stranger)?;
    let tried = build(workspace, &packages, &stranger, &target, run);
    remove_folder(&stranger)?;
    tried
}

/// Unpacks the packages and builds the stranger's crate.
fn build(
    workspace: &Workspace,
    packages: &Path,
    stranger: &Path,
    target: &Path,
    run: bool,
) -> Result<()> {
    let unpacked = unpack(packages, &stranger.join("packages"))?;
    ensure!(!unpacked.is_empty(), "no package in {}", packages.display());
    write_stranger(&unpacked, stranger)?;
    // The same outside crates as here: they are built already, and need no network.
    copy_file(&workspace.root().join("Cargo.lock"), &stranger.join("Cargo.lock"))?;
    eprintln!(
        "package: a stranger's crate with {} packages, {}",
        unpacked.len(),
        stranger.display()
    );
    run_cargo(stranger, target, &["check", "--quiet", "--bins"])?;
    if run {
        for example in RUNNABLE {
            run_cargo(stranger, target, &["run", "--quiet", "--bin", example])?;
        }
    }
    eprintln!("package: the packages compile, and so do the examples of the library");
    Ok(())
}

/// Runs cargo in a folder, with a target folder of its own.
fn run_cargo(folder: &Path, target: &Path, words: &[&str]) -> Result<()> {
    let mut cargo = Command::new("cargo");
    cargo.args(words).current_dir(folder).env("CARGO_TARGET_DIR", target);
    succeed(&mut cargo)
}

/// Unpacks every package, and returns the names of the crates with their folders.
fn unpack(packages: &Path, into: &Path) -> Result<Vec<(String, PathBuf)>> {
    fs::create_dir_all(into)?;
    let mut unpacked = Vec::new();
    for entry in fs::read_dir(packages).context("cargo has written no packages")? {
        let path = entry?.path();
        if path.extension().is_none_or(|extension| extension != "crate") {
            continue;
        }
        // With the time of now (`m`): cargo dates all files of packages alike, and would take those
        // of an earlier run in a folder of the same name for unchanged.
        succeed(Command::new("tar").arg("-xzmf").arg(&path).arg("-C").arg(into))?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let (name, _) = stem.rsplit_once('-').context("a package has a version in its name")?;
        unpacked.push((name.to_owned(), into.join(&stem)));
    }
    unpacked.sort();
    Ok(unpacked)
}

/// Writes the stranger's crate: the examples of the library as its programs.
fn write_stranger(unpacked: &[(String, PathBuf)], stranger: &Path) -> Result<()> {
    let mut manifest = String::from(
        "[workspace]\n\n[package]\nname = \"stranger\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\n\
         [dependencies]\n",
    );
    for (name, _) in unpacked.iter().filter(|(_, folder)| folder.join("src/lib.rs").is_file()) {
        manifest += &format!("{name} = \"*\"\n");
    }
    manifest += "\n[patch.crates-io]\n";
    for (name, folder) in unpacked {
        manifest += &format!("{name} = {{ path = {:?} }}\n", folder.display().to_string());
    }
    let programs = stranger.join("src/bin");
    fs::create_dir_all(&programs)?;
    fs::write(stranger.join("Cargo.toml"), manifest)?;
    let library = unpacked.iter().find(|(name, _)| name == LIBRARY);
    let (_, library) = library.context("the library is not among the packages")?;
    for example in EXAMPLES {
        let file = format!("{example}.rs");
        copy_file(&library.join("examples").join(&file), &programs.join(&file))?;
    }
    Ok(())
}

/// Returns the folder in which cargo builds.
fn target(workspace: &Workspace) -> PathBuf {
    let set = env::var_os("CARGO_TARGET_DIR").map(PathBuf::from);
    set.unwrap_or_else(|| workspace.root().join("target"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stranger_patches_every_package_and_has_the_examples() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("packages/tagalong-0.2.0");
        for example in EXAMPLES {
            let file = library.join("examples").join(format!("{example}.rs"));
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, "fn main() {}\n").unwrap();
        }
        let core =
            (String::from("tagalong-core"), folder.path().join("packages/tagalong-core-0.2.0"));
        for (_, root) in [(String::from("tagalong"), library.clone()), core.clone()] {
            fs::create_dir_all(root.join("src")).unwrap();
            fs::write(root.join("src/lib.rs"), "").unwrap();
        }
        let program = (String::from("tagalong-program"), folder.path().join("packages/program"));
        let unpacked = [(String::from("tagalong"), library), core, program];
        write_stranger(&unpacked, folder.path()).unwrap();
        let manifest = fs::read_to_string(folder.path().join("Cargo.toml")).unwrap();
        assert!(manifest.contains("tagalong-core = { path = \""), "{manifest}");
        assert!(manifest.contains("tagalong-core = \"*\"\n"), "{manifest}");
        assert!(!manifest.contains("tagalong-program = \"*\""), "a program is no dependency");
        assert!(folder.path().join("src/bin/own_detector.rs").is_file());
        assert!(write_stranger(&unpacked[1..], folder.path()).is_err(), "there is no library");
    }
}
