//! Generates one plugin of each kind in a copy of the workspace, and those of the walk-throughs,
//! and runs the checks of every plugin on them.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{fs, io};

use anyhow::{Context as _, Result};
use clap::ValueEnum as _;

use crate::new_plugin::{Kind, create, format};
use crate::walk_through::GUIDES;
use crate::workspace::{Workspace, remove_folder, succeed};

/// Where the copy lives: where `cargo clean` removes it.
const COPY: &str = "target/try-new-plugin";

/// Where the copy is built. It outlives the copy, so that the second trial is
/// fast, and is not the workspace's own: cargo would take the crates of the one
/// for those of the other.
const BUILD: &str = "target/try-new-plugin-build";

/// Folder of the workspace's own build, whose outside crates are as good for the copy.
const BUILT: &str = "debug";

/// Builds pipelines from config files, which follow.
const EXAMPLE: &[&str] = &[
    "run",
    "--quiet",
    "-p",
    "tagalong-pipeline",
    "--features",
    "plugins",
    "--example",
    "build_configs",
    "--",
];

/// Runs the whole trial.
pub fn try_out(workspace: &Workspace) -> Result<()> {
    let copy = copy_of(workspace)?;
    let mut names = Vec::new();
    for kind in Kind::value_variants() {
        let name = format!("trial-{kind:?}").to_lowercase();
        create(&copy, *kind, &name)?;
        format(&copy, &name)?;
        names.push(name);
    }
    for guide in &GUIDES {
        guide.walk(&copy)?;
        format(&copy, guide.name)?;
        names.push(guide.name.to_owned());
    }
    lend(&target(workspace).join(BUILT), &workspace.root().join(BUILD).join("debug"))?;
    let packages: Vec<String> =
        names.iter().flat_map(|name| ["-p".to_owned(), format!("tagalong-{name}")]).collect();
    // The program would be built for this alone; an example of the pipeline has the same plugins.
    let mut build_configs = EXAMPLE.to_vec();
    let configs: Vec<String> = names.iter().map(|name| format!("configs/{name}.toml")).collect();
    build_configs.extend(configs.iter().map(String::as_str));
    let clippy = ["clippy", "--quiet", "--all-targets", "--", "-D", "warnings"];
    for (step, args, packages) in [
        ("the generated crates are formatted", &["fmt", "--", "--check"][..], &packages[..]),
        ("they build without warnings", &clippy, &packages),
        ("they conform, as their own tests say", &["test", "--quiet"], &packages),
        ("their configs build pipelines", &build_configs, &[]),
    ] {
        eprintln!("new-plugin --try: {step}");
        let mut cargo = Command::new("cargo");
        let (before, after) = match args.iter().position(|arg| *arg == "--") {
            // Options of cargo stand before `--`, those of the tool behind it.
            Some(at) => args.split_at(at),
            None => (args, &[][..]),
        };
        cargo.args(before).args(packages).args(after);
        cargo.current_dir(copy.root()).env("CARGO_TARGET_DIR", workspace.root().join(BUILD));
        succeed(&mut cargo)?;
    }
    eprintln!("new-plugin --try: all six kinds work, and so do the walk-throughs");
    Ok(())
}

/// Returns the folder in which cargo builds the workspace.
fn target(workspace: &Workspace) -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| workspace.root().join("target"), PathBuf::from)
}

/// Copies the outside crates that cargo has built, so that they are not built a second time.
/// Without a build, or with one of an earlier trial, there is nothing to do.
fn lend(from: &Path, to: &Path) -> Result<()> {
    if to.exists() || !from.exists() {
        return Ok(());
    }
    eprintln!("new-plugin --try: crates from outside are taken from {}", from.display());
    for part in ["deps", "build", ".fingerprint"] {
        copy_outside(&from.join(part), &to.join(part))
            .with_context(|| format!("cannot copy from {}", from.join(part).display()))?;
    }
    Ok(())
}

/// Copies a folder without the crates of this workspace, tests and other programs included. Cargo
/// reuses files that keep their modification times.
fn copy_outside(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let path = entry.path();
        let name = entry.file_name();
        // Executables in `deps` have no extension; libraries do.
        let is_program = from.ends_with("deps") && path.extension().is_none();
        if is_program || name.to_string_lossy().contains("tagalong") {
            continue;
        }
        if entry.file_type()?.is_dir() {
            copy_outside(&path, &to.join(&name))?;
        } else {
            fs::copy(&path, to.join(&name))?;
            // Cargo compares modification times, and a copy has new ones.
            let copied = fs::File::options().write(true).open(to.join(&name))?;
            copied.set_modified(entry.metadata()?.modified()?)?;
        }
    }
    Ok(())
}

/// A fresh copy of all files that git knows or would know.
fn copy_of(workspace: &Workspace) -> Result<Workspace> {
    let root = workspace.root().join(COPY);
    remove_folder(&root)?;
    workspace.copy_to(&root, |_| true)?;
    Ok(Workspace::at(root))
}
