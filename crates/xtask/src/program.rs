//! The programs of the workspace: `tagalong`, and `tagalong-papers` of the laboratory.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use serde::Deserialize;

use crate::workspace::{Workspace, output};

/// A program of the workspace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Name {
    /// `tagalong`.
    Tagalong,
    /// `tagalong-papers`.
    Papers,
}

impl Name {
    /// All of them, the longer names first.
    pub const ALL: [Self; 2] = [Self::Papers, Self::Tagalong];

    /// Returns the name in a command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Tagalong => "tagalong",
            Self::Papers => "tagalong-papers",
        }
    }

    /// Returns the package that builds it.
    pub fn package(self) -> &'static str {
        match self {
            Self::Tagalong => "tagalong-cli",
            Self::Papers => "tagalong-papers",
        }
    }

    /// Returns a test that runs it: cargo builds the program for it, with the features that all tests
    /// together ask for, so that after them nothing is left to build.
    fn test(self) -> &'static str {
        match self {
            Self::Tagalong => "command",
            Self::Papers => "triangulate",
        }
    }
}

/// The built program.
pub struct Program(PathBuf);

/// Message of cargo about an artifact that it built.
#[derive(Deserialize)]
struct Built {
    target: Target,
    executable: Option<PathBuf>,
}

#[derive(Deserialize)]
struct Target {
    name: String,
    kind: Vec<String>,
}

impl Program {
    /// Builds it as the tests do.
    pub fn built(workspace: &Workspace, name: Name) -> Result<Self> {
        Self::with_arguments(
            workspace,
            name,
            &["test", "--no-run", "--workspace", "--test", name.test()],
        )
    }

    /// Builds it with optimisation.
    pub fn optimised(workspace: &Workspace, name: Name) -> Result<Self> {
        let package = name.package();
        Self::with_arguments(workspace, name, &["build", "--release", "--package", package])
    }

    fn with_arguments(workspace: &Workspace, name: Name, arguments: &[&str]) -> Result<Self> {
        let mut cargo = Command::new("cargo");
        cargo.args(arguments).args(["--quiet", "--message-format", "json"]);
        let said = output(cargo.current_dir(workspace.root()))?;
        let built = said.lines().filter_map(|line| serde_json::from_str::<Built>(line).ok());
        let mut programs = built.filter(|built| {
            built.target.name == name.as_str() && built.target.kind.iter().any(|kind| kind == "bin")
        });
        let program = programs.find_map(|built| built.executable);
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
