//! Commands for developers of Tagalong: `cargo xtask --help`.

mod accuracy;
mod api;
mod ci;
mod docs;
mod faults;
mod figures;
mod markdown;
mod metadata;
mod new_plugin;
mod package;
mod program;
mod record;
mod rehearse;
mod remove_plugin;
mod sentences;
mod tidy;
mod try_out;
mod walk_through;
mod workspace;

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, Parser, Subcommand};

use new_plugin::Kind;
use workspace::Workspace;

/// Commands for developers of Tagalong.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Writes a new plugin crate, lists it in the catalog and gives it a config
    NewPlugin(NewPlugin),
    /// Fails on wrong dependency arrows, unlisted plugins, stale paths and the like
    Tidy,
    /// Fills the parts of documents that commands print
    Docs {
        /// Fill the slow parts whose command contains this, for example `stereo-svm-ekf`,
        /// instead of the fast ones.
        #[arg(long, value_name = "PART")]
        slow: Option<String>,
        /// Fill the one part that `--slow` names with this file, which its command printed
        /// elsewhere, instead of running the command.
        #[arg(long, value_name = "FILE", requires = "slow")]
        printed: Option<PathBuf>,
        /// List the tables of slow commands that are older than a config, a model or the simulator
        /// that they were printed from, instead.
        #[arg(long, conflicts_with = "slow")]
        stale: bool,
        /// Fill the figures in sentences alone, for which no program is built.
        #[arg(long, conflicts_with_all = ["slow", "stale"])]
        sentences: bool,
    },
    /// Prints the table of faults with the tests that cover them
    Faults {
        /// Only rows whose names begin with one of these, for example `T`.
        rows: Vec<String>,
    },
    /// Runs the command lines of the documents that take no more than seconds
    Rehearse,
    /// Runs every config on every log and writes checksums of the results, to be compared with
    /// those after a change
    Record {
        /// The file to write.
        file: PathBuf,
        /// A built program to record, instead of this workspace's.
        #[arg(long)]
        program: Option<PathBuf>,
    },
    /// Packages every crate, and checks the examples of the library in a crate outside of this
    /// repository that has nothing but the packages
    Package {
        /// Build and run the examples, too: some minutes.
        #[arg(long)]
        run: bool,
    },
    /// Compares the public items of the library's crates with the committed lists in `tests/api`
    Api {
        /// Write the lists instead.
        #[arg(long)]
        write: bool,
    },
    /// Runs everything that the server runs (`.ci/run`)
    Ci,
}

#[derive(Args)]
struct NewPlugin {
    /// Kind of the plugin.
    #[arg(required_unless_present_any = ["try_out", "remove"])]
    kind: Option<Kind>,
    /// Its name in configs, for example `leg-width`.
    #[arg(required_unless_present_any = ["try_out", "remove"])]
    name: Option<String>,
    /// Generate one of each kind in a copy of the workspace and test them there.
    #[arg(long = "try", conflicts_with_all = ["kind", "name"])]
    try_out: bool,
    /// Remove the plugin of this name again: its folder, its config and its lines in the lists.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["kind", "name", "try_out"])]
    remove: Option<String>,
    /// Remove it even if its files were changed since.
    #[arg(long, requires = "remove")]
    force: bool,
}

fn main() -> ExitCode {
    match run(Cli::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<()> {
    let workspace = Workspace::find()?;
    match command {
        Command::NewPlugin(NewPlugin { kind: Some(kind), name: Some(name), .. }) => {
            new_plugin::create(&workspace, kind, &name)?;
            new_plugin::format(&workspace, &name)?;
            eprintln!("{}", new_plugin::what_now(kind, &name));
            Ok(())
        }
        Command::NewPlugin(NewPlugin { remove: Some(name), force, .. }) => {
            remove_plugin::remove(&workspace, &name, force)?;
            eprintln!("plugins/{name}, configs/{name}.toml and its lines in the lists are removed");
            Ok(())
        }
        Command::NewPlugin(_) => try_out::try_out(&workspace),
        Command::Docs { stale: true, .. } => docs::list_stale_tables(&workspace),
        Command::Docs { sentences: true, .. } => docs::fill_sentences(&workspace),
        Command::Docs { slow: Some(part), printed: Some(file), .. } => {
            docs::fill_from(&workspace, &part, &file)
        }
        Command::Docs { slow, .. } => docs::fill(&workspace, slow.as_deref()),
        Command::Faults { rows } => {
            let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
            std::io::stdout().write_all(faults::markdown(&workspace, &rows)?.as_bytes())?;
            Ok(())
        }
        Command::Tidy => tidy::tidy(&workspace),
        Command::Record { file, program } => record::record(&workspace, &file, program),
        Command::Rehearse => rehearse::rehearse(&workspace),
        Command::Package { run } => package::try_out(&workspace, run),
        Command::Api { write } => api::check(&workspace, write),
        Command::Ci => ci::ci(&workspace),
    }
}

/// The sub-commands of this program, for the check of documented commands.
fn subcommands() -> Vec<String> {
    use clap::CommandFactory as _;
    Cli::command().get_subcommands().map(|c| c.get_name().to_owned()).collect()
}
