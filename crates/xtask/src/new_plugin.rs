//! Writes a plugin crate that builds, keeps the promises of its kind, and does
//! as little as that allows.

use std::collections::BTreeSet;
use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};
use clap::ValueEnum;

use crate::tidy::plugins;
use crate::workspace::{Workspace, succeed};

/// The six kinds of plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// Finds people in images.
    Detector,
    /// Judges the detections of a detector.
    Verifier,
    /// Decides which detection belongs to which track.
    Associator,
    /// Estimates the states of people over time.
    Filter,
    /// Decides when tracks start, are confirmed, and end.
    #[value(alias = "track-manager")]
    Manager,
    /// Steers after one of them.
    Controller,
}

/// The files that differ between the kinds.
struct Template {
    /// The source file of the verb, and its text.
    verb: (&'static str, &'static str),
    lib: &'static str,
    config: &'static str,
    readme: &'static str,
    pipeline: &'static str,
}

macro_rules! template {
    ($folder:literal, $verb:literal) => {
        Template {
            verb: ($verb, include_str!(concat!("../templates/", $folder, "/", $verb, ".rs.txt"))),
            lib: include_str!(concat!("../templates/", $folder, "/lib.rs.txt")),
            config: include_str!(concat!("../templates/", $folder, "/config.rs.txt")),
            readme: include_str!(concat!("../templates/", $folder, "/README.md.txt")),
            pipeline: include_str!(concat!("../templates/", $folder, "/pipeline.toml.txt")),
        }
    };
}

const MANIFEST: &str = include_str!("../templates/Cargo.toml.txt");

impl Kind {
    fn template(self) -> Template {
        match self {
            Self::Detector => template!("detector", "detect"),
            Self::Verifier => template!("verifier", "verify"),
            Self::Associator => template!("associator", "associate"),
            Self::Filter => template!("filter", "filter"),
            Self::Manager => template!("manager", "manage"),
            Self::Controller => template!("controller", "control"),
        }
    }
}

/// Writes the crate, its lines in the workspace and the catalog, and a config that is built in.
/// Nothing is written if anything is in the way.
pub fn create(workspace: &Workspace, kind: Kind, name: &str) -> Result<()> {
    // All checks come first, so that a wrong name leaves nothing behind.
    check_name(workspace, name)?;
    let lists = lists_with(workspace, name)?;
    for (path, text) in files_of(kind, name) {
        workspace.write(path, &text)?;
    }
    lists.iter().try_for_each(|(path, text)| workspace.write(path, text))
}

/// Returns the files of a plugin, by their paths relative to the root.
fn files_of(kind: Kind, name: &str) -> Vec<(String, String)> {
    let template = kind.template();
    let folder = format!("plugins/{name}");
    let (verb, verb_text) = template.verb;
    let files = [
        (format!("{folder}/Cargo.toml"), MANIFEST),
        (format!("{folder}/README.md"), template.readme),
        (format!("{folder}/src/lib.rs"), template.lib),
        (format!("{folder}/src/config.rs"), template.config),
        (format!("{folder}/src/{verb}.rs"), verb_text),
        (format!("configs/{name}.toml"), template.pipeline),
    ];
    files.map(|(path, text)| (path, fill(text, name))).into()
}

/// Returns the files of a plugin for each kind that it may be of.
pub fn generated(name: &str) -> Vec<Vec<(String, String)>> {
    Kind::value_variants().iter().map(|kind| files_of(*kind, name)).collect()
}

/// Formats the new crate: where a line breaks depends on the length of its name.
pub fn format(workspace: &Workspace, name: &str) -> Result<()> {
    let mut cargo = Command::new("cargo");
    cargo.args(["fmt", "-p", &format!("tagalong-{name}")]);
    succeed(cargo.current_dir(workspace.root()))
}

/// Returns the next steps with the new crate, in a few lines.
pub fn what_now(kind: Kind, name: &str) -> String {
    let verb = kind.template().verb.0;
    let tried = if kind == Kind::Controller {
        format!("follow configs/{name}.toml configs/scenes/follow-passing.toml --seeds 1")
    } else {
        format!("run configs/{name}.toml LOG.mcap --overlay")
    };
    format!(
        "plugins/{name} is written, listed in crates/catalog and used by configs/{name}.toml, which is built\n\
         in. Say in its first line for what it is to be taken.\n\
         Write the method in plugins/{name}/src/{verb}.rs, its settings in src/config.rs, then\n\
         \n    cargo test -p tagalong-{name} && cargo test -p tagalong-tests --test conformance\n    \
         cargo run --release -- {tried}\n\n\
         `cargo xtask new-plugin --remove {name}` takes it away again.\n"
    )
}

