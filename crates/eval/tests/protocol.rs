//! Small scenes worked out by hand: ignored people, times, following, errors.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use tagalong_eval::{
    Clear, Comparison, DetectionTally, EvalError, EventKind, Following, Frame, GospaParts, Hota,
    HotaLevel, Identity, Prepared, Region, Report, Role, Scores, Sequence, SetDistance, SetTally,
    Similarity, Tally, Times, Truth, Verdict, View, events,
};

const SECOND_NS: i64 = 1_000_000_000;

/// Place `x` is a square of side 10 at 10 x, and the point x metres ahead.
fn region(x: f64) -> Region {
    Region::new(10.0 * x, 0.0, 10.0, 10.0)
}

fn truth(id: i64, x: f64) -> Truth {
    Truth { id, region: Some(region(x)), floor_m: Some([x, 0.0]), role: Role::Counts, view: None }
}

fn report(id: i64, x: f64) -> Report {
    Report { id, region: Some(region(x)), floor_m: Some([x, 0.0]), score: 0.5 }
}

/// Places of people: id and place.
type Places<'a> = &'a [(i64, f64)];

/// One frame a second from (places of people) and (places of tracks).
fn sequence(frames: &[(Places<'_>, Places<'_>)]) -> Sequence {
    let frames = (0..).zip(frames).map(|(index, (truths, reports))| Frame {
        stamp_ns: index * SECOND_NS,
        truths: truths.iter().map(|&(id, x)| truth(id, x)).collect(),
        reports: reports.iter().map(|&(id, x)| report(id, x)).collect(),
        ignore_regions: Vec::new(),
    });
    Sequence { name: "scene".into(), frames: frames.collect() }
}

fn one_frame(truths: Vec<Truth>, reports: Vec<Report>) -> Sequence {
    let frame = Frame { truths, reports, ..Frame::default() };
    Sequence { name: "one".into(), frames: vec![frame] }
}

fn prepared(sequence: &Sequence) -> Prepared {
    Prepared::new(sequence, &Comparison::default()).unwrap()
}

fn times(sequence: &Sequence) -> Times {
    let prepared = prepared(sequence);
    Times::measure(&prepared, &Clear::measure(&prepared).1)
}

#[test]
fn an_ignored_person_is_neither_miss_nor_false_alarm() {
    for similarity in [Similarity::Iou, Similarity::Metres] {
        for role in [Role::Ignored, Role::Bystander, Role::Counts] {
            let other = Truth { role, ..truth(2, 5.0) };
            let expected = match role {
                Role::Ignored => [(1, 0, 0), (1, 0, 0)],
                Role::Bystander => [(1, 1, 0), (1, 0, 0)],
                Role::Counts => [(2, 0, 0), (1, 0, 1)],
            };
            let found = vec![report(1, 0.0), report(2, 5.0)];
            for (reports, expected) in [found, vec![report(1, 0.0)]].into_iter().zip(expected) {
                let sequence = one_frame(vec![truth(1, 0.0), other], reports);
                let scores = Scores::measure(&sequence, similarity).unwrap();
                assert_eq!((scores.tp, scores.fp, scores.fn_), expected, "{role:?}");
            }
        }
    }
}

#[test]
fn the_real_person_goes_before_the_ignored_one() {
    let near = Truth { role: Role::Ignored, ..truth(2, 0.2) };
    let scene = one_frame(vec![near, truth(1, 0.0)], vec![report(1, 0.0)]);
    let scores = Scores::measure(&scene, Similarity::Iou).unwrap();
    assert_eq!((scores.tp, scores.fp, scores.fn_), (1, 0, 0));
}

