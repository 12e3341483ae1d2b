use std::f64::consts::TAU;

use nalgebra::Point2;

use super::*;

const WALKS: [&str; 2] = ["orca", "social-force"];

/// A room with nothing in it but people on the way from one point to another.
fn scene(walk: &str, ways: &[[[f64; 2]; 2]], more: &str) -> Scene {
    let mut text = format!(
        "duration_s = 100.0\n{more}\n[camera]\nwidth = 8\nheight = 8\nrate_hz = 0.1\n\
         [room]\nsize_m = [20.0, 20.0]\n"
    );
    for way in ways {
        text += &format!("[[people]]\nwalk = '{walk}'\nspeed_mps = 1.3\npath = {way:?}\n");
    }
    Scene::parse(&text).unwrap()
}

/// Walks for some time; calls `see` with the places of all people after every step.
fn walk(scene: &Scene, seconds: f64, mut see: impl FnMut(&[Point2<f64>])) -> Simulation {
    let mut simulation = Simulation::new(scene, 1);
    for step in 0..(seconds / 0.02) as usize {
        simulation.walk(step as f64 * 0.02, 0.02);
        see(&simulation.walkers.iter().map(|one| one.stance.place).collect::<Vec<_>>());
    }
    simulation
}

/// Least distance between two people, m.
fn nearest_m(places: &[Point2<f64>]) -> f64 {
    let pairs = (0..places.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    pairs.map(|(i, j)| (places[i] - places[j]).norm()).fold(f64::INFINITY, f64::min)
}

fn all_arrive(simulation: &Simulation) -> bool {
    simulation.walkers.iter().all(Walker::has_arrived)
}

/// People on a circle, all of whom walk to the opposite point.
fn circle(people: usize) -> Vec<[[f64; 2]; 2]> {
    fn at(angle: f64) -> [f64; 2] {
        [10.0 + 5.0 * angle.cos(), 10.0 + 5.0 * angle.sin()]
    }

    (0..people)
        .map(|i| {
            let angle = TAU * i as f64 / people as f64;
            [at(angle), at(angle + 0.5 * TAU)]
        })
        .collect()
}

#[test]
fn a_person_alone_walks_straight() {
    for name in WALKS {
        let mut aside_m = 0.0_f64;
        let scene = scene(name, &[[[4.0, 9.0], [16.0, 9.0]]], "");
        let simulation = walk(&scene, 14.0, |places| {
            aside_m = aside_m.max((places[0].y - 9.0).abs());
        });
        assert!(aside_m < 0.2, "{name}: {aside_m}");
        assert!(all_arrive(&simulation), "{name}");
    }
}

#[test]
fn two_who_meet_pass_each_other_without_touching() {
    for name in WALKS {
        for aside_m in [0.0, 0.2, -0.3] {
            let ways = [[[4.0, 9.0], [16.0, 9.0]], [[16.0, 9.0 + aside_m], [4.0, 9.0 + aside_m]]];
            let mut least_m = f64::INFINITY;
            let scene = scene(name, &ways, "");
            let simulation = walk(&scene, 16.0, |places| least_m = least_m.min(nearest_m(places)));
            assert!(least_m > 0.62, "{name} {aside_m}: {least_m}");
            assert!(all_arrive(&simulation), "{name} {aside_m}");
        }
    }
}

#[test]
fn crowds_cross_without_overlaps_or_deadlocks() {
    for name in WALKS {
        for people in [2, 3, 4, 8, 20] {
            let mut least_m = f64::INFINITY;
            let scene = scene(name, &circle(people), "");
            let simulation = walk(&scene, 40.0, |places| least_m = least_m.min(nearest_m(places)));
            assert!(least_m > 0.58, "{name} {people}: {least_m}");
            assert!(all_arrive(&simulation), "{name} {people}");
        }
    }
}

#[test]
fn a_person_passes_a_robot_that_stands_on_the_way() {
    for name in WALKS {
        let mut least_m = f64::INFINITY;
        let scene = scene(name, &[[[4.0, 9.0], [16.0, 9.0]]], "robot.start = [10.0, 9.0]");
        let simulation = walk(&scene, 16.0, |places| {
            least_m = least_m.min((places[0] - Point2::new(10.0, 9.0)).norm());
        });
        assert!(least_m > 0.56, "{name}: {least_m}");
        assert!(all_arrive(&simulation), "{name}");
    }
}

#[test]
fn people_find_the_way_round_blocks_and_back() {
    let walls = "blocks = [{ at = [10.0, 7.0], size_m = [0.4, 14.0] },\n\
        { at = [13.0, 13.0], size_m = [14.0, 0.4], heading_deg = 90.0 }]";
    for name in WALKS.into_iter().chain(["plain"]) {
        let ways = [[[4.0, 9.0], [16.0, 9.0]], [[16.0, 8.0], [4.0, 8.0]]];
        let scene = scene(name, &ways, walls);
        let mut deepest_m = 0.0_f64;
        let simulation = walk(&scene, 40.0, |places| {
            for (place, block) in
                places.iter().flat_map(|p| scene.blocks.iter().map(move |b| (p, b)))
            {
                deepest_m = deepest_m.max(0.3 - (block.nearest(place) - place).norm());
            }
        });
        if name == "plain" {
            assert!(deepest_m < 0.11, "{name}: {deepest_m}: the plain walk knows no ways");
        } else {
            assert!(deepest_m < 1e-6, "{name}: {deepest_m}");
            assert!(all_arrive(&simulation), "{name}");
        }
    }
}

#[test]
fn people_with_the_plain_walk_are_avoided_and_stay_as_they_are() {
    let mut mixed = scene("orca", &[[[4.0, 9.0], [16.0, 9.0]]], "");
    let stands = scene("plain", &[[[10.0, 9.0], [10.0, 9.1]]], "").people[0].clone();
    mixed.people.push(crate::PersonSettings { path: vec![[10.0, 9.0]], ..stands });
    let mut least_m = f64::INFINITY;
    let simulation = walk(&mixed, 16.0, |places| {
        least_m = least_m.min(nearest_m(places));
        assert_eq!(places[1], Point2::new(10.0, 9.0));
    });
    assert!(least_m > 0.58 && simulation.walkers[0].has_arrived(), "{least_m}");
}

#[test]
fn the_same_seed_gives_the_same_walks() {
    let scene = scene("orca", &circle(8), "");
    let mut first = Vec::new();
    walk(&scene, 6.0, |places| first.extend_from_slice(places));
    let mut second = Vec::new();
    walk(&scene, 6.0, |places| second.extend_from_slice(places));
    assert_eq!(first, second);
}
