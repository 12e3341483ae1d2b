use proptest::prelude::*;
use tagalong_core::GreyImage;
use tagalong_geometry::Rect;
use tagalong_math::{RandomSource, XorShift64};

use crate::{
    Cascade, Feature, Hit, Level, Next, Node, Part, PassedWindow, Scanner, Split, Stage, grouped,
    whole,
};

pub(crate) fn noise(width: usize, height: usize, seed: u64) -> GreyImage {
    let mut random = XorShift64::new(seed | 1);
    GreyImage::from_fn(width, height, |_, _| (random.next_u64() >> 40) as u8)
}

fn part(x: usize, y: usize, width: usize, height: usize) -> Part {
    Part { x, y, width, height }
}

/// Two stages: a stump and a tree, with numbers that pass some of the noise.
pub(crate) fn small() -> Cascade {
    fn pair(at: Part, half: Part) -> Feature {
        Feature::Haar(vec![(at, -1.0), (half, 2.0)])
    }

    fn node(feature: usize, limit: f32, next: [Next; 2]) -> Node {
        Node { feature, split: Split::Below(limit), next }
    }

    fn stage(threshold: f32, trees: Vec<Vec<Node>>) -> Stage {
        Stage { threshold, trees }
    }

    let features = vec![
        pair(part(1, 1, 8, 6), part(1, 1, 4, 6)),
        pair(part(2, 3, 5, 8), part(2, 3, 5, 4)),
        Feature::Haar(vec![
            (part(0, 0, 12, 12), -1.0),
            (part(0, 0, 6, 6), 2.0),
            (part(6, 6, 6, 6), 2.0),
        ]),
    ];
    let leaf = Next::Leaf;
    let stump = vec![node(0, 0.01, [leaf(-1.0), leaf(0.6)])];
    let tree =
        vec![node(1, 0.0, [Next::Node(1), leaf(-0.5)]), node(2, 0.02, [leaf(0.75), leaf(-0.25)])];
    let stages = vec![stage(0.5, vec![stump]), stage(0.3, vec![tree])];
    Cascade { width: 12, height: 12, features, stages, calibration: Some((1.5, -2.0)) }
}

fn binary() -> Cascade {
    let split = Split::Among([0x5A5A_F00F, 1, 0xFFFF_0000, 0x1234_5678, 9, 0x8000_0001, 3, 77]);
    let node = Node { feature: 0, split, next: [Next::Leaf(1.0), Next::Leaf(-1.0)] };
    let stages = vec![Stage { threshold: 0.0, trees: vec![vec![node]] }];
    let features = vec![Feature::Binary(part(1, 2, 3, 2))];
    Cascade { width: 12, height: 12, features, stages, calibration: None }
}

/// [`small`] with rectangles that are turned by 45 degrees.
fn tilted() -> Cascade {
    fn pair(at: Part, half: Part) -> Feature {
        Feature::Tilted(vec![(at, -1.0), (half, 2.0)])
    }

    let mut cascade = small();
    cascade.features[0] = pair(part(5, 1, 4, 5), part(5, 1, 2, 5));
    cascade.features[1] = pair(part(6, 0, 6, 6), part(6, 0, 6, 3));
    cascade.stages[0].trees[0][0].split = Split::Below(0.02);
    cascade
}

/// The sum of the values in a turned part of a window: those above the diagonals from its lowest
/// corner, without those above the diagonals from its left and its right one.
fn slow_tilted(image: &GreyImage, (left, top): (usize, usize), part: &Part) -> f64 {
    fn is_above(px: i64, py: i64, (x, y): (i64, i64)) -> bool {
        (px - x + 1).abs() < y - py
    }

    let [x, y, width, height] =
        [left + part.x, top + part.y, part.width, part.height].map(|v| v as i64);
    let corners = [(x, y), (x - height, y + height), (x + width, y + width)];
    let lowest = (x + width - height, y + width + height);
    let pixels = (0..image.height()).flat_map(|y| (0..image.width()).map(move |x| (x, y)));
    let values = pixels.map(|(x, y)| {
        let [px, py] = [x, y].map(|v| v as i64);
        let [upper, left, right] = corners.map(|at| i64::from(is_above(px, py, at)));
        let count = upper - left - right + i64::from(is_above(px, py, lowest));
        count as f64 * f64::from(image.row(y)[x])
    });
    values.sum()
}

/// The sum of the values in a part of a window, pixel by pixel.
fn slow_sum(image: &GreyImage, (x, y): (usize, usize), part: &Part, value: fn(f64) -> f64) -> f64 {
    let rows = y + part.y..y + part.y + part.height;
    let columns = x + part.x..x + part.x + part.width;
    rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
        .map(|(x, y)| value(f64::from(image.row(y)[x])))
        .sum()
}

