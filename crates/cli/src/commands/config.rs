use tagalong_core::{Registry, commented_defaults};
use tagalong_pipeline::PipelineSettings;

use crate::config_file::OuterSettings;
use crate::outcome::{Ended, Failure, Outcome, print};

/// The name under which the keys around the plugins are printed.
const PIPELINE: &str = "pipeline";

/// How plugins are named in a config.
const PLUGIN_SECTIONS: &str = "\
# The plugins (see `tagalong list`). The settings of each one stand in `config`; `tagalong config
# NAME` prints them.
# [[detectors]]
# plugin = \"depth-template\"
# roles = [\"discover\", \"follow\"]
# every = 1
# offset = 0
# config = {}
#
# [filter]
# plugin = \"ekf\"
# config = {}
";

/// `tagalong config PLUGIN`.
///
/// # Errors
/// If there is no such plugin: names the nearest one.
pub fn config(registry: &Registry, plugin: &str) -> Outcome {
    let text = if plugin == PIPELINE {
        let own = commented_defaults::<PipelineSettings>();
        let outer = commented_defaults::<OuterSettings>();
        format!("{own}\n{PLUGIN_SECTIONS}{outer}")
    } else {
        let found = registry.find(plugin).map_err(|error| {
            Failure::usage(format!("{error}; or `{PIPELINE}` for everything around the plugins"))
        })?;
        found.defaults()
    };
    print(&text)?;
    Ok(Ended::Well)
}
