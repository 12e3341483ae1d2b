use tagalong_log::{Inputs, LogError, Usage};

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Checks that the log has the inputs that the config needs.
pub fn needs(evidence: &Evidence) -> Option<Finding> {
    let usable = evidence.inspection.usable.join(", ");
    if let Some(missing) = &evidence.missing {
        let (severity, why) = if evidence.is_named {
            let why = "`tagalong run CONFIG LOG` and a robot refuse this pipeline; `tagalong run LOG` tracks \
                       people without commands to a robot";
            (Severity::Bad, why)
        } else {
            let why = "`tagalong run LOG` still tracks people; a robot refuses to drive with this \
                       pipeline";
            (Severity::Warn, why)
        };
        return Some(Finding::new("needs", severity, missing.to_string()).why(why));
    }
    let Some(LogError::Missing { wanted, hint, .. }) = &evidence.refusal else {
        let needed = words(evidence.inputs);
        if usable.is_empty() {
            let measured = format!("the config needs {needed}; nothing in the log can be used");
            let finding = Finding::new("needs", Severity::Bad, measured);
            return Some(
                finding.remedy("`tagalong inspect` prints for each topic why it cannot be used"),
            );
        }
        let measured = format!("the config needs {needed}; the log has {usable}");
        return Some(Finding::new("needs", Severity::Ok, measured));
    };
    let hint = hint.trim_start_matches("; ");
    let other = match &evidence.fitting[..] {
        [] => "take another config, see the column `needs` in configs/README.md".to_owned(),
        fitting => format!("take a config that fits this log: {}", fitting.join(", ")),
    };
    let remedy = if hint.is_empty() { other } else { format!("{hint};\nor {other}") };
    let measured = format!(
        "the log has no {wanted}; it has {}",
        if usable.is_empty() { "nothing usable" } else { &usable }
    );
    let finding = Finding::new("needs", Severity::Bad, measured).remedy(remedy);
    Some(finding.why("the pipeline cannot run on this log at all"))
}

fn words(inputs: Inputs) -> String {
    let names: Vec<&str> = inputs.of(Usage::Required).map(|input| input.name()).collect();
    if names.is_empty() { "any image".into() } else { names.join(", ") }
}
