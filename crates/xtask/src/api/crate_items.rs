//! The modules of a crate with their items, and which of them are public.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use syn::{Item, ItemImpl, ItemStruct, ItemUse, Type, UseTree, parse_quote};

use super::text::{implementation, is_exported, is_public, is_test, kind, lines, text};

/// Path of a module inside its crate.
type ModulePath = Vec<String>;

/// Items of a crate.
pub struct CrateItems {
    modules: BTreeMap<ModulePath, Vec<Item>>,
    /// Implementations, by the last name of their type.
    implementations: BTreeMap<String, Vec<ItemImpl>>,
    /// Exported macros, which users find at the root.
    macros: Vec<Item>,
}

impl CrateItems {
    /// Reads a crate from its root file.
    ///
    /// # Errors
    /// A file that is missing or no Rust.
    pub fn read(root: &Path) -> Result<Self> {
        let mut this =
            Self { modules: BTreeMap::new(), implementations: BTreeMap::new(), macros: Vec::new() };
        let folder = root.parent().context("a root file is in a folder")?;
        this.read_file(root, folder, Vec::new())?;
        Ok(this)
    }

    /// Reads a module from its file; its modules are in files of `folder`.
    fn read_file(&mut self, file: &Path, folder: &Path, path: ModulePath) -> Result<()> {
        let source = fs::read_to_string(file).with_context(|| file.display().to_string())?;
        let parsed = syn::parse_file(&source).with_context(|| file.display().to_string())?;
        self.read_items(parsed.items, folder, path)
    }

    fn read_items(&mut self, items: Vec<Item>, folder: &Path, path: ModulePath) -> Result<()> {
        let mut kept = Vec::new();
        for item in items {
            match item {
                Item::Mod(mut module) if !is_test(&module.attrs) => {
                    let name = module.ident.to_string();
                    let within = folder.join(&name);
                    let mut inner = path.clone();
                    inner.push(name);
                    match module.content.take() {
                        Some((_, items)) => self.read_items(items, &within, inner)?,
                        None => self.read_file(&module_file(&within), &within, inner)?,
                    }
                    kept.push(Item::Mod(module));
                }
                Item::Impl(item) if !is_test(&item.attrs) => {
                    if let Some(name) = type_name(&item.self_ty) {
                        self.implementations.entry(name).or_default().push(item);
                    }
                }
                Item::Macro(item) if item.mac.path.is_ident("settings") => {
                    let settings: ItemStruct = item.mac.parse_body()?;
                    kept.push(Item::Struct(self.expand_settings(settings)));
                }
                Item::Macro(item) if is_exported(&item.attrs) => {
                    self.macros.push(Item::Macro(item));
                }
                item => kept.push(item),
            }
        }
        self.modules.insert(path, kept);
        Ok(())
    }

