//! A person at rest observed from a moving robot stays at rest in the world.

use nalgebra::{Matrix3, Vector2, Vector3};
use tagalong_core::{EgoMotion, PersonFilter};

use super::world::{DT_S, World, mean, normal3, track};
use crate::ekf::{Config, Ekf, State};

const SEEDS: u64 = 40;
const SPEED_MPS: f64 = 0.5;

fn corrected() -> Ekf {
    Ekf::new(Config { extra_sigma_m: 0.0, ..Config::default() }).unwrap()
}

/// Result of a run over all seeds, after the first two seconds.
struct Outcome {
    /// Mean velocity and position error in the robot's direction.
    velocity_bias_mps: f64,
    position_bias_m: f64,
    nis: f64,
    /// Distance to the truth after another second without sightings.
    coasted_m: f64,
}

fn run(filter: &Ekf, turn_radps: f64) -> Outcome {
    let mut velocities = vec![];
    let mut positions = vec![];
    let mut nis = vec![];
    let mut coasted = vec![];
    for seed in 0..SEEDS {
        let mut world = World::new(seed);
        let seen = world.look();
        let mut state = filter.start(&seen);
        track(filter, &mut state, &mut world, 22, |world| world.drive(SPEED_MPS, turn_radps));
        for _ in 0..20 {
            nis.extend(track(filter, &mut state, &mut world, 1, |world| {
                world.drive(SPEED_MPS, turn_radps)
            }));
            let off = state.mean.fixed_rows::<3>(0) - world.person_in_robot().coords;
            velocities.push(state.mean[3]);
            positions.push(off[0]);
        }
        coasted.push(coast(filter, state, &mut world, turn_radps));
    }
    Outcome {
        velocity_bias_mps: mean(&velocities),
        position_bias_m: mean(&positions),
        nis: mean(&nis),
        coasted_m: mean(&coasted),
    }
}

fn coast(filter: &Ekf, mut state: State, world: &mut World, turn_radps: f64) -> f64 {
    for _ in 0..(1.0 / DT_S) as usize {
        let motion = world.drive(SPEED_MPS, turn_radps);
        filter.predict(&mut state, &motion);
    }
    let (position, _) = world.of_belief(&state);
    (position - world.person.xy()).norm()
}

#[test]
fn a_standing_person_stands_still() {
    for turn_radps in [0.0, 0.2, -0.4] {
        let got = run(&corrected(), turn_radps);
        assert!(got.velocity_bias_mps.abs() < 0.02, "{}", got.velocity_bias_mps);
        assert!(got.position_bias_m.abs() < 0.005, "{}", got.position_bias_m);
        assert!(got.nis > 2.0 && got.nis < 3.1, "{}", got.nis);
        assert!(got.coasted_m < 0.3, "{}", got.coasted_m);
    }
}

#[test]
fn the_velocity_of_a_walker_is_over_ground() {
    let filter = corrected();
    let mut world = World::new(7);
    world.velocity = Vector2::new(0.4, -0.6);
    let mut state = filter.start(&world.look());
    track(&filter, &mut state, &mut world, 60, |world| {
        world.walk(0.0, 0.0);
        world.drive(SPEED_MPS, 0.3)
    });
    let (position, velocity) = world.of_belief(&state);
    assert!((velocity - world.velocity).norm() < 0.25, "{velocity}");
    assert!((position - world.person.xy()).norm() < 0.1);
}

/// A person that moves just as the filter assumes: the mean of N values of chi-squared with 3
/// degrees of freedom is 3 with variance 6 / N.
#[test]
fn the_filter_is_consistent() {
    let config = Config { extra_sigma_m: 0.0, ..Config::default() };
    let filter = Ekf::new(config.clone()).unwrap();
    let mut all = Vec::new();
    for seed in 100..100 + SEEDS {
        let mut world = World::new(seed);
        let mut state = filter.start(&world.look());
        world.velocity = config.initial_velocity_variance.sqrt() * normal3(&mut world.random).xy();
        all.extend(track(&filter, &mut state, &mut world, 40, |world| {
            world.walk(config.acceleration_noise, config.height_noise);
            world.drive(SPEED_MPS, 0.3)
        }));
    }
    let bound = 3.0 * (6.0 / all.len() as f64).sqrt();
    assert!((mean(&all) - 3.0).abs() < bound, "{} +- {bound}", mean(&all));
}

/// The same with odometry that errs as its covariance says. Without the
/// ego-motion noise the filter is too sure of itself.
#[test]
fn errors_of_the_odometry_are_accounted_for() {
    let sigma = Vector3::new(0.01, 0.01, 0.03);
    let [told, untold] = [true, false].map(|told| {
        let filter = corrected();
        let mut all = Vec::new();
        for seed in 200..200 + SEEDS {
            let mut world = World::new(seed);
            let mut state = filter.start(&world.look());
            all.extend(track(&filter, &mut state, &mut world, 40, |world| {
                world.walk(0.5, 0.07);
                let error = sigma.component_mul(&normal3(&mut world.random));
                let true_motion = world.drive(SPEED_MPS, 0.1);
                let covariance = Matrix3::from_diagonal(&sigma.component_mul(&sigma));
                EgoMotion {
                    forward: true_motion.forward + error.x,
                    left: true_motion.left + error.y,
                    turn: true_motion.turn + error.z,
                    covariance: if told { covariance } else { Matrix3::zeros() },
                    ..true_motion
                }
            }));
        }
        mean(&all)
    });
    assert!(told < 3.3, "{told}");
    assert!(untold > 4.0, "{untold}");
}
