//! Rules that the compiler does not check: allowed dependencies between crates, complete lists of
//! plugins, documents without stale parts, plain words in comments, few closures bound by `let`.

mod arrows;
mod circles;
mod closures;
mod commands;
mod defaults;
mod files;
mod licences;
mod names;
mod papers;
mod paths;
pub mod plugins;
mod words;

use anyhow::{Result, bail};

use crate::markdown;
use crate::metadata::Metadata;
use crate::workspace::Workspace;

/// Prints complaints.
fn print_complaints(complaints: &[String]) {
    for complaint in complaints {
        eprintln!("tidy: {complaint}");
    }
}

/// Runs all checks; an error if there is any complaint.
pub fn tidy(workspace: &Workspace) -> Result<()> {
    let metadata = Metadata::of(workspace)?;
    let mut complaints = arrows::check(workspace, &metadata)?;
    complaints.extend(plugins::check(workspace, &metadata)?);
    complaints.extend(licences::check(workspace, &metadata)?);
    complaints.extend(circles::check(workspace, &metadata)?);
    complaints.extend(files::check(workspace)?);
    complaints.extend(names::check(workspace)?);
    complaints.extend(papers::check(workspace)?);
    complaints.extend(words::check(workspace)?);
    complaints.extend(closures::check(workspace)?);
    complaints.extend(crate::faults::check(workspace)?);
    let documents = markdown::documents(workspace)?;
    complaints.extend(paths::check(workspace, &documents));
    complaints.extend(commands::check(workspace, &metadata, &documents)?);
    print_complaints(&complaints);
    // The programs that print parts of documents are built first, which takes minutes in a new clone.
    eprintln!("tidy: the parts of documents that commands print");
    let stale = crate::docs::stale(workspace)?;
    print_complaints(&stale);
    complaints.extend(stale);
    let stale = crate::docs::stale_tables(workspace)?.len();
    if stale > 0 {
        // No complaint: printing them anew takes hours.
        eprintln!(
            "tidy: warning: {stale} tables of slow commands are older than their sources: \
             `cargo xtask docs --stale` lists them"
        );
    }
    if complaints.is_empty() {
        eprintln!("tidy: nothing to complain about");
        return Ok(());
    }
    bail!("{} complaints", complaints.len())
}
