//! The `tagalong-papers` command: the tables of the published systems, and every command of
//! `tagalong` with the equations as printed among its plugins.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tagalong_config::Registry;
use tagalong_papers::command::{HELP, ReproduceArgs, reproduce};
use tagalong_papers::realism::{RealismArgs, realism};
use tagalong_papers::webcams::{self, TriangulateArgs, triangulate};

/// Repeats the experiments of five published systems. Every other command is that of `tagalong`,
/// with the plugins of the printed equations in addition.
#[derive(Debug, Parser)]
#[command(name = "tagalong-papers", version, about, after_help = HELP, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Prints the tables of a published system beside ours
    #[command(after_help = HELP)]
    Reproduce(ReproduceArgs),
    /// Checks how realistic simulated worlds are, beside measurements of real sensors and rooms
    Realism(RealismArgs),
    /// Measures the position of a coloured hat with fixed cameras in a log
    #[command(after_help = webcams::HELP)]
    Triangulate(TriangulateArgs),
    /// Any command of `tagalong`, like `run` and `list`
    #[command(external_subcommand)]
    Product(Vec<OsString>),
}

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let outcome = match Cli::parse().command {
        Command::Reproduce(args) => reproduce(&args, &registry()),
        Command::Realism(args) => realism(&args, &registry()),
        Command::Triangulate(args) => triangulate(&args),
        Command::Product(words) => {
            // The name of the program comes before its words, as in any command line.
            let line = arguments.first().cloned().into_iter().chain(words);
            return ExitCode::from(tagalong_cli::main_from(line, tagalong_papers::register));
        }
    };
    ExitCode::from(tagalong_cli::exit_code(&outcome, tagalong_cli::wants_json(&arguments)))
}

/// Returns a registry with all plugins of the workspace and those of the printed equations.
fn registry() -> Registry {
    let mut registry = Registry::default();
    tagalong_papers::register(&mut registry);
    registry
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn other_commands_are_those_of_the_product() {
        let cli = Cli::try_parse_from(["tagalong-papers", "list", "--format", "json"]).unwrap();
        assert!(
            matches!(cli.command, Command::Product(words) if words == ["list", "--format", "json"])
        );
        let cli = Cli::try_parse_from(["tagalong-papers", "reproduce", "laser"]).unwrap();
        assert!(matches!(cli.command, Command::Reproduce(_)));
        let cli = Cli::try_parse_from(["tagalong-papers", "realism", "--seeds", "24"]).unwrap();
        assert!(matches!(cli.command, Command::Realism(args) if args.seeds == 24));
        assert!(Cli::try_parse_from(["tagalong-papers", "realism", "--seeds", "0"]).is_err());
    }
}
