//! Items as lines of text.

use quote::ToTokens;
use syn::{
    Attribute, Fields, ImplItem, Item, ItemImpl, ItemStruct, ItemTrait, Meta, TraitItem, Visibility,
};

/// Spaces that the tokens of an item have between them, and that its source has not.
const SPACES: &[(&str, &str)] = &[
    (" :: ", "::"),
    (":: ", "::"),
    (" < ", "<"),
    ("< ", "<"),
    (" >", ">"),
    ("& ", "&"),
    ("* ", "*"),
    ("# [", "#["),
    ("[ ", "["),
    (" ]", "]"),
    ("( ", "("),
    (" (", "("),
    (" )", ")"),
    ("->(", "-> ("),
    (" ,", ","),
    (",)", ")"),
    (",>", ">"),
    (" :", ":"),
    (" ;", ";"),
];

/// Writes tokens as a source has them.
pub fn text(tokens: &impl ToTokens) -> String {
    let mut text = tokens.to_token_stream().to_string();
    for (from, to) in SPACES {
        text = text.replace(from, to);
    }
    text
}

/// Returns whether everybody may use an item.
pub fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

/// Returns whether an item is of tests alone.
pub fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| text(attribute) == "#[cfg(test)]")
}

/// Returns whether a macro is one for users of the crate.
pub fn is_exported(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| attribute.path().is_ident("macro_export"))
}

/// Returns the attributes that users depend on, each behind a space.
fn attributes(attributes: &[Attribute]) -> String {
    attributes
        .iter()
        .filter(|attribute| {
            let names = ["derive", "non_exhaustive", "cfg", "must_use", "deprecated"];
            names.iter().any(|name| attribute.path().is_ident(name))
        })
        .map(|attribute| format!(" {}", short(attribute)))
        .collect()
}

/// Returns an attribute without its reason.
fn short(attribute: &Attribute) -> String {
    match &attribute.meta {
        Meta::NameValue(pair) => format!("#[{}]", text(&pair.path)),
        _ => text(attribute),
    }
}

/// Returns the lines of an item under a path, without its inherent functions.
pub fn lines(item: &Item, path: &str) -> Vec<String> {
    match item {
        Item::Const(item) => vec![format!("pub const {path}: {}", text(&item.ty))],
        Item::Static(item) => vec![format!("pub static {path}: {}", text(&item.ty))],
        Item::Type(item) => {
            vec![format!("pub type {path}{} = {}", text(&item.generics), text(&item.ty))]
        }
        Item::Fn(item) => {
            let name = format!("fn {}", item.sig.ident);
            let signature = text(&item.sig).replacen(&name, &format!("fn {path}"), 1);
            vec![format!("pub {signature}{}", attributes(&item.attrs))]
        }
        Item::Struct(item) => struct_lines(item, path),
        Item::Enum(item) => {
            let generics = text(&item.generics);
            let head = format!("pub enum {path}{generics}");
            let variants = item.variants.iter().map(|variant| {
                let fields = fields(&variant.fields);
                format!("pub enum {path}: {}{fields}{}", variant.ident, attributes(&variant.attrs))
            });
            std::iter::once(head + &attributes(&item.attrs)).chain(variants).collect()
        }
        Item::Trait(item) => trait_lines(item, path),
        Item::Macro(item) if is_exported(&item.attrs) => vec![format!("macro {path}!")],
        _ => Vec::new(),
    }
}

/// Returns the fields of a variant, all of which are public.
fn fields(fields: &Fields) -> String {
    let each = fields.iter().map(|field| match &field.ident {
        Some(name) => format!("{name}: {}", text(&field.ty)),
        None => text(&field.ty),
    });
    let each = each.collect::<Vec<_>>().join(", ");
    match fields {
        Fields::Named(_) => format!(" {{ {each} }}"),
        Fields::Unnamed(_) => format!("({each})"),
        Fields::Unit => String::new(),
    }
}

fn struct_lines(item: &ItemStruct, path: &str) -> Vec<String> {
    let generics = text(&item.generics);
    let mut lines = vec![format!("pub struct {path}{generics}{}", attributes(&item.attrs))];
    for (index, field) in item.fields.iter().enumerate() {
        if is_public(&field.vis) {
            let name = field.ident.as_ref().map_or(index.to_string(), ToString::to_string);
            lines.push(format!("pub struct {path}: {name}: {}", text(&field.ty)));
        }
    }
    let is_unit = matches!(item.fields, Fields::Unit);
    if !is_unit && item.fields.iter().any(|field| !is_public(&field.vis)) {
        lines.push(format!("pub struct {path}: private fields"));
    }
    lines
}

fn trait_lines(item: &ItemTrait, path: &str) -> Vec<String> {
    let bounds = if item.supertraits.is_empty() {
        String::new()
    } else {
        format!(": {}", text(&item.supertraits))
    };
    let head = format!("pub trait {path}{}{bounds}", text(&item.generics));
    let items = item.items.iter().filter_map(|item| match item {
        TraitItem::Const(item) => Some(format!("const {}: {}", item.ident, text(&item.ty))),
        TraitItem::Fn(item) => {
            // A method with a body may be left out by those that implement the trait.
            let body = item.default.as_ref().map_or("", |_| " {..}");
            Some(text(&item.sig) + body)
        }
        TraitItem::Type(item) => Some(format!("type {}: {}", item.ident, text(&item.bounds))),
        _ => None,
    });
    let items = items.map(|line| format!("pub trait {path}: {line}"));
    std::iter::once(head).chain(items).collect()
}

/// Returns the word that begins the lines of an item with implementations.
pub fn kind(item: &Item) -> Option<&'static str> {
    match item {
        Item::Struct(_) => Some("struct"),
        Item::Enum(_) => Some("enum"),
        _ => None,
    }
}

/// Returns the lines of an implementation for an item that is public under a path.
pub fn implementation(item: &ItemImpl, kind: &str, path: &str) -> Vec<String> {
    let generics = text(&item.generics);
    if let Some((of, _)) = &item.trait_ {
        // A change of its items is one of the trait.
        return vec![format!("impl{generics} {} for {path}", text(of))];
    }
    let public = item.items.iter().filter_map(|item| match item {
        ImplItem::Fn(item) if is_public(&item.vis) => {
            Some(text(&item.sig) + &attributes(&item.attrs))
        }
        ImplItem::Const(item) if is_public(&item.vis) => {
            Some(format!("const {}: {}", item.ident, text(&item.ty)))
        }
        _ => None,
    });
    public.map(|line| format!("pub {kind} {path}: {line}")).collect()
}
