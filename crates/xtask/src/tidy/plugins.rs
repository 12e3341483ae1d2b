use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context as _, Result};

use super::defaults;
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

/// The calls that check a plugin against the promises of its kind.
const CONFORMANCE: [&str; 2] = ["assert_conforms(", "check_all("];

/// Page that lists all registered plugins with their settings.
const LIST: &str = "docs/reference/config-keys.md";

/// Plugins that are described on the page of another one of their crate.
const DESCRIBED_WITH: &[(&str, &str)] = &[("depth-net-verifier", "depth-net")];

/// Folders of configs: those of the laboratory try plugins that no config for users recommends yet.
const CONFIGS: &[&str] = &["configs", "benches/papers/configs"];

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
        if !tests_conformance(workspace, &folder)? {
            complaints.push(format!("no test of {folder} calls {}", CONFORMANCE.join(" or ")));
        }
        if !workspace.root().join(&folder).join("README.md").exists() {
            complaints.push(format!("{folder} has no README.md"));
        }
    }
    let pages = pages(workspace)?;
    let settings = workspace.read(LIST)?;
    for (name, of_plugin) in defaults::of_page(&settings) {
        if let Some((file, text)) = pages.get(name) {
            let wrong = defaults::wrong_defaults(text, &of_plugin);
            complaints.extend(wrong.into_iter().map(|wrong| format!("{file} {wrong}")));
        }
    }
    for name in headed(&settings).collect::<BTreeSet<_>>() {
        if !used.contains(name) && !DEFAULTS.contains(&name) {
            complaints.push(format!(
                "no config in configs/ or benches/papers/configs/ uses the plugin `{name}`"
            ));
        }
        match pages.get(page_of(name)) {
            Some((file, text)) => {
                complaints.extend(gaps(text).into_iter().map(|gap| format!("{file} {gap}")));
            }
            None => complaints
                .push(format!("no README.md below plugins/ has the heading `# {}`", page_of(name))),
        }
    }
    Ok(complaints)
}

/// Returns the names of all plugins, as the generated page of their settings lists them.
///
/// # Errors
/// The page cannot be read.
pub fn registered(workspace: &Workspace) -> Result<BTreeSet<String>> {
    Ok(headed(&workspace.read(LIST)?).map(String::from).collect())
}

/// Returns the names in the headings "### `name` (kind)".
fn headed(page: &str) -> impl Iterator<Item = &str> {
    page.lines().filter_map(defaults::named_in)
}

/// Returns the plugin on whose page this one is described.
fn page_of(name: &str) -> &str {
    DESCRIBED_WITH.iter().find(|(plugin, _)| *plugin == name).map_or(name, |(_, page)| page)
}

/// Returns file and text of each README of the plugins, by its heading.
fn pages(workspace: &Workspace) -> Result<BTreeMap<String, (String, String)>> {
    let mut pages = BTreeMap::new();
    for path in workspace.files()? {
        if path.starts_with("plugins") && path.ends_with("README.md") {
            let text = workspace.read(&path)?;
            let heading = text.lines().next().and_then(|line| line.strip_prefix("# "));
            if let Some(heading) = heading.map(str::to_owned) {
                pages.insert(heading, (path.display().to_string(), text));
            }
        }
    }
    Ok(pages)
}

/// Says whether a file of the plugin runs the checks of its kind.
fn tests_conformance(workspace: &Workspace, folder: &str) -> Result<bool> {
    for file in workspace.files()? {
        let is_source = file.starts_with(folder) && file.extension().is_some_and(|e| e == "rs");
        if is_source {
            let text = workspace.read(&file)?;
            let is_called = CONFORMANCE.iter().any(|call| text.contains(call));
            if text.contains("tagalong_conformance::") && is_called {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// Returns the parts that a README lacks, and the lines of the template that it still has.
fn gaps(readme: &str) -> Vec<String> {
    let missing = README_PARTS
        .iter()
        .filter(|part| !readme.lines().any(|line| line.starts_with(**part)))
        .map(|part| format!("has no part `{part}`"));
    let unfilled = PLACEHOLDERS.iter().filter(|text| readme.contains(**text));
    let unfilled = unfilled.map(|text| format!("still says `{text}`, as the template does"));
    missing.chain(unfilled).collect()
}

/// The names after `plugin =` in all shipped configs.
fn used_plugins(workspace: &Workspace) -> Result<BTreeSet<String>> {
    let mut used = BTreeSet::new();
    for file in workspace.files()? {
        let is_config = CONFIGS.iter().any(|folder| file.starts_with(folder));
        if is_config && file.extension().is_some_and(|e| e == "toml") {
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
    fn plugins_are_those_of_the_generated_page() {
        let page = "## Detectors\n\n### `a-b` (detector)\n\n### `c` (filter)\n### other\n";
        assert_eq!(headed(page).collect::<Vec<_>>(), ["a-b", "c"]);
        assert_eq!([page_of("depth-net-verifier"), page_of("ekf")], ["depth-net", "ekf"]);
    }

    #[test]
    fn plugins_are_found_wherever_a_config_names_them() {
        let text = "[[detectors]]\nplugin = \"a\"\n[[detectors]]\nplugin = \"b\"\n[filter]\nplugin = \"c\"";
        let mut used = BTreeSet::new();
        collect_plugins(&toml::from_str(text).unwrap(), &mut used);
        assert_eq!(used.into_iter().collect::<Vec<_>>(), ["a", "b", "c"]);
    }
}