fn is_word(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())
}

/// Checks that a name can be that of a plugin.
pub fn check_form(name: &str) -> Result<()> {
    let well_formed = name.starts_with(|c: char| c.is_ascii_lowercase())
        // Names become parts of crate names, module names and paths.
        && name.split('-').all(is_word);
    ensure!(
        well_formed,
        "`{name}` cannot name a plugin: use lower-case words joined by hyphens, like `leg-width`"
    );
    Ok(())
}

fn check_name(workspace: &Workspace, name: &str) -> Result<()> {
    check_form(name)?;
    let mut taken: BTreeSet<String> = workspace.folders("crates")?.into_iter().collect();
    taken.extend(["tests", "benches", "config", "pipeline"].map(String::from));
    ensure!(
        !taken.contains(name),
        "`{name}` is the name of a crate or command of the workspace: choose another"
    );
    // Some plugins share a crate, so that no folder has their name.
    let plugins = plugins::registered(workspace).unwrap_or_default();
    ensure!(!plugins.contains(name), "`{name}` is a plugin already: choose another name");
    for path in [format!("plugins/{name}"), format!("configs/{name}.toml")] {
        if workspace.root().join(&path).exists() {
            bail!("{path} exists already: choose another name, or remove it first");
        }
    }
    Ok(())
}

/// The file that lists the configs of the program.
const BUILT_IN: &str = "crates/pipeline/src/config/builtin.rs";

