use std::fmt::Write as _;
use std::path::Path;

use clap::ValueEnum;
use tagalong_app::timings::{Timings, WHOLE_FRAME, too_slow};
use tagalong_log::{Input, is_loss};
use tagalong_math::counted;

use super::args::RunArgs;
use super::report::RunReport;

/// Lines of the funnel that are shown.
const FUNNEL_LINES: usize = 6;

/// Persons that are listed one by one.
const PERSON_LINES: usize = 12;

/// Inputs that give boxes in an image.
const IMAGES: [Input; 3] = [Input::Colour, Input::Depth, Input::Right];

/// Stages whose times are shown beside those of whole frames.
const STAGE_LINES: usize = 3;

/// Returns the results of a run, for a terminal.
pub fn text(
    report: &RunReport,
    timings: &Timings,
    period_ms: Option<f64>,
    folder: &Path,
    args: &RunArgs,
) -> String {
    let mut out = String::new();
    let frames = &report.frames;
    let _ = writeln!(
        out,
        "{}: {}, people in {} of them ({}{})",
        report.log.name,
        counted(frames.read, "frame"),
        frames.with_person,
        report.ended,
        // The end that was reached is not the one of the recording.
        if report.data_lost { ", but part of the log was lost" } else { "" }
    );
    persons(&mut out, report, args);
    funnel(&mut out, report);
    times(&mut out, timings, period_ms, args);
    losses(&mut out, report);
    let has_images = IMAGES.iter().any(|input| report.inputs.usable().contains(&input.name()));
    files(&mut out, folder, has_images, args.overlay.is_some());
    out
}

fn persons(out: &mut String, report: &RunReport, args: &RunArgs) {
    let _ = match report.persons.len() {
        0 => writeln!(
            out,
            "no person was found; `{}` looks for the cause, and --overlay=debug shows the test that \
             dropped each candidate",
            doctor(report, args)
        ),
        // A person whose track ends is reported under a new ID: these are no persons.
        count => writeln!(out, "{}:", counted(count, "ID")),
    };
    // The longest seen: short-lived IDs say little.
    let mut longest: Vec<_> = report.persons.iter().collect();
    longest.sort_by_key(|(_, person)| std::cmp::Reverse(person.seen_frames));
    let further = longest.split_off(longest.len().min(PERSON_LINES));
    longest.sort_by_key(|(id, _)| **id);
    for (id, person) in longest {
        let _ = writeln!(
            out,
            "  {id}: frames {} to {}, seen in {}",
            person.first_frame, person.last_frame, person.seen_frames
        );
    }
    if let Some((_, person)) = further.first() {
        let frames = counted(person.seen_frames, "frame");
        let _ = writeln!(out, "  and {} more, seen in at most {frames}", further.len());
    }
}

/// Returns the command that looks for the cause of a result, for the config and the log of the run.
pub fn doctor(report: &RunReport, args: &RunArgs) -> String {
    let log = quoted(&args.log().display().to_string());
    // A config that the program chose is known by its name alone.
    let config = match args.config() {
        Some(path) => quoted(&path.display().to_string()),
        None => {
            let name = &report.config.name;
            name.strip_suffix(".toml").unwrap_or(name).to_owned()
        }
    };
    let mut command = format!("tagalong doctor {config} {log}");
    if let Some(camera) = &args.input.camera {
        let _ = write!(command, " --camera {}", quoted(camera));
    }
    if let Some(stamps) = args.input.stamps.and_then(|stamps| stamps.to_possible_value()) {
        let _ = write!(command, " --stamps {}", stamps.get_name());
    }
    command
}

/// Returns a path as one word of a POSIX shell.
pub fn quoted(path: &str) -> String {
    let is_plain = path.chars().all(|c| c.is_ascii_alphanumeric() || "/._-+=:@%,".contains(c));
    if is_plain && !path.is_empty() {
        return path.to_owned();
    }
    // A quote ends the quoted word, stands escaped, and begins the next.
    format!("'{}'", path.replace('\'', "'\\''"))
}