#[test]
fn unmatched_reports_in_an_ignore_region_or_too_small_are_left_out() {
    fn false_alarms(scene: &Sequence, comparison: &Comparison) -> (u64, u64) {
        let tally = Tally::measure(scene, comparison, &SetDistance::default()).unwrap();
        (tally.clear.tp, tally.clear.fp)
    }

    let mut scene = one_frame(vec![truth(1, 0.0)], vec![report(1, 0.0), report(2, 5.0)]);
    let usual = Comparison::default();
    assert_eq!(false_alarms(&scene, &usual), (1, 1));
    let small = Comparison { ignore_unmatched_below_px: Some(10.0), ..usual };
    assert_eq!(false_alarms(&scene, &small), (1, 0));
    scene.frames[0].ignore_regions.push(Region::new(44.0, 0.0, 100.0, 100.0));
    assert_eq!(false_alarms(&scene, &usual), (1, 0));
    scene.frames[0].ignore_regions[0].x = 56.0;
    assert_eq!(false_alarms(&scene, &usual), (1, 1));
}

#[test]
fn an_ignored_truth_absorbs_any_number_of_detections() {
    let crowd = Truth {
        role: Role::Ignored,
        region: Some(Region::new(100.0, 0.0, 100.0, 10.0)),
        ..truth(9, 10.0)
    };
    let reports = vec![report(1, 0.0), report(2, 11.0), report(3, 14.0), report(4, 30.0)];
    let tally = DetectionTally::measure(
        &one_frame(vec![truth(1, 0.0), crowd], reports),
        Similarity::Iou,
        0.5,
    );
    let right: Vec<bool> = tally.verdicts.iter().map(|verdict| verdict.right).collect();
    assert_eq!((tally.truths, right), (1, vec![true, false]));
}

#[test]
fn the_miss_rate_is_read_left_of_each_reference() {
    // Two people in two images; the surer detection of three is wrong.
    let mut scene = sequence(&[(&[(1, 0.0)], &[(1, 0.0), (2, 5.0)]), (&[(1, 0.0)], &[(1, 0.0)])]);
    scene.frames[0].reports[1].score = 0.9;
    let tally = DetectionTally::measure(&scene, Similarity::Iou, 0.5);
    let curve: Vec<(f64, f64)> = tally.curve().iter().map(|p| (p.fppi, p.miss_rate)).collect();
    assert_eq!(curve, [(0.5, 1.0), (0.5, 0.0)]);
    // Seven references lie left of the first point, two see no miss at all.
    let expected = (2.0 * 1e-10_f64.ln() / 9.0).exp();
    assert!((tally.log_average_miss_rate().unwrap() - expected).abs() < 1e-12);
    // One right of two at recall one half, then two of three.
    assert!((tally.average_precision().unwrap() - 2.0 / 3.0).abs() < 1e-12);
}

#[test]
fn each_reference_reads_the_last_point_that_is_not_beyond_it() {
    let mut tally = DetectionTally { truths: 10, images: 1000, ..DetectionTally::default() };
    let groups = [(5, 1), (15, 1), (30, 2), (50, 1), (400, 2), (1500, 2)];
    for (step, (wrong, right)) in groups.into_iter().enumerate() {
        for (right, count) in [(false, wrong), (true, right)] {
            let verdict = Verdict { score: -(step as f64), right };
            tally.verdicts.extend(std::iter::repeat_n(verdict, count));
        }
    }
    let fppi: Vec<f64> = tally.curve().iter().map(|point| point.fppi).collect();
    assert_eq!(fppi, [0.005, 0.02, 0.05, 0.1, 0.5, 2.0]);
    // The fourth point lies on a reference, and is read there; the last one is beyond all.
    let read: [f64; 9] = [0.9, 0.9, 0.8, 0.6, 0.5, 0.5, 0.5, 0.3, 0.3];
    let expected = (read.iter().map(|rate| rate.ln()).sum::<f64>() / 9.0).exp();
    assert!((tally.log_average_miss_rate().unwrap() - expected).abs() < 1e-12);
}

