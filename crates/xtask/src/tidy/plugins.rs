use std::collections::BTreeSet;

use anyhow::{Context as _, Result};

use crate::metadata::Metadata;
use crate::workspace::Workspace;

/// Headings that the README of a plugin must have, as beginnings.
const README_PARTS: &[&str] = &["**Source**", "**Needs**", "## Where we differ from the paper"];

/// Text of the README of a generated plugin until its author writes something there.
const PLACEHOLDERS: &[&str] = &[
    "Say in a paragraph what the method is",
    "authors, *title*, where and when",
    "| what it says | what is done instead",
];

/// The call that checks a plugin against the promises of its kind.
const CONFORMANCE: &str = "check_all(";

/// Plugins that a config has without naming them.
const DEFAULTS: &[&str] = &["associate-hungarian", "manage-m-of-n"];

/// Complains about plugins that are not listed, described or used.
pub fn check(workspace: &Workspace, metadata: &Metadata) -> Result<Vec<String>> {
    let members = metadata.members(workspace.root());
    let catalog = members.get("crates/catalog").context("there is no crates/catalog")?;
    let list = workspace.read("crates/catalog/src/lib.rs")?;
    let used = used_plugins(workspace)?;
    let mut complaints = Vec::new();
    for name in workspace.folders("plugins")? {
        let folder = format!("plugins/{name}");
        let Some(package) = members.get(&folder) else {
            complaints.push(format!("{folder} is no package of the workspace"));
            continue;
        };
        let call = format!("{}::register(registry);", package.name.replace('-', "_"));
        if !list.contains(&call) || !catalog.dependencies.iter().any(|d| d.name == package.name) {
            complaints.push(format!("{folder} is not listed in crates/catalog"));
        }
        if !used.contains(&name) && !DEFAULTS.contains(&name.as_str()) {
            complaints.push(format!("no config in configs/ uses the plugin `{name}`"));
        }
        if !tests_conformance(workspace, &folder)? {
            complaints.push(format!("no test of {folder} calls {CONFORMANCE}"));
        }
        complaints.extend(readme_gaps(workspace, &folder));
    }
    Ok(complaints)
}

/// Says whether a file of the plugin runs the checks of its kind.
fn tests_conformance(workspace: &Workspace, folder: &str) -> Result<bool> {
    for file in workspace.files()? {
        let is_source = file.starts_with(folder) && file.extension().is_some_and(|e| e == "rs");
        if is_source {
            let text = workspace.read(&file)?;
            if text.contains("tagalong_conformance::") && text.contains(CONFORMANCE) {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

fn readme_gaps(workspace: &Workspace, folder: &str) -> Vec<String> {
    let Ok(text) = workspace.read(format!("{folder}/README.md")) else {
        return vec![format!("{folder} has no README.md")];
    };
    gaps(&text).into_iter().map(|gap| format!("{folder}/README.md {gap}")).collect()
}

/// Returns the parts that a README lacks, and the lines of the template that it still has.
fn gaps(readme: &str) -> Vec<String> {
    let lacks = |part: &&&str| !readme.lines().any(|line| line.starts_with(**part));
    let missing = README_PARTS.iter().filter(lacks).map(|part| format!("has no part `{part}`"));
    let unfilled = PLACEHOLDERS.iter().filter(|text| readme.contains(**text));
    let unfilled = unfilled.map(|text| format!("still says `{text}`, as the template does"));
    missing.chain(unfilled).collect()
}

/// The names after `plugin =` in all shipped configs.
fn used_plugins(workspace: &Workspace) -> Result<BTreeSet<String>> {
    let mut used = BTreeSet::new();
    for file in workspace.files()? {
        if file.starts_with("configs") && file.extension().is_some_and(|e| e == "toml") {
            let table: toml::Table = toml::from_str(&workspace.read(&file)?)
                .with_context(|| format!("{} is no TOML", file.display()))?;
            collect_plugins(&toml::Value::Table(table), &mut used);
        }
    }
    Ok(used)
}

fn collect_plugins(value: &toml::Value, used: &mut BTreeSet<String>) {
    match value {
        toml::Value::Table(table) => {
            used.extend(table.get("plugin").and_then(|v| v.as_str()).map(String::from));
            table.values().for_each(|inner| collect_plugins(inner, used));
        }
        toml::Value::Array(values) => values.iter().for_each(|v| collect_plugins(v, used)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the README of every template: it has all parts, and nothing in them yet.
    #[test]
    fn the_readme_of_a_template_has_to_be_filled_in() {
        let templates = concat!(env!("CARGO_MANIFEST_DIR"), "/templates");
        let folders = std::fs::read_dir(templates).unwrap().map(|entry| entry.unwrap().path());
        let readmes = folders
            .filter(|folder| folder.is_dir())
            .map(|folder| std::fs::read_to_string(folder.join("README.md.txt")).unwrap());
        let readmes: Vec<String> = readmes.collect();
        assert_eq!(readmes.len(), 6, "one for each kind of plugin");
        for readme in &readmes {
            let gaps = gaps(readme);
            assert_eq!(gaps.len(), PLACEHOLDERS.len(), "{gaps:?}");
            assert!(gaps.iter().all(|gap| gap.starts_with("still says")), "{gaps:?}");
        }
        let filled = PLACEHOLDERS.iter().fold(readmes[0].clone(), |text, p| text.replace(p, "x"));
        assert!(gaps(&filled).is_empty());
        assert_eq!(gaps("**Source**: us\n**Needs**: a camera\n").len(), 1);
    }

    #[test]
    fn plugins_are_found_wherever_a_config_names_them() {
        let text = "[[detectors]]\nplugin = \"a\"\n[[detectors]]\nplugin = \"b\"\n[filter]\nplugin = \"c\"";
        let mut used = BTreeSet::new();
        collect_plugins(&toml::from_str(text).unwrap(), &mut used);
        assert_eq!(used.into_iter().collect::<Vec<_>>(), ["a", "b", "c"]);
    }
}
