use nalgebra::{Point3, Vector2};
use proptest::prelude::*;
use tagalong_core::{DepthImage, EgoMotion, Images, Stamp};
use tagalong_geometry::Pinhole;

use super::*;

fn frame(pixels: Vec<f32>) -> Frame {
    let camera = Arc::new(Camera::mounted(Pinhole::centred(80.0, 80, 60), 80, 60, 1.4, 0.1, 0.1));
    let depth = DepthImage::from_pixels(80, 60, pixels).map(Arc::new);
    let images = Images { depth, ..Images::default() };
    Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), images)
}

/// Computes the weight of a scene pixel by pixel: which person is in front at each one?
fn slow(weigher: &Weigher, frame: &Frame, scene: &[Person]) -> f64 {
    fn inside(span: Option<Span>, x: i64) -> bool {
        span.is_some_and(|(a, b)| a <= x && x < b)
    }

    let config = DepthTemplateConfig::default();
    let image = frame.derived::<Working>().unwrap();
    let mut tools = weigher.tools();
    let view = tools.view_of(frame, &image);
    let mut cast: Vec<PlacedPerson> = scene
        .iter()
        .filter_map(|p| tools.place(p, direction(p, &frame.camera), &frame.camera, &view))
        .collect();
    cast.sort_by(|a, b| a.depth_m.total_cmp(&b.depth_m));
    let mut weight = 0.0;
    for (k, person) in cast.iter().enumerate() {
        let mut sum = 0;
        let mut beside = [0, 0];
        let mut bank = Bank::new(usize::MAX);
        let rows = &bank.template(person.silhouette.pose).rows;
        for (index, row) in rows.iter().enumerate() {
            let line = person.y + rows[0].dy + index as i64;
            if line % person.silhouette.step != 0 || !(0..60).contains(&line) {
                continue;
            }
            let level = person.levels.behind(row.relief_m);
            let half = person.silhouette.half_width;
            for x in (person.x - half..=person.x + half).filter(|x| (0..80).contains(x)) {
                let pixel = tools.scores.pixel(x, line, level);
                let from = person.x + row.from;
                let to = person.x + row.to;
                let edge = person.x + row.guard_from;
                let end = person.x + row.guard_to;
                if from <= x && x < to {
                    let hidden = cast[..k].iter().any(|p| inside(p.body(line), x));
                    sum += if hidden { 0 } else { pixel.covered };
                } else if x < edge || end <= x {
                    let others = cast.iter().enumerate().filter(|(i, _)| *i != k);
                    let mut rivals = others
                        .map(|(_, p)| p)
                        .filter(|p| p.depth_m < person.depth_m + config.likelihood_tolerance_m);
                    let taken = rivals.any(|p| inside(p.body(line), x));
                    beside[usize::from(x >= end)] += if taken { 0 } else { pixel.beside };
                }
            }
        }
        let both = 2 * beside[0].min(beside[1]);
        let one = config.likelihood_one_sided * f64::from((beside[0] - beside[1]).abs());
        weight += (f64::from(sum - both) - one) / (f64::from(ONE) * person.silhouette.area);
    }
    weigher.nats * weight
}

