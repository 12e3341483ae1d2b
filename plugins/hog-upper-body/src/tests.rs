use proptest::prelude::*;
use tagalong_core::GreyImage;
use tagalong_geometry::Rect;
use tagalong_math::{RandomSource, XorShift64};

use crate::channels::{self, DEPTH};
use crate::coverage::SIDE;
use crate::coverage::WINDOW_PX;
use crate::hog::{BINS, BLOCK, CELL};
use crate::trees::channel_numbers;
use crate::{
    Blocks, Channels, Coverage, DepthTrees, Grid, Machine, Model, NUMBERS, Scanner, Spans, Tree,
    Trees, Wanted, Window, merge, resampled, window_numbers,
};

fn noise(width: usize, height: usize, seed: u64) -> GreyImage {
    let mut random = XorShift64::new(seed | 1);
    GreyImage::from_fn(width, height, |_, _| (random.next_u64() >> 40) as u8)
}

#[test]
fn it_conforms() {
    tagalong_conformance::assert_conforms(crate::register);
}

/// Histogram of one cell, gradient by gradient, over the whole image.
fn slow_cell(pixels: &[f32], width: usize, cell: (usize, usize)) -> [f32; BINS] {
    fn centre(cell: usize) -> f32 {
        (cell * CELL) as f32 + 0.5 * CELL as f32
    }

    fn away(pixel: usize, cell: usize) -> f32 {
        (pixel as f32 - 0.5 - centre(cell)).abs()
    }

    fn near(d: f32) -> f32 {
        (1.0 - d / CELL as f32).max(0.0)
    }

    let height = pixels.len() / width;
    let roots: Vec<f32> = pixels.iter().map(|v| v.sqrt()).collect();
    let mut histogram = [0.0; BINS];
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let at = y * width + x;
            let gx = roots[at + 1] - roots[at - 1];
            let gy = roots[at + width] - roots[at - width];
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
    fn norm(v: &[f32]) -> f32 {
        v.iter().map(|v| v * v).sum::<f32>().sqrt()
    }

    let image = noise(50, 42, 9);
    let pixels: Vec<f32> = image.pixels().iter().map(|v| f32::from(*v)).collect();
    let mut blocks = Blocks::default();
    blocks.fill(&pixels, 50, &Spans::whole(50, 42));
    assert_eq!((blocks.columns(), blocks.rows()), (5, 4));
    for (x, y) in [(0, 0), (3, 1), (4, 3)] {
        let cells = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
        let mut slow: Vec<f32> =
            cells.iter().flat_map(|cell| slow_cell(&pixels, 50, *cell)).collect();
        let length = norm(&slow) + 0.1 * BLOCK as f32 / 255.0_f32.sqrt();
        slow.iter_mut().for_each(|v| *v = (*v / length).min(0.2));
        let length = norm(&slow) + 1e-3;
        for (fast, slow) in blocks.from(x, y).iter().zip(&slow) {
            assert!((fast - slow / length).abs() < 1e-3, "{fast} {}", slow / length);
        }
    }
}

/// All windows of some sizes that a closure allows.
fn scan(
    scanner: &mut Scanner,
    image: &GreyImage,
    sides: &[f64],
    part: impl Fn(&Rect) -> bool,
) -> Vec<Window> {
    let sides = sides.iter().copied();
    let mut found = Vec::new();
    scanner.scan(
        image,
        sides,
        f32::NEG_INFINITY,
        |grid: &Grid, wanted: &mut Vec<Wanted>| {
            wanted.extend(grid.windows(|square| part(square).then_some(None)));
        },
        &mut found,
    );
    found
}

/// True for sums that differ by little, or that are both of rejected windows.
fn same(a: f32, b: f32, by: f32) -> bool {
    a == b || (a - b).abs() <= by
}

fn linear() -> Model {
    let weights = (0..NUMBERS).map(|i| ((i * 37 % 101) as f32 - 50.0) * 0.02).collect();
    let machine = Machine::Linear { weights, bias: 0.25 };
    Model { machine, coverage: Coverage::UpperBody, slope: 1.0, offset: 0.0, depth: None }
}

const TREE: Tree = Tree { numbers: [0, 9, 63], below: [0.5; 3], values: [1.0, 2.0, 3.0, 4.0] };

/// Trees that reject some windows.
fn trees() -> Model {
    trees_of(Coverage::UpperBody)
}

