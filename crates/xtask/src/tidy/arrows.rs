use std::collections::BTreeMap;

use anyhow::Result;

use crate::metadata::{Metadata, Package};
use crate::workspace::Workspace;

/// Allowed dependencies between the folders of `crates/`, apart from dev-dependencies. The table in
/// `crates/README.md` says why.
const ARROWS: &[(&str, &[&str])] = &[
    ("math", &[]),
    ("geometry", &[]),
    ("core", &[]),
    ("config", &[]),
    ("vision", &[]),
    ("learn", &[]),
    ("network", &[]),
    ("stereo", &["vision"]),
    ("tracking", &["vision"]),
    ("following", &["tracking", "vision"]),
    ("pipeline", &["stereo", "tracking", "following", "network", "vision", "catalog"]),
    ("log", &["vision"]),
    // The library for other programs: it wires the parts and is what they see.
    ("tagalong", &["pipeline", "log", "tracking", "vision"]),
    ("sim", &[]),
    ("serve", &[]),
    ("eval", &[]),
    ("report", &["eval"]),
    ("trials", &["vision", "stereo", "pipeline", "sim", "eval"]),
    ("conformance", &[]),
    ("catalog", &["plugins"]),
    ("app", &["tagalong", "pipeline", "log", "network", "eval"]),
    ("render", &["pipeline", "log", "vision"]),
    (
        "simulate",
        &["app", "eval", "render", "vision", "stereo", "pipeline", "log", "sim", "trials"],
    ),
    ("doctor", &["tagalong", "app", "render", "vision", "pipeline", "log"]),
    ("annotate", &["app", "render", "report", "log", "eval", "pipeline", "serve"]),
    ("view", &["app", "report", "render", "log", "eval", "pipeline", "serve"]),
    ("training", &["app", "stereo", "pipeline", "log", "sim", "eval", "trials"]),
    (
        "benchmark",
        &[
            "app", "simulate", "pipeline", "render", "log", "sim", "eval", "trials", "report",
            "learn",
        ],
    ),
    ("import", &["app", "log", "eval", "sim"]),
    (
        "cli",
        &[
            "annotate",
            "app",
            "benchmark",
            "catalog",
            "doctor",
            "eval",
            "import",
            "log",
            "network",
            "pipeline",
            "render",
            "sim",
            "simulate",
            "tagalong",
            "training",
            "view",
        ],
    ),
    ("fuzz", &["log", "eval", "import", "pipeline", "sim", "catalog", "plugins"]),
    ("xtask", &[]),
];

/// The words of the project, from the ground up: each may use those before it, and every other
/// crate may use all of them.
const WORDS: &[&str] = &["math", "geometry", "core", "config"];

/// Crates that a plugin may depend on.
const OF_PLUGINS: &[&str] = &["vision", "learn", "network"];

/// Crates that the tests of any crate may depend on in addition.
const FOR_TESTS: &[&str] = &["vision", "learn", "sim", "conformance", "catalog", "plugins"];

/// Complains about every wrong arrow.
pub fn check(workspace: &Workspace, metadata: &Metadata) -> Result<Vec<String>> {
    let members = metadata.members(workspace.root());
    let folder_of: BTreeMap<&str, &str> =
        members.iter().map(|(folder, p)| (p.name.as_str(), folder.as_str())).collect();
    let mut complaints = Vec::new();
    for (folder, package) in &members {
        let Some(allowed) = allowed(folder) else {
            let file = "crates/xtask/src/tidy/arrows.rs";
            complaints.push(format!("{folder}: {file} does not say what it may depend on"));
            continue;
        };
        complaints.extend(misnamed(folder, package));
        for (target, dev) in targets(package, &folder_of) {
            if !may(folder, allowed, target, dev) {
                let dev = if dev { " in its tests" } else { "" };
                complaints.push(format!("{folder} must not depend on {target}{dev}"));
            }
        }
    }
    Ok(complaints)
}

