use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use serde::Deserialize;

use crate::workspace::{Workspace, output};

/// Output of `cargo metadata`, as far as it matters here.
#[derive(Deserialize)]
pub struct Metadata {
    /// Every package of the dependency tree.
    pub packages: Vec<Package>,
    workspace_members: Vec<String>,
}

/// A package.
#[derive(Deserialize)]
pub struct Package {
    id: String,
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// Its licence as an SPDX expression, if it declares one.
    pub license: Option<String>,
    /// The folder with its manifest is the parent of this.
    pub manifest_path: PathBuf,
    /// Registries that it may be published in: none if it is empty, all without such a list.
    pub publish: Option<Vec<String>>,
    /// Direct dependencies.
    pub dependencies: Vec<Dependency>,
    /// Targets that are built from it.
    pub targets: Vec<Target>,
}

/// A direct dependency.
#[derive(Deserialize)]
pub struct Dependency {
    /// The package.
    pub name: String,
    /// `None`, "dev" or "build".
    pub kind: Option<String>,
}

/// Something built from a package.
#[derive(Deserialize)]
pub struct Target {
    /// "lib", "bin", ...
    pub kind: Vec<String>,
}

impl Metadata {
    /// Asks cargo about the workspace and all its dependencies.
    pub fn of(workspace: &Workspace) -> Result<Self> {
        let mut cargo = Command::new("cargo");
        cargo.args(["metadata", "--format-version", "1", "--all-features"]);
        let text = output(cargo.current_dir(workspace.root()))?;
        serde_json::from_str(&text).context("cargo metadata has changed its form")
    }

    /// The packages of the workspace by folder (`crates/core`), in order.
    pub fn members<'a>(&'a self, root: &Path) -> BTreeMap<String, &'a Package> {
        let inside = self.packages.iter().filter(|p| self.workspace_members.contains(&p.id));
        inside.filter_map(|p| Some((p.folder(root)?, p))).collect()
    }

    /// The packages that come from elsewhere.
    pub fn outside(&self) -> impl Iterator<Item = &Package> {
        self.packages.iter().filter(|p| !self.workspace_members.contains(&p.id))
    }
}

impl Package {
    /// The folder relative to the root, with forward slashes.
    fn folder(&self, root: &Path) -> Option<String> {
        let root = root.canonicalize().ok()?;
        let manifest = self.manifest_path.canonicalize().ok()?;
        let folder = manifest.parent()?.strip_prefix(root).ok()?;
        Some(folder.to_string_lossy().replace('\\', "/"))
    }

    /// True if it is for this repository alone.
    pub fn is_private(&self) -> bool {
        self.publish.as_ref().is_some_and(Vec::is_empty)
    }

    /// True if it builds a program.
    pub fn is_program(&self) -> bool {
        self.targets.iter().any(|target| target.kind.iter().any(|kind| kind == "bin"))
    }
}
