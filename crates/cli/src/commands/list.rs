use std::fmt::Write as _;

use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print};
use tagalong_app::serialize::to_json;
use tagalong_config::Registry;

/// Runs `tagalong list`.
///
/// # Errors
/// If stdout cannot be written.
pub fn list(registry: &Registry, format: Format) -> Outcome {
    print(&match format {
        Format::Text => as_text(registry),
        Format::Json => as_json(registry)?,
    })?;
    Ok(Ended::Well)
}

fn as_text(registry: &Registry) -> String {
    let mut plugins: Vec<_> = registry.plugins().collect();
    plugins.sort_by_key(|plugin| (plugin.kind, plugin.name));
    let width = plugins.iter().map(|plugin| plugin.name.len()).max().unwrap_or(0);
    let mut out = String::new();
    for plugin in plugins {
        // Padding works on strings only.
        let kind = plugin.kind.to_string();
        let _ = writeln!(out, "{kind:<10}  {:<width$}  {}", plugin.name, plugin.summary);
    }
    out
}

fn as_json(registry: &Registry) -> Result<String, Failure> {
    let plugins: Vec<_> = registry
        .plugins()
        .map(|plugin| {
            serde_json::json!({
                "name": plugin.name,
                "kind": plugin.kind.to_string(),
                "summary": plugin.summary,
                "schema": plugin.schema(),
            })
        })
        .collect();
    to_json("the list of plugins", &plugins)
}
