use tagalong_app::config_file::OuterSettings;
use tagalong_app::format::TableFormat;
use tagalong_app::outcome::{Ended, Failure, Outcome, print};
use tagalong_app::remedies::Remedies;
use tagalong_app::serialize::to_json;
use tagalong_config::{PluginInfo, Registry, commented_defaults};
use tagalong_pipeline::PipelineSettings;

use crate::keys;

/// Name under which the keys around the plugins are printed.
const PIPELINE: &str = "pipeline";

/// Name under which all keys are printed.
const ALL: &str = "all";

/// Name under which the settings of the rejection funnel's tests are printed.
const FUNNEL: &str = "funnel";

/// Name of a schema in messages.
const SCHEMA: &str = "the schema";

/// Example of the plugin sections of a config.
const PLUGIN_SECTIONS: &str = "\
# The plugins (see `tagalong list`). The settings of each one are in `config`; `tagalong config
# NAME` prints them.
# [[detectors]]
# plugin = \"depth-template\"
# roles = [\"discover\", \"follow\"]
# every = 1
# offset = 0
# verify = true
# config = {}
#
# [filter]
# plugin = \"ekf\"
# config = {}
";

/// Returns everything around the plugins, with its defaults.
fn pipeline_defaults() -> String {
    let own = commented_defaults::<PipelineSettings>();
    let outer = commented_defaults::<OuterSettings>();
    format!("{own}\n{PLUGIN_SECTIONS}{outer}")
}

/// Runs `tagalong config PLUGIN`.
///
/// # Errors
/// If there is no such plugin: names the nearest one.
pub fn config(registry: &Registry, plugin: &str, format: TableFormat) -> Outcome {
    let text = match plugin {
        PIPELINE => around(format)?,
        ALL => all(registry, format)?,
        FUNNEL => funnel(registry, format)?,
        name => one(find(registry, name)?, format)?,
    };
    print(&text)?;
    Ok(Ended::Well)
}

/// Runs `tagalong schema`.
///
/// # Errors
/// If stdout cannot be written.
pub fn schema(registry: &Registry) -> Outcome {
    print(&to_json(SCHEMA, &keys::schema(registry))?)?;
    Ok(Ended::Well)
}

fn find<'a>(registry: &'a Registry, name: &str) -> Result<&'a PluginInfo, Failure> {
    registry.find(name).map_err(|error| {
        Failure::usage(format!("{error}; or `{PIPELINE}` for all settings outside the plugins"))
    })
}

fn around(format: TableFormat) -> Result<String, Failure> {
    Ok(match format {
        TableFormat::Text => pipeline_defaults(),
        TableFormat::Markdown => keys::markdown_around(),
        TableFormat::Json => to_json(SCHEMA, &keys::around_schema())?,
    })
}

fn one(plugin: &PluginInfo, format: TableFormat) -> Result<String, Failure> {
    Ok(match format {
        TableFormat::Text => plugin.defaults(),
        TableFormat::Markdown => keys::markdown_of(plugin),
        TableFormat::Json => to_json(SCHEMA, &plugin.schema())?,
    })
}

fn all(registry: &Registry, format: TableFormat) -> Result<String, Failure> {
    Ok(match format {
        TableFormat::Text => {
            let plugins = registry.plugins();
            let defaults = plugins.map(|p| format!("\n# ---- {}\n{}", p.name, p.defaults()));
            pipeline_defaults() + &defaults.collect::<String>()
        }
        TableFormat::Markdown => keys::markdown(registry),
        TableFormat::Json => to_json(SCHEMA, &keys::schema(registry))?,
    })
}

fn funnel(registry: &Registry, format: TableFormat) -> Result<String, Failure> {
    let remedies = Remedies::new(registry);
    Ok(match format {
        TableFormat::Text => remedies.toml()?,
        TableFormat::Markdown => remedies.markdown(),
        TableFormat::Json => to_json("the remedies", &serde_json::json!(remedies.all()))?,
    })
}
