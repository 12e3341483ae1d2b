use std::path::{Component, Path, PathBuf};

use crate::markdown::Document;
use crate::workspace::Workspace;

/// Complains about paths that a document names, in backticks or as a link, and
/// that do not exist. A path is relative to the document or to the root.
pub fn check(workspace: &Workspace, documents: &[Document]) -> Vec<String> {
    let mut complaints = Vec::new();
    for document in documents {
        for (number, line) in &document.prose {
            let linked = links(line).map(|path| (path, true));
            let quoted = backticked(line).map(|path| (path, false));
            for (path, is_link) in linked.chain(quoted) {
                if is_stale(workspace.root(), &document.path, path, is_link) {
                    let name = document.path.display();
                    complaints.push(format!("{name}:{number}: there is no `{path}`"));
                }
            }
        }
    }
    complaints
}

/// Targets of links to files, without the part after `#`.
fn links(line: &str) -> impl Iterator<Item = &str> {
    let targets = line.split("](").skip(1).filter_map(|rest| rest.split([')', ' ']).next());
    let files = targets.filter(|target| !target.contains(':'));
    files.filter_map(|target| target.split('#').next()).filter(|target| !target.is_empty())
}

/// Returns the words in backticks that look like paths.
fn backticked(line: &str) -> impl Iterator<Item = &str> {
    let in_path = |c: char| c.is_ascii_alphanumeric() || "._-/".contains(c);
    let quoted = line.split('`').skip(1).step_by(2);
    quoted.filter(move |text| {
        text.contains('/') && !text.starts_with('/') && text.chars().all(in_path)
    })
}

fn is_stale(root: &Path, document: &Path, path: &str, is_link: bool) -> bool {
    let folder = document.parent().unwrap_or(Path::new(""));
    let path = Path::new(path);
    let candidates = [normal(&folder.join(path)), normal(path)];
    let inside: Vec<&PathBuf> = candidates.iter().flatten().collect();
    if inside.is_empty() || inside.iter().any(|path| root.join(path).exists()) {
        return false;
    }
    let begins = [root, &root.join(folder)].iter().any(|base| starts_in(base, path));
    is_link || is_source(path) || begins
}

/// The path without `..`; `None` if it leads out of the workspace.
fn normal(path: &Path) -> Option<PathBuf> {
    let mut parts = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir if !parts.pop() => return None,
            Component::Normal(name) => parts.push(name),
            _ => {}
        }
    }
    Some(parts)
}

/// Files that are never the output of a run.
fn is_source(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| ["rs", "toml", "md", "sh"].contains(&extension))
}

/// True if the first folder of the path exists: then the rest should, too.
/// (A message type like `sensor_msgs/Image` starts nowhere.)
fn starts_in(base: &Path, path: &Path) -> bool {
    let first = path.components().next();
    first.is_some_and(|first| first.as_os_str() != "target" && base.join(first).is_dir())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_found_in_links_and_in_backticks() {
        let line =
            "see [a](crates/a.md#top), `crates/b/`, `sensor_msgs/Image`, `a b/c`, [w](https://x/y)";
        assert_eq!(links(line).collect::<Vec<_>>(), ["crates/a.md"]);
        assert_eq!(backticked(line).collect::<Vec<_>>(), ["crates/b/", "sensor_msgs/Image"]);
    }

    #[test]
    fn only_paths_that_should_exist_are_stale() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("crates/core")).unwrap();
        let stale = |path| is_stale(folder.path(), Path::new("crates/README.md"), path, false);
        assert!(stale("crates/gone") && stale("gone/it.rs"));
        assert!(!stale("crates/core") && !stale("core/") && !stale("../crates/core"));
        assert!(!stale("sensor_msgs/Image") && !stale("../../elsewhere/x"));
        assert!(is_stale(folder.path(), Path::new("README.md"), "gone", true));
    }
}
