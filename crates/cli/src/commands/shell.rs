use std::path::Path;

use clap::Command;
use clap_complete::Shell;
use tagalong_app::outcome::{Ended, Failure, Outcome, make_folder, print, say};

/// Runs `tagalong completions`.
///
/// # Errors
/// If stdout cannot be written.
pub fn completions(mut command: Command, shell: Shell) -> Outcome {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command, "tagalong", &mut script);
    print(&String::from_utf8_lossy(&script))?;
    Ok(Ended::Well)
}

/// Runs `tagalong man`.
///
/// # Errors
/// A folder that cannot be made or written.
pub fn man(command: Command, folder: &Path) -> Outcome {
    make_folder(folder)?;
    let shown = folder.display();
    clap_mangen::generate_to(command, folder)
        .map_err(|error| Failure::usage(format!("cannot write to {shown}: {error}")))?;
    say(&format!("the pages are in {shown}; `man {shown}/tagalong.1` shows the first"));
    Ok(Ended::Well)
}
