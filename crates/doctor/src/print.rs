use std::fmt::Write as _;

use tagalong_app::timings::too_slow;
use tagalong_math::counted;

use super::coverage::{Alternative, Coverage};
use super::diagnosis::{Diagnosis, Drop, Row};
use super::finding::{Finding, Severity};

/// Largest number of lines of the funnel that are shown.
const FUNNEL_LINES: usize = 8;

/// Largest number of settings that are shown.
const SETTING_LINES: usize = 10;

/// Returns the diagnosis, for a terminal.
pub fn text(diagnosis: &Diagnosis) -> String {
    let mut out = String::new();
    let config = diagnosis.config.display();
    let log = diagnosis.log.display();
    pipelines(&mut out, diagnosis);
    let _ = writeln!(out, "{log} through {config}, {}", counted(diagnosis.frames, "frame"));
    out.push('\n');
    for line in diagnosis.inputs.lines() {
        let _ = writeln!(out, "{line}");
    }
    if !diagnosis.inputs.topics.is_empty() {
        out.push('\n');
    }
    diagnosis.findings.iter().for_each(|found| finding(&mut out, found));
    too_slow_here(&mut out, diagnosis);
    settings(&mut out, diagnosis);
    if let Some(folder) = &diagnosis.pictures {
        let _ = writeln!(out, "\npictures of frames with their tracks: {}", folder.display());
    }
    if !diagnosis.funnel.is_empty() {
        let _ =
            writeln!(out, "\ncandidates dropped by each test, and its settings with their values:");
    }
    diagnosis.funnel.iter().take(FUNNEL_LINES).for_each(|line| drop(&mut out, line));
    summary(&mut out, &diagnosis.findings);
    out
}

/// Writes the table of the pipelines, and names the selected one.
fn pipelines(out: &mut String, diagnosis: &Diagnosis) {
    if diagnosis.pipelines.is_empty() {
        return;
    }
    let frames = counted(diagnosis.frames, "frame");
    let _ = writeln!(out, "pipelines that fit {}, on {frames}:\n", diagnosis.log.display());
    let _ = writeln!(out, "  {}  {:>7}  pipeline", heading(), "ms");
    for Row { config, taken, coverage, frame_ms, failure, .. } in &diagnosis.pipelines {
        let mark = if *taken { " (taken by `run`)" } else { "" };
        let failure = failure.iter().map(|why| format!(": failed, {why}")).collect::<String>();
        let _ = writeln!(out, "  {}  {frame_ms:>7.1}  {config}{mark}{failure}", figures(coverage));
    }
    let _ = writeln!(out, "{}", legend(&diagnosis.coverage));
    if let Some(why) = &diagnosis.network {
        let _ = writeln!(out, "  no network is among them: {why}");
    }
    slow(out, diagnosis);
    if let Some(taken) = diagnosis.pipelines.iter().find(|row| row.taken) {
        let contents = &diagnosis.contents;
        let name = &taken.config;
        let why = taken.reason;
        let _ =
            writeln!(out, "\nthe log has {contents}: `tagalong run` takes {name}, because {why}");
        if let Some(better) = &diagnosis.better {
            let _ = writeln!(out, "{better}");
        }
        better(out, taken, &diagnosis.pipelines);
        out.push('\n');
    }
}

/// Writes that the pipeline takes longer per frame than the interval between frames of the log.
fn too_slow_here(out: &mut String, diagnosis: &Diagnosis) {
    let Some(period_ms) = diagnosis.period_ms else { return };
    let Some(slow) = too_slow(diagnosis.coverage.frame_ms, period_ms) else { return };
    // Without a config, the times of all pipelines are printed above.
    let others = if diagnosis.pipelines.is_empty() {
        "; `tagalong doctor LOG` prints the time of each pipeline"
    } else {
        ""
    };
    let _ = writeln!(out, "\n{slow}{others}");
}

