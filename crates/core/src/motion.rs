use nalgebra::{Isometry2, Isometry3, Matrix3, Point2, UnitQuaternion, Vector2, Vector3};

/// Speeds over ground of the two driven wheels, m/s.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct WheelSpeeds {
    /// Left wheel.
    pub left: f64,
    /// Right wheel.
    pub right: f64,
}

impl WheelSpeeds {
    /// Robot at rest.
    pub const STOP: Self = Self { left: 0.0, right: 0.0 };
}

/// Velocity of the robot over ground, in the robot frame.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Twist {
    /// Speed forward, m/s.
    pub linear_mps: f64,
    /// Speed to the left, m/s; 0 for a differential drive, which cannot move sideways.
    pub lateral_mps: f64,
    /// Turn rate, rad/s, positive to the left.
    pub angular_rps: f64,
}

impl Twist {
    /// Robot at rest.
    pub const STOP: Self = Self { linear_mps: 0.0, lateral_mps: 0.0, angular_rps: 0.0 };

    /// Creates the twist of a robot that drives forward and turns.
    pub const fn new(linear_mps: f64, angular_rps: f64) -> Self {
        Self { linear_mps, lateral_mps: 0.0, angular_rps }
    }

    /// Returns the twist on the same arc at `by` times the speed.
    pub fn scaled(self, by: f64) -> Self {
        Self {
            linear_mps: self.linear_mps * by,
            lateral_mps: self.lateral_mps * by,
            angular_rps: self.angular_rps * by,
        }
    }
}

/// Step between neighbouring poses beyond which the odometry has jumped, m.
pub const MAX_ODOMETRY_STEP_M: f64 = 1.0;
/// Turn between neighbouring poses beyond which the odometry has jumped, rad: a quarter turn within
/// [`MAX_ODOMETRY_GAP_S`] is faster than robots turn.
pub const MAX_ODOMETRY_STEP_RAD: f64 = std::f64::consts::FRAC_PI_2;
/// Gap in the odometry beyond which poses are stale, s.
pub const MAX_ODOMETRY_GAP_S: f64 = 0.5;
/// Age of the newest transform to the camera beyond which its pose is unknown, s: moving transforms are
/// published at least once a second, on most robots 10 to 50 times.
pub const MAX_CAMERA_POSE_AGE_S: f64 = 1.5;
/// Longest time over which the uncertainty of an unknown motion grows, s.
const MAX_UNKNOWN_S: f64 = 5.0;

/// Motion of the robot between two image stamps, in its frame at the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EgoMotion {
    /// Time between the images, s; never negative.
    pub dt: f64,
    /// Displacement along the first heading, m.
    pub forward: f64,
    /// Displacement to the left of the first heading, m.
    pub left: f64,
    /// Change of heading, rad, counter-clockwise.
    pub turn: f64,
    /// Covariance of (forward, left, turn).
    pub covariance: Matrix3<f64>,
}

/// A differential drive. The wheels are `2 * half_separation_m` apart, as in P1, section 2.3.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffDrive {
    /// Half the distance between the wheels, m.
    pub half_separation_m: f64,
    /// Slip: standard deviation of a wheel's travel as a fraction of it.
    pub slip: f64,
}

impl DiffDrive {
    /// Returns the twist of the robot at these wheel speeds.
    pub fn twist(&self, WheelSpeeds { left, right }: WheelSpeeds) -> Twist {
        Twist::new(0.5 * (left + right), 0.5 * (right - left) / self.half_separation_m)
    }

    /// Returns the wheel speeds of a twist, without its lateral part.
    pub fn wheels(&self, twist: Twist) -> WheelSpeeds {
        let rim = twist.angular_rps * self.half_separation_m;
        WheelSpeeds { left: twist.linear_mps - rim, right: twist.linear_mps + rim }
    }

    /// Returns the wheel speeds of a twist, on the same arc no faster than `max_mps` for each
    /// wheel.
    pub fn wheels_within(&self, twist: Twist, max_mps: f64) -> WheelSpeeds {
        let rim = twist.angular_rps * self.half_separation_m;
        let scale = max_mps / (twist.linear_mps.abs() + rim.abs()).max(max_mps);
        let WheelSpeeds { left, right } = self.wheels(twist);
        WheelSpeeds { left: left * scale, right: right * scale }
    }
}