fn slow_answer(image: &GreyImage, at: (usize, usize), cascade: &Cascade, node: &Node) -> bool {
    match (&cascade.features[node.feature], node.split) {
        (Feature::Haar(parts) | Feature::Tilted(parts), Split::Below(limit)) => {
            let middle = cascade.middle();
            let area = (middle.width * middle.height) as f64;
            let sum = slow_sum(image, at, &middle, |v| v);
            let squares = slow_sum(image, at, &middle, |v| v * v);
            let contrast = (area * squares - sum * sum).sqrt();
            let is_tilted = matches!(cascade.features[node.feature], Feature::Tilted(_));
            let mut value = 0.0;
            for (part, weight) in parts {
                let sum = if is_tilted {
                    slow_tilted(image, at, part)
                } else {
                    slow_sum(image, at, part, |v| v)
                };
                value += f64::from(*weight) * sum;
            }
            value / contrast < f64::from(limit)
        }
        (Feature::Binary(first), Split::Among(bits)) => {
            let around = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)];
            let middle = slow_block(image, at, first, (1, 1));
            let pattern = around.iter().fold(0_usize, |pattern, block| {
                2 * pattern + usize::from(slow_block(image, at, first, *block) >= middle)
            });
            bits[pattern / 32] & (1 << (pattern % 32)) != 0
        }
        _ => panic!("a feature and a question that do not go together"),
    }
}

/// The sum of a block that is so many blocks right of and below the first one.
fn slow_block(
    image: &GreyImage,
    at: (usize, usize),
    first: &Part,
    (right, below): (usize, usize),
) -> f64 {
    let x = first.x + right * first.width;
    let y = first.y + below * first.height;
    slow_sum(image, at, &Part { x, y, ..*first }, |v| v)
}

/// The value of the leaf of a tree that a window comes to.
fn slow_leaf(image: &GreyImage, at: (usize, usize), cascade: &Cascade, tree: &[Node]) -> f32 {
    let mut node = &tree[0];
    loop {
        match node.next[usize::from(!slow_answer(image, at, cascade, node))] {
            Next::Leaf(value) => return value,
            Next::Node(to) => node = &tree[to],
        }
    }
}

/// The number of stages that a window passes.
fn slow_stages(image: &GreyImage, at: (usize, usize), cascade: &Cascade) -> usize {
    cascade
        .stages
        .iter()
        .take_while(|stage| {
            let leaves = stage.trees.iter().map(|tree| slow_leaf(image, at, cascade, tree));
            leaves.sum::<f32>() >= stage.threshold
        })
        .count()
}

/// The windows that pass, in OpenCV's order: the one after a window that fails the first stage is
/// skipped.
fn slow_scan(image: &GreyImage, cascade: &Cascade, step: usize) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for y in (0..=image.height() - cascade.height).step_by(step) {
        let mut x = 0;
        while x <= image.width() - cascade.width {
            let passed = slow_stages(image, (x, y), cascade);
            if passed == cascade.stages.len() {
                found.push((x, y));
            }
            x += if passed == 0 { 2 * step } else { step };
        }
    }
    found
}

#[test]
fn it_conforms() {
    tagalong_conformance::assert_conforms(crate::register);
}

proptest! {
    #[test]
    fn a_scan_finds_what_the_slow_reference_finds(
        seed: u64, width in 12..60usize, height in 12..30usize, step in 1..=2usize,
    ) {
        // From half of the size on, windows begin at each pixel instead of every second one.
        let scale = [2.0, 1.0][step - 1];
        let image = noise(width * (3 - step), height * (3 - step), seed);
        let mut level = Level::default();
        level.fill(&image, (width, height), step);
        let shrunk = GreyImage::from_pixels(width, height, level.pixels().to_vec()).unwrap();
        for cascade in [small(), binary(), tilted()] {
            let mut scanner = Scanner::default();
            let mut found = Vec::new();
            scanner.size(
                &image,
                &cascade,
                scale,
                &whole(&image),
                &|_, _| true,
                &mut |seen: PassedWindow<'_>| found.push((seen.x, seen.y)),
            );
            prop_assert_eq!(found, slow_scan(&shrunk, &cascade, step));
        }
    }

    #[test]
    fn a_size_of_its_own_is_the_image_itself(
        seed: u64, width in 1..40usize, height in 1..40usize, step in 1..=2usize,
    ) {
        let image = noise(width, height, seed);
        let mut level = Level::default();
        level.fill(&image, (width, height), step);
        prop_assert_eq!(level.pixels(), image.pixels());
        for (x, y) in [(width, height), (width / 2, height), (width, height / 3), (0, 0)] {
            let part = (0..y).flat_map(|y| &image.row(y)[..x]);
            let values: Vec<u32> = part.map(|v| u32::from(*v)).collect();
            prop_assert_eq!(level.sums()[level.offset(x, y)], values.iter().sum::<u32>());
            let squares: u32 = values.iter().map(|v| v * v).sum();
            prop_assert_eq!(level.squares()[level.offset(x, y)], squares);
        }
    }
}

