//! Sampling steps of the filter; a program may replace them by those of another scheme.

use std::fmt::Debug;
use std::sync::Arc;

use nalgebra::{Vector2, Vector5};

use crate::particle::across;
use crate::random::Random;
use crate::resampling::systematic;

/// Steps of a scheme of sampling. The default ones are those of a filter that resamples
/// systematically where few particles have most of the weight.
pub trait SamplingSteps: Debug + Send + Sync {
    /// Returns true if all particles are resampled in every frame.
    fn resamples_always(&self) -> bool {
        false
    }

    /// Returns the indices of the particles that resampling keeps, some of them repeatedly.
    fn resample(&self, weights: &[f64], count: usize, random: &mut Random) -> Vec<usize> {
        systematic(weights, count, random)
    }

    /// Returns the indices of the particles that are kept where groups form and part.
    fn choose(&self, weights: &[f64], count: usize, random: &mut Random) -> Vec<usize> {
        systematic(weights, count, random)
    }

    /// Returns the weight of two chosen particles as a joint one.
    fn joint_weight(&self, _weights: [f64; 2]) -> f64 {
        1.0
    }

    /// Returns noise of variance one for the five numbers of a person. `dimensions` are generators
    /// for these numbers, with the same seeds in every group.
    fn noise(&self, random: &mut Random, _dimensions: &mut [Random]) -> Vector5<f64> {
        Vector5::from_fn(|_, _| random.normal())
    }

    /// Returns true if all people of a joint particle are moved by the same noise.
    fn shares_noise(&self) -> bool {
        false
    }

    /// Returns the axis of the lateral positions of people on a viewing ray.
    fn lateral_axis(&self, ray: &Vector2<f64>) -> Vector2<f64> {
        across(ray)
    }

    /// Returns true if the prediction of the next frame is reported.
    fn reports_prediction(&self) -> bool {
        false
    }
}

/// The default steps.
#[derive(Clone, Copy, Debug)]
struct Systematic;

impl SamplingSteps for Systematic {}

/// Scheme of sampling, the default one or that of a program.
#[derive(Clone, Debug)]
pub struct Sampling(Arc<dyn SamplingSteps>);

impl Sampling {
    /// Returns a scheme with other steps.
    pub fn new(steps: impl SamplingSteps + 'static) -> Self {
        Self(Arc::new(steps))
    }

    /// Returns its steps.
    pub(crate) fn steps(&self) -> &dyn SamplingSteps {
        &*self.0
    }
}

impl Default for Sampling {
    fn default() -> Self {
        Self::new(Systematic)
    }
}

impl PartialEq for Sampling {
    fn eq(&self, other: &Self) -> bool {
        // Steps have no equality of their own; their settings are in what they print.
        format!("{self:?}") == format!("{other:?}")
    }
}
