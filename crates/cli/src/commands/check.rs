use std::fmt::Write as _;
use std::path::Path;

use tagalong_core::Registry;
use tagalong_log::{FrameSource, Needs};
use tagalong_pipeline::{Pipeline, needs};

use crate::args::Format;
use crate::config_file::{ConfigFile, OuterSettings};
use crate::outcome::{Ended, Failure, Outcome, print};
use crate::suggest::check_log_path;

/// Frames of the log that are tried.
const FRAMES: u64 = 3;

/// `tagalong check CONFIG [LOG]`.
///
/// # Errors
/// What is wrong with the config, or why the log does not suit it.
pub fn check(registry: &Registry, config: &Path, log: Option<&Path>, format: Format) -> Outcome {
    let file = ConfigFile::read(config)?;
    let (pipeline, _) = file.pipeline(registry, None)?;
    file.check_tuning(registry)?;
    let outer = file.outer()?;
    let wanted = needs(|| file.pipeline(registry, None).map(|(pipeline, _)| pipeline))?;
    let notes = log.map(|log| fits(pipeline, &outer, log, wanted)).transpose()?;
    let config = config.display();
    print(&match format {
        Format::Text => {
            let mut out = format!("{config}: right; needs {}\n", in_words(wanted));
            if let (Some(log), Some(notes)) = (log, notes) {
                let _ = writeln!(out, "{}: fits", log.display());
                notes.iter().for_each(|note| out += &format!("  {note}\n"));
            }
            out
        }
        Format::Json => {
            let needs = names(wanted);
            let answer = serde_json::json!({
                "config": config.to_string(), "needs": needs, "log": log, "notes": notes,
            });
            format!("{answer:#}\n")
        }
    })?;
    Ok(Ended::Well)
}

/// Tries the first frames of the log; returns what the reader has to say.
fn fits(
    mut pipeline: Pipeline,
    outer: &OuterSettings,
    log: &Path,
    wanted: Needs,
) -> Result<Vec<String>, Failure> {
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
    Ok(source.notes().to_vec())
}

fn names(needs: Needs) -> Vec<&'static str> {
    let named = [(needs.colour, "colour"), (needs.depth, "depth"), (needs.right, "right stereo")];
    named.iter().filter(|(is, _)| *is).map(|(_, name)| *name).collect()
}

fn in_words(needs: Needs) -> String {
    let names = names(needs);
    match names.is_empty() {
        true => "no particular image".to_owned(),
        false => format!("{} images", names.join(" and ")),
    }
}
