//! Depth from a stereo pair.

use std::sync::Arc;

use tagalong_core::{DepthImage, Frame, GreyImage, Images, RightImage};

use super::doubles::{World, frame};

/// A detector that needs depth.
const CONFIG: &str = "
    filter.plugin = 'steady'
    stereo = { method = 'block', speckle_pixels = 0 }
    [[detectors]]
    plugin = 'script'
    config = { how = 'depth' }
";

fn with_images(images: Images) -> Frame {
    let plain = frame(1, 0.0);
    Frame::new(plain.index, plain.stamp, plain.camera, plain.motion, images)
}

fn pair() -> Images {
    fn noise(x: usize, y: usize) -> u8 {
        (x * x * 31 + y * y * 17 + x * y) as u8
    }

    let image = GreyImage::from_fn(640, 480, |x, y| noise(x + 20, y));
    Images {
        grey: Some(Arc::new(GreyImage::from_fn(640, 480, noise))),
        right: Some(Arc::new(RightImage { image, baseline_m: 0.1 })),
        ..Images::default()
    }
}

#[test]
fn a_pair_gives_the_detectors_depth() {
    let mut pipeline = World::default().pipeline(CONFIG);
    let report = pipeline.step(with_images(pair())).unwrap();
    assert_eq!(report.plugin_timings[0].0, "stereo");
    assert!(report.funnel.entries().iter().any(|e| e.test.starts_with("stereo pixels: ")));
}

#[test]
fn depth_of_the_log_is_left_alone() {
    let depth = Some(Arc::new(DepthImage::filled(640, 480, 2.0)));
    let mut pipeline = World::default().pipeline(CONFIG);
    let report = pipeline.step(with_images(Images { depth, ..pair() })).unwrap();
    assert!(report.funnel.entries().is_empty(), "{:?}", report.funnel);
}

#[test]
fn without_a_right_image_the_frame_is_refused() {
    let mut pipeline = World::default().pipeline(CONFIG);
    let error = pipeline.step(with_images(Images { right: None, ..pair() })).unwrap_err();
    assert_eq!(
        error.to_string(),
        "frame 1: `stereo` needs right images of a stereo pair, which this frame does not have"
    );
    assert!(pipeline.step(with_images(pair())).is_ok(), "it goes on");
}
