//! Tests of the filter against slow, obvious references: a Kalman filter in the world for one
//! person, a Bayes filter on a grid for two people that hide each other.

use nalgebra::{Matrix2, Rotation2, Vector2};
use tagalong_core::{EgoMotion, Person};

use super::rig::{EXACT, Formula, Rig};
use crate::{Chosen, Config, Method};

/// Kalman filter of a position and its velocity along one axis of the world.
struct Axis {
    mean: Vector2<f64>,
    covariance: Matrix2<f64>,
}

impl Axis {
    fn new(at: f64, sigma: f64, velocity_variance: f64) -> Self {
        let covariance = Matrix2::new(sigma * sigma, 0.0, 0.0, velocity_variance);
        Self { mean: Vector2::new(at, 0.0), covariance }
    }

    /// `density` of a white acceleration, and noise of position and velocity beside it.
    fn predict(&mut self, dt: f64, density: f64, place_noise: f64, velocity_noise: f64) {
        let f = Matrix2::new(1.0, dt, 0.0, 1.0);
        let white = Matrix2::new(dt.powi(3) / 3.0, dt * dt / 2.0, dt * dt / 2.0, dt) * density;
        let beside = Matrix2::new(place_noise.powi(2) * dt, 0.0, 0.0, velocity_noise.powi(2) * dt);
        self.mean = f * self.mean;
        self.covariance = f * self.covariance * f.transpose() + white + beside;
    }

    fn correct(&mut self, measured: f64, sigma: f64) {
        let gain = self.covariance.column(0) / (self.covariance[(0, 0)] + sigma * sigma);
        let row = self.covariance.row(0).into_owned();
        self.mean += gain * (measured - self.mean[0]);
        self.covariance -= gain * row;
    }
}

const DT_S: f64 = 0.2;
const LOOK_M: [f64; 3] = [0.1, 0.1, 0.06];

/// A person walks through the world past a robot on a curve; the likelihood is a Gaussian around
/// slightly wrong positions. Compares the estimate after eight frames with Kalman filters of the
/// three axes.
fn follows_kalman(config: Config, tolerance: f64) {
    let q = config.acceleration_noise;
    let place = config.position_noise;
    let velocity = config.velocity_noise;
    let height = config.height_noise;
    let mut axes = [2.4, 0.1, 1.62].map(|at| Axis::new(at, 0.15, config.initial_velocity_variance));
    axes[2].covariance[(1, 1)] = 0.0;
    let mut rig = Rig::new(config, 3);
    rig.start(1, [2.4, 0.1, 1.62], [0.15; 3]);
    let motion = EgoMotion { forward: 0.03, left: 0.005, turn: 0.03, ..EgoMotion::at_rest(DT_S) };
    let mut robot = Vector2::zeros();
    let mut heading = 0.0;
    let wrong = [0.05, -0.06, 0.02, 0.07, -0.03, -0.05, 0.06, 0.01];
    for (frame, wrong) in (1..).zip(wrong) {
        let way = 0.12 * f64::from(frame);
        let measured = [2.4 + 0.5 * way + wrong, 0.1 + way - wrong, 1.6 + 0.4 * wrong];
        axes[0].predict(DT_S, q, place, velocity);
        axes[1].predict(DT_S, q, place, velocity);
        axes[2].predict(DT_S, 0.0, height, 0.0);
        for axis in 0..3 {
            axes[axis].correct(measured[axis], LOOK_M[axis]);
        }
        robot += Rotation2::new(heading) * Vector2::new(motion.forward, motion.left);
        heading += motion.turn;
        let to_world = Rotation2::new(heading);
        let from = robot;
        let likelihood = Formula::new(move |scene| {
            let at = scene.first().map_or_else(Vector2::zeros, |p| p.position.coords.xy());
            let floor = to_world * at + from;
            let z = scene.first().map_or(0.0, |p| p.position.z);
            let off = [floor.x - measured[0], floor.y - measured[1], z - measured[2]];
            -0.5 * off.iter().zip(LOOK_M).map(|(off, sigma)| (off / sigma).powi(2)).sum::<f64>()
        });
        rig.look_after(motion, &likelihood, &[], None);
    }
    let estimate = rig.estimate(1);
    let back = Rotation2::new(-heading);
    let floor = back * (Vector2::new(axes[0].mean[0], axes[1].mean[0]) - robot);
    let speed = back * Vector2::new(axes[0].mean[1], axes[1].mean[1]);
    let found = estimate.person.position;
    assert!((found.coords.xy() - floor).norm() < tolerance * 0.06, "{found} {floor}");
    assert!((found.z - axes[2].mean[0]).abs() < tolerance * 0.03, "{found} {}", axes[2].mean[0]);
    let walks = estimate.person.velocity;
    assert!((walks - speed).norm() < tolerance * 0.2, "{walks} {speed}");
    let expected = [&axes[0], &axes[1], &axes[2]].map(|axis| axis.covariance[(0, 0)].sqrt());
    for (axis, expected) in expected.into_iter().enumerate() {
        let spread = estimate.covariance[(axis, axis)].sqrt();
        assert!((spread / expected - 1.0).abs() < 0.3 * tolerance, "{axis}: {spread} {expected}");
    }
    for (n, axis) in axes.iter().enumerate().take(2) {
        let spread = estimate.covariance[(3 + n, 3 + n)].sqrt();
        let expected = axis.covariance[(1, 1)].sqrt();
        assert!((spread / expected - 1.0).abs() < 0.3 * tolerance, "{n}: {spread} {expected}");
    }
}