#[test]
fn constant_scores_are_told_from_an_order() {
    fn scores(scene: &Sequence) -> Scores {
        Scores::measure(scene, Similarity::Iou).unwrap()
    }

    let mut scene = sequence(&[(&[(1, 0.0)], &[(1, 0.0), (2, 5.0)]), (&[(1, 0.0)], &[(1, 0.0)])]);
    let constant = scores(&scene);
    assert_eq!((constant.distinct_scores, constant.has_constant_scores()), (1, true));
    scene.frames[1].reports[0].score = 0.4;
    let ordered = scores(&scene);
    assert_eq!((ordered.distinct_scores, ordered.has_constant_scores()), (2, false));
    // A single report has an order of one.
    let single = scores(&one_frame(vec![truth(1, 0.0)], vec![report(1, 0.0)]));
    assert_eq!((single.distinct_scores, single.has_constant_scores()), (1, false));
}

#[test]
fn a_switch_a_gap_and_a_wrong_person() {
    let scene = sequence(&[
        (&[(1, 0.0), (2, 5.0)], &[(7, 5.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(7, 5.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(8, 0.0), (7, 5.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(8, 0.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(8, 0.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(8, 5.0)]),
        (&[(1, 0.0)], &[]),
    ]);
    let (clear, _) = Clear::measure(&prepared(&scene));
    assert_eq!((clear.tp, clear.fn_, clear.fp, clear.id_switches), (7, 6, 0, 1));
    // Frames without any report do not interrupt, as in TrackEval.
    assert_eq!(clear.fragmentations, 1);
    let times = times(&scene);
    assert_eq!(times.confirm_s, [0.0, 2.0]);
    assert_eq!(times.never_confirmed, 0);
    assert_eq!(times.reacquire_s, [2.0]);
    assert_eq!(times.never_reacquired, 1);
    assert_eq!(times.wrong_person_s, 1.0);
    assert_eq!(times.duration_s, 7.0);
}

/// Returns the ID switches and the inherited IDs of a scene, in the image as on the floor.
fn wrong_ids(frames: &[(Places<'_>, Places<'_>)]) -> (u64, u64) {
    let scene = sequence(frames);
    let [image, floor] = [Similarity::Iou, Similarity::Metres].map(|similarity| {
        let scores = Scores::measure(&scene, similarity).unwrap();
        (scores.idsw, scores.inherited_ids)
    });
    assert_eq!(image, floor, "the same in the image and on the floor");
    image
}

#[test]
fn a_newcomer_inherits_the_id_that_another_person_had_last() {
    // Person 1 leaves, a frame is empty, and person 2 comes in elsewhere with the ID.
    let left: (Places<'_>, Places<'_>) = (&[(1, 0.0)], &[(7, 0.0)]);
    let empty: (Places<'_>, Places<'_>) = (&[], &[]);
    let came: (Places<'_>, Places<'_>) = (&[(2, 5.0)], &[(7, 5.0)]);
    assert_eq!(wrong_ids(&[left, empty, came]), (0, 1));
    // It counts once: from then on the ID is that of person 2, also after a pause.
    assert_eq!(wrong_ids(&[left, empty, came, came, empty, came]), (0, 1));
    // Person 1 has it again: inherited from person 2, and no switch, as 7 is the last ID of both.
    assert_eq!(wrong_ids(&[left, came, left]), (0, 2));
    // A person with the own ID of before, or a newcomer with a new one, has inherited nothing.
    assert_eq!(wrong_ids(&[left, empty, left]), (0, 0));
    assert_eq!(wrong_ids(&[left, empty, (&[(2, 5.0)], &[(8, 5.0)])]), (0, 0));
    // An ID that was on no person belongs to none.
    assert_eq!(wrong_ids(&[(&[(1, 0.0)], &[(7, 5.0)]), came]), (0, 0));
}

#[test]
fn two_people_who_swap_their_ids_inherit_both() {
    let people: Places<'_> = &[(1, 0.0), (2, 5.0)];
    let before: (Places<'_>, Places<'_>) = (people, &[(7, 0.0), (8, 5.0)]);
    let after: (Places<'_>, Places<'_>) = (people, &[(8, 0.0), (7, 5.0)]);
    assert_eq!(wrong_ids(&[before, after, after]), (2, 2));
    // Person 2 alone takes over the ID of person 1, not found any more.
    assert_eq!(wrong_ids(&[before, (people, &[(7, 5.0)])]), (1, 1));
    // A new ID is a switch and was no person's.
    assert_eq!(wrong_ids(&[before, (people, &[(9, 0.0), (8, 5.0)])]), (1, 0));
}

#[test]
fn a_track_is_kept_before_similarity_is_looked_at() {
    // The second track lies better in the second frame, the first well enough.
    let scene = sequence(&[(&[(1, 0.0)], &[(7, 0.0)]), (&[(1, 0.0)], &[(7, 0.3), (8, 0.0)])]);
    let (clear, matches) = Clear::measure(&prepared(&scene));
    assert_eq!((clear.id_switches, clear.fp, matches[1][0].col), (0, 1, 0));
    // Too far off it is not kept.
    let scene = sequence(&[(&[(1, 0.0)], &[(7, 0.0)]), (&[(1, 0.0)], &[(7, 0.4), (8, 0.0)])]);
    assert_eq!(Clear::measure(&prepared(&scene)).0.id_switches, 1);
}

#[test]
fn what_went_wrong_is_listed_in_the_order_of_time() {
    let scene = sequence(&[
        (&[(1, 0.0), (2, 5.0)], &[(7, 0.0), (8, 5.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(7, 0.0), (8, 20.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(7, 5.0), (8, 20.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(7, 5.0), (8, 0.0)]),
    ]);
    let prepared = prepared(&scene);
    let (clear, matches) = Clear::measure(&prepared);
    let happened = events(&prepared, &matches);
    let listed: Vec<(usize, EventKind)> = happened.iter().map(|e| (e.frame, e.kind)).collect();
    use EventKind::{FalseTrack, Found, Miss, Switch, WrongPerson};
    let expected = [
        (2, Miss { person: 2, track: Some(8) }),
        (2, FalseTrack { track: 8 }),
        (3, Miss { person: 1, track: Some(7) }),
        (3, Found { person: 2, track: 7 }),
        (3, Switch { person: 2, from: 8, to: 7 }),
        (3, WrongPerson { track: 7, began_with: 1, person: 2 }),
        (4, Found { person: 1, track: 8 }),
        (4, Switch { person: 1, from: 7, to: 8 }),
        (4, WrongPerson { track: 8, began_with: 2, person: 1 }),
    ];
    assert_eq!(listed, expected);
    assert_eq!((happened[2].stamp_ns, clear.id_switches), (2 * SECOND_NS, 2));
}

#[test]
fn who_was_out_of_view_is_waited_for_from_the_return_on() {
    let scene = sequence(&[
        (&[(1, 0.0)], &[(7, 0.0)]),
        (&[], &[(7, 0.0)]),
        (&[], &[]),
        (&[(1, 0.0)], &[]),
        (&[(1, 0.0)], &[(9, 0.0)]),
        (&[(3, 4.0)], &[]),
    ]);
    let times = times(&scene);
    assert_eq!((times.confirm_s, times.reacquire_s), (vec![0.0], vec![1.0]));
    assert_eq!((times.never_confirmed, times.never_reacquired), (1, 0));
}

#[test]
fn following_is_judged_by_the_clock() {
    let scene = sequence(&[
        (&[(1, 0.0), (2, 5.0)], &[(7, 0.0), (8, 5.0), (9, 20.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(7, 0.0), (8, 5.0), (9, 20.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(7, 0.0), (8, 5.0), (9, 20.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(7, 0.0), (8, 5.0), (9, 20.0)]),
        (&[(1, 0.0), (2, 5.0)], &[(7, 0.0), (8, 5.0), (9, 20.0)]),
    ]);
    let prepared = prepared(&scene);
    let (_, matches) = Clear::measure(&prepared);
    let followed = [Some(7), Some(8), None, Some(7), Some(9)];
    let following = Following::measure(&prepared, &matches, 1, &followed);
    let expected =
        Following { on_target_s: 2.0, wrong_person_s: 1.0, nobody_s: 1.0, idle_s: 1.0, losses: 2 };
    assert_eq!(following, expected);
}

#[test]
fn position_errors_and_set_distances_in_metres() {
    fn close(got: Option<f64>, expected: f64) {
        assert!((got.unwrap() - expected).abs() < 1e-12, "{got:?} {expected}");
    }

    let scene = one_frame(vec![truth(1, 0.0), truth(2, 5.0)], vec![report(1, 0.3), report(2, 5.4)]);
    let scores = Scores::measure(&scene, Similarity::Metres).unwrap();
    close(scores.position_error_mean_m, 0.35);
    close(scores.position_error_rms_m, (0.125_f64).sqrt());
    close(scores.position_error_p95_m, 0.395);
    close(scores.position_error_max_m, 0.4);
    close(scores.motp, 0.65);
    close(scores.ospa, (0.125_f64).sqrt());
    close(scores.gospa, 0.5);
    // A pair 2 m apart counts as long as the cutoff is wider.
    let apart = one_frame(vec![truth(1, 0.0)], vec![report(1, 2.0)]);
    let wide = SetDistance { cutoff: 3.0, order: 1.0 };
    let tally = Tally::measure(&apart, &Similarity::Metres.into(), &wide).unwrap();
    close(tally.sets.ospa(), 2.0);
    assert_eq!(tally.clear.tp, 0);
}

#[test]
fn bad_input_is_named() {
    fn error(scene: &Sequence, similarity: Similarity) -> EvalError {
        Prepared::new(scene, &similarity.into()).unwrap_err()
    }

    let twice = one_frame(vec![truth(1, 0.0), truth(1, 3.0)], vec![]);
    let text = error(&twice, Similarity::Iou).to_string();
    assert!(text.contains("`one`, frame 1") && text.contains("truth id 1 occurs twice"), "{text}");

    let nowhere = one_frame(vec![], vec![Report { floor_m: None, ..report(4, 0.0) }]);
    assert!(Prepared::new(&nowhere, &Comparison::default()).is_ok());
    let text = error(&nowhere, Similarity::Metres).to_string();
    assert!(text.contains("track id 4 has no floor position"), "{text}");

    for bad in [
        Report { region: Some(Region::new(f64::NAN, 0.0, 1.0, 1.0)), ..report(4, 0.0) },
        Report { region: Some(Region::new(0.0, 0.0, 1.0, f64::INFINITY)), ..report(4, 0.0) },
        Report { floor_m: Some([f64::INFINITY, 0.0]), ..report(4, 0.0) },
        Report { score: f64::NAN, ..report(4, 0.0) },
    ] {
        let scene = one_frame(vec![], vec![bad]);
        assert!(matches!(error(&scene, Similarity::Iou), EvalError::NotFinite { id: 4, .. }));
    }

    let mut scene = sequence(&[(&[], &[]), (&[], &[])]);
    scene.frames[0].stamp_ns = 2 * SECOND_NS;
    assert!(matches!(error(&scene, Similarity::Iou), EvalError::OutOfOrder { frame: 2, .. }));
}

#[test]
fn the_flat_object_carries_the_names_of_the_field() {
    let scores =
        Scores::measure(&one_frame(vec![truth(1, 0.0)], vec![report(1, 0.0)]), Similarity::Iou);
    let json = serde_json::to_value(scores.unwrap()).unwrap();
    let object = json.as_object().unwrap();
    for name in [
        "HOTA",
        "DetA",
        "AssA",
        "LocA",
        "MOTA",
        "MOTP",
        "IDF1",
        "IDP",
        "IDR",
        "IDSW",
        "inherited_ids",
        "FP",
        "FN",
        "TP",
        "Frag",
        "MT",
        "PT",
        "ML",
        "LAMR",
        "OSPA",
        "GOSPA",
        "position_error_mean_m",
    ] {
        assert!(object.contains_key(name), "{name}");
    }
    assert!(object.values().all(|value| value.is_number() || value.is_null()));
}

#[test]
fn what_is_counted_adds_up_field_by_field() {
    fn clear(n: u64) -> Clear {
        Clear {
            tp: n,
            fn_: 2 * n,
            fp: 3 * n,
            id_switches: 5 * n,
            inherited_ids: 23 * n,
            fragmentations: 7 * n,
            mostly_tracked: 11 * n,
            partly_tracked: 13 * n,
            mostly_lost: 17 * n,
            similarity_sum: n as f64,
            frames: 19 * n,
        }
    }

    fn identity(n: u64) -> Identity {
        Identity { tp: n, fn_: 2 * n, fp: 3 * n }
    }

    fn sets(n: u64) -> SetTally {
        let one = n as f64;
        let parts = GospaParts { location: 3.0 * one, missed: 4.0 * one, false_: 5.0 * one };
        SetTally { ospa_sum: one, gospa_sum: 2.0 * one, parts, frames: n }
    }

    fn times(numbers: &[f64], n: u64) -> Times {
        Times {
            confirm_s: numbers.to_vec(),
            never_confirmed: n,
            reacquire_s: numbers.iter().map(|t| -t).collect(),
            never_reacquired: 2 * n,
            wrong_person_s: 3.0 * n as f64,
            duration_s: 4.0 * n as f64,
        }
    }

    fn detections(scores: &[f64], n: u64) -> DetectionTally {
        DetectionTally {
            verdicts: scores.iter().map(|&score| Verdict { score, right: true }).collect(),
            truths: n,
            images: 3 * n,
        }
    }

    fn tally(n: u64) -> Tally {
        Tally { truths: n, reports: 2 * n, truth_ids: 3 * n, track_ids: 5 * n, ..Tally::default() }
    }

    assert_eq!(Clear::combine([&clear(1), &clear(2)]), clear(3));
    assert_eq!(Identity::combine([&identity(1), &identity(2)]), identity(3));
    let both = SetTally::combine([&sets(1), &sets(2)]);
    assert_eq!(both, sets(3));
    assert_eq!((both.ospa(), both.gospa()), (Some(1.0), Some(2.0)));
    let mut hota = [Hota::default(), Hota::default(), Hota::default()];
    for (n, of) in (1_u64..).zip(&mut hota) {
        for (step, level) in (1..).zip(&mut of.levels) {
            let one = step * n;
            *level = HotaLevel {
                tp: one,
                fn_: 2 * one,
                fp: 3 * one,
                similarity_sum: (4 * one) as f64,
                association_sum: (5 * one) as f64,
                association_recall_sum: (6 * one) as f64,
                association_precision_sum: (7 * one) as f64,
            };
        }
    }
    assert_eq!(Hota::combine([&hota[0], &hota[1]]), hota[2]);
    assert_eq!(Times::combine([&times(&[1.0], 1), &times(&[2.0], 2)]), times(&[1.0, 2.0], 3));
    let both = DetectionTally::combine([&detections(&[0.5], 1), &detections(&[0.6], 2)]);
    assert_eq!(both, detections(&[0.5, 0.6], 3));
    assert_eq!(Tally::combine([&tally(1), &tally(2)]), tally(3));
}

#[test]
fn four_fifths_are_partly_tracked_and_so_is_one_fifth() {
    // Of five people each in five frames, person n is found in n frames.
    let truths: Vec<(i64, f64)> = (0..6).map(|id| (id, 5.0 * id as f64)).collect();
    let frames: Vec<Vec<(i64, f64)>> = (0..5)
        .map(|frame| truths.iter().copied().filter(|(id, _)| *id > frame).collect())
        .collect();
    let scene: Vec<(Places<'_>, Places<'_>)> =
        frames.iter().map(|reports| (&truths[..], &reports[..])).collect();
    let (clear, _) = Clear::measure(&prepared(&sequence(&scene)));
    assert_eq!((clear.mostly_tracked, clear.partly_tracked, clear.mostly_lost), (1, 4, 1));
    assert_eq!((clear.recall(), clear.precision(), clear.fp_per_frame()), (0.5, 1.0, 0.0));
}

#[test]
fn rectangles_meet_cover_and_have_areas() {
    let a = Region::new(0.0, 2.0, 10.0, 20.0);
    let b = Region::new(5.0, 12.0, 10.0, 30.0);
    assert_eq!((a.area(), b.area(), a.intersection(&b)), (200.0, 300.0, 50.0));
    assert_eq!((a.iou(&b), a.covered_by(&b), b.covered_by(&a)), (50.0 / 450.0, 0.25, 50.0 / 300.0));
    let beside = Region::new(10.0, 2.0, 10.0, 20.0);
    assert_eq!((a.intersection(&beside), a.iou(&beside), a.iou(&a)), (0.0, 0.0, 1.0));
    let flat = Region::new(1.0, 3.0, 0.0, 5.0);
    assert_eq!((flat.iou(&a), flat.covered_by(&a), flat.iou(&flat)), (0.0, 0.0, 0.0));
    for (width, height, has_area) in
        [(1.0, 1.0, true), (0.0, 1.0, false), (1.0, 0.0, false), (-1.0, -1.0, false)]
    {
        assert_eq!(Region::new(0.0, 0.0, width, height).has_area(), has_area);
    }
}

#[test]
fn alike_on_the_floor_is_what_is_left_of_a_metre() {
    for (x, y, expected) in [(0.0, 0.0, 1.0), (0.0, 0.25, 0.75), (3.0, 4.0, 0.0), (0.3, 0.4, 0.5)] {
        let there = Report { floor_m: Some([x, y]), ..report(1, 0.0) };
        let alike = Similarity::Metres.between(&truth(1, 0.0), &there);
        assert!((alike - expected).abs() < 1e-12, "{alike} {expected}");
    }
}

#[test]
fn what_makes_no_sense_is_absent() {
    fn scores(truths: Vec<Truth>, reports: Vec<Report>) -> Scores {
        Scores::measure(&one_frame(truths, reports), Similarity::Iou).unwrap()
    }

    let unseen = scores(vec![truth(1, 0.0)], vec![]);
    assert_eq!((unseen.mota, unseen.recall, unseen.lamr), (Some(0.0), Some(0.0), Some(1.0)));
    assert_eq!((unseen.precision, unseen.motp, unseen.fp_per_frame), (None, None, Some(0.0)));
    let invented = scores(vec![], vec![report(1, 0.0)]);
    assert_eq!((invented.mota, invented.idf1, invented.lamr), (None, None, None));
    assert_eq!((invented.precision, invented.fp_per_frame), (Some(0.0), Some(1.0)));
    assert_eq!((invented.average_precision, invented.hota, invented.recall), (None, None, None));
}

#[test]
fn a_detection_takes_the_truth_it_fits_best() {
    // The surer one fits both people; the other one only the first.
    let mut scene =
        one_frame(vec![truth(1, 0.0), truth(2, 0.3)], vec![report(1, 0.3), report(2, -0.2)]);
    scene.frames[0].reports[0].score = 0.9;
    let tally = DetectionTally::measure(&scene, Similarity::Iou, 0.5);
    assert_eq!(tally.verdicts.iter().filter(|verdict| verdict.right).count(), 2);
    assert_eq!((tally.truths, tally.images), (2, 1));
    // Half a metre away is near enough, and excuses on the floor, too.
    let half = one_frame(vec![truth(1, 0.0)], vec![report(1, 0.5)]);
    assert!(DetectionTally::measure(&half, Similarity::Metres, 0.5).verdicts[0].right);
    let ignored = Truth { role: Role::Ignored, ..truth(1, 0.0) };
    for (place, left) in [(0.5, 0), (0.6, 1)] {
        let scene = one_frame(vec![ignored], vec![report(1, place)]);
        let tally = DetectionTally::measure(&scene, Similarity::Metres, 0.5);
        assert_eq!((tally.verdicts.len(), tally.truths), (left, 0));
    }
}

#[test]
fn who_is_followed_by_nothing_known_is_idle() {
    let scene = sequence(&[(&[(1, 0.0)], &[(7, 0.0)]), (&[(1, 0.0)], &[(7, 0.0)])]);
    let prepared = prepared(&scene);
    let (_, matches) = Clear::measure(&prepared);
    let following = Following::measure(&prepared, &matches, 1, &[Some(7)]);
    assert_eq!((following.on_target_s, following.idle_s, following.losses), (1.0, 1.0, 1));
}

#[test]
fn reports_at_the_limits_of_what_is_excused() {
    fn kept(truth_x: f64, ignored: Option<Region>, report_x: f64) -> u64 {
        let mut scene = one_frame(
            vec![Truth { role: Role::Ignored, ..truth(1, truth_x) }],
            vec![report(1, report_x)],
        );
        scene.frames[0].ignore_regions.extend(ignored);
        prepared(&scene).report_count()
    }

    // Half inside of a region that is not annotated, and a little more.
    fn region(x: f64) -> Option<Region> {
        Some(Region::new(x, 0.0, 100.0, 100.0))
    }

    // Intersection over union: 0.5 and a little less.
    assert_eq!((kept(0.0, None, 1.0 / 3.0), kept(0.0, None, 0.34)), (0, 1));
    assert_eq!((kept(50.0, region(5.0), 0.0), kept(50.0, region(4.9), 0.0)), (1, 0));
}

#[test]
fn recall_is_told_apart_by_what_shows_of_a_person() {
    fn view(visible: f64, distance_m: f64) -> Option<View> {
        Some(View { visible, distance_m })
    }

    fn seen(id: i64, x: f64, view: Option<View>) -> Truth {
        Truth { view, ..truth(id, x) }
    }

    let people = vec![
        seen(1, 0.0, view(1.0, 2.0)),
        seen(2, 5.0, view(0.9, 5.0)),
        seen(3, 10.0, view(0.89, 3.0)),
        seen(4, 15.0, view(0.6, 3.0)),
        // In neither figure: most of it is hidden, too far away, not annotated, does not count.
        seen(5, 20.0, view(0.59, 3.0)),
        seen(6, 25.0, view(1.0, 5.1)),
        seen(7, 30.0, None),
        Truth { role: Role::Ignored, ..seen(8, 35.0, view(1.0, 1.0)) },
    ];
    let reports = [2, 3, 4, 5].map(|id| report(id, 5.0 * (id - 1) as f64));
    let sequence = one_frame(people, reports.to_vec());
    let tally = Tally::measure(&sequence, &Similarity::Iou.into(), &SetDistance::default());
    let tally = tally.unwrap();
    assert_eq!((tally.visibility.free.matched, tally.visibility.free.of), (1, 2));
    let partly = tally.visibility.partly_hidden;
    assert_eq!((partly.matched, partly.of), (2, 2));
    let twice = Tally::combine([&tally, &tally]);
    assert_eq!(twice.visibility.free.of, 4);
    let scores = twice.scores();
    assert_eq!((scores.recall_free, scores.recall_partly_hidden), (Some(0.5), Some(1.0)));
    let blind = Scores::measure(&one_frame(vec![truth(1, 0.0)], vec![]), Similarity::Iou).unwrap();
    assert_eq!((blind.recall_free, blind.recall), (None, Some(0.0)));
}