fn trees_of(coverage: Coverage) -> Model {
    let most = channel_numbers(coverage);
    let trees = (1..30).map(|k| Tree {
        numbers: [k * 131, k * 57 + 9, k * 733 + 1].map(|n| (n % most) as u16),
        below: [0.5, 0.12, 0.3],
        values: [0.25, -0.5, 1.0, -0.125],
    });
    let trees = Trees::new(trees.collect(), -11.0);
    Model { machine: Machine::Trees(trees), coverage, slope: 1.0, offset: 0.0, depth: None }
}

#[test]
fn a_scan_gives_each_window_the_sum_of_its_numbers() {
    let image = noise(160, 130, 4);
    for model in [linear(), trees(), trees_of(Coverage::WholeBody)] {
        let mut scanner = Scanner::new(&model);
        let windows = scan(&mut scanner, &image, &[32.0, 45.0], |_| true);
        assert_eq!(scanner.looked_at(), windows.len() as u64);
        assert!(windows.len() > 100, "{}", windows.len());
        // At the edge of the resampled part, cells have other neighbours.
        let mut inner = windows.clone();
        inner.retain(|window| {
            let r = crate::window_of(&window.region, model.coverage);
            r.x > 0.0 && r.y > 0.0 && r.right() < 160.0 && r.bottom() < 130.0
        });
        let different = inner.iter().filter(|window| {
            let numbers = window_numbers(&image, &window.region, model.layout());
            !same(window.sum, model.sum_of(&numbers), 2e-2)
        });
        let different = different.count();
        // A value may lie so close to its threshold that the two ways differ.
        assert!(inner.len() > 20 && different * 50 <= inner.len(), "{different}");
        let given_up = inner.iter().filter(|w| w.sum == f32::NEG_INFINITY).count();
        let some = 1..inner.len();
        assert!(model == linear() || some.contains(&given_up), "{given_up}");
    }
}

/// Values of a cell, pixel by pixel, before the normalisation by neighbours.
fn slow_channels(pixels: &[f32], width: usize, cell: (usize, usize)) -> [f32; DEPTH] {
    let bins = DEPTH - 2;
    let mut numbers = [0.0; DEPTH];
    let count = (channels::CELL * channels::CELL) as f32;
    let pixels: Vec<f32> = pixels.iter().map(|v| v / 255.0).collect();
    for y in 1 + cell.1 * channels::CELL..1 + (cell.1 + 1) * channels::CELL {
        for x in 1 + cell.0 * channels::CELL..1 + (cell.0 + 1) * channels::CELL {
            let at = y * width + x;
            let gx = (pixels[at + 1] - pixels[at - 1]) / 2.0;
            let gy = (pixels[at + width] - pixels[at - width]) / 2.0;
            let length = gx.hypot(gy);
            let angle = gy.atan2(gx).rem_euclid(std::f32::consts::PI);
            let at_bin = angle / std::f32::consts::PI * bins as f32;
            numbers[0] += pixels[at] / count;
            numbers[1] += length / count;
            for bin in 0..bins {
                let off = (at_bin - bin as f32).abs();
                let off = off.min(bins as f32 - off);
                numbers[2 + bin] += length * (1.0 - off).max(0.0) / count;
            }
        }
    }
    numbers
}

/// The weighted mean of a number of the cells around a cell, over those that exist.
fn mean_around(
    [x, y]: [i64; 2],
    [columns, rows]: [i64; 2],
    weights: &[f32],
    number: &dyn Fn(i64, i64) -> f32,
) -> f32 {
    let reach = weights.len() as i64 / 2;
    let mut sum = 0.0;
    let mut total = 0.0;
    for (y, v) in (y - reach..).zip(weights) {
        for (x, w) in (x - reach..).zip(weights) {
            if (0..columns).contains(&x) && (0..rows).contains(&y) {
                sum += v * w * number(x, y);
                total += v * w;
            }
        }
    }
    sum / total
}

#[test]
fn channels_are_those_of_the_slow_reference() {
    let image = noise(50, 42, 21);
    let pixels: Vec<f32> = image.pixels().iter().map(|v| f32::from(*v)).collect();
    let mut channels = Channels::default();
    channels.fill(&pixels, 50, &Spans::whole(50, 42));
    let size = [12, 10];
    let cells: Vec<[f32; DEPTH]> =
        (0..120).map(|k| slow_channels(&pixels, 50, (k % 12, k / 12))).collect();
    for (x, y) in [(0, 0), (5, 4), (11, 9), (3, 0)] {
        for k in 0..DEPTH {
            let slow = mean_around([x, y], size, &[1.0, 2.0, 1.0], &|x, y| {
                let weights = [1.0, 2.0, 3.0, 2.0, 1.0];
                let around = mean_around([x, y], size, &weights, &|x, y| {
                    cells[(y * size[0] + x) as usize][1]
                });
                let own = cells[(y * size[0] + x) as usize][k];
                own / if k == 0 { 1.0 } else { around + 0.005 }
            });
            let fast = channels.from(x as usize, y as usize)[k];
            assert!((fast - slow).abs() < 1e-3, "({x}, {y}) {k}: {fast} {slow}");
        }
    }
}

