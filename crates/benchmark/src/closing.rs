//! Lines below the tables of a benchmark: means, the best two, reasons for skipped tasks, and
//! limits of the logs.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use tagalong_math::{counted, draws_needed};
use tagalong_report::{Benchmark, Outcome, PipelineSummary, Summary, TaskResult};

use super::plan::Task;
use super::store::Stored;

/// Maximum number of pipelines whose means are listed in a line.
const MOST_NAMED: usize = 8;
/// Time between two frames from which on they count as separate moments, s.
const FAR_APART_S: f64 = 1.0;
/// Keys of the figure that ranks the pipelines, in order of precedence, with the place in words.
const RANKING: [(&str, &str); 2] =
    [("image.HOTA", "in the image"), ("metres.HOTA", "on the floor")];

/// Returns the means of the main figure, best first, and whether the best two differ significantly.
pub fn ranking(benchmark: &Benchmark) -> String {
    let summary = Summary::new(benchmark);
    let mut out = String::new();
    for (key, place) in RANKING {
        let mut ranked: Vec<(&PipelineSummary, f64, u64)> = summary
            .pipelines
            .iter()
            .filter_map(|pipeline| {
                let of = pipeline.figures.get(key)?;
                Some((pipeline, of.mean, of.logs))
            })
            .collect();
        // A mean over fewer logs, which may be the easier ones, is not comparable.
        let most = ranked.iter().map(|(.., logs)| *logs).max().unwrap_or(0);
        let fewer = fewer_logs(&ranked, most);
        ranked.retain(|(.., logs)| *logs == most);
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        if ranked.is_empty() || most < 2 && ranked.len() < 2 {
            continue;
        }
        let named = ranked.iter().take(MOST_NAMED);
        let named: Vec<String> =
            named.map(|(p, mean, _)| format!("{} {mean:.3}", p.pipeline)).collect();
        let rest = ranked.len().saturating_sub(MOST_NAMED);
        let rest = if rest > 0 { format!(", and {rest} more") } else { String::new() };
        let logs = counted(most, "log");
        let _ = writeln!(
            out,
            "HOTA {place}, mean over {logs} of equal weight: {}{rest}",
            named.join(", ")
        );
        if let [first, second, ..] = &ranked[..] {
            out += &verdict(&summary, key, [&first.0.pipeline, &second.0.pipeline]);
        }
        out += &fewer;
        break;
    }
    out
}

/// Names the pipelines that have fewer logs than others, and so no place among them.
fn fewer_logs(pipelines: &[(&PipelineSummary, f64, u64)], most: u64) -> String {
    let fewer = pipelines.iter().filter(|(.., logs)| *logs < most);
    let named: Vec<String> =
        fewer.map(|(p, mean, logs)| format!("{} {mean:.3} ({logs})", p.pipeline)).collect();
    if named.is_empty() {
        return String::new();
    }
    format!("not ranked, because of fewer logs, with their number: {}\n", named.join(", "))
}

/// States whether two pipelines differ significantly, or how many logs that takes.
fn verdict(summary: &Summary, key: &str, names: [&String; 2]) -> String {
    let mut pairs = summary.pairs.iter().filter(|pair| pair.figure == key);
    let compared = pairs.clone().count();
    let Some(pair) = pairs.find(|p| names.contains(&&p.a) && names.contains(&&p.b)) else {
        return String::new();
    };
    let [first, second] = names;
    let needed = draws_needed(compared);
    if pair.is_clear() {
        format!("{first} is clearly better than {second} (p = {:.3})\n", pair.p_corrected)
    } else if (pair.logs as usize) < needed {
        format!(
            "no difference can be clear with {} and {}: {needed} logs are needed\n",
            counted(pair.logs, "log"),
            counted(compared, "pair")
        )
    } else {
        format!("{first} and {second} do not differ clearly (p = {:.3})\n", pair.p_corrected)
    }
}

/// Returns the reasons for skipped tasks, each once, with the pipelines and logs.
pub fn skipped(tasks: &[TaskResult]) -> String {
    let mut reasons: BTreeMap<&str, [BTreeSet<&str>; 2]> = BTreeMap::new();
    for task in tasks {
        if let Outcome::Skipped { why } = &task.outcome {
            let [pipelines, logs] =
                reasons.entry(why.lines().next().unwrap_or_default()).or_default();
            pipelines.insert(&task.pipeline);
            logs.insert(&task.log);
        }
    }
    let mut out = String::new();
    for (why, [pipelines, logs]) in reasons {
        let [pipelines, logs] =
            [pipelines, logs].map(|names| names.into_iter().collect::<Vec<_>>().join(", "));
        let _ = writeln!(out, "skipped: {pipelines} on {logs}: {why}");
    }
    out
}

/// Returns notes on frames that are so far apart that IDs have little meaning, and on logs of the
/// same room.
pub fn notes(plan: &[Task], all: &[Stored]) -> Vec<String> {
    let mut apart: BTreeMap<&str, f64> = BTreeMap::new();
    let mut rooms: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (task, stored) in plan.iter().zip(all) {
        if stored.result.outcome != Outcome::Done {
            continue;
        }
        if let Some(room) = task.room.as_deref() {
            rooms.entry(room).or_default().insert(&task.log_name);
        }
        if let Some(recording) = stored.recording.as_ref().filter(|_| !task.single_frames) {
            let seconds = 1.0 / recording.rate_hz.max(f64::MIN_POSITIVE);
            if seconds >= FAR_APART_S {
                apart.insert(&task.log_name, seconds);
            }
        }
    }
    let mut notes: Vec<String> = apart
        .into_iter()
        .map(|(log, seconds)| {
            format!(
                "{log}: frames are {seconds:.1} s apart: figures of IDs (HOTA, IDF1, switches) \
                 mean little; `--rooms FILE` can mark such logs as single frames"
            )
        })
        .collect();
    for (room, logs) in rooms.into_iter().filter(|(_, logs)| logs.len() > 1) {
        let names: Vec<&str> = logs.into_iter().collect();
        notes.push(format!(
            "{} are of one room ({room}) and count as {} independent logs: the intervals are too narrow \
             and the p-values too small",
            names.join(" and "),
            names.len()
        ));
    }
    notes
}