#[test]
fn the_small_cascades_pass_some_windows_and_not_all() {
    for cascade in [small(), binary(), tilted()] {
        let found = slow_scan(&noise(60, 60, 3), &cascade, 2).len();
        assert!((5..300).contains(&found), "{found}");
    }
}

proptest! {
    #[test]
    fn areas_give_the_windows_that_the_whole_image_gives(
        seed: u64, scale in 1.0..3.5f64, at in prop::array::uniform4(0.0..0.8f64),
        long in prop::array::uniform4(0.05..0.3f64),
    ) {
        let image = noise(90, 70, seed);
        let cascade = small();
        let areas = [0, 2]
            .map(|k| Rect::new(90.0 * at[k], 70.0 * at[k + 1], 90.0 * long[k], 70.0 * long[k + 1]));
        // The neighbour of the last window of one area is not in the other.
        let Rect { x, y, width, height } = areas[0];
        let beside = Rect::new(x - 8.0, y - 8.0, width + 16.0, height + 16.0);
        prop_assume!(beside.iou(&areas[1]) == 0.0);
        let [in_areas, everywhere] = [&areas[..], &[whole(&image)]].map(|searched| {
            let mut scanner = Scanner::default();
            let mut hits = Vec::new();
            scanner.scan_within(
                &image,
                &cascade,
                scale,
                searched,
                |window| areas.iter().any(|area| area.contains(window.centre())),
                &mut hits,
            );
            hits.sort_by(|a, b| {
                (a.region.y, a.region.x).partial_cmp(&(b.region.y, b.region.x)).unwrap()
            });
            (hits, scanner.looked_at())
        });
        prop_assert_eq!(in_areas, everywhere);
    }

    #[test]
    fn a_part_of_a_size_is_cut_out_of_the_whole(
        seed: u64, width in 13..70usize, height in 13..60usize, x in 0..12usize, y in 0..12usize,
    ) {
        let image = noise(64, 48, seed);
        let mut level = Level::default();
        let mut cut = Level::default();
        level.fill(&image, (width, height), 1);
        let part = part(x, y, (width - x).min(20), (height - y).min(20));
        cut.fill_part(&image, (width, height), part, 1);
        for (j, row) in cut.pixels().chunks(part.width).enumerate() {
            prop_assert_eq!(row, &level.pixels()[(y + j) * width + x..][..part.width]);
        }
    }
}

#[test]
fn areas_hold_windows_that_pass() {
    let image = noise(90, 70, 8);
    let cascade = small();
    let mut scanner = Scanner::default();
    let mut hits = Vec::new();
    let area = Rect::new(30.0, 20.0, 30.0, 30.0);
    scanner.scan_within(&image, &cascade, 2.5, &[area], |_| true, &mut hits);
    assert!(!hits.is_empty() && hits.iter().all(|hit| area.contains(hit.region.centre())));
}

#[test]
fn windows_without_contrast_are_left_out() {
    let mut cascade = small();
    cascade.stages.iter_mut().for_each(|stage| stage.threshold = -9.0);
    let mut scanner = Scanner::default();
    let mut hits = Vec::new();
    let flat = GreyImage::from_fn(40, 40, |x, _| 100 + (x % 2) as u8);
    scanner.scan(&flat, &cascade, [1.0].into_iter(), &mut hits);
    assert!(hits.is_empty() && scanner.looked_at() > 100);
}

#[test]
fn a_cascade_survives_its_file() {
    fn without(cascade: &Cascade) -> Cascade {
        Cascade {
            stages: cascade.stages.iter().map(|s| Stage { threshold: 0.0, ..s.clone() }).collect(),
            ..cascade.clone()
        }
    }

    for cascade in [small(), binary(), tilted()] {
        let read = Cascade::from_xml(&cascade.to_xml()).unwrap();
        assert_eq!(without(&read), without(&cascade));
        for (a, b) in read.stages.iter().zip(&cascade.stages) {
            assert!((a.threshold - b.threshold).abs() < 1e-6);
        }
    }
}

