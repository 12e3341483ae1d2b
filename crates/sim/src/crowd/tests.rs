use super::orca::{HalfPlane, solve};
use super::*;
use crate::random::Random;

/// Velocities of a fine grid that are not too fast.
fn grid(max_mps: f64) -> Vec<Vector2<f64>> {
    let steps = -100..=100;
    let all = steps.clone().flat_map(|x| steps.clone().map(move |y| (x, y)));
    all.map(|(x, y)| Vector2::new(f64::from(x), f64::from(y)) * (max_mps / 100.0))
        .filter(|velocity| velocity.norm() <= max_mps)
        .collect()
}

/// Largest violation of half planes, m/s.
fn violation(planes: &[HalfPlane], velocity: &Vector2<f64>) -> f64 {
    planes.iter().map(|plane| plane.violation(velocity)).fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn the_linear_program_is_as_good_as_trying_all_velocities() {
    let mut random = Random::new(7, 1);
    let grid = grid(1.5);
    let mut impossible = 0;
    for _ in 0..200 {
        // Things that stand always allow the velocity zero.
        let planes = [0.0, 0.0, 0.7, 0.7, 0.7, 0.7, 0.7].map(|most| {
            let angle = random.between(0.0, std::f64::consts::TAU);
            let normal = Vector2::new(angle.cos(), angle.sin());
            HalfPlane { normal, least: random.between(-1.2, most) }
        });
        let wanted = Vector2::new(random.between(-1.5, 1.5), random.between(-1.5, 1.5));
        let found = solve(&planes, 2, wanted, 1.5);
        assert!(found.norm() <= 1.5 + 1e-6);
        assert!(violation(&planes[..2], &found) < 1e-6, "walls hold");
        let allowed = grid.iter().filter(|velocity| violation(&planes, velocity) <= 0.0);
        let best = allowed.map(|velocity| (velocity - wanted).norm()).min_by(f64::total_cmp);
        match best {
            Some(best) => {
                assert!(violation(&planes, &found) < 1e-6, "{planes:?}");
                assert!((found - wanted).norm() < best + 1e-6, "{planes:?}");
            }
            None => {
                impossible += 1;
                let behind_walls =
                    grid.iter().filter(|velocity| violation(&planes[..2], velocity) <= 0.0);
                let least = behind_walls.map(|velocity| violation(&planes[2..], velocity));
                let least = least.min_by(f64::total_cmp).unwrap();
                assert!(violation(&planes[2..], &found) < least.max(0.0) + 1e-6, "{planes:?}");
            }
        }
    }
    assert!(impossible > 20, "{impossible}");
}

/// Time until the bodies of two agents touch at these velocities, stepped, s.
fn touch_s(me: &Agent, other: &Agent, velocity: Vector2<f64>, theirs: Vector2<f64>) -> f64 {
    let radius_m = me.radius_m + other.radius_m + 0.2;
    (0..1000)
        .find(|step| {
            let at_s = f64::from(*step) * 0.01;
            (other.place + theirs * at_s - (me.place + velocity * at_s)).norm() < radius_m - 1e-6
        })
        .map_or(f64::INFINITY, |step| f64::from(step) * 0.01)
}

#[test]
fn two_who_both_choose_do_not_touch_within_the_horizon() {
    let mut random = Random::new(3, 2);
    let settings = CrowdSettings::default();
    let blocks = Blocks::new(&[], [100.0, 100.0], 0.4);
    for _ in 0..200 {
        let pair = [50.0, 52.0].map(|x| Agent {
            place: Point2::new(x, 50.0 + random.between(-2.0, 2.0)),
            velocity: Vector2::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0)),
            radius_m: 0.3,
        });
        let chosen = [0, 1].map(|i| {
            let others = [pair[1 - i]];
            let around =
                Around { others: &others, obstacles: &[], blocks: &blocks, settings: &settings };
            around.velocity(Walk::Orca, &pair[i], pair[i].velocity, 1.5)
        });
        if (pair[0].place - pair[1].place).norm() > 0.8 {
            let at_s = touch_s(&pair[0], &pair[1], chosen[0], chosen[1]);
            assert!(at_s >= settings.horizon_s - 0.02, "{pair:?}: {at_s}");
        }
    }
}

#[test]
fn a_way_round_blocks_is_the_shortest_one() {
    let wall = Block { at: [10.0, 10.0], size_m: [0.4, 6.0], heading_deg: 0.0 };
    let blocks = Blocks::new(&[wall], [20.0, 20.0], 0.4);
    let from = Point2::new(8.0, 9.0);
    let to = Point2::new(12.0, 9.0);
    let way = blocks.route(&from, &to);
    assert_eq!(way.len(), 3, "{way:?}");
    assert!(way[0].y < 7.0 && way[1].y < 7.0, "past the nearer end: {way:?}");
    assert!(blocks.is_free(&from, &way[0]) && blocks.is_free(&way[0], &way[1]));
    assert!(blocks.hides(&from, &to) && !blocks.hides(&from, &Point2::new(8.0, 12.0)));
    assert_eq!(blocks.route(&from, &Point2::new(8.0, 12.0)), [Point2::new(8.0, 12.0)]);
    let closed = Block { at: [10.0, 10.0], size_m: [0.4, 40.0], heading_deg: 0.0 };
    let blocks = Blocks::new(&[closed], [20.0, 20.0], 0.4);
    assert_eq!(blocks.route(&from, &to), [to], "there is no way");
}

#[test]
fn scenes_without_reacting_people_are_written_as_before() {
    let text = toml::to_string(&crate::Scene::parse("[[people]]\nwander = 2\n").unwrap()).unwrap();
    for word in ["walk", "reacting", "blocks"] {
        assert!(!text.contains(word), "{word}: {text}");
    }
    for wrong in ["[reacting]\nradius_m = 0.0", "[[blocks]]\nat = [1.0, 1.0]\nsize_m = [0.0, 1.0]"]
    {
        assert!(crate::Scene::parse(wrong).is_err(), "{wrong}");
    }
}
