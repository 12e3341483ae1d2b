//! A short run of every parser; `cargo run --release -p tagalong-fuzz` is the long one.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use tagalong_fuzz::{run, targets, tried};

/// Files for each parser: seconds for all of them together.
const FILES: u64 = 300;

#[test]
fn no_parser_panics_on_mutated_files() {
    let folder = tempfile::tempdir().unwrap();
    for target in targets() {
        let path = folder.path().join(target.name);
        let outcome = run(&target, FILES, 11, &path, || ());
        assert!(outcome.finding.is_none(), "{}: {:?}", target.name, outcome.finding);
        assert_eq!(outcome.files, FILES);
    }
}

#[test]
fn every_parser_takes_its_seeds() {
    let folder = tempfile::tempdir().unwrap();
    for target in targets() {
        assert!(!target.seeds.is_empty(), "{}", target.name);
        for seed in &target.seeds {
            let (_, why) = tried(&target, seed, &folder.path().join(target.name));
            assert!(why.is_none(), "{}: {why:?}", target.name);
        }
    }
}

/// A panic and a file that takes too long are findings.
#[test]
fn what_goes_wrong_is_found() {
    let mut target = targets().swap_remove(0);
    target.parse = |bytes, _| assert!(bytes.len() > 2, "too short: {}", bytes.len());
    let (_, why) = tried(&target, b"ab", std::path::Path::new("x"));
    assert_eq!(why.as_deref(), Some("panics: too short: 2"));
    target.parse = |_, _| {
        let start = cpu_time::ThreadTime::now();
        while start.elapsed().as_secs_f64() < 1.1 {}
    };
    let (_, why) = tried(&target, b"ab", std::path::Path::new("x"));
    assert!(why.is_some_and(|why| why.starts_with("takes ")));
}
