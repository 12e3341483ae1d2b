//! The figures that TrackEval, py-motmetrics and the KAIST evaluation print on
//! real data. Where the data are absent the tests say so and pass.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;
use tagalong_conformance::testdata::find;
use tagalong_eval::formats::{Timeline, mot};
use tagalong_eval::{
    Comparison, DetectionTally, Frame, HotaLevel, Region, Report, Role, Sequence, SetDistance,
    Similarity, Tally, Truth,
};

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn sequence(name: &str, truth: &Path, tracks: &Path, rules: mot::Rules, length: u32) -> Sequence {
    let mut timeline = Timeline::new();
    let truth = read(truth);
    assert_eq!(mot::Rules::of_truth(&truth, "truth").unwrap(), rules, "{name}");
    let truth = mot::parse_truth(&truth, "truth", rules).unwrap();
    let tracks = mot::parse_tracks(&read(tracks), "tracks").unwrap();
    for rows in [&truth, &tracks] {
        mot::check_length(rows, name, length).unwrap();
    }
    timeline.add_truths(truth.iter().map(|row| row.truth(rules)));
    timeline.add_reports(tracks.iter().map(mot::Row::report));
    timeline.into_sequence(name, 1, length, 30.0).0
}

fn mot17(mot: &Path) -> Vec<Sequence> {
    ["MOT17-02-FRCNN", "MOT17-04-FRCNN", "MOT17-05-FRCNN", "MOT17-10-FRCNN"]
        .iter()
        .map(|name| {
            let truth = mot.join("gt/MOT17-train").join(name);
            let info = mot::parse_info(&read(&truth.join("seqinfo.ini")), "seqinfo.ini").unwrap();
            let tracks = mot.join("tracker-output/MOT17-train").join(format!("{name}.txt"));
            sequence(name, &truth.join("gt/gt.txt"), &tracks, mot::Rules::Mot17, info.length)
        })
        .collect()
}

fn tud_campus(mot: &Path) -> Sequence {
    let folder = mot.join("py-motmetrics/TUD-Campus");
    let truth = folder.join("gt.txt");
    let tracks = folder.join("test.txt");
    sequence("TUD-Campus", &truth, &tracks, mot::Rules::Mot15, 71)
}

fn tally(sequence: &Sequence) -> Tally {
    Tally::measure(sequence, &Comparison::default(), &SetDistance::default()).unwrap()
}

type Figure = fn(&HotaLevel) -> f64;

/// All figures under TrackEval's names.
fn figures(tally: &Tally) -> BTreeMap<String, f64> {
    let clear = &tally.clear;
    let identity = &tally.identity;
    let plain = [
        ("MOTA", clear.mota()),
        ("MOTP", clear.motp()),
        ("CLR_Re", clear.recall()),
        ("CLR_Pr", clear.precision()),
        ("FP_per_frame", clear.fp_per_frame()),
        ("MOTP_sum", clear.similarity_sum),
        ("CLR_TP", clear.tp as f64),
        ("CLR_FN", clear.fn_ as f64),
        ("CLR_FP", clear.fp as f64),
        ("CLR_Frames", clear.frames as f64),
        ("IDSW", clear.id_switches as f64),
        ("MT", clear.mostly_tracked as f64),
        ("PT", clear.partly_tracked as f64),
        ("ML", clear.mostly_lost as f64),
        ("Frag", clear.fragmentations as f64),
        ("IDF1", identity.idf1()),
        ("IDR", identity.idr()),
        ("IDP", identity.idp()),
        ("IDTP", identity.tp as f64),
        ("IDFN", identity.fn_ as f64),
        ("IDFP", identity.fp as f64),
        ("Dets", tally.reports as f64),
        ("GT_Dets", tally.truths as f64),
        ("IDs", tally.track_ids as f64),
        ("GT_IDs", tally.truth_ids as f64),
        ("HOTA(0)", tally.hota.levels[0].hota()),
        ("LocA(0)", tally.hota.levels[0].loc_a()),
    ];
    let mut all: BTreeMap<String, f64> =
        plain.iter().map(|(name, value)| (name.to_string(), *value)).collect();
    let family: [(&str, Figure); 8] = [
        ("HOTA", HotaLevel::hota),
        ("DetA", HotaLevel::det_a),
        ("AssA", HotaLevel::ass_a),
        ("DetRe", HotaLevel::det_re),
        ("DetPr", HotaLevel::det_pr),
        ("AssRe", HotaLevel::ass_re),
        ("AssPr", HotaLevel::ass_pr),
        ("LocA", HotaLevel::loc_a),
    ];
    for (name, figure) in family {
        all.insert(name.to_owned(), tally.hota.mean(figure));
        all.insert(format!("{name}___AUC"), tally.hota.mean(figure));
        for (index, level) in tally.hota.levels.iter().enumerate() {
            all.insert(format!("{name}___{}", 5 * (index + 1)), figure(level));
        }
    }
    all
}

