//! Rotation and zoom of a camera, fitted to points with outliers.

use nalgebra::{Matrix2x4, Matrix4, Rotation3, Vector2, Vector3, Vector4};
use tagalong_math::{RandomSource, SplitMix64};

/// Seed of the samples, the same for each frame, so that a run can be repeated.
const SEED: u64 = 0x5151_1A12;
/// Number of random pairs of points that are tried: if half of the points are wrong, all pairs are
/// bad in one case of 10^12.
const TRIALS: usize = 100;
/// Steps of a fit; the error falls by about a hundredfold in each.
const STEPS: usize = 4;
/// Minimum distance of the two points of a trial, in units of [`SwingFit::of_agreeing`].
const APART: f64 = 50.0;
/// Fraction of the points that must agree.
const LEAST_PART: f64 = 0.4;
/// Number of least-squares fits, each to the points that agree with the one before.
const ROUNDS: usize = 3;

/// A point in the two images, as rays of depth 1: x to the right, y down.
pub type Pair = [Vector2<f64>; 2];

/// Motion of the image of distant objects: a zoom about the optical axis, then a rotation of the
/// camera. For a narrow lens and a small rotation it is the similarity transform that is usual
/// elsewhere; unlike that, it models how a pan of a wide lens bends the image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Swing {
    /// Rotation from the axes of the old camera to those of the new one.
    pub new_from_old: Rotation3<f64>,
    /// Factor by which the image grows.
    pub zoom: f64,
}

impl Default for Swing {
    /// Returns no motion at all.
    fn default() -> Self {
        Self { new_from_old: Rotation3::identity(), zoom: 1.0 }
    }
}

impl Swing {
    /// Returns a ray in the new camera, from the one in the old camera; both of depth 1.
    pub fn apply(&self, ray: Vector2<f64>) -> Vector2<f64> {
        let seen = self.new_from_old * (self.zoom * ray).push(1.0);
        seen.xy() / seen.z
    }

    /// Fits the motion to pairs by least squares (Gauss-Newton); `None` for too few points, or if
    /// all are in one place.
    fn of_pairs<'p>(pairs: impl Iterator<Item = &'p Pair> + Clone) -> Option<Self> {
        let mut swing = Self::default();
        for _ in 0..STEPS {
            let (matrix, vector) = swing.equations(pairs.clone());
            let step = matrix.cholesky()?.solve(&vector);
            swing = swing.after(&step);
        }
        swing.new_from_old.matrix().iter().all(|v| v.is_finite()).then_some(swing)
    }

    /// Returns the normal equations of the step to a better fit.
    fn equations<'p>(&self, pairs: impl Iterator<Item = &'p Pair>) -> (Matrix4<f64>, Vector4<f64>) {
        let start = (Matrix4::zeros(), Vector4::zeros());
        pairs.fold(start, |(matrix, vector), [from, to]| {
            let slopes = self.slopes(*from);
            let transposed = slopes.transpose();
            (matrix + transposed * slopes, vector + transposed * (to - self.apply(*from)))
        })
    }

    /// Returns the derivative of [`Swing::apply`] with respect to a further rotation about x, y and
    /// z, rad, and to the logarithm of the zoom.
    fn slopes(&self, ray: Vector2<f64>) -> Matrix2x4<f64> {
        let seen = self.new_from_old * (self.zoom * ray).push(1.0);
        let grown = self.new_from_old * (self.zoom * ray).push(0.0);
        let x = seen.x / seen.z;
        let y = seen.y / seen.z;
        let by_zoom = (grown.xy() - Vector2::new(x, y) * grown.z) / seen.z;
        Matrix2x4::new(
            -x * y,
            1.0 + x * x,
            -y,
            by_zoom.x, //
            -1.0 - y * y,
            x * y,
            x,
            by_zoom.y,
        )
    }

    fn after(&self, step: &Vector4<f64>) -> Self {
        let further = Rotation3::new(Vector3::new(step.x, step.y, step.z));
        // A wild step from a bad sample must not turn the image inside out.
        let zoom = self.zoom * step.w.clamp(-1.0, 1.0).exp();
        Self { new_from_old: further * self.new_from_old, zoom }
    }

    fn misses_by(&self, [from, to]: &Pair) -> f64 {
        (self.apply(*from) - to).norm()
    }
}

