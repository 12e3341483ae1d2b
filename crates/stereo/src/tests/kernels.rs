//! Each fast kernel against its reference.

use proptest::prelude::*;
use tagalong_core::GreyImage;

use super::reference::{self, Volume};
use crate::census::BYTES;
use crate::cost::Features;
use crate::paths::{Excess, Penalties};
use crate::refine::Refiner;
use crate::speckle::SpeckleFilter;
use crate::texture::TextureTest;
use crate::winner::{FromRight, RowWinners, Winners};
use crate::{Matcher, Method, StereoSettings, cost, fill, paths, window};

const D: usize = 16;

/// Generates images with many equal neighbours, or few.
fn images(count: usize) -> impl Strategy<Value = Vec<GreyImage>> {
    (1..40usize, 1..12usize, 1..=255u8).prop_flat_map(move |(width, height, most)| {
        let pixels = prop::collection::vec(0..=most, width * height);
        let image =
            pixels.prop_map(move |p| GreyImage::from_pixels(width, height, p).expect("all pixels"));
        prop::collection::vec(image, count)
    })
}

fn features(pair: &[GreyImage], noise: u8, y: usize) -> (Features, Features) {
    let mut left = Features::default();
    let mut right = Features::default();
    left.all(&pair[0], y, noise, None);
    right.all(&pair[1], y, noise, Some(D));
    (left, right)
}

fn cost_row(pair: &[GreyImage], noise: u8, y: usize) -> Vec<[u8; D]> {
    let (left, right) = features(pair, noise, y);
    let mut costs = vec![[0; D]; pair[0].width()];
    let mut columns = costs.clone();
    cost::bits(&left, &right, &mut costs, &mut columns);
    assert_eq!(costs, columns, "the sums of one row");
    cost::bits(&left, &right, &mut costs, &mut columns);
    assert_eq!(costs, columns, "a row in its own place");
    costs
}

fn cost_rows(pair: &[GreyImage], noise: u8) -> Vec<Vec<[u8; D]>> {
    (0..pair[0].height()).map(|y| cost_row(pair, noise, y)).collect()
}

fn wide(cells: &[u8]) -> Vec<i64> {
    cells.iter().copied().map(i64::from).collect()
}

