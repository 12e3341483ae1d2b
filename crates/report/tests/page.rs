//! The page and the files beside it, on invented results.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod common;

use std::collections::BTreeSet;

use tagalong_eval::Scores;
use tagalong_report::{
    Benchmark, EventRow, Outcome, PairSummary, Summary, TaskResult, Timings, Trajectory, csv, html,
    json,
};

const HOSTILE: &str = "<script>alert(1)</script>\"'&";

fn two_by_three() -> Benchmark {
    common::benchmark(&["alpha", "beta"], &["hall", "lab", "yard"])
}

/// Returns the references of the page to other resources.
fn requests(page: &str) -> Vec<String> {
    let links = page.match_indices("http").map(|(at, _)| &page[at..]);
    let urls = page.match_indices("url(").map(|(at, _)| &page[at..]);
    let sources = page.match_indices("src=\"").map(|(at, _)| &page[at..]);
    let imports = page.match_indices("@import").map(|(at, _)| &page[at..]);
    let sources = sources.filter(|s| !s.starts_with("src=\"data:image/png;base64,"));
    let all = links.chain(urls).chain(sources).chain(imports);
    all.map(|text| text.chars().take(60).collect()).collect()
}

#[test]
fn the_page_asks_nothing_of_the_network() {
    let benchmark = two_by_three();
    let page = html(&benchmark, Some(&common::timings(&benchmark)));
    assert_eq!(requests(&page), [] as [&str; 0]);
    assert!(!page.contains("<link"));
    assert!(page.contains("src=\"data:image/png;base64,"), "the pictures are inside");
}

#[test]
fn hostile_names_are_escaped_everywhere() {
    let mut benchmark = two_by_three();
    for task in &mut benchmark.tasks {
        task.pipeline += HOSTILE;
        task.log += HOSTILE;
        task.hash += HOSTILE;
        task.inputs.insert(HOSTILE.into(), HOSTILE.into());
        task.funnel.iter_mut().for_each(|f| f.test += HOSTILE);
        for event in &mut task.events {
            event.kind += HOSTILE;
            event.text += HOSTILE;
            event.picture_png_base64 = Some(format!("{HOSTILE}AAA"));
        }
        task.missed.iter_mut().for_each(|m| m.test = Some(HOSTILE.into()));
        task.deciding = [(HOSTILE.to_owned(), vec![HOSTILE.to_owned()])].into();
        task.reasons = [(HOSTILE.to_owned(), HOSTILE.to_owned())].into();
        task.causes = vec![HOSTILE.to_owned(); 2];
    }
    for moment in &mut benchmark.moments {
        moment.log += HOSTILE;
    }
    benchmark.moments[0].image_jpeg_base64 = format!("{HOSTILE}AAA");
    benchmark.version = HOSTILE.into();
    common::spoil(&mut benchmark, Outcome::Failed { why: HOSTILE.into() });
    let mut timings = common::timings(&benchmark);
    timings.machine = HOSTILE.into();
    for timing in timings.tasks.values_mut() {
        timing.stages.iter_mut().for_each(|s| s.stage += HOSTILE);
    }
    let page = html(&benchmark, Some(&timings));
    assert!(!page.contains("<script>alert"));
    assert!(page.contains("&lt;script&gt;alert(1)&lt;/script&gt;&quot;"));
    assert!(!page.contains("<img"), "what is not base64 is no picture");
}

#[test]
fn the_order_of_the_tasks_changes_no_byte() {
    let benchmark = two_by_three();
    let mut turned = benchmark.clone();
    turned.tasks.reverse();
    assert_eq!(html(&benchmark, None), html(&turned, None));
    assert_eq!(json(&benchmark).unwrap(), json(&turned).unwrap());
    assert_eq!(csv(&benchmark), csv(&turned));
}

