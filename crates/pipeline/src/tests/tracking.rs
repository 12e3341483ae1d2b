use std::sync::Arc;

use tagalong_core::{Detection, Frame, Images, RgbImage, TrackId};

use super::doubles::{PLAIN, World, frame, person, scored};
use crate::{Fate, FrameReport, Weighing};

fn ids(report: &FrameReport) -> Vec<u32> {
    let mut ids: Vec<u32> = report.tracks.iter().map(|t| t.id.0).collect();
    ids.sort();
    ids
}

fn place_of(report: &FrameReport, id: u32) -> Option<(f64, f64)> {
    let track = report.tracks.iter().find(|t| t.id == TrackId(id))?;
    let position = track.estimate.person.position;
    Some((position.x, position.y))
}

#[test]
fn a_person_is_confirmed_by_the_second_sighting_and_keeps_the_number() {
    let reports = World::of((0..6).map(|_| vec![person(3.0, 0.0)])).run(PLAIN, 6, 0.1);
    let confirmed: Vec<bool> = reports.iter().map(|r| r.tracks[0].confirmed).collect();
    assert_eq!(confirmed, [false, true, true, true, true, true]);
    assert!(reports.iter().all(|r| ids(r) == [1] && r.tracks[0].seen));
    assert_eq!(reports[0].candidates[0].fate, Fate::Started(TrackId(1)));
    assert_eq!(reports[1].candidates[0].fate, Fate::Matched(TrackId(1)));
    assert_eq!(reports[1].nis.len(), 1);
    assert_eq!(reports[5].tracks[0].age, 5);
}

#[test]
fn a_high_score_confirms_at_once() {
    let reports = World::of([vec![scored(4.5, person(3.0, 0.0))]]).run(PLAIN, 1, 0.1);
    assert!(reports[0].tracks[0].confirmed);
}

/// A laser scan has no pixels: two people in one line of sight are not merged by their boxes, and
/// the track's region is where the filter expects the person in the image.
#[test]
fn a_detection_without_a_box_is_tracked_all_the_same() {
    fn boxless(x: f64, y: f64) -> Detection {
        person(x, y).with_image(None)
    }

    fn two() -> Vec<Detection> {
        vec![boxless(3.0, 0.0), boxless(3.6, 0.0)]
    }

    let reports = World::of((0..3).map(|_| two())).run(PLAIN, 3, 0.1);
    assert_eq!(ids(&reports[2]), [1, 2]);
    let track = &reports[2].tracks[0];
    assert!(track.confirmed && track.seen);
    assert_eq!(Some(track.estimate.region), person(3.0, 0.0).rect());
}

#[test]
fn a_filter_of_boxes_receives_no_detection_without_one() {
    let config = PLAIN.replace("'steady'", "'odd'\nconfig = { how = 'boxes' }");
    let boxless = person(5.0, 0.0).with_image(None);
    let reports = World::of([vec![person(3.0, 0.0), boxless]]).run(&config, 1, 0.1);
    assert_eq!(ids(&reports[0]), [1]);
    assert_eq!(reports[0].candidates.len(), 1);
    assert_eq!(reports[0].funnel.count("no image box"), 1);
}

/// Frame 9 shows one person between two who are known, nearer to the right one, in the colour of
/// the left one.
#[test]
fn appearance_says_whose_detection_it_is_where_places_do_not() {
    fn seen(weight: f64) -> Vec<u32> {
        let both = (0..8).map(|_| vec![person(3.0, 0.5), person(3.0, -0.5)]);
        let world = World::of(both.chain([vec![person(3.0, -0.1)]]));
        let config = format!(
            "associator.config.gate = 1e3\nassociator.config.gate_m = 2.0\n{PLAIN}\
             [reidentification]\nremember_s = 9.0\nassociation_weight = {weight:?}\n"
        );
        let mut pipeline = world.pipeline(&config);
        let reports = (1..=9).map(|index| {
            let colour = RgbImage::from_fn(640, 480, |x, _| {
                if x < 320 || index == 9 { [200, 20, 20] } else { [20, 20, 200] }
            });
            let images = Images { colour: Some(Arc::new(colour)), ..Images::default() };
            let blank = frame(index, index as f64 * 0.1);
            let frame = Frame::new(index, blank.stamp, blank.camera, blank.motion, images);
            pipeline.step(&frame).unwrap()
        });
        let last = reports.last().unwrap();
        let is_seen = last.tracks.iter().filter(|track| track.seen);
        is_seen.map(|track| track.id.0).collect::<Vec<_>>()
    }

    let [left, right] = [1, 2];
    assert_eq!(seen(0.0), [right]);
    assert_eq!(seen(50.0), [left]);
}

