//! `tagalong eval` as a user calls it.

use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::common::{
    Drawn, code, json, messages_of, own_plugin, results_of, tagalong, text, write,
};

fn eval(arguments: &[&str]) -> Output {
    tagalong().arg("eval").args(arguments).output().unwrap()
}

fn shown(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A log, its truth, and a run over it.
fn home() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    Drawn::of(20).write(&folder.path().join("walk.mcap"));
    crate::common::config(folder.path(), "");
    fs::write(folder.path().join("walk.people.csv"), crate::common::people(20)).unwrap();
    let mut run = own_plugin();
    run.current_dir(folder.path()).args(["run", "nearest.toml", "walk.mcap", "-o", "out"]);
    assert!(run.output().unwrap().status.success());
    folder
}

fn in_home(folder: &Path, arguments: &[&str]) -> Output {
    tagalong().current_dir(folder).arg("eval").args(arguments).output().unwrap()
}

#[test]
fn each_printed_figure_is_defined_in_the_reference() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/figures.md");
    let page = fs::read_to_string(page).unwrap();
    let folder = home();
    let files = ["--truth", "walk.people.csv", "--tracks", "out", "--format", "json"];
    let printed = json(&in_home(folder.path(), &files));
    for name in printed.as_object().unwrap().keys() {
        // A cell may have the ends of names that begin alike.
        let end = name.strip_prefix("position_error").unwrap_or(name);
        let is_defined = [name, end].iter().any(|name| page.contains(&format!("`{name}`")));
        assert!(is_defined || ["rules", "notes"].contains(&name.as_str()), "{name}");
    }
}

#[test]
fn a_run_is_scored_in_the_image_and_on_the_floor() {
    let folder = home();
    let files = ["--truth", "walk.people.csv", "--tracks", "out", "--format", "json"];
    let image = json(&in_home(folder.path(), &files));
    assert_eq!((image["frames"].as_u64(), image["truths"].as_u64()), (Some(20), Some(20)));
    let wrong = ["FP", "IDSW", "inherited_ids"].map(|figure| image[figure].as_u64());
    assert_eq!(wrong, [Some(0); 3]);
    assert!(image["MOTA"].as_f64().unwrap() > 0.7, "{image}");
    let floor = json(&in_home(folder.path(), &[&files[..], &["--similarity", "metres"]].concat()));
    assert!(floor["HOTA"].as_f64().unwrap() > 0.6, "{floor}");
    assert!(floor["position_error_mean_m"].as_f64().unwrap() < 0.15, "{floor}");
    assert!(image["position_error_mean_m"].is_number(), "{image}");
    assert!(floor.as_object().unwrap().values().all(|value| !value.is_object()), "one flat object");
}

#[test]
fn paths_in_each_others_place_are_refused_with_the_cure() {
    let folder = home();
    fs::create_dir(folder.path().join("runs")).unwrap();
    fs::rename(folder.path().join("out"), folder.path().join("runs/walk")).unwrap();
    for (truth, tracks, cure) in [
        ("walk.people.csv", "runs", "name one of them, as `--tracks runs/walk`"),
        ("runs/walk", "walk.people.csv", "--truth and --tracks are swapped"),
        ("runs/walk/tracks.csv", "walk.people.csv", "--truth and --tracks are swapped"),
        ("walk.mcap", "runs/walk", "`--truth walk.people.csv`"),
    ] {
        let told = in_home(folder.path(), &["--truth", truth, "--tracks", tracks]);
        let why = text(&told.stderr);
        assert!(code(&told) == 2 && why.contains(cure), "{truth} {tracks}: {why}");
    }
}

#[test]
fn tracks_without_what_is_compared_are_refused_with_the_remedy() {
    let folder = home();
    let truth = ["--truth", "walk.people.csv", "--tracks"];
    let places = in_home(folder.path(), &[&truth[..], &["out/tracks-metres.csv"]].concat());
    let told = text(&places.stderr);
    assert!(code(&places) == 2 && told.contains("positions and no boxes"), "{told}");
    let boxes = ["out/tracks.csv", "--similarity", "metres", "--log", "walk.mcap"];
    let boxes = in_home(folder.path(), &[&truth[..], &boxes].concat());
    let told = text(&boxes.stderr);
    assert!(code(&boxes) == 2 && told.contains("boxes and no positions"), "{told}");
}

