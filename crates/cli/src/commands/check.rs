use std::fmt::Write as _;
use std::path::Path;

use crate::run::cannot_steer;
use tagalong::logs::sources_of;
use tagalong_app::config_file::{ConfigFile, OuterSettings};
use tagalong_app::format::Format;
use tagalong_app::lacking::Lacking;
use tagalong_app::misfit::Traits;
use tagalong_app::outcome::{Ended, Failure, Outcome, print};
use tagalong_app::suggest::check_log_path;
use tagalong_config::{PathText, Registry};
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Usage};
use tagalong_pipeline::{BlindZone, Pipeline, Sources, Suits};

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
    let mut needs = names(inputs, &outer.input, Usage::Required);
    if needs_odometry(&pipeline) {
        needs.push("odometry");
    }
    let uses = names(inputs, &outer.input, Usage::Optional);
    let distances = pipeline.safety_distances();
    if format == Format::Text {
        // Told before the log is tried, for a log that does not fit changes nothing about the config.
        let mut distances = distances.as_ref().map(ToString::to_string).unwrap_or_default();
        if !distances.is_empty() && uses.contains(&Input::Laser.name()) {
            distances += "  without a laser scanner it sees no people outside the view of its \
                          camera, such as beside or behind it\n";
        }
        print(&format!("{}: valid; {}\n{distances}", config.display(), in_words(&needs, &uses)))?;
        for note in file.notes()? {
            print(&format!("  note: {note}\n"))?;
        }
    }
    let suits = pipeline.config().suits;
    let alone = pipeline.cautions(None);
    let fit = log.map(|log| fits(&file, pipeline, &outer, log)).transpose()?;
    let blind_zone = fit.as_ref().and_then(|fit| fit.blind_zone);
    let data_lost = fit.as_ref().is_some_and(|fit| fit.data_lost);
    let seen_m = fit.as_ref().and_then(|fit| fit.traits.camera_height_m);
    let height_m = seen_m.or_else(|| outer.input.mount().map(|mount| mount.height_m));
    let unsuited = unsuited(height_m, fit.as_ref(), &suits);
    let cautions = fit.as_ref().map_or(alone, |fit| fit.cautions.clone());
    let (topics, notes) = fit.map(|fit| (fit.topics, fit.notes)).unzip();
    print(&match format {
        Format::Text => {
            let mut out = String::new();
            if let Some(unsuited) = &unsuited {
                let _ = writeln!(out, "  {unsuited}");
            }
            for caution in &cautions {
                let _ = writeln!(out, "  warning: {caution}");
            }
            if let Some(zone) = &blind_zone {
                out += &told_zone(zone);
            }
            if let (Some(log), Some(topics), Some(notes)) = (log, topics, notes) {
                let _ = writeln!(out, "{}: fits", log.display());
                topics.iter().for_each(|topic| out += &format!("  {topic}\n"));
                notes.iter().for_each(|note| out += &format!("  {note}\n"));
            }
            out
        }
        Format::Json => {
            let answer = serde_json::json!({
                "config": config.display().to_string(), "needs": needs, "uses": uses,
                "log": log.map(PathText), "topics": topics, "notes": notes, "unsuited": unsuited,
                "cautions": cautions, "distances": distances, "blind_zone": blind_zone,
            });
            format!("{answer:#}\n")
        }
    })?;
    Ok(Ended::with_loss(data_lost))
}

/// Returns true for a config that a robot without odometry cannot run: its controller needs it, or
/// `[suits]` says so.
fn needs_odometry(pipeline: &Pipeline) -> bool {
    let all_but_odometry = Sources { depth: true, right: true, laser: true, odometry: false };
    pipeline.check_sources(all_but_odometry).is_err() || pipeline.config().suits.odometry
}

/// Facts about a log that fits.
struct Fit {
    /// Topics that are read, each with its input.
    topics: Vec<String>,
    /// Notes of the reader.
    notes: Vec<String>,
    /// Part of the log was lost.
    data_lost: bool,
    /// Properties that `[suits]` may exclude.
    traits: Traits,
    /// Region that the camera of the log does not see, for a config with a controller.
    blind_zone: Option<BlindZone>,
    /// Warnings of the settings with the camera of the log.
    cautions: Vec<String>,
}

