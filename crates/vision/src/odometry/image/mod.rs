//! Motion of the camera from its images alone, for logs without odometry and depth. Corners are
//! tracked from image to image, a rotation and a zoom of the camera are fitted to those that agree,
//! and the result is returned as a turn and a forward motion of the robot, and as a nod and a roll
//! of the camera.

mod corners;
mod flow;
mod swing;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Point2, UnitQuaternion, Vector2, Vector3};
use tagalong_core::{EgoMotion, Estimate, Frame, Funnel, GreyImage};
use tagalong_geometry::{Camera, Lens, Rect};

use crate::odometry::{OdometrySettings, halve};
use corners::corners;
use flow::{track, whole_shift};
use swing::Pair;
pub use swing::{Swing, SwingFit};

/// Maximum number of sizes of an image, each half of the one before.
const LEVELS: usize = 4;
/// Smallest side of an image that is worth halving, px.
const LEAST_SIDE_PX: usize = 48;
/// Fraction of the corners that must agree on a motion so that no other one is searched for.
const MOST: f64 = 0.6;
/// Assumed height of a person of whom only the upper body is known, m.
const TALL_M: f64 = 1.8;
/// Ratio of height to width from which on a region encloses a whole person.
const WHOLE_FROM: f64 = 1.5;
/// Fraction by which the box of a person is enlarged, for limbs outside of it.
const LIMBS: f64 = 0.3;
/// Distance from a fitted motion within which a corner agrees with it, as a fraction of the width of
/// the image: 1.3 px of 640.
const AGREES: f64 = 2e-3;
/// Error of a pan in addition to that of the corners, px: a scene with depth does not move like one
/// far away, and neither do people without a track. A camera whose image moves less than this is at
/// rest.
const MODEL_PX: f64 = 0.3;
/// Error of the forward motion, as a fraction of it, because the depth of the scene is a guess.
const GUESSED_DEPTH: f64 = 0.5;
/// Smallest horizontal part of the optical axis for which the camera has a heading.
const LEAST_LEVEL: f64 = 0.2;

/// Motion of a camera from its images.
pub struct CameraMotion {
    settings: OdometrySettings,
    last: Option<View>,
}

/// An image at several sizes, with the camera that took it.
struct View {
    levels: Vec<GreyImage>,
    /// The camera as the log describes it.
    nominal: Camera,
    /// Rotation of the camera in the robot frame, estimated from the images.
    mount: UnitQuaternion<f64>,
}

/// Motion of the camera from one frame to the next.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CameraMoved {
    /// Motion of the robot.
    pub motion: Option<EgoMotion>,
    /// Camera of the frame, if it differs from that of the log.
    pub camera: Option<Camera>,
}

impl CameraMotion {
    /// Creates the estimator with these settings.
    pub fn new(settings: OdometrySettings) -> Self {
        Self { settings, last: None }
    }

    /// Returns the robot's motion since the previous frame, and the camera of this one. `motion` is
    /// that of the log. Unless it is rest it is returned unchanged, and only the nod and the roll
    /// of the camera come from the images. `people` are those of the previous frame.
    ///
    /// A frame without an image or with a panorama changes nothing, nor does one with too few
    /// corners that agree, which is counted in the funnel.
    pub fn see(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        people: &[Estimate],
        funnel: &mut Funnel,
    ) -> CameraMoved {
        let (Ok(grey), Lens::Pinhole(_)) = (frame.grey(), &frame.camera.lens) else {
            self.last = None;
            return CameraMoved { motion, camera: None };
        };
        let nominal = &*frame.camera;
        let mut view = View {
            levels: levels(grey),
            nominal: nominal.clone(),
            mount: nominal.robot_from_camera.rotation,
        };
        // If the log itself moves the camera, the log is right.
        let last = self.last.take().filter(|last| last.nominal == *nominal).zip(motion);
        let moved = last.and_then(|(last, motion)| {
            let found = last.compared(&view, people, &self.settings);
            funnel.drop_many("odometry: too few corners agree", u64::from(found.is_none()));
            let (motion, mount) = last.explained(found.as_ref(), motion, &self.settings)?;
            view.mount = mount;
            Some(motion)
        });
        let camera = (view.mount != nominal.robot_from_camera.rotation).then(|| view.camera());
        self.last = Some(view);
        CameraMoved { motion: moved.or(motion), camera }
    }
}

impl View {
    /// Returns the motion from this image to the next one, fitted to static corners; `None` if too
    /// few of them agree.
    fn compared(
        &self,
        next: &Self,
        people: &[Estimate],
        settings: &OdometrySettings,
    ) -> Option<SwingFit> {
        let Lens::Pinhole(lens) = &self.nominal.lens else { return None };
        let agrees = AGREES * self.nominal.width as f64 / lens.fx;
        let people: Vec<Rect> = people.iter().map(|person| outline(&person.region)).collect();
        let from: Vec<Point2<f64>> = corners(&self.levels, settings)
            .into_iter()
            .filter(|at| people.iter().all(|person| !holds(person, at)))
            .collect();
        let least = (agrees, settings.min_points);
        let near = self.fit_around(next, &from, Vector2::zeros(), least);
        if near.is_some_and(|fit| fit.points as f64 >= MOST * from.len() as f64) {
            return near.map(|fit| self.without_noise(fit));
        }
        // A jerk moves corners by more than the width of a patch; then whole images are compared
        // first.
        let shift = whole_shift(&self.levels, &next.levels);
        let far = self.fit_around(next, &from, shift, least);
        near.into_iter().chain(far).reduce(|a, b| if b.points > a.points { b } else { a })
    }

