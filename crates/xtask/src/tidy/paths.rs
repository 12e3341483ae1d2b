use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use crate::markdown::Document;
use crate::workspace::Workspace;

/// Complains about paths that a document names, in backticks or as a link, and
/// that do not exist, and about links to headings that do not exist. A path is relative to the
/// document or to the root.
pub fn check(workspace: &Workspace, documents: &[Document]) -> Vec<String> {
    let headings: BTreeMap<&Path, BTreeSet<String>> =
        documents.iter().map(|document| (document.path.as_path(), anchors(document))).collect();
    let mut complaints = Vec::new();
    for document in documents {
        for (number, line) in &document.prose {
            for (path, anchor) in anchored(line) {
                if lacks_heading(&headings, &document.path, path, anchor) {
                    let name = document.path.display();
                    complaints.push(format!("{name}:{number}: no heading is `{path}#{anchor}`"));
                }
            }
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

/// Returns file and heading of the links to headings; the file is empty for the document itself.
fn anchored(line: &str) -> impl Iterator<Item = (&str, &str)> {
    let targets = line.split("](").skip(1).filter_map(|rest| rest.split([')', ' ']).next());
    targets.filter(|target| !target.contains(':')).filter_map(|target| target.split_once('#'))
}

/// Returns the anchors of the headings of a document, as GitHub forms them.
fn anchors(document: &Document) -> BTreeSet<String> {
    let headings = document.prose.iter().filter(|(_, line)| line.starts_with('#'));
    headings.map(|(_, line)| anchor(line.trim_start_matches('#').trim())).collect()
}

fn anchor(heading: &str) -> String {
    let lower = heading.to_lowercase();
    let kept = lower.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// Returns true if the link leads to a document of the workspace that has no such heading.
fn lacks_heading(
    headings: &BTreeMap<&Path, BTreeSet<String>>,
    document: &Path,
    path: &str,
    anchor: &str,
) -> bool {
    let folder = document.parent().unwrap_or(Path::new(""));
    let target =
        if path.is_empty() { Some(document.to_owned()) } else { normal(&folder.join(path)) };
    let found = target.as_deref().and_then(|target| headings.get(target));
    found.is_some_and(|anchors| !anchors.contains(anchor))
}

/// Returns the words in backticks that look like paths.
fn backticked(line: &str) -> impl Iterator<Item = &str> {
    fn in_path(c: char) -> bool {
        c.is_ascii_alphanumeric() || "._-/".contains(c)
    }

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
    fn links_to_headings_that_do_not_exist_are_found() {
        let heading = (1, "## Pipelines x logs, `[tune]`".to_owned());
        let page = Document { path: "docs/a.md".into(), prose: vec![heading], shell: Vec::new() };
        let headings = BTreeMap::from([(page.path.as_path(), anchors(&page))]);
        assert!(!lacks(&headings, "README.md", "[a](docs/a.md#pipelines-x-logs-tune)"));
        assert!(!lacks(&headings, "docs/a.md", "[a](#pipelines-x-logs-tune)"));
        assert!(lacks(&headings, "docs/b.md", "[a](a.md#pipelines)"));
        assert!(!lacks(&headings, "docs/b.md", "[a](source.rs#L3)"));
    }

    /// Returns true if the link of a line in the page `from` leads to no heading.
    fn lacks(headings: &BTreeMap<&Path, BTreeSet<String>>, from: &str, line: &str) -> bool {
        let link = anchored(line).next();
        link.is_some_and(|(path, anchor)| lacks_heading(headings, Path::new(from), path, anchor))
    }

    #[test]
    fn only_paths_that_should_exist_are_stale() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("crates/core")).unwrap();
        for (path, is_gone) in [
            ("crates/gone", true),
            ("gone/it.rs", true),
            ("crates/core", false),
            ("core/", false),
            ("../crates/core", false),
            ("sensor_msgs/Image", false),
            ("../../elsewhere/x", false),
        ] {
            let page = Path::new("crates/README.md");
            assert_eq!(is_stale(folder.path(), page, path, false), is_gone, "{path}");
        }
        assert!(is_stale(folder.path(), Path::new("README.md"), "gone", true));
    }
}