fn person() -> impl Strategy<Value = Person> {
    let place = (1.2..5.0f64, -0.6..0.6f64, 1.2..1.9f64);
    (place, -1.0..1.0f64, -1.0..1.0f64).prop_map(|((x, slope, z), vx, vy)| Person {
        position: Point3::new(x, slope * x, z),
        velocity: Vector2::new(vx, vy),
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn runs_of_a_scene_equal_its_pixels(
        pixels in prop::collection::vec(
            prop_oneof![Just(f32::NAN), 1.0f32..2.5, 2.0f32..6.0], 80 * 60),
        scenes in prop::collection::vec(prop::collection::vec(person(), 3), 1..5),
        size in 1usize..4,
    ) {
        let scenes: Vec<&[Person]> = scenes.iter().map(|scene| &scene[..size]).collect();
        let weigher = Weigher::new(&DepthTemplateConfig::default());
        let frame = frame(pixels);
        let mut fast = Vec::new();
        weigher.log_likelihoods(&frame, &scenes.concat(), size, &mut fast).unwrap();
        prop_assert_eq!(fast.len(), scenes.len());
        for (scene, fast) in scenes.iter().zip(fast) {
            let slow = slow(&weigher, &frame, scene);
            prop_assert!((fast - slow).abs() < 1e-9, "{} {}", fast, slow);
            let alone = weigher.log_likelihood(&frame, scene).unwrap();
            prop_assert!((fast - alone).abs() < 1e-9, "in a batch {}, alone {}", fast, alone);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn people_beside_the_image_are_left_out_and_change_nothing(
        pixels in prop::collection::vec(prop_oneof![Just(f32::NAN), 1.0f32..4.0], 80 * 60),
        scene in prop::collection::vec((person(), 1.0..4.0f64), 1..4),
    ) {
        let scene: Vec<Person> = scene
            .into_iter()
            .map(|(mut person, aside)| {
                person.position.y *= aside;
                person
            })
            .collect();
        let frame = frame(pixels);
        let [some, all] = [false, true].map(|all_windows| {
            let weigher = Weigher::new(&DepthTemplateConfig::default());
            weigher.tools().all_windows = all_windows;
            weigher.log_likelihood(&frame, &scene).unwrap()
        });
        prop_assert_eq!(some, all);
    }
}

/// A wall at 5 m and people painted as their silhouettes.
fn painted(people: &[Person]) -> Frame {
    let weigher = Weigher::new(&DepthTemplateConfig::default());
    let empty = frame(vec![5.0; 80 * 60]);
    let image = empty.derived::<Working>().unwrap();
    let mut tools = weigher.tools();
    let view = tools.view_of(&empty, &image);
    let cast: Vec<PlacedPerson> = people
        .iter()
        .filter_map(|p| tools.place(p, direction(p, &empty.camera), &empty.camera, &view))
        .collect();
    let depth = DepthImage::from_fn(80, 60, |x, y| {
        let x = x as i64;
        let y = y as i64;
        let mut nearest = 5.0_f32;
        for p in cast.iter().filter(|p| p.body(y).is_some_and(|(a, b)| a <= x && x < b)) {
            let row = p.silhouette.rows.iter().find(|row| p.y + row.dy == y);
            let relief_m = row.map_or(0.0, |row| {
                with_reliefs(p.silhouette.pose, std::iter::once(row))[0].relief_m
            });
            nearest = nearest.min((p.depth_m + relief_m) as f32);
        }
        nearest
    });
    frame(depth.pixels().to_vec())
}

fn standing(x: f64, y: f64) -> Person {
    Person { position: Point3::new(x, y, 1.5), velocity: Vector2::zeros() }
}

fn weight(frame: &Frame, scene: &[Person]) -> f64 {
    let weigher = Weigher::new(&DepthTemplateConfig::default());
    weigher.log_likelihood(frame, scene).unwrap()
}

#[test]
fn a_visible_person_weighs_all_and_a_hidden_one_nothing() {
    let near = standing(1.8, 0.0);
    let hidden = standing(3.6, 0.0);
    let frame = painted(&[near]);
    let alone = weight(&frame, &[near]);
    assert!((alone - 12.0).abs() < 1.5, "{alone}");
    assert!((weight(&frame, &[near, hidden]) - alone).abs() < 0.5);
    assert!(weight(&frame, &[near, standing(3.6, 1.4)]) < alone - 6.0);
}

#[test]
fn a_person_weighs_as_much_at_any_range() {
    fn of(x: f64) -> f64 {
        weight(&painted(&[standing(x, 0.0)]), &[standing(x, 0.0)])
    }

    assert!((of(1.6) - of(3.2)).abs() < 1.5, "{} {}", of(1.6), of(3.2));
}

#[test]
fn who_stands_half_behind_another_is_weighed_by_what_is_seen() {
    let near = standing(1.8, 0.0);
    let far = standing(3.0, 0.35);
    let frame = painted(&[near, far]);
    let [there, right, left] = [0.35, 0.15, 0.6]
        .map(|y| weight(&frame, &[near, standing(3.0, y)]) - weight(&frame, &[near]));
    assert!(there > 2.0 && there > right.max(left), "{there} {right} {left}");
}

#[test]
fn the_body_faces_where_it_moves_as_seen_from_the_camera() {
    let camera = frame(vec![1.0; 80 * 60]).camera.clone();
    for (x, y, vx, vy, expected) in [
        (2.0, 0.0, 0.0, 1.0, Direction::Left),
        (2.0, 0.0, 0.0, -1.0, Direction::Right),
        (2.0, 0.0, -1.0, 0.2, Direction::Along),
        // Along the ray, not the axis.
        (2.0, 2.0, 1.0, 1.0, Direction::Along),
        // Too slow to tell.
        (2.0, 0.0, 0.0, 0.1, Direction::Along),
    ] {
        let person = Person { velocity: Vector2::new(vx, vy), ..standing(x, y) };
        assert_eq!(direction(&person, &camera), expected, "{person:?}");
    }
}

/// Renders a person with an object at the same depth beside the body, on the left, the right or
/// both sides.
fn laden(near: Person, left: bool, right: bool) -> Frame {
    let bare = painted(&[near]);
    let depth_m = near.position.x as f32 - 0.08;
    let depth = DepthImage::from_fn(80, 60, |x, y| {
        let [on_left, on_right] = [30..35, 45..50].map(|columns| columns.contains(&x));
        let is_load = (8..24).contains(&y) && (left && on_left || right && on_right);
        let seen_m = bare.depth().unwrap().get(x as i64, y as i64).unwrap_or(f32::NAN);
        if is_load { seen_m.min(depth_m) } else { seen_m }
    });
    frame(depth.pixels().to_vec())
}

#[test]
fn a_rucksack_costs_less_than_furniture_on_both_sides() {
    let near = standing(1.8, 0.0);
    let [bare, one, both] = [(false, false), (true, false), (true, true)]
        .map(|(left, right)| weight(&laden(near, left, right), &[near]));
    assert!(one < bare && (bare - one) * 3.0 < bare - both, "{bare} {one} {both}");
}

#[test]
fn who_is_behind_does_not_explain_what_is_seen_in_front() {
    let near = standing(1.8, 0.0);
    let frame = laden(standing(1.8, 0.0), true, true);
    for i in -8..=8 {
        let scene = [near, standing(3.2, 0.05 * f64::from(i))];
        let gain = weight(&frame, &scene) - weight(&frame, &[near]);
        assert!(gain < 0.05, "{i}: {gain}");
    }
}

#[test]
fn what_is_shown_of_somebody_is_what_nobody_hides() {
    assert_eq!(outside((2, 12), vec![(8, 9), (1, 3), (2, 6)]), [(6, 8), (9, 12)]);
    assert_eq!(outside((2, 12), vec![(0, 20)]), []);
    let near = standing(1.8, 0.0);
    let far = standing(3.0, 0.35);
    let frame = painted(&[near, far]);
    let weigher = Weigher::new(&DepthTemplateConfig::default());
    let scenes = [&[far][..], &[far, near], &[near]];
    let [alone, together, before] = scenes.map(|scene| -> Vec<f64> {
        let shown = weigher.visualise(&frame, scene).unwrap().unwrap();
        let ComparedPixels(runs) = shown.downcast_ref().unwrap();
        runs.iter().map(|runs| runs.iter().map(Rect::area).sum()).collect()
    });
    let [shown, whole] = [together[0], alone[0]];
    assert!(shown > 0.2 * whole && shown < 0.9 * whole, "{whole} {together:?}");
    assert_eq!(together[1], before[0]);
}

#[test]
fn the_lines_of_a_window_are_those_that_have_a_row() {
    let weigher = Weigher::new(&DepthTemplateConfig::default());
    let frame = painted(&[]);
    let image = frame.derived::<Working>().unwrap();
    let mut tools = weigher.tools();
    let view = tools.view_of(&frame, &image);
    let person = standing(2.0, 0.0);
    let placed = tools.place(&person, direction(&person, &frame.camera), &frame.camera, &view);
    let placed = placed.unwrap();
    let (first, end) = placed.lines();
    let has_row = [first - 1, first, end - 1, end].map(|line| placed.row(line).is_some());
    assert_eq!(has_row, [false, true, true, false]);
}

#[test]
fn pixels_that_are_hidden_twice_are_hidden_once() {
    let mut masks = Vec::new();
    union_of(&mut masks, [(5, 9), (1, 3), (2, 6)].into_iter());
    assert_eq!(masks, [(1, 9)]);
    assert_eq!(masked(&masks, (2, 12), |(from, to): Span| i32::try_from(to - from).unwrap()), 7);
}