/// In the truth there is a second person, whom the run never reports.
#[test]
fn repairs_show_what_each_kind_of_error_costs() {
    let folder = home();
    let mut truth = String::new();
    for (number, line) in crate::common::people(20).lines().enumerate() {
        truth += &format!("{line}\n");
        let mut fields: Vec<&str> = line.split(',').collect();
        // Person 2, with the left edges of the boxes and the head elsewhere.
        for (column, value) in [(1, "2"), (2, "10"), (6, "10"), (10, "-1.3")] {
            fields[column] = value;
        }
        if number > 0 {
            truth += &format!("{}\n", fields.join(","));
        }
    }
    fs::write(folder.path().join("walk.people.csv"), truth).unwrap();
    let files = ["--truth", "walk.people.csv", "--tracks", "out", "--repairs"];
    let scores = json(&in_home(folder.path(), &[&files[..], &["--format", "json"]].concat()));
    let repairs = scores["repairs"].as_array().unwrap();
    let [misses, identities, reports] = ["misses", "identities", "false-reports"].map(|name| {
        let row = repairs.iter().find(|row| row["repair"] == name);
        row.and_then(|row| row["HOTA"].as_f64()).unwrap_or_else(|| panic!("{name}: {scores}"))
    });
    let as_is = scores["HOTA"].as_f64().unwrap();
    assert!(as_is < 0.9 && misses > as_is + 0.1, "{scores}");
    assert_eq!([identities, reports], [as_is; 2], "{scores}");
    let printed = in_home(folder.path(), &files);
    let printed = text(&printed.stdout);
    let line = printed.lines().find(|line| line.starts_with("no misses")).unwrap();
    assert!(line.contains(&format!("{misses:.4}")), "{printed}");
    assert!(!text(&in_home(folder.path(), &files[..4]).stdout).contains("no misses"));
}

#[test]
fn truth_that_is_named_after_another_log_is_noted() {
    let folder = home();
    for name in ["other.people.csv", "truth.csv"] {
        fs::copy(folder.path().join("walk.people.csv"), folder.path().join(name)).unwrap();
    }
    for (truth, tracks, is_noted) in [
        ("walk.people.csv", "out", false),
        ("other.people.csv", "out", true),
        ("other.people.csv", "out/tracks.csv", true),
        ("truth.csv", "out", false),
    ] {
        let said = results_of(&in_home(folder.path(), &["--truth", truth, "--tracks", tracks]));
        assert_eq!(
            said.contains("named after other, and the run is of walk.mcap"),
            is_noted,
            "{said}"
        );
    }
}

#[test]
fn a_truth_that_nothing_matches_is_asked_about() {
    let folder = home();
    let elsewhere = "1,1,0,0,20,20,1,-1,-1,-1\n20,1,0,0,20,20,1,-1,-1,-1\n";
    write(folder.path(), "walk.txt", elsewhere);
    for (truth, is_asked) in [("walk.txt", true), ("walk.people.csv", false)] {
        let output = in_home(folder.path(), &["--truth", truth, "--tracks", "out"]);
        let said = text(&output.stdout);
        let question = "nothing matches: is it the truth of another log?";
        assert_eq!(said.contains(question), is_asked, "{said}");
    }
}

#[test]
fn tracks_of_a_run_that_was_stopped_are_noted() {
    let folder = home();
    let report = folder.path().join("out/report.json");
    let whole = fs::read_to_string(&report).unwrap();
    let stopped = whole.replace("\"ended\": \"complete\"", "\"ended\": \"stopped by signal 2\"");
    for (written, is_noted) in [(&whole, false), (&stopped, true)] {
        fs::write(&report, written).unwrap();
        let said =
            results_of(&in_home(folder.path(), &["--truth", "walk.people.csv", "--tracks", "out"]));
        assert_eq!(
            said.contains("the run is incomplete (stopped by signal 2)"),
            is_noted,
            "{said}"
        );
    }
}

#[test]
fn people_annotated_in_laser_scans_are_truth_on_the_floor() {
    let folder = home();
    let header = "scan,id,x_laser_m,y_laser_m,x_robot_m,y_robot_m,ignore,source\n";
    // Scans count from 0. Without a place in the robot frame that in the frame of the laser is taken;
    // the last row is neither a miss nor a false alarm.
    let rows = format!(
        "{header}15,7,90,90,2.88,-0.18,0,annotated\n19,7,2.88,-0.1,,,0,annotated\n\
         18,7,90,90,,,1,gap\n"
    );
    fs::write(folder.path().join("walk.people-floor.csv"), rows).unwrap();
    let files = ["--truth", "walk.people-floor.csv", "--tracks", "out", "--format", "json"];
    let said = messages_of(&in_home(folder.path(), &files), 2);
    assert!(said.contains("--similarity metres"), "{said}");
    let floor = json(&in_home(folder.path(), &[&files[..], &["--similarity", "metres"]].concat()));
    assert_eq!((floor["truths"].as_u64(), floor["FN"].as_u64()), (Some(2), Some(0)), "{floor}");
}

