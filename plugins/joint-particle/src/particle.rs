use nalgebra::{Matrix2, Matrix3, Matrix5, Point2, Point3, Vector2, Vector3, Vector5};
use tagalong_core::{Detection, EgoMotion, Person};

use crate::config::Config;
use crate::random::Random;

/// One person in one particle: a Gaussian over (x, y, z, vx, vy) in the robot frame, m and m/s over
/// ground. The part that was sampled in this frame has no variance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Particle {
    pub(crate) mean: Vector5<f64>,
    pub(crate) covariance: Matrix5<f64>,
}

/// Prediction from one frame to the next: x' = F (x + shift), P' = F P F' + Q.
pub(crate) struct Transition {
    f: Matrix5<f64>,
    shift: Vector5<f64>,
    noise: Matrix5<f64>,
    motion: EgoMotion,
}

impl Transition {
    /// Creates the transition for the robot's motion.
    pub(crate) fn new(motion: &EgoMotion, config: &Config) -> Self {
        let (sin, cos) = motion.turn.sin_cos();
        let back = Matrix2::new(cos, sin, -sin, cos);
        let mut f = Matrix5::identity();
        f.fixed_view_mut::<2, 2>(0, 0).copy_from(&back);
        f.fixed_view_mut::<2, 2>(0, 3).copy_from(&(back * motion.dt));
        f.fixed_view_mut::<2, 2>(3, 3).copy_from(&back);
        let shift = Vector5::new(-motion.forward, -motion.left, 0.0, 0.0, 0.0);
        Self { f, shift, noise: process_noise(motion.dt, config), motion: *motion }
    }

    /// Predicts a particle; the noise becomes variance.
    pub(crate) fn apply(&self, particle: &mut Particle) {
        particle.mean = self.f * (particle.mean + self.shift);
        let turned = self.times(&self.times(&particle.covariance).transpose()).transpose();
        particle.covariance = turned + self.noise + ego_noise(&particle.mean, &self.motion);
    }

    /// Returns F times a matrix without the products with the zeros of F, which are half of them:
    /// places and velocities turn, places move by velocities, and the height stays.
    fn times(&self, matrix: &Matrix5<f64>) -> Matrix5<f64> {
        let f = &self.f;
        let mut product = *matrix;
        for (from, mut to) in matrix.column_iter().zip(product.column_iter_mut()) {
            for i in 0..2 {
                to[i] = f[(i, 0)] * from[0] + f[(i, 1)] * from[1];
                to[i] += f[(i, 3)] * from[3];
                to[i] += f[(i, 4)] * from[4];
                to[i + 3] = f[(i + 3, 3)] * from[3] + f[(i + 3, 4)] * from[4];
            }
        }
        product
    }
}

/// Returns the process noise. It is isotropic on the floor, so that the robot's turn does not
/// matter.
fn process_noise(dt: f64, config: &Config) -> Matrix5<f64> {
    let q = config.acceleration_noise;
    let position = q * dt.powi(3) / 3.0 + config.position_noise.powi(2) * dt;
    let velocity = q * dt + config.velocity_noise.powi(2) * dt;
    let height = config.height_noise.powi(2) * dt;
    let mut noise =
        Matrix5::from_diagonal(&Vector5::new(position, position, height, velocity, velocity));
    for axis in 0..2 {
        noise[(axis, axis + 3)] = q * dt.powi(2) / 2.0;
        noise[(axis + 3, axis)] = q * dt.powi(2) / 2.0;
    }
    noise
}

/// Returns the noise that the uncertainty of the robot's own motion adds to the position.
fn ego_noise(predicted: &Vector5<f64>, motion: &EgoMotion) -> Matrix5<f64> {
    let (sin, cos) = motion.turn.sin_cos();
    let x = predicted[0];
    let y = predicted[1];
    let by_motion = nalgebra::Matrix2x3::new(-cos, -sin, y, sin, -cos, -x);
    let mut noise = Matrix5::zeros();
    let place = by_motion * motion.covariance * by_motion.transpose();
    noise.fixed_view_mut::<2, 2>(0, 0).copy_from(&place);
    noise
}

