//! Forecast of a person's position over the next seconds, with its covariance.
//!
//! The velocity of a person decays at a constant rate and is disturbed by white acceleration, which
//! grows with the speed of the person (an Ornstein-Uhlenbeck process, whose integral is the
//! position). The uncertainty of the state is a fraction of that of the track's filter. Most people
//! keep their motion and few turn round, so the position has long tails: it has a Student's t
//! distribution, with degrees of freedom that fall with time. All settings are learned from
//! simulated walks by `cargo run --release -p tagalong-benches --example forecast`, which prints
//! how many true positions lie within the ellipses on walks that were not used for learning.

use nalgebra::{Matrix2, Matrix4, Point2, Vector2};
use tagalong_core::{EgoMotion, Track, settings};

/// Above this neither a coordinate, m, nor a speed, m/s, makes sense.
const MOST: f64 = 1e6;
/// Standard deviations of a state above these say no more than that nothing is known, m and m/s.
const MOST_SIGMA_M: f64 = 3.0;
const MOST_SIGMA_MPS: f64 = 1.5;
/// Product of rate and time below which the decay is a series: the quotients would lose their digits.
const SMALL: f64 = 1e-3;
/// Degrees of freedom to which those of the place fall.
const LEAST_DOF: f64 = 2.0;
/// Time below which their number does not rise, s.
const LEAST_S: f64 = 0.1;
/// Least variance of a place, m²: an ellipse without area has no inverse.
const LEAST_VARIANCE_M2: f64 = 1e-6;

settings! {
    /// Motion that is expected of people.
    #[derive(Copy)]
    pub struct ForecastSettings {
        /// Decay rate of the velocity, 1/s; 0 for a constant velocity.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub damping_per_s: f64 = 0.1,
        /// Spectral density of the acceleration of a person at rest, m²/s³.
        #[schemars(range(min = 0.0, max = 1e3))]
        pub unrest: f64 = 0.07,
        /// Additional spectral density per (m/s)² of squared speed, 1/s.
        #[schemars(range(min = 0.0, max = 1e3))]
        pub unrest_by_speed: f64 = 0.0,
        /// Factor on the covariance that the track's filter reports.
        #[schemars(range(min = 0.0, max = 100.0))]
        pub filter_part: f64 = 0.5,
        /// Degrees of freedom of the position after one second, beyond two; they fall with the
        /// square of the time.
        #[schemars(range(min = 0.1, max = 1e9))]
        pub tail_dof: f64 = 6.0,
    }
}

/// State of a person from which places are forecast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Place now, m.
    pub at: Point2<f64>,
    /// Velocity over ground now, m/s.
    pub velocity: Vector2<f64>,
    /// Scale matrix of place and velocity, (x, y, vx, vy): their covariance without the tails.
    covariance: Matrix4<f64>,
    damping_per_s: f64,
    density: f64,
    tail_dof: f64,
}

impl Forecast {
    /// Creates the forecast of a person by the mean and the covariance of (x, y, vx, vy); `None` for a
    /// place that is no number or far beyond any robot. A velocity or a covariance that makes no sense
    /// counts as unknown.
    pub fn new(
        settings: &ForecastSettings,
        at: Point2<f64>,
        velocity: Vector2<f64>,
        covariance: Matrix4<f64>,
    ) -> Option<Self> {
        let is_place = at.iter().all(|metres| metres.abs() < MOST);
        if !is_place {
            return None;
        }
        let is_velocity = velocity.iter().all(|mps| mps.abs() < MOST);
        let velocity = if is_velocity { velocity } else { Vector2::zeros() };
        let density = settings.unrest + settings.unrest_by_speed * velocity.norm_squared().min(9.0);
        Some(Self {
            at,
            velocity,
            covariance: bounded(&covariance) * settings.filter_part,
            damping_per_s: settings.damping_per_s,
            density,
            tail_dof: settings.tail_dof,
        })
    }

    /// Creates the forecast of a track.
    pub fn of_track(settings: &ForecastSettings, track: &Track) -> Option<Self> {
        const ROWS: [usize; 4] = [0, 1, 3, 4];
        let estimate = &track.estimate;
        let covariance =
            Matrix4::from_fn(|row, column| estimate.covariance[(ROWS[row], ROWS[column])]);
        Self::new(settings, estimate.person.position.xy(), estimate.person.velocity, covariance)
    }

