//! Likelihood maps over the lateral positions of two people (P3, section III).

use nalgebra::{Cholesky, DMatrix, DVector};
use tagalong_math::exp2_of_negative;

use crate::config::{Config, Method};

/// Positions of two people across the viewing ray of the near one's mean: near, far, m.
pub type PositionPair = [f64; 2];

/// Widths of the kernel along the two positions, m.
#[derive(Clone, Copy, Debug)]
pub struct Kernel([f64; 2]);

impl Kernel {
    /// Creates P3's kernel: standard deviations of 40 and 100 mm.
    pub fn new(config: &Config) -> Self {
        Self([config.kernel_near_m, config.kernel_far_m])
    }

    fn at(&self, a: &PositionPair, b: &PositionPair) -> f64 {
        let square: f64 = (0..2).map(|i| ((a[i] - b[i]) / self.0[i]).powi(2)).sum();
        (-0.5 * square).exp()
    }
}

/// Returns P3's estimate: the sum of kernels at the compared places, each scaled by its likelihood.
pub fn parzen(
    places: &[PositionPair],
    likelihoods: &[f64],
    kernel: Kernel,
    at: &PositionPair,
) -> f64 {
    places.iter().zip(likelihoods).map(|(place, l)| l * kernel.at(place, at)).sum()
}

/// Places side by side: two vectors of AVX-512, four of AVX2.
const LANES: usize = 16;

/// Returns [`parzen`] at many places. The exponential function is that of [`exp2_of_negative`],
/// without which the compiler makes no vector instructions; the sums differ by less than 1e-14 of
/// the sum of the kernels, and are the same on all processors.
fn parzen_at_all(
    places: &[PositionPair],
    likelihoods: &[f64],
    kernel: Kernel,
    at: &[PositionPair],
) -> Vec<f64> {
    let mut sums = vec![0.0; at.len()];
    for (at, sums) in at.chunks(LANES).zip(sums.chunks_mut(LANES)) {
        let lanes = [0, 1].map(|axis| std::array::from_fn(|i| at[i.min(at.len() - 1)][axis]));
        let found = parzen_lanes(places, likelihoods, kernel, &lanes);
        sums.copy_from_slice(&found[..sums.len()]);
    }
    sums
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn parzen_lanes(
    places: &[PositionPair],
    likelihoods: &[f64],
    kernel: Kernel,
    at: &[[f64; LANES]; 2],
) -> [f64; LANES] {
    // In these units a kernel is 2 to the power of minus the squared distance.
    let per_unit = kernel.0.map(|width| (0.5 * std::f64::consts::LOG2_E).sqrt() / width);
    let at = [0, 1].map(|axis| at[axis].map(|value| value * per_unit[axis]));
    let mut sums = [0.0; LANES];
    for (place, likelihood) in places.iter().zip(likelihoods) {
        let place = [place[0] * per_unit[0], place[1] * per_unit[1]];
        for lane in 0..LANES {
            let near = place[0] - at[0][lane];
            let far = place[1] - at[1][lane];
            sums[lane] += likelihood * exp2_of_negative(-(near * near + far * far));
        }
    }
    sums
}

/// Interpolation by a Gaussian process with the same kernels. A sum of kernels is higher where more
/// places were compared; this is not.
#[derive(Clone, Debug)]
pub struct Gp {
    places: Vec<PositionPair>,
    coefficients: DVector<f64>,
    kernel: Kernel,
}

impl Gp {
    /// Fits the process; `None` if the covariance matrix of the places is singular.
    pub fn fit(
        places: Vec<PositionPair>,
        likelihoods: &[f64],
        kernel: Kernel,
        nugget: f64,
    ) -> Option<Self> {
        let count = places.len().min(likelihoods.len());
        let gram = DMatrix::from_fn(count, count, |i, j| {
            // The nugget keeps the matrix regular where places coincide.
            kernel.at(&places[i], &places[j]) + if i == j { nugget } else { 0.0 }
        });
        let known = DVector::from_column_slice(&likelihoods[..count]);
        let coefficients = Cholesky::new(gram)?.solve(&known);
        Some(Self { places, coefficients, kernel })
    }

    /// Returns the likelihood at a place; never negative.
    pub fn at(&self, at: &PositionPair) -> f64 {
        parzen(&self.places, self.coefficients.as_slice(), self.kernel, at).max(0.0)
    }

    /// Returns the likelihoods at many places; never negative.
    fn at_all(&self, at: &[PositionPair]) -> Vec<f64> {
        let mut all = parzen_at_all(&self.places, self.coefficients.as_slice(), self.kernel, at);
        all.iter_mut().for_each(|likelihood| *likelihood = likelihood.max(0.0));
        all
    }
}

/// Likelihood over the places, known at some of them.
#[derive(Clone, Debug)]
pub enum LikelihoodMap {
    /// Known at all places of a table.
    Table(Grid, Vec<f64>),
    /// Known at a few; a sum of kernels.
    Kernels(Vec<PositionPair>, Vec<f64>, Kernel),
    /// Known at a few; interpolated.
    Gp(Gp),
}

impl LikelihoodMap {
    /// Creates the map of a method. If there is no Gaussian process, kernels are summed.
    pub fn new(
        method: Method,
        places: Vec<PositionPair>,
        known: Vec<f64>,
        config: &Config,
    ) -> Self {
        let kernel = Kernel::new(config);
        let gp = match method {
            Method::Table => return Self::Table(Grid::new(config), known),
            Method::Gp => Gp::fit(places.clone(), &known, kernel, config.nugget),
            _ => None,
        };
        gp.map_or(Self::Kernels(places, known, kernel), Self::Gp)
    }

    /// Returns the likelihood at a place.
    pub fn at(&self, at: &PositionPair) -> f64 {
        match self {
            Self::Table(grid, known) => grid.look_up(known, at),
            Self::Kernels(places, known, kernel) => parzen(places, known, *kernel, at),
            Self::Gp(gp) => gp.at(at),
        }
    }

    /// Returns the likelihoods at many places, as [`LikelihoodMap::at`] does at each, but faster.
    pub fn at_all(&self, at: &[PositionPair]) -> Vec<f64> {
        match self {
            Self::Table(..) => at.iter().map(|at| self.at(at)).collect(),
            Self::Kernels(places, known, kernel) => parzen_at_all(places, known, *kernel, at),
            Self::Gp(gp) => gp.at_all(at),
        }
    }
}

/// Places of P3's full table.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    reach: [f64; 2],
    step: f64,
    sides: [usize; 2],
}

