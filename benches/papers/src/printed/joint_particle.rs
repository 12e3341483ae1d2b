//! `joint-particle-as-printed`: the particle filter of P3.
//!
//! Kernels have `2 sigma` in the denominator in place of `2 sigma²`, both people of a joint particle
//! are moved by the same noise, the likeliest particles alone are kept when groups form and part, and
//! lateral positions lie along the robot's Y axis. Sampling is that of OpenCV's ConDensation, which
//! the paper used.

use nalgebra::{Vector2, Vector5};
use tagalong_config::{Registry, check_settings};
use tagalong_core::{Result, settings};
use tagalong_joint_particle::{
    JointParticle, Random, Sampling, SamplingSteps, heaviest, systematic,
};

settings! {
    /// Settings of the filter `joint-particle-as-printed`, beside those of `joint-particle`. Each
    /// of them is true as printed, and corrects one misprint where it is false.
    pub struct Config {
        /// Kernels with 2 sigma in place of 2 sigma², in millimetres.
        pub printed_kernel: bool = true,
        /// Lateral positions along the robot's Y axis instead of across the viewing ray.
        pub printed_axes: bool = true,
        /// All people of a group are moved by the same noise.
        pub shared_noise: bool = true,
        /// The most likely particles are kept when groups form and part, instead of resampling from
        /// all.
        pub top: bool = true,
        /// As in OpenCV's ConDensation: resampling in every frame without a random offset, uniform
        /// noise from generators with the same seeds for every track, and the prediction reported
        /// as the estimate.
        pub condensation: bool = true,
        /// Settings of `joint-particle`.
        #[serde(flatten)]
        pub base: tagalong_joint_particle::Config,
    }
}

/// The printed steps of sampling.
#[derive(Clone, Copy, Debug)]
struct PrintedSteps {
    axes: bool,
    shared_noise: bool,
    top: bool,
    condensation: bool,
}

impl SamplingSteps for PrintedSteps {
    fn resamples_always(&self) -> bool {
        self.condensation
    }

    fn resample(&self, weights: &[f64], count: usize, random: &mut Random) -> Vec<usize> {
        if self.condensation { without_offset(weights) } else { systematic(weights, count, random) }
    }

    fn choose(&self, weights: &[f64], count: usize, random: &mut Random) -> Vec<usize> {
        if self.top { heaviest(weights, count) } else { systematic(weights, count, random) }
    }

    fn joint_weight(&self, weights: [f64; 2]) -> f64 {
        if self.top { weights[0] * weights[1] } else { 1.0 }
    }

    fn noise(&self, random: &mut Random, dimensions: &mut [Random]) -> Vector5<f64> {
        if self.condensation {
            return Vector5::from_fn(|i, _| flat(&mut dimensions[i]));
        }
        Vector5::from_fn(|_, _| random.normal())
    }

    fn shares_noise(&self) -> bool {
        self.shared_noise
    }

    fn lateral_axis(&self, ray: &Vector2<f64>) -> Vector2<f64> {
        let length = ray.norm();
        let has_side = !self.axes && length > 1e-9;
        if has_side { Vector2::new(-ray.y, ray.x) / length } else { Vector2::y() }
    }

    fn reports_prediction(&self) -> bool {
        self.condensation
    }
}

/// Returns a uniform number with mean zero and variance one.
fn flat(random: &mut Random) -> f64 {
    (2.0 * random.uniform() - 1.0) * 3f64.sqrt()
}

/// Resamples as OpenCV's ConDensation: at evenly spaced points without a random offset, which favours
/// low indices.
fn without_offset(weights: &[f64]) -> Vec<usize> {
    let count = weights.len();
    let mut index = 0;
    let mut sum = weights.first().copied().unwrap_or_default();
    let mut kept = Vec::with_capacity(count);
    for i in 0..count {
        while sum <= i as f64 / count as f64 && index + 1 < count {
            index += 1;
            sum += weights[index];
        }
        kept.push(index);
    }
    kept
}

/// Returns the width of a kernel of which the printed formula takes sigma, in mm, for a variance, in
/// mm².
fn printed_width_m(sigma_m: f64) -> f64 {
    (1000.0 * sigma_m).sqrt() / 1000.0
}

/// Builds the filter.
///
/// # Errors
/// Settings outside their ranges.
pub fn filter(config: Config, seed: u64) -> Result<JointParticle> {
    check_settings(&config)?;
    let Config { printed_kernel, printed_axes, shared_noise, top, condensation, mut base } = config;
    if printed_kernel {
        base.kernel_near_m = printed_width_m(base.kernel_near_m);
        base.kernel_far_m = printed_width_m(base.kernel_far_m);
    }
    let steps = PrintedSteps { axes: printed_axes, shared_noise, top, condensation };
    base.sampling = Sampling::new(steps);
    JointParticle::new(base, seed)
}