    /// Returns the forecast in the axes of the robot after its motion, at the end of which it begins.
    pub fn after(&self, motion: &EgoMotion) -> Self {
        let turn = motion.isometry().rotation.inverse().to_rotation_matrix();
        let mut both = Matrix4::zeros();
        both.fixed_view_mut::<2, 2>(0, 0).copy_from(turn.matrix());
        both.fixed_view_mut::<2, 2>(2, 2).copy_from(turn.matrix());
        let covariance = self.state_covariance(motion.dt);
        Self {
            at: motion.apply_to_point(self.place(motion.dt)),
            velocity: motion.apply_to_velocity(self.velocity_after(motion.dt)),
            covariance: both * covariance * both.transpose(),
            ..*self
        }
    }

    /// Returns the expected place after some seconds, m.
    pub fn place(&self, seconds: f64) -> Point2<f64> {
        self.at + self.velocity * self.reach(seconds)
    }

    /// Returns the expected velocity after some seconds, m/s.
    pub fn velocity_after(&self, seconds: f64) -> Vector2<f64> {
        self.velocity * (-self.damping_per_s * seconds).exp()
    }

    /// Returns the scale matrix of the place after some seconds, m²: the covariance of most people, without
    /// the tails.
    pub fn covariance(&self, seconds: f64) -> Matrix2<f64> {
        let place = self.state_covariance(seconds).fixed_view::<2, 2>(0, 0).into_owned();
        place + Matrix2::identity() * LEAST_VARIANCE_M2
    }

    /// Returns true if a place lies within the ellipse that is to hold this share of the places after
    /// some seconds.
    pub fn holds(&self, seconds: f64, share: f64, truth: &Point2<f64>) -> bool {
        let off = truth - self.place(seconds);
        let Some(inverse) = self.covariance(seconds).try_inverse() else { return false };
        // In the plane the squared distance has a distribution with this inverse.
        let dof = self.dof(seconds);
        off.dot(&(inverse * off)) <= dof * ((1.0 - share).powf(-2.0 / dof) - 1.0)
    }

    /// Returns the degrees of freedom of the place after some seconds.
    pub fn dof(&self, seconds: f64) -> f64 {
        LEAST_DOF + self.tail_dof / seconds.max(LEAST_S).powi(2)
    }

    /// Returns the distance that a velocity of 1 m/s leads to, m: the integral of its decay.
    fn reach(&self, seconds: f64) -> f64 {
        let part = self.damping_per_s * seconds;
        if part < SMALL {
            seconds * (1.0 - 0.5 * part)
        } else {
            (1.0 - (-part).exp()) / self.damping_per_s
        }
    }

    /// Returns the covariance of (x, y, vx, vy) after some seconds.
    fn state_covariance(&self, seconds: f64) -> Matrix4<f64> {
        let rate = self.damping_per_s;
        let part = rate * seconds;
        let decay = (-part).exp();
        let reach = self.reach(seconds);
        let mut step = Matrix4::identity();
        for axis in 0..2 {
            step[(axis, axis + 2)] = reach;
            step[(axis + 2, axis + 2)] = decay;
        }
        let [of_place, of_both, of_velocity] = if part < SMALL {
            [
                seconds.powi(3) / 3.0 * (1.0 - 0.75 * part),
                seconds.powi(2) / 2.0 * (1.0 - part),
                seconds * (1.0 - part),
            ]
        } else {
            let twice = (1.0 - decay * decay) / (2.0 * rate);
            [(seconds - 2.0 * reach + twice) / (rate * rate), 0.5 * reach * reach, twice]
        };
        let mut grown = step * self.covariance * step.transpose();
        for axis in 0..2 {
            grown[(axis, axis)] += self.density * of_place;
            grown[(axis, axis + 2)] += self.density * of_both;
            grown[(axis + 2, axis)] += self.density * of_both;
            grown[(axis + 2, axis + 2)] += self.density * of_velocity;
        }
        grown
    }
}

