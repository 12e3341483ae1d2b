//! Pose from which an image shows the points of a keyframe at their pixels.
//!
//! Gauss-Newton on the brightness around all points at once (Lucas and Kanade 1981; Forster,
//! Pizzoli and Scaramuzza 2014 call it sparse image alignment), over the planar motion of a robot
//! and the pitch of its camera. A patch is shifted and not warped, because the keyframe is always
//! near.

use nalgebra::{Isometry2, Isometry3, Matrix3, Matrix4, Vector2, Vector3, Vector4};
use tagalong_geometry::{Camera, Pinhole};

use crate::odometry::keyframe::{Keyframe, Point, Pyramid};
use crate::odometry::patch::Difference;

/// Maximum number of steps at each of the two image sizes.
const STEPS: usize = 12;
/// A step smaller than this ends the iteration, m and rad.
const STILL: f64 = 2e-5;
/// Number of pixels that count as one measurement, because errors of neighbouring pixels are
/// correlated.
const ALIKE: f64 = 20.0;
/// Prior standard deviation of the camera's pitch, rad.
const NOD_RAD: f64 = 0.02;
/// Minimum depth of a point that is compared, m.
const NEAREST_M: f64 = 0.2;
/// Minimum number of visible points for an estimate.
const LEAST_POINTS: usize = 8;
/// Maximum deviation from the wheel odometry, in standard deviations.
const MOST_SIGMAS: f64 = 3.5;
/// Scale of the robust weight, as a multiple of the median squared difference.
const USUAL: f64 = 3.0;

/// Motion since the keyframe by wheel odometry.
pub struct Prior {
    /// Pose of the robot, in its frame at the keyframe.
    pub pose: Isometry2<f64>,
    /// Standard deviations of forward, left and turn, m and rad.
    pub sigma: Vector3<f64>,
}

impl Prior {
    /// Returns true if the pose deviates from the wheel odometry by more than [`MOST_SIGMAS`]: then
    /// something other than the robot is moving.
    pub fn is_contradicted_by(&self, pose: &Isometry2<f64>) -> bool {
        let off = self.pose.inverse() * pose;
        let off = Vector3::new(off.translation.x, off.translation.y, off.rotation.angle());
        off.component_div(&self.sigma).amax() > MOST_SIGMAS
    }
}

/// Estimated pose from which an image was taken.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Pose of the robot, in its frame at the keyframe.
    pub pose: Isometry2<f64>,
    /// Pitch of the camera relative to the keyframe, rad.
    pub nod: f64,
    /// Covariance of forward, left and turn.
    pub covariance: Matrix3<f64>,
    /// Number of points of the keyframe that the image shows.
    pub seen: usize,
}

/// State of the estimation: forward, left, turn, pitch.
type State = Vector4<f64>;

/// Normal equations of the brightness differences.
struct Equations {
    matrix: Matrix4<f64>,
    vector: State,
    seen: usize,
}

/// Camera with the images of a frame, and the keyframe to compare them with.
pub struct AlignmentInput<'a> {
    pub keyframe: &'a Keyframe,
    pub camera: &'a Camera,
    pub camera_from_robot: Isometry3<f64>,
    pub lens: &'a Pinhole,
    pub images: Pyramid<'a>,
}

