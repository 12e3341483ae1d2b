//! State of one track, its prediction over time and robot motion, and its update by a detection.

use nalgebra::{
    Cholesky, Const, Matrix2, Matrix3, Matrix5, Point2, SMatrix, Vector2, Vector3, Vector5,
};
use tagalong_core::{Detection, EgoMotion, Estimate, Person, Update};
use tagalong_geometry::{Camera, Rect};

use crate::image_kalman::Config;
use crate::image_kalman::space::{ImagePoint, RobotPoint, pixel_covariance, range};

type Matrix3x5 = SMatrix<f64, 3, 5>;

/// Narrowest box, pixels.
const MIN_WIDTH_PX: f64 = 1.0;
/// Nearest range that is accepted, m.
const MIN_RANGE_M: f64 = 0.15;
/// Step of the derivatives with respect to the robot's motion, m and rad.
const MOTION_STEP: f64 = 1e-4;

/// Gaussian state of one person.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// (x, y, vx, vy, s): centre of the box, pixels; its velocity with the robot's motion taken
    /// out, pixels/s; its width, pixels.
    pub image: Vector5<f64>,
    /// Covariance of `image`.
    pub image_covariance: Matrix5<f64>,
    /// Distance of the centre of the head from the camera, m, and its rate, m/s.
    pub range: Vector2<f64>,
    /// Covariance of `range`.
    pub range_covariance: Matrix2<f64>,
    shape: Shape,
    /// Position in space of a person behind the camera, after a motion of the robot: there is no
    /// pixel, so the person is kept here until in front again.
    behind: Option<RobotPoint>,
    /// Camera of the frame in whose pixels the state is.
    camera: Camera,
    /// Box of the detection in this frame, where that is to be reported.
    observed: Option<Rect>,
}

/// Parts of a box that do not change as it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shape {
    /// Height over width.
    aspect: f64,
    /// From the centre of the box to the centre of the head, in widths.
    head: Vector2<f64>,
}

impl Shape {
    /// Returns the shape of a detection; `None` for a box without area or a head behind the camera.
    fn of(detection: &Detection, camera: &Camera) -> Option<Self> {
        let rect = detection.rect_in(camera);
        let Rect { width, height, .. } = rect;
        let head = camera.project(&detection.position)?;
        let is_box = width >= MIN_WIDTH_PX && height >= MIN_WIDTH_PX;
        is_box.then(|| Self { aspect: height / width, head: (head - rect.centre()) / width })
    }

    fn blend(&mut self, seen: &Self, weight: f64) {
        self.aspect += weight * (seen.aspect - self.aspect);
        self.head += weight * (seen.head - self.head);
    }
}

/// Difference between a box and its prediction.
struct Innovation {
    /// Measurement matrix and measurement noise.
    look: Matrix3x5,
    noise: Matrix3<f64>,
    innovation: Vector3<f64>,
    /// Its covariance, S = H P H^T + R.
    spread: Cholesky<f64, Const<3>>,
}

