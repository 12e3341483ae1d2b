use nalgebra::{Matrix2, Matrix3, Point3, SMatrix, SVector, Vector2, Vector3, Vector5};
use tagalong_config::check_settings;
use tagalong_core::{
    Detection, EgoMotion, Estimate, Person, PersonFilter, Result, Update, match_moments,
};
use tagalong_geometry::Camera;

use crate::ekf::Config;

type Matrix5 = SMatrix<f64, 5, 5>;
type Matrix5x3 = SMatrix<f64, 5, 3>;

/// A coordinate with a larger variance, m², was not measured.
const UNMEASURED_M2: f64 = 100.0;

/// Rounds in which the weight of a detection is found; it settles at once.
const STUDENT_ROUNDS: usize = 2;

/// Gaussian state of a person.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// (x, y, z, vx, vy) in the robot frame: m, m/s over ground.
    pub mean: SVector<f64, 5>,
    /// Its covariance.
    pub covariance: SMatrix<f64, 5, 5>,
}

/// The filter.
pub struct Ekf {
    config: Config,
}

impl Ekf {
    /// A filter.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        Ok(Self { config })
    }

    /// Measurement covariance R, m².
    fn measurement(&self, detection: &Detection) -> Matrix3<f64> {
        detection.covariance + Matrix3::identity() * self.config.extra_sigma_m.powi(2)
    }

    /// Process noise. It is isotropic on the floor, so that it is the same in
    /// the axes before and after the robot's turn.
    fn process_noise(&self, dt: f64) -> Matrix5 {
        let q = self.config.acceleration_noise;
        let position = q * dt.powi(3) / 3.0;
        let cross = q * dt.powi(2) / 2.0;
        let velocity = q * dt;
        let height = self.config.height_noise.powi(2) * dt;
        let mut noise =
            Matrix5::from_diagonal(&Vector5::new(position, position, height, velocity, velocity));
        for axis in 0..2 {
            noise[(axis, axis + 3)] = cross;
            noise[(axis + 3, axis)] = cross;
        }
        noise
    }

    /// The mean after the motion.
    pub(crate) fn transition(&self, mean: &Vector5<f64>, motion: &EgoMotion) -> Vector5<f64> {
        let back = turn_back(motion);
        let velocity = Vector2::new(mean[3], mean[4]);
        let (passed, kept) = decayed(self.config.velocity_decay_s, motion.dt);
        let moved = Vector2::new(mean[0], mean[1]) + velocity * passed;
        let position = back * (moved - Vector2::new(motion.forward, motion.left));
        let velocity = back * velocity * kept;
        Vector5::new(position.x, position.y, mean[2], velocity.x, velocity.y)
    }
}

impl PersonFilter for Ekf {
    type State = State;

