//! Conformance suite for all plugins of a [`Registry`].
//!
//! A plugin is tested as soon as it is listed: the suite builds it with its default settings, runs
//! it on small simulated scenes (see [`figure`]) and checks the contracts of the traits of
//! `tagalong_core`. A crate outside the workspace runs the same suite over its own registry:
//!
//! ```no_run
//! # fn register(_: &mut tagalong_config::Registry) {}
//! tagalong_conformance::assert_conforms(register);
//! ```
//!
//! A panic inside a plugin is caught and becomes a [`Failure`] that names the plugin and the check.
//! The type of a detector does not show whether it has to find the simulated people (a face
//! detector sees no face in them, and some detectors only find tracked people again), so this has
//! to be demanded by name: [`Suite::must_discover`], [`Suite::must_follow`].

mod associators;
mod controllers;
mod detectors;
pub mod figure;
mod filters;
mod findings;
mod general;
mod likelihoods;
mod managers;
pub mod patch;
pub mod pattern;
pub mod samples;
mod scenes;
mod subject;
pub mod testdata;
mod verdict;
mod verifiers;

use std::collections::BTreeSet;
use std::fmt;
use std::iter::Chain;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::slice;

use tagalong_config::{Context, Kind, Registry};

pub use controllers::target;
use subject::{Subject, WHEELS};
use verdict::{Check, Verdict};

/// Failure of one check by one plugin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Name of the plugin in configs.
    pub plugin: String,
    /// Name of the check, for example `empty scene stays empty`.
    pub check: &'static str,
    /// Observed and expected behaviour.
    pub what: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "plugin `{}` fails the check \"{}\": {}", self.plugin, self.check, self.what)
    }
}

/// Returns the context of plugins in tests: seed 1, paths relative to the working directory, the
/// drive of a small robot.
pub fn context() -> Context {
    Context::new(1, ".", WHEELS)
}

type Checks = Chain<slice::Iter<'static, Check>, slice::Iter<'static, Check>>;

/// The suite for one registry.
pub struct Suite<'a> {
    registry: &'a Registry,
    base_dir: PathBuf,
    discoverers: BTreeSet<String>,
    followers: BTreeSet<String>,
}

impl<'a> Suite<'a> {
    /// Creates a suite without demands on individual detectors.
    pub fn new(registry: &'a Registry) -> Self {
        Self {
            registry,
            base_dir: PathBuf::from("."),
            discoverers: BTreeSet::new(),
            followers: BTreeSet::new(),
        }
    }

    /// Resolves model files of default settings against `dir`.
    pub fn base_dir(mut self, dir: impl Into<PathBuf>) -> Self {
        self.base_dir = dir.into();
        self
    }

    /// Demands that this detector discovers the simulated person.
    pub fn must_discover(mut self, detector: impl Into<String>) -> Self {
        self.discoverers.insert(detector.into());
        self
    }

    /// Demands that this detector finds the simulated person again near a track.
    pub fn must_follow(mut self, detector: impl Into<String>) -> Self {
        self.followers.insert(detector.into());
        self
    }

    /// Returns all failures of all plugins. A demand on a detector that is not registered is a
    /// failure as well, and so is a registry without plugins.
    #[must_use = "broken promises are returned, not asserted"]
    pub fn check_all(&self) -> Vec<Failure> {
        let mut failures = self.unmet_demands();
        // Without this check, a `register` that does nothing would pass.
        if self.registry.plugins().next().is_none() {
            let what = "the registry has no plugin to check".to_owned();
            failures.push(failure("(none)", "is registered", what));
        }
        for info in self.registry.plugins() {
            failures.extend(self.check(info.name));
        }
        failures
    }

    /// Returns all failures of one plugin.
    #[must_use = "broken promises are returned, not asserted"]
    pub fn check(&self, plugin: &str) -> Vec<Failure> {
        self.check_where(plugin, |_| true)
    }

