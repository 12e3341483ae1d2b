//! Every plugin of the catalog passes the checks of its kind.

use tagalong_config::Registry;
use tagalong_conformance::Suite;

/// Detectors that discover the simulated person in an image or a laser scan. A freshly generated
/// detector finds no people and is not listed; a working one is listed, so that it has to keep
/// working.
const DISCOVER: &[&str] = &["depth-net", "depth-template", "laser-legs"];

/// Detectors that find the simulated person near a track.
const FOLLOW: &[&str] = &["depth-net", "depth-template"];

#[test]
fn every_plugin_of_the_catalog_conforms() {
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    let configs = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs");
    let suite = Suite::new(&registry).base_dir(configs);
    let suite = DISCOVER.iter().fold(suite, |suite, name| suite.must_discover(*name));
    let suite = FOLLOW.iter().fold(suite, |suite, name| suite.must_follow(*name));
    let failures: Vec<String> = suite.check_all().iter().map(ToString::to_string).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
