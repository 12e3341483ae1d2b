//! Tests of each setting by its effect.

use nalgebra::{Point3, Vector2, Vector5};
use proptest::prelude::*;
use tagalong_core::{EgoMotion, Person, RgbImage};

use super::rig::{EXACT, Formula, Rig, sighting};
use crate::{Chosen, Config, Method, Random, Sampling, SamplingSteps};

/// Two people one behind the other, with uncertain positions across the view.
fn pair(config: Config) -> Rig {
    let mut rig = Rig::new(config, 5);
    rig.start(1, [2.0, 0.0, 1.6], [EXACT, 0.05, EXACT]);
    rig.start(2, [3.0, 0.1, 1.7], [EXACT, 0.05, EXACT]);
    rig
}

/// P3's form: everything is sampled.
fn drawn() -> Config {
    Config { marginalise: false, method: Method::All, ..Config::default() }
}

/// Counts the scenes of two people for which the first frame needs a likelihood.
fn scenes_of_two(config: Config) -> usize {
    let mut rig = pair(config);
    let likelihood = Formula::flat(3.0);
    rig.look(&likelihood);
    likelihood.asked().iter().filter(|scene| scene.len() == 2).count()
}

/// Number of scenes beside those of the particles: one for `support`, and six for `facing`.
const BESIDE: usize = 7;

#[test]
fn each_method_compares_as_many_scenes_as_it_says() {
    fn with(method: Method, points: usize) -> Config {
        Config { method, points, ..drawn() }
    }

    assert_eq!(scenes_of_two(with(Method::All, 50)), 625 + BESIDE);
    assert_eq!(scenes_of_two(with(Method::Table, 50)), 1281 + BESIDE);
    assert_eq!(scenes_of_two(with(Method::Kde, 50)), 50 + BESIDE);
    assert_eq!(scenes_of_two(with(Method::Gp, 30)), 30 + BESIDE);
    assert_eq!(scenes_of_two(with(Method::Partitioned, 50)), 100 + BESIDE);
    let smaller = Config { reach_near_m: 0.06, reach_far_m: 0.1, step_m: 0.02, ..drawn() };
    assert_eq!(scenes_of_two(Config { method: Method::Table, ..smaller }), 7 * 11 + BESIDE);
}

#[test]
fn there_are_as_many_particles_as_asked_for() {
    fn rows(config: Config) -> usize {
        let mut rig = pair(config);
        rig.look(&Formula::flat(3.0));
        rig.columns(2).len()
    }

    assert_eq!(rows(Config { joint_side: 7, ..drawn() }), 49);
    assert_eq!(rows(Config { particles: 80, method: Method::Partitioned, ..drawn() }), 80);
    let mut alone = Rig::new(Config { particles: 33, ..Config::default() }, 1);
    alone.start(1, [2.0, 0.0, 1.6], [0.1; 3]);
    assert_eq!(alone.columns(1).len(), 33);
}

#[test]
fn a_wide_belief_gets_as_many_particles_as_its_spread_asks() {
    fn rows(config: Config) -> usize {
        let mut rig = Rig::new(config, 2);
        rig.start(1, [2.0, 0.0, 1.6], [0.02, 0.5, EXACT]);
        rig.look(&Formula::new(|scene: &[Person]| {
            scene.iter().map(|p| -0.5 * (p.position.y / 0.15).powi(2)).sum::<f64>()
        }));
        rig.look(&Formula::flat(3.0));
        rig.columns(1).len()
    }

    let config = Config { particles: 50, max_particles: 100_000, ..Config::default() };
    let usual = rows(config.clone());
    assert!((100..400).contains(&usual), "{usual}");
    assert_eq!(rows(Config { max_particles: 70, ..config.clone() }), 70);
    assert_eq!(rows(Config { particles: 1000, ..config.clone() }), 1000);
    assert!(rows(Config { kld_error: 0.2, ..config.clone() }) < usual / 2);
    assert!(rows(Config { kld_quantile: 0.5, ..config }) < usual);
}

