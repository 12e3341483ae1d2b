use tagalong_core::{Context, Detection, Error, Frame, Result, Verifier};

use crate::{Config, Features, Model};

/// The model that is part of the program.
const BUILT_IN: &str = include_str!("../../../configs/models/color-texture.toml");

/// The verifier.
pub struct ColorTexture {
    model: Model,
    features: Features,
    weight: f64,
    limit: f64,
    bias: f64,
}

impl ColorTexture {
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
        if !config.bias.is_finite() {
            return Err(Error::Settings(format!("`bias` = {} must be finite", config.bias)));
        }
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        let features = Features::default();
        let Config { weight, limit, bias, .. } = config;
        Ok(Self { model, features, weight, limit, bias })
    }
}

impl Verifier for ColorTexture {
    fn margin(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        self.features.look(frame, candidate)?;
        let log_odds = self.model.log_odds(&self.features).clamp(-self.limit, self.limit);
        Ok(self.weight * log_odds + self.bias)
    }
}
