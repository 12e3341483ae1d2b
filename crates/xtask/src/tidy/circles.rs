//! Circles of files: files of a crate that all use each other, directly or through others.
//!
//! A module and the files of its own folder may do so, because they are one piece. Otherwise shared
//! types lie below and checks above, so that a reader can begin somewhere.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;

use crate::metadata::Metadata;
use crate::workspace::Workspace;

/// Most files in a circle that are not of one module.
const MOST: usize = 3;

/// Re-exports that are followed one after the other, at most.
const DEPTH: usize = 6;

/// Names from the root of a crate to a module or an item.
type Names = Vec<String>;

/// Paths that a module names, and whether it exports them.
type Uses = Vec<(bool, Names)>;

/// Modules of a crate, with the paths that each names.
type Modules = BTreeMap<Names, Uses>;

/// Complains about circles of files in the members of the workspace.
pub fn check(workspace: &Workspace, metadata: &Metadata) -> Result<Vec<String>> {
    let members = metadata.members(workspace.root());
    let mut crates: BTreeMap<String, Modules> = BTreeMap::new();
    for path in workspace.files()? {
        let file = path.display().to_string().replace('\\', "/");
        if let Some((folder, module)) = place(&file).filter(|(of, _)| members.contains_key(*of)) {
            let modules = crates.entry(folder.to_owned()).or_default();
            add_module(modules, module, &workspace.read(&path)?);
        }
    }
    let mut complaints = Vec::new();
    for (folder, modules) in &crates {
        for circle in circles(modules) {
            if circle.len() > MOST && !is_one_module(&circle) {
                let names: Vec<String> = circle.iter().map(|module| module.join("::")).collect();
                complaints.push(format!(
                    "{folder}: {} files use each other in a circle: {}; move the types that they \
                     share below them",
                    circle.len(),
                    names.join(", ")
                ));
            }
        }
    }
    Ok(complaints)
}

/// Adds a file to the modules of its crate.
fn add_module(modules: &mut Modules, module: Names, text: &str) {
    // A program beside a library is another crate. Its `main.rs` comes after `lib.rs`.
    modules.entry(module).or_insert_with(|| uses(text));
}

/// Returns the folder of the crate of a source file, and its module; `None` for tests and others.
fn place(file: &str) -> Option<(&str, Names)> {
    let (folder, rest) = file.split_once("/src/")?;
    let module = rest.strip_suffix(".rs")?;
    let mut names: Names = module.split('/').map(String::from).collect();
    if names[0] == "bin" || names.iter().any(|name| name == "tests") {
        return None;
    }
    if names.last().is_some_and(|name| ["lib", "main", "mod"].contains(&name.as_str())) {
        names.pop();
    }
    Some((folder, names))
}

/// Returns the paths that a file names before its tests.
fn uses(text: &str) -> Uses {
    let code = text.lines().take_while(|line| line.trim() != "#[cfg(test)]");
    let code: Vec<&str> = code.filter(|line| !line.trim_start().starts_with("//")).collect();
    let mut uses = Vec::new();
    for statement in code.join("\n").split_inclusive([';', '}']) {
        add_paths(statement, &mut uses);
    }
    for (is_exported, tree) in imports(&code) {
        for names in expanded(&[], &tree) {
            uses.push((is_exported, names));
        }
    }
    uses
}

/// Returns the trees of `use`, and whether they are exported.
fn imports(code: &[&str]) -> Vec<(bool, String)> {
    let mut imports = Vec::new();
    let mut lines = code.iter();
    while let Some(line) = lines.next() {
        let Some((before, tree)) = line.trim_start().split_once("use ") else { continue };
        if !before.is_empty() && !before.starts_with("pub") {
            continue;
        }
        let mut tree = tree.to_owned();
        while !tree.contains(';') {
            let Some(more) = lines.next() else { break };
            tree += more.trim();
        }
        imports.push((!before.is_empty(), tree.split(';').next().unwrap_or_default().to_owned()));
    }
    imports
}