#[test]
fn times_show_only_if_the_machine_was_free() {
    let benchmark = two_by_three();
    let free = common::timings(&benchmark);
    let busy = Timings { exclusive: false, ..free.clone() };
    assert!(html(&benchmark, Some(&free)).contains("an invented machine"));
    let page = html(&benchmark, Some(&busy));
    assert!(!page.contains("an invented machine") && page.contains("had other work"));
    let other = Timings { exclusive: false, ..Timings::default() };
    assert_eq!(page, html(&benchmark, Some(&other)));
}

#[test]
fn small_and_odd_benchmarks_make_a_page() {
    let empty = Benchmark::default();
    assert!(html(&empty, Some(&Timings::default())).contains("no tasks yet"));
    let one = common::benchmark(&["only"], &["lab"]);
    let page = html(&one, None);
    assert!(!page.contains("side by side") && page.contains("only"));
    assert!(!page.contains("★ 0."), "nobody is best alone");
    let mut failed = common::benchmark(&["only"], &["lab"]);
    common::spoil(&mut failed, Outcome::Failed { why: "panicked at frame 7".into() });
    let page = html(&failed, None);
    assert!(page.contains("panicked at frame 7") && page.contains("1 failed"));
    common::spoil(&mut failed, Outcome::Skipped { why: "the log has no depth".into() });
    assert!(html(&failed, None).contains("the log has no depth"));
    let mut several = common::benchmark(&["mono"], &["hall", "lab"]);
    for task in &mut several.tasks {
        task.outcome = Outcome::Skipped { why: "no depth there".into() };
    }
    let page = html(&several, None);
    assert_eq!(page.matches("no depth there").count(), 1, "one reason for both logs");
    assert!(page.contains("hall, lab"));
}

#[test]
fn the_largest_gain_of_a_repair_stands_out() {
    let page = html(&two_by_three(), None);
    let section = page.split("id=\"repairs\"").nth(1).unwrap().split("</section>").next().unwrap();
    assert_eq!(section.matches("<strong>+0.210</strong>").count(), 6, "{section}");
    assert_eq!(section.matches("<strong>").count(), 6);
    for name in ["IDs right", "no misses", "places exact", "boxes right sideways"] {
        assert!(section.contains(name), "{name}");
    }
    let mut without = two_by_three();
    without.tasks.iter_mut().for_each(|task| task.repairs.clear());
    assert!(!html(&without, None).contains("id=\"repairs\""), "results of an older program");
}

#[test]
fn what_is_no_number_is_left_out() {
    let mut benchmark = two_by_three();
    let mut timings = common::timings(&benchmark);
    for task in &mut benchmark.tasks {
        let scores = Scores {
            hota: Some(f64::NAN),
            mota: None,
            wrong_person_s: f64::INFINITY,
            ..Scores::default()
        };
        (task.image, task.metres, task.duration_s) = (Some(scores), Some(scores), f64::NAN);
        task.lamr_curve.iter_mut().for_each(|p| p.fppi = f64::NAN);
        task.tracks
            .push(Trajectory { id: 9, points: vec![[f64::NAN; 3], [0.0, f64::INFINITY, 1.0]] });
        task.events.push(EventRow { t_s: f64::NAN, ..EventRow::default() });
        task.nis.as_mut().unwrap().mean = f64::NAN;
    }
    for timing in timings.tasks.values_mut() {
        timing.frame_ms_p50 = f64::NAN;
        timing.stages[0].p95_ms = f64::INFINITY;
        timing.stages[1].max_ms = f64::NAN;
    }
    let page = html(&benchmark, Some(&timings));
    assert!(!page.contains("NaN") && !page.contains(">inf"));
    csv(&benchmark);
}

#[test]
fn a_miss_rate_from_constant_scores_says_that_it_means_nothing() {
    assert!(!html(&two_by_three(), None).contains("mean nothing"));
    let all = logs_with_lamr(&two_by_three());
    for (distinct_scores, reports, are_few) in [(1, 9, true), (9, 20, true), (10, 20, false)] {
        let mut benchmark = two_by_three();
        let task = &mut benchmark.tasks[0];
        let scores = task.image.expect("figures in the image");
        task.image = Some(Scores { distinct_scores, reports, ..scores });
        let said = format!("{} on {}.", task.pipeline, task.log);
        let left_out = all - logs_with_lamr(&benchmark);
        assert_eq!(left_out, u64::from(are_few), "{distinct_scores} scores");
        let page = html(&benchmark, None);
        let note = page.split("mean nothing").nth(1).and_then(|note| note.split("</p>").next());
        assert_eq!(note.is_some(), are_few, "{distinct_scores} scores");
        assert!(note.is_none_or(|note| note.ends_with(&said)), "{said}: {note:?}");
    }
}