#[test]
fn a_log_that_is_not_beside_the_truth_can_be_named() {
    let folder = home();
    fs::create_dir(folder.path().join("elsewhere")).unwrap();
    fs::rename(folder.path().join("walk.mcap"), folder.path().join("elsewhere/w.mcap")).unwrap();
    let files = ["--truth", "walk.people.csv", "--tracks", "out", "--similarity", "metres"];
    let said = messages_of(&in_home(folder.path(), &files), 2);
    assert!(said.contains("--log"), "{said}");
    let said =
        results_of(&in_home(folder.path(), &[&files[..], &["--log", "elsewhere/w.mcap"]].concat()));
    assert!(said.contains("HOTA"), "{said}");
}

/// The stamps of people.csv need it, wherever the truth is.
#[test]
fn the_log_that_a_run_names_is_found_where_it_was() {
    let folder = home();
    fs::create_dir(folder.path().join("truth")).expect("a folder");
    let truth = folder.path().join("truth/mine.csv");
    fs::rename(folder.path().join("walk.people.csv"), truth).expect("a move");
    let files = ["--truth", "truth/mine.csv", "--tracks", "out", "--similarity", "metres"];
    let said = results_of(&in_home(folder.path(), &files));
    assert!(said.contains("HOTA"), "{said}");

    // A log of several files is the folder of them.
    let recording = folder.path().join("recording");
    fs::create_dir(&recording).expect("a folder");
    fs::rename(folder.path().join("walk.mcap"), recording.join("recording_0.mcap"))
        .expect("a move");
    let mut run = own_plugin();
    run.current_dir(folder.path()).args(["run", "nearest.toml", "recording", "-o", "whole"]);
    assert!(run.output().expect("a run").status.success());
    let files = ["--truth", "truth/mine.csv", "--tracks", "whole", "--similarity", "metres"];
    let of_folder = results_of(&in_home(folder.path(), &files));
    assert_eq!(figures(&of_folder), figures(&said));
}

/// Returns the lines of a result that are no notes.
fn figures(said: &str) -> Vec<&str> {
    said.lines().filter(|line| !line.starts_with("note:")).collect()
}

#[test]
fn mistakes_are_named_by_file_and_line() {
    let folder = home();
    fs::write(folder.path().join("bad.txt"), "1,1,0,0,5,5,1\n2,1,0,zero,5,5,1\n").unwrap();
    let said = messages_of(
        &in_home(folder.path(), &["--truth", "walk.people.csv", "--tracks", "bad.txt"]),
        1,
    );
    assert!(said.contains("bad.txt, line 2"), "{said}");
    let said = messages_of(&in_home(folder.path(), &["--truth", "none.csv", "--tracks", "out"]), 1);
    assert!(said.contains("none.csv"), "{said}");
    let said =
        messages_of(&in_home(folder.path(), &["--truth", "walk.mcap", "--tracks", "out"]), 2);
    assert!(said.contains("`--truth walk.people.csv`"), "{said}");
    fs::copy(folder.path().join("walk.mcap"), folder.path().join("alone.mcap")).unwrap();
    let said =
        messages_of(&in_home(folder.path(), &["--truth", "alone.mcap", "--tracks", "out"]), 1);
    assert!(said.contains("/truth/people"), "{said}");
    assert_eq!(code(&eval(&["--truth", "a", "--tracks", "b", "--similarity", "feet"])), 2);
}