/// Motion noise with a noticeable effect of every part.
fn lively() -> Config {
    Config {
        particles: 400,
        acceleration_noise: 0.3,
        position_noise: 0.15,
        height_noise: 0.1,
        velocity_noise: 0.5,
        initial_velocity_variance: 0.5,
        ..Config::default()
    }
}

#[test]
fn alone_the_belief_is_that_of_a_kalman_filter() {
    follows_kalman(lively(), 0.5);
}

#[test]
fn drawing_everything_ends_at_the_same_belief() {
    let config = Config { marginalise: false, particles: 6000, max_particles: 6000, ..lively() };
    follows_kalman(config, 0.5);
}

/// Distribution over the lateral positions of a near and a far person, as numbers on a grid.
struct Grid {
    cells: Vec<f64>,
}

const SIDE: usize = 91;
const CELL_M: f64 = 0.02;

impl Grid {
    fn at(index: usize) -> f64 {
        CELL_M * (index as f64 - 45.0)
    }

    fn new(prior: impl Fn(f64, f64) -> f64) -> Self {
        let near_by_far = (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j)));
        Self { cells: near_by_far.map(|(i, j)| prior(Self::at(i), Self::at(j))).collect() }
    }

    /// Both people are moved by independent normal noise.
    fn predict(&mut self, sigma: f64) {
        let kernel: Vec<f64> = (0..SIDE * SIDE)
            .map(|n| normal(Self::at(n / SIDE) - Self::at(n % SIDE), sigma))
            .collect();
        let old = std::mem::take(&mut self.cells);
        let near: Vec<f64> =
            (0..SIDE * SIDE).map(|n| blurred_cell(&kernel, &old, n / SIDE, n % SIDE)).collect();
        let turned: Vec<f64> = (0..SIDE * SIDE).map(|n| near[n % SIDE * SIDE + n / SIDE]).collect();
        let far = (0..SIDE * SIDE).map(|n| blurred_cell(&kernel, &turned, n % SIDE, n / SIDE));
        self.cells = far.collect();
    }

    fn look(&mut self, log: impl Fn(f64, f64) -> f64) {
        for (n, cell) in self.cells.iter_mut().enumerate() {
            *cell *= log(Self::at(n / SIDE), Self::at(n % SIDE)).exp();
        }
        let sum: f64 = self.cells.iter().sum();
        self.cells.iter_mut().for_each(|cell| *cell /= sum);
    }

    /// Returns the expected value of a function of the places of both people.
    fn expected_value(&self, value: impl Fn(f64, f64) -> f64) -> f64 {
        let each = self.cells.iter().enumerate();
        each.map(|(n, cell)| cell * value(Self::at(n / SIDE), Self::at(n % SIDE))).sum()
    }

    /// Mean and standard deviation of the near and the far person.
    fn moments(&self) -> [(f64, f64); 2] {
        let near = self.expected_value(|near, _| near);
        let far = self.expected_value(|_, far| far);
        [
            (near, self.expected_value(|at, _| (at - near).powi(2)).sqrt()),
            (far, self.expected_value(|_, at| (at - far).powi(2)).sqrt()),
        ]
    }
}

/// Returns the sum of a column of cells weighted by a row of the kernel.
fn blurred_cell(kernel: &[f64], cells: &[f64], row: usize, column: usize) -> f64 {
    (0..SIDE).map(|k| kernel[row * SIDE + k] * cells[k * SIDE + column]).sum()
}

fn normal(off: f64, sigma: f64) -> f64 {
    (-0.5 * (off / sigma).powi(2)).exp()
}

const NEAR_M: f64 = 2.0;
const FAR_M: f64 = 3.0;

/// Apparent positions of the two people in a frame: the far one explains nothing while hidden.
#[derive(Clone, Copy)]
struct ApparentPositions {
    near: f64,
    far: f64,
}

impl ApparentPositions {
    fn near_log(self, near: f64) -> f64 {
        4.0 * normal(near - self.near, 0.15)
    }