#[test]
fn tracks_are_reported_near_to_far() {
    let people = vec![person(4.0, 0.0), person(2.0, 0.5), person(3.0, -0.5)];
    let reports = World::of([people]).run(PLAIN, 1, 0.1);
    let x: Vec<f64> = reports[0].tracks.iter().map(|t| t.estimate.person.position.x).collect();
    assert_eq!(x, [2.0, 3.0, 4.0]);
}

#[test]
fn two_people_who_cross_keep_their_numbers() {
    let reports = World::of((0..21).map(|i| {
        let along = 0.1 * f64::from(i) - 1.0;
        vec![person(3.0, along), person(3.5, -along)]
    }))
    .run(PLAIN, 21, 0.1);
    let first = &reports[0];
    let last = &reports[20];
    assert_eq!(ids(last), [1, 2]);
    for id in [1, 2] {
        let before = place_of(first, id).unwrap();
        let after = place_of(last, id).unwrap();
        assert_eq!(before.0, after.0, "track {id} stays in its lane");
        assert!((before.1 + after.1).abs() < 1e-9, "track {id} crossed over");
    }
}

/// One person stands 2 m ahead; the other walks behind and is not seen there.
fn behind_somebody(somebody: bool) -> Vec<FrameReport> {
    World::of((0..50).map(|i| {
        let y = 1.3 - 0.05 * f64::from(i);
        let visible = y.abs() > 0.45;
        let mut people: Vec<Detection> = visible.then(|| person(4.0, y)).into_iter().collect();
        if somebody {
            people.insert(0, person(2.0, 0.0));
        }
        people
    }))
    .run(PLAIN, 50, 0.1)
}

#[test]
fn a_person_hidden_behind_another_coasts_and_keeps_the_number() {
    fn hidden(r: &FrameReport) -> bool {
        r.tracks.iter().any(|t| t.occluded && !t.seen)
    }

    let reports = behind_somebody(true);
    assert!(reports.iter().all(|r| ids(r) == [1, 2]), "no track ends, none is added");
    assert!(reports.iter().filter(|r| hidden(r)).count() >= 10);
    assert!(reports.iter().all(|r| r.tracks.iter().all(|t| !(t.occluded && t.seen))));
}

/// Standard deviations, along and across, of the measurement of a person 4 m ahead in the last of
/// some frames.
fn spread_of_second(how: &str, frames: Vec<Vec<Detection>>) -> (f64, f64) {
    let many = frames.len() as u64;
    let reports = World::of(frames).run(&format!("{how}\n{PLAIN}"), many, 0.1);
    let seen = reports
        .last()
        .unwrap()
        .candidates
        .iter()
        .find(|c| c.fate == Fate::Matched(TrackId(2)))
        .unwrap();
    let covariance = &seen.detection.covariance;
    (covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt())
}

#[test]
fn who_is_half_hidden_is_seen_aside_also_by_one_who_is_too_near_to_be_found() {
    let how = "occlusion.body_width_m = 0.5";
    let [off, beside, hidden] = [("", 0.4), (how, 1.2), (how, 0.4)].map(|(how, y)| {
        let mut moments = vec![vec![person(2.0, 0.0), person(4.0, y)]; 3];
        moments.push(vec![person(4.0, y)]);
        spread_of_second(how, moments)
    });
    assert_eq!((off, beside), ((0.1, 0.1), (0.1, 0.1)));
    let (along, across) = hidden;
    assert!((0.13..0.27).contains(&across) && along < 0.11, "{along} {across}");
}

