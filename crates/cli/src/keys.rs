//! Every key of a config, from the code: as a table for readers, and as one JSON schema for
//! editors.

use std::fmt::Write as _;

use schemars::schema_for;
use serde_json::{Map, Value, json};
use tagalong_app::config_file::OuterSettings;
use tagalong_config::{Kind, PluginInfo, Registry};
use tagalong_pipeline::{PipelineSettings, Suits};

/// Returns the schemas of everything around the plugins.
fn around() -> [Value; 2] {
    [schema_for!(PipelineSettings).to_value(), schema_for!(OuterSettings).to_value()]
}

/// Returns the schema of everything around the plugins.
pub fn around_schema() -> Value {
    let mut definitions = Map::new();
    let mut properties = Map::new();
    for (name, part) in ["pipeline", "outer"].into_iter().zip(around()) {
        let part = lifted(part, name, &mut definitions);
        properties.extend(part["properties"].as_object().cloned().unwrap_or_default());
    }
    properties.insert("tune".into(), tune_schema());
    properties
        .insert("suits".into(), lifted(schema_for!(Suits).to_value(), "suits", &mut definitions));
    properties.insert("extends".into(), extends_schema());
    json!({ "type": "object", "properties": properties, "$defs": definitions })
}

fn extends_schema() -> Value {
    json!({
        "type": "string",
        "description": "Path of a config, from the folder of this one. Keys in this config replace \
                        those in that one; lists are replaced as a whole.",
    })
}

/// Returns the schema of `[tune]`, with the dotted names of all others as keys.
fn tune_schema() -> Value {
    let spread = json!({
        "type": "object",
        "required": ["between", "steps"],
        "additionalProperties": false,
        "properties": {
            "between": {
                "description": "The lowest and the highest value.",
                "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2,
            },
            "steps": {
                "description": "Number of equally spaced values that are tried.",
                "type": "integer", "minimum": 2, "maximum": 64,
            },
        },
    });
    let nested = json!({ "type": "object" });
    json!({
        "description": "Settings that `tagalong bench --leave-one-room-out` fits, by their \
            dotted names, each with the values to try. A run ignores them.",
        "type": "object",
        "additionalProperties": { "anyOf": [{ "type": "array", "minItems": 1 }, spread, nested] },
    })
}

/// Returns the plugins, by kind and name.
fn plugins(registry: &Registry) -> Vec<&PluginInfo> {
    let mut plugins: Vec<_> = registry.plugins().collect();
    plugins.sort_by_key(|plugin| (plugin.kind, plugin.name));
    plugins
}

/// Returns all keys as Markdown: a table for everything around the plugins, and one for each
/// plugin.
pub fn markdown(registry: &Registry) -> String {
    let mut out = String::from("### Around the plugins\n\n");
    table(&mut out, &around());
    for plugin in plugins(registry) {
        let _ = writeln!(out, "\n### `{}` ({})\n\n{}.\n", plugin.name, plugin.kind, plugin.summary);
        table(&mut out, &[plugin.schema()]);
    }
    out
}

/// Returns the keys of one plugin as Markdown.
pub fn markdown_of(plugin: &PluginInfo) -> String {
    let mut out = String::new();
    table(&mut out, &[plugin.schema()]);
    out
}

/// Returns the keys around the plugins as Markdown.
pub fn markdown_around() -> String {
    let mut out = String::new();
    table(&mut out, &around());
    out
}

fn table(out: &mut String, schemas: &[Value]) {
    out.push_str("| key | default | meaning |\n|---|---|---|\n");
    schemas.iter().for_each(|schema| rows(out, "", schema, schema));
}

/// Appends the keys of a table and of those in it.
fn rows(out: &mut String, path: &str, table: &Value, root: &Value) {
    for (key, property) in table["properties"].as_object().into_iter().flatten() {
        let (text, target) = resolve(property, root);
        if target["properties"].is_object() {
            rows(out, &format!("{path}{key}."), target, root);
            if !alternatives(property).any(|it| it["type"] == "string") {
                continue;
            }
        }
        let default = match &property["default"] {
            Value::Null => "none".to_owned(),
            value => format!("`{value}`"),
        };
        // A cell of a Markdown table must be one line without a bare `|`.
        let text = text.unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ");
        let _ = writeln!(out, "| `{path}{key}` | {default} | {} |", text.replace('|', "\\|"));
    }
}

/// Returns the description of a property, and the schema that it refers to.
fn resolve<'a>(property: &'a Value, root: &'a Value) -> (Option<&'a str>, &'a Value) {
    let target = alternatives(property)
        .find_map(|it| it["$ref"].as_str())
        .and_then(|path| root.pointer(path.trim_start_matches('#')))
        .unwrap_or(property);
    (property["description"].as_str().or_else(|| target["description"].as_str()), target)
}

/// Returns the schemas of which a value must match one: of a property and of those that it holds.
fn alternatives(property: &Value) -> Box<dyn Iterator<Item = &Value> + '_> {
    let inner = property["anyOf"].as_array().into_iter().flatten().flat_map(alternatives);
    Box::new(std::iter::once(property).chain(inner))
}

