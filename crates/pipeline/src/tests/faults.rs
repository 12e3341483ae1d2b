use std::collections::BTreeSet;

use proptest::prelude::*;
use tagalong_core::{Detection, Reason, WheelSpeeds};

use super::doubles::{PLAIN, World, frame, person, scored};
use crate::{FrameReport, StepError};

fn one_person() -> World {
    World::of((0..10).map(|_| vec![scored(5.0, person(3.0, 0.0))]))
}

fn failure(config: &str) -> StepError {
    one_person().pipeline(config).step(frame(1, 0.1)).unwrap_err()
}

fn with(how: &str, of: &str) -> String {
    match of {
        "script" => PLAIN.replace("'script'", &format!("'script'\nconfig = {{ how = '{how}' }}")),
        "odd" => PLAIN.replace("'steady'", &format!("'odd'\nconfig = {{ how = '{how}' }}")),
        "choosy" => {
            format!("{PLAIN}\n[[verifiers]]\nplugin = 'choosy'\nconfig = {{ how = '{how}' }}")
        }
        _ => format!("{PLAIN}\n[controller]\nplugin = 'drive'\nconfig = {{ how = '{how}' }}"),
    }
}

#[test]
fn a_panic_names_the_plugin_and_the_frame() {
    for (of, words) in [
        ("script", "out of ideas"),
        ("odd", "cannot start 1"),
        ("choosy", "no"),
        ("drive", "which way?"),
    ] {
        let error = failure(&with("panic", of));
        assert!(matches!(error, StepError::Panic { .. }), "{error}");
        let text = error.to_string();
        assert!(text.starts_with(&format!("frame 1: `{of}` panicked: {words}")), "{text}");
    }
}

#[test]
fn a_failed_pipeline_stays_stopped() {
    let mut pipeline = one_person().pipeline(&with("panic", "script"));
    assert_eq!(pipeline.step(frame(1, 0.1)).unwrap_err().frame(), 1);
    let again = pipeline.step(frame(2, 0.2)).unwrap_err();
    assert_eq!(again, StepError::Stopped { frame: 1 });
}

#[test]
fn a_missing_image_is_named_with_who_needs_it() {
    let text = failure(&with("depth", "script")).to_string();
    assert_eq!(text, "frame 1: `script` needs depth images, which this frame does not have");
    assert!(failure(&with("fail", "choosy")).to_string().contains("`choosy` has no opinion"));
}

#[test]
fn detections_that_are_not_finite_are_dropped() {
    let mut odd = person(3.0, 0.0);
    odd.position.x = f64::NAN;
    let mut negative = person(3.0, 0.0);
    negative.covariance[(1, 1)] = -1.0;
    let people = vec![odd, negative, scored(f64::INFINITY, person(3.0, 0.0)), person(2.0, 0.0)];
    let report = World::of([people]).run(PLAIN, 1, 0.1).remove(0);
    assert_eq!(report.funnel.count("detection not finite"), 3);
    assert_eq!(report.tracks.len(), 1);
}

#[test]
fn a_margin_that_is_not_finite_drops_the_candidate() {
    let report = one_person().run(&with("nan", "choosy"), 1, 0.1).remove(0);
    assert_eq!(report.funnel.count("verifier not finite"), 1);
    assert!(report.candidates.is_empty() && report.tracks.is_empty());
}

#[test]
fn estimates_that_are_not_finite_end_their_tracks_and_never_leave() {
    for how in ["nan", "negative", "forgets"] {
        let reports = one_person().run(&with(how, "odd"), 4, 0.1);
        assert!(reports.iter().all(|r| r.tracks.is_empty()), "{how}");
        assert!(reports.iter().all(|r| r.funnel.count("track: estimate not finite") == 1));
        let mut ended: Vec<_> = reports.iter().flat_map(|r| r.ended.clone()).collect();
        ended.dedup();
        assert_eq!(ended.len(), 4, "a number is not used twice");
    }
}

#[test]
fn support_of_a_track_that_does_not_exist_is_counted() {
    let reports = one_person().run(&with("", "odd"), 2, 0.1);
    assert_eq!(reports[1].funnel.count("support of an unknown track"), 1);
    assert!(reports.iter().all(|r| r.nis.is_empty()));
}