#[test]
fn a_person_who_should_be_visible_and_is_not_ends_soon() {
    let reports = behind_somebody(false);
    assert_eq!(ids(&reports[49]), [2], "the track ended, a new one was started");
    let ended: Vec<u32> = reports.iter().flat_map(|r| &r.ended).map(|id| id.0).collect();
    assert_eq!(ended, [1]);
    assert_eq!(reports.iter().map(|r| r.funnel.count("track: not seen")).sum::<u64>(), 1);
}

#[test]
fn a_person_who_left_the_image_is_kept_a_little_longer_but_not_seen() {
    let reports = World::of(
        (0..50).map(|i| if i < 12 { vec![person(2.0, 0.12 * f64::from(i))] } else { vec![] }),
    )
    .run(PLAIN, 50, 0.1);
    assert!(!reports[20].tracks[0].seen && !reports[20].tracks[0].occluded);
    let last = reports.iter().rposition(|r| !r.tracks.is_empty()).unwrap();
    assert!(last > 11 + 15 && last < 11 + 25, "{last}");
    assert_eq!(reports.iter().map(|r| r.funnel.count("track: left the image")).sum::<u64>(), 1);
}

#[test]
fn a_track_that_was_never_confirmed_dies_after_two_misses() {
    let reports = World::of([vec![person(3.0, 0.0)]]).run(PLAIN, 3, 0.1);
    let alive: Vec<usize> = reports.iter().map(|r| r.tracks.len()).collect();
    assert_eq!(alive, [1, 1, 0]);
    assert_eq!(reports[2].funnel.count("track: not confirmed"), 1);
}

#[test]
fn three_misses_are_needed_however_slow_the_log_is() {
    let reports = World::of((0..8).map(|i| if i < 4 { vec![person(3.0, 0.0)] } else { vec![] }))
        .run(&format!("{PLAIN}[clock]\nreset_gap_s = 5.0\n"), 8, 1.0);
    let alive: Vec<usize> = reports.iter().map(|r| r.tracks.len()).collect();
    assert_eq!(alive, [1, 1, 1, 1, 1, 1, 0, 0]);
}

#[test]
fn the_gate_grows_with_the_time_between_frames() {
    fn walk(i: i32) -> Vec<Detection> {
        vec![person(3.0, -1.5 + f64::from(i))]
    }

    fn numbers(dt_s: f64) -> usize {
        ids(&World::of((0..3).map(walk)).run(PLAIN, 3, dt_s)[2]).len()
    }

    fn wide(gate_m: f64) -> String {
        format!("associator.config.gate = 1e3\nassociator.config.gate_m = {gate_m}\n{PLAIN}")
    }

    let slow = World::of((0..3).map(walk)).run(&wide(0.3), 3, 0.5);
    assert_eq!(ids(&slow[2]), [1], "1 m in half a second");
    let fast = World::of((0..3).map(walk)).run(&wide(0.3), 3, 0.1);
    assert!(ids(&fast[2]).len() > 1, "nobody runs at 10 m/s");
    assert!(numbers(0.1) > 1);
}

#[test]
fn what_is_dropped_is_counted_under_the_name_of_the_test() {
    let config = format!("{PLAIN}\n[[verifiers]]\nplugin = 'choosy'");
    let people = vec![
        scored(-1.0, person(3.0, -0.3)),
        person(3.0, 0.6),
        person(2.0, -0.2),
        scored(0.5, person(2.05, -0.22)),
    ];
    let report = World::of([people]).run(&config, 1, 0.1).remove(0);
    let fates: Vec<Fate> = report.candidates.iter().map(|c| c.fate).collect();
    let expected = [
        Fate::Dropped("score"),
        Fate::Dropped("verifier"),
        Fate::Started(TrackId(1)),
        Fate::Dropped("same person"),
    ];
    assert_eq!(fates, expected);
    for test in ["score", "verifier", "same person"] {
        assert_eq!(report.funnel.count(test), 1, "{test}");
    }
}

#[test]
fn the_detectors_own_tests_are_in_the_funnel() {
    let config = PLAIN.replace("'script'", "'script'\nconfig = { how = 'picky' }");
    let report = World::of([vec![]]).run(&config, 1, 0.1).remove(0);
    assert_eq!(report.funnel.count("too small"), 2);
}

