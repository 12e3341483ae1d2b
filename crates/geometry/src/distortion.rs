use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

/// Largest angle between a ray and the optical axis that [`Distortion::remove`] returns, rad. A ray
/// at depth 1 cannot lie in the plane of the lens.
const MAX_ANGLE_RAD: f64 = FRAC_PI_2 - 1e-3;
/// Maximum number of steps of an inversion; about four are needed.
const MAX_STEPS: usize = 40;
/// Error below which an inversion has converged, in focal lengths.
const CLOSE: f64 = 1e-13;

/// Lens distortion, as in `sensor_msgs/CameraInfo`: OpenCV's models.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Distortion {
    /// No distortion: an ideal or an already rectified image.
    #[default]
    None,
    /// `plumb_bob`: k1, k2, p1, p2, k3.
    PlumbBob([f64; 5]),
    /// `rational_polynomial`: k1, k2, p1, p2, k3, k4, k5, k6, then the thin prism s1, s2, s3, s4,
    /// the tilt of the sensor tx, ty (rad); zeros if the calibration has fewer.
    Rational([f64; 14]),
    /// `equidistant`, OpenCV's `fisheye`: k1, k2, k3, k4 of the angle from the axis. Rays at 90
    /// degrees or more from the axis have no depth along it, and therefore no pixel here.
    Equidistant([f64; 4]),
}

impl Distortion {
    /// Converts ideal normalised coordinates to distorted ones.
    pub(crate) fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        match self {
            Self::None => (x, y),
            // Plumb bob is the rational model with a denominator of 1.
            Self::PlumbBob([k1, k2, p1, p2, k3]) => {
                bend(x, y, &[*k1, *k2, *k3, 0.0, 0.0, 0.0], [*p1, *p2])
            }
            Self::Rational([k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tx, ty]) => {
                let (bent_x, bent_y) = bend(x, y, &[*k1, *k2, *k3, *k4, *k5, *k6], [*p1, *p2]);
                let r2 = x * x + y * y;
                tilt([*tx, *ty], bent_x + r2 * (s1 + r2 * s2), bent_y + r2 * (s3 + r2 * s4))
            }
            Self::Equidistant(k) => {
                let radius = x.hypot(y);
                let (angle, _) = equidistant(k, radius.atan());
                // The limit of the ratio on the axis is 1.
                let ratio = if radius > 1e-12 { angle / radius } else { 1.0 };
                (x * ratio, y * ratio)
            }
        }
    }

    /// Converts distorted normalised coordinates to ideal ones. Where the model has no inverse, far
    /// outside of the image, it returns the nearest point that it finds.
    pub(crate) fn remove(&self, x: f64, y: f64) -> (f64, f64) {
        match self {
            Self::None => (x, y),
            Self::Equidistant(k) => {
                let radius = x.hypot(y);
                let ratio = if radius > 1e-12 { angle_of(k, radius).tan() / radius } else { 1.0 };
                (x * ratio, y * ratio)
            }
            Self::PlumbBob(_) | Self::Rational(_) => self.search(Vector2::new(x, y)),
        }
    }

    /// Inverts by Newton's method, with shorter steps where a full one increases the error: wide
    /// lenses bend so much that fixed-point iteration diverges.
    fn search(&self, goal: Vector2<f64>) -> (f64, f64) {
        let mut at = goal;
        let mut error = goal - self.bent_point(&at);
        for _ in 0..MAX_STEPS {
            if error.norm() < CLOSE {
                break;
            }
            let slope = slope(|at| self.bent_point(at), &at);
            let Some(step) = slope.try_inverse().map(|inverse| inverse * error) else { break };
            let lengths = (0..12).map(|halvings| 0.5_f64.powi(halvings));
            let better = lengths.map(|length| at + step * length).find_map(|next| {
                let left = goal - self.bent_point(&next);
                (left.norm() < error.norm()).then_some((next, left))
            });
            let Some(better) = better else { break };
            (at, error) = better;
        }
        (at.x, at.y)
    }

    /// Returns the distorted position of a point.
    fn bent_point(&self, at: &Vector2<f64>) -> Vector2<f64> {
        Vector2::from(<[f64; 2]>::from(self.apply(at.x, at.y)))
    }
}

