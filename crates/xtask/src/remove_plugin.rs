//! Takes away what `new-plugin` wrote.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};

use crate::new_plugin::{check_form, generated, lines_of};
use crate::workspace::{Workspace, remove_folder};

/// Removes the folder of a plugin, its config and its lines in the lists. Nothing is removed if another
/// crate needs it, or, without `force`, if anything was changed since it was generated.
pub fn remove(workspace: &Workspace, name: &str, force: bool) -> Result<()> {
    check_form(name)?;
    let folder = format!("plugins/{name}");
    let is_there = workspace.root().join(&folder).join("Cargo.toml").is_file();
    ensure!(
        is_there,
        "there is no plugin in {folder}: `--remove` takes the name that new-plugin got"
    );
    let needed = dependents(workspace, name)?;
    ensure!(needed.is_empty(), "other crates need {folder}: {}", needed.join(", "));
    if !force {
        let changed = changed_files(workspace, name)?;
        ensure!(
            changed.is_empty(),
            "not as it was generated: {}; with --force it is removed all the same",
            changed.join(", ")
        );
    }
    for (path, line) in lines_of(name) {
        let text = workspace.read(path)?;
        workspace.write(path, &without_line(&text, &line))?;
    }
    let config = workspace.root().join(format!("configs/{name}.toml"));
    if config.exists() {
        fs::remove_file(&config).with_context(|| format!("cannot remove {}", config.display()))?;
    }
    remove_folder(&workspace.root().join(folder))
}

/// Returns the crates that need the plugin's crate, beside the catalog.
fn dependents(workspace: &Workspace, name: &str) -> Result<Vec<String>> {
    let mut folders: Vec<String> = ["tests", "benches", "benches/papers"].map(String::from).into();
    for parent in ["crates", "plugins"] {
        let names = workspace.folders(parent)?.into_iter();
        folders.extend(names.map(|folder| format!("{parent}/{folder}")));
    }
    let own = [format!("plugins/{name}"), "crates/catalog".to_owned()];
    folders.retain(|folder| !own.contains(folder) && needs(workspace, folder, name));
    Ok(folders)
}

/// Returns true if the manifest in a folder names the plugin's crate.
fn needs(workspace: &Workspace, folder: &str, name: &str) -> bool {
    let Ok(manifest) = workspace.read(format!("{folder}/Cargo.toml")) else { return false };
    let package = format!("tagalong-{name}");
    manifest.lines().any(|line| {
        line.strip_prefix(&package).is_some_and(|rest| rest.starts_with(['.', ' ', '=']))
    })
}

/// Returns the files that are not as `new-plugin` writes them for the kind that fits best.
fn changed_files(workspace: &Workspace, name: &str) -> Result<Vec<String>> {
    let there = files_under(workspace.root(), &PathBuf::from(format!("plugins/{name}")))?;
    let by_kind = generated(name).into_iter().map(|files| {
        let mut changed: Vec<String> = there
            .iter()
            .filter(|path| !files.iter().any(|(wanted, _)| wanted == *path))
            .cloned()
            .collect();
        for (path, text) in &files {
            let now = workspace.read(path);
            if !now.is_ok_and(|now| unformatted(&now) == unformatted(text)) {
                changed.push(path.clone());
            }
        }
        changed
    });
    Ok(by_kind.min_by_key(Vec::len).unwrap_or_default())
}

/// Returns all files in a folder, relative to the root, sorted.
fn files_under(root: &Path, folder: &Path) -> Result<Vec<String>> {
    let mut files = Vec::new();
    let entries = fs::read_dir(root.join(folder))
        .with_context(|| format!("cannot list the folder {}", folder.display()))?;
    for entry in entries {
        let entry = entry?;
        let path = folder.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            files.extend(files_under(root, &path)?);
        } else {
            files.push(path.display().to_string());
        }
    }
    files.sort();
    Ok(files)
}

/// Returns a text without that which the formatter changes.
fn unformatted(text: &str) -> String {
    text.chars().filter(|letter| !letter.is_whitespace() && *letter != ',').collect()
}

fn without_line(text: &str, line: &str) -> String {
    let kept: Vec<&str> = text.lines().filter(|other| *other != line).collect();
    kept.join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::*;
    use crate::new_plugin::{Kind, create, small_workspace};

    /// The lists of a workspace, and its configs.
    const LISTS: [&str; 4] = [
        "Cargo.toml",
        "crates/catalog/Cargo.toml",
        "crates/catalog/src/lib.rs",
        "crates/pipeline/src/config/builtin.rs",
    ];

    fn lists(workspace: &Workspace) -> Vec<String> {
        LISTS.iter().map(|path| workspace.read(path).unwrap()).collect()
    }

    #[test]
    fn a_plugin_of_each_kind_goes_without_a_trace() {
        let (_folder, workspace) = small_workspace();
        let before = lists(&workspace);
        for kind in Kind::value_variants() {
            create(&workspace, *kind, "leg-width").unwrap();
            // As the formatter may leave it.
            let path = "plugins/leg-width/src/lib.rs";
            let text = workspace.read(path).unwrap().replace("(registry: ", "(\n    registry: ");
            workspace.write(path, &text).unwrap();
            assert_ne!(lists(&workspace), before);
            remove(&workspace, "leg-width", false).unwrap();
            assert_eq!(lists(&workspace), before, "{kind:?}");
            assert_eq!(workspace.folders("plugins").unwrap(), ["b"]);
            assert!(!workspace.root().join("configs/leg-width.toml").exists());
        }
    }

    #[test]
    fn work_that_was_done_is_removed_by_force_alone() {
        let (_folder, workspace) = small_workspace();
        let before = lists(&workspace);
        create(&workspace, Kind::Verifier, "contrast").unwrap();
        workspace.write("plugins/contrast/src/own.rs", "//! Mine.\n").unwrap();
        let verb = workspace.read("plugins/contrast/src/verify.rs").unwrap();
        workspace.write("plugins/contrast/src/verify.rs", &(verb + "// mine\n")).unwrap();
        workspace.write("configs/contrast.toml", "# Mine.\n").unwrap();
        let then = lists(&workspace);
        let refusal = remove(&workspace, "contrast", false).unwrap_err().to_string();
        let changed = "not as it was generated: plugins/contrast/src/own.rs, \
                       plugins/contrast/src/verify.rs, configs/contrast.toml; with --force";
        assert!(refusal.starts_with(changed), "{refusal}");
        assert_eq!(lists(&workspace), then, "nothing is removed");
        assert_eq!(workspace.folders("plugins").unwrap(), ["b", "contrast"]);
        remove(&workspace, "contrast", true).unwrap();
        assert_eq!(lists(&workspace), before);
        assert_eq!(workspace.folders("plugins").unwrap(), ["b"]);
    }

    #[test]
    fn a_plugin_that_is_needed_or_not_there_stays() {
        let (_folder, workspace) = small_workspace();
        create(&workspace, Kind::Filter, "steady").unwrap();
        workspace.write("crates/user/Cargo.toml", "tagalong-steady.workspace = true\n").unwrap();
        for (name, why) in [
            ("steady", "other crates need plugins/steady: crates/user"),
            ("nothing", "there is no plugin in plugins/nothing"),
            ("../b", "cannot name a plugin"),
        ] {
            let refusal = remove(&workspace, name, true).unwrap_err().to_string();
            assert!(refusal.contains(why), "{name}: {refusal}");
        }
        assert_eq!(workspace.folders("plugins").unwrap(), ["b", "steady"]);
    }
}
