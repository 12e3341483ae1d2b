//! Disparities of the Middlebury pairs, compared with those of OpenCV.
#![allow(clippy::unwrap_used, reason = "a broken test may stop loudly")]
#![allow(clippy::print_stdout, reason = "the figures are what one wants to see")]

use std::path::Path;

use tagalong_core::GreyImage;
use tagalong_stereo::{Matcher, Method, StereoSettings};

/// Pair of images, and the bad pixels of OpenCV 4.14 on it.
struct Pair {
    name: &'static str,
    /// Grey levels per pixel of disparity, in the image of the truth.
    scale: f32,
    disparities: usize,
    /// Bad pixels by `StereoSGBM` among all with a truth, %: off by more than 1 and 2 px.
    sgbm: [f64; 2],
    /// The same by `StereoBM`.
    bm: [f64; 2],
    /// The same by `StereoSGBM` among those that are visible in both views.
    sgbm_visible: [f64; 2],
}

const PAIRS: [Pair; 4] = [
    Pair {
        name: "tsukuba",
        scale: 16.0,
        disparities: 16,
        bm: [13.91, 12.59],
        sgbm: [7.28, 5.81],
        sgbm_visible: [5.16, 3.88],
    },
    Pair {
        name: "venus",
        scale: 8.0,
        disparities: 32,
        bm: [14.27, 13.63],
        sgbm: [2.61, 2.08],
        sgbm_visible: [1.68, 1.31],
    },
    Pair {
        name: "sawtooth",
        scale: 8.0,
        disparities: 32,
        bm: [12.37, 12.33],
        sgbm: [3.86, 3.73],
        sgbm_visible: [1.86, 1.80],
    },
    Pair {
        name: "teddy",
        scale: 4.0,
        disparities: 64,
        bm: [26.12, 24.60],
        sgbm: [14.17, 11.62],
        sgbm_visible: [11.32, 8.90],
    },
];

/// Converts colour to grey as OpenCV does.
fn grey(path: &Path) -> GreyImage {
    let image = image::open(path).unwrap().to_rgb8();
    let pixels = image.pixels().map(|p| {
        let [r, g, b] = p.0.map(f32::from);
        (0.299 * r + 0.587 * g + 0.114 * b).round() as u8
    });
    GreyImage::from_pixels(image.width() as usize, image.height() as usize, pixels.collect())
        .unwrap()
}

/// Marks the pixels of the left view that a nearer one hides in the right view.
fn hidden(truth: &[f32]) -> Vec<bool> {
    let seen_at: Vec<Option<usize>> =
        truth.iter().zip(0..).map(|(d, x)| usize::try_from(x - d.round() as i64).ok()).collect();
    let mut nearest = vec![0.0_f32; truth.len()];
    for (at, d) in seen_at.iter().zip(truth) {
        if let Some(at) = *at {
            nearest[at] = nearest[at].max(*d);
        }
    }
    seen_at.iter().zip(truth).map(|(at, d)| at.is_none_or(|at| nearest[at] > d + 1.0)).collect()
}

/// Returns the bad pixels, %: of all off by more than 1 and 2 px, and of the visible ones. A pixel
/// without a disparity is bad; one left of the disparity range or without a truth does not count.
fn bad(found: &[f32], truth: &[f32], width: usize, disparities: usize) -> [f64; 4] {
    let mut count = [0_u32; 4];
    let mut pixels = [0_u32; 2];
    for (found, truth) in found.chunks(width).zip(truth.chunks(width)) {
        let hidden = hidden(truth);
        for x in (disparities..width).filter(|x| truth[*x] > 0.0) {
            let off = (found[x] - truth[x]).abs();
            let wrong = [1.0, 2.0].map(|most| u32::from(off.is_nan() || off > most));
            let visible = u32::from(!hidden[x]);
            pixels = [pixels[0] + 1, pixels[1] + visible];
            let add = [wrong[0], wrong[1], wrong[0] * visible, wrong[1] * visible];
            count = std::array::from_fn(|i| count[i] + add[i]);
        }
    }
    std::array::from_fn(|i| 100.0 * f64::from(count[i]) / f64::from(pixels[i / 2]))
}