#[test]
fn what_the_filter_does_not_support_was_not_seen() {
    let world = World::of((0..3).map(|_| vec![person(3.0, 1.0)]));
    let reports = world.run(&with("", "odd"), 2, 0.1);
    assert_eq!(reports[1].funnel.count("filter"), 1);
    assert!(!reports[1].tracks[0].seen);
}

fn commands(reports: &[FrameReport]) -> Vec<WheelSpeeds> {
    reports.iter().filter_map(|r| r.command).map(|command| command.wheels).collect()
}

#[test]
fn commands_are_limited_and_keep_their_curvature() {
    let reports = one_person().run(&with("", "drive"), 2, 0.1);
    let [first, second] = commands(&reports)[..] else { panic!("two commands") };
    for WheelSpeeds { left, right } in [first, second] {
        assert!((right / left - 2.0).abs() < 1e-9 && right <= 0.9, "{left} {right}");
    }
    assert!(second.left > first.left);
    assert_eq!(reports[1].target, Some(reports[1].tracks[0].id));
}

#[test]
fn a_command_that_is_not_finite_is_a_stop() {
    let reports = one_person().run(&with("nan", "drive"), 2, 0.1);
    assert_eq!(commands(&reports), [WheelSpeeds::STOP; 2]);
    assert_eq!(reports[0].funnel.count("command not finite"), 1);
}

#[test]
fn without_a_target_the_robot_stands_and_a_lost_one_is_not_replaced() {
    let empty = World::of([vec![]]).run(&with("", "drive"), 1, 0.1);
    assert_eq!((empty[0].target, commands(&empty)), (None, vec![WheelSpeeds::STOP]));
    let reports = World::of((0..30).map(|i| {
        let first = (i < 3).then(|| scored(5.0, person(2.0, 0.0)));
        first.into_iter().chain([scored(5.0, person(4.0, 0.9))]).collect()
    }))
    .run(&with("", "drive"), 30, 0.1);
    assert_eq!(reports[0].target.map(|id| id.0), Some(1));
    assert_eq!(reports[29].target, None);
    let last = reports[29].command.unwrap();
    assert_eq!((last.wheels, last.reason), (WheelSpeeds::STOP, Reason::NoTarget));
    assert!(reports[29].tracks[0].confirmed);
}

fn any_detection() -> impl Strategy<Value = Detection> {
    let variance = prop_oneof![4 => 1e-4..2.0f64, 1 => any::<f64>()];
    (any_number(), any_number(), any_number(), variance).prop_map(|(x, y, score, variance)| {
        let known = scored(score, person(x, y));
        known.with_covariance(nalgebra::Matrix3::identity() * variance)
    })
}

/// A number that is mostly sensible.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![8 => -6.0..8.0f64, 1 => Just(0.0), 1 => any::<f64>()]
}

proptest! {
    #[test]
    fn whatever_detectors_say_the_report_is_sane(
        frames in prop::collection::vec(prop::collection::vec(any_detection(), 0..6), 1..20),
        steps_s in prop::collection::vec(-0.3..1.0f64, 20),
    ) {
        let world = World::default();
        let config = "
            [[detectors]]
            plugin = 'script'
            roles = ['track', 'discover']
            [filter]
            plugin = 'steady'
            [controller]
            plugin = 'drive'
        ";
        let mut pipeline = world.pipeline(config);
        let mut t_s = 10.0;
        let mut ended = BTreeSet::new();
        for (index, (detections, step_s)) in (1..).zip(frames.into_iter().zip(steps_s)) {
            world.show(0, index, detections);
            t_s += step_s;
            let report = pipeline.step(frame(index, t_s)).unwrap();
            prop_assert!(report.tracks.iter().all(|t| t.estimate.is_sane() && t.score.is_finite()));
            prop_assert!(report.tracks.iter().all(|t| !ended.contains(&t.id)), "a number again");
            let alive: BTreeSet<_> = report.tracks.iter().map(|t| t.id).collect();
            prop_assert_eq!(alive.len(), report.tracks.len());
            if let Some(command) = report.command {
                let WheelSpeeds { left, right } = command.wheels;
                prop_assert!(left.abs() <= 0.9 && right.abs() <= 0.9);
            }
            ended.extend(report.ended);
        }
    }
}
