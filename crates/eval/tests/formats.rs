//! Text in, rows out, and back again; files of other people's tools.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;

use proptest::prelude::*;
use tagalong_eval::formats::{
    FormatError, MOST_FRAMES, OddLines, Timeline, floor, keep_first_of_id, kitti, metres, mot,
    people, trackeval,
};
use tagalong_eval::{
    Comparison, Frame, Region, Report, Role, Sequence, SetDistance, Similarity, Tally, Truth,
};

fn text(write: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> String {
    let mut bytes = Vec::new();
    write(&mut bytes).unwrap();
    String::from_utf8(bytes).unwrap()
}

fn why<T: std::fmt::Debug>(result: Result<T, FormatError>) -> String {
    result.unwrap_err().to_string()
}

fn measured(sequence: &Sequence, comparison: &Comparison) -> Tally {
    Tally::measure(sequence, comparison, &SetDistance::default()).unwrap()
}

fn parse_people(text: &str) -> Result<Vec<people::Row>, FormatError> {
    people::parse(text, "p.csv")
}

#[test]
fn mot_lines_with_commas_or_blanks_long_or_short() {
    let rows = mot::parse("1,-1,2.5,3,4,5,0.9,-1,-1,-1\r\n\n2.0 7 1 2 3 4\n", "det.txt").unwrap();
    assert_eq!(rows.len(), 2);
    assert_eq!((rows[0].frame, rows[0].id, rows[0].confidence), (1, -1, 0.9));
    assert_eq!(rows[0].region, Region::new(2.5, 3.0, 4.0, 5.0));
    assert_eq!((rows[1].frame, rows[1].id, rows[1].confidence, rows[1].class), (2, 7, 1.0, None));
}

#[test]
fn a_bad_line_is_named_with_what_was_expected() {
    for (text, expected) in [
        (
            "1,1,1,1,1,1,1\n1,1,1\n",
            "gt.txt, line 2: has 3 fields, but `y` should be field 4; is the file cut off?",
        ),
        ("1,1,1,x,1,1", "gt.txt, line 1: `y` is `x`, expected a finite number"),
        ("1,1,1,inf,1,1", "finite"),
        ("0,1,1,1,1,1", "numbered from 1"),
        (
            "\"frame\",\"id\",\"x\",\"y\",\"w\",\"h\"\n1,1,1,1,9,9\n",
            "gt.txt, line 1: is a header: remove it",
        ),
        ("1,1.5,1,1,1,1", "`id` is `1.5`, expected a whole number"),
    ] {
        let error = why(mot::parse(text, "gt.txt"));
        assert!(error.contains(expected), "{error}");
    }
}

/// Returns the answers of all readers to a row of this frame, or scan.
fn readers_of(frame: &str) -> [Result<usize, FormatError>; 5] {
    let floor_header = "scan,id,x_laser_m,y_laser_m,ignore,source";
    let metres_header =
        "stamp_ns,frame,id,x_robot_m,y_robot_m,z_robot_m,x_odom_m,y_odom_m,z_odom_m,seen";
    let kitti_row = format!("{frame} 1 Pedestrian 0 0 0 0 0 9 9 1 1 1 1 1 1 0");
    [
        mot::parse(&format!("{frame},1,0,0,9,9\n"), "rows").map(|rows| rows.len()),
        kitti::parse(&kitti_row, "rows").map(|rows| rows.len()),
        people::parse(&format!("frame,id,ub_x,ub_y,ub_w,ub_h\n{frame},1,0,0,9,9\n"), "rows")
            .map(|rows| rows.len()),
        floor::parse(&format!("{floor_header}\n{frame},1,1,1,0,annotated\n"), "rows")
            .map(|rows| rows.len()),
        metres::parse(&format!("{metres_header}\n5,{frame},1,1,1,1,1,1,1,1\n"), "rows")
            .map(|rows| rows.len()),
    ]
}

#[test]
fn a_frame_number_that_is_a_stamp_is_refused_by_every_reader() {
    for frame in ["1700000000", "4294967295", "1000001"] {
        for refused in readers_of(frame) {
            let refused = why(refused);
            assert!(refused.starts_with("rows, line "), "{refused}");
            assert!(refused.contains(&format!("frame {frame};")), "{refused}");
            assert!(refused.contains("plausible up to 1000000"), "{refused}");
        }
    }
    assert!(readers_of("1000000").iter().all(|read| *read == Ok(1)));
}

#[test]
fn a_long_file_may_have_more_frames_than_a_short_one() {
    let rows = "1,1,0,0,9,9\n".repeat(200_000);
    assert!(mot::parse(&format!("{rows}1900000,1,0,0,9,9"), "gt.txt").is_ok());
    let refused = why(mot::parse(&format!("{rows}2100000,1,0,0,9,9"), "gt.txt"));
    assert!(
        refused.contains("line 200001: frame 2100000") && refused.contains("2000010"),
        "{refused}"
    );
}

/// Two lines of truth, the second with this class.
fn classed(class: &str) -> String {
    format!("1,1,0,0,9,9,1,1,1\n2,1,0,0,9,9,1{class}\n")
}

#[test]
fn a_truth_without_its_class_is_refused_and_changes_no_rules() {
    for (class, said) in [(",0,1", "class 0"), (",-1,1", "class -1"), (",14,1", "class 14")] {
        let text = classed(class);
        for refused in [
            why(mot::Rules::of_truth(&text, "gt.txt")),
            why(mot::parse_truth(&text, "gt.txt", mot::Rules::Mot17)),
        ] {
            assert!(refused.starts_with(&format!("gt.txt, line 2: {said};")), "{refused}");
        }
        assert_eq!(mot::parse_truth(&text, "gt.txt", mot::Rules::Mot15).unwrap().len(), 2);
    }
    let short = why(mot::parse_truth(&classed(""), "gt.txt", mot::Rules::Mot20));
    assert_eq!(short, "gt.txt, line 2: has no class (field 8)");
}

#[test]
fn truth_says_whose_rules_it_follows() {
    for (text, rules) in [
        (&classed(",13,1")[..], mot::Rules::Mot17),
        ("1,1,0,0,9,9,1,-1,-1,-1\n2,1,0,0,9,9,0,-1,-1,-1\n", mot::Rules::Mot15),
        ("1,1,0,0,9,9\n", mot::Rules::Mot15),
        ("", mot::Rules::Mot15),
        // Places in metres, one of which looks like a class.
        ("1,1,0,0,9,9,1,4.25,5.5,0\n2,1,0,0,9,9,1,4,5.5,0\n", mot::Rules::Mot15),
    ] {
        assert_eq!(mot::Rules::of_truth(text, "gt.txt").unwrap(), rules, "{text}");
    }
    let mixed = why(mot::Rules::of_truth("1,1,0,0,9,9,1,1,1\n2,1,0,0,9,9,1,2.5,1\n", "gt.txt"));
    assert!(mixed.starts_with("gt.txt, line 2: class 2.5;"), "{mixed}");
    assert_eq!(mot::Rules::Mot20.name(), "MOT20");
}

#[test]
fn tracks_of_no_person_or_of_a_car_are_refused() {
    for class in ["-1", "0", "1"] {
        let tracks = mot::parse_tracks(&two_tracks(7, class), "tracks.txt");
        assert_eq!(tracks.unwrap().len(), 2, "{class}");
    }
    let car = why(mot::parse_tracks(&two_tracks(7, "3"), "tracks.txt"));
    assert!(car.starts_with("tracks.txt, line 2: class 3; only people"), "{car}");
    let nobody = why(mot::parse_tracks(&two_tracks(-1, "-1"), "tracks.txt"));
    assert!(nobody.starts_with("tracks.txt, line 2: id -1;"), "{nobody}");
    let truth = why(mot::parse_truth("1,-1,0,0,9,9,1,1,1", "gt.txt", mot::Rules::Mot17));
    assert!(truth.starts_with("gt.txt, line 1: id -1;"), "{truth}");
}

/// A table of two tracks, of which the second has this number and class.
fn two_tracks(id: i64, class: &str) -> String {
    format!("1,0,0,0,9,9,1,1\n2,{id},0,0,9,9,0.5,{class},-1,-1\n")
}

#[test]
fn frames_beyond_the_length_are_refused_with_their_line() {
    let rows = mot::parse("3,1,0,0,9,9\n4,1,0,0,9,9\n", "tracks.txt").unwrap();
    assert!(mot::check_length(&rows, "tracks.txt", 4).is_ok());
    let beyond = why(mot::check_length(&rows, "tracks.txt", 3));
    assert_eq!(beyond, "tracks.txt, line 2: frame 4; the sequence has 3 (seqLength)");
    let mut files = exported(&Sequence { name: "hall".into(), frames: vec![Frame::default()] });
    for path in [
        "gt/mot_challenge/Tagalong-train/hall/gt/gt.txt",
        "trackers/mot_challenge/Tagalong-train/ours/data/hall.txt",
    ] {
        let kept = files.insert(path.into(), "1,1,0,0,9,9,1,1,1\n2,1,0,0,9,9,1,1,1\n".into());
        let read = trackeval::read(&files, "Tagalong", "ours", mot::Rules::Mot17);
        assert!(why(read).starts_with(&format!("{path}, line 2: frame 2;")));
        files.insert(path.into(), kept.unwrap());
    }
}

#[test]
fn boxes_without_an_area_match_nobody() {
    let rows =
        mot::parse("1,1,10,10,20,20\n1,2,30,10,-20,20\n1,3,30,30,-20,-20\n1,4,9,9,0,9\n", "t");
    let rows = rows.unwrap();
    let odd = OddLines::among(rows.iter().map(|row| (row.line, !row.region.has_area())));
    assert_eq!(odd, Some(OddLines { count: 3, first: 2, of: 4 }));
    assert_eq!(OddLines::among([(1, false)]), None);
    let mut timeline = Timeline::new();
    timeline.add_truths([rows[0].truth(mot::Rules::Mot15)]);
    timeline.add_reports(rows.iter().map(mot::Row::report));
    let (sequence, _) = timeline.into_sequence("flat", 1, 1, 1.0);
    // KITTI's rules leave out whatever is unmatched and not high.
    for (comparison, fp) in [(Comparison::default(), 3), (kitti::comparison(Similarity::Iou), 0)] {
        let clear = measured(&sequence, &comparison).clear;
        assert_eq!((clear.tp, clear.fp, clear.fn_), (1, fp, 0));
    }
}

#[test]
fn classes_and_flags_mean_what_each_benchmark_says() {
    use mot::Rules::{Mot15, Mot17, Mot20};
    for (class, flag, rules, role) in [
        (1, 1, Mot17, Role::Counts),
        (1, 0, Mot17, Role::Bystander),
        (7, 0, Mot17, Role::Ignored),
        (3, 0, Mot17, Role::Bystander),
        (6, 0, Mot17, Role::Bystander),
        (6, 0, Mot20, Role::Ignored),
        (-1, 1, Mot15, Role::Counts),
        (-1, 0, Mot15, Role::Bystander),
    ] {
        let line = format!("1,1,0,0,9,9,{flag},{class},1");
        let rows = mot::parse_truth(&line, "gt.txt", rules).unwrap();
        assert_eq!(rows[0].role(rules), role, "{line}");
    }
}

#[test]
fn sequence_info_survives_a_round_trip() {
    let info = mot::SequenceInfo {
        name: "hall".into(),
        rate_hz: 7.5,
        length: 12,
        width: 640,
        height: 480,
    };
    let written = text(|out| mot::write_info(out, &info));
    assert_eq!(mot::parse_info(&written, "seqinfo.ini").unwrap(), info);
    assert!(why(mot::parse_info("name=x", "seqinfo.ini")).contains("has no `frameRate=`"));
    let wrong = why(mot::parse_info("name=x\nframeRate=0\nseqLength=1", "seqinfo.ini"));
    assert!(wrong.contains("frames per second"), "{wrong}");
    let endless = why(mot::parse_info("name=x\nframeRate=9\nseqLength=4e9", "seqinfo.ini"));
    assert!(endless.contains("more than 1000000 frames"), "{endless}");
}

#[test]
fn kitti_labels_survive_a_round_trip_and_mean_what_they_say() {
    let source = "\
0 1 Pedestrian 0 0 -1.5 10 20 30 80 1.7 0.5 0.8 1.5 1.6 9.25 0.1
0 2 Pedestrian 1 0 -1.5 50 20 70 80 1.7 0.5 0.8 2.5 1.6 9 0.1
0 3 Person_sitting 0 1 0 90 20 99 80 1.2 0.5 0.8 -1000 -1000 -1000 0
0 4 Car 0 0 0 110 20 199 80 1.2 0.5 0.8 1 1 1 0
1 -1 DontCare -1 -1 -10 200 100 260 180 -1 -1 -1 -1000 -1000 -1000 -10
";
    let labels = kitti::parse(source, "0000.txt").unwrap();
    assert_eq!(text(|out| labels.iter().try_for_each(|label| kitti::write(out, label))), source);
    let mut timeline = Timeline::new();
    kitti::add_truths(&mut timeline, &labels);
    kitti::add_reports(&mut timeline, &labels);
    let (sequence, beyond) = timeline.into_sequence("0000", 0, 2, 10.0);
    assert_eq!(beyond, 0);
    let frame = &sequence.frames[0];
    let roles: Vec<Role> = frame.truths.iter().map(|t| t.role).collect();
    assert_eq!(roles, [Role::Counts, Role::Ignored, Role::Ignored]);
    assert_eq!((frame.truths[0].floor_m, frame.truths[2].floor_m), (Some([1.5, 9.25]), None));
    assert_eq!((frame.reports.len(), frame.reports[0].score), (2, 1.0));
    assert_eq!(sequence.frames[1].ignore_regions, [Region::new(200.0, 100.0, 60.0, 80.0)]);
    assert_eq!(sequence.frames[1].stamp_ns, 100_000_000);
    // Only the walker counts; the person that is cut off is excused with their report.
    let clear = measured(&sequence, &kitti::comparison(Similarity::Iou)).clear;
    assert_eq!((clear.tp, clear.fp, clear.fn_), (1, 0, 0));
    assert_eq!(measured(&sequence, &kitti::comparison(Similarity::Metres)).clear.tp, 1);
    // A box that ends before it begins is read, and a miss.
    let inside_out = kitti::parse(&source.replace("10 20 30 80", "30 20 10 80"), "0000.txt");
    assert!(!inside_out.unwrap()[0].region.has_area());
}

#[test]
fn kitti_pedestrians_count_as_far_as_they_are_seen() {
    for (class, role) in [
        ("pedestrian 0 2", Some(Role::Counts)),
        ("Pedestrian -1 -1", Some(Role::Counts)),
        ("Pedestrian 0 3", Some(Role::Ignored)),
        ("Pedestrian 0.5 0", Some(Role::Ignored)),
        ("Person 0 0", Some(Role::Ignored)),
        ("Cyclist 0 0", None),
    ] {
        let line = format!("0 1 {class} 0 1 1 9 9 1 1 1 1 1 1 0\n");
        assert_eq!(kitti::parse(&line, "0000.txt").unwrap()[0].pedestrian_role(), role, "{class}");
    }
    for (x, z, floor_m) in [(-3, 7, Some([-3.0, 7.0])), (-1000, 7, None), (-3, -1000, None)] {
        let line = format!("0 1 Pedestrian 0 0 0 1 1 9 9 1 1 1 {x} 1 {z} 0\n");
        assert_eq!(kitti::parse(&line, "0000.txt").unwrap()[0].floor_m(), floor_m);
    }
    let metres = kitti::comparison(Similarity::Metres);
    assert_eq!(
        (metres.similarity, metres.ignore_unmatched_below_px),
        (Similarity::Metres, Some(25.0))
    );
}

#[test]
fn numbers_of_a_line_are_whole_where_they_have_to_be() {
    fn id(id: &str) -> Result<i64, FormatError> {
        mot::parse(&format!("\u{feff}1,{id},0,0,9,9"), "t").map(|rows| rows[0].id)
    }

    fn frame(frame: &str) -> Result<u32, FormatError> {
        mot::parse(&format!("{frame},1,0,0,9,9"), "t").map(|rows| rows[0].frame)
    }

    assert_eq!((id("12.0").unwrap(), id("-3").unwrap()), (12, -3));
    assert_eq!(id("8999999999999999").unwrap(), 8_999_999_999_999_999);
    assert!(why(id("9e15")).contains("expected a whole number"));
    assert!(why(id("0.5")).contains("expected a whole number"));
    assert_eq!((frame("1").unwrap(), frame("1e6").unwrap()), (1, MOST_FRAMES));
    assert!(frame("0").is_err() && frame("-1").is_err() && frame("4294967296").is_err());
    let whole_file = FormatError { file: "a".into(), line: 0, why: "is empty".into() };
    assert_eq!(whole_file.to_string(), "a: is empty");
    for (text, expected) in [
        ("1,1,0,0,9,9", (1.0, None, None)),
        ("1,1,0,0,9,9,0.5", (0.5, None, None)),
        ("1,1,0,0,9,9,0.5,7", (0.5, Some(7.0), None)),
        ("1,1,0,0,9,9,0.5,7,0.25", (0.5, Some(7.0), Some(0.25))),
    ] {
        let row = mot::parse(text, "t").unwrap()[0];
        assert_eq!((row.confidence, row.class, row.visibility), expected);
    }
}

#[test]
fn places_that_are_broken_are_named_by_line_and_column() {
    let source = "stamp_ns,frame,id,x_robot_m,y_robot_m,z_robot_m,x_odom_m,y_odom_m,z_odom_m,seen\n\
                  1,1,12,2.5,-0.5,1.6,7.5,1.5,1.7,0\n";
    let rows = metres::parse(source, "t.csv").unwrap();
    assert_eq!((rows[0].line, rows[0].seen, rows[0].frame), (2, false, 1));
    assert_eq!(
        (rows[0].head_in_robot_m, rows[0].head_in_odom_m),
        ([2.5, -0.5, 1.6], [7.5, 1.5, 1.7])
    );
    let broken = why(metres::parse(&source.replace("1.6", "high"), "t.csv"));
    assert!(broken.starts_with("t.csv, line 2: `z` is `high`"), "{broken}");
    let header = "frame,id,ub_x,ub_y,ub_w,ub_h,vis_x,vis_y,vis_w,vis_h,head_x,head_y,head_z,visible,\
                  occluder,ignore,interpolated\n";
    let read = "1,4,1,2,3,4,5,6,7,8,0.5,-0.3,2.5,0.75,0,0,300";
    let read = parse_people(&format!("{header}{read}")).unwrap()[0].clone();
    assert_eq!((read.ignore, read.interpolated, read.occluder.as_str()), (false, 255, "0"));
    assert_eq!(read.visible_body, Some(Region::new(5.0, 6.0, 7.0, 8.0)));
    assert!(read.key, "by default");
    for negative in ["1,4,1,2,-3,4,5,6,7,8,0,0,1,1,0,0,0", "1,4,1,2,3,4,5,6,7,-8,0,0,1,1,0,0,0"] {
        let error = why(parse_people(&format!("{header}{negative}")));
        assert!(error.contains("p.csv, line 2: a box has a negative size"));
    }
    let outside = "1,4,1,2,0,0,5,6,0,0,0,0,1,1,0,0,0";
    let outside = parse_people(&format!("{header}{outside}"));
    assert!(outside.is_ok(), "who is out of the image has no box");
}

#[test]
fn only_a_box_or_a_place_is_required_of_a_person() {
    let boxes = parse_people("id,frame,ub_x,ub_y,ub_w,ub_h\n4,2,10,20,30,30\n").unwrap();
    assert_eq!((boxes[0].frame, boxes[0].id, boxes[0].visible), (2, 4, 1.0));
    let (_, truth) = boxes[0].truth(|_| panic!("it has no place"));
    assert_eq!((truth.region, truth.floor_m), (Some(Region::new(10.0, 20.0, 30.0, 30.0)), None));
    assert_eq!((truth.role, truth.view), (Role::Counts, None));
    let places = parse_people("frame,id,head_x,head_y,head_z,ignore\n2,4,0,0,2.5,1\n").unwrap();
    let (_, truth) = places[0].truth(|[_, _, z]| Some([z, 0.0]));
    assert_eq!((truth.region, truth.floor_m, truth.role), (None, Some([2.5, 0.0]), Role::Ignored));
    // Empty cells are those of missing columns.
    let mixed =
        "frame,id,ub_x,ub_y,ub_w,ub_h,head_x,head_y,head_z,key\n1,1,5,5,9,9,,,,0\n1,2,,,,,0,0,3,\n";
    let mixed = parse_people(mixed).unwrap();
    assert_eq!((mixed[0].head_in_camera_m, mixed[0].key), (None, false));
    assert_eq!((mixed[1].upper_body, mixed[1].key), (None, true));
    assert_eq!(parse_people(&text(|out| people::write(out, &mixed))).unwrap(), mixed);
    for (wrong, cause) in [
        ("frame,id\n1,1\n", "line 1: has neither a box nor a place: add ub_x"),
        ("frame,ub_x,ub_y,ub_w,ub_h\n", "no column `id`"),
        ("frame,id,ub_x,ub_y,ub_w\n", "no column `ub_h`"),
        ("frame,id,head_x,head_y,head_z\n1,1,,,\n", "line 2: has neither a box (ub_*) nor"),
        ("frame,id,head_x,head_y,head_z\n1,1,2,,3\n", "line 2: fill all of head_x, head_y, head_z"),
    ] {
        let error = why(parse_people(wrong));
        assert!(error.contains(cause), "{error}");
    }
}

#[test]
fn sequence_info_has_limits_and_may_leave_out_the_size() {
    let plain = "[Sequence]\nNAME = hall \nframerate=14\nseqLength=1000000";
    let plain = mot::parse_info(plain, "seqinfo.ini").unwrap();
    assert_eq!((plain.name.as_str(), plain.rate_hz, plain.length), ("hall", 14.0, 1_000_000));
    assert_eq!((plain.width, plain.height), (0, 0));
    for (text, words) in [
        ("name=x\nframeRate=-1\nseqLength=1", "expected a number"),
        ("name=x\nframeRate=inf\nseqLength=1", "expected a number"),
        ("frameRate=1\nseqLength=1", "has no `name=`"),
    ] {
        assert!(why(mot::parse_info(text, "seqinfo.ini")).contains(words), "{text}");
    }
}

#[test]
fn kitti_objects_that_are_not_told_apart_are_left_out() {
    fn label(id: i64, class: &str) -> String {
        format!("0 {id} {class} 0 0 0 1 1 9 9 1 1 1 1 1 1 0\n")
    }

    let source = label(-1, "Pedestrian") + &label(-1, "DontCare") + &label(0, "Pedestrian");
    let labels = kitti::parse(&source, "0000.txt").unwrap();
    let odd = labels.iter().map(|label| (label.line, label.is_anonymous())).collect::<Vec<_>>();
    assert_eq!(odd, [(1, true), (2, false), (3, false)]);
    let mut timeline = Timeline::new();
    kitti::add_truths(&mut timeline, &labels);
    kitti::add_reports(&mut timeline, &labels);
    let frame = timeline.frame(0);
    assert_eq!((frame.truths.len(), frame.reports.len()), (1, 1));
    assert_eq!((frame.truths[0].id, frame.ignore_regions.len()), (0, 1));
}

#[test]
fn people_csv_survives_a_round_trip_in_any_order_of_columns() {
    let Some(path) = tagalong_conformance::testdata::find("logs/um.people.csv") else { return };
    let source = fs::read_to_string(&path).unwrap();
    let rows = people::parse(&source, "um.people.csv").unwrap();
    assert_eq!(rows.len(), source.lines().count() - 1);
    let written = text(|out| people::write(out, &rows));
    assert_eq!(people::parse(&written, "written").unwrap(), rows);
    let counted: Vec<u32> = rows.iter().filter(|r| !r.ignore).map(|r| r.frame).collect();
    assert!(rows.iter().all(|row| row.ignore || row.id == 1), "only the walker counts");
    assert_eq!((counted.first(), counted.last()), (Some(&1), Some(&32)));
}

#[test]
fn people_rows_become_truth() {
    let source = "ignore,id,frame,ub_x,ub_y,ub_w,ub_h,vis_x,vis_y,vis_w,vis_h,head_x,head_y,head_z,\
                  visible,occluder,interpolated\n1,4,2,1,2,3,4,5,6,7,8,0.5,-0.3,2.5,0.75,border,2\n";
    let rows = people::parse(source, "a.csv").unwrap();
    let (frame, truth) = rows[0].truth(|[x, _, z]| Some([z, -x]));
    assert_eq!((frame, truth.id, truth.role), (2, 4, Role::Ignored));
    assert_eq!(truth.region, Some(Region::new(1.0, 2.0, 3.0, 4.0)));
    assert_eq!(truth.floor_m, Some([2.5, -0.5]));
    let missing = why(people::parse(&source.replace("ub_w", "width"), "a.csv"));
    assert!(
        missing.starts_with("a.csv, line 1: no column `ub_w`; there are: ignore,"),
        "{missing}"
    );
    assert!(why(people::parse("", "a.csv")).contains("is empty"));
}

#[test]
fn places_of_a_run_become_reports() {
    let source = "stamp_ns,frame,id,x_robot_m,y_robot_m,z_robot_m,x_odom_m,y_odom_m,z_odom_m,seen\n\
                  1700000000123456789,3,12,2.5,-0.5,1.6,7.5,1.5,1.6,1\n";
    let rows = metres::parse(source, "tracks-metres.csv").unwrap();
    assert_eq!((rows[0].stamp_ns, rows[0].seen), (1_700_000_000_123_456_789, true));
    let (frame, report) = rows[0].report(metres::Floor::Robot);
    assert_eq!((frame, report.id, report.floor_m), (3, 12, Some([2.5, -0.5])));
    assert_eq!(rows[0].report(metres::Floor::Odometry).1.floor_m, Some([7.5, 1.5]));
    assert!(metres::check_length(&rows, "t.csv", 3).is_ok());
    assert!(why(metres::check_length(&rows, "t.csv", 2)).starts_with("t.csv, line 2: frame 3;"));
    let wrong = why(metres::parse(&source.replace("1700000000123456789", "soon"), "t.csv"));
    assert!(wrong.contains("`stamp_ns` is `soon`"), "{wrong}");
}

#[test]
fn frames_beyond_the_end_are_counted() {
    let mut timeline = Timeline::new();
    timeline.add_truths([(1, Truth::default()), (9, Truth::default())]);
    assert_eq!(timeline.last(), Some(9));
    let (sequence, beyond) = timeline.into_sequence("short", 1, 4, 2.0);
    assert_eq!((sequence.frames.len(), beyond), (4, 1));
    assert_eq!(sequence.frames[3].stamp_ns, 1_500_000_000);
}

fn some_region() -> impl Strategy<Value = Region> {
    (0.0..50.0_f64, 0.0..10.0_f64, 5.0..30.0_f64, 5.0..30.0_f64)
        .prop_map(|(x, y, width, height)| Region { x, y, width, height })
}

fn a_frame() -> impl Strategy<Value = Frame> {
    let role =
        prop_oneof![4 => Just(Role::Counts), 1 => Just(Role::Ignored), 1 => Just(Role::Bystander)];
    let truths = prop::collection::vec((some_region(), role), 0..5);
    let reports = prop::collection::vec((some_region(), 0.0..1.0_f64), 0..5);
    (truths, reports).prop_map(|(truths, reports)| Frame {
        truths: (1..)
            .zip(truths)
            .map(|(id, (r, role))| Truth { id, region: Some(r), role, ..Truth::default() })
            .collect(),
        reports: (1..)
            .zip(reports)
            .map(|(id, (r, score))| Report { id, region: Some(r), floor_m: None, score })
            .collect(),
        ..Frame::default()
    })
}

fn exported(sequence: &Sequence) -> trackeval::Files {
    let info =
        mot::SequenceInfo { name: "hall".into(), rate_hz: 4.0, width: 640, height: 480, length: 0 };
    trackeval::write("Tagalong", "ours", &[(info, sequence.clone())])
}

proptest! {
    #[test]
    fn the_exported_tree_scores_like_what_was_exported(
        frames in prop::collection::vec(a_frame(), 1..6),
    ) {
        let mut frames = frames;
        for (index, frame) in frames.iter_mut().enumerate() {
            frame.stamp_ns = index as i64 * 250_000_000;
        }
        let sequence = Sequence { name: "hall".into(), frames };
        let files = exported(&sequence);
        let read = trackeval::read(&files, "Tagalong", "ours", mot::Rules::Mot17).unwrap();
        prop_assert_eq!(&read[0].1, &sequence);
        let comparison = Comparison::from(Similarity::Iou);
        prop_assert_eq!(measured(&read[0].1, &comparison), measured(&sequence, &comparison));
    }

    #[test]
    fn no_frame_number_asks_for_more_memory_than_its_file_is_worth(
        frame in prop_oneof![any::<u64>().prop_map(|n| n.to_string()), "[0-9]{1,12}(\\.0|e[0-9]{1,3})?"],
    ) {
        for read in readers_of(&frame) {
            let number = frame.parse::<f64>().unwrap();
            prop_assert!(read.is_err() || number <= f64::from(MOST_FRAMES), "{}", frame);
        }
    }

    #[test]
    fn no_text_makes_a_reader_panic(text in "[0-9,. \n\\-a-f=]{0,80}") {
        let _ = mot::parse(&text, "x");
        let _ = mot::parse_info(&text, "x");
        let _ = kitti::parse(&text, "x");
        let _ = people::parse(&text, "x");
        let _ = metres::parse(&text, "x");
    }
}

#[test]
fn the_tree_has_the_paths_that_trackeval_looks_for() {
    let files = exported(&Sequence { name: "hall".into(), frames: vec![Frame::default()] });
    let paths: Vec<&str> = files.keys().map(String::as_str).collect();
    assert_eq!(
        paths,
        [
            "gt/mot_challenge/Tagalong-train/hall/gt/gt.txt",
            "gt/mot_challenge/Tagalong-train/hall/seqinfo.ini",
            "gt/mot_challenge/seqmaps/Tagalong-train.txt",
            "trackers/mot_challenge/Tagalong-train/ours/data/hall.txt",
        ]
    );
    let mut broken = files.clone();
    broken.remove("gt/mot_challenge/Tagalong-train/hall/gt/gt.txt");
    let missing = trackeval::read(&broken, "Tagalong", "ours", mot::Rules::Mot17);
    assert!(why(missing).contains("hall/gt/gt.txt: is missing"));
}

#[test]
fn of_people_with_one_id_in_a_frame_the_first_stays() {
    let mut people = vec![(1, 7, 'a'), (2, 7, 'b'), (1, 7, 'c'), (1, 8, 'd'), (1, 7, 'e')];
    assert_eq!(keep_first_of_id(&mut people, |(frame, id, _)| (*frame, *id)), 2);
    let kept: String = people.iter().map(|(.., name)| name).collect();
    assert_eq!(kept, "abd");
    assert_eq!(keep_first_of_id(&mut people, |(frame, id, _)| (*frame, *id)), 0);
}