/// Names a result after its task. For a log of single frames, it marks the result and removes the
/// figures of tracking.
pub fn with_facts(task: &Task, mut stored: Stored) -> Stored {
    // Two configs with the same settings share a result, which has the name of one of them.
    stored.result.pipeline.clone_from(&task.pipeline);
    if task.single_frames {
        let result = &mut stored.result;
        result.single_frames = true;
        result.repairs.clear();
        result.events.retain(|event| !["switch", "wrong-person"].contains(&event.kind.as_str()));
        for scores in [&mut result.image, &mut result.metres].into_iter().flatten() {
            scores.hota = None;
            scores.ass_a = None;
            scores.idf1 = None;
            scores.mota = None;
        }
    }
    stored
}

#[cfg(test)]
mod tests {
    use tagalong_eval::{Scores, Sequence};

    use super::super::plan::planned_for_tests;
    use super::super::store::Recording;
    use super::*;

    fn scored(pipeline: &str, log: &str, hota: f64) -> TaskResult {
        let scores = Scores { hota: Some(hota), idsw: 3, ..Scores::default() };
        TaskResult {
            pipeline: pipeline.into(),
            log: log.into(),
            image: Some(scores),
            ..TaskResult::default()
        }
    }

    /// Returns two pipelines on so many logs, of which the first is better on each.
    fn two(logs: usize) -> Benchmark {
        let mut tasks = Vec::new();
        for log in 0..logs {
            let log = format!("log {log}");
            tasks.extend([
                scored("a", &log, 0.7),
                scored("b", &log, 0.5 + 0.01 * tasks.len() as f64),
            ]);
        }
        Benchmark { tasks, ..Benchmark::default() }
    }

    #[test]
    fn means_say_their_weights_and_what_the_logs_can_tell() {
        let told = ranking(&two(3));
        assert!(
            told.starts_with("HOTA in the image, mean over 3 logs of equal weight: a 0.700, b 0.5"),
            "{told}"
        );
        assert!(told.contains("with 3 logs and 1 pair: 6 logs are needed"), "{told}");
        assert!(ranking(&two(6)).contains("a is clearly better than b (p = 0.031)"));
        assert_eq!(
            ranking(&Benchmark { tasks: vec![scored("a", "x", 0.5)], ..Benchmark::default() }),
            ""
        );
    }

    #[test]
    fn a_pipeline_with_fewer_logs_is_named_beside_the_ranking() {
        assert!(!ranking(&two(3)).contains("not ranked"));
        let mut benchmark = two(3);
        benchmark.tasks.push(scored("c", "log 1", 0.9));
        let told = ranking(&benchmark);
        assert!(told.contains("mean over 3 logs of equal weight: a 0.700, b"), "{told}");
        let fewer = "not ranked, because of fewer logs, with their number: c 0.900 (1)\n";
        assert!(told.ends_with(fewer), "{told}");
    }

    #[test]
    fn a_reason_is_told_once_for_all_that_it_skips() {
        let mut tasks = Vec::new();
        for (pipeline, log) in [("a", "x"), ("b", "x"), ("a", "y")] {
            let outcome = Outcome::Skipped { why: "no depth\nadvice".into() };
            tasks.push(TaskResult { outcome, ..scored(pipeline, log, 0.5) });
        }
        assert_eq!(skipped(&tasks), "skipped: a, b on x, y: no depth\n");
    }

    #[test]
    fn single_frames_have_no_figures_over_time_and_frames_far_apart_are_noted() {
        let task = planned_for_tests("a");
        let recording =
            Recording { sequence: Sequence::default(), rate_hz: 1.0, ..Recording::default() };
        let result = scored("a", "hall", 0.5);
        let stored = Stored { result, recording: Some(recording), ..Stored::default() };
        let told = notes(std::slice::from_ref(&task), std::slice::from_ref(&stored));
        assert!(told.len() == 1 && told[0].starts_with("hall: frames are 1.0 s apart"), "{told:?}");
        let other = Task { pipeline: "b".into(), ..task.clone() };
        assert_eq!(with_facts(&other, stored.clone()).result.pipeline, "b", "of the same settings");
        let single = Task { single_frames: true, ..task };
        let stored = with_facts(&single, stored);
        assert_eq!(notes(&[single], std::slice::from_ref(&stored)), [""; 0]);
        assert_eq!(stored.result.image.and_then(|scores| scores.hota), None);
        let summary =
            Summary::new(&Benchmark { tasks: vec![stored.result], ..Benchmark::default() });
        assert!(!summary.pipelines[0].figures.contains_key("image.IDSW"));
    }

    #[test]
    fn logs_of_one_room_are_no_independent_ones() {
        let plan = ["x", "y"].map(|log| Task {
            log_name: log.into(),
            room: Some("A".into()),
            ..planned_for_tests("a")
        });
        let all =
            ["x", "y"].map(|log| Stored { result: scored("a", log, 0.5), ..Stored::default() });
        let told = notes(&plan, &all);
        assert!(told.len() == 1 && told[0].starts_with("x and y are of one room (A)"), "{told:?}");
    }
}