#[test]
fn marginalised_particles_keep_what_is_not_drawn_as_a_gaussian() {
    fn scattered(marginalise: bool) -> (f64, f64) {
        let mut rig = Rig::new(Config { marginalise, ..Config::default() }, 1);
        rig.start(1, [2.0, 0.0, 1.6], [EXACT, EXACT, 0.1]);
        rig.look(&Formula::flat(3.0));
        let points = rig.sketch(&Formula::flat(0.0)).points;
        let rows: Vec<f64> = points.iter().map(|point| point.pixel.y).collect();
        let (low, high) =
            rows.iter().fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
        (high - low, rig.estimate(1).covariance[(2, 2)].sqrt())
    }

    let ((kept, sigma), (drawn, spread)) = (scattered(true), scattered(false));
    assert!(kept < 0.1 && drawn > 5.0, "{kept} {drawn} pixels");
    assert!((sigma - 0.1).abs() < 0.005 && (spread - 0.1).abs() < 0.03, "{sigma} {spread}");
}

#[test]
fn who_is_weighed_together_keeps_depth_and_height_where_these_are_held() {
    fn spreads(hold_depth: bool, method: Method, people: i32) -> [f64; 3] {
        let config = Config { hold_depth, method, chosen: Chosen::Spread, ..drawn() };
        let mut rig = Rig::new(config, 4);
        rig.start(1, [2.0, 0.0, 1.6], [EXACT, 0.05, EXACT]);
        if people == 2 {
            rig.start(2, [3.0, 0.1, 1.7], [EXACT, 0.05, EXACT]);
        }
        (0..5).for_each(|_| drop(rig.look(&Formula::flat(3.0))));
        let covariance = rig.estimate(1).covariance;
        [covariance[(0, 0)].sqrt(), covariance[(2, 2)].sqrt(), covariance[(1, 1)].sqrt()]
    }

    for method in [Method::Table, Method::Kde, Method::Gp] {
        let [along, up, across] = spreads(true, method, 2);
        assert!(along < 1e-3 && up < 1e-3 && across > 0.05, "{along} {up} {across}");
        let [along, up, _] = spreads(false, method, 2);
        assert!(along > 0.05 && up > 0.02, "{along} {up}");
    }
    let [along, up, _] = spreads(true, Method::Kde, 1);
    assert!(along > 0.05 && up > 0.02, "alone nothing is held: {along} {up}");
}

/// Returns the velocity with which a person is rendered after frames in which a likelihood favours
/// people that face to the left.
fn faces(config: Config, people: usize, walks: Vector2<f64>) -> Vector2<f64> {
    let mut rig = Rig::new(config, 4);
    rig.start(1, [2.0, 0.0, 1.6], [0.05; 3]);
    if people == 2 {
        rig.start(2, [3.0, 0.1, 1.7], [0.05; 3]);
    }
    for frame in 1..=6 {
        let at = Point3::new(
            2.0 + 0.1 * walks.x * f64::from(frame),
            0.1 * walks.y * f64::from(frame),
            1.6,
        );
        rig.look(&Formula::new(move |scene: &[Person]| {
            let near = scene.iter().filter(|p| p.position.x < 2.5);
            let places = near.map(|p| -0.5 * ((p.position - at).norm() / 0.03).powi(2));
            let turned = scene.iter().filter(|p| p.velocity.y > 0.3).count();
            places.sum::<f64>() + 3.0 * turned as f64
        }));
    }
    let likelihood = Formula::flat(3.0);
    rig.look(&likelihood);
    let asked = likelihood.asked();
    asked.iter().flatten().find(|p| p.position.x < 2.5).unwrap().velocity
}

