//! The `tagalong-ros2` command.

use std::io::Write as _;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use clap::Parser;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use tagalong_ros2::{Options, run};

fn main() -> ExitCode {
    let options = Options::parse();
    if options.check {
        return check(&options);
    }
    let stop = Arc::new(AtomicBool::new(false));
    let signal = Arc::new(AtomicUsize::new(0));
    let listening = [SIGINT, SIGTERM].into_iter().try_for_each(|number| {
        // The exit code depends on the number of the signal.
        flag::register_usize(number, Arc::clone(&signal), number as usize)?;
        flag::register(number, Arc::clone(&stop)).map(drop)
    });
    if let Err(error) = listening {
        eprintln!("error: cannot listen to signals: {error}");
        return ExitCode::FAILURE;
    }
    match run(&options, &stop, &|sentence| eprintln!("{sentence}")) {
        Ok(summary) => {
            eprint!("{summary}");
            let signal = signal.load(Ordering::Relaxed);
            ExitCode::from(if signal == 0 { 0 } else { 128 + signal as u8 })
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Only checks the config.
fn check(options: &Options) -> ExitCode {
    match options.checked(&tagalong::builtin_registry()) {
        Ok(lines) => {
            // A closed pipe is not an error of the config.
            let _closed = write!(std::io::stdout(), "{lines}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
