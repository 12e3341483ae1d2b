use tagalong_config::Context;
use tagalong_core::{Detection, Frame, Input, Inputs, Result, Verifier};
use tagalong_learn::ScoreCalibration;

use crate::{Config, Features, Model};

/// The model that is part of the program.
const BUILT_IN: &str = include_str!("../models/color-texture.toml");

/// The verifier.
pub struct ColorTexture {
    model: Model,
    features: Features,
    calibration: ScoreCalibration,
}

impl ColorTexture {
    /// A verifier; reads its model.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Model`] for a file that cannot be read or is no model,
    /// [`tagalong_core::Error::Settings`] for weights that are no weights.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        let calibration = ScoreCalibration::new(config.weight, config.limit, config.bias)?;
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        let features = Features::default();
        Ok(Self { model, features, calibration })
    }
}

impl Verifier for ColorTexture {
    fn inputs(&self) -> Inputs {
        Inputs::NONE.require(Input::Colour).accept(Input::Depth)
    }

    fn log_odds(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        self.features.look(frame, candidate)?;
        Ok(self.calibration.calibrate(self.model.log_odds(&self.features)))
    }
}