impl Grid {
    /// Creates the table of the settings.
    pub fn new(config: &Config) -> Self {
        let reach = [config.reach_near_m, config.reach_far_m];
        let half = reach.map(|reach| ((reach / config.step_m).round() as usize).min(MAX_HALF));
        Self {
            reach: half.map(|h| h as f64 * config.step_m),
            step: config.step_m,
            sides: half.map(|h| 2 * h + 1),
        }
    }

    /// Returns all places, ordered by that of the near person.
    pub fn places(&self) -> Vec<PositionPair> {
        let mut places = Vec::with_capacity(self.sides[0] * self.sides[1]);
        for row in 0..self.sides[0] {
            let near = row as f64 * self.step - self.reach[0];
            for column in 0..self.sides[1] {
                places.push([near, column as f64 * self.step - self.reach[1]]);
            }
        }
        places
    }

    /// Returns the number of places of the far person for each of the near one.
    pub fn columns(&self) -> usize {
        self.sides[1]
    }

    /// Returns the value of the nearest place; outside of the table that of its edge.
    pub fn look_up(&self, table: &[f64], at: &PositionPair) -> f64 {
        let [row, column] = [0, 1].map(|axis| {
            let steps = ((at[axis] + self.reach[axis]) / self.step).round();
            steps.clamp(0.0, (self.sides[axis] - 1) as f64) as usize
        });
        table.get(row * self.sides[1] + column).copied().unwrap_or_default()
    }
}