#[test]
fn two_people_one_behind_the_other_both_stay() {
    fn window(x: f64, depth_m: Option<f64>, sum: f32) -> Window {
        Window { region: Rect::new(x, 0.0, 50.0, 50.0), depth_m, sum }
    }

    fn merged(a: Option<f64>, b: Option<f64>) -> Vec<Window> {
        let mut windows = vec![window(0.0, a, 1.0), window(5.0, b, 2.0)];
        merge(&mut windows, Coverage::UpperBody, 0.4, 0.4);
        windows
    }

    assert_eq!(merged(Some(2.0), Some(2.1)).len(), 1);
    assert_eq!(merged(Some(2.0), Some(2.6)).len(), 2);
    assert_eq!(merged(None, Some(2.6)).len(), 1);
    assert_eq!(merged(None, None)[0].sum, 2.0);
}

#[test]
fn whole_bodies_side_by_side_are_told_apart_by_their_boxes() {
    fn at(y: f64, sum: f32) -> Window {
        Window { region: Rect::new(0.0, y, 50.0, 50.0), depth_m: None, sum }
    }

    fn left(coverage: Coverage) -> usize {
        let mut windows = vec![at(0.0, 2.0), at(25.0, 1.0)];
        merge(&mut windows, coverage, 0.4, 0.4);
        windows.len()
    }

    // The squares have a third in common, the bodies seven tenths.
    assert_eq!([Coverage::UpperBody, Coverage::WholeBody].map(left), [2, 1]);
}

#[test]
fn a_model_survives_its_file_and_a_wrong_one_is_refused() {
    let depth = Some(DepthTrees { slope: 0.5, offset: 0.25, ..DepthTrees::new(vec![TREE]) });
    let kept = Model { slope: 3.0, offset: -1.0, depth, ..trees() };
    let broken = kept.to_text().unwrap().replace("slope = 0.5", "slope = 0.0");
    assert!(Model::from_text(&broken).unwrap_err().contains("depth channel"));
    assert_eq!(Model::from_text(&kept.to_text().unwrap()).unwrap(), kept);
    let model = Model { slope: 2.5, offset: -1.5, ..linear() };
    let text = model.to_text().unwrap();
    assert_eq!(Model::from_text(&text).unwrap(), model);
    assert!((model.log_odds(model.sum_at(0.5)) - 0.5).abs() < 1e-5);
    for (from, to, why) in [
        ("hog-upper-body 3", "hog 9", "format"),
        ("slope = 2.5", "slope = -2.5", "slope"),
        ("\"linear\"", "\"trees\"", "trees"),
    ] {
        let refusal = Model::from_text(&text.replace(from, to)).unwrap_err();
        assert!(refusal.contains(why), "{refusal}");
    }
    assert!(Model::from_text("nonsense").is_err());
    assert_eq!(WINDOW_PX, (SIDE + 1) * CELL);
}

/// Whether a square lies in a slanted stripe of some width, and there in one of `every` columns.
fn is_in_stripe(square: &Rect, slope: f64, width: f64, every: usize) -> bool {
    let across = square.x - 80.0 - slope * (square.y - 40.0);
    across.abs() < width && ((square.x / 10.0) as usize).is_multiple_of(every)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn a_part_of_the_image_gives_the_same_windows(
        slope in -2.0..2.0f64, width in 10.0..90.0f64, every in 1..4_usize,
    ) {
        fn order(window: &Window) -> [i64; 3] {
                let region = window.region;
                [region.width, region.y, region.x].map(|v| (v * 1e3) as i64)
            }

        let image = noise(200, 150, 4);
        let sides = [40.0, 52.0];
        for model in [linear(), trees(), trees_of(Coverage::WholeBody)] {
            let mut all = scan(&mut Scanner::new(&model), &image, &sides, |_| true);
            all.retain(|window| is_in_stripe(&window.region, slope, width, every));
            let mut some = scan(&mut Scanner::new(&model), &image, &sides, |square| {
                is_in_stripe(square, slope, width, every)
            });
            all.sort_by_key(order);
            some.sort_by_key(order);
            prop_assert_eq!(all.len(), some.len());
            for (a, b) in all.iter().zip(&some) {
                prop_assert_eq!(a.region, b.region);
                prop_assert!(same(a.sum, b.sum, 1e-3), "{} {}", a.sum, b.sum);
            }
        }
    }
}

