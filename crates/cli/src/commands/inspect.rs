use std::path::Path;

use tagalong_app::config_file::{ConfigFile, OuterSettings};
use tagalong_app::format::Format;
use tagalong_app::input_args::InputArgs;
use tagalong_app::outcome::{Ended, Outcome, print};
use tagalong_app::serialize::to_json;
use tagalong_app::suggest::check_log_path;

/// Runs `tagalong inspect LOG`.
///
/// # Errors
/// A log that cannot be read at all.
pub fn inspect(log: &Path, config: Option<&Path>, args: &InputArgs, format: Format) -> Outcome {
    let outer = match config {
        Some(config) => ConfigFile::read(config)?.outer()?,
        None => OuterSettings::default(),
    };
    let outer = args.applied(outer);
    check_log_path(log)?;
    let found = tagalong_log::inspect(log, &outer.input, &outer.limits)?;
    print(&match format {
        Format::Text => found.to_string(),
        Format::Json => to_json("the contents of the log", &found)?,
    })?;
    Ok(Ended::with_loss(found.data_lost))
}
