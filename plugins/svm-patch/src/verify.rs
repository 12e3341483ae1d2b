use tagalong_config::Context;
use tagalong_core::{Detection, Frame, Input, Inputs, Result, Verifier};
use tagalong_learn::ScoreCalibration;

use crate::{Config, Model};

/// Model that is compiled into the program.
const BUILT_IN: &str = include_str!("../models/svm-patch.toml");

/// Verifier by a support vector machine on grey patches.
pub struct SvmPatch {
    model: Model,
    calibration: ScoreCalibration,
}

impl SvmPatch {
    /// Creates a verifier and reads its model.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Model`] for a file that cannot be read or is not a model,
    /// [`tagalong_core::Error::Settings`] for a weight or limit outside its range.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        let calibration = ScoreCalibration::new(config.weight, config.limit, 0.0)?;
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        Ok(Self { model, calibration })
    }
}

impl Verifier for SvmPatch {
    fn inputs(&self) -> Inputs {
        Inputs::NONE.require(Input::Colour)
    }

    fn log_odds(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        let patch = self.model.sampler.patch(frame.grey()?, &candidate.rect_in(&frame.camera));
        Ok(self.calibration.calibrate(self.model.log_odds(&patch)))
    }
}
