//! The program `tagalong` of the workspace.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use serde::Deserialize;

use crate::workspace::{Workspace, output};

/// The built program.
pub struct Program(PathBuf);

/// Message of cargo about an artifact that it built.
#[derive(Deserialize)]
struct Built {
    executable: Option<PathBuf>,
}

impl Program {
    /// Builds it as the tests do, which have built it already.
    pub fn built(workspace: &Workspace) -> Result<Self> {
        let mut cargo = Command::new("cargo");
        cargo.args(["build", "--quiet", "--package", "tagalong-cli", "--bin", "tagalong"]);
        cargo.args(["--message-format", "json"]);
        let said = output(cargo.current_dir(workspace.root()))?;
        let built = said.lines().filter_map(|line| serde_json::from_str::<Built>(line).ok());
        let program = built.filter_map(|built| built.executable).next_back();
        Ok(Self(program.context("cargo does not say where the program is")?))
    }

    /// A call with these words.
    pub fn call(&self, words: &[&str]) -> Command {
        let mut command = Command::new(&self.0);
        command.args(words);
        command
    }

    /// The folder that it lies in.
    pub fn folder(&self) -> &Path {
        self.0.parent().unwrap_or(Path::new("."))
    }
}
