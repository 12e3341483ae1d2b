use tagalong_core::{Context, Detection, Error, Frame, Result, Verifier};

use crate::{Config, Model, Pass, View};

/// The model that is part of the program.
const BUILT_IN: &str = include_str!("../../../configs/models/body-net.toml");

/// The verifier.
pub struct BodyNet {
    model: Model,
    pass: Pass,
    weight: f64,
    limit: f64,
    bias: f64,
}

impl BodyNet {
    /// A verifier; reads its model.
    ///
    /// # Errors
    /// [`Error::Model`] for a file that cannot be read or is no model,
    /// [`Error::Settings`] for weights that are no weights.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        let Config { weight, limit, bias, .. } = config;
        for (name, value) in [("weight", weight), ("limit", limit)] {
            if !(value.is_finite() && value >= 0.0) {
                let message = format!("`{name}` = {value} must be a number from 0 on");
                return Err(Error::Settings(message));
            }
        }
        if !bias.is_finite() {
            return Err(Error::Settings(format!("`bias` = {bias} must be finite")));
        }
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        Ok(Self { model, pass: Pass::default(), weight, limit, bias })
    }
}

impl Verifier for BodyNet {
    fn margin(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        let Some(view) = View::new(frame, candidate)? else { return Ok(0.0) };
        let log_odds = self.model.log_odds(&view, &mut self.pass).clamp(-self.limit, self.limit);
        Ok(self.weight * log_odds + self.bias)
    }
}