    fn far_log(self, near: f64, far: f64) -> f64 {
        let hidden = (far / FAR_M - near / NEAR_M).abs() < 0.06;
        if hidden { 0.0 } else { 4.0 * normal(far - self.far, 0.2) }
    }

    /// The same for people in the robot's axes, by their bearings.
    fn scene(self, scene: &[Person]) -> f64 {
        fn lateral(person: &Person, depth_m: f64) -> f64 {
            depth_m * person.position.y / person.position.x
        }

        let near = scene.iter().find(|p| p.position.x < 2.5).map(|p| lateral(p, NEAR_M));
        let far = scene.iter().find(|p| p.position.x >= 2.5).map(|p| lateral(p, FAR_M));
        let of_near = near.map_or(0.0, |near| self.near_log(near));
        of_near + far.map_or(0.0, |far| self.far_log(near.unwrap_or(9.0), far))
    }
}

/// The near person stands while the far one comes out from behind, a little off the prediction.
const WALK: [ApparentPositions; 4] = [
    ApparentPositions { near: 0.06, far: 0.0 },
    ApparentPositions { near: 0.02, far: 0.15 },
    ApparentPositions { near: 0.04, far: 0.3 },
    ApparentPositions { near: 0.0, far: 0.36 },
];
const PRIOR_M: [f64; 2] = [0.1, 0.15];
const STEP_NOISE: f64 = 0.2;

fn by_grid(sharp: f64) -> [(f64, f64); 2] {
    let mut grid = Grid::new(|near, far| normal(near, PRIOR_M[0]) * normal(far - 0.1, PRIOR_M[1]));
    for seen in WALK {
        grid.predict(STEP_NOISE * 0.1f64.sqrt());
        grid.look(|near, far| sharp * (seen.near_log(near) + seen.far_log(near, far)));
    }
    grid.moments()
}

fn by_particles(config: Config, seed: u64, sharp: f64) -> [(f64, f64); 2] {
    let config = Config {
        position_noise: STEP_NOISE,
        acceleration_noise: 0.0,
        height_noise: 0.0,
        initial_velocity_variance: 0.0,
        ..config
    };
    let mut rig = Rig::new(config, seed);
    rig.start(1, [NEAR_M, 0.0, 1.6], [EXACT, PRIOR_M[0], EXACT]);
    rig.start(2, [FAR_M, 0.1, 1.6], [EXACT, PRIOR_M[1], EXACT]);
    for seen in WALK {
        rig.look(&Formula::new(move |scene| sharp * seen.scene(scene)));
    }
    [(1, NEAR_M), (2, FAR_M)].map(|(id, depth_m)| {
        let estimate = rig.estimate(id);
        let position = estimate.person.position;
        (depth_m * position.y / position.x, estimate.covariance[(1, 1)].sqrt())
    })
}

/// Largest difference of the means, m, and of the standard deviations, as the logarithm of their
/// ratio.
fn apart(config: &Config, sharp: f64) -> [f64; 2] {
    let grid = by_grid(sharp);
    let mut apart = [0f64; 2];
    for seed in 0..3 {
        let found = by_particles(config.clone(), seed, sharp);
        for (found, grid) in found.iter().zip(&grid) {
            apart[0] = apart[0].max((found.0 - grid.0).abs());
            apart[1] = apart[1].max((found.1 / grid.1).ln().abs());
        }
    }
    apart
}

fn checked(config: &Config, mean_m: f64, spread: f64) {
    let [mean, log_ratio] = apart(config, 1.0);
    assert!(mean < mean_m && log_ratio < spread, "{:?}: {mean} m, {log_ratio}", config.method);
}

#[test]
fn two_who_hide_each_other_are_believed_to_be_where_a_grid_says() {
    let many = Config { particles: 4000, max_particles: 4000, ..Config::default() };
    checked(&many, 0.02, 0.12);
    let drawn = Config { marginalise: false, ..many };
    checked(&drawn, 0.02, 0.12);
    let all = Config { method: Method::All, particles: 400, joint_side: 80, ..drawn };
    checked(&all, 0.02, 0.12);
    checked(&Config { method: Method::Table, ..all.clone() }, 0.02, 0.12);
    let gp = Config { method: Method::Gp, points: 300, chosen: Chosen::Spread, ..all };
    checked(&gp, 0.03, 0.2);
}

#[test]
fn whom_a_sharp_look_leaves_few_particles_is_where_a_grid_says() {
    let config = Config { particles: 4000, max_particles: 4000, ..Config::default() };
    let [mean, log_ratio] = apart(&config, 6.0);
    assert!(mean < 0.02 && log_ratio < 0.2, "{mean} m, {log_ratio}");
}