#[test]
fn bodies_face_where_the_image_says_or_where_they_walk() {
    let right = Vector2::new(0.0, -1.0);
    let lively = Config { initial_velocity_variance: 4.0, acceleration_noise: 4.0, ..drawn() };
    let lively = Config { marginalise: true, max_particles: 1000, particles: 1000, ..lively };
    let [by_image, by_track, of_two] =
        [(true, 1), (false, 1), (false, 2)].map(|(facing_by_image, people)| {
            faces(Config { facing_by_image, ..lively.clone() }, people, right).y
        });
    assert!(by_image > 0.9, "by the image");
    assert!(by_track < -0.3 && of_two < -0.3, "where the track walks: {by_track} {of_two}");
    let still = Vector2::zeros();
    let [of_one, of_two] = [1, 2].map(|people| {
        let calm =
            Config { initial_velocity_variance: 0.01, acceleration_noise: 0.1, ..lively.clone() };
        faces(Config { facing_by_image: false, ..calm }, people, still)
    });
    assert!(of_one.y > 0.9, "who stands alone is looked at");
    assert_eq!(of_two, still, "who stands with others faces as before");
}

#[test]
fn a_heading_turns_against_the_robot() {
    let mut rig = Rig::new(Config::default(), 4);
    rig.start(1, [2.0, 0.0, 1.6], [0.05; 3]);
    let left =
        Formula::new(|scene| 5.0 * scene.iter().filter(|p| p.velocity.y > 0.3).count() as f64);
    rig.look(&left);
    let likelihood = Formula::flat(3.0);
    rig.look_after(EgoMotion { turn: 0.5, ..EgoMotion::at_rest(0.1) }, &likelihood, &[], None);
    let faces = likelihood.asked()[0][0].velocity;
    assert!((faces - Vector2::new(0.5f64.sin(), 0.5f64.cos())).norm() < 0.05, "{faces}");
}

#[test]
fn a_part_of_the_particles_starts_again_at_a_sighting() {
    fn moved(from_detection: f64, marginalise: bool) -> usize {
        let mut rig = Rig::new(Config { from_detection, marginalise, ..Config::default() }, 4);
        rig.start(1, [2.0, 0.0, 1.6], [0.01; 3]);
        let seen = [(1, sighting(Point3::new(2.0, 0.5, 1.6), [0.01; 3]))];
        rig.look_after(EgoMotion::at_rest(0.1), &Formula::flat(3.0), &seen, None);
        rig.columns(1).iter().filter(|x| **x < 49.5 - 12.0).count()
    }

    for marginalise in [true, false] {
        let parts = [0.0, 0.1, 0.5, 1.0].map(|part| moved(part, marginalise));
        assert_eq!(parts, [0, 10, 50, 100]);
    }
}

/// Returns the number of frames, of ten, in which a person that explains this many nats is seen,
/// with a detection in all of them or in none.
fn frames_seen(config: &Config, nats: f64, sighted: bool) -> usize {
    let mut rig = Rig::new(config.clone(), 4);
    rig.start(1, [2.0, 0.0, 1.6], [0.02; 3]);
    let seen = [(1, sighting(Point3::new(2.0, 0.0, 1.6), [0.02; 3]))];
    let sightings = if sighted { &seen[..] } else { &[] };
    (0..10)
        .filter(|_| {
            !rig.look_after(EgoMotion::at_rest(0.1), &Formula::flat(nats), sightings, None)
                .is_empty()
        })
        .count()
}

#[test]
fn support_is_asked_of_who_was_found_who_was_not_and_who_was_not_for_long() {
    let config = Config {
        min_support_found: 1.0,
        min_support: 3.0,
        min_support_unfound: 5.0,
        trust_s: 0.45,
        ..Config::default()
    };
    assert_eq!([0.9, 1.1].map(|nats| frames_seen(&config, nats, true)), [0, 10]);
    assert_eq!([2.9, 3.1, 4.9, 5.1].map(|nats| frames_seen(&config, nats, false)), [0, 4, 4, 10]);
    let longer = Config { trust_s: 0.65, ..config };
    assert_eq!(frames_seen(&longer, 4.0, false), 6);
}

#[test]
fn who_is_hidden_explains_nothing_and_is_not_seen() {
    // Only the near person is visible.
    fn hidden(scene: &[Person]) -> f64 {
        7.0 * scene.iter().filter(|p| p.position.x < 2.5).count() as f64
    }

    let mut rig = pair(Config::default());
    assert_eq!(rig.look(&Formula::new(hidden)), [1]);
    assert_eq!(pair(Config::default()).look(&Formula::flat(7.0)), [1, 2]);
}