/// Most places on each side of the middle of a table.
const MAX_HALF: usize = 100;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::random::Random;

    /// A likelihood ridge of two people: sharp in the near one, wide and sloping in the far one.
    fn ridge(at: &PositionPair) -> f64 {
        let near = at[0] - 0.03;
        let far = at[1] - 0.2 - 0.5 * at[0];
        (-0.5 * (near / 0.06).powi(2) - 0.5 * (far / 0.18).powi(2)).exp()
    }

    /// Places near the ridge, like those of the best particles of the previous frame.
    fn sampled(count: usize, seed: u64) -> Vec<PositionPair> {
        let mut random = Random::new(seed, 0);
        (0..count)
            .map(|_| {
                [(0.03, 0.08), (0.2, 0.25)]
                    .map(|(centre, spread)| centre + spread * random.normal())
            })
            .collect()
    }

    proptest! {
        #[test]
        fn many_places_are_looked_up_as_one_by_one(
            count in 0usize..60, at in 1usize..40, seed in 0u64..1000, method in 0usize..3,
        ) {
            let method = [Method::Kde, Method::Gp, Method::Table][method];
            let config = Config::default();
            let places = sampled(count, seed);
            let known: Vec<f64> = places.iter().map(ridge).collect();
            let known = if method == Method::Table { vec![0.5; 1281] } else { known };
            let map = LikelihoodMap::new(method, places, known, &config);
            let at = sampled(at, seed + 1);
            let weight = match &map {
                LikelihoodMap::Gp(gp) => gp.coefficients.abs().sum(),
                _ => count as f64,
            };
            for (at, fast) in at.iter().zip(map.at_all(&at)) {
                prop_assert!((fast - map.at(at)).abs() <= 1e-14 * weight, "{} {}", fast, map.at(at));
            }
        }
    }

    fn correlation(a: &[f64], b: &[f64]) -> f64 {
        fn mean(v: &[f64]) -> f64 {
            v.iter().sum::<f64>() / v.len() as f64
        }

        fn dot(x: &[f64], mx: f64, y: &[f64], my: f64) -> f64 {
            x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum()
        }

        let ma = mean(a);
        let mb = mean(b);
        dot(a, ma, b, mb) / (dot(a, ma, a, ma) * dot(b, mb, b, mb)).sqrt()
    }

    /// Kernels of 6 and 10 mm, which is what 40 and 100 mm become where they are taken for variances
    /// in mm².
    fn narrow() -> Config {
        let [kernel_near_m, kernel_far_m] = [40.0_f64, 100.0].map(|mm2| mm2.sqrt() / 1000.0);
        Config { kernel_near_m, kernel_far_m, ..Config::default() }
    }

    /// Mean correlation with the full table over ten samples of 50 places: narrow kernel, wide
    /// kernel, Gaussian process.
    fn correlations() -> [f64; 3] {
        let grid = Grid::new(&Config::default()).places();
        let truth: Vec<f64> = grid.iter().map(ridge).collect();
        let narrow = Kernel::new(&narrow());
        let right = Kernel::new(&Config::default());
        let mut sums = [0.0; 3];
        for seed in 0..10 {
            let places = sampled(50, seed);
            let known: Vec<f64> = places.iter().map(ridge).collect();
            let gp = Gp::fit(places.clone(), &known, right, 0.03).unwrap();
            let maps: [Vec<f64>; 3] = [
                grid.iter().map(|at| parzen(&places, &known, narrow, at)).collect(),
                grid.iter().map(|at| parzen(&places, &known, right, at)).collect(),
                grid.iter().map(|at| gp.at(at)).collect(),
            ];
            for (sum, map) in sums.iter_mut().zip(&maps) {
                *sum += correlation(map, &truth) / 10.0;
            }
        }
        sums
    }

    #[test]
    fn kernels_fall_by_the_root_of_e_at_40_and_100_mm() {
        fn at(config: &Config, place: [f64; 2]) -> f64 {
            Kernel::new(config).at(&[0.0, 0.0], &place)
        }

        let right = Config::default();
        for place in [[0.04, 0.0], [0.0, 0.1]] {
            assert!((at(&right, place) - (-0.5f64).exp()).abs() < 1e-12);
        }
        // exp(-d² / (2 sigma)) in millimetres.
        assert!((at(&narrow(), [0.008, 0.0]) - (-64.0 / 80.0f64).exp()).abs() < 1e-9);
        assert!((at(&narrow(), [0.0, 0.02]) - (-400.0 / 200.0f64).exp()).abs() < 1e-9);
        let wider = Config { kernel_near_m: 0.08, kernel_far_m: 0.3, ..Config::default() };
        assert!((at(&wider, [0.08, 0.3]) - (-1f64).exp()).abs() < 1e-12);
    }

    #[test]
    fn a_sum_of_kernels_is_as_high_as_the_likelihoods() {
        let kernel = Kernel::new(&Config::default());
        let places = [[0.0, 0.0], [0.04, 0.0]];
        let half = (-0.5f64).exp();
        assert!(
            (parzen(&places, &[2.0, 3.0], kernel, &[0.0, 0.0]) - (2.0 + 3.0 * half)).abs() < 1e-12
        );
    }

    #[test]
    fn the_nugget_says_how_closely_the_process_follows() {
        let places = vec![[0.0, 0.0], [0.2, 0.5]];
        for (nugget, expected) in [(1e-6, 1.0), (1.0, 0.5)] {
            let config = Config { nugget, ..Config::default() };
            let map = LikelihoodMap::new(Method::Gp, places.clone(), vec![1.0, 0.0], &config);
            let found = map.at(&[0.0, 0.0]);
            assert!((found - expected).abs() < 1e-3, "{nugget}: {found}");
        }
    }

    #[test]
    fn a_process_is_never_negative() {
        let places = vec![[0.0, 0.0], [0.03, 0.0]];
        let gp = Gp::fit(places, &[0.0, 1.0], Kernel::new(&Config::default()), 0.001).unwrap();
        assert_eq!(gp.at(&[-0.03, 0.0]), 0.0);
    }

    #[test]
    fn the_printed_kernel_makes_spikes_and_interpolation_follows_the_ridge() {
        let [printed, right, gp] = correlations();
        assert!((0.25..0.65).contains(&printed), "printed {printed}");
        assert!(right > 0.85 && right > printed + 0.2, "corrected {right}");
        assert!(gp > right, "interpolated {gp}, corrected {right}");
    }

    #[test]
    fn interpolation_finds_the_mean_that_a_sum_of_kernels_misses() {
        /// The mean place across of a map.
        fn mean_across(grid: &[PositionPair], map: impl Fn(&PositionPair) -> f64) -> f64 {
            let sum: f64 = grid.iter().map(&map).sum();
            grid.iter().map(|at| at[1] * map(at)).sum::<f64>() / sum
        }

        let grid = Grid::new(&Config::default()).places();
        let kernel = Kernel::new(&Config::default());
        let truth = mean_across(&grid, ridge);
        let mut by_sum = 0.0;
        let mut by_gp = 0.0;
        for seed in 0..10 {
            let places = sampled(50, seed);
            let known: Vec<f64> = places.iter().map(ridge).collect();
            let gp = Gp::fit(places.clone(), &known, kernel, 0.03).unwrap();
            let of_sum = mean_across(&grid, |at| parzen(&places, &known, kernel, at));
            by_sum += (of_sum - truth).abs() / 10.0;
            by_gp += (mean_across(&grid, |at| gp.at(at)) - truth).abs() / 10.0;
        }
        assert!(by_gp < 0.010 && by_sum > 1.5 * by_gp, "gp {by_gp} m, sum {by_sum} m");
    }

    #[test]
    fn the_printed_table_has_1281_places_and_finds_each_again() {
        let grid = Grid::new(&Config::default());
        let places = grid.places();
        assert_eq!(places.len(), 1281);
        let numbers: Vec<f64> = (0..1281).map(f64::from).collect();
        assert!(places.iter().zip(&numbers).all(|(at, n)| grid.look_up(&numbers, at) == *n));
        assert_eq!(grid.look_up(&numbers, &[-9.0, -9.0]), 0.0);
        assert_eq!(grid.look_up(&numbers, &[9.0, 9.0]), 1280.0);
    }
}
