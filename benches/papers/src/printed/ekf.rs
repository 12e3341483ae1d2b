//! `ekf-as-printed`: the filter of P1, section 2.3, and P4, section III-B.
//!
//! The printed prediction subtracts the speed of the robot from the velocity of the person in every
//! frame, although the rows of the position account for it. Noise enters the velocity alone and
//! depends on the frame rate, one variance serves all detections, and the covariance becomes
//! `P - K H P`, which loses symmetry.

use nalgebra::{Matrix2, Matrix3, Matrix5, SMatrix, Vector5};
use tagalong_config::{Registry, check_settings};
use tagalong_core::{
    Detection, EgoMotion, Estimate, PerPerson, PersonFilter, Result, Update, settings,
};
use tagalong_filters::ekf::{Ekf, State};
use tagalong_geometry::Camera;

/// A coordinate with a larger variance, m², was not measured.
const UNMEASURED_M2: f64 = 100.0;

settings! {
    /// Settings of the filter `ekf-as-printed`.
    pub struct Config {
        /// The speed of the robot is subtracted from the velocity; `false`: corrected.
        pub velocity: bool = true,
        /// Noise enters the velocity alone; `false`: corrected.
        pub noise: bool = true,
        /// The covariance is `P - K H P`; `false`: corrected, the Joseph form.
        pub update: bool = true,
        /// All detections have the same variance; `false`: corrected, their own.
        pub measurement: bool = true,
        /// Standard deviation of the process noise, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_w: f64 = 1.0,
        /// Standard deviation of the measurement noise, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_v_m: f64 = 0.05,
        /// Variance of each velocity component of a new track, m²/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub initial_velocity_variance: f64 = 2.0,
    }
}

/// The printed filter of one person.
pub struct PrintedEkf {
    config: Config,
    /// The corrected filter, for the parts that are not printed wrongly.
    corrected: Ekf,
    /// The corrected filter with the noise of the detections alone.
    exact: Ekf,
}

impl PrintedEkf {
    /// Creates the filter.
    ///
    /// # Errors
    /// Settings outside their ranges.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        let initial_velocity_variance = config.initial_velocity_variance;
        let settings =
            tagalong_filters::ekf::Config { initial_velocity_variance, ..Default::default() };
        let exact =
            Ekf::new(tagalong_filters::ekf::Config { extra_sigma_m: 0.0, ..settings.clone() })?;
        Ok(Self { config, corrected: Ekf::new(settings)?, exact })
    }

    /// Returns the filter and the detection whose covariance is the measurement noise.
    fn measured(&self, detection: &Detection) -> (&Ekf, Detection) {
        if !self.config.measurement {
            return (&self.corrected, detection.clone());
        }
        let covariance = Matrix3::identity() * self.config.sigma_v_m.powi(2);
        (&self.exact, detection.clone().with_covariance(covariance))
    }
}

impl PersonFilter for PrintedEkf {
    type State = State;

    fn start(&self, detection: &Detection) -> State {
        let (filter, detection) = self.measured(detection);
        filter.start(&detection)
    }

    fn predict(&self, state: &mut State, motion: &EgoMotion) {
        let before = state.covariance;
        self.corrected.predict(state, motion);
        if self.config.velocity && motion.dt > 0.0 {
            let way_m = motion.forward.hypot(motion.left).copysign(motion.forward);
            state.mean[3] -= way_m / motion.dt;
        }
        if self.config.noise {
            let f = transition(motion);
            let variance = (self.config.sigma_w * motion.dt).powi(2);
            let noise = Vector5::new(0.0, 0.0, 0.0, variance, variance);
            let predicted = f * before * f.transpose() + Matrix5::from_diagonal(&noise);
            state.covariance = 0.5 * (predicted + predicted.transpose());
        }
    }

    fn correct(&self, state: &mut State, detection: &Detection, camera: &Camera) -> Update {
        let prior = state.covariance;
        let (filter, measured) = self.measured(detection);
        let update = filter.correct(state, &measured, camera);
        if self.config.update && update.nis.is_some() {
            state.covariance = printed_update(&prior, &measured_noise(filter, &measured));
        }
        // A coordinate that was not measured is not counted, whatever the variance of all is.
        let variances = detection.covariance.diagonal();
        let dof = variances.iter().filter(|variance| **variance < UNMEASURED_M2).count();
        Update::new(update.nis.map(|(nis, _)| (nis, dof as u32)))
    }