    /// Adds to settings what `tagalong_core::settings!` adds to them.
    fn expand_settings(&mut self, mut settings: ItemStruct) -> ItemStruct {
        let name = &settings.ident;
        let default = parse_quote!(impl Default for #name {});
        self.implementations.entry(name.to_string()).or_default().push(default);
        settings.attrs.insert(
            0,
            parse_quote!(#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]),
        );
        settings
    }

    /// Returns a line for each public item and each of its public parts, sorted.
    pub fn public(&self) -> Vec<String> {
        let mut listed = BTreeSet::new();
        self.list(&Vec::new(), "", &mut listed);
        for item in &self.macros {
            listed.extend(name_of(item).into_iter().flat_map(|(name, _)| lines(item, &name)));
        }
        listed.into_iter().collect()
    }

    /// Adds the public items of a module that users find under `shown`.
    fn list(&self, module: &ModulePath, shown: &str, lines: &mut BTreeSet<String>) {
        for item in self.modules.get(module).into_iter().flatten() {
            match item {
                Item::Use(import) if is_public(&import.vis) => {
                    self.list_import(import, module, shown, lines);
                }
                _ => {
                    if let Some((name, true)) = name_of(item) {
                        self.list_item(item, module, &join(shown, &name), lines);
                    }
                }
            }
        }
    }

    /// Adds an item that users find under `shown`.
    fn list_item(
        &self,
        item: &Item,
        module: &ModulePath,
        shown: &str,
        into: &mut BTreeSet<String>,
    ) {
        if let Item::Mod(inner) = item {
            into.insert(format!("pub mod {shown}"));
            let mut path = module.clone();
            path.push(inner.ident.to_string());
            return self.list(&path, shown, into);
        }
        into.extend(lines(item, shown));
        let (Some(kind), Some((name, _))) = (kind(item), name_of(item)) else { return };
        let all = self.implementations.get(&name);
        into.extend(all.into_iter().flatten().flat_map(|item| implementation(item, kind, shown)));
    }

    /// Adds the items that a module re-exports: those of this crate as they are, others by name.
    fn list_import(
        &self,
        import: &ItemUse,
        module: &ModulePath,
        shown: &str,
        lines: &mut BTreeSet<String>,
    ) {
        for Import { path, name } in imports(&import.tree) {
            let is_all = name == "*";
            let Some(found) = self.resolve(&path, module) else {
                let renamed = path.last().is_none_or(|last| *last != name);
                let suffix = match (is_all, renamed) {
                    (true, _) => "::*".to_owned(),
                    (false, true) => format!(" as {name}"),
                    (false, false) => String::new(),
                };
                let place = if shown.is_empty() { "" } else { " in " };
                lines.insert(format!("pub use {}{suffix}{place}{shown}", path.join("::")));
                continue;
            };
            if is_all {
                self.list(&found, shown, lines);
                continue;
            }
            let Some((last, parent)) = found.split_last() else { continue };
            let parent = parent.to_vec();
            for item in self.modules.get(&parent).into_iter().flatten() {
                match item {
                    // Imported there itself, from another module.
                    Item::Use(inner) if imports(&inner.tree).iter().any(|i| i.name == *last) => {
                        for other in imports(&inner.tree).into_iter().filter(|i| i.name == *last) {
                            self.list_renamed(&other.path, &parent, &join(shown, &name), lines);
                        }
                    }
                    _ if name_of(item).is_some_and(|(own, _)| own == *last) => {
                        self.list_item(item, &parent, &join(shown, &name), lines);
                    }
                    _ => {}
                }
            }
        }
    }

    /// Adds the item of a path under a name, or the path itself if it is of another crate.
    fn list_renamed(
        &self,
        path: &[String],
        module: &ModulePath,
        shown: &str,
        lines: &mut BTreeSet<String>,
    ) {
        let Some((last, parent)) = self.resolve(path, module).and_then(|mut found| {
            let last = found.pop()?;
            Some((last, found))
        }) else {
            lines.insert(format!("pub use {} as {shown}", path.join("::")));
            return;
        };
        for item in self.modules.get(&parent).into_iter().flatten() {
            if name_of(item).is_some_and(|(own, _)| own == last) {
                self.list_item(item, &parent, shown, lines);
            }
        }
    }

    /// Returns the place of a path in this crate; `None` if it begins with another crate.
    fn resolve(&self, path: &[String], module: &ModulePath) -> Option<ModulePath> {
        let (first, rest) = path.split_first()?;
        let mut place = match first.as_str() {
            "crate" => Vec::new(),
            "self" => module.clone(),
            "super" => module[..module.len().checked_sub(1)?].to_vec(),
            name => {
                let mut place = module.clone();
                place.push(name.to_owned());
                let is_here = self.modules.contains_key(&place)
                    || self
                        .modules
                        .get(module)?
                        .iter()
                        .any(|item| name_of(item).is_some_and(|(own, _)| own == name));
                if !is_here {
                    return None;
                }
                place
            }
        };
        place.extend(rest.iter().cloned());
        Some(place)
    }
}

/// Returns the file of a module whose own modules are in `folder`.
fn module_file(folder: &Path) -> PathBuf {
    let beside = folder.with_extension("rs");
    if beside.is_file() { beside } else { folder.join("mod.rs") }
}

fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}::{name}") }
}

/// Returns the last name of a type's path.
fn type_name(of: &Type) -> Option<String> {
    match of {
        Type::Path(path) => path.path.segments.last().map(|last| last.ident.to_string()),
        _ => None,
    }
}

/// Returns the name of an item, and whether it is public.
fn name_of(item: &Item) -> Option<(String, bool)> {
    let (name, visibility) = match item {
        Item::Const(item) => (&item.ident, &item.vis),
        Item::Enum(item) => (&item.ident, &item.vis),
        Item::Fn(item) => (&item.sig.ident, &item.vis),
        Item::Mod(item) => (&item.ident, &item.vis),
        Item::Static(item) => (&item.ident, &item.vis),
        Item::Struct(item) => (&item.ident, &item.vis),
        Item::Trait(item) => (&item.ident, &item.vis),
        Item::Type(item) => (&item.ident, &item.vis),
        Item::Macro(item) => return Some((item.ident.as_ref()?.to_string(), true)),
        _ => return None,
    };
    Some((text(name), is_public(visibility)))
}

/// An imported path, and its name here: `*` for everything inside.
struct Import {
    path: Vec<String>,
    name: String,
}

fn imports(tree: &UseTree) -> Vec<Import> {
    match tree {
        UseTree::Path(path) => {
            let mut all = imports(&path.tree);
            for import in &mut all {
                import.path.insert(0, path.ident.to_string());
                if import.name == "self" {
                    import.name = path.ident.to_string();
                }
            }
            all
        }
        UseTree::Name(name) if name.ident == "self" => {
            vec![Import { path: Vec::new(), name: "self".to_owned() }]
        }
        UseTree::Name(name) => {
            vec![Import { path: vec![name.ident.to_string()], name: name.ident.to_string() }]
        }
        UseTree::Rename(rename) => {
            vec![Import { path: vec![rename.ident.to_string()], name: rename.rename.to_string() }]
        }
        UseTree::Glob(_) => vec![Import { path: Vec::new(), name: "*".to_owned() }],
        UseTree::Group(group) => group.items.iter().flat_map(imports).collect(),
    }
}