#[test]
fn broken_files_are_refused() {
    let text = small().to_xml();
    for (from, to, why) in [
        ("<width>12", "<width>11", "feature"),
        // Turned, the rectangle from (1, 1) on reaches beyond the left border.
        ("<tilted>0", "<tilted>1", "feature 0"),
        ("<_>1 1 8 6 -1.0</_>", "<_>1 1 8</_>", "rectangle"),
        ("<stages>", "<stage>", ""),
        ("<width>12", "<width>twelve", "twelve"),
    ] {
        assert!(text.contains(from), "{from}");
        let refusal = Cascade::from_xml(&text.replace(from, to)).unwrap_err();
        assert!(!refusal.is_empty() && refusal.contains(why), "{refusal}");
    }
    assert!(Cascade::from_xml("<a/>").is_err() && Cascade::from_xml("nonsense").is_err());
}

/// The compiled form would ask the first node of each tree.
#[test]
fn a_tree_without_nodes_is_refused() {
    let mut cascade = tilted();
    cascade.stages[0].trees.push(Vec::new());
    assert_eq!(cascade.check().unwrap_err(), "one of its trees is empty");
}

#[test]
fn like_windows_are_one_face_and_single_ones_none() {
    fn hit(x: f64, y: f64, side: f64) -> Hit {
        Hit { region: Rect::new(x, y, side, side), margin: 0.5 }
    }

    let near = [hit(10.0, 10.0, 30.0), hit(11.0, 12.0, 30.0), hit(12.0, 11.0, 31.0)];
    let hits = [&near[..], &[hit(80.0, 10.0, 30.0)]].concat();
    let groups = grouped(&hits, 2);
    assert_eq!(groups.len(), 1);
    assert_eq!((groups[0].count, groups[0].strength), (3, 1.5));
    assert_eq!(groups[0].region, Rect::new(11.0, 11.0, 30.0, 30.0));
    // A chain holds together although its ends do not overlap enough.
    let chain: Vec<Hit> = (0..8).map(|k| hit(f64::from(k) * 5.0, 0.0, 30.0)).collect();
    assert_eq!(grouped(&chain, 2).len(), 1);
}

/// The results of `cv2.groupRectangles(.., 3, 0.2)` of OpenCV 4.14.
#[test]
fn groups_are_rounded_as_opencv_does() {
    fn hit(x: f64, y: f64, side: f64) -> Hit {
        Hit { region: Rect::new(x, y, side, side), margin: 0.0 }
    }

    fn mean(a: Hit, b: Hit) -> Rect {
        grouped(&[a, b, a, b], 3)[0].region
    }

    // A fifth of the larger one's side is rounded, too: 5.6 to 6, 6.4 to 6.
    fn inside(side: f64, off: f64) -> bool {
        let groups = [&[hit(0.0, 0.0, side); 5][..], &[hit(-off, 0.0, 20.0); 4]].concat();
        grouped(&groups, 3).len() == 1
    }

    // Halves go to the even number: 10.5 to 10, 11.5 to 12.
    let low = mean(hit(10.0, 11.0, 20.0), hit(11.0, 12.0, 21.0));
    assert_eq!(low, Rect::new(10.0, 12.0, 20.0, 20.0));
    let high = mean(hit(11.0, 10.0, 21.0), hit(12.0, 11.0, 22.0));
    assert_eq!(high, Rect::new(12.0, 10.0, 22.0, 22.0));
    assert!(inside(28.0, 6.0) && !inside(28.0, 7.0));
    assert!(inside(32.0, 6.0) && !inside(32.0, 7.0));
}

#[test]
fn a_smaller_group_inside_a_stronger_one_goes() {
    fn hit(x: f64, side: f64) -> Hit {
        Hit { region: Rect::new(x, x, side, side), margin: 0.1 }
    }

    let large = [hit(0.0, 60.0); 5];
    let small = [hit(20.0, 20.0); 3];
    assert_eq!(grouped(&[&large[..], &small].concat(), 2).len(), 1);
    assert_eq!(grouped(&[&large[..3], &[small[0]; 5]].concat(), 2).len(), 2);
}

/// Compiled cascades hold offsets, which are those of one layout.
#[test]
fn all_sizes_of_an_image_share_a_layout_and_other_images_and_steps_do_not() {
    fn layout(image_width: usize, width: usize, step: usize) -> (usize, usize, usize) {
        let mut level = Level::default();
        level.fill(&noise(image_width, 60, 1), (width, 30), step);
        level.layout()
    }

    assert_eq!(layout(60, 40, 1), layout(60, 50, 1));
    assert_ne!(layout(60, 40, 1), layout(80, 40, 1));
    assert_ne!(layout(60, 40, 1), layout(60, 40, 2));
}

