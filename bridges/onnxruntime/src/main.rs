//! The `tagalong` command with the detector `onnxruntime`.

fn main() -> std::process::ExitCode {
    tagalong_cli::main_with(|registry| {
        tagalong_catalog::register(registry);
        tagalong_onnxruntime::register(registry);
    })
}
