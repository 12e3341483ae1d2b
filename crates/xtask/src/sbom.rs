//! The parts list of a program (SBOM), as CycloneDX 1.5 in JSON: every crate that is linked into it,
//! with version, licence, and the checksum of the lock file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::workspace::{Workspace, output};

/// Output of `cargo metadata`, as far as it matters here.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    resolve: Resolve,
}

#[derive(Deserialize)]
struct Package {
    id: String,
    name: String,
    version: String,
    license: Option<String>,
    description: Option<String>,
    repository: Option<String>,
    source: Option<String>,
}

#[derive(Deserialize)]
struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Edge>,
}

#[derive(Deserialize)]
struct Edge {
    pkg: String,
    dep_kinds: Vec<Kind>,
}

#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
}

#[derive(Deserialize)]
struct Lock {
    package: Vec<Locked>,
}

#[derive(Deserialize)]
struct Locked {
    name: String,
    version: String,
    checksum: Option<String>,
}

/// Returns the parts list of the package `root` of the workspace in `folder`.
///
/// # Errors
/// A package that is not there, and metadata that cargo does not give.
pub fn sbom(workspace: &Workspace, folder: &Path, root: &str) -> Result<String> {
    let manifest = workspace.root().join(folder).join("Cargo.toml");
    let mut cargo = Command::new("cargo");
    cargo.args(["metadata", "--format-version", "1", "--locked", "--manifest-path"]);
    let text = output(cargo.arg(manifest).current_dir(workspace.root()))?;
    let metadata = serde_json::from_str(&text).context("cargo metadata has changed its form")?;
    let lock = toml::from_str(&workspace.read(folder.join("Cargo.lock"))?)?;
    Ok(serde_json::to_string_pretty(&document(&metadata, &lock, root)?)? + "\n")
}

fn document(metadata: &Metadata, lock: &Lock, root: &str) -> Result<Value> {
    let root = metadata.packages.iter().find(|package| package.name == root);
    let root = root.with_context(|| "there is no such package in this workspace")?;
    let linked = linked(metadata, &root.id);
    let sums = lock.package.iter().filter_map(|locked| {
        Some(((&*locked.name, &*locked.version), locked.checksum.as_deref()?))
    });
    let sums: BTreeMap<(&str, &str), &str> = sums.collect();
    let known: BTreeMap<&str, &Package> =
        metadata.packages.iter().map(|package| (&*package.id, package)).collect();
    // Sorted by name and version, so that two lists can be compared line by line.
    let mut parts: Vec<&Package> = linked
        .keys()
        .filter(|id| **id != root.id)
        .filter_map(|id| known.get(id).copied())
        .collect();
    parts.sort_by_key(|package| (&package.name, &package.version));
    let component = |package: &&Package| component(package, &sums);
    let edges = linked.iter().filter_map(|(id, deps)| {
        let names: BTreeSet<String> =
            deps.iter().filter_map(|id| known.get(id)).map(|p| url(p)).collect();
        Some(json!({ "ref": url(known.get(id)?), "dependsOn": names }))
    });
    Ok(json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": component(&root) },
        "components": parts.iter().map(component).collect::<Vec<_>>(),
        "dependencies": edges.collect::<Vec<_>>(),
    }))
}

/// Returns the packages that are linked into `root`, each with those that it uses. Build scripts and
/// tests are not part of a program.
fn linked<'a>(metadata: &'a Metadata, root: &'a str) -> BTreeMap<&'a str, Vec<&'a str>> {
    let nodes: BTreeMap<&str, &Node> =
        metadata.resolve.nodes.iter().map(|node| (&*node.id, node)).collect();
    let mut found = BTreeMap::new();
    let mut waiting = vec![root];
    while let Some(id) = waiting.pop() {
        let edges = nodes.get(id).map_or(&[][..], |node| &node.deps);
        let is_linked = |edge: &&Edge| edge.dep_kinds.iter().any(|kind| kind.kind.is_none());
        let deps: Vec<&str> = edges.iter().filter(is_linked).map(|edge| &*edge.pkg).collect();
        if found.insert(id, deps.clone()).is_none() {
            waiting.extend(deps);
        }
    }
    found
}

fn component(package: &Package, sums: &BTreeMap<(&str, &str), &str>) -> Value {
    let Package { name, version, license, description, repository, .. } = package;
    let kind = if name == "tagalong-cli" { "application" } else { "library" };
    let url = url(package);
    let mut part =
        json!({ "type": kind, "bom-ref": url, "name": name, "version": version, "purl": url });
    if let Some(text) = description {
        part["description"] = text.trim().into();
    }
    if let Some(licence) = license {
        // Old manifests have a slash where SPDX has OR.
        part["licenses"] = json!([{ "expression": licence.replace('/', " OR ") }]);
    }
    if let Some(sum) = sums.get(&(&**name, &**version)) {
        part["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
    }
    if let Some(repository) = repository {
        part["externalReferences"] = json!([{ "type": "vcs", "url": repository }]);
    }
    part
}

/// Returns the package URL. One without a registry is a folder of this repository.
fn url(package: &Package) -> String {
    let Package { name, version, source, .. } = package;
    match source {
        Some(_) => format!("pkg:cargo/{name}@{version}"),
        None => format!("pkg:generic/{name}@{version}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn metadata() -> Metadata {
        let package = |id: &str, source: Option<&str>| {
            json!({ "id": id, "name": id, "version": "1.0.0", "license": "MIT/Apache-2.0",
                "description": "Words.\n", "repository": null, "source": source })
        };
        let edge =
            |to: &str, kind: Option<&str>| json!({ "pkg": to, "dep_kinds": [{ "kind": kind }] });
        let outside = Some("registry");
        serde_json::from_value(json!({
            "packages": [package("root", None), package("b", outside), package("a", outside),
                package("cc", outside), package("test", outside)],
            "resolve": { "nodes": [
                { "id": "root", "deps": [edge("b", None), edge("cc", Some("build")),
                    edge("test", Some("dev"))] },
                { "id": "b", "deps": [edge("a", None)] },
                { "id": "a", "deps": [edge("b", None)] },
            ] },
        }))
        .unwrap()
    }

    #[test]
    fn what_is_linked_is_listed_with_licence_and_checksum() {
        let lock = "[[package]]\nname = \"a\"\nversion = \"1.0.0\"\nchecksum = \"0f\"\n";
        let list = document(&metadata(), &toml::from_str(lock).unwrap(), "root").unwrap();
        let names: Vec<&Value> =
            list["components"].as_array().unwrap().iter().map(|part| &part["name"]).collect();
        assert_eq!(names, ["a", "b"], "neither build scripts nor tests");
        let a = &list["components"][0];
        assert_eq!(a["purl"], "pkg:cargo/a@1.0.0");
        assert_eq!(a["hashes"][0]["content"], "0f");
        assert_eq!(a["licenses"][0]["expression"], "MIT OR Apache-2.0");
        assert_eq!(list["metadata"]["component"]["purl"], "pkg:generic/root@1.0.0");
        assert_eq!(list["dependencies"].as_array().unwrap().len(), 3);
        assert!(document(&metadata(), &toml::from_str(lock).unwrap(), "none").is_err());
    }
}