/// The files that list all plugins and their configs, with the new one in its place.
fn lists_with(workspace: &Workspace, name: &str) -> Result<[(&'static str, String); 4]> {
    let [root, catalog, register, config] = lines_of(name);
    Ok([
        list_with(workspace, root, |line| {
            line.starts_with("tagalong-") && line.contains("path = \"plugins/")
        })?,
        list_with(workspace, catalog, |line| line.starts_with("tagalong-"))?,
        list_with(workspace, register, |line| {
            line.starts_with("    tagalong_") && line.ends_with("::register(registry);")
        })?,
        list_with(workspace, config, |line| {
            // The lines of the macro, and none of a list with commas.
            line.starts_with("    \"") && line.ends_with('"')
        })?,
    ])
}

/// Returns the lists of all plugins and their configs, each with the line of a plugin.
pub fn lines_of(name: &str) -> [(&'static str, String); 4] {
    let package = format!("tagalong-{name}");
    let register = format!("    {}::register(registry);", package.replace('-', "_"));
    [
        ("Cargo.toml", dependency(name)),
        ("crates/catalog/Cargo.toml", format!("{package}.workspace = true")),
        ("crates/catalog/src/lib.rs", register),
        (BUILT_IN, format!("    \"{name}\"")),
    ]
}

/// A file and its text with one more line among its siblings.
fn list_with(
    workspace: &Workspace,
    (path, line): (&'static str, String),
    is_sibling: fn(&str) -> bool,
) -> Result<(&'static str, String)> {
    let text = insert_sorted(&workspace.read(path)?, &line, is_sibling);
    Ok((path, text.with_context(|| format!("{path}: no place for the line `{line}`"))?))
}

/// Returns the line of a plugin in the dependencies of the workspace, whose crates share a version.
fn dependency(name: &str) -> String {
    let version = env!("CARGO_PKG_VERSION");
    format!("tagalong-{name} = {{ version = \"{version}\", path = \"plugins/{name}\" }}")
}

/// `text` with `line` before the first sibling that sorts after it, else after
/// the last one; `None` if there is no sibling at all.
fn insert_sorted(text: &str, line: &str, is_sibling: fn(&str) -> bool) -> Option<String> {
    let mut lines: Vec<&str> = text.lines().collect();
    let siblings: Vec<usize> = (0..lines.len()).filter(|i| is_sibling(lines[*i])).collect();
    // Before the first sibling that is greater, so that lists stay sorted.
    let after = siblings.iter().find(|i| lines[**i] > line).copied();
    lines.insert(after.or(siblings.last().map(|last| last + 1))?, line);
    Some(lines.join("\n") + "\n")
}

/// Puts the names of the plugin into a template.
fn fill(text: &str, name: &str) -> String {
    text.replace("@NAME@", name)
        .replace("@CRATE@", &format!("tagalong_{}", name.replace('-', "_")))
        .replace("@TYPE@", &type_name(name))
}

/// `leg-width` as `LegWidth`.
fn type_name(name: &str) -> String {
    name.split('-')
        .map(|word| {
            let (first, rest) = word.split_at(1);
            first.to_uppercase() + rest
        })
        .collect()
}

/// Returns a workspace with one plugin, `b`, for tests.
#[cfg(test)]
pub fn small_workspace() -> (tempfile::TempDir, Workspace) {
    let folder = tempfile::tempdir().unwrap();
    let workspace = Workspace::at(folder.path());
    let lines = format!("{}\n\n[profile]\n", dependency("b"));
    workspace.write("Cargo.toml", &lines).unwrap();
    workspace.write("plugins/b/Cargo.toml", "").unwrap();
    workspace.write("crates/catalog/Cargo.toml", "tagalong-b.workspace = true\n").unwrap();
    let register = "fn f() {\n    tagalong_b::register(registry);\n}\n";
    workspace.write("crates/catalog/src/lib.rs", register).unwrap();
    let configs = "const BUILT_IN: &[C] = configs! {\n    \"b\"\n};\n";
    workspace.write(BUILT_IN, configs).unwrap();
    (folder, workspace)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_plugin_is_listed_in_order() {
        let (_folder, workspace) = small_workspace();
        create(&workspace, Kind::Filter, "a-filter").unwrap();
        create(&workspace, Kind::Detector, "c").unwrap();
        let catalog = workspace.read("crates/catalog/src/lib.rs").unwrap();
        let expected = "fn f() {\n    tagalong_a_filter::register(registry);\n    \
                        tagalong_b::register(registry);\n    tagalong_c::register(registry);\n}\n";
        assert_eq!(catalog, expected);
        let root = workspace.read("Cargo.toml").unwrap();
        assert!(root.starts_with(&(dependency("a-filter") + "\n")), "{root}");
        assert!(workspace.read("plugins/a-filter/src/filter.rs").unwrap().contains("AFilter"));
        let configs = workspace.read(BUILT_IN).unwrap();
        assert!(configs.contains("{\n    \"a-filter\"\n    \"b\"\n    \"c\"\n}"), "{configs}");
    }

    #[test]
    fn no_placeholder_is_left() {
        let (_folder, workspace) = small_workspace();
        for (kind, name) in Kind::value_variants().iter().zip(["d", "v", "a", "f", "m", "e"]) {
            create(&workspace, *kind, name).unwrap();
            let config = workspace.read(format!("configs/{name}.toml")).unwrap();
            assert!(config.starts_with("# Take this ") && !config.contains('@'), "{config}");
            let verb = format!("src/{}.rs", kind.template().verb.0);
            for file in ["Cargo.toml", "README.md", "src/lib.rs", "src/config.rs", &verb] {
                let text = workspace.read(format!("plugins/{name}/{file}")).unwrap();
                assert!(!text.contains('@'), "{kind:?} {file}: {text}");
            }
        }
    }

    #[test]
    fn bad_and_taken_names_are_refused_and_nothing_is_written() {
        let (_folder, workspace) = small_workspace();
        for (name, why) in [
            ("Leg", "lower-case"),
            ("a--b", "lower-case"),
            ("../x", "lower-case"),
            ("3d", "lower-case"),
            ("", "lower-case"),
            ("b", "exists already"),
            ("catalog", "a crate or command of the workspace"),
        ] {
            let error = create(&workspace, Kind::Detector, name).unwrap_err().to_string();
            assert!(error.contains(why), "{name}: {error}");
        }
        assert_eq!(workspace.folders("plugins").unwrap(), ["b"]);
    }

    #[test]
    fn a_missing_list_is_an_error_before_anything_is_written() {
        let (_folder, workspace) = small_workspace();
        workspace.write("crates/catalog/src/lib.rs", "fn f() {}\n").unwrap();
        let error = create(&workspace, Kind::Detector, "c").unwrap_err().to_string();
        assert!(error.contains("crates/catalog/src/lib.rs"), "{error}");
        assert_eq!(workspace.folders("plugins").unwrap(), ["b"]);
    }
}
