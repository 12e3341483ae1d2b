//! Ego-motion from images, which corrects wheel odometry.
//!
//! A wheel half a percent larger than calibrated turns a robot by about a degree per metre, and a
//! person at 5 m is then some 10 cm off in any frame but the robot's. [`VisualOdometry`] compares
//! each image with one taken a few decimetres earlier, at static points of known depth, and
//! corrects the wheel odometry. Points on people, and behind them, are left out because their
//! outlines move.
//!
//! [`CameraMotion`] needs neither wheel odometry nor depth: it fits a rotation and a zoom to
//! corners that are tracked from image to image, for a camera that turns and shakes.
//!
//! An image of a bare wall carries no information and leaves the wheel odometry unchanged;
//! otherwise the weight of the image grows with its texture.

mod align;
mod image;
mod keyframe;
mod patch;
mod settings;
#[cfg(test)]
mod tests;

use nalgebra::{Isometry2, Point2, Vector3};
use tagalong_core::{DepthImage, EgoMotion, Frame, Funnel, GreyImage};
use tagalong_geometry::{Lens, Pinhole};

use align::{AlignmentInput, Fit, Prior};
pub use image::{CameraMotion, CameraMoved, Swing, SwingFit};
use keyframe::{Keyframe, Pyramid};
pub use settings::{MotionSource, OdometrySettings};

/// Minimum standard deviations of the wheel odometry, m and rad.
const LEAST_M: f64 = 1e-3;
const LEAST_RAD: f64 = 3e-4;
/// Fraction of a keyframe's points that an image must show for the keyframe to be kept.
const SHOWN: f64 = 0.6;

/// Correction of wheel odometry by the static points of the images.
pub struct VisualOdometry {
    settings: OdometrySettings,
    reference: Option<Reference>,
    half: GreyImage,
}

/// Keyframe that images are compared with.
struct Reference {
    keyframe: Keyframe,
    by_wheels: Way,
    /// Estimated pose of the robot in its frame at the keyframe.
    pose: Isometry2<f64>,
    /// Pitch of the camera relative to the keyframe, rad.
    nod: f64,
}

/// Path since the keyframe by wheel odometry alone.
#[derive(Default)]
struct Way {
    pose: Isometry2<f64>,
    travel_m: f64,
    turned_rad: f64,
}

impl VisualOdometry {
    /// Creates the odometry with these settings.
    pub fn new(settings: OdometrySettings) -> Self {
        Self { settings, reference: None, half: GreyImage::default() }
    }

    /// Returns the robot's motion since the previous frame. `motion` is that of the wheel odometry;
    /// without it the keyframe is dropped. `people` are positions on the floor in the previous
    /// frame, in the robot frame, m.
    ///
    /// The motion is unchanged for a frame without depth, with a panorama, or with too few static
    /// points; the last case is counted in the funnel.
    pub fn see(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        people: &[Point2<f64>],
        funnel: &mut Funnel,
    ) -> Option<EgoMotion> {
        let (Ok(grey), Ok(depth), Lens::Pinhole(lens)) =
            (frame.grey(), frame.depth(), &frame.camera.lens)
        else {
            self.reference = None;
            return motion;
        };
        halve(grey, &mut self.half);
        let images = [grey, &self.half];
        let settings = &self.settings;
        let before = self.reference.take().zip(motion);
        let compared = before.map(|(reference, motion)| {
            reference.compare(settings, frame, (lens, images), motion, funnel)
        });
        let (reference, motion) = compared.unwrap_or((None, motion));
        let moved = motion.unwrap_or(EgoMotion::at_rest(0.0));
        self.reference = reference.or_else(|| {
            // The positions of the people are those of the previous frame, but the keyframe is this
            // one.
            let people: Vec<_> = people.iter().map(|place| moved.apply_to_point(*place)).collect();
            Reference::new(settings, frame, images, depth, &people, funnel)
        });
        motion
    }
}