/// Returns a covariance with no larger standard deviations than make sense; that of an unknown state if
/// it is none.
fn bounded(covariance: &Matrix4<f64>) -> Matrix4<f64> {
    let most = [MOST_SIGMA_M, MOST_SIGMA_M, MOST_SIGMA_MPS, MOST_SIGMA_MPS];
    let is_one = covariance.iter().all(|value| value.is_finite())
        && covariance.diagonal().iter().all(|variance| *variance >= 0.0);
    if !is_one {
        return Matrix4::from_diagonal(&most.map(|sigma| sigma * sigma).into());
    }
    // Rows and columns are scaled, so that correlations stay as they are.
    let mut scale = Matrix4::identity();
    for (axis, sigma) in most.into_iter().enumerate() {
        let variance = covariance[(axis, axis)];
        if variance > sigma * sigma {
            scale[(axis, axis)] = sigma / variance.sqrt();
        }
    }
    scale * covariance * scale
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const STILL: ForecastSettings =
        ForecastSettings { damping_per_s: 0.0, unrest: 0.0, unrest_by_speed: 0.0, ..NORMAL };
    /// The covariance of the filter, and no tails.
    const NORMAL: ForecastSettings = ForecastSettings {
        damping_per_s: 0.15,
        unrest: 0.1,
        unrest_by_speed: 0.05,
        filter_part: 1.0,
        tail_dof: 1e9,
    };

    fn forecast(settings: ForecastSettings, variances: [f64; 4]) -> Forecast {
        let covariance = Matrix4::from_diagonal(&variances.into());
        let at = Point2::new(2.0, 1.0);
        Forecast::new(&settings, at, Vector2::new(1.0, -0.5), covariance).unwrap()
    }

    #[test]
    fn without_damping_a_person_goes_on_and_the_uncertainty_grows_by_the_velocity() {
        let walks = forecast(STILL, [0.01, 0.01, 0.04, 0.04]);
        assert!((walks.place(4.0) - Point2::new(6.0, -1.0)).norm() < 1e-12);
        let variance = walks.covariance(4.0)[(0, 0)];
        assert!((variance - (0.01 + 16.0 * 0.04)).abs() < 1e-5, "{variance}");
        let disturbed = forecast(ForecastSettings { unrest: 0.3, ..STILL }, [0.0; 4]);
        let variance = disturbed.covariance(2.0)[(1, 1)];
        assert!((variance - 0.3 * 8.0 / 3.0).abs() < 1e-5, "{variance}");
    }

    #[test]
    fn a_damped_walk_ends_where_its_integral_does() {
        let settings = ForecastSettings { damping_per_s: 0.5, unrest: 0.2, ..STILL };
        let walks = forecast(settings, [0.01, 0.02, 0.03, 0.04]);
        // The slow way: many small steps of the same process.
        let steps = 20_000;
        let dt = 4.0 / f64::from(steps);
        let mut at = walks.at;
        let mut velocity = walks.velocity;
        let mut covariance = walks.covariance;
        let mut step = Matrix4::identity();
        for axis in 0..2 {
            step[(axis, axis + 2)] = dt;
            step[(axis + 2, axis + 2)] = 1.0 - 0.5 * dt;
        }
        for _ in 0..steps {
            at += velocity * dt;
            velocity *= 1.0 - 0.5 * dt;
            covariance = step * covariance * step.transpose();
            covariance[(2, 2)] += 0.2 * dt;
            covariance[(3, 3)] += 0.2 * dt;
        }
        assert!((walks.place(4.0) - at).norm() < 1e-3);
        let off = walks.state_covariance(4.0) - covariance;
        assert!(off.abs().max() < 1e-3, "{off}");
    }

    #[test]
    fn a_small_damping_is_nearly_none() {
        let little = ForecastSettings { damping_per_s: 0.9e-3 / 4.0, ..NORMAL };
        let more = ForecastSettings { damping_per_s: 1.1e-3 / 4.0, ..little };
        let [below, above] = [little, more].map(|settings| forecast(settings, [0.01; 4]));
        assert!((below.place(4.0) - above.place(4.0)).norm() < 1e-3);
        let off = below.state_covariance(4.0) - above.state_covariance(4.0);
        assert!(off.abs().max() < 2e-3, "{off}");
    }

    #[test]
    fn the_faster_a_person_the_less_is_known() {
        fn variance(speed: f64) -> f64 {
            let settings = ForecastSettings { unrest: 0.1, unrest_by_speed: 0.2, ..STILL };
            let velocity = Vector2::new(0.0, speed);
            let zero = Matrix4::zeros();
            let walks = Forecast::new(&settings, Point2::origin(), velocity, zero).unwrap();
            walks.covariance(1.0)[(0, 0)]
        }

        assert!((variance(0.0) - 0.1 / 3.0).abs() < 1e-5);
        assert!((variance(1.0) - 0.3 / 3.0).abs() < 1e-5);
    }

    #[test]
    fn ellipses_hold_their_share_of_normal_places() {
        use tagalong_math::{ChaCha, RandomSource};

        let walks = forecast(NORMAL, [0.04, 0.01, 0.09, 0.02]);
        let root = walks.covariance(2.0).cholesky().unwrap().l();
        let mut random = ChaCha::new(5, 1);
        for share in [0.5, 0.9, 0.95] {
            let held = (0..20_000).filter(|_| {
                let off = root * Vector2::new(random.normal(), random.normal());
                walks.holds(2.0, share, &(walks.place(2.0) + off))
            });
            let found = held.count() as f64 / 20_000.0;
            assert!((found - share).abs() < 0.01, "{share}: {found}");
        }
    }

    /// The slow way: Student's t as a normal place of a random scale.
    #[test]
    fn ellipses_of_long_tails_hold_their_share_of_places_with_long_tails() {
        use tagalong_math::{ChaCha, RandomSource};

        let settings = ForecastSettings { tail_dof: 8.0, ..NORMAL };
        let walks = forecast(settings, [0.04, 0.01, 0.09, 0.02]);
        assert_eq!((walks.dof(1.0), walks.dof(2.0)), (10.0, 4.0));
        let root = walks.covariance(2.0).cholesky().unwrap().l();
        let mut random = ChaCha::new(5, 2);
        for share in [0.5, 0.9, 0.95] {
            let held = (0..20_000).filter(|_| {
                let normal = Vector2::new(random.normal(), random.normal());
                let squares: f64 = (0..4).map(|_| random.normal().powi(2)).sum();
                let off = root * normal / (squares / 4.0).sqrt();
                walks.holds(2.0, share, &(walks.place(2.0) + off))
            });
            let found = held.count() as f64 / 20_000.0;
            assert!((found - share).abs() < 0.01, "{share}: {found}");
        }
    }

    #[test]
    fn numbers_that_are_none_are_unknown_and_never_certain() {
        let settings = NORMAL;
        let here = Point2::new(1.0, 0.0);
        let nowhere = Point2::new(f64::NAN, 0.0);
        let zero = Matrix4::zeros();
        assert_eq!(Forecast::new(&settings, nowhere, Vector2::zeros(), zero), None);
        let odd = Vector2::new(f64::INFINITY, 0.0);
        let stands = Forecast::new(&settings, here, odd, zero).unwrap();
        assert_eq!(stands.place(3.0), here);
        for value in [f64::NAN, -1.0, 1e30] {
            let covariance = Matrix4::from_diagonal(&[value, 0.01, 0.01, 0.01].into());
            let unknown = Forecast::new(&settings, here, Vector2::zeros(), covariance).unwrap();
            let variance = unknown.covariance(0.0)[(0, 0)];
            assert!((variance - 9.0).abs() < 1e-3, "{value}: {variance}");
        }
        let exact = Forecast::new(&STILL, here, Vector2::zeros(), zero).unwrap();
        assert!(exact.holds(0.0, 0.5, &here) && !exact.holds(0.0, 0.99, &Point2::new(1.1, 0.0)));
    }

    proptest! {
        /// A person ahead is to the side of the turned robot, with the ellipse.
        #[test]
        fn a_robot_that_moves_sees_the_same_world(
            forward in -1.0..1.0, left in -1.0..1.0, turn in -3.0..3.0, seconds in 0.0..4.0,
        ) {
            let walks = forecast(ForecastSettings::default(), [0.04, 0.01, 0.09, 0.02]);
            let motion = EgoMotion { forward, left, turn, ..EgoMotion::at_rest(0.3) };
            let seen = walks.after(&motion);
            let before = motion.isometry() * seen.place(seconds);
            prop_assert!((before - walks.place(0.3 + seconds)).norm() < 1e-6);
            let turned = motion.isometry().rotation.to_rotation_matrix();
            let ellipse = turned.matrix() * seen.covariance(seconds) * turned.matrix().transpose();
            let off = ellipse - walks.covariance(0.3 + seconds);
            prop_assert!(off.abs().max() < 1e-4, "{off}");
        }
    }
}