proptest! {
    #[test]
    fn a_plane_stays_a_plane_in_every_size(
        step in 0.4..4.0f64, x in 20.0..40.0f64, y in 20.0..30.0f64,
    ) {
        let image = GreyImage::from_fn(120, 90, |x, y| (x + y) as u8);
        let found = resampled(&image, (x, y), step, [1, 1]);
        for (index, value) in found.iter().enumerate() {
            let i = (index % 10) as f64 + 0.5;
            let j = (index / 10) as f64 + 0.5;
            let expected = x + i * step - 0.5 + y + j * step - 0.5;
            prop_assert!((f64::from(*value) - expected).abs() < 0.35, "{value} {expected}");
        }
    }
}

/// Returns a sample pixel by pixel: a triangle as wide as the step, or as a pixel.
fn slow_sample(image: &GreyImage, (x, y): (f64, f64), step: f64) -> f64 {
    let reach = step.max(1.0);
    let mut sum = 0.0;
    let mut total = 0.0;
    for row in -60..160_i64 {
        for column in -60..160_i64 {
            let [across, down] = [(column, x), (row, y)]
                .map(|(at, centre)| (1.0 - (at as f64 + 0.5 - centre).abs() / reach).max(0.0));
            let weight = across * down;
            let right = image.width() as i64 - 1;
            let bottom = image.height() as i64 - 1;
            let value = image.row(row.clamp(0, bottom) as usize)[column.clamp(0, right) as usize];
            sum += weight * f64::from(value);
            total += weight;
        }
    }
    sum / total
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn samples_are_those_of_the_slow_reference(
        step in 0.4..4.0f64, x in -40.0..60.0f64, y in -40.0..50.0f64,
    ) {
        let image = noise(57, 43, 8);
        for (index, value) in resampled(&image, (x, y), step, [1, 1]).iter().enumerate().step_by(7) {
            let i = (index % 10) as f64 + 0.5;
            let j = (index / 10) as f64 + 0.5;
            let slow = slow_sample(&image, (x + i * step, y + j * step), step);
            prop_assert!((f64::from(*value) - slow).abs() < 0.02, "{index}: {value} {slow}");
        }
    }

    #[test]
    fn a_grid_has_all_windows_with_their_square_in_the_image(
        width in 80..200usize, height in 80..200usize, side in 16.0..60.0f64,
    ) {
        let grid = Grid::new((width, height), side);
        let right = width as f64 + 1e-9;
        let bottom = height as f64 + 1e-9;
        let columns = grid.columns.clone();
        let rows = grid.rows.clone();
        for (x, y, is) in [
            (columns.start, rows.start, true),
            (columns.end - 1, rows.end - 1, true),
            (columns.start - 1, rows.start, false),
            (columns.start, rows.start - 1, false),
            (columns.end, rows.start, false),
            (columns.start, rows.end, false),
        ] {
            let square = grid.square(x, y);
            let starts_inside = square.x > -1e-9 && square.y > -1e-9;
            let is_inside = starts_inside && square.right() < right && square.bottom() < bottom;
            prop_assert_eq!(is_inside, is, "{} {}: {:?}", x, y, square);
            prop_assert_eq!((square.width, square.height), (side, side));
            // The window begins at its cell, of 8 pixels of the resampled image.
            let window = crate::window_of(&square, Coverage::UpperBody);
            let cell = side / (0.5 * WINDOW_PX as f64) * 8.0;
            prop_assert!((window.x - x as f64 * cell).abs() < 1e-9);
            prop_assert!((window.y - y as f64 * cell).abs() < 1e-9);
            prop_assert!((window.width - 2.0 * side).abs() < 1e-9);
        }
        let mut order = Vec::new();
        let some = grid.windows(|square| (square.x > 10.0).then_some(Some(2.0)));
        order.extend(some.map(|window| (window.y, window.x)));
        prop_assert!(order.is_sorted());
        let expected = columns.filter(|x| grid.square(*x, 0).x > 10.0).count() * rows.count();
        prop_assert_eq!(order.len(), expected);
    }
}

#[cfg(feature = "train")]
mod training {
    use tagalong_config::{Example, Trainer};
    use tagalong_conformance::patch::{candidate, frame};
    use tagalong_core::Detection;
    use tagalong_geometry::ImageBox;

    use super::*;
    use crate::train::HogTrainer;
    use crate::{Kind, Training};

    const SQUARE: Rect = Rect { x: 28.0, y: 24.0, width: 40.0, height: 40.0 };

