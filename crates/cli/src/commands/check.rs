use std::fmt::Write as _;
use std::path::Path;

use tagalong_app::choice::sources;
use tagalong_app::config_file::{ConfigFile, OuterSettings};
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print};
use tagalong_app::suggest::check_log_path;
use tagalong_config::Registry;
use tagalong_log::{FrameSource, Inputs, Usage};
use tagalong_pipeline::Pipeline;

/// Frames of the log that are tried.
const FRAMES: u64 = 3;

/// Runs `tagalong check CONFIG [LOG]`.
///
/// # Errors
/// A mistake in the config, or the reason for which the log does not suit it.
pub fn check(registry: &Registry, config: &Path, log: Option<&Path>, format: Format) -> Outcome {
    let file = ConfigFile::read(config)?;
    let (pipeline, _) = file.pipeline(registry, None)?;
    file.check_tuning(registry)?;
    let outer = file.outer_for(&pipeline)?;
    let inputs = pipeline.inputs();
    let fit = log.map(|log| fits(pipeline, &outer, log)).transpose()?;
    let data_lost = fit.as_ref().is_some_and(|fit| fit.data_lost);
    let notes = fit.map(|fit| fit.notes);
    let config = config.display();
    print(&match format {
        Format::Text => {
            let mut out = format!("{config}: right; {}\n", in_words(inputs));
            if let (Some(log), Some(notes)) = (log, notes) {
                let _ = writeln!(out, "{}: fits", log.display());
                notes.iter().for_each(|note| out += &format!("  {note}\n"));
            }
            out
        }
        Format::Json => {
            let (needs, uses) = (names(inputs, Usage::Required), names(inputs, Usage::Optional));
            let answer = serde_json::json!({
                "config": config.to_string(), "needs": needs, "uses": uses, "log": log,
                "notes": notes,
            });
            format!("{answer:#}\n")
        }
    })?;
    Ok(Ended::with_loss(data_lost))
}

/// Facts about a log that fits.
struct Fit {
    /// Notes of the reader.
    notes: Vec<String>,
    /// Part of the log was lost.
    data_lost: bool,
}

/// Tries the first frames of the log.
fn fits(mut pipeline: Pipeline, outer: &OuterSettings, log: &Path) -> Result<Fit, Failure> {
    check_log_path(log)?;
    let mut source = FrameSource::open(log, &outer.input, &outer.limits, pipeline.inputs())?;
    let missing = |why| Failure::failed(format!("`{}`: {why}", log.display()));
    pipeline.check_sources(sources(&source)).map_err(missing)?;
    let mut tried = 0;
    while tried < FRAMES
        && let Some(item) = source.next_frame()
    {
        pipeline.step(&item.frame).map_err(Failure::failed)?;
        tried += 1;
    }
    // A log that opens but yields no frame is no fit.
    if tried == 0 {
        return Err(Failure::failed(format!("{}: no frame that can be used", log.display())));
    }
    Ok(Fit { notes: source.notes().to_vec(), data_lost: source.data_lost() })
}

fn names(inputs: Inputs, usage: Usage) -> Vec<&'static str> {
    inputs.of(usage).map(|input| input.name()).collect()
}

/// Formats inputs as "needs colour and depth; uses laser where the log has it".
fn in_words(inputs: Inputs) -> String {
    let (needs, uses) = (names(inputs, Usage::Required), names(inputs, Usage::Optional));
    let needs = match needs.is_empty() {
        true => "no particular image".to_owned(),
        false => needs.join(" and "),
    };
    match uses.is_empty() {
        true => format!("needs {needs}"),
        false => format!("needs {needs}; uses {} where the log has it", uses.join(" and ")),
    }
}