impl EgoMotion {
    /// Returns the motion of a robot at rest for `dt` seconds.
    pub fn at_rest(dt: f64) -> Self {
        Self { dt, forward: 0.0, left: 0.0, turn: 0.0, covariance: Matrix3::zeros() }
    }

    /// Returns the motion over `dt` seconds without valid odometry: at rest, with the uncertainty of a
    /// robot that may have driven at 1 m/s and turned at 1 rad/s, for at most 5 s.
    pub fn unknown(dt: f64) -> Self {
        let reach = dt.clamp(0.0, MAX_UNKNOWN_S);
        Self { covariance: Matrix3::identity() * (reach * reach), ..Self::at_rest(dt) }
    }

    /// Integrates wheel speeds held for `dt` seconds (P1, section 2.3.1). The chord is `v dt
    /// sinc(turn / 2)`, which has no singularity at equal speeds; the printed form divides by their
    /// difference.
    pub fn from_wheels(left_mps: f64, right_mps: f64, wheels: &DiffDrive, dt: f64) -> Self {
        let d = wheels.half_separation_m;
        let turn = (right_mps - left_mps) / (2.0 * d) * dt;
        let chord = 0.5 * (right_mps + left_mps) * dt * sinc(0.5 * turn);
        let (sin, cos) = (0.5 * turn).sin_cos();
        let sl = wheels.slip * left_mps * dt;
        let sr = wheels.slip * right_mps * dt;
        // Derivatives of (forward, left, turn) by the travel of each wheel, at zero turn. The
        // wheels slip independently, so their covariances add up.
        let by_left = Vector3::new(0.5, 0.0, -0.5 / d);
        let by_right = Vector3::new(0.5, 0.0, 0.5 / d);
        let covariance =
            by_left * by_left.transpose() * (sl * sl) + by_right * by_right.transpose() * (sr * sr);
        Self { dt, forward: chord * cos, left: chord * sin, turn, covariance }
    }

    /// Returns the motion from one odometry pose to the next. `sigma_fraction` is the standard
    /// deviation of each component as a fraction of the travel.
    pub fn between(
        before: &Isometry2<f64>,
        after: &Isometry2<f64>,
        dt: f64,
        sigma_fraction: f64,
    ) -> Self {
        let step = before.inverse() * after;
        let forward = step.translation.x;
        let left = step.translation.y;
        let turn = step.rotation.angle();
        let travel = sigma_fraction * forward.hypot(left);
        let rotation = sigma_fraction * turn.abs();
        let covariance = Matrix3::from_diagonal(&Vector3::new(
            travel * travel,
            travel * travel,
            // Driving straight also disturbs the heading: by 0.1 rad per metre of position error.
            rotation * rotation + 0.01 * travel * travel,
        ));
        Self { dt, forward, left, turn, covariance }
    }

    /// Returns the position, after the motion, of a point that is fixed in the world.
    pub fn apply_to_point(&self, point_in_robot: Point2<f64>) -> Point2<f64> {
        self.isometry().inverse_transform_point(&point_in_robot)
    }

    /// Returns a velocity over ground in the axes after the motion: it is only rotated.
    pub fn apply_to_velocity(&self, velocity: Vector2<f64>) -> Vector2<f64> {
        self.isometry().inverse_transform_vector(&velocity)
    }

    /// Returns the motion as a pose change: `odom_from_robot * isometry()` is the new pose.
    pub fn isometry(&self) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(self.forward, self.left), self.turn)
    }

    /// Returns the motion followed by another one; the covariances are added in the axes of the
    /// first (first order, for short steps).
    pub fn then(&self, next: &Self) -> Self {
        let whole = self.isometry() * next.isometry();
        Self {
            dt: self.dt + next.dt,
            forward: whole.translation.x,
            left: whole.translation.y,
            turn: self.turn + next.turn,
            covariance: self.covariance + next.covariance,
        }
    }
}

