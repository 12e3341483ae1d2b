//! The plugin keeps the promises of its kind.

#[test]
fn it_conforms() {
    let mut registry = tagalong_core::Registry::default();
    own_plugin::register(&mut registry);
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}

/// The config beside it is right, and means this plugin.
#[test]
fn the_program_knows_it() {
    let program = env!("CARGO_BIN_EXE_own-plugin");
    let config = concat!(env!("CARGO_MANIFEST_DIR"), "/own-contrast.toml");
    let output = std::process::Command::new(program).args(["check", config]).output();
    let output = output.expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
