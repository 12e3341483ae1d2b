use std::sync::Arc;

use tagalong_core::DepthImage;
use tagalong_eval::{Clear, Comparison, Frame, Region, Report, Similarity, Truth};
use tagalong_geometry::{Camera, Pinhole};

use super::*;
use crate::frame_notes::{CandidateNote, DroppedNote, FateNote, FrameNotes, MeasuredNote};

/// Box of the person, and a candidate's box at it.
const PERSON: Rect = Rect::new(100.0, 100.0, 60.0, 60.0);
const AT: [f64; 4] = [102.0, 101.0, 58.0, 58.0];

fn remedies() -> Remedies {
    let registry = tagalong_catalog::registry();
    Remedies::new(&registry)
}

fn config() -> Table {
    let text = "[[detectors]]\nplugin = 'depth-template'\n[detectors.config]\nmin_body = 0.5\n\
                discover_cost = 0.2\nmin_depth_m = 0.5\nmax_depth_m = 5.0\nmin_head_height_m = 1.2\n\
                max_head_height_m = 2.1\n[manager]\nplugin = 'manage-sprt'\n[manager.config]\n\
                tentative_misses = 2\n";
    toml::from_str(text).expect("a config")
}

fn candidate(test: &str, box_px: [f64; 4]) -> CandidateNote {
    CandidateNote { box_px, fate: FateNote::Dropped(test.into()), ..CandidateNote::default() }
}

fn dropped(test: &str, box_px: [f64; 4]) -> DroppedNote {
    DroppedNote { test: test.into(), count: 1, boxes_px: vec![box_px], ..DroppedNote::default() }
}

fn track(id: u32, stage: TrackStage, x: f32) -> SightedTrack {
    SightedTrack { id, stage, box_px: [x, 101.0, 58.0, 58.0], floor_m: [2.0, 0.0] }
}

/// Returns the cause at the person in one frame with these notes and tracks.
fn cause(notes: &FrameNotes, tracks: &[SightedTrack], depths: Option<Depths>) -> Cause {
    let mut witness = Witness::default();
    witness.add(1, notes, tracks.to_vec(), depths);
    let place = PersonAt { rect: Some(PERSON), floor_m: None };
    let rules = Rules { remedies: &remedies(), config: &config() };
    witness.explain(1, &place, &BTreeSet::from([8]), None, rules)
}

fn of_drops(drops: &[(&str, [f64; 4])]) -> Cause {
    let dropped = drops.iter().map(|(test, at)| dropped(test, *at)).collect();
    cause(&FrameNotes { dropped, ..FrameNotes::default() }, &[], None)
}

#[test]
fn the_last_test_of_a_candidate_of_the_persons_size_is_the_cause() {
    let found = of_drops(&[
        ("template cost", [108.0, 101.0, 58.0, 58.0]),
        ("template cost", AT),
        ("body below", AT),
        // Elsewhere, and of another size.
        ("verifier", [300.0, 101.0, 58.0, 58.0]),
        ("score", [110.0, 110.0, 20.0, 20.0]),
    ]);
    assert_eq!(
        found.test.as_deref(),
        Some("template cost"),
        "stages count, not the order of drops"
    );
    assert_eq!(found.box_px, Some(AT), "the nearest of one test");
    assert_eq!(
        found.text,
        "No track began here: the test \"template cost\" dropped the candidate; decided by \
         detectors.0.config.discover_cost = 0.2 (depth-template): larger finds \
         more people and more furniture."
    );
}

/// Returns a place near the person, and the cost that it was dropped for.
fn costly(cost: f64, x: f64) -> ([f64; 4], MeasuredValue) {
    let limits = vec![("refine_cost".to_owned(), 0.4), ("discover_cost".to_owned(), 0.2)];
    ([x, 101.0, 58.0, 58.0], MeasuredValue { what: "cost".into(), value: cost, limits })
}