#[cfg(feature = "train")]
mod training {
    use tagalong_config::{Example, Fitted, Trainer};
    use tagalong_conformance::patch::{candidate, frame};
    use tagalong_geometry::ImageBox;

    use super::*;
    use crate::train::CascadeTrainer;
    use crate::{Config, Training};

    const FACE: Rect = Rect { x: 28.0, y: 28.0, width: 40.0, height: 40.0 };

    /// A bright disc with two dark eyes and a mouth before a wall, or stripes; both noisy.
    fn picture(is_face: bool, seed: u64) -> GreyImage {
        let mut random = XorShift64::new(seed + 1);
        GreyImage::from_fn(96, 96, |x, y| {
            let dx = x as f64 - 48.0;
            let dy = y as f64 - 48.0;
            let eye = (dx.abs() - 8.0).hypot(dy + 6.0) < 4.0;
            let mouth = dx.abs() < 8.0 && (dy - 10.0).abs() < 2.5;
            let skin = dx.hypot(dy) < 19.0;
            let stripe = ((x + y * (seed as usize % 3)) / 6).is_multiple_of(2);
            let face = if eye || mouth {
                40.0
            } else if skin {
                200.0
            } else {
                110.0
            };
            let stripes = if stripe { 60.0 } else { 180.0 };
            let grey = if is_face { face } else { stripes };
            (grey + 25.0 * random.uniform()) as u8
        })
    }

    fn settings(stages: usize) -> Config {
        let training = Training {
            stages,
            features: 300,
            others: 150,
            fewest_others: 10,
            max_trees: 6,
            ..Training::default()
        };
        Config { min_neighbours: 2, training, ..Config::default() }
    }

    fn fitted(config: Config, begun: Option<Cascade>) -> (Fitted, Vec<f64>) {
        let mut trainer = CascadeTrainer::new(config, begun, 3).unwrap();
        for group in 0..40 {
            for is_person in [true, false] {
                let at = candidate().with_image(ImageBox::upper_body(FACE));
                let frame = frame(picture(is_person, group));
                trainer.add(&frame, &at, Example { is_person, group }).unwrap();
            }
        }
        let mut parts = vec![0.0];
        let fitted = trainer.fit(&mut |part| parts.push(part)).unwrap();
        (fitted, parts)
    }

    /// Returns a count among some figures.
    fn count_of(figures: &toml::Table, key: &str) -> i64 {
        figures[key].as_integer().expect("an integer")
    }

    #[test]
    fn a_cascade_learns_faces_and_goes_on_where_it_ended() {
        let (fitted, parts) = fitted(settings(2), None);
        assert!(parts.is_sorted() && parts.last() == Some(&1.0), "{parts:?}");
        let figures = &fitted.figures;
        // Each face in four variants, mirrored and not.
        let faces = count_of(figures, "windows_of_faces");
        assert!(faces % 8 == 0 && (8 * 20..8 * 36).contains(&faces), "{figures}");
        let [held_out, validation] = ["held_out", "validation"].map(|name| {
            let faces = count_of(figures, &format!("{name}_faces"));
            assert_eq!(faces, count_of(figures, &format!("{name}_pictures_with_faces")));
            let found = figures[&format!("{name}_found_at_1_false_alarms_a_picture")].as_float();
            assert!(found.unwrap() > 0.7, "{figures}");
            faces
        });
        assert_eq!(faces / 8 + held_out + validation, 40);
        assert_eq!(count_of(figures, "held_out_pictures_without"), held_out, "the same groups");
        let cascade = Cascade::from_xml(&fitted.model).unwrap();
        assert_eq!(figures["trees"].as_array().unwrap().len(), cascade.stages.len());
        // A complete cascade is measured again, and a longer one is cut.
        let again = self::fitted(settings(cascade.stages.len()), Some(cascade.clone())).0;
        assert_eq!(Cascade::from_xml(&again.model).unwrap().stages, cascade.stages);
        let cut = self::fitted(settings(1), Some(cascade.clone())).0;
        assert_eq!(Cascade::from_xml(&cut.model).unwrap().stages, cascade.stages[..1]);
    }

    #[test]
    fn faces_alone_and_other_sizes_are_refused() {
        let mut trainer = CascadeTrainer::new(settings(2), None, 3).unwrap();
        let error = trainer.fit(&mut |_| {}).unwrap_err().to_string();
        assert!(error.contains("both are needed"), "{error}");
        let other = Cascade::without_stages(24);
        assert!(CascadeTrainer::new(settings(2), Some(other), 3).is_err());
    }
}
