use std::sync::Arc;

use nalgebra::Point3;
use proptest::prelude::*;
use tagalong_core::{GreyImage, Rect, Registry};

use crate::hog::{BINS, BLOCK, CELL};
use crate::model::SIDE;
use crate::scan::WINDOW_PX;
use crate::{Blocks, Model, NUMBERS, Scanner, Window, merge, resampled, window_numbers};

fn noise(width: usize, height: usize, seed: u64) -> GreyImage {
    let mut state = seed | 1;
    GreyImage::from_fn(width, height, |_, _| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as u8
    })
}

#[test]
fn it_conforms() {
    let mut registry = Registry::default();
    crate::register(&mut registry);
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}

/// The histogram of one cell, gradient by gradient, over the whole image.
fn slow_cell(pixels: &[f32], width: usize, cell: (usize, usize)) -> [f32; BINS] {
    let height = pixels.len() / width;
    let root = |x: usize, y: usize| pixels[y * width + x].sqrt();
    let centre = |cell: usize| (cell * CELL) as f32 + 0.5 * CELL as f32;
    let mut histogram = [0.0; BINS];
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let (gx, gy) = (root(x + 1, y) - root(x - 1, y), root(x, y + 1) - root(x, y - 1));
            let away = |pixel: usize, cell: usize| (pixel as f32 - 0.5 - centre(cell)).abs();
            let near = |d: f32| (1.0 - d / CELL as f32).max(0.0);
            let share = near(away(x, cell.0)) * near(away(y, cell.1));
            let angle = gy.atan2(gx).rem_euclid(std::f32::consts::PI);
            for (bin, sum) in histogram.iter_mut().enumerate() {
                let middle = (bin as f32 + 0.5) * std::f32::consts::PI / BINS as f32;
                let off = (angle - middle).abs();
                let off = off.min(std::f32::consts::PI - off) * BINS as f32 / std::f32::consts::PI;
                *sum += share * (gx * gx + gy * gy).sqrt() * near(off * CELL as f32);
            }
        }
    }
    histogram
}

#[test]
fn blocks_are_those_of_the_slow_reference() {
    let image = noise(50, 42, 9);
    let pixels: Vec<f32> = image.pixels().iter().map(|v| f32::from(*v)).collect();
    let mut blocks = Blocks::default();
    blocks.fill(&pixels, 50);
    assert_eq!((blocks.columns(), blocks.rows()), (5, 4));
    for (x, y) in [(0, 0), (3, 1), (4, 3)] {
        let cells = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
        let mut slow: Vec<f32> =
            cells.iter().flat_map(|cell| slow_cell(&pixels, 50, *cell)).collect();
        let norm = |v: &[f32]| v.iter().map(|v| v * v).sum::<f32>().sqrt();
        let length = norm(&slow) + 0.1 * BLOCK as f32 / 255.0_f32.sqrt();
        slow.iter_mut().for_each(|v| *v = (*v / length).min(0.2));
        let length = norm(&slow) + 1e-3;
        for (fast, slow) in blocks.run(x, y, 1).iter().zip(&slow) {
            assert!((fast - slow / length).abs() < 1e-3, "{fast} {}", slow / length);
        }
    }
}

#[test]
fn a_scan_gives_each_window_the_sum_of_its_numbers() {
    let image = noise(160, 130, 4);
    let weights = (0..NUMBERS).map(|i| ((i * 37 % 101) as f32 - 50.0) * 0.02).collect();
    let model = Model { weights, bias: 0.25, slope: 1.0, offset: 0.0 };
    let mut scanner = Scanner::default();
    let sides = [51.2, 66.0].into_iter();
    let windows = scanner.scan(&image, &model, sides, f32::MIN, |_| Some(None));
    assert_eq!(scanner.looked_at(), windows.len() as u64);
    assert!(windows.len() > 100, "{}", windows.len());
    for window in &windows {
        let slow = model.sum_of(&window_numbers(&image, &window.region));
        assert!((window.sum - slow).abs() < 2e-2, "{window:?}: {slow}");
    }
}

#[test]
fn a_part_of_the_image_gives_the_same_windows() {
    let image = noise(200, 150, 4);
    let weights = (0..NUMBERS).map(|i| ((i * 37 % 101) as f32 - 50.0) * 0.02).collect();
    let model = Model { weights, bias: 0.25, slope: 1.0, offset: 0.0 };
    let part = |square: &Rect| square.x > 60.0 && square.y > 40.0;
    let scan = |part: &dyn Fn(&Rect) -> bool| {
        let propose = |square: &Rect| part(square).then_some(None);
        Scanner::default().scan(&image, &model, [52.0].into_iter(), f32::MIN, propose)
    };
    let all: Vec<Window> = scan(&|_| true).into_iter().filter(|w| part(&w.region)).collect();
    let some = scan(&part);
    assert_eq!(all.len(), some.len());
    for (a, b) in all.iter().zip(&some) {
        assert_eq!(a.region, b.region);
        assert!((a.sum - b.sum).abs() < 1e-3);
    }
}

#[test]
fn two_people_one_behind_the_other_both_stay() {
    let window = |x: f64, depth_m: Option<f64>, sum: f32| Window {
        region: Rect::new(x, 0.0, 50.0, 50.0),
        depth_m,
        sum,
    };
    let count = |a: Option<f64>, b: Option<f64>| {
        merge(vec![window(0.0, a, 1.0), window(5.0, b, 2.0)], 0.4, 0.4).len()
    };
    assert_eq!(count(Some(2.0), Some(2.1)), 1);
    assert_eq!(count(Some(2.0), Some(2.6)), 2);
    assert_eq!(count(None, Some(2.6)), 1);
    assert_eq!(merge(vec![window(0.0, None, 1.0), window(5.0, None, 2.0)], 0.4, 0.4)[0].sum, 2.0);
}

#[test]
fn a_model_survives_its_file_and_a_wrong_one_is_refused() {
    let weights = (0..NUMBERS).map(|i| i as f32 * 0.01 - 3.0).collect();
    let model = Model { weights, bias: -0.7, slope: 2.5, offset: -1.5 };
    let text = model.to_text();
    assert_eq!(Model::from_text(&text).unwrap(), model);
    assert!((model.log_odds(model.sum_at(0.5)) - 0.5).abs() < 1e-5);
    let wrong = |from: &str, to: &str| Model::from_text(&text.replace(from, to)).unwrap_err();
    assert!(wrong("hog-upper-body 1", "hog 9").contains("format"));
    assert!(wrong("slope = 2.5", "slope = -2.5").contains("slope"));
    assert!(Model::from_text("nonsense").is_err());
    assert_eq!(WINDOW_PX, (SIDE + 1) * CELL);
    assert!(Arc::new(model).bias < 0.0 && Point3::<f64>::origin().x == 0.0);
}

proptest! {
    #[test]
    fn a_plane_stays_a_plane_in_every_size(
        step in 0.4..4.0f64, x in 20.0..40.0f64, y in 20.0..30.0f64,
    ) {
        let image = GreyImage::from_fn(120, 90, |x, y| (x + y) as u8);
        let found = resampled(&image, (x, y), step, 8, 6);
        for (index, value) in found.iter().enumerate() {
            let (i, j) = ((index % 8) as f64 + 0.5, (index / 8) as f64 + 0.5);
            let expected = x + i * step - 0.5 + y + j * step - 0.5;
            prop_assert!((f64::from(*value) - expected).abs() < 0.35, "{value} {expected}");
        }
    }
}