/// Returns a JSON schema of a whole config: the sections, and in each the settings of the plugin
/// that it names.
pub fn schema(registry: &Registry) -> Value {
    fn object(value: &mut Value) -> Map<String, Value> {
        value.as_object_mut().map(std::mem::take).unwrap_or_default()
    }

    let mut around = around_schema();
    let mut properties = object(&mut around["properties"]);
    let mut definitions = object(&mut around["$defs"]);
    for (section, kind, many, has_default) in SECTIONS {
        let names: Vec<&PluginInfo> =
            plugins(registry).into_iter().filter(|plugin| plugin.kind == kind).collect();
        let default = registry.default_of(kind).filter(|_| has_default).map(|plugin| plugin.name);
        let of_kind = plugin_section(&names, section, default, &mut definitions);
        let whole = if many { json!({ "type": "array", "items": of_kind }) } else { of_kind };
        properties.insert(section.to_owned(), whole);
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A pipeline of Tagalong",
        "type": "object",
        "additionalProperties": false,
        "anyOf": [{ "required": ["filter"] }, { "required": ["extends"] }],
        "properties": properties,
        "$defs": definitions,
    })
}

/// Sections that name plugins: their kind, whether there may be several, and whether one that is left
/// out stands for the default plugin of its kind.
const SECTIONS: [(&str, Kind, bool, bool); 6] = [
    ("detectors", Kind::Detector, true, false),
    ("verifiers", Kind::Verifier, true, false),
    ("associator", Kind::Associator, false, true),
    ("filter", Kind::Filter, false, false),
    ("manager", Kind::Manager, false, true),
    ("controller", Kind::Controller, false, false),
];

/// Returns the schema of a section, in which the plugin determines the keys of `config`.
fn plugin_section(
    plugins: &[&PluginInfo],
    section: &str,
    default: Option<&str>,
    out: &mut Map<String, Value>,
) -> Value {
    let names: Vec<&str> = plugins.iter().map(|plugin| plugin.name).collect();
    let mut properties = Map::new();
    if section == "detectors" {
        let own = schema_for!(tagalong_pipeline::DetectorSettings).to_value();
        let own = lifted(own, section, out);
        properties.extend(own["properties"].as_object().cloned().unwrap_or_default());
    }
    properties.insert("plugin".into(), json!({ "enum": names }));
    properties.insert("config".into(), json!({ "type": "object" }));
    let choices: Vec<Value> = plugins
        .iter()
        .map(|plugin| {
            let config = lifted(plugin.schema(), plugin.name, out);
            // A section that names no plugin passes the condition of the default one alone.
            let named = if default == Some(plugin.name) { json!([]) } else { json!(["plugin"]) };
            json!({
                "if": { "properties": { "plugin": { "const": plugin.name } }, "required": named },
                "then": { "properties": { "config": config } },
            })
        })
        .collect();
    json!({
        "type": "object",
        "required": if default.is_some() { json!([]) } else { json!(["plugin"]) },
        "properties": properties,
        "additionalProperties": false,
        "allOf": choices,
    })
}

/// Returns a schema without definitions, which are moved to `out`, under names that begin with
/// `owner`.
fn lifted(mut schema: Value, owner: &str, out: &mut Map<String, Value>) -> Value {
    rename(&mut schema, owner);
    if let Some(fields) = schema.as_object_mut() {
        fields.remove("$schema");
        let own = fields.remove("$defs");
        for (name, definition) in own.as_ref().and_then(Value::as_object).into_iter().flatten() {
            out.insert(format!("{owner}.{name}"), definition.clone());
        }
    }
    schema
}

/// Redirects references to the moved definitions.
// Two plugins may both define `Settings`, so each name gets its owner as a prefix.
fn rename(value: &mut Value, owner: &str) {
    match value {
        Value::Object(fields) => {
            if let Some(Value::String(target)) = fields.get_mut("$ref") {
                *target = target.replace("#/$defs/", &format!("#/$defs/{owner}."));
            }
            fields.values_mut().for_each(|inner| rename(inner, owner));
        }
        Value::Array(items) => items.iter_mut().for_each(|inner| rename(inner, owner)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_every_key_of_every_plugin() {
        let registry = tagalong_catalog::registry();
        let text = markdown(&registry);
        for plugin in registry.plugins() {
            for key in plugin.schema()["properties"].as_object().into_iter().flatten() {
                assert!(text.contains(&format!("| `{}", key.0)), "{} of {}", key.0, plugin.name);
            }
        }
        let around = [
            "merge.same_person_m",
            "input.depth_offset_px",
            "input.camera.height_m",
            "input.camera",
        ];
        for key in around {
            assert!(text.contains(&format!("| `{key}` |")), "{key}");
        }
        assert!(!text.contains("|  |\n"), "a key without a meaning");
    }

    /// Checks that all references of the schema lead somewhere.
    fn check_references(value: &Value, root: &Value) {
        match value {
            Value::Object(fields) => {
                if let Some(target) = fields.get("$ref").and_then(Value::as_str) {
                    assert!(root.pointer(target.trim_start_matches('#')).is_some(), "{target}");
                }
                fields.values().for_each(|inner| check_references(inner, root));
            }
            Value::Array(items) => items.iter().for_each(|inner| check_references(inner, root)),
            _ => {}
        }
    }

    #[test]
    fn the_schema_hangs_together_and_knows_the_sections() {
        let schema = schema(&tagalong_catalog::registry());
        check_references(&schema, &schema);
        let properties = schema["properties"].as_object().unwrap();
        for section in ["detectors", "filter", "input", "manager", "merge", "seed"] {
            assert!(properties.contains_key(section), "{section}");
        }
        let ekf = schema["properties"]["filter"]["allOf"].as_array().unwrap();
        assert!(ekf.iter().any(|choice| choice["if"]["properties"]["plugin"]["const"] == "ekf"));
    }
}