impl AlignmentInput<'_> {
    /// Estimates the pose, starting from a guess of the pose and the pitch; `None` if too few
    /// points are visible.
    pub fn align(&self, prior: &Prior, guess: (Isometry2<f64>, f64)) -> Option<Fit> {
        let sigma = prior.sigma.push(NOD_RAD);
        let precision = Matrix4::from_diagonal(&sigma.map(|sigma| sigma.powi(-2)));
        let by_wheels = state(&prior.pose, 0.0);
        let mut at = state(&guess.0, guess.1);
        let mut last = None;
        // Half size first: one pixel there is two of the full image, so that the linearised
        // brightness holds for a worse guess.
        for level in [1, 0] {
            for _ in 0..STEPS {
                let Equations { matrix, vector, seen } = self.equations(level, &at)?;
                let covariance = (matrix + precision).try_inverse()?;
                // The wheel odometry is a Gaussian prior: directions without texture keep its
                // value.
                let step = covariance * (vector + precision * (at - by_wheels));
                at -= step;
                last = Some((covariance, seen));
                if step.amax() < STILL {
                    break;
                }
            }
        }
        let (covariance, seen) = last?;
        let covariance = covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let is_finite = at.iter().chain(&covariance).all(|value| value.is_finite());
        is_finite.then(|| Fit { pose: pose(&at), nod: at.w, covariance, seen })
    }

    /// Returns the normal equations at a state. The weight of a point falls with its mean squared
    /// difference (Geman and McClure); `None` with too few points.
    fn equations(&self, level: usize, at: &State) -> Option<Equations> {
        let stance = Stance::new(at);
        let looks: Vec<PointComparison> =
            self.keyframe.points.iter().filter_map(|p| self.look(p, level, &stance)).collect();
        // At least one squared grey level, the order of quantisation: a perfect match would
        // otherwise have infinite weight.
        let usual =
            median_of_enough(looks.iter().map(|look| look.difference.mean_square))?.max(1.0);
        let mut equations =
            Equations { matrix: Matrix4::zeros(), vector: State::zeros(), seen: looks.len() };
        for look in &looks {
            let unusual = look.difference.mean_square / (USUAL * usual);
            let weight = (1.0 + unusual).powi(-2) / (ALIKE * usual);
            look.add_to(&mut equations, weight);
        }
        Some(equations)
    }

    /// Returns the difference of a point at a state, and the derivative of its pixel with respect
    /// to the state.
    fn look<'p>(
        &self,
        point: &'p Point,
        level: usize,
        stance: &Stance,
    ) -> Option<PointComparison<'p>> {
        let here = point.after(&stance.pose);
        let seen = stance.nod(&(self.camera_from_robot * here).coords);
        if seen.z < NEAREST_M {
            return None;
        }
        let scale = [1.0, 0.5][level];
        let pixel = self.camera.project_from_camera(&seen.into())?;
        let middle = pixel.coords * scale + point.shifts[level];
        let difference = point.patches[level].compare(self.images[level], middle)?;
        let sin = stance.pose.rotation.im;
        let cos = stance.pose.rotation.re;
        let [ahead, aside, turn] = [
            Vector3::new(-cos, sin, 0.0),
            Vector3::new(-sin, -cos, 0.0),
            Vector3::new(here.y, -here.x, 0.0),
        ]
        .map(|way| stance.nod(&(self.camera_from_robot.rotation * way)));
        let moves = [ahead, aside, turn, Vector3::new(0.0, -seen.z, seen.y)];
        let across = seen.x / seen.z;
        let down = seen.y / seen.z;
        let [fx, fy] = [self.lens.fx, self.lens.fy].map(|f| f * scale / seen.z);
        Some(PointComparison {
            difference,
            products: &point.patches[level].products,
            columns: moves.map(|m| fx * (m.x - across * m.z)).into(),
            rows: moves.map(|m| fy * (m.y - down * m.z)).into(),
        })
    }
}

/// Comparison of a point of the keyframe with the image.
struct PointComparison<'p> {
    difference: Difference,
    /// Sums of the products of the slopes of its patch: xx, xy, yy.
    products: &'p [f64; 3],
    /// Derivative of the pixel's column with respect to the state; `rows` is that of its row.
    columns: State,
    rows: State,
}

impl PointComparison<'_> {
    fn add_to(&self, equations: &mut Equations, weight: f64) {
        let ([xx, xy, yy], [x, y]) = (self.products, self.difference.along);
        let by_columns = self.columns * *xx + self.rows * *xy;
        let by_rows = self.columns * *xy + self.rows * *yy;
        equations.matrix +=
            (by_columns * self.columns.transpose() + by_rows * self.rows.transpose()) * weight;
        equations.vector += (self.columns * x + self.rows * y) * weight;
    }
}

/// State with the sine and cosine of its pitch, ready to be applied to points.
struct Stance {
    pose: Isometry2<f64>,
    nod_sin: f64,
    nod_cos: f64,
}

impl Stance {
    fn new(at: &State) -> Self {
        let (nod_sin, nod_cos) = at.w.sin_cos();
        Self { pose: pose(at), nod_sin, nod_cos }
    }

    /// Rotates a vector about the camera's horizontal axis.
    fn nod(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let sin = self.nod_sin;
        let cos = self.nod_cos;
        Vector3::new(v.x, cos * v.y - sin * v.z, sin * v.y + cos * v.z)
    }
}