impl State {
    /// Initialises the state from the first detection.
    pub fn start(config: &Config, detection: &Detection, camera: &Camera) -> Self {
        let rect = detection.rect_in(camera);
        let centre = rect.centre();
        let width = rect.width.max(MIN_WIDTH_PX);
        let speed = (config.initial_speed * width).powi(2);
        let mut image_covariance = Matrix5::from_diagonal_element(speed);
        let noise = image_noise(config, detection, width, camera);
        image_covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&noise.fixed_view::<2, 2>(0, 0));
        image_covariance[(4, 4)] = noise[(2, 2)];
        let (range, range_noise) = measured_range(config, detection, camera);
        let upper_body = Shape { aspect: 1.0, head: Vector2::zeros() };
        Self {
            image: Vector5::new(centre.x, centre.y, 0.0, 0.0, width),
            image_covariance,
            range: Vector2::new(range.max(MIN_RANGE_M), 0.0),
            range_covariance: Matrix2::from_diagonal(&Vector2::new(
                range_noise,
                config.initial_range_speed_mps.powi(2),
            )),
            shape: Shape::of(detection, camera).unwrap_or(upper_body),
            behind: None,
            camera: camera.clone(),
            observed: config.observed_boxes.then_some(rect),
        }
    }

    /// Predicts forward in time (eq. 7), and into the robot's new frame.
    pub fn predict(&mut self, config: &Config, motion: &EgoMotion, camera: &Camera) {
        self.observed = None;
        // The pixel velocity is that of the old frame, so the time step comes before the change
        // of frame.
        self.walk(config, motion.dt);
        self.turn_with(motion, camera);
        self.camera.clone_from(camera);
        self.stay_in_range();
    }

    /// Applies the constant-velocity model; the width and the rate of the range are random walks.
    fn walk(&mut self, config: &Config, dt: f64) {
        let mut step = Matrix5::identity();
        let (passed, kept) = decayed(config.velocity_decay_s, dt);
        (step[(0, 2)], step[(1, 3)]) = (passed, passed);
        (step[(2, 2)], step[(3, 3)]) = (kept, kept);
        let noise = process_noise(config, self.image[4], dt);
        self.image = step * self.image;
        self.image_covariance = symmetric(step * self.image_covariance * step.transpose() + noise);
        let step = Matrix2::new(1.0, dt, 0.0, 1.0);
        self.range = step * self.range;
        self.range_covariance = step * self.range_covariance * step.transpose()
            + white_acceleration(config.range_noise, dt);
    }

    /// Compensates the robot's own motion, and that of the camera on the robot: the head is moved in
    /// space, and the box with it.
    fn turn_with(&mut self, motion: &EgoMotion, camera: &Camera) {
        // The floor keeps the ratio of the widths finite for a head beside the lens.
        fn depth(camera: &Camera, place: &RobotPoint) -> f64 {
            camera.depth_of(&place.position).max(MIN_RANGE_M)
        }

        let before = self.seen();
        let last = before.in_space(&self.camera);
        let place = match self.behind.take() {
            Some(place) => place.walked(motion.dt),
            None if is_still(motion) && self.camera == *camera => return,
            None => last,
        };
        let place = place.after(motion);
        let Some(after) = place.seen(camera) else {
            self.behind = Some(place);
            return;
        };
        self.doubt_the_motion(&before, &after, motion, camera);
        self.image[4] *= depth(&self.camera, &last) / depth(camera, &place);
        self.image[4] *= zoom(&self.camera, camera);
        self.image.fixed_rows_mut::<2>(2).copy_from(&after.velocity);
        let centre = after.pixel - self.shape.head * self.image[4];
        self.image.fixed_rows_mut::<2>(0).copy_from(&centre.coords);
        self.range = after.range;
    }

    /// Adds the errors of the odometry, and the error of the image shift that follows from the
    /// uncertain range.
    fn doubt_the_motion(
        &mut self,
        before: &ImagePoint,
        after: &ImagePoint,
        motion: &EgoMotion,
        camera: &Camera,
    ) {
        let mut by_motion = Matrix3::zeros();
        for (column, step) in steps(motion).into_iter().enumerate() {
            let Some(moved) = before.after(&step, [&self.camera, camera]) else { return };
            by_motion.set_column(column, &(difference(&moved, after) / MOTION_STEP));
        }
        let noise = by_motion * motion.covariance * by_motion.transpose();
        let mut place = self.image_covariance.fixed_view_mut::<2, 2>(0, 0);
        place += noise.fixed_view::<2, 2>(0, 0);
        self.range_covariance[(0, 0)] += noise[(2, 2)];
        // The shift at one standard deviation of the range gives that error to first order.
        let sigma = Vector2::new(self.range_covariance[(0, 0)].max(0.0).sqrt(), 0.0);
        let farther = ImagePoint { range: before.range + sigma, ..*before };
        if let Some(moved) = farther.after(motion, [&self.camera, camera]) {
            let shift = moved.pixel - after.pixel;
            place = self.image_covariance.fixed_view_mut::<2, 2>(0, 0);
            place += shift * shift.transpose();
        }
        self.image_covariance = symmetric(self.image_covariance);
    }

    /// Updates the state with a detection (eq. 8, with a correct measurement matrix), in Joseph
    /// form.
    pub fn correct(&mut self, config: &Config, seen: &Detection, camera: &Camera) -> Update {
        if self.behind.is_some() {
            // The image state means nothing behind the camera, so the track starts anew.
            *self = Self::start(config, seen, camera);
            return Update::default();
        }
        let by_box = self.correct_box(config, seen, camera);
        let by_range = self.correct_range(config, seen, camera);
        if let Some(shape) = Shape::of(seen, camera) {
            self.shape.blend(&shape, config.shape_weight);
        }
        self.stay_in_range();
        self.observed = config.observed_boxes.then(|| seen.rect_in(camera));
        let parts = [by_box.map(|nis| (nis, 3)), by_range.map(|nis| (nis, 1))];
        Update::new(parts.into_iter().flatten().reduce(|a, b| (a.0 + b.0, a.1 + b.1)))
    }

    /// Returns true for a person behind the camera, whose box means nothing.
    pub(crate) fn is_behind(&self) -> bool {
        self.behind.is_some()
    }

    /// Replaces the estimates by the moments of a mixture of states with these weights, which sum to
    /// 1. What does not change as a box moves stays.
    pub(crate) fn take_mixture<'s>(
        &mut self,
        parts: impl Iterator<Item = (f64, &'s Self)> + Clone,
    ) {
        let mut image = Vector5::zeros();
        let mut range = Vector2::zeros();
        for (weight, state) in parts.clone() {
            image += state.image * weight;
            range += state.range * weight;
        }
        let mut image_covariance = Matrix5::zeros();
        let mut range_covariance = Matrix2::zeros();
        for (weight, state) in parts {
            let apart = state.image - image;
            let farther = state.range - range;
            image_covariance += (state.image_covariance + apart * apart.transpose()) * weight;
            range_covariance += (state.range_covariance + farther * farther.transpose()) * weight;
        }
        (self.image, self.image_covariance) = (image, symmetric(image_covariance));
        (self.range, self.range_covariance) = (range, range_covariance);
    }

    /// Returns the log-likelihood of a detection's box, up to a constant; `None` for a covariance
    /// that is singular.
    pub(crate) fn log_likelihood(
        &self,
        config: &Config,
        seen: &Detection,
        camera: &Camera,
    ) -> Option<f64> {
        let Innovation { innovation, spread, .. } = self.innovation(config, seen, camera)?;
        let log_volume = 2.0 * spread.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>();
        Some(-0.5 * (innovation.dot(&spread.solve(&innovation)) + log_volume))
    }

    /// Returns the innovation of centre and width of a box; `None` for a covariance that is
    /// singular.
    fn innovation(&self, config: &Config, seen: &Detection, camera: &Camera) -> Option<Innovation> {
        let look = measurement();
        let noise = image_noise(config, seen, self.image[4], camera);
        let rect = seen.rect_in(camera);
        let measured = Vector3::new(rect.centre().x, rect.centre().y, rect.width);
        let innovation = measured - look * self.image;
        let spread = (look * self.image_covariance * look.transpose() + noise).cholesky()?;
        Some(Innovation { look, noise, innovation, spread })
    }

    /// Updates the box; returns the normalised innovation squared of centre and width.
    fn correct_box(&mut self, config: &Config, seen: &Detection, camera: &Camera) -> Option<f64> {
        let Innovation { look, noise, innovation, spread } =
            self.innovation(config, seen, camera)?;
        let p = self.image_covariance;
        let gain = spread.solve(&(look * p)).transpose();
        self.image += gain * innovation;
        let kept = Matrix5::identity() - gain * look;
        self.image_covariance =
            symmetric(kept * p * kept.transpose() + gain * noise * gain.transpose());
        Some(innovation.dot(&spread.solve(&innovation)))
    }

    /// Updates the range; returns its normalised innovation squared.
    fn correct_range(&mut self, config: &Config, seen: &Detection, camera: &Camera) -> Option<f64> {
        let (measured, noise) = measured_range(config, seen, camera);
        if measured < MIN_RANGE_M {
            return None;
        }
        let p = self.range_covariance;
        let spread = p[(0, 0)] + noise;
        let gain = p.column(0) / spread;
        let innovation = measured - self.range.x;
        self.range += gain * innovation;
        let kept = Matrix2::identity() - gain * Vector2::x().transpose();
        let corrected = kept * p * kept.transpose() + gain * noise * gain.transpose();
        // Rounding would make the matrix asymmetric over many frames.
        self.range_covariance = 0.5 * (corrected + corrected.transpose());
        Some(innovation * innovation / spread)
    }

    /// Returns position, velocity and box in the common form.
    pub fn estimate(&self, camera: &Camera) -> Estimate {
        let head = self.seen();
        let place = self.behind.unwrap_or_else(|| head.in_space(camera));
        let mut seen_covariance = SMatrix::<f64, 6, 6>::zeros();
        let image = self.image_covariance.fixed_view::<4, 4>(0, 0);
        seen_covariance.fixed_view_mut::<4, 4>(0, 0).copy_from(&image);
        seen_covariance.fixed_view_mut::<2, 2>(4, 4).copy_from(&self.range_covariance);
        let jacobian = head.jacobian(camera);
        let covariance = jacobian * seen_covariance * jacobian.transpose();
        let width = self.image[4];
        let height = self.image[4] * self.shape.aspect;
        let left = self.image[0] - 0.5 * width;
        let top = self.image[1] - 0.5 * height;
        Estimate::new(
            Person { position: place.position, velocity: place.velocity.xy() },
            symmetric(covariance),
            match (self.behind, self.observed) {
                (Some(_), _) => Rect::default(),
                (None, Some(observed)) => observed,
                (None, None) => Rect::new(left, top, width, height),
            },
        )
    }

    /// Returns the head in image coordinates and range.
    fn seen(&self) -> ImagePoint {
        let centre = Point2::new(self.image[0], self.image[1]);
        ImagePoint {
            pixel: centre + self.shape.head * self.image[4],
            velocity: Vector2::new(self.image[2], self.image[3]),
            range: self.range,
        }
    }

    fn stay_in_range(&mut self) {
        self.image[4] = self.image[4].max(MIN_WIDTH_PX);
        self.range.x = self.range.x.max(MIN_RANGE_M);
    }
}