proptest! {
    #[test]
    fn costs_equal_counted_bits(pair in images(2), noise in 0..20u8) {
        let width = pair[0].width() as i64;
        let height = pair[0].height() as i64;
        let slow = Volume::from_fn((width, height, D as i64), |x, y, d| {
            reference::bits(&pair, noise, x, y, d)
        });
        let fast: Vec<u8> = cost_rows(&pair, noise).concat().into_flattened();
        prop_assert_eq!(wide(&fast), slow.cells);
    }

    #[test]
    fn blended_costs_equal_added_ones(pair in images(2), noise in 0..20u8) {
        let width = pair[0].width();
        let height = pair[0].height();
        let size = (width as i64, height as i64, D as i64);
        let slow =
            Volume::from_fn(size, |x, y, d| reference::blend(&pair, noise, x, y, d));
        let mut fast = Vec::new();
        for y in 0..height {
            let (left, right) = features(&pair, noise, y);
            let mut costs = vec![[0; D]; width];
            cost::blend(&left, &right, &mut costs);
            fast.extend(wide(costs.as_flattened()));
        }
        prop_assert_eq!(fast, slow.cells);
    }

    #[test]
    fn holes_are_bridged_pixel_by_pixel(
        values in prop::collection::vec(prop_oneof![Just(f32::NAN), 0.0..4.0_f32], 12 * 9),
        most in 0..6usize,
        baselines in 0.0..2.0_f32,
        step in 0.0..3.0_f32,
    ) {
        fn holes(image: &[f32]) -> usize {
            image.iter().filter(|v| v.is_nan()).count()
        }

        let slow = reference::without_holes(&values, 12, (most, baselines), step);
        let mut fast = values.clone();
        let bounds = fill::Most { px: most, baselines, step };
        let filled = fill::holes(&mut fast, 12, &bounds);
        prop_assert_eq!(filled as usize, holes(&values) - holes(&fast));
        for (fast, slow) in fast.iter().zip(&slow) {
            let close = (fast - slow).abs() < 1e-5 || (fast.is_nan() && slow.is_nan());
            prop_assert!(close, "{} {}", fast, slow);
        }
    }

    #[test]
    fn smooth_pixels_are_kept_between_textured_ones(
        image in images(1),
        values in prop::collection::vec(prop_oneof![Just(f32::NAN), 0.0..20.0_f32], 40 * 12),
        least in 1..60u8,
        threads in 1..5usize,
    ) {
        fn bits(row: &[f32]) -> Vec<u32> {
            row.iter().map(|v| v.to_bits()).collect::<Vec<u32>>()
        }

        fn holes(row: &[f32]) -> usize {
            row.iter().filter(|v| v.is_nan()).count()
        }

        let (image, width) = (&image[0], image[0].width());
        let values = &values[..image.pixels().len()];
        let rows = values.chunks(width).enumerate();
        let slow: Vec<f32> =
            rows.flat_map(|(y, row)| reference::supported(row, image, y, least.into())).collect();
        let mut fast = values.to_vec();
        let dropped = TextureTest::default().apply(image, least, threads, &mut fast);
        prop_assert_eq!(bits(&fast), bits(&slow));
        prop_assert_eq!(dropped as usize, holes(&fast) - holes(values));
    }

    #[test]
    fn refined_disparities_equal_solved_windows(
        pair in images(2),
        values in prop::collection::vec(prop_oneof![Just(f32::NAN), 3.0..6.0_f32], 40 * 12),
        radius in 1..5usize,
        threads in 1..5usize,
    ) {
        let mut fast = values[..pair[0].pixels().len()].to_vec();
        let slow = reference::refined(&pair, &fast, radius);
        Refiner::default().apply([&pair[0], &pair[1]], radius, threads, &mut fast);
        for (fast, slow) in fast.iter().zip(&slow) {
            let close = (f64::from(*fast) - slow).abs() < 1e-2 || (fast.is_nan() && slow.is_nan());
            prop_assert!(close, "{} {}", fast, slow);
        }
    }

    #[test]
    fn path_sums_equal_equation_13(
        pair in images(2), small in 0..9u8, more in 0..20u8, most in 0..40u8,
    ) {
        let large = std::array::from_fn(|i| if i < 9 { small + more + most } else { small + more });
        let penalties = Penalties { small, large };
        let rows = cost_rows(&pair, 0);
        let grey = &pair[0];
        let cells = wide(&rows.concat().into_flattened());
        let width = grey.width() as i64;
        let height = grey.height() as i64;
        let costs = Volume { width, height, disparities: D as i64, cells };
        let mut slow = vec![0_i64; costs.cells.len()];
        for from in [(-1, 0), (1, 0), (-1, -1), (0, -1), (1, -1)] {
            let path =
                reference::path(&costs, grey, from, small.into(), |i| large[usize::from(i)].into());
            slow.iter_mut().zip(path.cells).for_each(|(s, p)| *s = (*s + p).min(255));
        }
        let mut excess: [Excess; 3] = Default::default();
        excess.iter_mut().for_each(|e| e.reset::<D>(grey.width()));
        let mut fast = Vec::new();
        for (y, costs) in rows.iter().enumerate() {
            let pixels = (grey.row(y), grey.row(y.saturating_sub(1)));
            let mut sums = vec![[0; D]; grey.width()];
            paths::sums(costs, pixels, &penalties, &mut excess, &mut sums);
            fast.extend(wide(sums.as_flattened()));
        }
        prop_assert_eq!(fast, slow);
    }

    #[test]
    fn window_sums_equal_added_costs(
        cells in prop::collection::vec(0..=8 * BYTES as u8, 12 * 7 * D), radius in 1..5usize, shift in 0..4u32,
    ) {
        const WIDTH: usize = 7;
        let rows: Vec<&[[u8; D]]> = cells.as_chunks::<D>().0.chunks(WIDTH).collect();
        let side = 2 * radius + 1;
        for y in 0..rows.len() {
            let first = (y + 1).saturating_sub(side);
            let mut columns = vec![[0_u8; D]; WIDTH];
            for (x, d) in (0..WIDTH).flat_map(|x| (0..D).map(move |d| (x, d))) {
                columns[x][d] = rows[first..=y].iter().map(|row| row[x][d]).sum();
            }
            let mut sums = vec![[0; D]; WIDTH];
            window::slide_along(&columns, radius, shift, &mut sums);
            for (at, fast) in sums.as_flattened().iter().enumerate() {
                let mut slow = 0;
                for row in &rows[first..=y] {
                    for i in 0..side {
                        let x = (at / D + i).saturating_sub(radius).min(WIDTH - 1);
                        slow += u32::from(row[x][at % D]);
                    }
                }
                prop_assert_eq!(*fast, (slow >> shift) as u8);
            }
        }
    }

    #[test]
    fn winners_are_the_least(cells in prop::collection::vec(any::<u8>(), D)) {
        let sums: [u8; D] = cells.clone().try_into().expect("D of them");
        let mut fast = Winners::default();
        fast.resize(1);
        fast.find(std::slice::from_ref(&sums));
        let cost = *cells.iter().min().expect("some");
        let best = cells.iter().position(|c| *c == cost).expect("the least is there");
        let others = cells.iter().enumerate().filter(|(d, _)| d.abs_diff(best) > 1);
        prop_assert_eq!((usize::from(fast.disparity[0]), fast.cost[0]), (best, cost));
        prop_assert_eq!(Some(fast.second[0]), others.map(|(_, c)| *c).min());
        let beside = [cells[best.saturating_sub(1)], cells[(best + 1).min(D - 1)]];
        prop_assert_eq!([fast.below[0], fast.above[0]], beside);
    }

    #[test]
    fn judged_winners_are_unique_and_agree_from_the_right(
        rows in prop::collection::vec(prop::array::uniform5(0..12u8), 1..30),
        uniqueness in 0.0..0.5_f32,
        tolerance in 0..3u8,
    ) {
        let width = rows.len();
        let [disparity, cost, second, below, above] =
            std::array::from_fn(|i| rows.iter().map(|row| row[i]).collect::<Vec<u8>>());
        let second: Vec<u8> = second.iter().zip(&cost).map(|(s, c)| s + c).collect();
        let winners = Winners { disparity, cost, below, above, second };
        let mut disparities = vec![0.0; width];
        let mut confidences = vec![0; width];
        let mut found = RowWinners { disparities: &mut disparities, confidences: &mut confidences };
        let refused = winners.judge(uniqueness, &mut found);
        let mut buffers = FromRight::default();
        let disagree = winners.look_from_right(tolerance, &mut buffers, &mut disparities);
        let (slow, counts) = reference::judged(&winners, uniqueness, tolerance);
        prop_assert_eq!([refused.outside, refused.not_unique, disagree], counts);
        for (fast, slow) in disparities.iter().zip(slow) {
            let close = (fast - slow).abs() < 1e-5 || (fast.is_nan() && slow.is_nan());
            prop_assert!(close, "{} {}", fast, slow);
        }
    }

    #[test]
    fn speckles_equal_flooded_patches(
        values in prop::collection::vec(prop_oneof![Just(f32::NAN), 0.0..4.0_f32], 12 * 9),
        min_pixels in 0..30usize,
        step in 0.0..1.5_f32,
    ) {
        fn bits(image: &[f32]) -> Vec<u32> {
            image.iter().map(|v| v.to_bits()).collect::<Vec<u32>>()
        }

        fn holes(image: &[f32]) -> usize {
            image.iter().filter(|v| v.is_nan()).count()
        }

        let slow = reference::without_speckles(&values, 12, min_pixels, step);
        let mut fast = values.clone();
        let erased = SpeckleFilter::default().apply(&mut fast, 12, min_pixels, step);
        prop_assert_eq!(bits(&fast), bits(&slow));
        prop_assert_eq!(erased as usize, holes(&fast) - holes(&values));
    }

    #[test]
    fn any_pair_gives_what_can_be(
        pair in images(2), block: bool, max_disparity in 0..256usize, uniqueness in 0.0..0.5,
    ) {
        let method = if block { Method::Block } else { Method::SemiGlobal };
        let settings =
            StereoSettings { method, uniqueness, speckle_pixels: 3, ..StereoSettings::default() };
        let mut matcher = Matcher::new(settings).expect("valid settings");
        let found = matcher.disparities(&pair[0], &pair[1], max_disparity).expect("one size");
        prop_assert_eq!(found.values.len(), pair[0].pixels().len());
        for (at, value) in found.values.iter().enumerate() {
            let column = (at % found.width) as f32;
            // Half a pixel for the parabola, one for the refinement.
            prop_assert!(value.is_nan() || (-0.5..=column + 1.5).contains(value));
            prop_assert_eq!(value.is_nan() && found.confidences[at] > 0, false);
        }
    }
}

