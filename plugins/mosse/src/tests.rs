use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{Point3, SMatrix, Vector2};
use proptest::prelude::*;
use rustfft::num_complex::{Complex32, Complex64};
use tagalong_config::Registry;
use tagalong_core::{
    DepthImage, Detection, Detector, EgoMotion, Estimate, Frame, Funnel, GreyImage, Images, Person,
    Query, Stamp, Track, TrackId,
};
use tagalong_geometry::{Camera, Distortion, HEAD_RADIUS_M, Pinhole, Rect};

use crate::filter::goal;
use crate::patch::{CELLS, Change, SIDE};
use crate::{Config, Filter, Fourier, Mosse, Patch, Peak};

const SIZE: (usize, usize) = (320, 240);

#[test]
fn it_conforms() {
    let mut registry = Registry::default();
    crate::register(&mut registry);
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}

/// Cells that look random.
fn noise(seed: u64) -> Vec<f32> {
    let mut state = seed;
    let mut next = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    };
    (0..CELLS).map(|_| next()).collect()
}

/// The definition of the transform, for one pair of frequencies.
fn slow_spectrum(cells: &[f32], row: usize, column: usize) -> Complex64 {
    let term = |(number, value): (usize, &f32)| {
        let turns = (number / SIDE * row + number % SIDE * column) as f64 / SIDE as f64;
        Complex64::from_polar(f64::from(*value), -TAU * turns)
    };
    cells.iter().enumerate().map(term).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn a_spectrum_is_what_its_definition_says(
        seed in any::<u64>(), row in 0..SIDE, column in 0..SIDE,
    ) {
        let (fourier, cells) = (Fourier::default(), noise(seed));
        let spectrum = fourier.spectrum(&cells);
        let slow = slow_spectrum(&cells, row, column);
        let fast = spectrum[row * SIDE + column];
        let off = (Complex64::new(fast.re.into(), fast.im.into()) - slow).norm();
        prop_assert!(off < 1e-2, "{off}");
        let back = fourier.window(spectrum);
        prop_assert!(back.iter().zip(&cells).all(|(a, b)| (a - b).abs() < 1e-4));
    }

    /// The filter in space, laid over the window at one place.
    #[test]
    fn a_correlation_is_a_sum_over_cells(seed in any::<u64>(), at in 0..CELLS) {
        let fourier = Fourier::default();
        let wanted = goal(&fourier, 2.0);
        let learnt = [noise(seed), noise(!seed)].map(|cells| fourier.spectrum(&cells));
        let filter = Filter::new(&learnt, &wanted);
        let window = noise(seed ^ 5);
        let fast = filter.correlation(&fourier, &fourier.spectrum(&window), 0.01);
        // A single 1 in the corner has an even spectrum: its correlation is the filter, mirrored.
        let mut one = vec![0.0; CELLS];
        one[0] = 1.0;
        let mirrored = filter.correlation(&fourier, &fourier.spectrum(&one), 0.01);
        let value = |number: usize| {
            let row = (at / SIDE + SIDE - number / SIDE) % SIDE;
            let column = (at % SIDE + SIDE - number % SIDE) % SIDE;
            f64::from(window[number]) * f64::from(mirrored[row * SIDE + column])
        };
        let slow: f64 = (0..CELLS).map(value).sum();
        prop_assert!((f64::from(fast[at]) - slow).abs() < 1e-3, "{} {slow}", fast[at]);
    }
}

/// The sum over all windows of the squared differences between correlation and goal.
fn squared_error(filter: &[Complex32], windows: &[Vec<Complex32>], goal: &[Complex32]) -> f64 {
    let error = |window: &Vec<Complex32>| {
        let pairs = window.iter().zip(filter).zip(goal);
        pairs.map(|((f, h), g)| f64::from((f * h - g).norm_sqr())).sum::<f64>()
    };
    windows.iter().map(error).sum()
}