#[test]
fn truth_is_read_from_the_log_itself() {
    let folder = home();
    let truth = tagalong_log::TruthFrame {
        stamp_ns: crate::common::FIRST_NS + 300_000_000,
        people: vec![
            tagalong_log::TruthPerson {
                id: 1,
                head_in_robot_m: Some([2.88, -0.43, 1.5]),
                upper_body_px: Some([87.0, 39.0, 26.0, 26.0]),
                visible: 1.0,
                ..Default::default()
            },
            // Beside the image: compared on the floor, and not by boxes.
            tagalong_log::TruthPerson {
                id: 2,
                head_in_robot_m: Some([1.0, 3.0, 1.5]),
                ..Default::default()
            },
        ],
    };
    Drawn { truth: vec![truth], ..Drawn::of(20) }.write(&folder.path().join("walk.mcap"));
    let files = ["--truth", "walk.mcap", "--tracks", "out", "--format", "json"];
    let image = json(&in_home(folder.path(), &files));
    assert_eq!((image["truths"].as_u64(), image["TP"].as_u64()), (Some(1), Some(1)), "{image}");
    let floor = json(&in_home(folder.path(), &[&files[..], &["--similarity", "metres"]].concat()));
    assert_eq!((floor["truths"].as_u64(), floor["TP"].as_u64()), (Some(2), Some(1)), "{floor}");
}

#[test]
fn whole_bodies_can_be_compared_by_their_upper_bodies() {
    let folder = tempfile::tempdir().unwrap();
    // 1.7 m over 170 pixels: the square has 57 of them, and 2.5 of air.
    write(folder.path(), "whole.txt", "1,1,100,50,60,170,1,1,1\n");
    write(folder.path(), "upper.txt", "1,1,101.5,47.5,57,57,1,-1,-1,-1\n");
    let files = ["--truth", "whole.txt", "--tracks", "upper.txt", "--format", "json"];
    let told = json(&in_home(folder.path(), &files));
    assert_eq!(told["TP"].as_u64(), Some(1));
    assert!(told["notes"][0].to_string().contains("as with --upper-body"), "{told}");
    let upper = json(&in_home(folder.path(), &[&files[..], &["--upper-body"]].concat()));
    assert!((upper["MOTP"].as_f64().unwrap() - 1.0).abs() < 1e-9, "{upper}");
}

#[test]
fn kitti_labels_count_frames_from_zero() {
    let folder = tempfile::tempdir().unwrap();
    let label = "4 Pedestrian 0 0 0 100 100 150 220 1.7 0.5 0.5 1 1.6 8 0";
    let rows = "1,9,100,100,50,120,1,-1,-1,-1\n2,9,100,100,50,120,1,-1,-1,-1\n";
    write(folder.path(), "truth.txt", &format!("0 {label}\n1 {label}"));
    write(folder.path(), "tracks.txt", rows);
    let files = ["--truth", "truth.txt", "--tracks", "tracks.txt", "--format", "json"];
    let scores = json(&in_home(folder.path(), &files));
    assert_eq!(scores["HOTA"].as_f64(), Some(1.0), "{scores}");
}

/// Truth of two frames, the second row with this class.
fn truth_with(class: &str) -> String {
    format!("1,1,0,0,40,90,1,1,1\n2,1,0,0,40,90,1,{class},1\n")
}

/// Scores two texts, as files of a sequence of two frames.
fn scored(truth: &str, tracks: &str, more: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "gt.txt", truth);
    write(folder.path(), "tracks.txt", tracks);
    write(folder.path(), "seqinfo.ini", "name=two\nframeRate=10\nseqLength=2\n");
    let files = ["--truth", "gt.txt", "--tracks", "tracks.txt"];
    in_home(folder.path(), &[&files[..], more].concat())
}

const TRACKS: &str = "1,1,0,0,40,90,1,-1,-1,-1\n2,1,0,0,40,90,1,-1,-1,-1\n";

#[test]
fn what_trackeval_refuses_is_refused_with_its_line() {
    let right = "2,1,0,0,40,90,1,-1,-1,-1";
    let cases = [
        (truth_with("0"), right, "gt.txt, line 2: class 0"),
        (truth_with("-1"), right, "gt.txt, line 2: class -1"),
        (truth_with("14"), right, "gt.txt, line 2: class 14"),
        (truth_with("1").replace("2,1", "3,1"), right, "gt.txt, line 2: frame 3"),
        (truth_with("1"), "2,1,0,0,40,90,1,3,-1,-1", "tracks.txt, line 2: class 3"),
        (truth_with("1"), "2,-1,0,0,40,90,1,-1,-1,-1", "tracks.txt, line 2: id -1"),
        (truth_with("1"), "3,1,0,0,40,90,1,-1,-1,-1", "tracks.txt, line 2: frame 3"),
    ];
    for (truth, second, expected) in cases {
        let output = scored(&truth, &format!("1,1,0,0,40,90,1,-1,-1,-1\n{second}\n"), &[]);
        let said = text(&output.stderr);
        assert!(code(&output) == 1 && said.contains(expected), "{expected}: {said}");
    }
    let said = scored(&truth_with("14"), TRACKS, &["--rules", "mot15", "--format", "json"]);
    let said = json(&said);
    assert_eq!((said["rules"].as_str(), said["TP"].as_u64()), (Some("MOT15"), Some(2)), "{said}");
}

