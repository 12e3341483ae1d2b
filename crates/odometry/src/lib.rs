//! The robot's own motion, as far as the images show it.
//!
//! Wheels that are half a percent larger than believed turn a robot by a degree in a
//! metre, and whoever is five metres away is then ten centimetres beside their place in
//! any frame but the robot's. What stands still in the images tells: [`VisualOdometry`]
//! compares each image with one that was taken a few decimetres before, at points whose
//! depth is known, and corrects the motion by the wheels. People are left out, and what
//! is behind them: their outlines move with them.
//!
//! A bare wall says nothing, and then the wheels are believed; what little is seen counts
//! by how much it says.

mod align;
mod keyframe;
mod patch;
mod settings;
#[cfg(test)]
mod tests;

use nalgebra::{Isometry2, Point2, Vector3};
use tagalong_core::{DepthImage, Frame, Funnel, GreyImage, Lens, Motion, Pinhole};

use align::{Fit, Prior, View};
use keyframe::{Keyframe, Pyramid};
pub use settings::OdometrySettings;

/// The wheels are never believed to less than this, m and rad.
const LEAST_M: f64 = 1e-3;
const LEAST_RAD: f64 = 3e-4;
/// Part of the points of a keyframe that an image must show.
const SHOWN: f64 = 0.6;

/// Corrects odometry by what stands still in the images.
pub struct VisualOdometry {
    settings: OdometrySettings,
    reference: Option<Reference>,
    half: GreyImage,
}

/// What images are compared with.
struct Reference {
    keyframe: Keyframe,
    by_wheels: Way,
    /// The robot in its frame at the keyframe, as far as is known.
    pose: Isometry2<f64>,
    /// How the camera nods, compared to the keyframe, rad.
    nod: f64,
}

/// The way since a keyframe, by the wheels alone.
#[derive(Default)]
struct Way {
    pose: Isometry2<f64>,
    travel_m: f64,
    turned_rad: f64,
}

impl VisualOdometry {
    /// Odometry by these settings.
    pub fn new(settings: OdometrySettings) -> Self {
        Self { settings, reference: None, half: GreyImage::default() }
    }

    /// The robot's motion since the frame before. `motion` is what the wheels say of it;
    /// without one, nothing that was seen before is of use. `people` were at these places
    /// on the floor in that frame, robot frame, m.
    ///
    /// A frame without depth or with a panorama, and one that shows too little of what
    /// stands still, leaves the motion as it is; the latter is counted in the funnel.
    pub fn see(
        &mut self,
        frame: &Frame,
        motion: Option<Motion>,
        people: &[Point2<f64>],
        funnel: &mut Funnel,
    ) -> Option<Motion> {
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
        let moved = motion.unwrap_or(Motion::at_rest(0.0));
        self.reference = reference.or_else(|| {
            let people: Vec<_> = people.iter().map(|place| moved.apply_to_point(*place)).collect();
            Reference::new(settings, frame, images, depth, &people, funnel)
        });
        motion
    }
}

impl Reference {
    /// The frame itself; `None` if it shows too little.
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
        let (by_wheels, pose) = (Way::default(), Isometry2::identity());
        is_enough.then_some(Self { keyframe, by_wheels, pose, nod: 0.0 })
    }

    /// Corrects the motion to a frame; keeps the reference if the next frame can be
    /// compared with it, too.
    fn compare(
        mut self,
        settings: &OdometrySettings,
        frame: &Frame,
        (lens, images): (&Pinhole, Pyramid<'_>),
        motion: Motion,
        funnel: &mut Funnel,
    ) -> (Option<Self>, Option<Motion>) {
        self.by_wheels.go_on(&motion);
        let view = View {
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
        let corrected = Motion {
            forward: step.translation.x,
            left: step.translation.y,
            turn: step.rotation.angle(),
            // Of two poses, each known as well.
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
    fn go_on(&mut self, motion: &Motion) {
        let step = motion.isometry();
        self.pose *= step;
        self.travel_m += step.translation.vector.norm();
        self.turned_rad += motion.turn.abs();
    }

    /// What it says. Wheels are wrong by the same fraction all the way.
    fn prior(&self, settings: &OdometrySettings) -> Prior {
        let far = settings.wheel_error * self.travel_m + LEAST_M;
        let turn = settings.heading_error_per_m * self.travel_m
            + settings.wheel_error * self.turned_rad
            + LEAST_RAD;
        Prior { pose: self.pose, sigma: Vector3::new(far, far, turn) }
    }
}

/// Means of two by two pixels.
fn halve(image: &GreyImage, half: &mut GreyImage) {
    let (width, height) = (image.width() / 2, image.height() / 2);
    if (half.width(), half.height()) != (width, height) {
        *half = GreyImage::filled(width, height, 0);
    }
    for (y, row) in half.pixels_mut().chunks_exact_mut(width.max(1)).enumerate() {
        let (above, below) = (image.row(2 * y), image.row(2 * y + 1));
        let pairs = above.chunks_exact(2).zip(below.chunks_exact(2));
        for (mean, (above, below)) in row.iter_mut().zip(pairs) {
            let sum: u16 = above.iter().chain(below).map(|grey| u16::from(*grey)).sum();
            *mean = ((sum + 2) / 4) as u8;
        }
    }
}
