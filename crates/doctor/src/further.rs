//! Further attempts after a visit, if its findings require them: other settings and other configs.

use tagalong_app::choice::{CHOICES, fitting};
use tagalong_config::Registry;

use super::args::Trying;
use super::visit::{Scope, Visit};
use super::{alternatives, checks, preparations};

/// Tries other settings and other configs if the findings require it.
pub fn ask_further(visit: &mut Visit, when: Trying, scope: Scope, registry: &Registry) {
    if visit.evidence.refusal.is_some() {
        let found = fitting(scope.log, registry, scope.input, CHOICES.len()).fitting;
        visit.evidence.fitting = found.iter().map(|other| other.choice.config).collect();
        return;
    }
    visit.evidence.preparations = preparations::tried(visit, when, scope, registry);
    let is_wanted = match when {
        Trying::Never => false,
        Trying::Always => true,
        Trying::Auto => checks::asks_for_settings(&visit.evidence),
    };
    if is_wanted && visit.evidence.trial.failure.is_none() {
        visit.evidence.alternatives = alternatives::tried(visit, scope, registry);
    }
}