/// Errors on a pair.
struct Judged {
    /// See [`bad`].
    bad: [f64; 4],
    /// Fraction of the disparities that are off by more than 2 px, % of the valid ones.
    wrong: f64,
}

fn judge(folder: &Path, pair: &Pair, settings: &StereoSettings) -> Judged {
    let [left, right, truth] =
        ["im2.png", "im6.png", "disp2.png"].map(|name| grey(&folder.join(pair.name).join(name)));
    let truth: Vec<f32> = truth.pixels().iter().map(|p| f32::from(*p) / pair.scale).collect();
    let mut matcher = Matcher::new(settings.clone()).unwrap();
    let found = matcher.disparities(&left, &right, pair.disparities - 1).unwrap();
    let bad = bad(found.values, &truth, left.width(), pair.disparities);
    let known = found.values.iter().filter(|d| !d.is_nan()).count();
    let near = found.values.iter().zip(&truth).map(|(f, t)| (f - t).abs()).filter(|e| *e < 1.0);
    let (n, sum) = near.fold((0, 0.0_f64), |(n, sum), e| (n + 1, sum + f64::from(e)));
    let fine = sum / f64::from(n);
    let density = 100.0 * known as f64 / truth.len() as f64;
    let off = found.values.iter().zip(&truth).filter(|(f, t)| **t > 0.0 && (*f - *t).abs() > 2.0);
    let wrong = 100.0 * off.count() as f64 / known as f64;
    println!(
        "{:9} {:?}: wrong of the known {wrong:.2} %, bad-1/bad-2 all {:.2}/{:.2}, visible {:.2}/{:.2}, known {density:.1} %, fine {fine:.3} px, {:?}",
        pair.name, settings.method, bad[0], bad[1], bad[2], bad[3], found.dropped
    );
    Judged { bad, wrong }
}

/// Returns settings that drop no smooth pixel, because one without a disparity is bad here.
fn dense(method: Method) -> StereoSettings {
    StereoSettings { method, texture: 0, ..StereoSettings::default() }
}

#[test]
fn semi_global_is_no_worse_than_opencv() {
    let Some(folder) = tagalong_conformance::testdata::find("stereo") else { return };
    for pair in &PAIRS {
        let Judged { bad, .. } = judge(&folder, pair, &dense(Method::SemiGlobal));
        println!("    OpenCV's SGBM: all {:.2?}, visible {:.2?}", pair.sgbm, pair.sgbm_visible);
        assert!(bad[3] <= pair.sgbm_visible[1], "{}: {:.2} % of the visible", pair.name, bad[3]);
    }
}

/// The methods fail in different places: without texture, ours leave holes and `StereoBM` with its
/// larger window guesses.
#[test]
fn windows_fail_nowhere_as_badly_as_opencv_where_it_is_worst() {
    let Some(folder) = tagalong_conformance::testdata::find("stereo") else { return };
    for pair in &PAIRS {
        let [_, all, ..] = judge(&folder, pair, &dense(Method::Block)).bad;
        println!("    OpenCV's BM: all {:.2?}", pair.bm);
        assert!(all <= 24.60, "{}: {all:.2} % of all", pair.name);
    }
}

/// The disparities that the texture test drops are more often wrong than those that it keeps.
#[test]
fn of_what_the_defaults_leave_less_is_wrong() {
    let Some(folder) = tagalong_conformance::testdata::find("stereo") else { return };
    for pair in &PAIRS {
        let all = judge(&folder, pair, &dense(Method::SemiGlobal)).wrong;
        let left = judge(&folder, pair, &StereoSettings::default()).wrong;
        assert!(left < all, "{}: {left:.2} and {all:.2} %", pair.name);
    }
}