/// Projects a 3-D pose onto the floor: position and heading.
pub fn planar_pose(pose: &Isometry3<f64>) -> Isometry2<f64> {
    let forward = pose.rotation * Vector3::x();
    Isometry2::new(Vector2::new(pose.translation.x, pose.translation.y), forward.y.atan2(forward.x))
}

/// Lifts a pose on the floor to one in space, as the inverse of [`planar_pose`].
pub fn spatial_pose(pose: &Isometry2<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.rotation.angle());
    Isometry3::from_parts(pose.translation.vector.push(0.0).into(), turn)
}

/// Computes sin(x) / x, with its Taylor series near zero.
fn sinc(x: f64) -> f64 {
    // Below 1e-4 the next term, x^4 / 120, is less than the rounding error.
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { x.sin() / x }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const WHEELS: DiffDrive = DiffDrive { half_separation_m: 0.167, slip: 0.02 };

    #[test]
    fn equal_speeds_drive_straight() {
        let motion = EgoMotion::from_wheels(0.5, 0.5, &WHEELS, 0.1);
        assert_eq!((motion.forward, motion.left, motion.turn), (0.05, 0.0, 0.0));
    }

    #[test]
    fn a_twist_and_its_wheels_are_the_same_motion() {
        let twist = Twist::new(0.5, -1.0);
        let wheels = WHEELS.wheels(twist);
        assert!((wheels.left - 0.667).abs() < 1e-12 && (wheels.right - 0.333).abs() < 1e-12);
        let back = WHEELS.twist(wheels);
        assert!((back.linear_mps - 0.5).abs() < 1e-12 && (back.angular_rps + 1.0).abs() < 1e-12);
        assert_eq!(WHEELS.wheels(Twist { lateral_mps: 0.3, ..twist }), wheels);
    }

    #[test]
    fn twists_beyond_the_wheels_are_driven_slower_on_the_same_arc() {
        let fast = Twist::new(0.9, 0.9 / WHEELS.half_separation_m);
        let limited = WHEELS.wheels_within(fast, 0.9);
        assert!(limited.left.abs() < 1e-12 && (limited.right - 0.9).abs() < 1e-12, "{limited:?}");
        let slow = Twist::new(0.3, 0.5);
        assert_eq!(WHEELS.wheels_within(slow, 0.9), WHEELS.wheels(slow));
        assert_eq!(WHEELS.wheels_within(fast.scaled(0.5), 0.9), WHEELS.wheels(fast.scaled(0.5)));
    }

    proptest! {
        #[test]
        fn wheels_agree_with_small_steps(l in -0.9..0.9f64, r in -0.9..0.9f64, dt in 0.01..0.5f64) {
            let mut pose = Isometry2::<f64>::identity();
            for _ in 0..2000 {
                let v = 0.5 * (l + r);
                let w = (r - l) / (2.0 * WHEELS.half_separation_m);
                let h = dt / 2000.0;
                pose *= Isometry2::new(Vector2::new(v * h, 0.0), w * h);
            }
            let motion = EgoMotion::from_wheels(l, r, &WHEELS, dt).isometry();
            prop_assert!((motion.translation.vector - pose.translation.vector).norm() < 1e-3);
            prop_assert!((motion.rotation.inverse() * pose.rotation).angle().abs() < 1e-9);
        }

        #[test]
        fn a_fixed_point_stays_fixed(x in -5.0..5.0f64, y in -5.0..5.0f64, f in -1.0..1.0f64, t in -1.0..1.0f64) {
            let motion = EgoMotion { forward: f, turn: t, ..EgoMotion::at_rest(0.1) };
            let seen = motion.apply_to_point(Point2::new(x, y));
            prop_assert!((motion.isometry() * seen - Point2::new(x, y)).norm() < 1e-12);
        }
    }

    /// Only the left wheel turns, and slips by 2 % of its travel: the standard deviation forward is
    /// half of that slip, and that of the heading is half of it over the half separation.
    #[test]
    fn what_a_wheel_slips_is_uncertain_ahead_and_in_heading() {
        fn of(left: f64, right: f64) -> Matrix3<f64> {
            EgoMotion::from_wheels(left, right, &WHEELS, 0.1).covariance
        }

        let d = WHEELS.half_separation_m;
        let slipped = 0.02 * 0.5 * 0.1;
        let left = of(0.5, 0.0);
        let right = of(0.0, 0.5);
        for covariance in [left, right] {
            assert!((covariance[(0, 0)].sqrt() - 0.5 * slipped).abs() < 1e-12);
            assert!((covariance[(2, 2)].sqrt() - 0.5 * slipped / d).abs() < 1e-12);
            assert_eq!(covariance[(1, 1)], 0.0);
        }
        let both = 0.25 * slipped * slipped / d;
        assert!((left[(0, 2)] + both).abs() < 1e-12 && (right[(0, 2)] - both).abs() < 1e-12);
        assert!((of(0.5, 0.5) - left - right).amax() < 1e-15, "the wheels slip by themselves");
        assert!((of(0.5, 0.5)[(0, 2)]).abs() < 1e-15);
    }

    #[test]
    fn a_small_turn_is_driven_as_its_neighbours_are() {
        assert_eq!((sinc(0.0), sinc(2.0)), (1.0, 2.0_f64.sin() / 2.0));
        for x in [9e-5_f64, -9e-5, 2e-4] {
            let off = 1.0 - sinc(x);
            assert!((off / (x * x / 6.0) - 1.0).abs() < 1e-6, "{x}: {off}");
        }
    }

    /// The step is 3 m forward and 4 m to the side in the axes of the first pose, which faces left.
    #[test]
    fn odometry_poses_give_the_way_between_them_and_how_sure_it_is() {
        let before = Isometry2::new(Vector2::new(1.0, 2.0), std::f64::consts::FRAC_PI_2);
        let after = before * Isometry2::new(Vector2::new(0.3, 0.4), -0.2);
        let motion = EgoMotion::between(&before, &after, 0.25, 0.1);
        let way = [motion.dt, motion.forward, motion.left, motion.turn];
        for (found, expected) in way.iter().zip([0.25, 0.3, 0.4, -0.2]) {
            assert!((found - expected).abs() < 1e-12, "{way:?}");
        }
        let travel = 0.1 * 0.5;
        let expected = [travel * travel, travel * travel, 0.02 * 0.02 + 0.01 * travel * travel];
        for (found, expected) in motion.covariance.diagonal().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{}", motion.covariance);
        }
        assert_eq!(motion.covariance, Matrix3::from_diagonal(&motion.covariance.diagonal()));
    }

    #[test]
    fn one_motion_after_another_is_one_motion() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let covariance = Matrix3::identity() * 0.01;
        let first = EgoMotion {
            forward: 1.0,
            left: 0.5,
            turn: quarter,
            covariance,
            ..EgoMotion::at_rest(0.1)
        };
        let next = EgoMotion { forward: 2.0, turn: 0.3, covariance, ..EgoMotion::at_rest(0.2) };
        let whole = first.then(&next);
        let found = [whole.dt, whole.forward, whole.left, whole.turn];
        for (found, expected) in found.iter().zip([0.3, 1.0, 2.5, quarter + 0.3]) {
            assert!((found - expected).abs() < 1e-12, "{whole:?}");
        }
        assert_eq!(whole.covariance, Matrix3::identity() * 0.02);
    }

    #[test]
    fn a_velocity_over_ground_is_turned_and_not_moved() {
        let turn = std::f64::consts::FRAC_PI_2;
        let motion = EgoMotion { forward: 5.0, left: 1.0, turn, ..EgoMotion::at_rest(0.1) };
        let seen = motion.apply_to_velocity(Vector2::new(1.0, 0.0));
        assert!((seen - Vector2::new(0.0, -1.0)).norm() < 1e-12, "{seen}");
    }

    #[test]
    fn the_pose_on_the_floor_has_the_heading_of_the_front() {
        let tilted = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.7);
        let pose = Isometry3::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), tilted);
        let flat = planar_pose(&pose);
        assert_eq!(flat.translation.vector, Vector2::new(1.0, 2.0));
        assert!((flat.rotation.angle() - 0.7).abs() < 1e-12, "{flat}");
        let back = planar_pose(&spatial_pose(&flat));
        assert!((back.to_homogeneous() - flat.to_homogeneous()).norm() < 1e-12, "{back}");
    }
}
