//! Depth of frames, and the reasons that are reported for bad ones.

use std::sync::Arc;

use tagalong_core::{DepthImage, EgoMotion, Frame, Funnel, GreyImage, Images, RightImage, Stamp};
use tagalong_geometry::{Camera, Distortion, Lens, Pinhole};

use super::kernels::noise_pair;
use crate::{Method, StereoDepth, StereoSettings};

const BASELINE_M: f64 = 0.1;
const FX: f64 = 200.0;

fn frame(left: GreyImage, right: GreyImage) -> Frame {
    let width = left.width();
    let height = left.height();
    let lens = Pinhole { fx: FX, fy: FX, cx: 0.0, cy: 0.0, distortion: Distortion::None };
    let camera = Arc::new(Camera::mounted(lens, width, height, 1.0, 0.0, 0.0));
    let images = Images {
        grey: Some(Arc::new(left)),
        right: Some(Arc::new(RightImage { image: right, baseline_m: BASELINE_M })),
        ..Images::default()
    };
    Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.0), images)
}

fn depth(settings: StereoSettings, frame: &Frame) -> (Arc<DepthImage>, Funnel) {
    let mut funnel = Funnel::default();
    let mut stereo = StereoDepth::new(settings).unwrap();
    (stereo.depth(frame, &mut funnel).unwrap(), funnel)
}

fn known(depth: &DepthImage) -> usize {
    depth.pixels().iter().filter(|d| !d.is_nan()).count()
}

#[test]
fn a_plane_has_its_depth() {
    let (left, right) = noise_pair(160, 120, 10);
    for method in [Method::Block, Method::SemiGlobal] {
        let settings = StereoSettings { method, ..StereoSettings::default() };
        let (depth, _) = depth(settings, &frame(left.clone(), right.clone()));
        let wanted = (FX * BASELINE_M / 10.0) as f32;
        let close = depth.pixels().iter().filter(|d| (**d - wanted).abs() < 0.05).count();
        assert!(close > 140 * 120, "{method:?}: {close}");
    }
}

#[test]
fn a_reduced_pair_keeps_its_depth() {
    let (small_left, small_right) = noise_pair(100, 80, 5);
    fn twice(image: &GreyImage) -> GreyImage {
        GreyImage::from_fn(200, 160, |x, y| image.row(y / 2)[x / 2])
    }
    let settings = StereoSettings { width: 100, ..StereoSettings::default() };
    let (depth, _) = depth(settings, &frame(twice(&small_left), twice(&small_right)));
    assert_eq!((depth.width(), depth.height()), (200, 160));
    let close = depth.pixels().iter().filter(|d| (**d - 2.0).abs() < 0.1).count();
    assert!(close > 170 * 160, "{close}");
}

/// A plane at 0.2 m has 100 px, within the range of bytes; 0.01 m would have 2000.
#[test]
fn a_least_depth_that_is_too_near_is_told_and_the_rest_is_matched() {
    let (left, right) = noise_pair(320, 120, 100);
    for (min_depth_m, told) in [(0.01, 1), (0.1, 0)] {
        let settings = StereoSettings { min_depth_m, ..StereoSettings::default() };
        let (depth, funnel) = depth(settings, &frame(left.clone(), right.clone()));
        let close = depth.pixels().iter().filter(|d| (**d - 0.2).abs() < 0.01).count();
        assert!(close > 200 * 120, "{min_depth_m}: {close}");
        assert_eq!(funnel.count("stereo: least depth beyond 255 px of disparity"), told);
    }
}

#[test]
fn threads_are_bound_and_never_none() {
    fn of(threads: usize, most: usize) -> usize {
        StereoSettings { threads, ..StereoSettings::default() }.on_threads(most).threads
    }

    assert_eq!([of(0, 3), of(8, 3), of(1, 3), of(0, 0)], [3, 3, 1, 1]);
}

#[test]
fn depth_out_of_range_is_none_and_counted() {
    let (left, right) = noise_pair(160, 120, 10);
    let settings = StereoSettings { max_depth_m: 1.5, ..StereoSettings::default() };
    let (depth, funnel) = depth(settings, &frame(left, right));
    assert_eq!(known(&depth), 0);
    assert!(funnel.count("stereo pixels: outside of the depth range") > 140 * 120);
}