    fn start(&self, detection: &Detection) -> State {
        let mut covariance = Matrix5::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.measurement(detection));
        covariance[(3, 3)] = self.config.initial_velocity_variance;
        covariance[(4, 4)] = self.config.initial_velocity_variance;
        let p = &detection.position;
        State { mean: Vector5::new(p.x, p.y, p.z, 0.0, 0.0), covariance }
    }

    fn predict(&self, state: &mut State, motion: &EgoMotion) {
        state.mean = self.transition(&state.mean, motion);
        let moved = moved(&state.covariance, motion, self.config.velocity_decay_s);
        let mut covariance = moved + self.process_noise(motion.dt);
        // A robot at rest, or one whose motion is certain, adds none.
        if motion.covariance != Matrix3::zeros() {
            covariance += ego_noise(&state.mean, motion);
        }
        state.covariance = symmetric(covariance);
    }

    /// The update in Joseph form. S = P + R is positive definite as long as P
    /// is; where rounding has spoilt that, the state is left as it is.
    fn correct(&self, state: &mut State, detection: &Detection, _: &Camera) -> Update {
        let p = state.covariance;
        let prior = p.fixed_view::<3, 3>(0, 0).into_owned();
        let innovation = detection.position.coords - state.mean.fixed_rows::<3>(0);
        let variances = detection.covariance.diagonal();
        let measured = variances.iter().filter(|v| **v < UNMEASURED_M2).count() as u32;
        let normal = self.measurement(detection);
        let Some(mut inverted) = inverse(&symmetric3(prior + normal)) else {
            return Update::default();
        };
        let nis = innovation.dot(&(inverted * innovation));
        let mut r = normal;
        if self.config.student_dof != 0.0 {
            r /= self.weight(&prior, &normal, &innovation, measured);
            let Some(weighted) = inverse(&symmetric3(prior + r)) else {
                return Update::default();
            };
            inverted = weighted;
        }
        let gain: Matrix5x3 = p.fixed_columns::<3>(0) * inverted;
        state.mean += gain * innovation;
        state.covariance = corrected(&p, &gain, &r);
        Update::new(Some((nis, measured)))
    }

    fn merge(&self, alternatives: &[(f64, State)]) -> State {
        let parts: Vec<_> = alternatives
            .iter()
            .map(|(weight, state)| (*weight, state.mean, state.covariance))
            .collect();
        let (mean, covariance) = match_moments(&parts);
        State { mean, covariance: symmetric(covariance) }
    }

    fn estimate(&self, state: &State, camera: &Camera) -> Estimate {
        let m = &state.mean;
        let position = Point3::new(m[0], m[1], m[2]);
        Estimate::new(
            Person { position, velocity: Vector2::new(m[3], m[4]) },
            state.covariance,
            camera.upper_body(&position),
        )
    }
}

impl Ekf {
    /// Returns the weight of a detection if its noise has the tails of Student's t: `(dof + m) /
    /// (dof + d^2)`, where d^2 depends on the weight in turn (`algorithms`, section 11). A
    /// detection better than expected has no more than 1.
    fn weight(
        &self,
        prior: &Matrix3<f64>,
        normal: &Matrix3<f64>,
        innovation: &Vector3<f64>,
        measured: u32,
    ) -> f64 {
        let dof = self.config.student_dof;
        (0..STUDENT_ROUNDS).fold(1.0, |weight, _| {
            let inverted = inverse(&symmetric3(prior + normal / weight));
            let squared = inverted.map_or(0.0, |inverted| innovation.dot(&(inverted * innovation)));
            ((dof + f64::from(measured)) / (dof + squared)).min(1.0)
        })
    }
}

/// Returns J M J': the noise of the robot's own uncertain motion.
fn ego_noise(predicted: &Vector5<f64>, motion: &EgoMotion) -> Matrix5 {
    let jacobian = motion_jacobian(predicted, motion);
    jacobian * motion.covariance * jacobian.transpose()
}

/// Returns the covariance after the update, in Joseph form.
fn corrected(p: &Matrix5, gain: &Matrix5x3, r: &Matrix3<f64>) -> Matrix5 {
    let both = less_seen(gain, &less_seen(gain, p).transpose()).transpose();
    symmetric(both + gain * r * gain.transpose())
}

/// Returns the time for which a velocity that decays counts, s, and the part of it that is left.
fn decayed(time_constant_s: f64, dt: f64) -> (f64, f64) {
    if time_constant_s == 0.0 {
        return (dt, 1.0);
    }
    let kept = (-dt / time_constant_s).exp();
    (time_constant_s * (1.0 - kept), kept)
}

/// Returns F M F' with the Jacobian F of the transition, without its zeros: the sums of the others
/// are in the same order.
pub(crate) fn moved(m: &Matrix5, motion: &EgoMotion, decay_s: f64) -> Matrix5 {
    let back = turn_back(motion);
    let (passed, kept) = decayed(decay_s, motion.dt);
    let coupling = [back, back * passed, back * kept];
    moved_rows(&moved_rows(m, &coupling).transpose(), &coupling).transpose()
}