/// Returns the Jacobian of a mapping by finite differences.
fn slope(bent: impl Fn(&Vector2<f64>) -> Vector2<f64>, at: &Vector2<f64>) -> Matrix2<f64> {
    let step = 1e-6;
    let columns = [Vector2::x(), Vector2::y()]
        .map(|axis| (bent(&(at + axis * step)) - bent(&(at - axis * step))) / (2.0 * step));
    Matrix2::from_columns(&columns)
}

/// Applies the radial and tangential distortion of the rational model: k1 to k6, and p1, p2.
fn bend(x: f64, y: f64, k: &[f64; 6], [p1, p2]: [f64; 2]) -> (f64, f64) {
    let r2 = x * x + y * y;
    let radial = (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2])))
        / (1.0 + r2 * (k[3] + r2 * (k[4] + r2 * k[5])));
    (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

/// Projects onto a sensor that is tilted about x, then about y (Scheimpflug).
fn tilt([tx, ty]: [f64; 2], x: f64, y: f64) -> (f64, f64) {
    if tx == 0.0 && ty == 0.0 {
        return (x, y);
    }
    let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), -ty)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), -tx);
    let r = turned.matrix();
    let plane = Matrix3::new(
        r.m33, 0.0, -r.m13, //
        0.0, r.m33, -r.m23, //
        0.0, 0.0, 1.0,
    );
    let on = plane * r * Vector3::new(x, y, 1.0);
    (on.x / on.z, on.y / on.z)
}