/// Returns the paths of a tree such as `a::{b, c::d}`.
fn expanded(before: &[String], tree: &str) -> Vec<Names> {
    let Some((head, rest)) = tree.split_once('{') else {
        let path = tree.split(" as ").next().unwrap_or_default();
        return vec![[before, &names(path)].concat()];
    };
    let inner = rest.trim_end().strip_suffix('}').unwrap_or(rest);
    let before = [before, &names(head)].concat();
    let mut paths = Vec::new();
    let mut depth = 0;
    let mut start = 0;
    for (at, c) in inner.char_indices().chain([(inner.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let branch = inner[start..at].trim();
                if !branch.is_empty() {
                    paths.extend(expanded(&before, branch));
                }
                start = at + 1;
            }
            _ => {}
        }
    }
    paths
}

fn names(path: &str) -> Names {
    path.split("::").map(str::trim).filter(|name| !name.is_empty()).map(String::from).collect()
}

fn is_import(line: &str) -> bool {
    let line = line.trim_start();
    line.starts_with("use ") || (line.starts_with("pub") && line.contains(" use "))
}

/// Adds the paths of several names in a piece of code that is no `use`.
fn add_paths(code: &str, uses: &mut Uses) {
    fn in_path(c: char) -> bool {
        c.is_alphanumeric() || c == '_' || c == ':'
    }

    if code.lines().any(is_import) {
        return;
    }
    for word in code.split(|c| !in_path(c)) {
        if word.contains("::") {
            uses.push((false, names(word)));
        }
    }
}

/// Returns the circles of the modules of a crate.
fn circles(modules: &Modules) -> Vec<BTreeSet<&Names>> {
    let arrows: BTreeMap<&Names, BTreeSet<&Names>> =
        modules.keys().map(|module| (module, arrows(module, modules))).collect();
    let reached: BTreeMap<&Names, BTreeSet<&Names>> =
        modules.keys().map(|module| (module, reached(module, &arrows))).collect();
    let mut circles: Vec<BTreeSet<&Names>> = Vec::new();
    for module in modules.keys() {
        if circles.iter().any(|circle| circle.contains(module)) {
            continue;
        }
        let mutual = reached[module].iter().filter(|other| reached[**other].contains(module));
        let circle: BTreeSet<&Names> = mutual.copied().collect();
        if circle.len() > 1 {
            circles.push(circle);
        }
    }
    circles
}

/// Returns all modules to which arrows lead from one.
fn reached<'a>(
    from: &'a Names,
    arrows: &BTreeMap<&'a Names, BTreeSet<&'a Names>>,
) -> BTreeSet<&'a Names> {
    let mut reached = BTreeSet::new();
    let mut open = vec![from];
    while let Some(module) = open.pop() {
        for next in &arrows[module] {
            if reached.insert(*next) {
                open.push(next);
            }
        }
    }
    reached
}

/// Returns the modules that a module uses; to export from below is no use.
fn arrows<'a>(module: &Names, modules: &'a Modules) -> BTreeSet<&'a Names> {
    let mut arrows = BTreeSet::new();
    for (is_exported, path) in &modules[module] {
        let target = absolute(module, path, modules).and_then(|path| defining(&path, modules, 0));
        let Some(target) = target else { continue };
        let is_below = target.starts_with(module);
        if target != module && !(*is_exported && is_below) {
            arrows.insert(target);
        }
    }
    arrows
}

/// Returns a path from the root of the crate; `None` for those of other crates.
fn absolute(module: &Names, path: &[String], modules: &Modules) -> Option<Names> {
    let (first, rest) = path.split_first()?;
    match first.as_str() {
        "crate" => Some(rest.to_vec()),
        "self" => Some([module, rest].concat()),
        "super" => {
            let ups = path.iter().take_while(|name| *name == "super").count();
            let above = module.get(..module.len().checked_sub(ups)?)?;
            Some([above, &path[ups..]].concat())
        }
        _ => {
            let inside = [module.as_slice(), path].concat();
            modules.contains_key(&inside[..module.len() + 1]).then_some(inside)
        }
    }
}

/// Returns the module in which a path ends, through re-exports.
fn defining<'a>(path: &[String], modules: &'a Modules, depth: usize) -> Option<&'a Names> {
    let known = (0..=path.len()).rev().find_map(|end| modules.get_key_value(&path[..end]));
    let (module, uses) = known?;
    let rest = &path[module.len()..];
    let Some(item) = rest.first().filter(|_| depth < DEPTH) else { return Some(module) };
    let export = uses.iter().find(|(is_exported, used)| *is_exported && used.last() == Some(item));
    let origin = export.and_then(|(_, used)| absolute(module, used, modules));
    match origin {
        Some(origin) if origin != path => {
            defining(&[&origin, &rest[1..]].concat(), modules, depth + 1)
        }
        _ => Some(module),
    }
}