fn assert_close(name: &str, got: f64, expected: f64) {
    assert!((got - expected).abs() < 1e-6, "{name}: {got}, TrackEval prints {expected}");
}

/// Compares with an object of the expected figures; returns how many there were.
fn compare(sequence: &str, tally: &Tally, expected: &Value) -> usize {
    let figures = figures(tally);
    let object = expected.as_object().unwrap();
    for (name, value) in object {
        if name == "HOTA_alpha" {
            for (level, value) in tally.hota.levels.iter().zip(value.as_array().unwrap()) {
                assert_close(&format!("{sequence} {name}"), level.hota(), value.as_f64().unwrap());
            }
        } else {
            assert_close(&format!("{sequence} {name}"), figures[name], value.as_f64().unwrap());
        }
    }
    object.len()
}

#[test]
fn every_figure_equals_trackeval() {
    let Some(mot) = find("mot") else { return };
    let expected: Value =
        serde_json::from_str(&read(&mot.join("expected-trackeval.json"))).unwrap();
    let mut compared = 0;
    for sequence in mot17(&mot) {
        let expected = &expected["MOT17-train"][&sequence.name];
        compared += compare(&sequence.name, &tally(&sequence), expected);
    }
    let tud = tud_campus(&mot);
    compared += compare("TUD-Campus", &tally(&tud), &expected["py-motmetrics"]["TUD-Campus"]);
    assert_eq!(compared, 5 * 21);
}

#[test]
fn the_long_table_and_the_combined_line_equal_trackeval() {
    let Some(mot) = find("mot") else { return };
    let text = read(&mot.join("tracker-output/MOT17-train/expected-trackeval.csv"));
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let sequences = mot17(&mot);
    let tallies: BTreeMap<&str, Tally> =
        sequences.iter().map(|s| (s.name.as_str(), tally(s))).collect();
    let mut compared = 0;
    for line in lines.filter(|line| !line.is_empty()) {
        let (name, values) = line.split_once(',').unwrap();
        let Some(tally) = tallies.get(name) else { continue };
        let figures = figures(tally);
        for (column, value) in header[1..].iter().zip(values.split(',')) {
            let Some(got) = figures.get(*column) else { continue };
            assert_close(&format!("{name} {column}"), *got, value.parse().unwrap());
            compared += 1;
        }
    }
    assert_eq!(compared, 4 * 187);
}

#[test]
fn combined_figures_come_from_the_summed_counts() {
    let Some(mot) = find("mot") else { return };
    let tallies: Vec<Tally> = mot17(&mot).iter().map(tally).collect();
    let all = Tally::combine(&tallies);
    // (TP - FP - IDSW) / (TP + FN), and so on, from TrackEval's table.
    let tp = 15955 + 47060 + 6382 + 10833;
    let fn_ = 2626 + 497 + 535 + 2006;
    let fp = 723 + 147 + 409 + 626;
    let idsw = 168 + 32 + 57 + 137;
    assert_close("MOTA", all.clear.mota(), f64::from(tp - fp - idsw) / f64::from(tp + fn_));
    let idtp = 9718 + 45863 + 5674 + 7748;
    let idfn = 8863 + 1694 + 1243 + 5091;
    let idfp = 6960 + 1344 + 1117 + 3711;
    let idf1 = f64::from(2 * idtp) / f64::from(2 * idtp + idfn + idfp);
    assert_close("IDF1", all.identity.idf1(), idf1);
    for index in 0..19 {
        let mut weighted = 0.0;
        let mut tp = 0.0;
        for level in tallies.iter().map(|tally| tally.hota.levels[index]) {
            weighted += level.tp as f64 * level.ass_a();
            tp += level.tp as f64;
        }
        assert_close("AssA", all.hota.levels[index].ass_a(), weighted / tp);
    }
}

