//! Generates one plugin of each kind in a copy of the workspace, and the one of
//! the walk-through, and demands of them what is demanded of every plugin.

use std::fs;
use std::process::Command;

use anyhow::{Context as _, Result};
use clap::ValueEnum as _;

use crate::metadata::Metadata;
use crate::new_plugin::{Kind, create, format};
use crate::walk_through;
use crate::workspace::{Workspace, succeed};

/// Where the copy lives: where `cargo clean` removes it.
const COPY: &str = "target/try-new-plugin";

/// Where the copy is built. It outlives the copy, so that the second trial is
/// fast, and is not the workspace's own: cargo would take the crates of the one
/// for those of the other.
const BUILD: &str = "target/try-new-plugin-build";

/// Nobody waits for these programs, so that the dependencies need not be fast.
const QUICK_BUILD: &str = r#"profile.dev.package."*".opt-level = 1"#;

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
    walk_through::walk(&copy)?;
    format(&copy, walk_through::NAME)?;
    names.push(walk_through::NAME.to_owned());
    let packages: Vec<String> =
        names.iter().flat_map(|name| ["-p".to_owned(), format!("tagalong-{name}")]).collect();
    let cargo = |step: &str, args: &[&str], packages: &[String]| -> Result<()> {
        eprintln!("new-plugin --try: {step}");
        let mut cargo = Command::new("cargo");
        cargo.args(["--config", QUICK_BUILD]);
        let (before, after) = match args.iter().position(|arg| *arg == "--") {
            Some(at) => args.split_at(at),
            None => (args, &[][..]),
        };
        cargo.args(before).args(packages).args(after);
        cargo.current_dir(copy.root()).env("CARGO_TARGET_DIR", workspace.root().join(BUILD));
        succeed(&mut cargo)
    };
    cargo("the generated crates are formatted", &["fmt", "--", "--check"], &packages)?;
    let clippy = ["clippy", "--quiet", "--all-targets", "--", "-D", "warnings"];
    cargo("they build without warnings", &clippy, &packages)?;
    cargo("their tests pass", &["test", "--quiet"], &packages)?;
    let suite = ["test", "--quiet", "-p", "tagalong-tests", "--test", "conformance"];
    cargo("they conform", &suite, &[])?;
    if has_program(&copy)? {
        for name in &names {
            let config = format!("configs/{name}.toml");
            let run = ["run", "--quiet", "-p", "tagalong-cli", "--", "check", &config];
            cargo(&format!("{config} is a valid config"), &run, &[])?;
        }
    }
    eprintln!("new-plugin --try: all four kinds work, and so does the walk-through");
    Ok(())
}

fn has_program(copy: &Workspace) -> Result<bool> {
    let metadata = Metadata::of(copy)?;
    let members = metadata.members(copy.root());
    Ok(members.get("crates/cli").is_some_and(|package| package.is_program()))
}

/// A fresh copy of all files that git knows or would know.
fn copy_of(workspace: &Workspace) -> Result<Workspace> {
    let root = workspace.root().join(COPY);
    if root.exists() {
        fs::remove_dir_all(&root).with_context(|| format!("cannot remove {}", root.display()))?;
    }
    for file in workspace.files()? {
        let to = root.join(&file);
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::copy(workspace.root().join(&file), &to)
            .with_context(|| format!("cannot copy {}", file.display()))?;
    }
    Ok(Workspace::at(root))
}