/// Moves each column: `back` turns the place, `ahead` adds the way that the velocity goes, and
/// `onwards` is what becomes of the velocity.
#[inline]
fn moved_rows(m: &Matrix5, [back, ahead, onwards]: &[Matrix2<f64>; 3]) -> Matrix5 {
    let mut out = *m;
    for (mut out, m) in out.column_iter_mut().zip(m.column_iter()) {
        for i in 0..2 {
            let now = back[(i, 0)] * m[0] + back[(i, 1)] * m[1];
            out[i] = now + ahead[(i, 0)] * m[3] + ahead[(i, 1)] * m[4];
            out[i + 3] = onwards[(i, 0)] * m[3] + onwards[(i, 1)] * m[4];
        }
    }
    out
}

/// Returns (I - K H) M, without the zeros and ones of the velocities, which are not measured.
pub(crate) fn less_seen(gain: &Matrix5x3, m: &Matrix5) -> Matrix5 {
    let mut kept = -gain;
    (0..3).for_each(|i| kept[(i, i)] += 1.0);
    let mut out = Matrix5::zeros();
    for (mut out, m) in out.column_iter_mut().zip(m.column_iter()) {
        for i in 0..5 {
            let seen = kept[(i, 0)] * m[0] + kept[(i, 1)] * m[1] + kept[(i, 2)] * m[2];
            out[i] = if i < 3 { seen } else { seen + m[i] };
        }
    }
    out
}

/// From the axes before the robot's turn to those after it.
fn turn_back(motion: &EgoMotion) -> Matrix2<f64> {
    let (sin, cos) = motion.turn.sin_cos();
    Matrix2::new(cos, sin, -sin, cos)
}

/// Derivative of the transition by the state.
#[cfg(test)]
pub(crate) fn state_jacobian(motion: &EgoMotion, decay_s: f64) -> Matrix5 {
    let back = turn_back(motion);
    let (passed, kept) = decayed(decay_s, motion.dt);
    let mut f = Matrix5::identity();
    f.fixed_view_mut::<2, 2>(0, 0).copy_from(&back);
    f.fixed_view_mut::<2, 2>(0, 3).copy_from(&(back * passed));
    f.fixed_view_mut::<2, 2>(3, 3).copy_from(&(back * kept));
    f
}

/// Derivative of the transition by the motion (forward, left, turn), at the
/// predicted state (x, y, z, vx, vy): turning by a little moves (x, y) by
/// (y, -x).
pub(crate) fn motion_jacobian(predicted: &Vector5<f64>, motion: &EgoMotion) -> Matrix5x3 {
    let mut j = Matrix5x3::zeros();
    j.fixed_view_mut::<2, 2>(0, 0).copy_from(&-turn_back(motion));
    let [x, y, _, vx, vy] = [0, 1, 2, 3, 4].map(|i| predicted[i]);
    j.set_column(2, &Vector5::new(y, -x, 0.0, vy, -vx));
    j
}

/// Returns the inverse of a symmetric matrix by its minors, with one division, where factors take
/// dozens; `None` for a matrix that is not positive definite (Sylvester's criterion).
pub(crate) fn inverse(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let [a, b, c, d, e, f] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|place| m[place]);
    let first = d * f - e * e;
    let second = c * e - b * f;
    let third = b * e - c * d;
    let middle = a * f - c * c;
    let last = a * d - b * b;
    let beside = b * c - a * e;
    let determinant = a * first + b * second + c * third;
    let is_positive = a > 0.0 && last > 0.0 && determinant > 0.0;
    let adjugate = Matrix3::new(first, second, third, second, middle, beside, third, beside, last);
    is_positive.then(|| adjugate * (1.0 / determinant))
}

fn symmetric(m: Matrix5) -> Matrix5 {
    0.5 * (m + m.transpose())
}

fn symmetric3(m: Matrix3<f64>) -> Matrix3<f64> {
    0.5 * (m + m.transpose())
}
