//! `tagalong doctor`: explains missing or false detections.
//!
//! A `visit` passes a log through a pipeline and measures both; the `checks` turn the measurements
//! into findings. `scenery` has the shapes that come and go in depth, independent of any pipeline,
//! and `coverage` compares them with the tracks. If these disagree, `alternatives` tries other
//! settings on the same frames, and `preparations` tries other colour orders, scales and placements
//! of the images for a neural network. Without a config, `comparison` visits the log with each
//! built-in pipeline that fits it.
//!
//! ```
//! use clap::Parser as _;
//! use tagalong_config::Registry;
//! use tagalong_doctor::{doctor, DoctorArgs};
//!
//! #[derive(clap::Parser)]
//! struct Cli {
//!     #[command(flatten)]
//!     args: DoctorArgs,
//! }
//!
//! let cli = Cli::parse_from(["doctor", "none.mcap", "--frames", "100"]);
//! let failure = doctor(&cli.args, &Registry::default()).unwrap_err();
//! assert_eq!(failure.code, 1);
//! assert!(failure.message.contains("none.mcap"), "{}", failure.message);
//! ```

mod alternatives;
mod args;
mod checks;
mod comparison;
mod coverage;
mod depth_unit;
mod diagnosis;
mod evidence;
mod finding;
mod further;
mod preparations;
mod present;
mod print;
mod scenery;
mod sheets;
mod snapshots;
mod trial;
mod visit;

pub use args::{DoctorArgs, Trying};
use tagalong_app::config_file::ConfigFile;
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print};
use tagalong_app::remedies::Remedies;
use tagalong_app::serialize::to_json;
use tagalong_app::suggest::check_log_path;
use tagalong_config::Registry;
use tagalong_log::write::RunDir;

use self::diagnosis::Diagnosis;
use self::finding::Severity;
use self::visit::{Scope, Visit};

/// Runs the checks and a pipeline on a log, and reports the problems.
///
/// # Errors
/// A config or a log that cannot be read, or a folder that cannot be written. A problem with the
/// log is not an error, but gives exit code 3.
pub fn doctor(args: &DoctorArgs, registry: &Registry) -> Outcome {
    let config = args.config.as_deref().map(ConfigFile::read).transpose()?;
    // Errors in a config are reported before those of the log.
    if let Some(config) = &config {
        config.pipeline(registry, None)?;
    }
    check_log_path(&args.log)?;
    if let Some(folder) = &args.output {
        RunDir::check(folder, args.overwrite, &args.log).map_err(Failure::usage)?;
    }
    let scope = Scope {
        log: &args.log,
        input: &args.input,
        frames: args.frames,
        with_pictures: args.output.is_some(),
        is_named: config.is_some(),
        with_samples: true,
    };
    let diagnosis = match config {
        Some(config) => diagnose(config, args, scope, registry)?,
        None => comparison::compare(args, scope, registry)?,
    };
    print(&match args.format {
        Format::Text => print::text(&diagnosis),
        Format::Json => to_json("the diagnosis", &diagnosis)?,
    })?;
    let is_bad = diagnosis.findings.iter().any(|finding| finding.severity == Severity::Bad);
    Ok(if is_bad { Ended::WithFindings } else { Ended::Well })
}

/// Visits a log with the pipeline of a config.
fn diagnose(
    config: ConfigFile,
    args: &DoctorArgs,
    scope: Scope,
    registry: &Registry,
) -> Result<Diagnosis, Failure> {
    let mut visit = Visit::make(config, scope, registry)?;
    further::ask_further(&mut visit, args.settings, scope, registry);
    let pictures = args.output.as_ref().map(|folder| folder.join("frames"));
    if let Some(folder) = &pictures {
        snapshots::write(&visit, scope, folder)?;
    }
    let path = args.config.clone().unwrap_or_default();
    let diagnosis =
        Diagnosis::of(&visit, path, args, args.output.as_deref(), &Remedies::new(registry))?;
    Ok(Diagnosis { pictures, ..diagnosis })
}