impl Reference {
    /// Makes a keyframe of the frame; `None` if it has too few points.
    fn new(
        settings: &OdometrySettings,
        frame: &Frame,
        images: Pyramid<'_>,
        depth: &DepthImage,
        people: &[Point2<f64>],
        funnel: &mut Funnel,
    ) -> Option<Self> {
        let keyframe = Keyframe::new(settings, &frame.camera, &images, depth, people);
        let is_enough = keyframe.points.len() >= settings.min_points;
        funnel.drop_many("odometry: too few points", u64::from(!is_enough));
        let by_wheels = Way::default();
        let pose = Isometry2::identity();
        is_enough.then_some(Self { keyframe, by_wheels, pose, nod: 0.0 })
    }

    /// Corrects the motion to a frame. Keeps the reference if the next frame can also be compared
    /// with it.
    fn compare(
        mut self,
        settings: &OdometrySettings,
        frame: &Frame,
        (lens, images): (&Pinhole, Pyramid<'_>),
        motion: EgoMotion,
        funnel: &mut Funnel,
    ) -> (Option<Self>, Option<EgoMotion>) {
        self.by_wheels.go_on(&motion);
        let view = AlignmentInput {
            keyframe: &self.keyframe,
            camera: &frame.camera,
            camera_from_robot: frame.camera.robot_from_camera.inverse(),
            lens,
            images,
        };
        let guess = (self.pose * motion.isometry(), self.nod);
        let prior = self.by_wheels.prior(settings);
        let Some(fit) = view.align(&prior, guess) else {
            funnel.drop_many("odometry: too little in common with the image before", 1);
            return (None, Some(motion));
        };
        if prior.is_contradicted_by(&fit.pose) {
            funnel.drop_many("odometry: image contradicts the wheels", 1);
            return (None, Some(motion));
        }
        let step = self.pose.inverse() * fit.pose;
        let corrected = EgoMotion {
            forward: step.translation.x,
            left: step.translation.y,
            turn: step.rotation.angle(),
            // The covariance is that of the difference of two poses of equal covariance.
            covariance: 2.0 * fit.covariance,
            ..motion
        };
        let is_near = self.is_near(settings, &fit);
        (self.pose, self.nod) = (fit.pose, fit.nod);
        (is_near.then_some(self), Some(corrected))
    }

    fn is_near(&self, settings: &OdometrySettings, fit: &Fit) -> bool {
        fit.pose.translation.vector.norm() < settings.max_travel_m
            && fit.pose.rotation.angle().abs() < settings.max_turn_deg.to_radians()
            && fit.seen as f64 > SHOWN * self.keyframe.points.len() as f64
    }
}

impl Way {
    fn go_on(&mut self, motion: &EgoMotion) {
        let step = motion.isometry();
        self.pose *= step;
        self.travel_m += step.translation.vector.norm();
        self.turned_rad += motion.turn.abs();
    }

    /// Returns the pose with its deviations. The scale error of a wheel is constant over the path,
    /// so the deviations grow linearly with the distance.
    fn prior(&self, settings: &OdometrySettings) -> Prior {
        let far = settings.wheel_error * self.travel_m + LEAST_M;
        let turn = settings.heading_error_per_m * self.travel_m
            + settings.wheel_error * self.turned_rad
            + LEAST_RAD;
        Prior { pose: self.pose, sigma: Vector3::new(far, far, turn) }
    }
}

/// Halves an image: each pixel is the mean of two by two.
fn halve(image: &GreyImage, half: &mut GreyImage) {
    let width = image.width() / 2;
    let height = image.height() / 2;
    if (half.width(), half.height()) != (width, height) {
        *half = GreyImage::filled(width, height, 0);
    }
    for (y, row) in half.pixels_mut().chunks_exact_mut(width.max(1)).enumerate() {
        let above = image.row(2 * y);
        let below = image.row(2 * y + 1);
        let pairs = above.chunks_exact(2).zip(below.chunks_exact(2));
        for (mean, (above, below)) in row.iter_mut().zip(pairs) {
            let sum: u16 = above.iter().chain(below).map(|grey| u16::from(*grey)).sum();
            // Adding 2 before the division rounds to nearest.
            *mean = ((sum + 2) / 4) as u8;
        }
    }
}
