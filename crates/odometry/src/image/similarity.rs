//! Similarity transform of an image to the next one, fitted to points of which some are wrong.

use nalgebra::{Matrix2, Point2, Vector2};
use tagalong_stats::{RandomSource, SplitMix64};

/// Seed of the samples: the same for each frame, so that a run can be repeated.
const SEED: u64 = 0x5151_1A12;
/// Random pairs of points that are tried: with half of the points wrong, all of them are bad in one
/// case of 10^12.
const TRIALS: usize = 100;
/// Least distance of the two points of a trial, as a fraction of the width of the image.
const APART: f64 = 0.1;
/// Distance from a transform within which a point agrees with it, as a fraction of the width.
const AGREES: f64 = 2e-3;
/// Part of the points that must agree.
const LEAST_PART: f64 = 0.4;
/// Least-squares fits, each to the points that agree with the one before.
const ROUNDS: usize = 3;

/// Rotation, scale and shift: x' = (a, -b; b, a) x + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    a: f64,
    b: f64,
    shift: Vector2<f64>,
}

impl Default for Similarity {
    /// No motion at all.
    fn default() -> Self {
        Self { a: 1.0, b: 0.0, shift: Vector2::zeros() }
    }
}

impl Similarity {
    /// Returns the position of a point after the transform, pixels.
    pub fn apply(&self, at: Point2<f64>) -> Point2<f64> {
        Point2::from(self.turned(at.coords) + self.shift)
    }

    /// Returns the factor by which lengths grow.
    pub fn scale(&self) -> f64 {
        self.a.hypot(self.b)
    }

    /// Returns the angle by which the image turns, rad, from the columns' axis to that of the rows.
    pub fn angle(&self) -> f64 {
        self.b.atan2(self.a)
    }

    fn turned(&self, way: Vector2<f64>) -> Vector2<f64> {
        Matrix2::new(self.a, -self.b, self.b, self.a) * way
    }

    /// Returns the transform with the least sum of squared distances; `None` for points in one
    /// place.
    fn of_pairs<'p>(pairs: impl Iterator<Item = &'p [Point2<f64>; 2]> + Clone) -> Option<Self> {
        let count = pairs.clone().count() as f64;
        let sums = pairs.clone().fold([Vector2::zeros(); 2], |sums: [Vector2<f64>; 2], pair| {
            [sums[0] + pair[0].coords, sums[1] + pair[1].coords]
        });
        let middle = sums.map(|sum| sum / count);
        let (mut along, mut across, mut spread) = (0.0, 0.0, 0.0);
        for [from, to] in pairs {
            let (from, to) = (from.coords - middle[0], to.coords - middle[1]);
            along += from.dot(&to);
            across += from.perp(&to);
            spread += from.norm_squared();
        }
        if count < 2.0 || spread <= 0.0 {
            return None;
        }
        let turned = Self { a: along / spread, b: across / spread, shift: Vector2::zeros() };
        Some(Self { shift: middle[1] - turned.turned(middle[0]), ..turned })
    }

    fn misses_by(&self, [from, to]: &[Point2<f64>; 2]) -> f64 {
        (self.apply(*from) - to).norm()
    }
}

/// Transform with its uncertainty.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimilarityFit {
    /// The transform.
    pub transform: Similarity,
    /// Standard deviation of the shift in the middle of the points, px.
    pub sigma_px: f64,
    /// Standard deviation of the scale.
    pub sigma_scale: f64,
    /// Number of points that agree.
    pub points: usize,
}

impl SimilarityFit {
    /// Returns the transform on which most points agree (M. Fischler and R. Bolles, *Random sample
    /// consensus*, CACM 1981), from one image to the next of this width, px; `None` if they are
    /// fewer than `least`, or than two fifths of all.
    pub fn of_agreeing(pairs: &[[Point2<f64>; 2]], width: f64, least: usize) -> Option<Self> {
        let least = least.max((LEAST_PART * pairs.len() as f64).ceil() as usize).max(3);
        let near = AGREES * width;
        let agree = |transform: &Similarity| {
            pairs.iter().filter(|pair| transform.misses_by(pair) <= near).count()
        };
        let mut best = consensus(pairs, APART * width, agree)?;
        for _ in 0..ROUNDS {
            let agreeing = pairs.iter().filter(|pair| best.misses_by(pair) <= near);
            best = Similarity::of_pairs(agreeing)?;
        }
        let agreeing: Vec<_> = pairs.iter().filter(|pair| best.misses_by(pair) <= near).collect();
        (agreeing.len() >= least).then(|| Self::of(best, &agreeing))
    }

