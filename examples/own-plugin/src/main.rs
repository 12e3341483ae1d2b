//! The `tagalong` command with one more plugin.

fn main() -> std::process::ExitCode {
    tagalong_cli::main_with(|registry| {
        tagalong_catalog::register(registry);
        own_plugin::register(registry);
    })
}