/// Returns the way per unit of velocity in `dt`, s, and the part of the velocity that is left, if it
/// decays with a time constant (Ornstein-Uhlenbeck process); without one it stays.
fn decayed(time_constant_s: f64, dt: f64) -> (f64, f64) {
    if time_constant_s == 0.0 {
        return (dt, 1.0);
    }
    let kept = (-dt / time_constant_s).exp();
    (time_constant_s * (1.0 - kept), kept)
}

/// Returns H of eq. 8 without the time step, because the state is already predicted.
fn measurement() -> Matrix3x5 {
    let mut look = Matrix3x5::zeros();
    look[(0, 0)] = 1.0;
    look[(1, 1)] = 1.0;
    look[(2, 4)] = 1.0;
    look
}

fn process_noise(config: &Config, width: f64, dt: f64) -> Matrix5<f64> {
    let mut noise = Matrix5::zeros();
    let axis_noise = white_acceleration(config.acceleration_noise * width.powi(2), dt);
    for axis in 0..2 {
        noise[(axis, axis)] = axis_noise[(0, 0)] + (config.position_noise * width).powi(2) * dt;
        noise[(axis + 2, axis + 2)] = axis_noise[(1, 1)];
        noise[(axis, axis + 2)] = axis_noise[(0, 1)];
        noise[(axis + 2, axis)] = axis_noise[(1, 0)];
    }
    noise[(4, 4)] = (config.scale_noise * width).powi(2) * dt;
    noise
}

