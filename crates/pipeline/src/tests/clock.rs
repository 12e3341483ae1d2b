use tagalong_core::{EgoMotion, Frame};

use super::doubles::{PLAIN, World, frame, person};
use crate::{FrameReport, Outcome};

/// Steps over frames 1, 2, ... at the given times, with one person in view.
fn at(times_s: &[f64], config: &str) -> (World, Vec<FrameReport>) {
    let world = World::of(times_s.iter().map(|_| vec![person(3.0, 0.0)]));
    let mut pipeline = world.pipeline(config);
    let frames = (1..).zip(times_s).map(|(i, t)| frame(i, *t));
    let reports = frames.map(|f| pipeline.step(&f).unwrap()).collect();
    (world, reports)
}

fn outcomes(reports: &[FrameReport]) -> Vec<Outcome> {
    reports.iter().map(|r| r.outcome).collect()
}

fn last_id(reports: &[FrameReport]) -> u32 {
    reports.last().unwrap().tracks[0].id.0
}

#[test]
fn t1_a_clock_set_back_ends_all_tracks_once() {
    for back_s in [0.15, 10.0, 86_400.0] {
        let start = 100_000.0;
        let times: Vec<f64> = (0..5)
            .map(|i| start + 0.1 * f64::from(i))
            .chain((0..5).map(|i| start + 0.4 - back_s + 0.1 * f64::from(i)))
            .collect();
        let (world, reports) = at(&times, PLAIN);
        let resets = outcomes(&reports);
        let resets: Vec<_> =
            resets.iter().filter(|o| matches!(o, Outcome::ResetBackward { .. })).collect();
        assert_eq!(resets.len(), 1, "{back_s}");
        assert_eq!(reports[5].funnel.count("track: clock set back"), 1);
        assert_eq!(last_id(&reports), 2, "a number is not used twice");
        assert!(world.predicted.lock().unwrap().iter().all(|m| m.dt > 0.0));
    }
}

#[test]
fn t1_the_robot_stands_until_three_fresh_frames_came() {
    fn drives(config: &str) -> Vec<bool> {
        let (_, reports) = at(&[10.0, 10.1, 1.0, 1.1, 1.2, 1.3], config);
        reports.iter().map(|r| r.command.unwrap().wheels.left != 0.0).collect()
    }

    let config =
        format!("{PLAIN}\n[manager.config]\nconfirm_hits = 1\n[controller]\nplugin = 'drive'");
    let without_memory = config.clone() + "\n[target]\nremember = false\n";
    assert_eq!(drives(&without_memory), [true, true, false, false, false, true]);
    assert_eq!(drives(&config)[2..], [false; 4], "whoever is there has to look like the person");
}

#[test]
fn t2_a_pause_is_bridged_a_long_one_ends_all_tracks() {
    let steady: Vec<f64> = (0..6).map(|i| 0.1 * f64::from(i)).collect();
    for (pause_s, id) in [(0.45, 1), (0.8, 1), (1.0, 2), (3600.0, 2)] {
        let times: Vec<f64> = steady.iter().copied().chain([0.5 + pause_s]).collect();
        let (_, reports) = at(&times, PLAIN);
        let outcome = reports[6].outcome;
        match pause_s {
            p if p < 0.5 => assert_eq!(outcome, Outcome::Tracked),
            p if p < 0.9 => assert!(matches!(outcome, Outcome::Gap { .. }), "{outcome:?}"),
            _ => assert!(matches!(outcome, Outcome::ResetForward { .. }), "{outcome:?}"),
        }
        assert_eq!(last_id(&reports), id, "{pause_s}");
    }
}

#[test]
fn t2_a_gap_ends_tracks_that_are_not_confirmed() {
    let world = World::of((0..5).map(|_| vec![]));
    world.show(0, 5, vec![person(3.0, 0.0)]);
    let mut pipeline = world.pipeline(PLAIN);
    for (index, t_s) in [(1, 0.1), (2, 0.2), (3, 0.3), (4, 0.4), (5, 0.5)] {
        pipeline.step(frame(index, t_s)).unwrap();
    }
    let report = pipeline.step(frame(6, 1.3)).unwrap();
    assert_eq!(report.funnel.count("track: gap in the log"), 1);
}

#[test]
fn t2_a_slow_log_has_no_gaps() {
    for period_s in [0.25, 0.5, 1.0, 4.0] {
        let times: Vec<f64> = (0..12).map(|i| period_s * f64::from(i)).collect();
        let (_, reports) = at(&times, &format!("{PLAIN}[clock]\nreset_gap_s = 5.0\n"));
        assert_eq!(outcomes(&reports), [Outcome::Tracked; 12], "{period_s}");
        assert_eq!(last_id(&reports), 1);
    }
}

#[test]
fn t3_a_duplicate_is_processed_once() {
    fn tracks(reports: &[FrameReport]) -> Vec<String> {
        let processed = reports.iter().filter(|r| r.outcome.is_processed());
        processed.map(|r| format!("{:?} {:?} {:?}", r.stamp, r.tracks, r.nis)).collect::<Vec<_>>()
    }

    let (_, twice) = at(&[0.0, 0.1, 0.1, 0.1, 0.2, 0.3, 0.3, 0.4], PLAIN);
    let (_, once) = at(&[0.0, 0.1, 0.2, 0.3, 0.4], PLAIN);
    assert_eq!(twice.iter().map(|r| r.funnel.count("frame: duplicate")).sum::<u64>(), 3);
    assert_eq!(tracks(&twice), tracks(&once));
}

#[test]
fn t4_a_late_frame_is_dropped_and_counted() {
    let (world, reports) = at(&[0.0, 0.1, 0.2, 0.15, 0.3], PLAIN);
    assert_eq!(reports[3].outcome, Outcome::OutOfOrder);
    assert_eq!(reports[3].funnel.count("frame: out of order"), 1);
    assert_eq!(last_id(&reports), 1);
    let dt: Vec<f64> = world.predicted.lock().unwrap().iter().map(|m| m.dt).collect();
    assert!(dt.iter().all(|dt| (dt - 0.1).abs() < 1e-6), "{dt:?}");
}

#[test]
fn the_motion_over_a_skipped_frame_is_not_lost() {
    fn moving(index: u64, t_s: f64, forward: f64) -> Frame {
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.05) };
        let still = frame(index, t_s);
        Frame::new(index, still.stamp, still.camera.clone(), motion, still.images())
    }

    let world = World::of((0..4).map(|_| vec![person(3.0, 0.0)]));
    let mut pipeline = world.pipeline(PLAIN);
    for (index, t_s, forward) in [(1, 0.0, 0.0), (2, 0.0, 0.03), (3, 0.1, 0.04)] {
        pipeline.step(moving(index, t_s, forward)).unwrap();
    }
    let motion = world.predicted.lock().unwrap()[0];
    assert!((motion.forward - 0.07).abs() < 1e-12, "{motion:?}");
    assert!((motion.dt - 0.1).abs() < 1e-9);
    let report = pipeline.step(moving(4, 0.2, f64::NAN)).unwrap();
    assert_eq!(report.funnel.count("motion not finite"), 1);
    assert_eq!(report.tracks.len(), 1);
}