#[test]
fn the_silence_of_a_detector_on_anothers_frame_is_no_miss() {
    let config = "
        [[detectors]]
        plugin = 'script'
        every = 2
        [[detectors]]
        plugin = 'script'
        every = 2
        offset = 1
        config = { script = 1 }
        [filter]
        plugin = 'steady'
        [manager.config]
        drop_after_s = 0.05
        drop_after_misses = 1
        tentative_misses = 1
    ";
    let world = World::default();
    for index in (1..20).step_by(2) {
        world.show(0, index, vec![person(3.0, 0.0)]);
    }
    let reports = world.run(config, 20, 0.1);
    assert!(reports.iter().all(|r| ids(r) == [1]));
    assert!(reports[4].tracks[0].confirmed, "3 of 3 looks, not 3 of 5 frames");
    let asked = world.asked.lock().unwrap();
    let turns: Vec<(usize, u64)> = asked.iter().map(|a| (a.0, a.1)).take(4).collect();
    assert_eq!(turns, [(0, 1), (1, 2), (0, 3), (1, 4)]);
}

const FOLLOWING: &str = "
    [[detectors]]
    plugin = 'script'
    roles = ['discover', 'track']
    [filter]
    plugin = 'steady'
";

#[test]
fn a_followed_person_who_is_discovered_again_stays_one() {
    let reports = World::of((0..8).map(|_| vec![person(3.0, 0.0)])).run(FOLLOWING, 8, 0.1);
    assert!(reports.iter().all(|r| ids(r) == [1]));
    assert_eq!(reports[3].candidates.len(), 2);
    assert_eq!(reports[3].funnel.count("same person"), 1);
}

/// One script discovers, another one tracks.
const TWO_SCRIPTS: &str = "
    [[detectors]]
    plugin = 'script'
    roles = ['discover']
    [[detectors]]
    plugin = 'script'
    roles = ['track']
    config = { script = 1 }
    [filter]
    plugin = 'steady'
";

#[test]
fn the_better_sighting_of_a_followed_person_is_kept() {
    let world = World::of((0..4).map(|_| vec![scored(2.0, person(3.0, 0.0))]));
    for index in 2..5 {
        world.show(1, index, vec![person(3.1, 0.0)]);
    }
    let reports = world.run(TWO_SCRIPTS, 4, 0.1);
    assert_eq!(place_of(&reports[3], 1), Some((3.0, 0.0)));
    assert_eq!(ids(&reports[3]), [1]);
}

#[test]
fn a_search_for_one_person_does_not_steal_anothers_sighting() {
    // Two people side by side; then one is gone, and the searches for both tracks find the other
    // one. Track 1 is the nearer one and searches first.
    fn both() -> Vec<Detection> {
        vec![person(2.9, 0.2), person(3.0, -0.2)]
    }

    fn one() -> Vec<Detection> {
        vec![person(3.0, -0.2)]
    }

    let world = World::of((0..10).map(|i| if i < 5 { both() } else { one() }));
    let reports = world.run(FOLLOWING, 10, 0.1);
    assert_eq!(ids(&reports[4]), [1, 2]);
    for report in &reports[5..] {
        let seen: Vec<u32> = report.tracks.iter().filter(|t| t.seen).map(|t| t.id.0).collect();
        assert_eq!(seen, [2], "frame {}", report.index);
    }
}

#[test]
fn a_search_near_a_track_starts_nobody() {
    let world = World::of([vec![person(3.0, 0.0)], vec![]]);
    world.show(1, 2, vec![person(3.0, 0.0), person(3.0, 0.45)]);
    let report = world.run(TWO_SCRIPTS, 2, 0.1).remove(1);
    assert_eq!(ids(&report), [1]);
}

#[test]
fn nobody_looks_for_a_person_behind_one_who_was_found() {
    let far_config = format!("associator.config.gate = 1e3\n{FOLLOWING}");
    let world = World::of((0..8).map(|i| {
        let near = person(2.0, 0.0);
        if i < 5 { vec![near, person(4.0, 0.9)] } else { vec![near, person(4.0, 0.1)] }
    }));
    world.run(&far_config, 8, 0.1);
    let asked = world.asked.lock().unwrap();
    assert!(asked.contains(&(0, 4, Some(TrackId(2)))));
    assert!(asked.contains(&(0, 8, Some(TrackId(1)))));
    assert!(!asked.contains(&(0, 8, Some(TrackId(2)))), "hidden behind track 1");
}

