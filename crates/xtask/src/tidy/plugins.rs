use std::collections::BTreeSet;

use anyhow::{Context as _, Result};

use crate::metadata::Metadata;
use crate::workspace::Workspace;

/// Headings that the README of a plugin must have, as beginnings.
const README_PARTS: &[&str] = &["**Source**", "**Needs**", "## Where we differ from the paper"];

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
        complaints.extend(readme_gaps(workspace, &folder));
    }
    Ok(complaints)
}

fn readme_gaps(workspace: &Workspace, folder: &str) -> Vec<String> {
    let Ok(text) = workspace.read(format!("{folder}/README.md")) else {
        return vec![format!("{folder} has no README.md")];
    };
    let lacks = |part: &&&str| !text.lines().any(|line| line.starts_with(**part));
    let gaps = README_PARTS.iter().filter(lacks);
    gaps.map(|part| format!("{folder}/README.md has no part `{part}`")).collect()
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

    #[test]
    fn plugins_are_found_wherever_a_config_names_them() {
        let text = "[[detectors]]\nplugin = \"a\"\n[[detectors]]\nplugin = \"b\"\n[filter]\nplugin = \"c\"";
        let mut used = BTreeSet::new();
        collect_plugins(&toml::from_str(text).unwrap(), &mut used);
        assert_eq!(used.into_iter().collect::<Vec<_>>(), ["a", "b", "c"]);
    }
}