/// The logs with a LAMR, over all pipelines.
fn logs_with_lamr(benchmark: &Benchmark) -> u64 {
    Summary::new(benchmark).pipelines.iter().map(|p| p.figures["image.LAMR"].logs).sum()
}

#[test]
fn every_anchor_leads_somewhere_and_ids_are_unique() {
    let mut benchmark = two_by_three();
    common::spoil(&mut benchmark, Outcome::Failed { why: "x".into() });
    let page = html(&benchmark, Some(&common::timings(&benchmark)));
    let [ids, anchors] = [" id=\"", "href=\"#"].map(|start| -> Vec<&str> {
        page.split(start).skip(1).filter_map(|rest| rest.split('"').next()).collect()
    });
    let mut unique = ids.clone();
    unique.sort();
    unique.dedup();
    assert_eq!(unique.len(), ids.len());
    assert!(anchors.iter().all(|anchor| ids.contains(anchor)));
    assert!(anchors.len() > 8);
}

#[test]
fn json_reads_back_as_the_same_benchmark() {
    let mut benchmark = two_by_three();
    common::spoil(&mut benchmark, Outcome::Skipped { why: "no depth".into() });
    let text = json(&benchmark).unwrap();
    let back: Benchmark = serde_json::from_str(&text).unwrap();
    for task in &mut benchmark.tasks {
        task.events.iter_mut().for_each(|e| e.picture_png_base64 = None);
    }
    benchmark.moments.clear();
    assert!(back == benchmark);
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    let summary: Summary = serde_json::from_value(summary["summary"].clone()).unwrap();
    assert_eq!(summary, Summary::new(&benchmark));
}

#[test]
fn csv_has_one_row_per_task_and_quotes_what_needs_it() {
    let mut benchmark = two_by_three();
    common::spoil(&mut benchmark, Outcome::Failed { why: "said \"no\", then\nstopped".into() });
    let text = csv(&benchmark);
    let lines: Vec<&str> = text.split("\r\n").collect();
    assert_eq!(lines.len(), 1 + 6 + 1);
    let columns: Vec<&str> = lines[0].split(',').collect();
    assert_eq!(lines[1].split(',').count(), columns.len());
    let at = columns.iter().position(|c| *c == "image.HOTA").unwrap();
    let hota: f64 = lines[1].split(',').nth(at).unwrap().parse().unwrap();
    assert_eq!(Some(hota), benchmark.tasks[0].image.unwrap().hota);
    assert!(lines[6].contains("\"said \"\"no\"\", then\nstopped\""));
}

fn with_hota(values: &[(&str, &str, f64)]) -> Benchmark {
    let tasks = values.iter().map(|&(pipeline, log, hota)| TaskResult {
        pipeline: pipeline.into(),
        log: log.into(),
        image: Some(Scores { hota: Some(hota), ..Scores::default() }),
        ..TaskResult::default()
    });
    Benchmark { tasks: tasks.collect(), ..Benchmark::default() }
}

