//! All built-in pipelines that fit a log, side by side.

use serde::Serialize;
use tagalong_app::choice::{CHOICES, fitting};
use tagalong_app::outcome::Failure;
use tagalong_config::Registry;

use super::coverage::Coverage;
use super::diagnosis::Diagnosis;
use super::visit::{Scope, Visit};
use super::{DoctorArgs, Trying, snapshots};

/// Pipeline in the comparison.
#[derive(Debug, Serialize)]
pub struct Row {
    /// Name of the built-in config.
    pub config: &'static str,
    /// True for the one that `tagalong run` takes.
    pub taken: bool,
    /// Reason for the choice of such a pipeline.
    pub reason: &'static str,
    /// Figures on the log.
    pub coverage: Coverage,
    /// Mean time of a frame, ms.
    pub frame_ms: f64,
    /// Error of a plugin that ended it.
    pub failure: Option<String>,
}

/// Visits a log with each pipeline that fits it; the findings are those of the first, which
/// `tagalong run` takes.
///
/// # Errors
/// A log that no pipeline fits; a folder that cannot be written.
pub fn compare(args: &DoctorArgs, scope: Scope, registry: &Registry) -> Result<Diagnosis, Failure> {
    let found = fitting(scope.log, registry, CHOICES.len());
    if found.fitting.is_empty() {
        return Err(found.none_fits(scope.log));
    }
    let (mut rows, mut first) = (Vec::new(), None);
    for fitting in found.fitting {
        let choice = fitting.choice;
        let folder = args.output.as_ref().map(|folder| folder.join(choice.config));
        let mut visit = Visit::make(fitting.config, scope, registry)?;
        if let Some(folder) = &folder {
            snapshots::write(&visit, scope, folder)?;
        }
        rows.push(Row {
            config: choice.config,
            taken: first.is_none(),
            reason: choice.reason,
            coverage: visit.evidence.coverage.clone(),
            frame_ms: visit.evidence.coverage.frame_ms,
            failure: visit.evidence.trial.failure.clone(),
        });
        if first.is_none() {
            // The other pipelines are tried anyway; settings only where that is asked for.
            if args.settings == Trying::Always {
                visit.ask_further(args.settings, scope, registry);
            }
            first = Some(Diagnosis::of(&visit, choice.config.into(), args, folder.as_deref())?);
        }
    }
    let first = first.ok_or_else(|| Failure::failed("no pipeline was tried"))?;
    Ok(Diagnosis { pipelines: rows, ..first })
}