#[test]
fn the_pair_of_py_motmetrics_gives_its_published_line() {
    let Some(mot) = find("mot") else { return };
    let scores = tally(&tud_campus(&mot)).scores();
    for (value, percent) in [
        (scores.idf1, 55.8),
        (scores.idp, 73.0),
        (scores.idr, 45.1),
        (scores.recall, 58.2),
        (scores.precision, 94.1),
        (scores.mota, 52.6),
    ] {
        assert_eq!((value.unwrap() * 1000.0).round() / 10.0, percent);
    }
    assert_eq!((scores.truth_ids, scores.mt, scores.pt, scores.ml), (8, 1, 6, 1));
    assert_eq!((scores.fp, scores.fn_, scores.idsw, scores.frag), (13, 150, 7, 7));
    assert!((1.0 - scores.motp.unwrap() - 0.277).abs() < 5e-4);
}

/// The KAIST test set and a detector's output, one frame for each image.
fn kaist(folder: &Path) -> Vec<Frame> {
    let json: Value = serde_json::from_str(&read(&folder.join("KAIST_annotation.json"))).unwrap();
    let mut frames = vec![Frame::default(); json["images"].as_array().unwrap().len()];
    for truth in json["annotations"].as_array().unwrap() {
        if truth["category_id"] == 1 {
            let image = truth["image_id"].as_u64().unwrap() as usize;
            frames[image].truths.push(kaist_truth(truth));
        }
    }
    for row in read(&folder.join("MLPD_result.txt")).lines() {
        let v: Vec<f64> = row.split(',').map(|field| field.trim().parse().unwrap()).collect();
        let region = Some(Region::new(v[1], v[2], v[3], v[4]));
        let report = Report { region, score: v[5], ..Report::default() };
        frames[v[0] as usize - 1].reports.push(report);
    }
    frames
}

fn kaist_truth(truth: &Value) -> Truth {
    fn number(value: &Value) -> f64 {
        value.as_f64().unwrap()
    }

    let b = &truth["bbox"];
    let region = Region::new(number(&b[0]), number(&b[1]), number(&b[2]), number(&b[3]));
    let leaves = region.x < 5.0
        || region.y < 5.0
        || region.x + region.width > 635.0
        || region.y + region.height > 507.0;
    let hidden = number(&truth["occlusion"]) > 1.0;
    let ignored = number(&truth["height"]) < 55.0 || hidden || truth["ignore"] == 1 || leaves;
    let role = if ignored { Role::Ignored } else { Role::Counts };
    Truth { region: Some(region), role, ..Truth::default() }
}

#[test]
fn log_average_miss_rates_equal_the_published_ones() {
    fn rate(frames: &[Frame]) -> f64 {
        let sequence = Sequence { name: "KAIST".into(), frames: frames.to_vec() };
        let tally = DetectionTally::measure(&sequence, Similarity::Iou, 0.5);
        100.0 * tally.log_average_miss_rate().unwrap()
    }

    let Some(folder) = find("lamr") else { return };
    let frames = kaist(&folder);
    let all = rate(&frames);
    let day = rate(&frames[..1455]);
    let night = rate(&frames[1455..]);
    println!("log-average miss rate: all {all:.4} day {day:.4} night {night:.4}");
    assert!((all - 7.58).abs() < 0.01, "{all}");
    assert!((day - 7.96).abs() < 0.01, "{day}");
    assert!((night - 6.95).abs() < 0.01, "{night}");
}