#[test]
fn means_are_over_logs_and_the_best_needs_all_of_them() {
    let mut values =
        vec![("a", "x", 0.5), ("a", "y", 0.6), ("b", "x", 0.6), ("b", "y", 0.8), ("c", "x", 0.9)];
    values.push(("a", "y", 0.8));
    let summary = Summary::new(&with_hota(&values));
    let [a, b, c] =
        ["a", "b", "c"].map(|name| summary.pipeline(name).unwrap().figures["image.HOTA"]);
    assert!((a.mean - 0.6).abs() < 1e-12, "two runs of y are one log");
    let [low, high] = a.interval.unwrap();
    assert_eq!([low, high], [0.0, 1.0], "two logs, and no rate beyond its range");
    assert_eq!((a.best, b.best, c.best), (false, true, false));
    assert_eq!((c.logs, c.interval), (1, None));
    let two = pair_of(&summary, "a", "b");
    let one = pair_of(&summary, "a", "c");
    assert!((two.difference - 0.1).abs() < 1e-12);
    assert_eq!((two.logs, two.interval, two.p_value, two.is_clear()), (2, None, 0.5, false));
    assert_eq!((one.logs, one.interval, one.p_value, one.is_clear()), (1, None, 1.0, false));
}

#[test]
fn a_pipeline_of_fewer_logs_says_so_once_and_a_figure_of_fewer_still_beside_it() {
    let mut benchmark = with_hota(&[("a", "x", 0.5), ("a", "y", 0.6), ("a", "z", 0.6)]);
    benchmark.tasks.extend(with_hota(&[("b", "x", 0.5), ("b", "y", 0.6)]).tasks);
    // On one log two seeds, of which both have an MOTA; the other log has none.
    benchmark.tasks.extend(with_hota(&[("b", "x", 0.5)]).tasks);
    for task in benchmark.tasks.iter_mut().filter(|task| task.pipeline == "b" && task.log == "x") {
        task.image.as_mut().expect("figures in the image").mota = Some(0.25);
    }
    let page = html(&benchmark, None);
    let results = page.split("id=\"results\"").nth(1).expect("the results");
    let results = results.split("<details").next().expect("the first table");
    let row = results.split("<tr").nth(3).expect("the second pipeline");
    assert!(row.contains("3 / 3 <span class=\"fewer\">2 logs</span>"), "of three tasks: {row}");
    assert_eq!(row.matches("2 logs").count(), 1, "{row}");
    assert!(row.contains("0.250</span> <span class=\"fewer\">1 log</span>"), "{row}");
}

#[test]
fn the_plans_of_a_log_without_truth_are_folded_and_take_no_room_from_others() {
    let mut benchmark = two_by_three();
    let logs: BTreeSet<String> = benchmark.tasks.iter().map(|task| task.log.clone()).collect();
    let without = logs.first().expect("a log").clone();
    assert_eq!(open_plans(&benchmark).len(), 2, "of two pipelines each");
    for task in benchmark.tasks.iter_mut().filter(|task| task.log == without) {
        task.truth.clear();
    }
    let open = open_plans(&benchmark);
    assert!(open.len() == 2 && !open.contains(&without), "{open:?}");
}

/// The logs whose plans are open.
fn open_plans(benchmark: &Benchmark) -> Vec<String> {
    let page = html(benchmark, None);
    let plans = page.split("<section id=\"floor\"").nth(1).unwrap();
    let plans = plans.split("</section>").next().unwrap();
    let open = plans.split("<details class=\"print\" open><summary>").skip(1);
    open.filter_map(|rest| rest.split('<').next()).map(ToOwned::to_owned).collect()
}

fn pair_of<'a>(summary: &'a Summary, a: &str, b: &str) -> &'a PairSummary {
    summary.pairs.iter().find(|p| p.a == a && p.b == b && p.figure == "image.HOTA").unwrap()
}

/// Makes results of each of `pipelines` at its level on so many logs, with a different value on
/// each.
fn on_logs(count: usize, pipelines: &[(&str, f64)]) -> Benchmark {
    let names: Vec<String> = (0..count).map(|log| format!("log {log}")).collect();
    let mut values = Vec::new();
    for (at, log) in names.iter().enumerate() {
        for (name, level) in pipelines {
            values.push((*name, log.as_str(), level + 0.01 * level * (at as f64 + 1.0)));
        }
    }
    with_hota(&values)
}