#[test]
fn a_follower_that_looks_elsewhere_is_gated() {
    let config = FOLLOWING.replace("'track']", "'track']\nconfig = { how = 'far' }");
    let world = World::of([vec![person(3.0, 0.0)], vec![person(3.0, 0.0), person(4.5, 1.0)]]);
    let report = world.run(&config, 2, 0.1).remove(1);
    assert_eq!(report.funnel.count("gate"), 1);
    assert_eq!(ids(&report), [1, 2]);
}

#[test]
fn one_no_of_a_verifier_kills_no_track() {
    let config = format!("{PLAIN}\n[[verifiers]]\nplugin = 'choosy'\nconfig = {{ how = 'once' }}");
    let reports = World::of((0..12).map(|_| vec![person(3.0, 0.0)])).run(&config, 12, 0.1);
    assert!(reports.iter().all(|r| ids(r) == [1]));
    assert!(reports[7].tracks[0].score < reports[6].tracks[0].score);
}

#[test]
fn verifiers_are_not_asked_about_the_sightings_of_a_detector_that_goes_without() {
    let doubted = World::of((0..3).map(|_| vec![person(3.0, 0.3)]));
    for (verify, started) in [(true, vec![]), (false, vec![1])] {
        let config = PLAIN.replace("'script'", &format!("'script'\nverify = {verify}"));
        let config = format!("{config}\n[[verifiers]]\nplugin = 'choosy'");
        assert_eq!(ids(&doubted.run(&config, 3, 0.1)[2]), started, "{verify}");
    }
}

#[test]
fn a_track_that_is_doubted_again_and_again_ends() {
    let config = format!("{PLAIN}\n[[verifiers]]\nplugin = 'choosy'");
    let reports = World::of((0..25).map(|i| vec![person(3.0, if i < 5 { -0.02 } else { 0.02 })]))
        .run(&config, 25, 0.1);
    assert!(reports[4].tracks[0].confirmed);
    assert!(reports[24].tracks.is_empty());
}

#[test]
fn two_tracks_of_one_person_become_the_older_one() {
    let config = format!("{PLAIN}\n[merge]\nduplicate_m = 0.3");
    let reports = World::of((0..12).map(|i| {
        let apart = (0.8 - 0.1 * f64::from(i)).max(0.28);
        vec![person(3.0, 0.0), person(3.0, apart)]
    }))
    .run(&config, 12, 0.1);
    assert_eq!(ids(&reports[2]), [1, 2]);
    let ended: Vec<u32> = reports.iter().flat_map(|r| &r.ended).map(|id| id.0).collect();
    assert!(ended.contains(&2) && !ended.contains(&1), "{ended:?}");
    assert!(reports.iter().map(|r| r.funnel.count("track: duplicate")).sum::<u64>() >= 1);
}

#[test]
fn nobody_starts_where_somebody_is_seen() {
    let config = format!("{PLAIN}\n[merge]\nduplicate_m = 0.3");
    let one = vec![person(3.0, 0.0)];
    let frames = [one.clone(), vec![person(3.0, 0.0), person(3.0, 0.28)], one];
    let reports = World::of(frames).run(&config, 3, 0.1);
    assert!(reports.iter().all(|report| ids(report) == [1]));
    assert_eq!(reports[1].funnel.count("tracked already"), 1);
}

#[test]
fn too_many_detections_and_tracks_are_dropped_lowest_score_first() {
    let crowd = (0..8).map(|i| scored(f64::from(i), person(3.0, f64::from(i) * 0.4 - 1.4)));
    let config = format!("merge.max_detections = 6\nmerge.max_tracks = 4\n{PLAIN}");
    let report = World::of([crowd.collect()]).run(&config, 1, 0.1).remove(0);
    assert_eq!(report.funnel.count("too many detections"), 2);
    assert_eq!(report.funnel.count("track: too many"), 2);
    let scores: Vec<f64> = report.tracks.iter().map(|t| t.score).collect();
    assert!(scores.len() == 4 && scores.iter().all(|s| *s >= 4.0), "{scores:?}");
}