/// Generates a left image of smooth noise, and the right one that shows it shifted.
pub fn noise_pair(width: usize, height: usize, disparity: usize) -> (GreyImage, GreyImage) {
    fn hash(x: usize, y: usize) -> usize {
        let h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
        ((h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D) >> 24) as usize
    }

    fn mean(x: usize, y: usize) -> usize {
        (0..9).map(|i| hash(x + i % 3, y + i / 3)).sum::<usize>() / 9
    }

    let left = GreyImage::from_fn(width, height, |x, y| mean(x, y) as u8);
    let right = GreyImage::from_fn(width, height, |x, y| mean(x + disparity, y) as u8);
    (left, right)
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let (left, right) = noise_pair(90, 500, 7);
    for method in [Method::Block, Method::SemiGlobal] {
        let mut one = None;
        for threads in 1..=5 {
            let settings = StereoSettings { method, threads, ..StereoSettings::default() };
            let mut matcher = Matcher::new(settings).unwrap();
            let found = matcher.disparities(&left, &right, 20).unwrap();
            let bits: Vec<u32> = found.values.iter().map(|v| v.to_bits()).collect();
            let found = (bits, found.dropped);
            assert!(*one.get_or_insert_with(|| found.clone()) == found, "{threads} threads");
        }
    }
}