/// Bolme et al., equation 4: the sum of squared errors is least.
#[test]
fn no_other_filter_has_a_smaller_error() {
    let fourier = Fourier::default();
    let wanted = goal(&fourier, 2.0);
    let windows: Vec<_> = (1..4).map(|seed| fourier.spectrum(&noise(seed))).collect();
    let filter = Filter::new(&windows, &wanted);
    // The answer to a single 1 in the corner is the filter itself.
    let mut one = vec![0.0; CELLS];
    one[0] = 1.0;
    let best = fourier.spectrum(&filter.correlation(&fourier, &fourier.spectrum(&one), 1e-9));
    let least = squared_error(&best, &windows, &wanted);
    for (number, change) in [(0, 0.02), (70, -0.02), (2000, 0.05), (4000, -0.05)] {
        let mut other = best.clone();
        other[number] += Complex32::new(change, 0.5 * change);
        assert!(squared_error(&other, &windows, &wanted) > least, "{number}");
    }
}

#[test]
fn a_window_that_was_learnt_gets_the_wanted_answer_where_it_lies() {
    let fourier = Fourier::default();
    let wanted = goal(&fourier, 2.0);
    let cells = noise(3);
    let filter = Filter::new(&[fourier.spectrum(&cells)], &wanted);
    let moved: Vec<f32> = (0..CELLS)
        .map(|at| cells[(at / SIDE + SIDE - 3) % SIDE * SIDE + (at % SIDE + SIDE - 5) % SIDE])
        .collect();
    let answer = filter.correlation(&fourier, &fourier.spectrum(&moved), 1e-6);
    let peak = Peak::of(&answer);
    assert!((peak.offset[0] - 5.0).abs() < 0.05 && (peak.offset[1] - 3.0).abs() < 0.05, "{peak:?}");
    assert!(peak.ratio > 20.0, "{peak:?}");
    let stranger = filter.correlation(&fourier, &fourier.spectrum(&noise(77)), 1e-6);
    assert!(Peak::of(&stranger).ratio < 6.0, "{:?}", Peak::of(&stranger));
}

#[test]
fn the_past_has_its_weight() {
    let fourier = Fourier::default();
    let wanted = goal(&fourier, 2.0);
    let [a, b] = [1, 2].map(|seed| fourier.spectrum(&noise(seed)));
    let mut half = Filter::new(std::slice::from_ref(&a), &wanted);
    half.learn(&b, &wanted, 0.5);
    assert_eq!(half, Filter::new(&[a.clone(), b.clone()], &wanted), "the mean of two");
    let mut new = Filter::new(&[a], &wanted);
    new.learn(&b, &wanted, 0.0);
    assert_eq!(new, Filter::new(&[b], &wanted), "nothing is kept");
}

/// A peak of 10 among sidelobes of 1 and -1: their mean is 0, their deviation 1.
#[test]
fn the_ratio_is_the_height_above_the_sidelobes() {
    let mut cells: Vec<f32> = (0..CELLS)
        .map(|at| if (at / SIDE + at % SIDE).is_multiple_of(2) { 1.0 } else { -1.0 })
        .collect();
    cells[20 * SIDE + 40] = 10.0;
    let peak = Peak::of(&cells);
    assert!((peak.ratio - 10.0).abs() < 0.02, "{peak:?}");
    assert_eq!(peak.offset.map(f64::round), [8.0, -12.0]);
    assert_eq!(Peak::of(&vec![1.0; CELLS]).ratio, 0.0, "an even correlation");
}

/// A hill whose summit lies between cells.
#[test]
fn the_summit_is_found_between_cells() {
    let hill = |at: usize| {
        let (x, y) = ((at % SIDE) as f64 - 30.3, (at / SIDE) as f64 - 35.8);
        (100.0 - x * x - y * y) as f32
    };
    let cells: Vec<f32> = (0..CELLS).map(hill).collect();
    let [across, down] = Peak::of(&cells).offset;
    assert!((across + 1.7).abs() < 1e-3 && (down - 3.8).abs() < 1e-3, "{across} {down}");
}