#[test]
fn bad_pairs_have_no_depth_and_the_reason_is_counted() {
    let (left, right) = noise_pair(320, 240, 10);
    let [black, grey, white] = [0, 90, 255].map(|value| GreyImage::filled(320, 240, value));
    let cases = [
        (black, right.clone(), "stereo: image is black"),
        (left.clone(), white, "stereo: image is saturated"),
        (grey.clone(), grey, "stereo: image without texture"),
        (right.clone(), left.clone(), "stereo: left and right are swapped"),
    ];
    for (left, right, reason) in cases {
        let (depth, funnel) = depth(StereoSettings::default(), &frame(left, right));
        assert_eq!((known(&depth), funnel.count(reason)), (0, 1), "{reason}: {funnel:?}");
    }
    let (_, funnel) = depth(StereoSettings::default(), &frame(left, right));
    assert!(funnel.entries().iter().all(|e| !e.test.starts_with("stereo:")), "{funnel:?}");
}

/// Two cameras seldom have the same exposure. Census strings are not affected; differences of
/// brightness are, which is reported.
#[test]
fn cameras_of_unequal_gain_see_the_same_depth() {
    let (left, right) = noise_pair(160, 120, 10);
    let wanted = (FX * BASELINE_M / 10.0) as f32;
    for (method, gain, told) in
        [(Method::Block, 1.3, 1), (Method::Block, 0.7, 1), (Method::SemiGlobal, 1.1, 0)]
    {
        let settings = StereoSettings { method, ..StereoSettings::default() };
        let right =
            GreyImage::from_fn(160, 120, |x, y| (f32::from(right.row(y)[x]) * gain).round() as u8);
        let (depth, funnel) = depth(settings, &frame(left.clone(), right));
        let close = depth.pixels().iter().filter(|d| (**d - wanted).abs() < 0.05).count();
        assert!(close > 130 * 120, "{method:?} {gain}: {close}");
        assert_eq!(funnel.count("stereo: cameras differ in brightness"), told, "{gain}");
    }
}

#[test]
fn images_too_small_for_a_window_are_no_trouble() {
    for (width, height) in [(1, 1), (2, 1), (1, 7), (5, 3)] {
        let (left, right) = noise_pair(width, height, 1);
        for method in [Method::Block, Method::SemiGlobal] {
            let settings = StereoSettings { method, ..StereoSettings::default() };
            let (depth, _) = depth(settings, &frame(left.clone(), right.clone()));
            assert_eq!((depth.width(), depth.height()), (width, height));
        }
    }
}

#[test]
fn a_camera_that_is_not_calibrated_is_an_error() {
    let (left, right) = noise_pair(64, 48, 3);
    let whole = frame(left, right);
    for fx in [0.0, -200.0, f64::NAN, f64::INFINITY] {
        let lens = Pinhole { fx, fy: FX, cx: 0.0, cy: 0.0, distortion: Distortion::None };
        let camera = Arc::new(Camera { lens: Lens::Pinhole(lens), ..Camera::clone(&whole.camera) });
        let images = whole.images();
        let bad = Frame::new(1, whole.stamp, camera, whole.motion, images);
        let mut stereo = StereoDepth::new(StereoSettings::default()).unwrap();
        let error = stereo.depth(&bad, &mut Funnel::default()).unwrap_err().to_string();
        assert!(error.contains("focal length"), "{error}");
    }
}

#[test]
fn a_vertical_offset_is_measured_and_told() {
    let (left, right) = noise_pair(320, 240, 10);
    let lower = GreyImage::from_fn(320, 240, |x, y| right.row(y.saturating_sub(2))[x]);
    let mut stereo = StereoDepth::new(StereoSettings::default()).unwrap();
    let mut funnel = Funnel::default();
    stereo.depth(&frame(left, lower), &mut funnel).unwrap();
    assert!((stereo.rectification().vertical_px - 2.0).abs() < 0.2);
    assert_eq!(funnel.count("stereo: images vertically off"), 1);
}

#[test]
fn what_is_missing_or_does_not_fit_is_an_error() {
    let (left, right) = noise_pair(64, 48, 3);
    let mut stereo = StereoDepth::new(StereoSettings::default()).unwrap();
    let whole = frame(left.clone(), right.clone());
    let low = frame(left, GreyImage::filled(64, 47, 0));
    let mut cases = vec![
        (Images { right: None, ..whole.images() }, "needs right images"),
        (Images { grey: None, ..whole.images() }, "needs colour or grey images"),
        (low.images(), "64x47"),
    ];
    for baseline_m in [0.0, -0.1, f64::NAN] {
        let right = Some(Arc::new(RightImage { image: right.clone(), baseline_m }));
        cases.push((Images { right, ..whole.images() }, "baseline"));
    }
    for (images, told) in cases {
        let frame = Frame::new(1, whole.stamp, Arc::clone(&whole.camera), whole.motion, images);
        let error = stereo.depth(&frame, &mut Funnel::default()).unwrap_err().to_string();
        assert!(error.contains(told), "{error}");
    }
}
