use tagalong_config::{ConfigError, Kind, Registry};
use toml::{Table, Value};

use tagalong_tracking::DetectorSettings;

use crate::settings::PipelineSettings;

/// Returns the config with every default filled in, also those of the plugins. `[tune]` and
/// `[suits]` are left out.
pub(super) fn resolve(
    mut root: Table,
    settings: &PipelineSettings,
    registry: &Registry,
) -> Result<Table, ConfigError> {
    root.remove(super::tune::TABLE);
    root.remove(super::suits::TABLE);
    root.extend(table_of(settings)?);
    let controller = root.get("controller").and_then(|section| section.get("plugin"));
    if controller.and_then(Value::as_str) == Some(super::NO_CONTROLLER) {
        root.remove("controller");
    }
    for (section, kind) in [("associator", Kind::Associator), ("manager", Kind::Manager)] {
        let named = match registry.default_of(kind) {
            Some(plugin) => Table::from_iter([("plugin".to_owned(), Value::from(plugin.name))]),
            None => Table::new(),
        };
        fill(root.entry(section).or_insert_with(|| Value::Table(Table::new())), named);
    }
    for (name, value) in &mut root {
        match (name.as_str(), value) {
            ("detectors", Value::Array(sections)) => {
                for section in sections {
                    fill(section, table_of(&DetectorSettings::default())?);
                    fill_config(section, registry)?;
                }
            }
            ("verifiers", Value::Array(sections)) => {
                for section in sections {
                    fill_config(section, registry)?;
                }
            }
            ("associator" | "filter" | "manager" | "controller", section) => {
                fill_config(section, registry)?
            }
            _ => {}
        }
    }
    Ok(root)
}

/// Returns the name of the plugin that a section has without naming one.
///
/// # Errors
/// A program that registers no default of this kind.
pub(super) fn default_plugin(
    registry: &Registry,
    kind: Kind,
    section: &str,
) -> Result<&'static str, ConfigError> {
    registry.default_of(kind).map(|plugin| plugin.name).ok_or_else(|| {
        ConfigError::new(format!(
            "no {kind}: this program registers no default; add a section [{section}] with \
             `plugin = \"...\"`"
        ))
    })
}

fn fill_config(section: &mut Value, registry: &Registry) -> Result<(), ConfigError> {
    let name = section.get("plugin").and_then(Value::as_str).unwrap_or_default();
    let defaults = toml::from_str(&registry.find(name)?.defaults())?;
    if let Value::Table(table) = section {
        fill(table.entry("config").or_insert_with(|| Value::Table(Table::new())), defaults);
    }
    Ok(())
}

/// Adds the missing keys, table by table.
fn fill(value: &mut Value, defaults: Table) {
    let Value::Table(table) = value else { return };
    for (key, default) in defaults {
        match (table.get_mut(&key), default) {
            (None, default) => {
                table.insert(key, default);
            }
            (Some(inner), Value::Table(default)) => fill(inner, default),
            (Some(_), _) => {}
        }
    }
}

fn table_of<T: serde::Serialize>(settings: &T) -> Result<Table, ConfigError> {
    Table::try_from(settings).map_err(|error| ConfigError::new(error.to_string()))
}