/// Returns the distorted angle of an equidistant lens, and its derivative.
fn equidistant(k: &[f64; 4], angle: f64) -> (f64, f64) {
    let a2 = angle * angle;
    let value = angle * (1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
    let slope = 1.0 + a2 * (3.0 * k[0] + a2 * (5.0 * k[1] + a2 * (7.0 * k[2] + a2 * 9.0 * k[3])));
    (value, slope)
}

/// Inverts [`equidistant`] within [`MAX_ANGLE_RAD`] by Newton's method between two bounds.
fn angle_of(k: &[f64; 4], distorted: f64) -> f64 {
    let mut low = 0.0;
    let mut high = MAX_ANGLE_RAD;
    let mut angle = distorted.min(MAX_ANGLE_RAD);
    for _ in 0..MAX_STEPS {
        let (value, slope) = equidistant(k, angle);
        let error = distorted - value;
        if error.abs() < CLOSE {
            break;
        }
        if error > 0.0 {
            low = angle
        } else {
            high = angle
        }
        let next = angle + error / slope;
        // A step that leaves the bounds, or a slope of zero, is replaced by halving.
        angle = if next > low && next < high { next } else { 0.5 * (low + high) };
    }
    angle
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Ideal coordinates.
    const RAYS: [[f64; 2]; 4] = [[0.3, -0.2], [-0.9, 0.5], [1.2, 1.0], [0.0, 1.6]];

    fn lenses() -> [(Distortion, [[f64; 2]; 4]); 6] {
        [
            (
                Distortion::PlumbBob([0.1, -0.02, 0.002, -0.003, 0.005]),
                [
                    [0.3026318955, -0.201754597],
                    [-0.990374772, 0.55056154],
                    [1.425914304, 1.19924192],
                    [-0.00768, 1.949462528],
                ],
            ),
            (
                Distortion::PlumbBob([-0.28, 0.065, 0.0004, -0.0003, -0.0062]),
                [
                    [0.28926446358, -0.19281697572],
                    [-0.69312873072, 0.3853188504],
                    [0.73582552704, 0.6147739392],
                    [-0.000768, 0.97133641728],
                ],
            ),
            (
                Distortion::Rational([
                    0.3, 0.05, 0.002, -0.003, 0.005, 0.6, 0.1, 0.004, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
                ]),
                [
                    [0.287759467151, -0.191839644767],
                    [-0.718358922024, 0.399441623347],
                    [0.79807922978, 0.676046024816],
                    [-0.00768, 1.085588341455],
                ],
            ),
            (
                Distortion::Rational([
                    0.3, 0.05, 0.002, -0.003, 0.005, 0.6, 0.1, 0.004, 0.01, -0.002, 0.02, 0.001,
                    0.0, 0.0,
                ]),
                [
                    [0.289025667151, -0.189222744767],
                    [-0.710006122024, 0.421765223347],
                    [0.81057202978, 0.730799624816],
                    [0.0048128, 1.143341941455],
                ],
            ),
            (
                Distortion::Rational([
                    0.3, 0.05, 0.002, -0.003, 0.005, 0.6, 0.1, 0.004, 0.01, -0.002, 0.02, 0.001,
                    0.05, -0.03,
                ]),
                [
                    [0.288929024777, -0.188877257804],
                    [-0.710164264149, 0.421131003399],
                    [0.863548952829, 0.780482489137],
                    [0.005107955813, 1.214439338675],
                ],
            ),
            (
                Distortion::Equidistant([0.02, -0.004, 0.003, -0.001]),
                [
                    [0.288602939399, -0.192401959599],
                    [-0.707530909133, 0.393072727296],
                    [0.78314223926, 0.652618532716],
                    [0.0, 1.030838248989],
                ],
            ),
        ]
    }

    /// The table is that of OpenCV 4.10: `tests/clients/lenses_opencv.py` prints it.
    #[test]
    fn rays_are_bent_as_opencv_bends_them() {
        for (lens, expected) in lenses() {
            for (ray, expected) in RAYS.iter().zip(expected) {
                let (x, y) = lens.apply(ray[0], ray[1]);
                let off = (x - expected[0]).hypot(y - expected[1]);
                assert!(off < 1e-9, "{lens:?} {ray:?}: {x} {y}");
            }
        }
    }

    #[test]
    fn bent_rays_are_found_back() {
        for (lens, bent) in lenses() {
            for (ray, bent) in RAYS.iter().zip(bent) {
                let (x, y) = lens.remove(bent[0], bent[1]);
                assert!((x - ray[0]).hypot(y - ray[1]) < 1e-8, "{lens:?} {ray:?}: {x} {y}");
            }
        }
    }

    /// The corners of an image of 120 degrees, where fixed-point iteration was 8.6 px off.
    #[test]
    fn every_pixel_of_a_wide_lens_has_its_ray() {
        let wide = Distortion::PlumbBob([-0.28, 0.065, 0.0004, -0.0003, -0.0062]);
        let edge = 60_f64.to_radians().tan();
        for column in -20..=20 {
            for row in -11..=11 {
                let ray = [edge * f64::from(column) / 20.0, edge * f64::from(row) / 20.0];
                let bent = wide.apply(ray[0], ray[1]);
                let found = wide.remove(bent.0, bent.1);
                let again = wide.apply(found.0, found.1);
                let off_px = 300.0 * (again.0 - bent.0).hypot(again.1 - bent.1);
                assert!(off_px < 1e-6, "{ray:?}: {off_px} px");
            }
        }
    }

    #[test]
    fn a_pixel_beyond_a_half_sphere_has_the_ray_at_its_edge() {
        let (x, y) = Distortion::Equidistant([0.0; 4]).remove(2.0, 0.0);
        assert!((x.atan() - MAX_ANGLE_RAD).abs() < 1e-9 && y == 0.0, "{x}");
    }

    proptest! {
        #[test]
        fn an_equidistant_lens_is_inverted(
            x in -4.0..4.0f64, y in -4.0..4.0f64, k1 in -0.05..0.05f64, k2 in -0.01..0.01f64,
        ) {
            let lens = Distortion::Equidistant([k1, k2, 0.0, 0.0]);
            let bent = lens.apply(x, y);
            let found = lens.remove(bent.0, bent.1);
            prop_assert!((found.0 - x).hypot(found.1 - y) < 1e-8, "{found:?}");
        }
    }
}