/// Writes which pipelines take longer per frame than the interval between frames of the log.
fn slow(out: &mut String, diagnosis: &Diagnosis) {
    let Some(period_ms) = diagnosis.period_ms else { return };
    let slow = diagnosis.pipelines.iter().filter(|row| row.frame_ms > period_ms);
    let names: Vec<&str> = slow.map(|row| row.config.as_str()).collect();
    if !names.is_empty() {
        let _ = writeln!(
            out,
            "  ms: wall time per frame on this computer; the log has a frame every {period_ms:.0} \
             ms: live, {} would skip some",
            names.join(", ")
        );
    }
}

/// Gain of a pipeline over the selected one below which it is not mentioned.
const MIN_GAIN: f64 = 0.03;

/// Writes which pipeline misses fewer person-sized shapes on this log than the selected one.
/// Nothing else is measured: without truth, a pipeline that finds people under changing IDs looks
/// equally good.
fn better(out: &mut String, taken: &Row, rows: &[Row]) {
    let tracking = rows.iter().filter(|row| row.coverage.moving > 0);
    let best = tracking.max_by(|a, b| a.coverage.worth().total_cmp(&b.coverage.worth()));
    let needed = taken.coverage.worth() + MIN_GAIN;
    let Some(best) = best.filter(|best| best.coverage.worth() > needed) else { return };
    let Some(best_found) = best.coverage.found() else { return };
    let Some(taken_found) = taken.coverage.found() else { return };
    if best_found > taken_found {
        let name = &best.config;
        let _ = writeln!(
            out,
            "{name} misses fewer shapes here ({} against {}); ID switches are not measured: \
             compare with `annotate` and `bench`",
            percent(1.0 - best_found),
            percent(1.0 - taken_found)
        );
    }
}

/// Writes the results of the settings that were tried.
fn settings(out: &mut String, diagnosis: &Diagnosis) {
    if diagnosis.alternatives.is_empty() {
        return;
    }
    let _ = writeln!(out, "\nother settings on this log, the best first:");
    let _ = writeln!(out, "  {}  setting", heading());
    let _ = writeln!(out, "  {}  (as it is)", figures(&diagnosis.coverage));
    for Alternative { change, coverage } in diagnosis.alternatives.iter().take(SETTING_LINES) {
        let _ = writeln!(out, "  {}  {change}", figures(coverage));
    }
    let more = diagnosis.alternatives.len().saturating_sub(SETTING_LINES);
    if more > 0 {
        let _ = writeln!(out, "  and {more} more, see --format json");
    }
    if diagnosis.pipelines.is_empty() {
        let _ = writeln!(out, "{}", legend(&diagnosis.coverage));
    }
}

/// Returns the names of the columns of [`figures`].
fn heading() -> String {
    format!("{:>6} {:>6} {:>6} {:>6} {:>7}", "moving", "still", "boxes", "idle", "missed")
}

fn figures(coverage: &Coverage) -> String {
    let missed = coverage.found().map_or_else(|| "-".into(), |part| percent(1.0 - part));
    let idle = if coverage.boxes == 0 { "-".into() } else { percent(coverage.idle()) };
    format!(
        "{:>6} {:>6} {:>6.2} {idle:>6} {missed:>7}",
        coverage.moving,
        coverage.still,
        coverage.boxes_a_frame(),
    )
}

fn percent(part: f64) -> String {
    format!("{:.0} %", 100.0 * part)
}

/// Returns the meaning of the columns, depending on the data of the log.
fn legend(coverage: &Coverage) -> &'static str {
    if coverage.has_depth {
        "  moving, still: tracks that moved, and that never did; boxes: per frame; idle: boxes where\n  \
         nothing comes or goes; missed: person-sized shapes that come and go without a track"
    } else {
        "  moving, still: tracks that moved, and that never did; boxes: per frame; idle: boxes of\n  \
         tracks that never moved; missed: not measured without depth"
    }
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
    let pictures = drop.pictures.iter().map(|path| format!("pictures: {}", path.display()));
    for line in std::iter::once(drop.why.clone()).chain(pictures) {
        let _ = writeln!(out, "{:13}{line}", "");
    }
}