/// Returns the lateral displacements of both people over all particles in one frame without
/// information, in standard deviations of the noise.
fn displacements(config: Config, seed: u64) -> [Vec<f64>; 2] {
    let sigma = 0.3;
    let config = Config {
        joint_side: 20,
        position_noise: sigma / 0.1f64.sqrt(),
        initial_velocity_variance: 0.0,
        acceleration_noise: 0.0,
        ..config
    };
    let mut rig = Rig::new(config, seed);
    rig.start(1, [2.0, 0.0, 1.6], [EXACT; 3]);
    rig.start(2, [3.0, 0.0, 1.6], [EXACT; 3]);
    let likelihood = Formula::flat(3.0);
    rig.look(&likelihood);
    let scenes: Vec<Vec<Person>> = likelihood.asked().into_iter().take(400).collect();
    [0, 1].map(|person| scenes.iter().map(|scene| scene[person].position.y / sigma).collect())
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()
    }

    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(value.abs()))
}

#[test]
fn people_are_moved_by_noise_of_their_own() {
    let [one, other] = displacements(drawn(), 1);
    assert!(correlation(&one, &other).abs() < 0.2, "{}", correlation(&one, &other));
    assert!(largest(&one) > 2.2, "normal: {}", largest(&one));
    assert_ne!([one, other], displacements(drawn(), 2));
}

/// A scheme that replaces every step.
#[derive(Debug)]
struct Other;

impl SamplingSteps for Other {
    fn noise(&self, _: &mut Random, dimensions: &mut [Random]) -> Vector5<f64> {
        Vector5::from_fn(|i, _| dimensions[i].uniform())
    }

    fn shares_noise(&self) -> bool {
        true
    }

    fn lateral_axis(&self, _: &Vector2<f64>) -> Vector2<f64> {
        Vector2::y()
    }

    fn reports_prediction(&self) -> bool {
        true
    }
}

fn other() -> Config {
    Config { sampling: Sampling::new(Other), ..drawn() }
}

#[test]
fn a_scheme_may_share_noise_from_generators_of_the_dimensions() {
    let [one, other_one] = displacements(other(), 1);
    assert!(one.iter().zip(&other_one).all(|(a, b)| (a - b).abs() < 1e-3), "shared");
    assert!(one.iter().all(|noise| *noise > -1e-3), "uniform in 0..1");
    let again = displacements(other(), 2);
    assert!(one.iter().zip(&again[0]).all(|(a, b)| (a - b).abs() < 1e-3), "seeded alike");
}

#[test]
fn a_scheme_may_report_the_prediction() {
    fn of(config: Config) -> f64 {
        let mut rig = Rig::new(config, 1);
        rig.start(1, [2.0, 0.0, 1.6], [EXACT; 3]);
        for frame in 1..12 {
            let at = Point3::new(2.0, 0.1 * f64::from(frame), 1.6);
            rig.look(&Formula::new(move |scene: &[Person]| {
                scene.iter().map(|p| -0.5 * ((p.position - at).norm() / 0.04).powi(2)).sum()
            }));
        }
        rig.place(1).y - 1.1
    }

    let ahead = Config { sampling: Sampling::new(Ahead), ..drawn() };
    assert!(of(drawn()).abs() < 0.05 && of(ahead.clone()) > 0.04, "{}", of(ahead));
}

/// A scheme that differs in what it reports alone.
#[derive(Debug)]
struct Ahead;

impl SamplingSteps for Ahead {
    fn reports_prediction(&self) -> bool {
        true
    }
}

/// Returns the places that a table compares for a person at 45 degrees to the side.
fn table_places(config: Config) -> Vec<Point3<f64>> {
    let config = Config { method: Method::Table, ..config };
    let mut rig = Rig::new(config, 1);
    rig.start(1, [1.5, 1.5, 1.6], [EXACT; 3]);
    rig.start(2, [2.5, 2.5, 1.6], [EXACT; 3]);
    let likelihood = Formula::flat(3.0);
    rig.look(&likelihood);
    let asked = likelihood.asked();
    asked.iter().take(1281).map(|scene| scene[0].position).collect()
}