#[test]
fn rules_odd_boxes_and_constant_scores_are_said() {
    let tracks = TRACKS.to_owned() + "2,2,0,0,-40,90,1,-1,-1,-1\n";
    let said = json(&scored(&truth_with("1"), &tracks, &["--format", "json"]));
    assert_eq!((said["TP"].as_u64(), said["FP"].as_u64()), (Some(2), Some(1)), "{said}");
    assert_eq!(said["rules"].as_str(), Some("MOT17"));
    let notes = said["notes"].as_array().unwrap();
    for words in ["1 of 3 boxes have no area (the first in line 3)", "LAMR and AP mean nothing"] {
        let is_told = notes.iter().any(|note| note.as_str().unwrap().contains(words));
        assert!(is_told, "{words} in {notes:?}");
    }
    assert_eq!(notes.len(), 2, "{notes:?}");
    let printed = scored(&truth_with("1"), &tracks, &[]);
    let printed = text(&printed.stdout);
    assert!(printed.starts_with("note: tracks.txt: 1 of 3 boxes have no area"), "{printed}");
    assert!(printed.contains("LAMR and AP mean nothing") && printed.contains("MOT17"), "{printed}");
    // Scores with an order: no note is needed.
    let ordered = TRACKS.replacen("90,1,", "90,0.5,", 1);
    let said = json(&scored(&truth_with("1"), &ordered, &["--format", "json"]));
    assert!(said["notes"].as_array().unwrap().is_empty(), "{said}");
}

#[test]
fn a_car_of_a_kitti_tracker_that_ends_before_it_begins_refuses_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let [truth, person, car, nobody] =
        [(1, "Pedestrian", 150), (7, "Pedestrian", 150), (8, "Car", 90), (-1, "Pedestrian", 150)]
            .map(|(id, class, right)| {
                format!("0 {id} {class} 0 0 0 100 100 {right} 220 1.7 0.5 0.5 1 1.6 8 0 0.9\n")
            });
    write(folder.path(), "gt.txt", &truth);
    write(folder.path(), "tracks.txt", &(person + &car + &nobody));
    let files = ["--truth", "gt.txt", "--tracks", "tracks.txt", "--format", "json"];
    let said = json(&in_home(folder.path(), &files));
    assert_eq!((said["TP"].as_u64(), said["FP"].as_u64()), (Some(1), Some(0)), "{said}");
    assert_eq!(said["rules"].as_str(), Some("KITTI"));
    let notes = said["notes"].to_string();
    assert!(notes.contains("1 of 3 boxes have no area (the first in line 2)"), "{notes}");
    assert!(notes.contains("1 of 3 lines have an id below 0 (the first is line 3)"), "{notes}");
}

#[test]
fn tracks_that_go_on_without_a_known_end_are_said() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("gt.txt"), truth_with("1")).unwrap();
    fs::write(folder.path().join("tracks.txt"), TRACKS.replace("2,1", "9,1")).unwrap();
    let files = ["--truth", "gt.txt", "--tracks", "tracks.txt", "--format", "json"];
    let said = json(&in_home(folder.path(), &files));
    assert_eq!(said["frames"].as_u64(), Some(9));
    let notes = said["notes"].to_string();
    assert!(notes.contains("continues to frame 9, but the last known frame is 2"), "{notes}");
    assert!(notes.contains("30 frames a second are assumed"), "{notes}");
    let stated = json(&in_home(folder.path(), &[&files[..], &["--rate", "30"]].concat()));
    assert!(!stated["notes"].to_string().contains("assumed"), "{stated}");
}