    /// A dark head above dark shoulders, or bars of a width that depends on the seed; both noisy.
    fn picture(is_person: bool, seed: u64) -> GreyImage {
        let mut random = XorShift64::new(seed + 1);
        GreyImage::from_fn(96, 96, |x, y| {
            let dx = x as f64 - 48.0;
            let dy = y as f64 - 38.0;
            let dark = if is_person {
                dx.hypot(dy) < 9.0 || (dy > 12.0 && dx.abs() < 19.0)
            } else {
                (x / (5 + seed as usize % 9)).is_multiple_of(2)
            };
            (if dark { 60.0 } else { 150.0 } + 20.0 * random.uniform()) as u8
        })
    }

    fn at(square: Rect) -> Detection {
        candidate().with_image(ImageBox::upper_body(square))
    }

    fn trainer(kind: Kind) -> HogTrainer {
        let training = Training {
            epochs: 10,
            trees: 64,
            numbers: 64,
            random_windows: 3,
            mining_rounds: 1,
            mined_per_picture: 5,
            ..Training::default()
        };
        let mut trainer = HogTrainer::new(kind.into(), training, 3).unwrap();
        for group in 0..40 {
            for is_person in [true, false] {
                let frame = frame(picture(is_person, group));
                trainer.add(&frame, &at(SQUARE), Example { is_person, group }).unwrap();
            }
        }
        // Half of this window is beside the picture.
        let cut_off = at(Rect { x: -20.0, ..SQUARE });
        let example = Example { is_person: true, group: 99 };
        trainer.add(&frame(picture(true, 99)), &cut_off, example).unwrap();
        trainer
    }

    /// Returns a count among some figures.
    fn count_of(figures: &toml::Table, key: &str) -> i64 {
        figures[key].as_integer().expect("an integer")
    }

    #[test]
    fn both_machines_learn_to_tell_heads_from_bars() {
        for kind in [Kind::Linear, Kind::Trees] {
            let mut parts = vec![0.0];
            let fitted = trainer(kind).fit(&mut |part| parts.push(part)).unwrap();
            assert!(parts.is_sorted() && parts.last() == Some(&1.0), "{parts:?}");
            let figures = &fitted.figures;
            // Eight windows of each person that is fitted; a tenth and a fifth are held out.
            let people = count_of(figures, "windows_of_people");
            assert!(people % 8 == 0 && (8 * 22..8 * 35).contains(&people), "{figures}");
            // One window of each small picture of the same groups, and the mined ones.
            let mined = figures["mined"].as_array().unwrap()[0].as_integer().unwrap();
            assert_eq!(count_of(figures, "windows_of_others"), people / 8 + mined);
            assert!(mined <= 5 * people / 8, "{figures}");
            assert_eq!(count_of(figures, "pictures_without_people"), 40);
            assert_eq!(count_of(figures, "people_cut_off"), 1);
            assert!((1..18).contains(&count_of(figures, "held_out_people")), "{figures}");
            assert!(count_of(figures, "held_out_windows_of_others") > 100, "{figures}");
            let accepted = figures["held_out_people_accepted"].as_float().unwrap();
            let area = figures["area_under_roc_of_near_misses"].as_float().unwrap();
            assert!(accepted > 0.9 && (0.5..=1.0).contains(&area), "{figures}");
            let model = Model::from_text(&fitted.model).unwrap();
            for seed in 100..110 {
                let [person, bars] = [true, false].map(|is_person| {
                    let numbers = window_numbers(&picture(is_person, seed), &SQUARE, kind);
                    model.log_odds(model.sum_of(&numbers))
                });
                assert!(person > 0.0 && bars < person, "{kind:?} {seed}: {person} {bars}");
            }
        }
    }

    #[test]
    fn people_alone_are_no_training_set() {
        let mut trainer = HogTrainer::new(Kind::Linear.into(), Training::default(), 3).unwrap();
        for group in 0..10 {
            let example = Example { is_person: true, group };
            trainer.add(&frame(picture(true, group)), &at(SQUARE), example).unwrap();
        }
        assert!(trainer.fit(&mut |_| {}).unwrap_err().to_string().contains("both are needed"));
    }

    #[test]
    fn settings_that_cannot_work_are_refused() {
        fn of(training: Training) -> bool {
            HogTrainer::new(Kind::Linear.into(), training, 1).is_ok()
        }

        assert!(of(Training::default()));
        assert!(!of(Training { person_penalty: 0.0, ..Training::default() }));
        assert!(!of(Training { other_penalty: f64::INFINITY, ..Training::default() }));
        assert!(!of(Training { epochs: 0, ..Training::default() }));
        assert!(!of(Training { trees: 0, ..Training::default() }));
    }
}