fn state(pose: &Isometry2<f64>, nod: f64) -> State {
    Vector4::new(pose.translation.x, pose.translation.y, pose.rotation.angle(), nod)
}

fn pose(state: &State) -> Isometry2<f64> {
    Isometry2::new(Vector2::new(state.x, state.y), state.z)
}

/// Returns the median; `None` for fewer than [`LEAST_POINTS`] values.
fn median_of_enough(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (values.len() >= LEAST_POINTS).then(|| tagalong_math::median(values)).flatten()
}

#[cfg(test)]
mod tests {
    use tagalong_core::{DepthImage, GreyImage};
    use tagalong_geometry::Distortion;

    use super::*;
    use crate::odometry::OdometrySettings;

    #[test]
    fn wheels_are_not_wrong_by_any_angle() {
        let pose = Isometry2::new(Vector2::new(0.3, 0.1), 0.8);
        let prior = Prior { pose, sigma: Vector3::new(0.01, 0.01, 0.002) };
        for (forward, left, turn, is_too_far, why) in [
            (0.03, -0.03, 0.006, false, "three standard deviations each"),
            (0.04, 0.0, 0.0, true, "four ahead"),
            (0.0, -0.04, 0.0, true, "four aside"),
            (0.0, 0.0, 0.008, true, "four of the turn"),
        ] {
            let off = Isometry2::new(Vector2::new(forward, left), turn);
            assert_eq!(prior.is_contradicted_by(&(pose * off)), is_too_far, "{why}");
        }
    }

    /// Runs `work` on the keyframe of an image, compared with the same image.
    fn comparing(work: impl FnOnce(&AlignmentInput<'_>)) {
        let lens = Pinhole { fx: 80.0, fy: 85.0, cx: 47.5, cy: 35.5, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 96, 72, 1.1, 0.15, 0.05);
        let image = GreyImage::from_fn(96, 72, |x, y| ((x * 13) ^ (y * 29)) as u8);
        let half = GreyImage::from_fn(48, 36, |x, y| ((x * 26) ^ (y * 58)) as u8);
        let depth = DepthImage::filled(96, 72, 3.0);
        let settings = OdometrySettings { max_depth_m: 9.0, ..OdometrySettings::default() };
        let keyframe = Keyframe::new(&settings, &camera, &[&image, &half], &depth, &[]);
        assert!(keyframe.points.len() > 4);
        let view = AlignmentInput {
            keyframe: &keyframe,
            camera: &camera,
            camera_from_robot: camera.robot_from_camera.inverse(),
            lens: &lens,
            images: [&image, &half],
        };
        work(&view);
    }

    /// A pixel with an odd index is half a pixel off the centre of its patch at half size.
    #[test]
    fn an_image_does_not_differ_from_itself_at_either_size() {
        comparing(|view| {
            let stance = Stance::new(&State::zeros());
            let shifted = view.keyframe.points.iter().filter(|point| point.shifts[1].norm() > 0.0);
            assert!(shifted.count() > 0);
            for point in &view.keyframe.points {
                for level in [0, 1] {
                    let Some(look) = view.look(point, level, &stance) else { continue };
                    let mean_square = look.difference.mean_square;
                    assert!(mean_square < 1e-3, "{level}: {mean_square}");
                }
            }
        });
    }

    #[test]
    fn pixels_move_with_the_state_as_the_equations_say() {
        comparing(slopes_are_right);
    }

    fn slopes_are_right(view: &AlignmentInput<'_>) {
        let camera = view.camera;
        let keyframe = view.keyframe;
        let at = State::new(0.02, -0.01, 0.015, 0.004);
        let mut compared = 0;
        for point in &keyframe.points {
            let Some(look) = view.look(point, 0, &Stance::new(&at)) else { continue };
            for axis in 0..4 {
                let mut step = State::zeros();
                step[axis] = 1e-6;
                let [after, before] = [at + step, at - step].map(|at| {
                    let stance = Stance::new(&at);
                    let place = view.camera_from_robot * point.after(&stance.pose);
                    camera.project_from_camera(&stance.nod(&place.coords).into()).unwrap()
                });
                let slope = (after - before) / 2e-6;
                let expected = Vector2::new(look.columns[axis], look.rows[axis]);
                assert!((slope - expected).norm() < 1e-3 * (1.0 + slope.norm()), "{axis}");
            }
            compared += 1;
        }
        assert!(compared > 4);
    }
}