#[test]
fn a_shift_is_found() {
    let (left, right) = noise_pair(120, 60, 9);
    for method in [Method::Block, Method::SemiGlobal] {
        let settings = StereoSettings { method, ..StereoSettings::default() };
        let mut matcher = Matcher::new(settings).unwrap();
        let found = matcher.disparities(&left, &right, 31).unwrap();
        let right = found.values.iter().filter(|d| (**d - 9.0).abs() < 0.3).count();
        assert!(right > 100 * 60, "{method:?}: {right}");
        // Pixels further left are not in the right image, and the census of the last two columns
        // reads neighbours outside of it.
        let wrong: Vec<(usize, f32)> = found
            .values
            .iter()
            .enumerate()
            .map(|(at, d)| (at % 120, *d))
            .filter(|(x, d)| (9..118).contains(x) && (d - 9.0).abs() > 1.0)
            .collect();
        assert!(wrong.is_empty(), "{method:?}: {wrong:?}");
    }
}

#[test]
fn what_cannot_be_matched_is_an_error() {
    let mut matcher = Matcher::new(StereoSettings::default()).unwrap();
    let a = GreyImage::filled(8, 6, 0);
    let b = GreyImage::filled(8, 5, 0);
    let error = matcher.disparities(&a, &b, 15).unwrap_err().to_string();
    assert!(error.contains("8x6") && error.contains("8x5"), "{error}");
    let error = matcher.disparities(&a, &a, 256).unwrap_err().to_string();
    assert!(error.contains("256 px"), "{error}");
    let bad = StereoSettings { window: 4, ..StereoSettings::default() };
    assert!(Matcher::new(bad).unwrap_err().to_string().contains("`window` must be"));
}

/// Returns noise with a deviation of about `sigma` grey levels, another one for each `salt`.
fn grain(salt: u32, at: usize, sigma: f32) -> f32 {
    let uniforms = (0..4).map(|i| {
        let h = (at as u32 ^ salt.rotate_left(16)).wrapping_mul(0x9E37_79B1).wrapping_add(i);
        let h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
        ((h ^ (h >> 12)).wrapping_mul(0x297A_2D39) >> 8) as f32 / 16_777_216.0
    });
    sigma * 3.0_f32.sqrt() * (uniforms.sum::<f32>() - 2.0)
}

/// Returns a faint pattern that is shifted to the left, with grain.
fn grainy_pattern(salt: u32, shift: f32) -> GreyImage {
    fn pattern(x: f32, y: f32) -> f32 {
        90.0 + 9.0 * (0.31 * x + 0.2 * y).sin() + 9.0 * (0.43 * x).cos()
    }

    GreyImage::from_fn(200, 120, |x, y| {
        (pattern(x as f32 + shift, y as f32) + grain(salt, 200 * y + x, 1.5)).round() as u8
    })
}

#[test]
fn faint_surfaces_are_neither_too_near_nor_too_far() {
    for (method, shift) in
        [(Method::Block, 9.3), (Method::SemiGlobal, 9.3), (Method::SemiGlobal, 8.5)]
    {
        let settings = StereoSettings { method, ..StereoSettings::default() };
        let mut matcher = Matcher::new(settings).unwrap();
        let left = grainy_pattern(1, 0.0);
        let right = grainy_pattern(2, shift);
        let found = matcher.disparities(&left, &right, 31).unwrap();
        let errors: Vec<f32> = (0..found.values.len())
            .filter(|at| at % 200 > 40 && at % 200 < 190)
            .map(|at| found.values[at] - shift)
            .filter(|e| !e.is_nan())
            .collect();
        let mean = errors.iter().sum::<f32>() / errors.len() as f32;
        assert!(errors.len() > 120 * 75, "{method:?}: {}", errors.len());
        assert!(mean.abs() < 0.04, "{method:?} {shift}: {mean}");
    }
}