impl Particle {
    /// Initialises the state from the first detection.
    pub(crate) fn of(detection: &Detection, config: &Config) -> Self {
        let p = detection.position;
        let mut covariance = Matrix5::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&detection.covariance);
        covariance[(3, 3)] = config.initial_velocity_variance;
        covariance[(4, 4)] = config.initial_velocity_variance;
        Self { mean: Vector5::new(p.x, p.y, p.z, 0.0, 0.0), covariance }
    }

    /// Moves the person to a detection; the velocity stays.
    pub(crate) fn move_to(&mut self, position: &Point3<f64>, covariance: &Matrix3<f64>) {
        self.mean.fixed_rows_mut::<3>(0).copy_from(&position.coords);
        self.covariance.fixed_view_mut::<3, 2>(0, 3).fill(0.0);
        self.covariance.fixed_view_mut::<2, 3>(3, 0).fill(0.0);
        self.covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(covariance);
    }

    /// Samples all five numbers from the Gaussian with independent `noise`.
    pub(crate) fn draw_all(&mut self, noise: &Vector5<f64>) {
        if let Some(root) = root(&self.covariance) {
            self.mean += root * noise;
            self.covariance = Matrix5::zeros();
        }
    }

    /// Samples the position across the viewing ray of a camera at `eye`, and conditions the rest of
    /// the Gaussian on it (Rao and Blackwell).
    pub(crate) fn draw_across(&mut self, eye: &Point2<f64>, random: &mut Random) {
        let across = across(&(self.floor() - eye));
        let h = Vector3::new(across.x, across.y, 0.0);
        let deviation = self.variance(&h).max(0.0).sqrt();
        // A measurement without noise is the same as conditioning on the sample.
        self.correct(&h, deviation * random.normal(), 0.0);
    }

    /// Takes back the changes of the last `dt_s` seconds, and their variance, along a direction on
    /// the floor and in height.
    pub(crate) fn hold(&mut self, along: &Vector2<f64>, dt_s: f64) {
        let speed = along.dot(&self.person().velocity);
        let mut free = Matrix5::identity();
        let across = Matrix2::identity() - along * along.transpose();
        free.fixed_view_mut::<2, 2>(0, 0).copy_from(&across);
        free.fixed_view_mut::<2, 2>(3, 3).copy_from(&across);
        free[(2, 2)] = 0.0;
        let back = along * speed;
        let place = self.mean.fixed_rows::<2>(0) - back * dt_s;
        let velocity = self.mean.fixed_rows::<2>(3) - back;
        self.mean.fixed_rows_mut::<2>(0).copy_from(&place);
        self.mean.fixed_rows_mut::<2>(3).copy_from(&velocity);
        self.covariance = free * self.covariance * free;
    }

    /// Returns the variance of the position along a direction.
    pub(crate) fn variance(&self, h: &Vector3<f64>) -> f64 {
        let position = self.covariance.fixed_view::<3, 3>(0, 0);
        (position * h).dot(h)
    }

    /// Updates by a measurement of the position along the direction `h` with the given variance
    /// (Kalman); `off` is its difference from the position of the mean.
    pub(crate) fn correct(&mut self, h: &Vector3<f64>, off: f64, variance: f64) {
        let ph = self.covariance.fixed_columns::<3>(0) * h;
        let total = h.dot(&ph.fixed_rows::<3>(0)) + variance;
        // Along a direction without variance the gain is undefined, and there is nothing to update.
        if total > 1e-12 {
            let gain = ph / total;
            self.mean += gain * off;
            self.covariance -= gain * ph.transpose();
            self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
        }
    }

    pub(crate) fn floor(&self) -> Point2<f64> {
        Point2::new(self.mean[0], self.mean[1])
    }

    pub(crate) fn person(&self) -> Person {
        let m = &self.mean;
        let position = Point3::new(m[0], m[1], m[2]);
        Person { position, velocity: Vector2::new(m[3], m[4]) }
    }
}

/// Returns the horizontal unit vector to the left of a viewing ray; the robot's Y axis if there is
/// none.
pub(crate) fn across(ray: &Vector2<f64>) -> Vector2<f64> {
    let length = ray.norm();
    if length > 1e-9 { Vector2::new(-ray.y, ray.x) / length } else { Vector2::y() }
}