fn summary(out: &mut String, findings: &[Finding]) {
    let [bad, warn, unknown] = [Severity::Bad, Severity::Warn, Severity::Unknown]
        .map(|severity| findings.iter().filter(|finding| finding.severity == severity).count());
    let _ = match (bad, warn) {
        (0, 0) if unknown > 0 => writeln!(out, "\nno problem found; {unknown} not known"),
        (0, 0) => writeln!(out, "\nno problem found"),
        _ => writeln!(out, "\n{bad} bad, {warn} to look at; begin with the first one"),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the row of a pipeline with a number of moving tracks, and a number of missed shapes
    /// of 100.
    fn row(config: &str, moving: usize, unexplained: usize) -> Row {
        let coverage = Coverage { moving, blobs: 100, unexplained, ..Coverage::default() };
        let config = config.to_owned();
        Row { config, taken: false, reason: "", coverage, frame_ms: 1.0, failure: None }
    }

    fn said(taken: Row, other: Row) -> String {
        let mut out = String::new();
        let rows = [taken, other];
        better(&mut out, &rows[0], &rows);
        out
    }

    #[test]
    fn a_finding_that_is_not_known_is_not_passed_over() {
        let mut out = String::new();
        let well = Finding::new("rate", Severity::Ok, "");
        summary(&mut out, std::slice::from_ref(&well));
        assert_eq!(out, "\nno problem found\n");
        out.clear();
        summary(&mut out, &[well, Finding::new("odometry", Severity::Unknown, "")]);
        assert_eq!(out, "\nno problem found; 1 not known\n");
    }

    #[test]
    fn a_report_with_the_times_of_all_pipelines_does_not_advise_itself() {
        let mut diagnosis = Diagnosis { period_ms: Some(40.0), ..Diagnosis::default() };
        diagnosis.coverage.frame_ms = 80.0;
        let mut out = String::new();
        too_slow_here(&mut out, &diagnosis);
        assert!(
            out.contains("live, the others are skipped; `tagalong doctor LOG` prints"),
            "{out}"
        );
        diagnosis.pipelines = vec![row("late", 1, 0)];
        diagnosis.network = Some("install one".to_owned());
        out.clear();
        too_slow_here(&mut out, &diagnosis);
        assert!(out.ends_with("live, the others are skipped\n"), "{out}");
        // A network that does not fit is not listed among the pipelines that do.
        let printed = text(&diagnosis);
        assert!(printed.contains("\n  no network is among them: install one\n"), "{printed}");
    }

    #[test]
    fn pipelines_that_are_slower_than_the_log_are_named() {
        let mut out = String::new();
        let quick = row("quick", 1, 0);
        let late = Row { frame_ms: 50.0, ..row("late", 1, 0) };
        let mut diagnosis = Diagnosis { pipelines: vec![quick, late], ..Diagnosis::default() };
        slow(&mut out, &diagnosis);
        assert_eq!(out, "", "the rate of the log is not known");
        diagnosis.period_ms = Some(40.0);
        slow(&mut out, &diagnosis);
        assert!(out.contains("every 40 ms: live, late would skip some"), "{out}");
    }

    #[test]
    fn a_pipeline_that_misses_fewer_shapes_is_told_with_what_was_not_measured() {
        let told = said(row("first", 3, 16), row("second", 4, 5));
        assert_eq!(
            told,
            "second misses fewer shapes here (5 % against 16 %); ID switches are not measured: \
             compare with `annotate` and `bench`\n"
        );
        assert_eq!(said(row("first", 3, 16), row("second", 4, 15)), "", "too small a gain");
        assert_eq!(said(row("first", 3, 16), row("second", 0, 5)), "", "no track of it moves");
        let mut idle = row("first", 3, 5);
        idle.coverage.idle_boxes = 100;
        assert_eq!(said(idle, row("second", 4, 5)), "", "it misses as many");
    }
}