#[test]
fn the_candidate_that_came_nearest_to_the_limit_is_told_with_its_value() {
    let places = [costly(0.62, 102.0), costly(0.47, 110.0), costly(0.55, 101.0)];
    let measured = places.iter().enumerate();
    let measured = measured.map(|(at, (_, value))| MeasuredNote { at, value: value.clone() });
    let note = DroppedNote {
        test: "not refined".into(),
        count: 9,
        boxes_px: places.iter().map(|place| place.0).collect(),
        measured: measured.collect(),
    };
    let found = cause(&FrameNotes { dropped: vec![note], ..FrameNotes::default() }, &[], None);
    assert_eq!((found.name.as_str(), found.box_px), ("not refined", Some(places[1].0)));
    assert!(
        found.text.starts_with(
            "No track began here: the test \"not refined\" dropped the candidate, cost 0.47 > \
             refine_cost 0.4 and > discover_cost 0.2; it passes with "
        ) && found.text.contains("discover_cost = 0.48 (depth-template): "),
        "{}",
        found.text
    );
    assert!(!found.why.contains("0.47"), "the same for all people: {}", found.why);
}

#[test]
fn a_score_is_told_against_the_least_one_that_starts_a_track() {
    let mut low = candidate("verifier", AT);
    low.score = -1.304;
    let notes = FrameNotes { candidates: vec![low], ..FrameNotes::default() };
    assert!(!cause(&notes, &[], None).text.contains("log-odds"), "no limit is known");
    let mut config = config();
    let manager = config.get_mut("manager").and_then(|manager| manager.get_mut("config"));
    let manager = manager.and_then(toml::Value::as_table_mut).expect("a manager");
    manager.insert("start_log_odds".to_owned(), 0.0.into());
    let mut witness = Witness::default();
    witness.add(1, &notes, Vec::new(), None);
    let place = PersonAt { rect: Some(PERSON), floor_m: None };
    let rules = Rules { remedies: &remedies(), config: &config };
    let told = witness.cause_at(1, &place, rules).text;
    assert!(
        told.contains("candidate, log-odds -1.30 < start_log_odds 0; it passes with [manager]")
            && told.contains("{ start_log_odds = -1.31 }"),
        "{told}"
    );
    // The manager wants an end below the start.
    let manager = config.get_mut("manager").and_then(|manager| manager.get_mut("config"));
    let manager = manager.and_then(toml::Value::as_table_mut).expect("a manager");
    manager.insert("end_log_odds".to_owned(), (-1.0).into());
    let rules = Rules { remedies: &remedies(), config: &config };
    let told = witness.cause_at(1, &place, rules).text;
    assert!(
        told.contains("< start_log_odds 0 and < end_log_odds -1; it passes with [manager]")
            && told.contains("{ start_log_odds = -1.31, end_log_odds = -1.32 }"),
        "{told}"
    );
}

#[test]
fn advice_that_is_a_question_ends_in_its_mark() {
    let told = of_drops(&[("head width", AT)]).text;
    assert!(told.ends_with("is the depth scaled right?"), "{told}");
}

#[test]
fn a_candidate_that_overlaps_the_person_is_better_than_none() {
    // On the chest: its centre is below the person's square.
    let chest = [110.0, 152.0, 50.0, 50.0];
    assert_eq!(of_drops(&[("template cost", chest)]).test.as_deref(), Some("template cost"));
    let both = of_drops(&[("body below", AT), ("template cost", chest)]);
    assert_eq!(both.test.as_deref(), Some("body below"));
    assert_eq!(of_drops(&[("template cost", [150.0, 155.0, 50.0, 50.0])]).name, "no candidate");
}

#[test]
fn a_better_detection_of_another_person_is_the_cause_only_where_nothing_else_is() {
    let notes = FrameNotes {
        candidates: vec![candidate(NOT_BEST, AT)],
        dropped: vec![dropped("body below", [110.0, 152.0, 50.0, 50.0])],
        ..FrameNotes::default()
    };
    assert_eq!(cause(&notes, &[], None).test.as_deref(), Some("body below"));
    let alone = FrameNotes { dropped: Vec::new(), ..notes };
    let told = cause(&alone, &[], None).text;
    assert!(told.contains("no setting decides it: the search around a known person"), "{told}");
}