#[test]
fn a_difference_on_fewer_than_six_logs_is_never_clear() {
    for (logs, clear) in [(2, false), (5, false), (6, true)] {
        let benchmark = on_logs(logs, &[("a", 0.3), ("b", 0.6)]);
        let summary = Summary::new(&benchmark);
        let pair = pair_of(&summary, "a", "b");
        assert_eq!(pair.p_value, 2.0 / f64::from(1 << logs));
        assert_eq!((pair.is_clear(), pair.interval.unwrap()[0] > 0.0), (clear, true));
        let page = html(&benchmark, None);
        assert_eq!(page.contains("The difference is clear (p = 0.031)."), clear);
        assert_eq!(page.contains("<strong>b</strong>, clear"), clear, "{logs} logs");
        assert_eq!(page.contains("b, not clear"), !clear);
        assert_eq!(page.contains("These logs do not tell the two apart (p = "), !clear);
    }
}

#[test]
fn the_verdict_of_a_pair_allows_for_the_other_pairs() {
    let three = [("a", 0.3), ("b", 0.6), ("c", 0.9)];
    let summary = Summary::new(&on_logs(6, &three));
    let pair = pair_of(&summary, "a", "b");
    assert_eq!((pair.p_value, pair.p_corrected), (2.0 / 64.0, 6.0 / 64.0));
    assert!(!pair.is_clear());
    let more = Summary::new(&on_logs(8, &three));
    assert!(pair_of(&more, "a", "b").is_clear());
    let two = html(&on_logs(6, &three[..2]), None);
    let three = html(&on_logs(6, &three), None);
    assert!(!two.contains("Holm's correction") && three.contains("Holm's correction"));
    let needed = "With 6 logs and 3 pairs no difference can be clear: 7 logs are needed.";
    assert!(three.contains(needed) && three.contains("With 3 pairs that takes 7 logs at least."));
    assert!(!two.contains("can be clear") && two.contains("With 1 pair that takes 6 logs"));
    assert!(three.contains("it can exclude 0 beside"));
}

/// Returns where each text begins in the page.
fn places<'a>(page: &str, texts: impl IntoIterator<Item = &'a str>) -> Vec<usize> {
    let places = texts
        .into_iter()
        .map(|text| page.find(text).unwrap_or_else(|| panic!("{text} is missing")));
    places.collect()
}

#[test]
fn pipelines_stand_in_the_order_of_their_scores_and_the_plot_comes_first() {
    fn sections(page: &str) -> Vec<usize> {
        places(page, ["<section id=\"speed\"", "<section id=\"results\""])
    }

    let mut benchmark = on_logs(2, &[("a", 0.3), ("b", 0.9), ("c", 0.6)]);
    // The best of all is on one log only.
    benchmark.tasks.extend(with_hota(&[("d", "log 0", 0.99)]).tasks);
    let page = html(&benchmark, None);
    let table = &page[page.find("<section id=\"results\"").unwrap()..];
    let found =
        places(table, ["</svg> b</span>", "</svg> c</span>", "</svg> a</span>", "</svg> d</span>"]);
    assert!(found.is_sorted(), "{found:?}");
    assert!(!sections(&page).is_sorted(), "without times there is no plot");
    let timings = common::timings(&benchmark);
    assert!(sections(&html(&benchmark, Some(&timings))).is_sorted());
}

#[test]
fn the_matrix_has_each_pair_twice_with_opposite_signs() {
    let benchmark = on_logs(8, &[("a", 0.3), ("b", 0.6), ("c", 0.9)]);
    let page = html(&benchmark, None);
    let matrix = page.split("class=\"matrix\"").nth(1).unwrap().split("</table>").next().unwrap();
    assert_eq!(matrix.matches("▲").count(), 3);
    assert_eq!(matrix.matches("▼").count(), 3);
    let gain = page.matches("▲ +0.314").count();
    assert_eq!((gain, page.matches("▼ −0.314").count()), (2, 2), "{matrix}");
    assert!(!html(&on_logs(8, &[("a", 0.3), ("b", 0.6)]), None).contains("class=\"matrix\""));
}