#[test]
fn overlap_in_the_image_can_decide_who_is_who() {
    let config = format!("associator.config.cost = 'overlap'\n{PLAIN}");
    let reports = World::of((0..8).map(|i| {
        let y = 0.04 * f64::from(i);
        vec![person(3.0, y - 1.0), person(3.0, y)]
    }))
    .run(&config, 8, 0.1);
    assert!(reports.iter().all(|r| ids(r) == [1, 2]));
    let jump = World::of([vec![person(3.0, 0.0)], vec![person(3.0, 0.6)]]);
    assert_eq!(ids(&jump.run(&config, 2, 0.1)[1]), [1, 2], "no overlap, no match");
}

#[test]
fn the_same_run_gives_the_same_reports() {
    fn walk(i: i32) -> Vec<Detection> {
        let y = 0.1 * f64::from(i % 7);
        vec![person(3.0, y), person(4.0, -y), person(2.0, 1.0 - y), scored(-1.0, person(5.0, y))]
    }

    fn run() -> String {
        let reports = World::of((0..20).map(walk)).run(FOLLOWING, 20, 0.1);
        let timeless = reports.into_iter().map(|r| FrameReport {
            timings: vec![],
            plugin_timings: vec![],
            weighing: Weighing { ms: 0.0, ..r.weighing },
            ..r
        });
        format!("{:?}", timeless.collect::<Vec<_>>())
    }

    assert_eq!(run(), run());
}

#[test]
fn all_stages_are_timed() {
    let world = World::of([vec![]]);
    let mut pipeline = world.pipeline(PLAIN);
    let report = pipeline.step(frame(1, 0.0)).unwrap();
    let timed: Vec<&str> = report.timings.iter().map(|t| t.0).collect();
    assert_eq!(timed, pipeline.stage_names());
}

/// A coat stand: doubted in most frames, believed in one of four.
fn first_track_of_a_coat_stand(lifecycle: &str) -> Option<usize> {
    fn score(i: i32) -> f64 {
        if i % 4 == 3 { 1.5 } else { -2.0 }
    }

    let world = World::of((0..20).map(|i| vec![scored(score(i), person(3.0, 0.0))]));
    let reports = world.run(&format!("{PLAIN}[manager.config]\n{lifecycle}"), 20, 0.1);
    reports.iter().position(|report| !report.tracks.is_empty())
}

#[test]
fn where_somebody_was_rejected_one_look_starts_no_track() {
    assert_eq!(first_track_of_a_coat_stand(""), Some(3));
    assert_eq!(first_track_of_a_coat_stand("doubt_s = 3.0"), None);
}

#[test]
fn who_comes_to_a_doubted_place_is_believed_a_little_later() {
    fn score(i: i32) -> f64 {
        if i < 10 { -3.0 } else { 2.5 }
    }

    let world = World::of((0..20).map(|i| vec![scored(score(i), person(3.0, 0.0))]));
    let reports = world.run(&format!("{PLAIN}[manager.config]\ndoubt_s = 3.0"), 20, 0.1);
    let first = reports.iter().position(|report| !report.tracks.is_empty()).unwrap();
    assert!((11..=13).contains(&first), "{first}");
    assert_eq!(reports[10].funnel.count("doubt"), 1);
}

/// Reports with an associator chosen by its name.
fn associated(how: &str, frames: u64) -> Vec<FrameReport> {
    let associator =
        format!("[associator]\nplugin = 'weighing'\nconfig = {{ how = '{how}' }}\n{PLAIN}");
    World::of((0..frames).map(|_| vec![person(3.0, 0.0)])).run(&associator, frames, 0.1)
}

#[test]
fn a_track_that_is_probably_missed_is_missed() {
    fn seen(how: &str) -> bool {
        associated(how, 2)[1].tracks[0].seen
    }

    assert!(seen("1.0") && seen("0.6") && !seen("0.4"));
    let ended = associated("0.4", 9).iter().any(|report| !report.ended.is_empty());
    assert!(ended, "never confirmed");
}

#[test]
fn pairs_that_cannot_be_are_counted_and_form_no_match() {
    let reports = associated("impossible", 2);
    assert_eq!(reports[1].funnel.count("association not possible"), 3);
    assert!(reports[1].candidates.iter().all(|c| !matches!(c.fate, Fate::Matched(_))));
}