#[test]
fn a_predicted_track_does_not_count_and_the_cause_follows() {
    let notes = FrameNotes { dropped: vec![dropped("template cost", AT)], ..FrameNotes::default() };
    let told = cause(&notes, &[track(4, TrackStage::Predicted, 102.0)], None);
    assert!(
        told.text.starts_with(
            "Track 4 is only predicted here, and a predicted track does not count as reported: the \
             test \"template cost\" dropped"
        ),
        "{}",
        told.text
    );
    assert_eq!(told.test.as_deref(), Some("template cost"));
    let on_the_chest =
        SightedTrack { box_px: [102.0, 152.0, 58.0, 58.0], ..track(4, TrackStage::Predicted, 0.0) };
    for other in [track(4, TrackStage::Predicted, 200.0), on_the_chest] {
        let beside = cause(&notes, &[other], None);
        assert!(beside.text.starts_with("No track began here"), "{}", beside.text);
    }
}

#[test]
fn tracks_that_are_seen_or_not_confirmed_are_causes_of_their_own() {
    let notes = FrameNotes { dropped: vec![dropped("body below", AT)], ..FrameNotes::default() };
    let seen = cause(&notes, &[track(3, TrackStage::Seen, 130.0)], None);
    assert_eq!((seen.name.as_str(), seen.test), ("beside the person", None));
    assert!(seen.text.starts_with("Track 3 is seen here, but too far"), "{}", seen.text);
    assert!(seen.why.starts_with("a track is seen here"), "the same for all tracks: {}", seen.why);
    let new = cause(&notes, &[track(5, TrackStage::Tentative, 102.0)], None);
    assert_eq!(new.name, NOT_CONFIRMED);
    assert!(new.text.contains("{ tentative_misses = 2 }"), "{}", new.text);
    let other = cause(&notes, &[track(8, TrackStage::Seen, 130.0)], None);
    assert_eq!(other.name, "body below", "track 8 is on another person");
    let stages = [(false, true), (true, true), (true, false)].map(|(c, s)| TrackStage::of(c, s));
    assert_eq!(stages, [TrackStage::Tentative, TrackStage::Seen, TrackStage::Predicted]);
}

#[test]
fn a_track_that_ends_in_the_frame_is_the_cause_and_not_a_candidate_beside_it() {
    let ended = CandidateNote { fate: FateNote::Matched(5), ..candidate("", AT) };
    let of_track = DroppedNote { boxes_px: Vec::new(), ..dropped("track: not confirmed", AT) };
    let notes = FrameNotes {
        candidates: vec![ended],
        dropped: vec![dropped("occupied", AT), of_track],
        ended: vec![5],
        ..FrameNotes::default()
    };
    let found = cause(&notes, &[], None);
    assert_eq!((found.name.as_str(), found.test), (NOT_CONFIRMED, None));
    assert!(
        found.text.starts_with(
            "Track 5 was seen here and ended in this frame: the test \"track: not confirmed\" ended \
             the track; decided by [manager]"
        ),
        "{}",
        found.text
    );
    let two = FrameNotes { ended: Vec::new(), ..notes };
    assert_eq!(cause(&two, &[], None).name, "occupied", "that track goes on");
}

#[test]
fn a_second_detection_of_another_person_is_not_that_of_the_missed_one() {
    let between = [119.0, 101.0, 58.0, 58.0];
    let notes = FrameNotes { dropped: vec![dropped("occupied", between)], ..FrameNotes::default() };
    assert_eq!(cause(&notes, &[], None).name, "occupied");
    // Track 8 is on another person.
    let other = cause(&notes, &[track(8, TrackStage::Seen, 120.0)], None);
    assert_eq!(other.name, "no candidate");
    let farther = cause(&notes, &[track(8, TrackStage::Seen, 150.0)], None);
    assert_eq!(farther.name, "occupied");
}

fn depths(metres: f32) -> Depths {
    let camera = Camera::mounted(Pinhole::centred(500.0, 320, 240), 320, 240, 1.6, 0.0, 0.0);
    Depths::of(&DepthImage::filled(320, 240, metres), &Arc::new(camera))
}

#[test]
fn without_a_candidate_the_measured_cause_is_told() {
    fn of(metres: f32) -> Cause {
        cause(&FrameNotes::default(), &[], Some(depths(metres)))
    }

    assert_eq!(of(f32::NAN).name, "no depth");
    assert_eq!(of(0.4).name, "too near");
    assert_eq!(of(3.0).name, "no candidate");
    let far = of(6.2);
    assert_eq!(far.name, "too far");
    assert!(
        far.text.ends_with(
            "the surface there is 6.2 m away, farther than the detectors search; decided by \
             detectors.0.config.max_depth_m = 5.0 (depth-template)."
        ),
        "{}",
        far.text
    );
    let unknown = cause(&FrameNotes::default(), &[], None);
    assert_eq!(unknown.name, "no candidate", "without depth nothing is measured");
}