    /// Fits the motion of corners that are searched for around a guess.
    fn fit_around(
        &self,
        next: &Self,
        corners: &[Point2<f64>],
        guess: Vector2<f64>,
        (agrees, min_points): (f64, usize),
    ) -> Option<SwingFit> {
        let mut pairs: Vec<Pair> = Vec::new();
        for corner in corners {
            if let Some(found) = track(&self.levels, &next.levels, *corner, guess) {
                pairs.push([*corner, found].map(|at| self.nominal.ray(at).xy()));
            }
        }
        SwingFit::of_agreeing(&pairs, agrees, min_points)
    }

    /// Returns a fit without the motions that are smaller than their errors, which would shake the
    /// tracks of a camera at rest.
    fn without_noise(&self, fit: SwingFit) -> SwingFit {
        let right = self.nominal.width as f64;
        let bottom = self.nominal.height as f64;
        let corners = [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)];
        let moves_px = corners.map(|(x, y)| {
            let ray = self.nominal.ray(Point2::new(x, y)).xy();
            (fit.swing.apply(ray) - ray).norm() * self.nominal.focal_px()
        });
        let is_at_rest = moves_px.iter().sum::<f64>() < 4.0 * MODEL_PX;
        if is_at_rest { SwingFit { points: fit.points, ..SwingFit::default() } } else { fit }
    }

    /// Returns the motion of the robot and the new rotation of the camera that explain a motion of
    /// the image. Without one the camera returns to its mount. `None` if the camera has no heading.
    fn explained(
        &self,
        found: Option<&SwingFit>,
        motion: EgoMotion,
        settings: &OdometrySettings,
    ) -> Option<(EgoMotion, UnitQuaternion<f64>)> {
        let still = SwingFit::default();
        let fit = found.unwrap_or(&still);
        let new_from_old = UnitQuaternion::from_rotation_matrix(&fit.swing.new_from_old);
        let turned = self.mount * new_from_old.inverse();
        let pan = heading(&turned)? - heading(&self.nominal.robot_from_camera.rotation)?;
        let pan = pan - TAU * (pan / TAU).round();
        let level = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -pan) * turned;
        let mount = settled(&level, &self.nominal, motion.dt, settings.settle_s);
        // A log without odometry reports that the robot is at rest, whether or not that is certain.
        let is_at_rest = [motion.forward, motion.left, motion.turn] == [0.0; 3];
        let by_image = found
            .filter(|fit| is_at_rest && fit.swing != Swing::default())
            .map(|fit| self.moved(fit, pan, motion, settings));
        Some((by_image.unwrap_or(motion), mount))
    }

    /// Returns the motion of the robot with a turn, rad, and a forward motion from the zoom.
    fn moved(
        &self,
        fit: &SwingFit,
        turn: f64,
        motion: EgoMotion,
        settings: &OdometrySettings,
    ) -> EgoMotion {
        let depth_m = settings.scene_depth_m;
        let forward = depth_m * (1.0 - 1.0 / fit.swing.zoom);
        let ahead_sigma = (depth_m * fit.sigma_zoom).hypot(GUESSED_DEPTH * forward);
        let turn_sigma = fit.sigma_pan.hypot(MODEL_PX / self.nominal.focal_px());
        let sigma = Vector3::new(ahead_sigma, 0.0, turn_sigma);
        let covariance = Matrix3::from_diagonal(&sigma.map(|sigma| sigma * sigma));
        EgoMotion { forward, turn, covariance, ..motion }
    }

    /// Returns the camera of the log with the rotation that was estimated from the images.
    fn camera(&self) -> Camera {
        let translation = self.nominal.robot_from_camera.translation;
        let robot_from_camera = Isometry3::from_parts(translation, self.mount);
        Camera { robot_from_camera, ..self.nominal.clone() }
    }
}

/// Returns a rotation of the camera that has gone part of the way back to its mount. Otherwise
/// errors of many frames would add up to a camera that looks at the ceiling.
fn settled(
    mount: &UnitQuaternion<f64>,
    nominal: &Camera,
    dt_s: f64,
    settle_s: f64,
) -> UnitQuaternion<f64> {
    let home = nominal.robot_from_camera.rotation;
    let part = 1.0 - (-dt_s / settle_s).exp();
    // Half a turn has no shortest way back, and is not a nod either.
    mount.try_slerp(&home, part, 1e-9).unwrap_or(home)
}

/// Returns the heading of the optical axis of a camera with this rotation, rad; `None` for a camera
/// that looks up or down.
fn heading(robot_from_camera: &UnitQuaternion<f64>) -> Option<f64> {
    let axis = robot_from_camera * Vector3::z();
    (axis.xy().norm() > LEAST_LEVEL).then(|| axis.y.atan2(axis.x))
}

/// Returns the box of a whole person, enlarged, around the region of a track.
fn outline(region: &Rect) -> Rect {
    let is_whole = region.height >= WHOLE_FROM * region.width;
    let whole = if is_whole { *region } else { region.standing_of_upper_body(TALL_M) };
    whole.inflated(LIMBS)
}

fn holds(area: &Rect, at: &Point2<f64>) -> bool {
    (area.x..area.right()).contains(&at.x) && (area.y..area.bottom()).contains(&at.y)
}

/// Returns an image at full size, half of it, and so on.
fn levels(grey: &GreyImage) -> Vec<GreyImage> {
    let mut levels = vec![grey.clone()];
    while levels.len() < LEVELS {
        let last = &levels[levels.len() - 1];
        if last.width().min(last.height()) < 2 * LEAST_SIDE_PX {
            break;
        }
        let mut half = GreyImage::default();
        halve(last, &mut half);
        levels.push(half);
    }
    levels
}