/// `None` for a folder that nothing is known about; `Some(None)` for those that
/// may use everything.
fn allowed(folder: &str) -> Option<Option<&'static [&'static str]>> {
    match folder.split_once('/') {
        Some(("plugins", _)) => Some(Some(OF_PLUGINS)),
        Some(("crates", room)) => {
            ARROWS.iter().find(|(name, _)| *name == room).map(|(_, allowed)| Some(*allowed))
        }
        // Programs beside ours: no crate depends on them.
        Some(("bridges", _)) => Some(None),
        _ => matches!(folder, "tests" | "benches" | "benches/papers").then_some(None),
    }
}

/// The folders in the workspace that a package depends on, and whether only its
/// tests do.
fn targets<'a>(
    package: &'a Package,
    folder_of: &'a BTreeMap<&str, &str>,
) -> impl Iterator<Item = (&'a str, bool)> {
    package.dependencies.iter().filter_map(|dependency| {
        let folder = folder_of.get(dependency.name.as_str())?;
        Some((*folder, dependency.kind.as_deref() == Some("dev")))
    })
}

fn may(folder: &str, allowed: Option<&[&str]>, target: &str, dev: bool) -> bool {
    let Some(allowed) = allowed else { return true };
    let room = match target.split_once('/') {
        Some(("plugins", _)) => "plugins",
        Some((_, room)) => room,
        None => target,
    };
    // Plugins stand alone, in their tests, too.
    let other_plugin = room == "plugins" && folder.starts_with("plugins/");
    let is_whole = matches!(folder, "crates/cli" | "crates/tagalong");
    let free_tests = dev && !other_plugin && (FOR_TESTS.contains(&room) || is_whole);
    target == folder || is_word(folder, room) || allowed.contains(&room) || free_tests
}

/// Returns true if `target` is one of [`WORDS`] that `folder` may use.
fn is_word(folder: &str, target: &str) -> bool {
    fn place(name: &str) -> Option<usize> {
        WORDS.iter().position(|word| *word == name)
    }

    let own = folder.strip_prefix("crates/").and_then(place);
    place(target).is_some_and(|target| own.is_none_or(|own| target < own))
}

fn misnamed(folder: &str, package: &Package) -> Option<String> {
    let name = folder.rsplit('/').next().unwrap_or(folder);
    let expected = if name == "tagalong" { name.to_owned() } else { format!("tagalong-{name}") };
    (package.name != expected)
        .then(|| format!("{folder}: the package is called `{}`, not `{expected}`", package.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wrong(folder: &str, target: &str, dev: bool) -> bool {
        !may(folder, allowed(folder).unwrap(), target, dev)
    }

    #[test]
    fn arrows_point_from_plugins_to_the_words() {
        assert!(!wrong("plugins/filters", "crates/core", false));
        assert!(!wrong("plugins/filters", "crates/conformance", true));
        assert!(!wrong("crates/catalog", "plugins/filters", false));
        assert!(!wrong("tests", "plugins/filters", false));
        assert!(!wrong("benches/papers", "crates/cli", false));
        assert!(wrong("plugins/filters", "crates/conformance", false));
        assert!(wrong("plugins/filters", "plugins/depth-template", true));
        assert!(wrong("plugins/filters", "crates/pipeline", true));
        assert!(wrong("crates/core", "crates/vision", false));
        assert!(!wrong("crates/core", "crates/geometry", false));
        assert!(wrong("crates/core", "crates/config", false));
        assert!(wrong("crates/geometry", "crates/core", false));
        assert!(wrong("crates/pipeline", "plugins/filters", false));
        assert!(wrong("crates/cli", "plugins/filters", false));
        assert!(!wrong("crates/cli", "crates/doctor", false));
        assert!(wrong("crates/app", "crates/doctor", false));
        assert!(wrong("crates/doctor", "crates/training", false));
        assert!(allowed("crates/attic").is_none());
    }
}