/// Returns a square root of a covariance that may be singular; `None` if it is zero or not a
/// covariance.
fn root(covariance: &Matrix5<f64>) -> Option<Matrix5<f64>> {
    let size = covariance.trace();
    if !(size.is_finite() && size > 0.0) {
        return None;
    }
    // Cholesky needs a positive definite matrix; the ridge is far below any real variance.
    let ridge = Matrix5::identity() * (1e-12 * size);
    (covariance + ridge).cholesky().map(|c| c.unpack())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn gaussian(entries: [f64; 25]) -> Particle {
        let root = Matrix5::from_iterator(entries);
        let mean = Vector5::new(3.0, 0.5, 1.6, 0.4, -0.2);
        Particle { mean, covariance: root * root.transpose() + Matrix5::identity() * 1e-3 }
    }

    proptest! {
        /// Sampling a part and keeping the rest as a Gaussian is the same as sampling the whole:
        /// mean and covariance over many samples are those before.
        #[test]
        fn what_is_drawn_and_what_is_kept_make_up_the_whole(
            entries in prop::array::uniform25(-0.2..0.2f64), seed in 0u64..100,
        ) {
            let whole = gaussian(entries);
            let mut random = Random::new(seed, 0);
            let draws: Vec<Particle> = (0..4000).map(|_| {
                let mut particle = whole.clone();
                particle.draw_across(&Point2::origin(), &mut random);
                particle
            }).collect();
            let count = draws.len() as f64;
            let mean = draws.iter().map(|p| p.mean).sum::<Vector5<f64>>() / count;
            let spread: Matrix5<f64> = draws.iter().map(|p| {
                let off = p.mean - whole.mean;
                p.covariance + off * off.transpose()
            }).sum::<Matrix5<f64>>() / count;
            let scale = whole.covariance.trace();
            prop_assert!((mean - whole.mean).norm() < 0.1 * scale.sqrt());
            prop_assert!((spread - whole.covariance).norm() < 0.12 * scale);
        }

        #[test]
        fn a_covariance_is_predicted_by_the_whole_product(
            entries in prop::array::uniform25(-0.2..0.2f64), turn in -1.0..1.0f64, dt in 0.01..1.0f64,
        ) {
            let motion = EgoMotion { forward: 0.3, left: 0.1, turn, ..EgoMotion::at_rest(dt) };
            let transition = Transition::new(&motion, &Config::default());
            let mut particle = gaussian(entries);
            let f = &transition.f;
            let whole = f * particle.covariance * f.transpose() + transition.noise;
            transition.apply(&mut particle);
            let expected = whole + ego_noise(&particle.mean, &motion);
            prop_assert_eq!(particle.covariance, expected);
        }

        #[test]
        fn drawing_everything_leaves_no_variance(entries in prop::array::uniform25(-0.2..0.2f64)) {
            let mut particle = gaussian(entries);
            particle.draw_all(&Vector5::repeat(0.5));
            prop_assert_eq!(particle.covariance, Matrix5::zeros());
        }
    }

    #[test]
    fn who_is_held_moves_and_spreads_across_the_view_alone() {
        let mut held = gaussian([0.1; 25]);
        held.mean[4] = -0.6;
        let before = held.person();
        let along = Vector2::x();
        held.mean[0] += 0.1 * before.velocity.x;
        held.hold(&along, 0.1);
        assert!((held.person().position - before.position).norm() < 1e-12);
        assert_eq!(held.person().velocity, Vector2::new(0.0, -0.6));
        for still in [0, 2, 3] {
            assert_eq!(held.covariance.row(still).norm(), 0.0);
        }
        assert!(held.covariance[(1, 1)] > 0.0 && held.covariance[(4, 4)] > 0.0);
    }

    #[test]
    fn what_is_not_known_of_the_robots_motion_spreads_the_place() {
        let sigmas = Vector3::new(0.03, 0.02, 0.01);
        let covariance = Matrix3::from_diagonal(&sigmas.map(|s| s * s));
        let motion = EgoMotion { forward: 0.3, left: 0.1, turn: 0.4, covariance, dt: 0.1 };
        let standing =
            Particle { mean: Vector5::new(3.0, 0.5, 1.6, 0.0, 0.0), covariance: Matrix5::zeros() };
        let quiet = Config {
            acceleration_noise: 0.0,
            position_noise: 0.0,
            height_noise: 0.0,
            ..Config::default()
        };
        let mut particle = standing.clone();
        Transition::new(&motion, &quiet).apply(&mut particle);
        let mut random = Random::new(1, 0);
        let mut spread = Matrix2::zeros();
        for _ in 0..4000 {
            let parts =
                [(motion.forward, sigmas[0]), (motion.left, sigmas[1]), (motion.turn, sigmas[2])];
            let [forward, left, turn] = parts.map(|(mean, sigma)| mean + sigma * random.normal());
            let moved = EgoMotion { forward, left, turn, ..motion };
            let off = moved.apply_to_point(standing.floor()) - particle.floor();
            spread += off * off.transpose() / 4000.0;
        }
        let found = particle.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        assert!((found - spread).norm() < 0.1 * spread.norm(), "{found} {spread}");
        assert_eq!(particle.covariance[(2, 2)], 0.0);
    }

    #[test]
    fn left_of_a_viewing_ray_is_left() {
        assert_eq!(across(&Vector2::new(2.0, 0.0)), Vector2::y());
        assert_eq!(across(&Vector2::new(0.0, 3.0)), -Vector2::x());
        assert_eq!(across(&Vector2::zeros()), Vector2::y());
    }

    #[test]
    fn a_place_fixed_in_the_world_moves_as_the_robot_sees_it() {
        let motion = EgoMotion { forward: 0.3, left: 0.1, turn: 0.2, ..EgoMotion::at_rest(0.1) };
        let mut particle = gaussian([0.0; 25]);
        particle.mean[3] = 0.0;
        particle.mean[4] = 0.0;
        let expected = motion.apply_to_point(particle.floor());
        Transition::new(&motion, &Config::default()).apply(&mut particle);
        assert!((particle.floor() - expected).norm() < 1e-12);
    }
}
