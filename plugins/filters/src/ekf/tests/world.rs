//! A robot that drives and a person it sees, with a generator of its own so
//! that the numbers are the same everywhere.

use nalgebra::{Isometry2, Matrix3, Point2, Point3, Rotation2, Vector2, Vector3};
use tagalong_core::{Detection, EgoMotion, PersonFilter};
use tagalong_geometry::{Camera, ImageBox, Pinhole, Rect};
use tagalong_math::{RandomSource, SplitMix64};

use crate::ekf::{Ekf, State};

pub const DT_S: f64 = 0.09;
pub const SIGMA_M: f64 = 0.05;

/// Returns three standard normal numbers (Box and Muller).
pub fn normal3(random: &mut SplitMix64) -> Vector3<f64> {
    // From numbers in [0, 1) and not those of `RandomSource::normal`: the bounds of these tests
    // were set with this sequence.
    Vector3::from([(); 3].map(|()| {
        let radius = (-2.0 * (1.0 - random.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * random.uniform()).cos()
    }))
}

pub fn camera() -> Camera {
    Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0)
}

pub fn detection(position: Point3<f64>, sigma_m: f64) -> Detection {
    Detection::new("test", position, Matrix3::identity() * (sigma_m * sigma_m), 1.0)
        .with_image(ImageBox::upper_body(Rect::default()))
}

/// A robot at constant speed, and a person that starts at rest.
pub struct World {
    pub robot: Isometry2<f64>,
    pub person: Point3<f64>,
    pub velocity: Vector2<f64>,
    pub random: SplitMix64,
}

impl World {
    pub fn new(seed: u64) -> Self {
        Self {
            robot: Isometry2::identity(),
            person: Point3::new(4.0, 0.5, 1.6),
            velocity: Vector2::zeros(),
            random: SplitMix64::new(seed),
        }
    }

    /// Drives for one frame; the odometry is exact.
    pub fn drive(&mut self, speed_mps: f64, turn_radps: f64) -> EgoMotion {
        let turn = turn_radps * DT_S;
        let step = Rotation2::new(0.5 * turn) * Vector2::new(speed_mps * DT_S, 0.0);
        let motion = EgoMotion { forward: step.x, left: step.y, turn, ..EgoMotion::at_rest(DT_S) };
        self.robot *= motion.isometry();
        motion
    }

    /// White acceleration of density `q` and a height that wanders.
    pub fn walk(&mut self, q: f64, height_noise: f64) {
        let a = normal3(&mut self.random);
        let b = normal3(&mut self.random);
        let root = q.sqrt();
        let dv = DT_S.sqrt();
        let dp = DT_S.powf(1.5);
        let kick = root * dv * a.xy();
        let slide = root * dp * (0.5 * a.xy() + b.xy() / 12.0_f64.sqrt());
        let moved = self.person.xy() + self.velocity * DT_S + slide;
        let height = self.person.z + height_noise * DT_S.sqrt() * a.z;
        self.person = Point3::new(moved.x, moved.y, height);
        self.velocity += kick;
    }

    pub fn person_in_robot(&self) -> Point3<f64> {
        let floor = self.robot.inverse_transform_point(&self.person.xy());
        Point3::new(floor.x, floor.y, self.person.z)
    }

    pub fn look(&mut self) -> Detection {
        detection(self.person_in_robot() + SIGMA_M * normal3(&mut self.random), SIGMA_M)
    }

    /// Where the state is in the world, and how fast it moves there.
    pub fn of_belief(&self, state: &State) -> (Point2<f64>, Vector2<f64>) {
        let m = &state.mean;
        (self.robot * Point2::new(m[0], m[1]), self.robot * Vector2::new(m[3], m[4]))
    }
}

/// Sees the person once per frame; returns the normalised innovations squared.
pub fn track(
    filter: &Ekf,
    state: &mut State,
    world: &mut World,
    frames: usize,
    mut next: impl FnMut(&mut World) -> EgoMotion,
) -> Vec<f64> {
    let camera = camera();
    let mut all = Vec::new();
    for _ in 0..frames {
        let motion = next(world);
        filter.predict(state, &motion);
        let seen = world.look();
        all.extend(filter.correct(state, &seen, &camera).nis.map(|(nis, _)| nis));
    }
    all
}

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