#[test]
fn places_lie_across_the_viewing_ray_or_along_the_axis_of_a_scheme() {
    let [across, along] = [drawn(), other()].map(|config| {
        let places = table_places(config);
        places[1280] - places[0]
    });
    let half = 0.6 / 2f64.sqrt();
    assert!((across.xy() - Vector2::new(-half, half)).norm() < 0.02, "{across}");
    assert!((along.xy() - Vector2::new(0.0, 0.6)).norm() < 1e-9, "{along}");
}

#[test]
fn the_compared_places_of_both_count_from_the_near_one() {
    let config = Config { method: Method::Table, position_noise: 0.0, ..drawn() };
    let mut rig = Rig::new(Config { initial_velocity_variance: 0.0, ..config }, 1);
    // The far person was met first: the columns are not in the order of depth.
    rig.start(1, [3.0, 0.2, 1.7], [EXACT; 3]);
    rig.start(2, [2.0, 0.0, 1.6], [EXACT; 3]);
    let likelihood = Formula::flat(3.0);
    rig.look(&likelihood);
    let asked: Vec<Vec<Person>> = likelihood.asked().into_iter().take(1281).collect();
    let [near, far] = [1, 0].map(|person| [0, 1280].map(|at| asked[at][person].position.y));
    assert!((near[0] + 0.3).abs() < 0.02 && (near[1] - 0.3).abs() < 0.02, "{near:?}");
    assert!((far[0] + 0.9).abs() < 0.02 && (far[1] - 0.9).abs() < 0.02, "{far:?}");
    assert!(asked.iter().all(|scene| (scene[0].position.z - 1.7).abs() < 0.01));
}

/// Two people with particles that move to their detections alone.
fn walked(swap_margin: f64, mirrored: bool) -> Rig {
    // The second person faces left, the first one towards the robot.
    fn facing(scene: &[Person]) -> f64 {
        fn fits(p: &&Person) -> bool {
            (p.velocity.y > 0.3) == (p.position.y < 0.0)
        }
        5.0 * scene.len() as f64 + 2.0 * scene.iter().filter(fits).count() as f64
    }

    let config = Config { from_detection: 1.0, swap_margin, ..Config::default() };
    let mut rig = Rig::new(config, 1);
    rig.start(1, [2.0, 0.7, 1.6], [0.02; 3]);
    rig.start(2, [2.0, -0.7, 1.6], [0.02; 3]);
    fn image(mirrored: bool) -> Option<RgbImage> {
        Some(RgbImage::from_fn(100, 80, |x, _| {
            if (x < 50) != mirrored { [200, 20, 20] } else { [20, 20, 200] }
        }))
    }
    let before = [0.7, 0.1, 0.1].map(|y| (y, false));
    for (y, mirrored) in before.into_iter().chain([(0.7, mirrored); 4]) {
        let sightings =
            [(1, y), (2, -y)].map(|(id, y)| (id, sighting(Point3::new(2.0, y, 1.6), [0.02; 3])));
        rig.look_after(EgoMotion::at_rest(0.1), &Formula::new(facing), &sightings, image(mirrored));
    }
    rig
}

#[test]
fn people_who_come_out_with_each_others_colours_get_each_others_names() {
    let crossed = walked(0.3, true);
    let straight = walked(0.3, false);
    assert!(straight.place(1).y > 0.5 && straight.place(2).y < -0.5);
    assert!(crossed.place(1).y < -0.5 && crossed.place(2).y > 0.5, "{}", crossed.place(1));
    assert!(walked(2.0, true).place(1).y > 0.5, "2 is never");
    // The headings are exchanged with the tracks.
    let mut crossed = crossed;
    let likelihood = Formula::flat(5.0);
    crossed.look(&likelihood);
    let asked = likelihood.asked();
    let [left, right] = [true, false].map(|left| {
        asked.iter().flatten().find(|p| (p.position.y > 0.0) == left).unwrap().velocity.y
    });
    assert!(left.abs() < 1e-9 && right > 0.9, "{left} {right}");
}