    fn of(transform: Similarity, agreeing: &[&[Point2<f64>; 2]]) -> Self {
        let count = agreeing.len() as f64;
        let left: f64 = agreeing.iter().map(|pair| transform.misses_by(pair).powi(2)).sum();
        // Two numbers of each point, and the four of the transform.
        let variance = left / (2.0 * count - 4.0).max(1.0);
        let sum = agreeing.iter().fold(Vector2::zeros(), |sum, pair| sum + pair[0].coords);
        let spread: f64 =
            agreeing.iter().map(|pair| (pair[0].coords - sum / count).norm_squared()).sum();
        Self {
            transform,
            sigma_px: (variance / count).sqrt(),
            sigma_scale: (variance / spread).sqrt(),
            points: agreeing.len(),
        }
    }
}

/// Returns the transform of two points with which most points agree; the first of several.
fn consensus(
    pairs: &[[Point2<f64>; 2]],
    apart: f64,
    agree: impl Fn(&Similarity) -> usize,
) -> Option<Similarity> {
    if pairs.len() < 2 {
        return None;
    }
    let mut random = SplitMix64::new(SEED);
    let mut best: Option<(usize, Similarity)> = None;
    for _ in 0..TRIALS {
        let two = [random.pick(pairs), random.pick(pairs)];
        if (two[0][0] - two[1][0]).norm() < apart {
            continue;
        }
        let Some(transform) = Similarity::of_pairs(two.iter()) else { continue };
        let count = agree(&transform);
        if best.is_none_or(|(most, _)| count > most) {
            best = Some((count, transform));
        }
    }
    best.map(|(_, transform)| transform)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn known(scale: f64, angle: f64, shift: [f64; 2]) -> Similarity {
        let (sin, cos) = angle.sin_cos();
        Similarity { a: scale * cos, b: scale * sin, shift: shift.into() }
    }

    fn points() -> impl Iterator<Item = Point2<f64>> {
        (0..60).map(|i| Point2::new(f64::from(i * 97 % 640), f64::from(i * 61 % 480)))
    }

    proptest! {
        #[test]
        fn the_transform_of_exact_points_is_found(
            scale in 0.8..1.25f64, angle in -0.3..0.3f64, shift in prop::array::uniform2(-40.0..40.0f64),
        ) {
            let real = known(scale, angle, shift);
            let pairs: Vec<_> = points().map(|at| [at, real.apply(at)]).collect();
            let found = SimilarityFit::of_agreeing(&pairs, 640.0, 12).unwrap();
            prop_assert!((found.transform.scale() - scale).abs() < 1e-9);
            prop_assert!((found.transform.angle() - angle).abs() < 1e-9);
            prop_assert_eq!(found.points, 60);
            let at = Point2::new(200.0, 100.0);
            prop_assert!((found.transform.apply(at) - real.apply(at)).norm() < 1e-6);
        }
    }

    /// Every second point belongs to something else that moves, as a whole.
    #[test]
    fn points_that_move_otherwise_do_not_count() {
        let real = known(1.02, 0.01, [6.0, -3.0]);
        let other = known(1.0, 0.0, [-15.0, 0.0]);
        let pairs: Vec<_> = points()
            .enumerate()
            .map(|(i, at)| [at, if i % 5 < 2 { other.apply(at) } else { real.apply(at) }])
            .collect();
        let found = SimilarityFit::of_agreeing(&pairs, 640.0, 12).unwrap();
        assert_eq!(found.points, 36);
        assert!((found.transform.scale() - 1.02).abs() < 1e-9, "{found:?}");
        let least = |least| SimilarityFit::of_agreeing(&pairs, 640.0, least).is_some();
        assert!(least(36) && !least(37));
        let mut random = SplitMix64::new(7);
        let mut any = || Point2::new(random.between(0.0, 640.0), random.between(0.0, 480.0));
        let noise: Vec<_> = points().map(|at| [at, any()]).collect();
        assert_eq!(SimilarityFit::of_agreeing(&noise, 640.0, 8), None, "none agree");
    }

    #[test]
    fn the_uncertainty_is_that_of_the_points() {
        let off = |i: usize| Vector2::new((i % 3) as f64 - 1.0, (i / 3 % 3) as f64 - 1.0) * 0.5;
        let pairs: Vec<_> = points().enumerate().map(|(i, at)| [at, at + off(i)]).collect();
        let found = SimilarityFit::of_agreeing(&pairs, 640.0, 12).unwrap();
        // A deviation of 0.41 px along either axis, over the root of 60 points.
        assert!((found.sigma_px - 0.41 / 60.0_f64.sqrt()).abs() < 0.01, "{found:?}");
        assert!((found.transform.scale() - 1.0).abs() < 3.0 * found.sigma_scale, "{found:?}");
    }

    #[test]
    fn too_few_points_and_points_in_one_place_have_no_transform() {
        let here = [Point2::new(9.0, 9.0); 2];
        assert_eq!(SimilarityFit::of_agreeing(&[], 640.0, 12), None);
        assert_eq!(SimilarityFit::of_agreeing(&[here; 40], 640.0, 12), None);
    }
}