/// Returns the noise of (position, velocity) under white acceleration of density `q` over `dt`.
fn white_acceleration(q: f64, dt: f64) -> Matrix2<f64> {
    let cross = q * dt.powi(2) / 2.0;
    Matrix2::new(q * dt.powi(3) / 3.0, cross, cross, q * dt)
}

/// Returns the measurement noise of (x, y, s), pixels².
fn image_noise(
    config: &Config,
    detection: &Detection,
    width: f64,
    camera: &Camera,
) -> Matrix3<f64> {
    let own = (config.sigma_centre * width).powi(2);
    let scale = (config.sigma_scale * width).powi(2);
    let mut noise = Matrix3::from_diagonal(&Vector3::new(own, own, scale));
    let mut place = noise.fixed_view_mut::<2, 2>(0, 0);
    // Half the detection's covariance and half its transpose: the sum is exactly symmetric.
    if let Some(known) = pixel_covariance(camera, &detection.position, &detection.covariance) {
        place += 0.5 * (known + known.transpose());
    }
    noise
}

/// Returns the range of the head, m, and its measurement noise, m².
fn measured_range(config: &Config, detection: &Detection, camera: &Camera) -> (f64, f64) {
    let (range, variance) = range(camera, &detection.position, &detection.covariance);
    (range, variance + config.sigma_range_m.powi(2))
}

/// Returns the factor by which things grow in the image where the focal length changes.
fn zoom(from: &Camera, to: &Camera) -> f64 {
    if from.lens == to.lens { 1.0 } else { to.focal_px() / from.focal_px() }
}

fn is_still(motion: &EgoMotion) -> bool {
    let EgoMotion { forward, left, turn, covariance, .. } = motion;
    *forward == 0.0 && *left == 0.0 && *turn == 0.0 && *covariance == Matrix3::zeros()
}

/// Returns the motion with a small step added to each of its three components in turn.
fn steps(motion: &EgoMotion) -> [EgoMotion; 3] {
    [
        EgoMotion { forward: motion.forward + MOTION_STEP, ..*motion },
        EgoMotion { left: motion.left + MOTION_STEP, ..*motion },
        EgoMotion { turn: motion.turn + MOTION_STEP, ..*motion },
    ]
}

/// Returns pixel and range of `a` minus those of `b`.
fn difference(a: &ImagePoint, b: &ImagePoint) -> Vector3<f64> {
    let pixel = a.pixel - b.pixel;
    Vector3::new(pixel.x, pixel.y, a.range.x - b.range.x)
}

fn symmetric(m: Matrix5<f64>) -> Matrix5<f64> {
    0.5 * (m + m.transpose())
}
