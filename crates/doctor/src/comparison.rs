//! All built-in pipelines that fit a log, side by side.

use serde::Serialize;
use tagalong_app::choice::{CHOICES, Choice, Fitting, fitting};
use tagalong_app::outcome::Failure;
use tagalong_app::remedies::Remedies;
use tagalong_config::Registry;

use super::alternatives::Alternative;
use super::coverage::Coverage;
use super::diagnosis::Diagnosis;
use super::evidence::Evidence;
use super::visit::{Scope, Visit};
use super::{DoctorArgs, Trying, alternatives, snapshots};

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
    let found = fitting(scope.log, registry, scope.input, CHOICES.len());
    if found.fitting.is_empty() {
        return Err(found.none_fits(scope.log));
    }
    let contents = found.contents();
    let better = found.better();
    let mut rows = Vec::new();
    let mut first = None;
    for Fitting { choice, config } in found.fitting {
        let visit = Visit::make(config, scope, registry)?;
        if let Some(folder) = &args.output {
            snapshots::write(&visit, scope, &folder.join(choice.config))?;
        }
        rows.push(Row::of(choice, &visit.evidence, first.is_none()));
        first.get_or_insert(visit);
    }
    let (Some(mut visit), Some(taken)) = (first, rows.first()) else {
        return Err(Failure::failed("no pipeline was tried"));
    };
    let name = taken.config;
    if args.settings == Trying::Always {
        visit.ask_further(args.settings, scope, registry);
    }
    // The other pipelines are alternatives, too, and have been tried already.
    let shown = std::mem::take(&mut visit.evidence.alternatives);
    visit.evidence.alternatives = alternatives::ranked(rows.iter().skip(1).map(Row::alternative));
    let folder = args.output.as_ref().map(|folder| folder.join(name));
    let first =
        Diagnosis::of(&visit, name.into(), args, folder.as_deref(), &Remedies::new(registry))?;
    let pictures = args.output.clone();
    Ok(Diagnosis { pipelines: rows, contents, better, alternatives: shown, pictures, ..first })
}

impl Row {
    fn of(choice: Choice, evidence: &Evidence, taken: bool) -> Self {
        Self {
            config: choice.config,
            taken,
            reason: choice.reason,
            coverage: evidence.coverage.clone(),
            frame_ms: evidence.coverage.frame_ms,
            failure: evidence.trial.failure.clone(),
        }
    }

    fn alternative(&self) -> Alternative {
        Alternative { change: alternatives::another(self.config), coverage: self.coverage.clone() }
    }
}