/// Writes the tests that dropped most.
fn funnel(out: &mut String, report: &RunReport) {
    let mut lines: Vec<_> = report.funnel.iter().collect();
    lines.sort_by_key(|line| std::cmp::Reverse(line.count));
    if !lines.is_empty() {
        let _ = writeln!(out, "candidates dropped by:");
    }
    for line in lines.iter().take(FUNNEL_LINES) {
        let _ = writeln!(out, "  {} {}", line.test, line.count);
    }
}

/// Writes the times of whole frames and of the stages whose worst frames were slowest.
fn times(out: &mut String, timings: &Timings, period_ms: Option<f64>, args: &RunArgs) {
    let summary = timings.summary();
    let Some(whole) = summary.get(WHOLE_FRAME) else { return };
    let mut stages: Vec<_> = summary.iter().filter(|(name, _)| **name != WHOLE_FRAME).collect();
    stages.sort_by(|a, b| b.1.max_ms.total_cmp(&a.1.max_ms));
    let _ =
        writeln!(out, "{:<14}{:>8}{:>8}{:>8}{:>8}", "wall time, ms", "p50", "p95", "p99", "worst");
    for (name, t) in std::iter::once((&WHOLE_FRAME, whole)).chain(stages).take(1 + STAGE_LINES) {
        let [p50, p95, p99] = [t.p50_ms, t.p95_ms, t.p99_ms];
        let _ = writeln!(out, "  {name:<12}{p50:>8.2}{p95:>8.2}{p99:>8.2}{:>8.2}", t.max_ms);
    }
    if let Some(slow) = period_ms.and_then(|period_ms| too_slow(whole.mean_ms, period_ms)) {
        let log = quoted(&args.log().display().to_string());
        let _ = writeln!(
            out,
            "  {slow};\n  `tagalong doctor {log}` prints the time of each pipeline; a detector can \
             run in every Nth frame only (`every = N` beside its `plugin`)"
        );
    }
}

fn losses(out: &mut String, report: &RunReport) {
    if !report.data_lost {
        return;
    }
    let _ = writeln!(out, "part of the log was lost or could not be used:");
    for (name, count) in report.counters.iter().filter(|(name, _)| is_loss(name)) {
        let _ = writeln!(out, "  {name} {count}");
    }
}

fn files(out: &mut String, folder: &Path, has_images: bool, overlay: bool) {
    let shown = folder.display();
    let _ = writeln!(out, "files in {shown}; to look at them:");
    let _ = writeln!(out, "  tagalong view {}", quoted(&shown.to_string()));
    let mcap = quoted(&folder.join("tracks.mcap").display().to_string());
    if has_images {
        let _ =
            writeln!(out, "  rerun {mcap}    (people in 3D, camera; images with --with-images)");
        let _ = writeln!(out, "  Foxglove opens the same file: people in 3D, boxes in the image");
    } else {
        let _ = writeln!(out, "  rerun {mcap}, or Foxglove: people in 3D");
        let _ = writeln!(
            out,
            "  no camera was used: the people are in tracks-metres.csv, and tracks.csv has no box"
        );
    }
    if overlay {
        let _ = writeln!(out, "  {shown}/overlay/ has a picture of every frame");
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::super::report::RunReport;
    use super::{losses, quoted};

    #[test]
    fn counters_of_what_was_read_are_no_losses() {
        let counters = ["chunks_without_crc", "depth_registered", "truncated"];
        let counters: BTreeMap<String, u64> = counters.map(|name| (name.to_owned(), 2)).into();
        let report = RunReport { data_lost: true, counters, ..RunReport::default() };
        let mut out = String::new();
        losses(&mut out, &report);
        assert_eq!(out, "part of the log was lost or could not be used:\n  truncated 2\n");
    }

    #[test]
    fn a_printed_path_is_one_word_of_a_shell() {
        assert_eq!(quoted("runs/a-b.c"), "runs/a-b.c");
        assert_eq!(quoted("my runs/a"), "'my runs/a'");
        assert_eq!(quoted("it's; rm"), "'it'\\''s; rm'");
    }
}
