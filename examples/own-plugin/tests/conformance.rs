//! The plugins pass the checks of their kinds.

use tagalong_conformance::Suite;

#[test]
fn it_conforms() {
    let mut registry = tagalong_config::Registry::default();
    own_plugin::register(&mut registry);
    let failures = Suite::new(&registry).must_discover("own-band").check_all();
    assert!(failures.is_empty(), "{failures:#?}");
}

/// The configs beside them are valid, and select these plugins.
#[test]
#[cfg(feature = "program")]
fn the_program_knows_them() {
    let program = env!("CARGO_BIN_EXE_own-plugin");
    for config in ["own-band.toml", "own-contrast.toml", "own-tracker.toml"] {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(config);
        let output = std::process::Command::new(program).arg("check").arg(path).output();
        let output = output.expect("the program starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}