#[test]
fn the_height_of_the_head_is_measured() {
    let low = Rect::new(130.0, 180.0, 50.0, 50.0);
    let rules = Rules { remedies: &remedies(), config: &config() };
    let (name, why) = depths(4.0).cause(&low, rules).expect("a cause");
    assert_eq!(name, "head too low");
    assert!(
        why.contains("m above the floor, lower than") && why.contains("= 1.2 (depth-template)"),
        "{why}"
    );
    let high = Rect::new(130.0, 0.0, 50.0, 50.0);
    assert_eq!(depths(4.0).cause(&high, rules).map(|cause| cause.0), Some("head too high"));
}

#[test]
fn a_detector_that_looks_at_other_things_than_depth_has_no_limit_of_depth() {
    let mut config = config();
    let other: Table = toml::from_str("plugin = 'onnx'\nconfig = { }").expect("a table");
    let detectors = config.get_mut("detectors").and_then(toml::Value::as_array_mut);
    detectors.expect("a list").push(other.into());
    let rules = Rules { remedies: &remedies(), config: &config };
    assert_eq!(depths(9.0).cause(&PERSON, rules), None);
}

/// Person 1 is found as track 7 in the first frame, and missed in the next one.
fn course(tracks: &[SightedTrack], stamp_ns: i64) -> Vec<Missed> {
    let region = Some(Region { x: 100.0, y: 100.0, width: 60.0, height: 60.0 });
    let truths = vec![Truth { id: 1, region, ..Truth::default() }];
    let found = Frame {
        stamp_ns: 1,
        truths: truths.clone(),
        reports: vec![Report { id: 7, region, ..Report::default() }],
        ..Frame::default()
    };
    let missed = Frame { stamp_ns, truths, ..Frame::default() };
    let sequence = Sequence { name: "a".into(), frames: vec![found, missed] };
    let comparison = Comparison { similarity: Similarity::Iou, ..Comparison::default() };
    let prepared = Prepared::new(&sequence, &comparison).expect("sound truth");
    let (_, matches) = Clear::measure(&prepared);
    let mut witness = Witness::default();
    witness.add(2, &FrameNotes::default(), tracks.to_vec(), None);
    let rules = Rules { remedies: &remedies(), config: &config() };
    find_missed(&sequence, &prepared, &matches, &witness, rules)
}

#[test]
fn the_track_that_was_on_the_person_is_told() {
    let ended = course(&[], 1_000_000_000);
    assert_eq!((ended.len(), ended[0].at, ended[0].person), (1, 1, 1));
    assert_eq!(
        ended[0].cause.text,
        "Track 7 ended, and no new one began: no detector proposed a candidate here."
    );
    let elsewhere = course(&[track(7, TrackStage::Seen, 250.0)], 1_000_000_000);
    assert!(elsewhere[0].cause.text.starts_with("Track 7 was here and is elsewhere now"));
    let long_ago = course(&[], 3_000_000_000);
    assert!(long_ago[0].cause.text.starts_with("No track began here"));
}

#[test]
fn without_boxes_places_on_the_floor_are_compared() {
    let mut near = candidate("score", [0.0; 4]);
    near.head_odom_m = [2.5, 0.0, 0.0];
    let notes = FrameNotes { candidates: vec![near], ..FrameNotes::default() };
    let mut witness = Witness::default();
    witness.add(1, &FrameNotes { robot_odom: [1.0, 0.0, 0.0], ..notes }, Vec::new(), None);
    let rules = Rules { remedies: &remedies(), config: &config() };
    for (x, test) in [(1.2, Some("score")), (3.0, None)] {
        let floor_m = witness.in_odom(1, [x, 0.0]);
        let cause = witness.cause_at(1, &PersonAt { rect: None, floor_m }, rules);
        assert_eq!(cause.test.as_deref(), test, "{x} m ahead");
    }
}