/// A fitted motion with its uncertainty.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SwingFit {
    /// The motion.
    pub swing: Swing,
    /// Standard deviation of the rotation about the vertical axis of the image, rad.
    pub sigma_pan: f64,
    /// Standard deviation of the zoom.
    pub sigma_zoom: f64,
    /// Number of points that agree with it.
    pub points: usize,
}

impl SwingFit {
    /// Returns the motion on which most points agree (RANSAC; M. Fischler and R. Bolles, *Random
    /// sample consensus*, CACM 1981), within a distance `near` of the rays; `None` if they are
    /// fewer than `least`, or fewer than two fifths of all.
    pub fn of_agreeing(pairs: &[Pair], near: f64, least: usize) -> Option<Self> {
        let least = least.max((LEAST_PART * pairs.len() as f64).ceil() as usize).max(3);
        let mut best = consensus(pairs, near)?;
        for _ in 0..ROUNDS {
            let agreeing = pairs.iter().filter(|pair| best.misses_by(pair) <= near);
            best = Swing::of_pairs(agreeing)?;
        }
        let agreeing: Vec<&Pair> =
            pairs.iter().filter(|pair| best.misses_by(pair) <= near).collect();
        if agreeing.len() < least {
            return None;
        }
        Self::of(best, &agreeing)
    }

    fn of(swing: Swing, agreeing: &[&Pair]) -> Option<Self> {
        let count = agreeing.len();
        let left: f64 = agreeing.iter().map(|pair| swing.misses_by(pair).powi(2)).sum();
        // Two numbers per point, minus the four of the motion.
        let variance = left / (2.0 * count as f64 - 4.0).max(1.0);
        let (matrix, _) = swing.equations(agreeing.iter().copied());
        let covariance = matrix.try_inverse()? * variance;
        let [sigma_pan, sigma_zoom] = [1, 3].map(|at| covariance[(at, at)].max(0.0).sqrt());
        Some(Self { swing, sigma_pan, sigma_zoom, points: count })
    }
}

