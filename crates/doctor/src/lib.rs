//! `tagalong doctor`: explains missing or false detections.

mod checks;
mod evidence;
mod finding;
mod print;
pub mod remedies;
mod sheets;
mod trial;

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use tagalong_app::config_file::{ConfigFile, OuterSettings};
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, make_folder, print};
use tagalong_app::progress::Progress;
use tagalong_app::serialize::to_json;
use tagalong_app::suggest::check_log_path;
use tagalong_config::Registry;
use tagalong_log::write::RunDir;
use tagalong_log::{FrameSource, Input, examine};
use tagalong_pipeline::Pipeline;

use self::evidence::{Evidence, Samples};
use self::finding::{Finding, Severity};
use self::trial::Trial;

/// Arguments of `tagalong doctor`.
#[derive(Args, Debug)]
pub struct DoctorArgs {
    /// The pipeline, a TOML file.
    pub config: PathBuf,
    /// The log, an MCAP file with ROS 2 messages.
    pub log: PathBuf,
    /// Write pictures of the candidates that each test dropped into this folder.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Replace the pictures of an earlier visit in the same folder.
    #[arg(long)]
    pub overwrite: bool,
    /// Number of frames to examine, from the first one on.
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = clap::value_parser!(u64).range(1..))]
    pub frames: u64,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// Complete result of the doctor.
#[derive(Debug, Serialize)]
struct Diagnosis {
    config: PathBuf,
    log: PathBuf,
    /// Number of examined frames.
    frames: u64,
    findings: Vec<Finding>,
    funnel: Vec<Drop>,
}

/// Line of the rejection funnel.
#[derive(Debug, Serialize)]
struct Drop {
    test: &'static str,
    count: u64,
    /// Advice on the test.
    look: Option<String>,
    /// Settings that belong to it, with their present values.
    settings: Vec<String>,
    /// Pictures of the dropped candidates.
    pictures: Option<PathBuf>,
}

/// Runs the checks and a pipeline on a log, and reports the problems.
///
/// # Errors
/// A config or a log that cannot be read; a folder that cannot be written. A problem with the log
/// is no error, but exit code 3.
pub fn doctor(args: &DoctorArgs, registry: &Registry) -> Outcome {
    let config = ConfigFile::read(&args.config)?;
    let (mut pipeline, _) = config.pipeline(registry, None)?;
    let outer = config.outer()?;
    check_log_path(&args.log)?;
    if let Some(folder) = &args.output {
        RunDir::check(folder, args.overwrite, &args.log).map_err(Failure::usage)?;
    }
    let inputs = pipeline.inputs();
    // Light is judged, and pictures are rendered, also where the pipeline does not use colour.
    let read = inputs.accept(Input::Colour);
    let found = examine(&args.log, &outer.input, &outer.limits, read)?;
    let mut evidence = Evidence {
        samples: Samples::of(expected_frames(&found.inspection).min(args.frames)),
        inspection: found.inspection,
        refusal: found.refusal,
        input: outer.input.clone(),
        inputs,
        trial: Trial::default(),
    };
    if let Some(frames) = found.frames {
        look(frames, &mut pipeline, args, &mut evidence);
    }
    let diagnosis = Diagnosis {
        config: args.config.clone(),
        log: args.log.clone(),
        frames: evidence.trial.frames,
        findings: checks::ALL.iter().filter_map(|check| check(&evidence)).collect(),
        funnel: funnel(&evidence.trial, &pipeline, &outer, args.output.as_deref())?,
    };
    print(&match args.format {
        Format::Text => print::text(&diagnosis),
        Format::Json => to_json("the diagnosis", &diagnosis)?,
    })?;
    let is_bad = diagnosis.findings.iter().any(|finding| finding.severity == Severity::Bad);
    Ok(if is_bad { Ended::WithFindings } else { Ended::Well })
}

/// Returns the number of images on the topic that makes the frames.
fn expected_frames(inspection: &tagalong_log::Inspection) -> u64 {
    let facts = &inspection.facts;
    let topic = facts.colour_topic.as_ref().or(facts.depth_topic.as_ref());
    topic.and_then(|topic| inspection.topic(topic)).map_or(0, |topic| topic.count)
}

/// Makes one pass over the frames.
fn look(mut frames: FrameSource, pipeline: &mut Pipeline, args: &DoctorArgs, out: &mut Evidence) {
    let progress = Progress::new();
    for number in 0..args.frames {
        let Some(item) = frames.next_frame() else { break };
        out.samples.take(number, &item);
        // Without its inputs the pipeline cannot run, but the images can still be measured.
        if out.refusal.is_none() {
            out.trial.step(pipeline, &item.frame, args.output.is_some());
        }
        progress.show(frames.progress(), number, out.trial.people.len());
    }
    out.inspection.counters = frames.counters().clone();
    out.inspection.notes = frames.notes().to_vec();
    out.inspection.data_lost = frames.data_lost();
}

/// Returns the tests by the number of dropped candidates, most first, with the remedies.
fn funnel(
    trial: &Trial,
    pipeline: &Pipeline,
    outer: &OuterSettings,
    folder: Option<&Path>,
) -> Result<Vec<Drop>, Failure> {
    let mut pictures = match folder {
        None => Default::default(),
        Some(folder) => {
            make_folder(folder)?;
            sheets::write(trial, folder).map_err(Failure::failed)?
        }
    };
    let resolved = format!("{}\n{}", pipeline.resolved(), outer.resolved()?);
    let resolved: toml::Table = toml::from_str(&resolved).unwrap_or_default();
    let mut drops: Vec<Drop> = trial
        .funnel
        .entries()
        .iter()
        .map(|entry| {
            let remedy = remedies::of(entry.test);
            Drop {
                test: entry.test,
                count: entry.count,
                settings: remedy.as_ref().map_or_else(Vec::new, |remedy| remedy.lines(&resolved)),
                look: remedy.map(|remedy| remedy.look),
                pictures: pictures.remove(entry.test),
            }
        })
        .collect();
    drops.sort_by_key(|drop| std::cmp::Reverse(drop.count));
    Ok(drops)
}