/// Returns the warning of a log, or of the camera of a config alone, that `[suits]` excludes.
fn unsuited(camera_height_m: Option<f64>, fit: Option<&Fit>, suits: &Suits) -> Option<String> {
    let alone = Traits { has_odometry: true, ..Traits::default() };
    let traits = fit.map_or(alone, |fit| fit.traits);
    let misfits = Traits { camera_height_m, ..traits }.misfits(suits);
    (!misfits.is_empty()).then(|| {
        format!(
            "warning: {}: take another config, see the first table of configs/README.md",
            misfits.join("; ")
        )
    })
}

/// Returns what the camera does not see in a line.
fn told_zone(zone: &BlindZone) -> String {
    let floor = match zone.floor_m {
        Some(floor_m) => format!("no floor nearer than {floor_m:.2} m in front of the footprint"),
        None => "no floor".to_owned(),
    };
    let degrees = zone.field_of_view_deg;
    format!(
        "  its camera sees {floor}, and has a horizontal field of view of {degrees:.0} degrees\n"
    )
}

/// Tries the first frames of the log.
fn fits(
    file: &ConfigFile,
    mut pipeline: Pipeline,
    outer: &OuterSettings,
    log: &Path,
) -> Result<Fit, Failure> {
    check_log_path(log)?;
    let mut source = FrameSource::open(log, &outer.input, &outer.limits, pipeline.inputs())?;
    pipeline.check_sources(sources_of(&source)).map_err(|why| cannot_steer(file, log, &why))?;
    let mut tried = 0;
    let mut lacking = Lacking::default();
    let mut blind_zone = None;
    let mut cautions = Vec::new();
    while tried < FRAMES
        && let Some(item) = source.next_frame()
    {
        blind_zone = pipeline.blind_zone(&item.frame.camera);
        cautions = pipeline.cautions(Some(&item.frame.camera));
        let report = lacking.step(&mut pipeline, &item.frame).map_err(Failure::failed)?;
        tried += u64::from(report.is_some());
    }
    if let Some(error) = lacking.failure() {
        return Err(Failure::failed(error));
    }
    // A log that opens but yields no frame is no fit.
    if tried == 0 {
        return Err(Failure::failed(format!("{}: no frame that can be used", log.display())));
    }
    let used = source.account().topics.iter().filter(|topic| topic.used_as.is_some());
    let topics = used.map(ToString::to_string).collect();
    let mut notes = source.notes().to_vec();
    notes.extend(lacking.warnings());
    let traits = Traits::of(&source);
    Ok(Fit { topics, notes, data_lost: source.data_lost(), traits, blind_zone, cautions })
}

/// Returns the names of the inputs that a log has to have, or that are used where it has them.
fn names(inputs: Inputs, settings: &InputSettings, wanted: Usage) -> Vec<&'static str> {
    let mut names = Vec::new();
    for declared in [Usage::Required, Usage::Optional] {
        for input in inputs.of(declared) {
            if usage_of(input, declared, settings) == Some(wanted) {
                names.push(input.name());
            }
        }
    }
    names
}

/// Returns the usage of an input under the settings of a config. `None` for sources of obstacles where
/// the config has none.
fn usage_of(input: Input, declared: Usage, settings: &InputSettings) -> Option<Usage> {
    if input == Input::OBSTACLES {
        // Silent ones stop the robot, but for bumpers, which speak when they are touched.
        return (!settings.sources.is_empty()).then_some(Usage::Required);
    }
    // A log without a topic that is named is refused.
    let is_named = settings.topic_of(input).is_some();
    Some(if is_named { Usage::Required } else { declared })
}

/// Formats inputs as "needs colour and depth; uses laser where the log has it".
fn in_words(needs: &[&str], uses: &[&str]) -> String {
    let needs =
        if needs.is_empty() { "no particular image".to_owned() } else { needs.join(" and ") };
    if uses.is_empty() {
        format!("needs {needs}")
    } else {
        format!("needs {needs}; uses {} if the log has it", uses.join(" and "))
    }
}