#[test]
fn a_patch_has_no_brightness_and_no_border() {
    let image = |gain: f64| {
        GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            (gain * pattern(x as f64 / 40.0, y as f64 / 40.0, 1.0)) as u8
        })
    };
    let square = Rect::new(100.0, 80.0, 50.0, 50.0);
    let (bright, dark) = (Patch::new(&image(1.0), &square), Patch::new(&image(0.5), &square));
    let off = bright.0.iter().zip(&dark.0).map(|(a, b)| (a - b).abs()).sum::<f32>() / CELLS as f32;
    assert!(off < 0.03, "{off}");
    assert!(bright.0[..SIDE].iter().all(|value| *value == 0.0), "the first row");
    let turned = Patch::changed(&image(1.0), &square, Change { turn_rad: 0.1, growth: 1.0 });
    let middle = SIDE / 2 * SIDE + SIDE / 2;
    assert!((turned.0[middle] - bright.0[middle]).abs() < 0.1, "a turn is about the middle");
    assert_ne!(turned, bright);
}

fn camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 262.0, fy: 262.0, cx: 159.5, cy: 119.5, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, SIZE.0, SIZE.1, 1.3, 0.0, 0.0))
}

/// A reproducible pattern of blotches, 0 to 255.
fn pattern(u: f64, v: f64, kind: f64) -> f64 {
    let wave = |a: f64, b: f64| (a * u + b * v + kind).sin();
    127.0 + 60.0 * wave(9.0, 2.0) + 40.0 * wave(-4.0, 7.0 + kind) + 25.0 * wave(15.0, -11.0)
}

/// A person as a patterned square in front of another pattern.
fn frame(head: Point3<f64>, kind: f64, face_m: Option<f64>) -> Frame {
    let camera = camera();
    let of = camera.upper_body(&head);
    let on_person = |x: usize, y: usize| {
        let (u, v) = ((x as f64 + 0.5 - of.x) / of.width, (y as f64 + 0.5 - of.y) / of.height);
        ((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v)).then_some((u, v))
    };
    let grey = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| match on_person(x, y) {
        Some((u, v)) => pattern(u, v, kind) as u8,
        None => pattern(x as f64 / 90.0, y as f64 / 90.0, 4.0) as u8,
    });
    let depth = face_m.map(|face_m| {
        let metres = |x, y| if on_person(x, y).is_some() { face_m as f32 } else { 6.0 };
        Arc::new(DepthImage::from_fn(SIZE.0, SIZE.1, metres))
    });
    let images = Images { grey: Some(Arc::new(grey)), depth, ..Images::default() };
    Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.05), images)
}

fn track(head: Point3<f64>, seen: bool) -> Track {
    let person = Person { position: head, velocity: Vector2::zeros() };
    let covariance = SMatrix::identity() * 0.01;
    Track {
        id: TrackId(3),
        estimate: Estimate { person, covariance, region: camera().upper_body(&head) },
        seen,
        occluded: false,
        confirmed: true,
        age: 5,
        unseen_s: 0.0,
        score: 2.0,
    }
}

fn near(detector: &mut Mosse, frame: &Frame, expected: Point3<f64>) -> (Option<Detection>, Funnel) {
    let mut funnel = Funnel::default();
    let track = track(expected, true);
    let found = detector.detect(frame, &Query::Track(&track), &mut funnel).unwrap();
    (found.into_iter().next(), funnel)
}

/// A detector that was shown a person there.
fn taught(head: Point3<f64>) -> Mosse {
    let mut detector = Mosse::new(Config::default()).unwrap();
    detector.learn(&frame(head, 1.0, Some(face_m(head))), &[track(head, true)]).unwrap();
    detector
}

