//! Every check of the conformance suite can fail: a healthy plugin of each kind passes, and for
//! each check there is a copy of it with one deliberate fault that is caught by that check.

mod broken;

use std::collections::BTreeSet;

use tagalong_config::{Kind, Registry};
use tagalong_conformance::{Suite, check_names};

/// Checks that the healthy plugin passes, that each fault is caught by its check, and that there is
/// a fault for every check of the kind.
fn proves(
    kind: Kind,
    register: impl Fn(&mut Registry, &'static str),
    faults: &[(&'static str, &'static str)],
) {
    let mut registry = Registry::default();
    register(&mut registry, "healthy");
    faults.iter().for_each(|(fault, _)| register(&mut registry, fault));
    let demanding = |name| match kind {
        Kind::Detector => Suite::new(&registry).must_discover(name).must_follow(name),
        _ => Suite::new(&registry),
    };
    let complaints: Vec<_> =
        demanding("healthy").check("healthy").iter().map(ToString::to_string).collect();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
    for (fault, check) in faults {
        let failures = demanding(fault).check_one(fault, check);
        let caught = failures.iter().any(|failure| failure.check == *check);
        assert!(caught, "{kind} `{fault}` passes \"{check}\": {failures:?}");
    }
    let proven: BTreeSet<&str> = faults.iter().map(|(_, check)| *check).collect();
    let unproven: Vec<&str> =
        check_names(kind).into_iter().filter(|check| !proven.contains(check)).collect();
    assert!(unproven.is_empty(), "no broken {kind} proves {unproven:?}");
}

/// Faults that a plugin of any kind can have.
const GENERAL: [(&str, &str); 5] = [
    ("cannot-build", "is built from its defaults"),
    ("default-out-of-range", "defaults survive TOML"),
    ("unknown-accepted", "an unknown key is refused and named"),
    ("undocumented", "every setting is documented"),
    ("no-summary", "has a summary"),
];

fn with_general(own: &[(&'static str, &'static str)]) -> Vec<(&'static str, &'static str)> {
    GENERAL.iter().chain(own).copied().collect()
}

#[test]
fn every_check_of_detectors_can_fail() {
    let faults = with_general(&[
        ("panics", "never panics on odd frames"),
        ("vague", "a missing image is an error that names it"),
        ("secretive", "images that it does not declare do not matter"),
        ("easy-going", "it does without what it does not require"),
        ("modest", "it has the roles that it declares and no others"),
        ("moody", "same seed, same output"),
        ("denies", "who does not remember answers the question alone"),
        ("beside-the-image", "regions lie in the image"),
        ("lopsided", "covariance is symmetric and positive"),
        ("wanders", "near results lie in the window"),
        ("ghosts", "an empty scene stays empty"),
        ("blind", "one person at 2 m is found"),
        ("short-sighted", "a person is found near their track"),
        ("remembers", "people who left are forgotten"),
        ("borrows-a-name", "its tests have names of their own"),
        ("advises-on-others", "its tests have names of their own"),
        ("likes-left", "likelihood: the true scene outweighs a shifted one"),
        ("first-only", "likelihood: the order of people does not matter"),
        ("infinite", "likelihood: is finite on odd scenes"),
        ("hurries", "likelihood: many scenes weigh what each weighs alone"),
        ("imagines", "likelihood: a missing image is named"),
    ]);
    proves(Kind::Detector, broken::detector::register, &faults);
}

#[test]
fn every_check_of_verifiers_can_fail() {
    let faults = with_general(&[
        ("panics", "never panics on odd frames"),
        ("vague", "a missing image is an error that names it"),
        ("secretive", "images that it does not declare do not matter"),
        ("easy-going", "it does without what it does not require"),
        ("moody", "same seed, same output"),
        ("changes-its-mind", "the same candidate gets the same margin"),
    ]);
    proves(Kind::Verifier, broken::verifier::register, &faults);
}

#[test]
fn every_check_of_filters_can_fail() {
    let faults = with_general(&[
        ("panics", "never panics on odd frames"),
        ("moody", "same seed, same output"),
        ("lopsided", "covariance stays positive"),
        ("sure", "uncertainty grows without evidence"),
        ("forgets-the-robot", "a standing person stands still in the world"),
        ("never-moves", "a walking person is kept up with"),
        ("never-stops", "stop forgets"),
        ("swaps", "ids never mix"),
    ]);
    proves(Kind::Filter, broken::filter::register, &faults);
}

#[test]
fn every_check_of_controllers_can_fail() {
    let faults = with_general(&[
        ("panics", "never panics on odd frames"),
        ("moody", "same seed, same output"),
        ("never-stops", "no target means stop"),
        ("reckless", "speeds are finite and bounded"),
        ("one-sided", "a mirrored target gives mirrored wheels"),
    ]);
    proves(Kind::Controller, broken::controller::register, &faults);
}

#[test]
fn a_demand_on_a_plugin_that_is_not_there_fails() {
    let registry = Registry::default();
    let failures = Suite::new(&registry).must_discover("nobody").check_all();
    // An empty registry is a failure of its own.
    assert_eq!(failures.len(), 2, "{failures:#?}");
    let demanded = failures.iter().find(|failure| failure.to_string().contains("`nobody`"));
    assert!(demanded.is_some(), "{failures:#?}");
}