/// Returns the motion of two points with which most points agree; the first of several.
fn consensus(pairs: &[Pair], near: f64) -> Option<Swing> {
    if pairs.len() < 2 {
        return None;
    }
    let mut random = SplitMix64::new(SEED);
    let mut best: Option<(usize, Swing)> = None;
    for _ in 0..TRIALS {
        let two = [random.pick(pairs), random.pick(pairs)];
        if (two[0][0] - two[1][0]).norm() < APART * near {
            continue;
        }
        let Some(swing) = Swing::of_pairs(two.iter()) else { continue };
        let count = pairs.iter().filter(|pair| swing.misses_by(pair) <= near).count();
        if best.is_none_or(|(most, _)| count > most) {
            best = Some((count, swing));
        }
    }
    best.map(|(_, swing)| swing)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NEAR: f64 = 2e-3;

    fn known(rotation: [f64; 3], zoom: f64) -> Swing {
        Swing { new_from_old: Rotation3::new(rotation.into()), zoom }
    }

    fn rays() -> impl Iterator<Item = Vector2<f64>> {
        (0..60).map(|i| {
            Vector2::new(
                f64::from(i * 97 % 128) / 100.0 - 0.64,
                f64::from(i * 61 % 96) / 100.0 - 0.48,
            )
        })
    }

    proptest! {
        #[test]
        fn the_motion_of_exact_points_is_found(
            rotation in prop::array::uniform3(-0.1..0.1f64), zoom in 0.85..1.15f64,
        ) {
            let real = known(rotation, zoom);
            let pairs: Vec<Pair> = rays().map(|at| [at, real.apply(at)]).collect();
            let found = SwingFit::of_agreeing(&pairs, NEAR, 12).unwrap();
            prop_assert!((found.swing.zoom - zoom).abs() < 1e-7, "{found:?}");
            let off = found.swing.new_from_old.matrix() - real.new_from_old.matrix();
            prop_assert!(off.amax() < 1e-7, "{found:?}");
            prop_assert_eq!(found.points, 60);
        }

        #[test]
        fn the_slopes_are_those_of_small_steps(
            rotation in prop::array::uniform3(-0.1..0.1f64), x in -0.6..0.6f64, y in -0.5..0.5f64,
        ) {
            let swing = known(rotation, 1.1);
            let ray = Vector2::new(x, y);
            let slopes = swing.slopes(ray);
            for column in 0..4 {
                let mut step = Vector4::zeros();
                step[column] = 1e-6;
                let moved = (swing.after(&step).apply(ray) - swing.apply(ray)) / 1e-6;
                prop_assert!((moved - slopes.column(column)).norm() < 1e-4, "{column}: {moved}");
            }
        }
    }

    /// Two of five points belong to something else that moves, as a whole.
    #[test]
    fn points_that_move_otherwise_do_not_count() {
        let real = known([0.006, 0.012, 0.01], 1.02);
        let other = known([0.0, -0.03, 0.0], 1.0);
        let pairs: Vec<Pair> = rays()
            .enumerate()
            .map(|(i, at)| [at, if i % 5 < 2 { other.apply(at) } else { real.apply(at) }])
            .collect();
        let found = SwingFit::of_agreeing(&pairs, NEAR, 12).unwrap();
        assert_eq!(found.points, 36);
        assert!((found.swing.zoom - 1.02).abs() < 1e-7, "{found:?}");
        assert!(SwingFit::of_agreeing(&pairs, NEAR, 36).is_some());
        assert!(SwingFit::of_agreeing(&pairs, NEAR, 37).is_none());
        let mut random = SplitMix64::new(7);
        let noise: Vec<Pair> = rays()
            .map(|at| [at, Vector2::new(random.between(-0.6, 0.6), random.between(-0.5, 0.5))])
            .collect();
        assert_eq!(SwingFit::of_agreeing(&noise, NEAR, 8), None, "none agree");
    }

    /// The first 24 points agree and the rest goes anywhere.
    fn pairs_of_which_24_agree(all: usize) -> Vec<Pair> {
        let real = known([0.006, 0.012, 0.01], 1.02);
        let mut random = SplitMix64::new(7);
        let mut pairs: Vec<Pair> = rays().take(24).map(|at| [at, real.apply(at)]).collect();
        for at in rays().chain(rays()).skip(24).take(all - 24) {
            let anywhere = Vector2::new(random.between(-0.6, 0.6), random.between(-0.5, 0.5));
            pairs.push([at, anywhere]);
        }
        pairs
    }

    #[test]
    fn fewer_than_two_fifths_of_the_points_are_no_motion() {
        let enough = SwingFit::of_agreeing(&pairs_of_which_24_agree(58), NEAR, 12);
        assert_eq!(enough.unwrap().points, 24, "two fifths of 58 are 23.2");
        assert_eq!(SwingFit::of_agreeing(&pairs_of_which_24_agree(70), NEAR, 12), None);
    }

    #[test]
    fn the_uncertainty_is_that_of_the_points() {
        fn off(i: usize) -> Vector2<f64> {
            Vector2::new((i % 3) as f64 - 1.0, (i / 3 % 3) as f64 - 1.0) * 1e-3
        }

        let pairs: Vec<Pair> = rays().enumerate().map(|(i, at)| [at, at + off(i)]).collect();
        let found = SwingFit::of_agreeing(&pairs, NEAR, 12).unwrap();
        // A deviation of 0.82e-3 along either axis, over the root of 60 points.
        let expected = 0.82e-3 / 60.0_f64.sqrt();
        assert!((found.sigma_pan / expected - 1.0).abs() < 0.2, "{found:?} {expected}");
        assert!((found.swing.zoom - 1.0).abs() < 3.0 * found.sigma_zoom, "{found:?}");
    }

    /// Two numbers of a point less the four of the motion: nine points have 14, twice as many 32.
    #[test]
    fn few_points_are_the_less_certain_by_the_numbers_that_the_motion_takes() {
        fn variance(agreeing: &[&Pair]) -> f64 {
            SwingFit::of(known([0.0; 3], 1.0), agreeing).unwrap().sigma_pan.powi(2)
        }

        let pairs: Vec<Pair> = rays()
            .take(9)
            .enumerate()
            .map(|(i, at)| [at, at + Vector2::new((i % 3) as f64 - 1.0, 0.0) * 1e-3])
            .collect();
        let once: Vec<&Pair> = pairs.iter().collect();
        let twice = [&once[..], &once[..]].concat();
        let ratio = variance(&twice) / variance(&once);
        assert!((ratio - 14.0 / 32.0).abs() < 1e-9, "{ratio}");
    }

    #[test]
    fn too_few_points_and_points_in_one_place_have_no_motion() {
        let here = [Vector2::new(0.1, 0.1); 2];
        assert_eq!(SwingFit::of_agreeing(&[], NEAR, 12), None);
        assert_eq!(SwingFit::of_agreeing(&[here; 40], NEAR, 12), None);
    }
}
