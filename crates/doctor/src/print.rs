use std::fmt::Write as _;

use super::finding::{Finding, Severity};
use super::{Diagnosis, Drop};

/// Lines of the funnel that are shown.
const FUNNEL_LINES: usize = 8;

/// Returns the diagnosis, for a terminal.
pub fn text(diagnosis: &Diagnosis) -> String {
    let mut out = String::new();
    let (config, log) = (diagnosis.config.display(), diagnosis.log.display());
    let _ = writeln!(out, "{log} through {config}, {} frames", diagnosis.frames);
    out.push('\n');
    diagnosis.findings.iter().for_each(|found| finding(&mut out, found));
    if !diagnosis.funnel.is_empty() {
        let _ =
            writeln!(out, "\nwhat the pipeline dropped, and the settings that decide it (now):");
    }
    diagnosis.funnel.iter().take(FUNNEL_LINES).for_each(|line| drop(&mut out, line));
    summary(&mut out, &diagnosis.findings);
    out
}

fn finding(out: &mut String, finding: &Finding) {
    let _ = writeln!(out, "{:<5} {:<13} {}", finding.severity.word(), finding.id, finding.measured);
    if finding.severity < Severity::Warn {
        return;
    }
    let _ = writeln!(out, "{:19} why: {}", "", finding.why);
    for (number, line) in finding.remedy.iter().flat_map(|remedy| remedy.lines()).enumerate() {
        let lead = if number == 0 { "do:  " } else { "     " };
        let _ = writeln!(out, "{:19} {lead}{line}", "");
    }
}

fn drop(out: &mut String, drop: &Drop) {
    let _ = writeln!(out, "  {:>9}  {}", drop.count, drop.test);
    let look = drop.look.iter();
    let pictures = drop.pictures.iter().map(|path| format!("pictures: {}", path.display()));
    for line in look.cloned().chain(drop.settings.iter().cloned()).chain(pictures) {
        let _ = writeln!(out, "{:13}{line}", "");
    }
}

fn summary(out: &mut String, findings: &[Finding]) {
    let count = |severity| findings.iter().filter(|f| f.severity == severity).count();
    let (bad, warn) = (count(Severity::Bad), count(Severity::Warn));
    let _ = match (bad, warn) {
        (0, 0) => writeln!(out, "\nnothing to complain about"),
        _ => writeln!(out, "\n{bad} bad, {warn} to look at; begin with the first"),
    };
}
