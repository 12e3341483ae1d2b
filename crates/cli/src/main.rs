//! The `tagalong` command with the plugins of this workspace.

fn main() -> std::process::ExitCode {
    tagalong_cli::main_with(tagalong_catalog::register)
}