/// Returns true for files of one module below the root, which may know each other.
fn is_one_module(circle: &BTreeSet<&Names>) -> bool {
    let Some(first) = circle.first().and_then(|module| module.first()) else { return false };
    circle.iter().all(|module| module.first() == Some(first))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        let mut modules = Modules::new();
        for (file, text) in files {
            let file = format!("crates/a/src/{file}.rs");
            add_module(&mut modules, place(&file).unwrap().1, text);
        }
        circles(&modules)
            .into_iter()
            .map(|circle| circle.iter().map(|m| m.join("::")).collect())
            .collect()
    }

    #[test]
    fn files_that_use_each_other_are_a_circle() {
        let lib = ("lib", "mod a;\nmod b;\nmod c;\npub use c::C;");
        let a = ("a", "use crate::b::{self, B};");
        let b = ("b", "fn f() { crate::c::f(); }");
        assert_eq!(circle(&[lib, a, b, ("c", "use super::a::A;")]), [["a", "b", "c"]]);
        assert!(circle(&[lib, a, b, ("c", "// use super::a::A;")]).is_empty());
        assert!(
            circle(&[lib, a, b, ("c", "#[cfg(test)]\nmod tests { use super::a; }")]).is_empty()
        );
    }

    /// An item of the root that is only exported there is one of the file below.
    #[test]
    fn exports_lead_to_the_file_of_the_item() {
        let lib = ("lib", "mod a;\nmod b;\npub use a::{A, f};\npub use b::B;\nfn g() {}");
        let a = ("a", "use crate::B;");
        assert_eq!(circle(&[lib, a, ("b", "use crate::A;")]), [["a", "b"]]);
        assert_eq!(circle(&[("lib", "mod a;\nuse a::A;"), ("a", "use crate::g;")]), [["", "a"]]);
        assert!(circle(&[lib, a, ("b", "")]).is_empty());
        let nested = ("lib", "mod a;\npub use a::{b::{C}, A};");
        assert!(circle(&[nested, ("a", "fn f() { crate::g(); }")]).is_empty());
    }

    /// A list of systems, experiments that share a type, and a program beside the library.
    #[test]
    fn a_shared_type_that_knows_its_users_makes_a_circle() {
        let lib = ("lib", "mod lab;\npub use lab::Lab;\npub use systems::SYSTEMS;");
        let main = ("main", "mod other;\npub use other::Lab;");
        let systems = ("systems", "use crate::{laser, stereo};");
        let laser = ("laser", "use crate::{Lab, forms};");
        let stereo = ("stereo/mod", "use crate::forms::Forms;\nuse crate::Lab;");
        let cases: [(&str, &str, &[&[&str]]); 3] = [
            ("", "use crate::lab::Lab;", &[]),
            ("", "use crate::{laser, stereo};", &[&["forms", "laser", "stereo"]]),
            ("use crate::SYSTEMS;", "", &[&["lab", "laser", "stereo", "systems"]]),
        ];
        for (lab, forms, circles) in cases {
            let found =
                circle(&[lib, main, systems, laser, stereo, ("lab", lab), ("forms", forms)]);
            assert_eq!(found, circles, "{lab}{forms}");
        }
    }

    #[test]
    fn a_folder_is_one_module() {
        let [root, a, b] = ["", "a", "a::b"].map(names);
        assert!(is_one_module(&BTreeSet::from([&a, &b])));
        assert!(!is_one_module(&BTreeSet::from([&root, &a, &b])));
        assert_eq!(place("crates/x/src/a/mod.rs"), Some(("crates/x", names("a"))));
        assert_eq!(place("crates/x/src/a/tests.rs"), None);
        assert_eq!(place("benches/papers/src/a/b.rs"), Some(("benches/papers", names("a::b"))));
        assert_eq!(place("tests/src/lib.rs"), Some(("tests", Vec::new())));
        assert_eq!(place("benches/a.rs"), None);
    }
}