#[test]
fn a_missed_person_is_shown_with_the_test_and_the_setting_that_decides_it() {
    let benchmark = two_by_three();
    let page = html(&benchmark, None);
    let section = page.split("<section id=\"missed\"").nth(1).unwrap();
    let section = section.split("<section id=\"pairs\"").next().unwrap();
    assert!(section.contains("data:image/jpeg;base64,/9j/"));
    assert!(section.contains("least_margin = 0.2"));
    assert!(section.contains("hall, frame 61"), "{section}");
    assert!(
        section.contains("✕ margin") && section.contains("● track 12")
            || section.contains("✕ size")
    );
    assert!(section.contains("scene-person") && section.contains("scene-track s1"));
    assert!(!json(&benchmark).unwrap().contains("/9j/"), "images are for the page alone");
    let found = Benchmark { tasks: with_hota(&[("a", "x", 0.5)]).tasks, ..Benchmark::default() };
    assert!(!html(&found, None).contains("id=\"missed\""));
}

#[test]
fn thirty_pipelines_make_a_page_below_five_megabytes() {
    let names: Vec<String> = (0..30).map(|i| format!("pipeline-{i:02}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut benchmark =
        common::benchmark(&names, &["hall", "lab", "office", "yard", "street", "shop"]);
    for task in &mut benchmark.tasks {
        let events = task.events.clone();
        task.events = (0..12).flat_map(|_| events.clone()).collect();
        // As large as the pictures of a real benchmark.
        let picture = Some("QUJD".repeat(4000));
        task.events.iter_mut().for_each(|event| event.picture_png_base64 = picture.clone());
    }
    let moment = benchmark.moments[0].clone();
    let image_jpeg_base64 = "QUJD".repeat(12_000);
    let moments = (1..200).map(|frame| tagalong_report::Moment {
        frame,
        image_jpeg_base64: image_jpeg_base64.clone(),
        ..moment.clone()
    });
    benchmark.moments = moments.collect();
    let page = html(&benchmark, Some(&common::timings(&benchmark)));
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    assert!(page.len() > 3_000_000, "{} bytes: the bounds are not reached", page.len());
    assert_eq!(page.matches("class=\"pair\"").count(), 10);
    for folded in ["4 more pairs", "Miss rate on 2 more logs"] {
        assert_eq!(page.matches(&format!("<summary>{folded}</summary>")).count(), 1, "{folded}");
    }
    assert!(page.matches("class=\"moment\"").count() >= 20);
}

#[test]
fn one_log_shows_no_interval() {
    let benchmark = with_hota(&[("a", "x", 0.25), ("b", "x", 0.75)]);
    let page = html(&benchmark, None);
    assert!(page.contains("0.750") && !page.contains("class=\"ends\">0.750"), "{page}");
    assert!(page.contains("These logs do not tell the two apart (p = 1.000, 1 log in common"));
}

#[test]
fn people_are_counted_once_whatever_the_number_of_seeds() {
    fn task(log: &str, seed: u64, never_confirmed: u64) -> TaskResult {
        TaskResult {
            pipeline: "a".into(),
            log: log.into(),
            seed,
            image: Some(Scores { truth_ids: 4, never_confirmed, ..Scores::default() }),
            ..TaskResult::default()
        }
    }

    fn summary(tasks: &[TaskResult]) -> Summary {
        Summary::new(&Benchmark { tasks: tasks.to_vec(), ..Benchmark::default() })
    }

    let mut tasks = vec![task("x", 1, 1), task("x", 2, 1)];
    let one = summary(&tasks);
    let found = one.pipelines[0].people_found.unwrap();
    assert_eq!((found.estimate, one.pipelines[0].people), (0.75, 4));
    assert_eq!(found.ends(), None, "one log does not tell how much others differ");
    let text = serde_json::to_string(&one).unwrap();
    assert_eq!(serde_json::from_str::<Summary>(&text).unwrap(), one);
    tasks.push(task("y", 1, 3));
    let two = summary(&tasks);
    let found = two.pipelines[0].people_found.unwrap();
    assert_eq!((found.estimate, two.pipelines[0].people), (0.5, 8));
    assert!(found.lower < 0.1 && found.upper > 0.9, "logs differ more than people: {found:?}");
}

#[test]
fn each_pair_says_in_one_line_why() {
    let page = html(&two_by_three(), None);
    let section = &page[page.find("id=\"pairs\"").unwrap()..];
    let line = &section[section.find("class=\"pair-why\">").unwrap() + 17..];
    let line = &line[..line.find('<').unwrap()];
    assert!(line.contains(" people, ") && line.contains(" misses of "), "{line}");
    let line = line.replace("&quot;", "\"");
    let mut reasons = ["margin", "size"]
        .map(|test| format!(" the test \"{test}\" dropped the candidate"))
        .into_iter();
    assert!(reasons.any(|reason| line.contains(&reason)), "{line}");
}

#[test]
fn a_missed_person_has_the_sentence_of_the_frame_and_other_causes_have_names() {
    let mut benchmark = two_by_three();
    for task in &mut benchmark.tasks {
        task.missed.retain(|missed| missed.other_cause.is_some());
        task.missed.iter_mut().for_each(|missed| missed.frame = benchmark.moments[0].frame);
    }
    let page = html(&benchmark, None);
    assert!(
        page.contains(&format!("✕ too far</strong><span class=\"why line\">{}", common::TOO_FAR))
    );
    let section = &page[page.find("id=\"pairs\"").expect("the pairs")..];
    let line = section.split("class=\"pair-why\">").nth(1).expect("a pair");
    let line = line.split('<').next().unwrap_or_default().replace("&quot;", "\"");
    assert!(line.contains("counted by frame, was \"too far\""), "{line}");
}

#[test]
fn settings_of_a_cause_are_of_a_named_pipeline_if_another_one_has_others() {
    let mut benchmark = two_by_three();
    let same = html(&benchmark, None);
    assert!(same.contains("<span class=\"why\">the test &quot;margin&quot;"), "no name");
    for task in &mut benchmark.tasks {
        task.reasons.insert("margin".to_owned(), format!("a setting of {}", task.pipeline));
    }
    let page = html(&benchmark, None);
    let named = ["alpha", "beta"].map(|p| format!("<span class=\"why\">{p}: a setting of {p}<"));
    assert!(named.iter().any(|text| page.contains(text)), "one of them");
}

#[test]
fn a_narrow_column_breaks_the_path_of_a_setting_at_its_dots() {
    let mut benchmark = two_by_three();
    for task in &mut benchmark.tasks {
        task.causes = vec!["It passes with detectors.0.config.cost = 0.38.".to_owned(); 2];
    }
    let page = html(&benchmark, None);
    assert!(page.contains("with detectors.0.<wbr>config.<wbr>cost = 0.38.</span>"));
}

#[test]
fn all_that_are_equal_when_printed_are_best() {
    fn task(pipeline: &str, hota: f64) -> TaskResult {
        let image =
            Scores { hota: Some(hota), tp: 1, truths: 4, truth_ids: 2, ..Scores::default() };
        let mut task = TaskResult { pipeline: pipeline.into(), ..TaskResult::default() };
        task.log = "x".into();
        task.image = Some(image);
        task
    }

    let tasks = vec![task("a", 0.0351), task("b", 0.0354), task("c", 0.034)];
    let summary = Summary::new(&Benchmark { tasks, ..Benchmark::default() });
    let best: Vec<&str> = summary
        .pipelines
        .iter()
        .filter(|pipeline| pipeline.figures["image.HOTA"].best)
        .map(|pipeline| pipeline.pipeline.as_str())
        .collect();
    assert_eq!(best.len(), 2, "{best:?}");
    assert!(!best.contains(&"c"), "{best:?}");
}

#[test]
fn an_interval_in_a_cell_has_its_level() {
    let page = html(&two_by_three(), None);
    assert!(page.contains("<span class=\"ends\"><span class=\"level\">95\u{a0}%: "));
    assert!(page.contains("below each its 95\u{a0}% interval"), "where the level has no room");
}

#[test]
fn a_pair_that_finds_the_same_people_differs_in_its_false_reports() {
    let mut benchmark = two_by_three();
    let noisy = benchmark.tasks[0].pipeline.clone();
    for task in &mut benchmark.tasks {
        let rate = if task.pipeline == noisy { 1.25 } else { 0.0 };
        let scores = task.image.as_mut().unwrap();
        scores.never_confirmed = 0;
        scores.fp_per_frame = Some(rate);
    }
    let page = html(&benchmark, None);
    assert!(page.contains(">Both found "), "both find everybody");
    assert!(page.contains(&format!("; {noisy} reports 1.25 false people per frame, ")));
}

#[test]
fn the_time_on_the_wrong_person_is_named_before_id_switches() {
    let mut benchmark = two_by_three();
    let odd = benchmark.tasks[0].pipeline.clone();
    for (wrong_s, named, silent) in [
        (5.0, " follows the wrong person for 5.0 s per log, ", " switches IDs "),
        (0.25, " switches IDs 9.0 times per log, ", " follows the wrong person "),
    ] {
        for task in &mut benchmark.tasks {
            let is_odd = task.pipeline == odd;
            let scores = task.image.as_mut().expect("figures in the image");
            scores.wrong_person_s = if is_odd { wrong_s } else { 0.0 };
            scores.idsw = if is_odd { 9 } else { 0 };
        }
        let page = html(&benchmark, None);
        assert!(page.contains(&format!("; {odd}{named}")), "{named}");
        assert!(!page.contains(&format!("; {odd}{silent}")), "{silent}");
    }
}

#[test]
fn notes_on_the_logs_are_in_the_page_and_in_json() {
    let notes = vec!["hall.people.csv: nothing matches".to_owned()];
    let benchmark = Benchmark { notes: notes.clone(), ..two_by_three() };
    assert!(html(&benchmark, None).contains("Note: hall.people.csv: nothing matches."));
    let text = json(&benchmark).expect("JSON");
    assert_eq!(serde_json::from_str::<Benchmark>(&text).expect("JSON").notes, notes);
    assert!(!json(&two_by_three()).expect("JSON").contains("\"notes\""));
}

#[test]
fn a_mean_of_two_logs_shows_no_interval() {
    let two = [("a", "x", 0.25), ("a", "y", 0.35), ("b", "x", 0.75), ("b", "y", 0.7)];
    let three = [&two[..], &[("a", "z", 0.3), ("b", "z", 0.72)]].concat();
    let cell = "class=\"ends\">0.";
    assert!(html(&with_hota(&three), None).contains(cell));
    assert!(!html(&with_hota(&two), None).contains(cell));
}

#[test]
fn a_pipeline_that_no_log_suits_has_no_row_and_its_reasons_are_listed() {
    let mut benchmark = two_by_three();
    let logs = ["hall", "lab", "yard"];
    benchmark.tasks.extend(logs.map(|log| TaskResult {
        pipeline: "stereo".into(),
        log: log.into(),
        outcome: Outcome::Skipped { why: "no right images".into() },
        ..TaskResult::default()
    }));
    let page = html(&benchmark, None);
    let results = &page[page.find("id=\"results\"").unwrap()..page.find("id=\"failed\"").unwrap()];
    assert!(results.contains("1 pipeline that no log suits is left out"), "{results}");
    assert!(!results.contains("stereo"));
    assert_eq!(page.matches("no right images").count(), 1, "once for all logs");
    assert!(page.contains(&logs.join(", ")));
}

#[test]
fn a_pipeline_that_finds_nobody_is_the_best_in_nothing() {
    let mut benchmark = two_by_three();
    let silent = benchmark.tasks[0].pipeline.clone();
    for task in benchmark.tasks.iter_mut().filter(|task| task.pipeline == silent) {
        for scores in [&mut task.image, &mut task.metres].into_iter().flatten() {
            scores.never_confirmed = scores.truth_ids;
            scores.fp_per_frame = Some(0.0);
        }
    }
    let summary = Summary::new(&benchmark);
    let own = summary.pipeline(&silent).unwrap();
    assert_eq!(own.people_found_count(), Some(0));
    assert!(own.figures.values().all(|estimate| !estimate.best));
}