/// Registers the filter.
pub fn register(registry: &mut Registry) {
    registry.filter(
        "joint-particle-as-printed",
        "joint particles with the equations of P3 as printed, by ConDensation",
        |config: Config, context| filter(config, context.seed),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRINTED: PrintedSteps =
        PrintedSteps { axes: true, shared_noise: true, top: true, condensation: true };
    const CORRECTED: PrintedSteps =
        PrintedSteps { axes: false, shared_noise: false, top: false, condensation: false };

    #[test]
    fn the_likeliest_are_kept_when_groups_form_and_part_and_keep_their_weights() {
        let mut random = Random::new(1, 0);
        assert_eq!(PRINTED.choose(&[0.2, 0.5, 0.3], 2, &mut random), [1, 2]);
        assert!((PRINTED.joint_weight([0.5, 0.6]) - 0.3).abs() < 1e-12);
        let drawn = CORRECTED.choose(&[0.2, 0.5, 0.3], 10, &mut random);
        let counts = [0, 1, 2].map(|index| drawn.iter().filter(|drawn| **drawn == index).count());
        assert_eq!(counts, [2, 5, 3], "by their weights");
        assert_eq!(CORRECTED.joint_weight([0.5, 0.6]), 1.0);
    }

    #[test]
    fn without_an_offset_the_first_particle_is_preferred() {
        let weights = [0.1, 0.1, 0.4, 0.4];
        let [printed, corrected] = [&PRINTED, &CORRECTED].map(|steps| {
            let draws = (0..200).map(|seed| steps.resample(&weights, 4, &mut Random::new(seed, 0)));
            draws.filter(|kept| kept[0] == 0).count()
        });
        assert_eq!(without_offset(&weights), [0, 2, 2, 3]);
        assert_eq!(printed, 200);
        assert!((50..110).contains(&corrected), "0.4 of 200: {corrected}");
    }

    #[test]
    fn noise_is_uniform_and_the_same_for_every_track_and_corrected_normal() {
        fn largest(steps: &PrintedSteps, seed: u64) -> f64 {
            let mut random = Random::new(seed, 0);
            let mut dimensions: Vec<Random> = (0..5).map(|d| Random::new(d, 0)).collect();
            let drawn: Vec<Vector5<f64>> =
                (0..400).map(|_| steps.noise(&mut random, &mut dimensions)).collect();
            drawn.iter().fold(0.0, |most: f64, noise| most.max(noise.amax()))
        }

        let end = 3f64.sqrt();
        assert!((0.99 * end..=end).contains(&largest(&PRINTED, 1)));
        assert_eq!(largest(&PRINTED, 1), largest(&PRINTED, 2), "seeded alike");
        assert!(largest(&CORRECTED, 1) > 2.2);
        assert_ne!(largest(&CORRECTED, 1), largest(&CORRECTED, 2));
        assert!(PRINTED.shares_noise() && !CORRECTED.shares_noise());
    }

    #[test]
    fn lateral_positions_lie_along_y_and_corrected_across_the_viewing_ray() {
        let ray = Vector2::new(1.5, 1.5);
        assert_eq!(PRINTED.lateral_axis(&ray), Vector2::y());
        let half = 0.5f64.sqrt();
        assert!((CORRECTED.lateral_axis(&ray) - Vector2::new(-half, half)).norm() < 1e-12);
    }

    #[test]
    fn the_prediction_is_reported_and_corrected_the_estimate() {
        assert!(PRINTED.reports_prediction() && !CORRECTED.reports_prediction());
        assert!(PRINTED.resamples_always() && !CORRECTED.resamples_always());
    }

    #[test]
    fn a_kernel_is_as_narrow_as_a_variance_in_square_millimetres() {
        assert!((printed_width_m(0.04) - 40f64.sqrt() / 1000.0).abs() < 1e-12);
        assert!((printed_width_m(0.1) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn its_settings_stand_beside_those_of_the_filter() {
        let config: Config = toml::from_str("top = false\npoints = 30").unwrap();
        assert!(!config.top && config.base.points == 30 && config.condensation);
        assert!(toml::from_str::<Config>("tip = false").is_err());
        assert!(filter(config, 1).is_ok());
        let base = tagalong_joint_particle::Config { points: 0, ..Default::default() };
        assert!(filter(Config { base, ..Config::default() }, 1).is_err());
    }
}
