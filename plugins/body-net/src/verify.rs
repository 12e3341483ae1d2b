use tagalong_config::Context;
use tagalong_core::{Detection, Frame, Input, Inputs, Result, Verifier};
use tagalong_learn::ScoreCalibration;

use crate::{Config, Model, NetworkInput, Pass};

/// The model that is part of the program.
const BUILT_IN: &str = include_str!("../models/body-net.toml");

/// The verifier.
pub struct BodyNet {
    model: Model,
    pass: Pass,
    depth: bool,
    calibration: ScoreCalibration,
}

impl BodyNet {
    /// A verifier; reads its model.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Model`] for a file that cannot be read or is no model,
    /// [`tagalong_core::Error::Settings`] for weights that are no weights.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        let calibration = ScoreCalibration::new(config.weight, config.limit, config.bias)?;
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        Ok(Self { model, pass: Pass::default(), depth: config.depth, calibration })
    }
}

impl Verifier for BodyNet {
    fn inputs(&self) -> Inputs {
        Inputs::NONE.require(Input::Colour).accept(Input::Depth)
    }

    fn log_odds(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        let Some(view) = NetworkInput::new(frame, candidate, self.depth)? else { return Ok(0.0) };
        Ok(self.calibration.calibrate(self.model.log_odds(&view, &mut self.pass)))
    }
}
