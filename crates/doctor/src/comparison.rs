//! Comparison of all built-in pipelines that fit a log.

use tagalong_app::choice::{CHOICES, Fitting, fitting};
use tagalong_app::outcome::Failure;
use tagalong_app::remedies::Remedies;
use tagalong_config::Registry;

use super::args::{DoctorArgs, Trying};
use super::diagnosis::{Diagnosis, Row};
use super::visit::{Scope, Visit};
use super::{alternatives, further, snapshots};

/// Visits a log with each pipeline that fits it; the findings are those of the first one, which
/// `tagalong run` selects.
///
/// # Errors
/// A log that no pipeline fits, or a folder that cannot be written.
pub fn compare(args: &DoctorArgs, scope: Scope, registry: &Registry) -> Result<Diagnosis, Failure> {
    let found = fitting(scope.log, registry, scope.input, CHOICES.len());
    if found.fitting.is_empty() {
        return Err(found.none_fits(scope.log));
    }
    let contents = found.contents();
    let better = found.better();
    let network = found.without_network();
    let mut rows = Vec::new();
    let mut first = None;
    for Fitting { choice, config } in found.fitting {
        // Only the checks of the first pipeline are reported.
        let scope = Scope { with_samples: first.is_none(), ..scope };
        // The config of an installed network gets the name that `run` accepts.
        let name = config.stem();
        let visit = Visit::make(config, scope, registry)?;
        if let Some(folder) = &args.output {
            snapshots::write(&visit, scope, &folder.join(&name))?;
        }
        rows.push(Row::of(name, choice, &visit.evidence, first.is_none()));
        first.get_or_insert(visit);
    }
    let (Some(mut visit), Some(taken)) = (first, rows.first()) else {
        return Err(Failure::failed("no pipeline was tried"));
    };
    let name = taken.config.clone();
    if args.settings == Trying::Always {
        further::ask_further(&mut visit, args.settings, scope, registry);
    }
    // The other pipelines are alternatives, too, and have been tried already.
    let shown = std::mem::take(&mut visit.evidence.alternatives);
    visit.evidence.alternatives = alternatives::ranked(rows.iter().skip(1).map(Row::alternative));
    let folder = args.output.as_ref().map(|folder| folder.join(&name));
    let first =
        Diagnosis::of(&visit, name.into(), args, folder.as_deref(), &Remedies::new(registry))?;
    let pictures = args.output.clone();
    let pipelines = rows;
    Ok(Diagnosis { pipelines, contents, better, network, alternatives: shown, pictures, ..first })
}