fn face_m(head: Point3<f64>) -> f64 {
    camera().depth_of(&head) - HEAD_RADIUS_M
}

fn place(x: f64, y: f64) -> Point3<f64> {
    Point3::new(x, y, 1.35)
}

#[test]
fn a_person_is_followed_who_moves_by_a_quarter_of_their_width() {
    let (before, after) = (place(3.0, 0.0), place(3.0, 0.14));
    for depth in [Some(face_m(after)), None] {
        let (found, funnel) = near(&mut taught(before), &frame(after, 1.0, depth), before);
        let found = found.unwrap_or_else(|| panic!("{funnel:?}"));
        let off = found.rect().unwrap().centre() - camera().upper_body(&after).centre();
        assert!(off.norm() < 2.0, "{off}");
        assert!((found.position - after).norm() < 0.06 || depth.is_none(), "{}", found.position);
    }
}

#[test]
fn strangers_and_things_at_another_distance_are_not_the_person() {
    let here = place(3.0, 0.0);
    let dropped = |frame: &Frame, test: &str| {
        let (found, funnel) = near(&mut taught(here), frame, here);
        assert!(found.is_none() && funnel.count(test) == 1, "{test}: {funnel:?}");
    };
    dropped(&frame(here, 6.0, Some(face_m(here))), "mosse: peak");
    dropped(&frame(here, 1.0, Some(face_m(here) - 0.8)), "mosse: depth");
    let (_, funnel) =
        near(&mut Mosse::new(Config::default()).unwrap(), &frame(here, 1.0, None), here);
    assert_eq!(funnel.count("mosse: not learnt yet"), 1);
    let outside = place(3.0, 4.0);
    let (_, funnel) = near(&mut taught(here), &frame(here, 1.0, None), outside);
    assert_eq!(funnel.count("mosse: box outside, too small or too large"), 1);
}

#[test]
fn nothing_is_learnt_of_who_is_hidden_or_not_seen() {
    let here = place(3.0, 0.0);
    let image = frame(here, 1.0, Some(face_m(here)));
    let hidden = Track { occluded: true, ..track(here, true) };
    for track in [track(here, false), hidden] {
        let mut detector = Mosse::new(Config::default()).unwrap();
        detector.learn(&image, &[track]).unwrap();
        let (_, funnel) = near(&mut detector, &image, here);
        assert_eq!(funnel.count("mosse: not learnt yet"), 1);
    }
}

/// The track was given another detection: the filter learns the new look fast.
#[test]
fn who_is_found_by_another_detector_is_learnt_anew() {
    let here = place(3.0, 0.0);
    let (old, new) = (1.0, 1.6);
    let mut detector = taught(here);
    let image = frame(here, new, Some(face_m(here)));
    for _ in 0..4 {
        detector.learn(&image, &[track(here, true)]).unwrap();
    }
    let aside = place(3.0, 0.1);
    let ratio = |detector: &mut Mosse, kind: f64| {
        near(detector, &frame(aside, kind, Some(face_m(aside))), here).0.is_some()
    };
    assert!(ratio(&mut detector, new) && ratio(&mut taught(here), old));
}

#[test]
fn a_track_that_ended_is_forgotten() {
    let here = place(3.0, 0.0);
    let mut detector = taught(here);
    let image = frame(here, 1.0, Some(face_m(here)));
    detector.learn(&image, &[]).unwrap();
    assert_eq!(near(&mut detector, &image, here).1.count("mosse: not learnt yet"), 1);
}

#[test]
fn settings_that_cannot_work_are_refused_by_name() {
    for line in ["memory = 1.0", "peak_width = 0.0", "regularisation = 0.0", "sigma_box = 0.0"] {
        let key = line.split(' ').next().unwrap();
        let told = Mosse::new(toml::from_str(line).unwrap()).err().map(|error| error.to_string());
        assert!(told.as_ref().is_some_and(|why| why.contains(key)), "{line}: {told:?}");
    }
}
