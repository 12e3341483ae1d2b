//! The `tagalong` command, as a library, so that plugins outside the workspace get the same command
//! with one call:
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     tagalong_cli::main_with(|registry| {
//!         tagalong_catalog::register(registry);
//!         // my_plugin::register(registry);
//!     })
//! }
//! ```
//!
//! Results go to stdout, log messages go to stderr. Exit codes: 0 ok, 1 failed, 2 wrong usage or
//! config, 3 finished but part of the log was lost, 130 and 143 after SIGINT and SIGTERM.

mod args;
mod commands;
mod demo;
mod keys;
mod run;

use std::ffi::OsString;
use std::process::ExitCode;

use args::{Cli, Command};
use clap::{CommandFactory as _, Parser};
pub use commands::{EvalArgs, SimilarityChoice, eval_json};
pub use run::{Overlaid, RunArgs, run_until};
use tagalong_app::outcome::{Failure, Outcome, say};
use tagalong_config::Registry;

/// Runs the whole program: registers the plugins, parses the command line, dispatches the command.
pub fn main_with(register: impl FnOnce(&mut Registry)) -> ExitCode {
    ExitCode::from(main_from(std::env::args_os(), register))
}

/// Runs the whole program with these arguments, of which the first is its name, and returns the exit
/// code: 2 for wrong usage, which is reported, and 0 for `--help`, which is printed.
pub fn main_from(
    arguments: impl IntoIterator<Item = OsString>,
    register: impl FnOnce(&mut Registry),
) -> u8 {
    tell_panics_briefly();
    let mut registry = Registry::default();
    register(&mut registry);
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let for_programs = wants_json(&arguments);
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) if for_programs && error.use_stderr() => {
            let message = error.render().to_string();
            return tell(&Failure::usage(message.trim_start_matches("error: ").trim_end()), true);
        }
        Err(error) => {
            // A closed stdout has no reader to inform.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    exit_code(&dispatch(&cli.command, &registry), for_programs)
}

/// Returns the exit code of a command and tells why it failed, if it did: for programs as JSON, the
/// last line of stderr.
pub fn exit_code(outcome: &Outcome, for_programs: bool) -> u8 {
    match outcome {
        Ok(ended) => ended.code(),
        Err(failure) => tell(failure, for_programs),
    }
}

/// Returns true where the output is asked for as JSON, even if other arguments are wrong.
pub fn wants_json(arguments: &[OsString]) -> bool {
    arguments.iter().any(|argument| argument == "--format=json")
        || arguments.windows(2).any(|pair| pair == ["--format", "json"])
}

/// Tells a failure, for programs as the last line of stderr, and returns its exit code.
fn tell(failure: &Failure, for_programs: bool) -> u8 {
    let Failure { message, code } = failure;
    // An empty message: stdout was closed, and there is no reader to inform.
    if !message.is_empty() {
        say(&if for_programs {
            serde_json::json!({ "error": message, "exit_code": code }).to_string()
        } else {
            format!("error: {message}")
        });
    }
    *code
}

/// Reports a panic in a line or two, unless `RUST_BACKTRACE` is set.
fn tell_panics_briefly() {
    if std::env::var_os("RUST_BACKTRACE").is_none() {
        std::panic::set_hook(Box::new(|panic| say(&format!("internal error: {panic}"))));
    }
}

fn dispatch(command: &Command, registry: &Registry) -> Outcome {
    match command {
        Command::Run(args) => run::run(args, registry),
        Command::View(args) => tagalong_view::view(args, registry),
        Command::Annotate(args) => tagalong_annotate::annotate(args, registry),
        Command::List { format } => commands::list(registry, *format),
        Command::Config { plugin, format } => commands::config(registry, plugin, *format),
        Command::Schema => commands::schema(registry),
        Command::Completions { shell } => commands::completions(Cli::command(), *shell),
        Command::Man { output } => commands::man(Cli::command(), output),
        Command::Check { config, log, format } => {
            commands::check(registry, config, log.as_deref(), *format)
        }
        Command::Bench(args) => tagalong_benchmark::bench(args, registry),
        Command::Demo(args) => demo::demo(args, registry),
        Command::Doctor(args) => tagalong_doctor::doctor(args, registry),
        Command::Import(args) => tagalong_import::import(args),
        Command::Follow(args) => tagalong_benchmark::experiments::follow::follow(args, registry),
        Command::Eval(args) => commands::eval(args),
        Command::Alter(args) => commands::alter(args),
        Command::Blur(args) => commands::blur(args, registry),
        Command::Simulate(args) => tagalong_simulate::simulate(args),
        Command::Boxes(args) => tagalong_benchmark::experiments::boxes::boxes(args, registry),
        Command::Trials(args) => tagalong_benchmark::experiments::trials::trials(args, registry),
        Command::Train(args) => tagalong_training::train(args, registry),
        Command::Model(args) => commands::model(args, registry),
        Command::Inspect { log, config, input, format } => {
            commands::inspect(log, config.as_deref(), input, *format)
        }
    }
}