#[test]
fn who_is_forgotten_leaves_the_others_as_they_were() {
    // A track number that is used again has no heading from before.
    fn left(scene: &[Person]) -> f64 {
        5.0 * scene.iter().filter(|p| p.velocity.y > 0.3).count() as f64
    }

    use tagalong_core::{Filter, TrackId};
    let mut rig = pair(Config::default());
    rig.start(3, [2.5, -1.5, 1.6], [0.05; 3]);
    rig.look(&Formula::flat(3.0));
    let before = rig.place(2);
    rig.filter.stop(TrackId(1));
    assert!((rig.place(2) - before).norm() < 0.02, "{before} {}", rig.place(2));
    assert_eq!(rig.columns(1).len(), 0);
    assert_eq!(rig.columns(2).len(), Config::default().particles);
    rig.filter.stop(TrackId(2));
    assert!(!rig.columns(3).is_empty() && rig.columns(2).is_empty());
    rig.look(&Formula::new(left));
    rig.filter.stop(TrackId(3));
    rig.start(3, [2.5, 0.0, 1.6], [0.05; 3]);
    let likelihood = Formula::flat(3.0);
    rig.look(&likelihood);
    assert_eq!(likelihood.asked()[0][0].velocity, Vector2::zeros());
}

#[test]
fn three_people_are_weighed_as_whole_scenes_by_the_maps_too() {
    let mut rig = pair(Config { method: Method::Kde, joint_side: 5, ..drawn() });
    rig.start(3, [4.0, 0.0, 1.6], [EXACT, 0.05, EXACT]);
    let likelihood = Formula::flat(3.0);
    rig.look(&likelihood);
    let rows = rig.columns(1).len();
    let whole = likelihood.asked().iter().filter(|scene| scene.len() == 3).count();
    assert_eq!(rows, 25);
    assert_eq!(whole, rows + 1 + 9, "each particle, then support and facing");
}

proptest! {
    #[test]
    fn settings_out_of_range_are_refused_by_name(which in 0usize..25, above in any::<bool>()) {
        let value = if above { 1e12 } else { -1e12 };
        let mut config = Config::default();
        let count = if above { 1_000_000 } else { 0 };
        let counts = [
            ("particles", &mut config.particles), ("joint_side", &mut config.joint_side),
            ("max_particles", &mut config.max_particles), ("points", &mut config.points),
        ];
        let numbers = [
            ("kld_error", &mut config.kld_error), ("kld_quantile", &mut config.kld_quantile),
            ("acceleration_noise", &mut config.acceleration_noise),
            ("position_noise", &mut config.position_noise),
            ("height_noise", &mut config.height_noise),
            ("velocity_noise", &mut config.velocity_noise),
            ("initial_velocity_variance", &mut config.initial_velocity_variance),
            ("from_detection", &mut config.from_detection),
            ("min_support", &mut config.min_support),
            ("min_support_found", &mut config.min_support_found),
            ("min_support_unfound", &mut config.min_support_unfound),
            ("trust_s", &mut config.trust_s), ("inflate", &mut config.inflate),
            ("split_m", &mut config.split_m), ("kernel_near_m", &mut config.kernel_near_m),
            ("kernel_far_m", &mut config.kernel_far_m), ("nugget", &mut config.nugget),
            ("reach_near_m", &mut config.reach_near_m), ("reach_far_m", &mut config.reach_far_m),
            ("step_m", &mut config.step_m), ("swap_margin", &mut config.swap_margin),
        ];
        let name = match which.checked_sub(4) {
            None => {
                let (name, slot) = counts.into_iter().nth(which).unwrap();
                *slot = count;
                name
            }
            Some(which) => {
                let (name, slot) = numbers.into_iter().nth(which).unwrap();
                *slot = value;
                name
            }
        };
        let message = crate::JointParticle::new(config, 1).err().unwrap().to_string();
        prop_assert!(message.contains(&format!("`{name}`")), "{}", message);
    }
}
