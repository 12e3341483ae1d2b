//! Odometry, corrected by static structure.

use std::sync::Arc;

use tagalong_core::{DepthImage, EgoMotion, Frame, GreyImage, Images};

use super::doubles::{World, frame};

const BY_WHEELS: &str = "
    filter.plugin = 'steady'
    [[detectors]]
    plugin = 'script'
";

/// A frame of a robot that stands before a wall.
fn wall(index: u64, motion: EgoMotion) -> Frame {
    let plain = frame(index, 0.1 * index as f64);
    let images = Images {
        grey: Some(Arc::new(GreyImage::from_fn(640, 480, |x: usize, y: usize| {
            let x = x as f64;
            let y = y as f64;
            (128.0 + 50.0 * (0.13 * x + 0.05 * y).sin() + 50.0 * (0.17 * y - 0.07 * x).sin()) as u8
        }))),
        depth: Some(Arc::new(DepthImage::filled(640, 480, 3.0))),
        ..Images::default()
    };
    Frame::new(plain.index, plain.stamp, plain.camera, motion, images)
}

/// Estimated turn when the wheels report one while the robot stands, rad.
fn believed(config: &str) -> f64 {
    let mut pipeline = World::default().pipeline(config);
    pipeline.step(wall(1, EgoMotion::at_rest(0.0))).unwrap();
    let report =
        pipeline.step(wall(2, EgoMotion { turn: 0.01, forward: 0.01, ..EgoMotion::at_rest(0.1) }));
    report.unwrap().motion.turn
}

#[test]
fn the_motion_is_that_of_the_wheels_unless_the_config_asks_for_more() {
    assert!((believed(BY_WHEELS) - 0.01).abs() < 1e-12);
    let corrected = believed(&format!("odometry.wheel_error = 1.0\n{BY_WHEELS}"));
    assert!(corrected.abs() < 1e-3, "{corrected} rad");
}

#[test]
fn without_depth_the_wheels_are_believed() {
    let mut pipeline = World::default().pipeline(&format!("odometry = {{}}\n{BY_WHEELS}"));
    for index in 1..=2 {
        let report = pipeline.step(frame(index, 0.1 * index as f64)).unwrap();
        assert!(report.funnel.entries().is_empty(), "{:?}", report.funnel);
    }
}