    /// Returns the failures of one check (see [`check_names`]) on one plugin.
    #[must_use = "broken promises are returned, not asserted"]
    pub fn check_one(&self, plugin: &str, check: &str) -> Vec<Failure> {
        self.check_where(plugin, |name| name == check)
    }

    fn check_where(&self, plugin: &str, wanted: impl Fn(&str) -> bool) -> Vec<Failure> {
        let info = match self.registry.find(plugin) {
            Ok(info) => info,
            Err(error) => return vec![failure(plugin, "is registered", error.to_string())],
        };
        let subject = Subject {
            registry: self.registry,
            info,
            base_dir: &self.base_dir,
            must_discover: self.discoverers.contains(plugin),
            must_follow: self.followers.contains(plugin),
        };
        let (name, builds) = general::BUILDS;
        // The other checks need a plugin that can be built.
        if let Some(broken) = run(&subject, name, builds) {
            return vec![broken];
        }
        let checks = general::CHECKS.iter().chain(checks_of(info.kind));
        let wanted = checks.filter(|(name, _)| wanted(name));
        wanted.filter_map(|(name, check)| run(&subject, name, *check)).collect()
    }

    fn unmet_demands(&self) -> Vec<Failure> {
        let demanded = self.discoverers.union(&self.followers);
        demanded
            .filter_map(|name| match self.registry.find(name) {
                Ok(info) if info.kind == Kind::Detector => None,
                Ok(info) => {
                    let what = format!("is a {}, but must find people", info.kind);
                    Some(failure(name, "is a detector", what))
                }
                Err(error) => Some(failure(name, "is registered", error.to_string())),
            })
            .collect()
    }
}

/// Runs [`Suite::check_all`] without demands on individual detectors.
#[must_use = "broken promises are returned, not asserted"]
pub fn check_all(registry: &Registry) -> Vec<Failure> {
    Suite::new(registry).check_all()
}

/// Asserts that all plugins of a `register` function pass [`check_all`].
///
/// # Panics
/// If there are failures, with all of them.
#[track_caller]
pub fn assert_conforms(register: impl FnOnce(&mut Registry)) {
    let mut registry = Registry::default();
    register(&mut registry);
    let failures = check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}

/// Returns the names of all checks that apply to a kind of plugin.
pub fn check_names(kind: Kind) -> Vec<&'static str> {
    let checks = general::CHECKS.iter().chain(checks_of(kind));
    std::iter::once(general::BUILDS.0).chain(checks.map(|(name, _)| *name)).collect()
}

fn checks_of(kind: Kind) -> Checks {
    let (own, more): (&[Check], &[Check]) = match kind {
        Kind::Detector => (detectors::CHECKS, likelihoods::CHECKS),
        Kind::Verifier => (verifiers::CHECKS, &[]),
        Kind::Associator => (associators::CHECKS, &[]),
        Kind::Filter => (filters::CHECKS, &[]),
        Kind::Manager => (managers::CHECKS, &[]),
        Kind::Controller => (controllers::CHECKS, &[]),
    };
    own.iter().chain(more)
}

fn run(
    subject: &Subject<'_>,
    name: &'static str,
    check: fn(&Subject<'_>) -> Verdict,
) -> Option<Failure> {
    // Each check builds its own plugins, so a panic leaves no broken state for later checks.
    let outcome = catch_unwind(AssertUnwindSafe(|| check(subject)));
    let what = match outcome {
        Ok(Ok(())) => return None,
        Ok(Err(what)) => what,
        Err(panic) => format!("it panicked: {}", panic_text(panic.as_ref())),
    };
    Some(failure(subject.info.name, name, what))
}

fn failure(plugin: &str, check: &'static str, what: String) -> Failure {
    Failure { plugin: plugin.to_owned(), check, what }
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a message")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_registry_without_plugins_fails() {
        let failures = check_all(&Registry::default());
        assert_eq!(failures.len(), 1, "{failures:?}");
    }
}
