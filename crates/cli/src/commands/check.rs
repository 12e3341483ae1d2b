use std::fmt::Write as _;
use std::path::Path;

use tagalong_core::Registry;
use tagalong_log::{FrameSource, Needs};
use tagalong_pipeline::{Pipeline, needs};

use crate::config_file::{ConfigFile, OuterSettings};
use crate::outcome::{Ended, Failure, Outcome, print};
use crate::suggest::check_log_path;

/// Frames of the log that are tried.
const FRAMES: u64 = 3;

/// `tagalong check CONFIG [LOG]`.
///
/// # Errors
/// What is wrong with the config, or why the log does not suit it.
pub fn check(registry: &Registry, config: &Path, log: Option<&Path>) -> Outcome {
    let file = ConfigFile::read(config)?;
    let (pipeline, _) = file.pipeline(registry, None)?;
    let outer = file.outer()?;
    let wanted = needs(|| file.pipeline(registry, None).map(|(pipeline, _)| pipeline))?;
    print(&format!("{}: right; needs {}\n", config.display(), in_words(wanted)))?;
    match log {
        None => Ok(Ended::Well),
        Some(log) => fits(pipeline, &outer, log, wanted),
    }
}

/// Tries the first frames of the log.
fn fits(mut pipeline: Pipeline, outer: &OuterSettings, log: &Path, wanted: Needs) -> Outcome {
    check_log_path(log)?;
    let mut source = FrameSource::open(log, &outer.input, &outer.limits, wanted)?;
    let mut tried = 0;
    while tried < FRAMES
        && let Some(item) = source.next_frame()
    {
        pipeline.step(&item.frame).map_err(Failure::failed)?;
        tried += 1;
    }
    if tried == 0 {
        return Err(Failure::failed(format!("{}: no frame that can be used", log.display())));
    }
    let mut out = format!("{}: fits\n", log.display());
    for note in source.notes() {
        let _ = writeln!(out, "  {note}");
    }
    print(&out)?;
    Ok(Ended::Well)
}

fn in_words(needs: Needs) -> String {
    let named = [(needs.colour, "colour"), (needs.depth, "depth"), (needs.right, "right stereo")];
    let names: Vec<&str> = named.iter().filter(|(is, _)| *is).map(|(_, name)| *name).collect();
    match names.is_empty() {
        true => "no particular image".to_owned(),
        false => format!("{} images", names.join(" and ")),
    }
}