    fn merge(&self, alternatives: &[(f64, State)]) -> State {
        self.corrected.merge(alternatives)
    }

    fn estimate(&self, state: &State, camera: &Camera) -> Estimate {
        self.corrected.estimate(state, camera)
    }
}

/// Returns R, as a new track takes it over from its detection.
fn measured_noise(filter: &Ekf, detection: &Detection) -> Matrix3<f64> {
    filter.start(detection).covariance.fixed_view::<3, 3>(0, 0).into_owned()
}

/// Returns `P - K H P` with the gain `K = P H' S^-1`.
fn printed_update(prior: &Matrix5<f64>, noise: &Matrix3<f64>) -> Matrix5<f64> {
    let columns = prior.fixed_columns::<3>(0).into_owned();
    let s = prior.fixed_view::<3, 3>(0, 0) + noise;
    let Some(inverted) = s.try_inverse() else { return *prior };
    let gain: SMatrix<f64, 5, 3> = columns * inverted;
    prior - gain * prior.fixed_rows::<3>(0)
}

/// Returns F, the derivative of the transition by the state.
fn transition(motion: &EgoMotion) -> Matrix5<f64> {
    let (sin, cos) = motion.turn.sin_cos();
    let back = Matrix2::new(cos, sin, -sin, cos);
    let mut f = Matrix5::identity();
    f.fixed_view_mut::<2, 2>(0, 0).copy_from(&back);
    f.fixed_view_mut::<2, 2>(0, 3).copy_from(&(back * motion.dt));
    f.fixed_view_mut::<2, 2>(3, 3).copy_from(&back);
    f
}

