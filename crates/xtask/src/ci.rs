use std::process::Command;

use anyhow::Result;

use crate::workspace::{Workspace, succeed};

/// Runs all checks that the server runs.
pub fn ci(workspace: &Workspace) -> Result<()> {
    succeed(Command::new("bash").arg(".ci/run").current_dir(workspace.root()))
}