#[test]
fn mot17_figures_equal_those_of_trackeval() {
    let Some(mot) = tagalong_conformance::testdata::find("mot") else { return };
    let expected: Value =
        serde_json::from_slice(&fs::read(mot.join("expected-trackeval.json")).unwrap()).unwrap();
    for (name, figures) in expected["MOT17-train"].as_object().unwrap() {
        let truth = mot.join("gt/MOT17-train").join(name).join("gt/gt.txt");
        let tracks = mot.join("tracker-output/MOT17-train").join(format!("{name}.txt"));
        if !truth.exists() {
            continue;
        }
        let scores = json(&eval(&[
            "--truth",
            shown(&truth),
            "--tracks",
            shown(&tracks),
            "--format",
            "json",
        ]));
        for (ours, theirs) in [
            ("HOTA", "HOTA"),
            ("DetA", "DetA"),
            ("AssA", "AssA"),
            ("LocA", "LocA"),
            ("MOTA", "MOTA"),
            ("MOTP", "MOTP"),
            ("IDF1", "IDF1"),
            ("IDP", "IDP"),
            ("IDR", "IDR"),
            ("IDSW", "IDSW"),
            ("FP", "CLR_FP"),
            ("FN", "CLR_FN"),
            ("Frag", "Frag"),
        ] {
            let got = scores[ours].as_f64().unwrap();
            let want = figures[theirs].as_f64().unwrap();
            assert!((got - want).abs() < 1e-6, "{name} {ours}: {got}, TrackEval {want}");
        }
    }
}

#[test]
fn truth_that_ends_far_before_the_sequence_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "seqinfo.ini", "name=long\nframeRate=10\nseqLength=600\n");
    fn row(frame: usize) -> String {
        format!("{frame},1,0,0,40,90,1,-1,-1,-1\n")
    }
    let tracks: String = (1..=600).map(row).collect();
    write(folder.path(), "tracks.txt", &tracks);
    for (last, is_noted) in [(20, true), (590, false)] {
        let truth: String = (1..=last).map(row).collect();
        write(folder.path(), "gt.txt", &truth);
        let files = ["--truth", "gt.txt", "--tracks", "tracks.txt"];
        let said = results_of(&in_home(folder.path(), &files));
        let note = "its last frame with people is 20, and seqLength is 600";
        assert_eq!(said.contains(note), is_noted, "{said}");
    }
}

#[test]
fn doubled_ids_of_the_truth_are_dropped_if_asked_for() {
    let truth = "1,1,0,0,40,90,1,-1,-1,-1\n1,1,200,0,40,90,1,-1,-1,-1\n";
    let track = "1,1,0,0,40,90,1,-1,-1,-1\n";
    let said = messages_of(&scored(truth, track, &[]), 1);
    assert!(said.contains("gt.txt: ") && said.contains("truth id 1 occurs twice"), "{said}");
    assert!(said.contains("`--drop-doubled-ids` keeps the first"), "{said}");
    let said = json(&scored(truth, track, &["--drop-doubled-ids", "--format", "json"]));
    assert_eq!((said["truths"].as_u64(), said["TP"].as_u64()), (Some(1), Some(1)), "{said}");
    assert!(said["notes"].to_string().contains("1 people are left out"), "{said}");
    // Of tracks nothing is dropped: a tracker that reports an ID twice is wrong.
    let said = messages_of(&scored(track, truth, &["--drop-doubled-ids"]), 1);
    assert!(said.contains("tracks.txt: ") && !said.contains("`--drop"), "{said}");
}

#[test]
fn frames_from_0_and_a_log_beside_the_truth_are_found() {
    let folder = home();
    let mut truth = String::from("frame,id,ub_x,ub_y,ub_w,ub_h\n");
    let mut tracks = String::new();
    for frame in 1..=20 {
        truth += &format!("{frame},1,{},20,26,26\n", 6 * frame);
        // The frame that is called 0 is empty.
        if frame > 1 {
            tracks += &format!("{},7,{},20,26,26,1\n", frame - 1, 6 * frame);
        }
    }
    fs::write(folder.path().join("walk.people.csv"), truth).expect("a file");
    fs::write(folder.path().join("tracks.txt"), &tracks).expect("a file");
    let files = ["--truth", "walk.people.csv", "--tracks", "tracks.txt"];
    let said = text(&in_home(folder.path(), &files).stdout);
    assert!(!said.contains("frames a second are assumed"), "walk.mcap is beside its truth: {said}");
    assert!(said.contains("with all frame numbers one higher"), "{said}");
    fs::write(folder.path().join("tracks.txt"), format!("frame,id,x,y,w,h\n{tracks}"))
        .expect("a file");
    let refused = in_home(folder.path(), &files);
    let said = text(&refused.stderr);
    assert!(said.contains("tracks.txt, line 1: is a header: remove it"), "{said}");
}