/// Registers the filter.
pub fn register(registry: &mut Registry) {
    registry.filter(
        "ekf-as-printed",
        "Kalman filter in the robot frame with the equations of P1 and P4 as printed",
        |config: Config, _| Ok(PerPerson::new(PrintedEkf::new(config)?)),
    );
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry2, Point2, Point3, Rotation2, Vector2, Vector3};
    use tagalong_core::DiffDrive;
    use tagalong_geometry::{ImageBox, Pinhole, Rect};
    use tagalong_math::{RandomSource as _, SplitMix64};

    use super::*;

    const DT_S: f64 = 0.09;
    const SPEED_MPS: f64 = 0.5;
    const SIGMA_M: f64 = 0.05;
    const SEEDS: u64 = 40;

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0)
    }

    fn detection(position: Point3<f64>, sigma_m: f64) -> Detection {
        Detection::new("test", position, Matrix3::identity() * (sigma_m * sigma_m), 1.0)
            .with_image(ImageBox::upper_body(Rect::default()))
    }

    fn filter(config: Config) -> PrintedEkf {
        PrintedEkf::new(config).unwrap()
    }

    fn corrected() -> Config {
        let [velocity, noise, update, measurement] = [false; 4];
        Config { velocity, noise, update, measurement, ..Config::default() }
    }

    fn state_at(x: f64) -> State {
        filter(corrected()).start(&detection(Point3::new(x, 0.0, 1.6), 0.1))
    }

    /// A robot that drives, and a person at rest whom it sees with noise.
    struct World {
        robot: Isometry2<f64>,
        random: SplitMix64,
    }

    impl World {
        fn drive(&mut self, turn_radps: f64) -> EgoMotion {
            let turn = turn_radps * DT_S;
            let step = Rotation2::new(0.5 * turn) * Vector2::new(SPEED_MPS * DT_S, 0.0);
            let motion =
                EgoMotion { forward: step.x, left: step.y, turn, ..EgoMotion::at_rest(DT_S) };
            self.robot *= motion.isometry();
            motion
        }

        fn person(&self) -> Point3<f64> {
            let floor = self.robot.inverse_transform_point(&Point2::new(4.0, 0.5));
            Point3::new(floor.x, floor.y, 1.6)
        }

        fn look(&mut self) -> Detection {
            let noise = Vector3::from_fn(|_, _| self.random.normal());
            detection(self.person() + SIGMA_M * noise, SIGMA_M)
        }
    }

    /// Mean velocity and position errors in the robot's direction, mean normalised innovation
    /// squared, and distance to the truth after a second without detections.
    fn standing(config: &Config, turn_radps: f64) -> [f64; 4] {
        let filter = filter(config.clone());
        let mut sums = [Vec::new(), Vec::new(), Vec::new(), Vec::new()];
        for seed in 0..SEEDS {
            let mut world = World { robot: Isometry2::identity(), random: SplitMix64::new(seed) };
            let mut state = filter.start(&world.look());
            for frame in 0..42 {
                filter.predict(&mut state, &world.drive(turn_radps));
                let update = filter.correct(&mut state, &world.look(), &camera());
                if frame >= 22 {
                    sums[0].push(state.mean[3]);
                    sums[1].push(state.mean[0] - world.person().x);
                    sums[2].extend(update.nis.map(|(nis, _)| nis));
                }
            }
            for _ in 0..11 {
                filter.predict(&mut state, &world.drive(turn_radps));
            }
            sums[3].push((state.mean.fixed_rows::<3>(0) - world.person().coords).norm());
        }
        sums.map(|values| values.iter().sum::<f64>() / values.len() as f64)
    }

    #[test]
    fn a_standing_person_drifts_and_with_all_corrected_stands_still() {
        for turn_radps in [0.0, 0.2, -0.4] {
            let [speed, place, nis, coasted] = standing(&Config::default(), turn_radps);
            assert!(speed < -1.0 && place < -0.1 && nis > 15.0 && coasted > 3.0, "{speed} {place}");
            let [speed, place, nis, coasted] = standing(&corrected(), turn_radps);
            assert!(speed.abs() < 0.02 && place.abs() < 0.005, "{speed} {place}");
            assert!(nis < 3.1 && coasted < 0.3, "{nis} {coasted}");
        }
    }

    /// A setting that no paper prints decides how much of the misprint shows: a filter that puts no
    /// weight on its prediction follows the detections, and errs as soon as there are none.
    #[test]
    fn a_large_noise_hides_the_drift_until_the_person_is_hidden() {
        let config = Config { sigma_w: 10.0, ..Config::default() };
        let [speed, place, _, coasted] = standing(&config, 0.0);
        assert!(place.abs() < 0.05 && speed < -0.3 && coasted > 2.0, "{place} {speed} {coasted}");
    }

    #[test]
    fn the_velocity_is_that_of_the_paper() {
        let filter = filter(Config::default());
        let wheels = DiffDrive { half_separation_m: 0.167, slip: 0.0 };
        let motion = EgoMotion::from_wheels(0.4, 0.6, &wheels, DT_S);
        let mut state = state_at(3.0);
        state.mean = Vector5::new(3.0, 1.0, 1.6, 0.2, -0.1);
        filter.predict(&mut state, &motion);
        let turned = Isometry2::rotation(-motion.turn) * Vector2::new(0.2, -0.1);
        assert!((state.mean[3] - (turned.x - 0.5)).abs() < 1e-3);
        assert!((state.mean[4] - turned.y).abs() < 1e-12);
        let place = motion.apply_to_point(Point2::new(3.0 + 0.2 * DT_S, 1.0 - 0.1 * DT_S));
        assert!((Point2::new(state.mean[0], state.mean[1]) - place).norm() < 1e-12);
    }

    #[test]
    fn a_robot_that_backs_up_is_subtracted_the_other_way_and_one_that_waits_not_at_all() {
        fn speed(forward: f64, dt: f64) -> f64 {
            let mut state = state_at(3.0);
            let motion = EgoMotion { forward, ..EgoMotion::at_rest(dt) };
            filter(Config::default()).predict(&mut state, &motion);
            state.mean[3]
        }

        assert!((speed(-0.05, 0.1) - 0.5).abs() < 1e-12 && (speed(0.05, 0.1) + 0.5).abs() < 1e-12);
        assert_eq!(speed(0.05, 0.0), 0.0);
    }

    #[test]
    fn the_noise_depends_on_the_frame_rate_and_knows_neither_height_nor_ego_motion() {
        let [slow, fast, added] = [(5, 1.0), (50, 1.0), (1, 4.0)].map(|(steps, sigma_w)| {
            let filter = filter(Config { sigma_w, ..Config::default() });
            let mut state = state_at(5.0);
            let before = state.covariance;
            let mut motion = EgoMotion::at_rest(1.0 / f64::from(steps));
            motion.covariance = Matrix3::identity() * 0.01;
            (0..steps).for_each(|_| filter.predict(&mut state, &motion));
            state.covariance - before
        });
        assert!((slow[(3, 3)] / fast[(3, 3)] - 10.0).abs() < 1e-6, "{slow} {fast}");
        assert!((added[(3, 3)] - 16.0).abs() < 1e-12 && added[(2, 2)] == 0.0, "{added}");
        assert!((added[(0, 0)] - 2.0).abs() < 1e-12, "the velocity's share alone: {added}");
    }

    #[test]
    fn the_update_loses_symmetry_and_is_otherwise_that_of_the_textbook() {
        fn asymmetry(update: bool) -> f64 {
            let config = Config { noise: false, measurement: false, update, ..Config::default() };
            let filter = filter(config);
            let mut world = World { robot: Isometry2::identity(), random: SplitMix64::new(1) };
            let mut state = state_at(3.0);
            let mut worst: f64 = 0.0;
            for _ in 0..50 {
                filter.predict(&mut state, &world.drive(0.7));
                let mut seen = world.look();
                seen.covariance[(0, 1)] = 1e-3;
                seen.covariance[(1, 0)] = 1e-3;
                filter.correct(&mut state, &seen, &camera());
                worst = worst.max((state.covariance - state.covariance.transpose()).norm());
            }
            worst
        }

        for update in [false, true] {
            let filter = filter(Config { update, sigma_v_m: 0.3, ..Config::default() });
            let mut state = state_at(3.0);
            let p = state.covariance[(0, 0)];
            let seen = detection(Point3::new(3.5, 0.0, 1.6), 0.01);
            let (nis, measured) = filter.correct(&mut state, &seen, &camera()).nis.unwrap();
            let gain = p / (p + 0.09);
            assert!((state.mean[0] - 3.0 - 0.5 * gain).abs() < 1e-12);
            assert!((state.covariance[(0, 0)] - (1.0 - gain) * p).abs() < 1e-12);
            assert!((nis - 0.25 / (p + 0.09)).abs() < 1e-12 && measured == 3);
        }
        assert_eq!(asymmetry(false), 0.0);
        assert!(asymmetry(true) > 0.0);
    }

    #[test]
    fn one_variance_serves_all_detections_and_an_unmeasured_height_is_not_counted() {
        fn moved(config: Config, sigma_m: f64) -> f64 {
            let mut state = state_at(3.0);
            let seen = detection(Point3::new(3.5, 0.0, 1.6), sigma_m);
            filter(config).correct(&mut state, &seen, &camera());
            state.mean[0] - 3.0
        }

        assert_eq!(moved(Config::default(), 0.5), moved(Config::default(), 0.01));
        assert!(moved(corrected(), 0.5) < 0.1 * moved(corrected(), 0.01));
        let mut seen = detection(Point3::new(3.1, 0.0, 0.0), 0.05);
        seen.covariance[(2, 2)] = 1e6;
        let update = filter(Config::default()).correct(&mut state_at(3.0), &seen, &camera());
        assert_eq!(update.nis.map(|(_, dof)| dof), Some(2));
    }

    #[test]
    fn settings_outside_their_ranges_are_refused() {
        for config in [
            Config { sigma_w: 0.0, ..Config::default() },
            Config { sigma_v_m: f64::NAN, ..Config::default() },
            Config { initial_velocity_variance: -1.0, ..Config::default() },
        ] {
            assert!(PrintedEkf::new(config).is_err());
        }
    }
}
