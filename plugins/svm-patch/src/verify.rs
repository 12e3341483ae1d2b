use tagalong_core::{Context, Detection, Error, Frame, Result, Verifier};

use crate::{Config, Model};

/// The model that is part of the program.
const BUILT_IN: &str = include_str!("../../../configs/models/svm-patch.toml");

/// The verifier.
pub struct SvmPatch {
    model: Model,
    weight: f64,
    limit: f64,
}

impl SvmPatch {
    /// A verifier; reads its model.
    ///
    /// # Errors
    /// [`Error::Model`] for a file that cannot be read or is no model,
    /// [`Error::Settings`] for weights that are no weights.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        for (name, value) in [("weight", config.weight), ("limit", config.limit)] {
            if !(value.is_finite() && value >= 0.0) {
                let message = format!("`{name}` = {value} must be a number from 0 on");
                return Err(Error::Settings(message));
            }
        }
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        Ok(Self { model, weight: config.weight, limit: config.limit })
    }
}

impl Verifier for SvmPatch {
    fn margin(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        let patch = self.model.sampler.patch(frame.grey()?, &candidate.region);
        let log_odds = self.model.log_odds(&patch).clamp(-self.limit, self.limit);
        Ok(self.weight * log_odds)
    }
}
