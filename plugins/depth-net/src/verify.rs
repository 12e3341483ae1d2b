use tagalong_config::{Context, check_settings};
use tagalong_core::{Detection, Frame, Input, Inputs, Result, Verifier};
use tagalong_learn::ScoreCalibration;

use crate::{BUILT_IN, FloorMap, Model, Source, VerifierConfig};

/// Verifier that returns the log-odds of the map at a candidate's place.
pub struct DepthNetVerifier {
    model: Model,
    radius_m: f64,
    calibration: ScoreCalibration,
}

impl DepthNetVerifier {
    /// Creates a verifier and reads its model.
    pub fn new(config: VerifierConfig, context: &Context) -> Result<Self> {
        check_settings(&config)?;
        let calibration = ScoreCalibration::new(config.weight, config.limit, config.bias)?;
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        Ok(Self { model, radius_m: config.radius_m, calibration })
    }
}

impl Verifier for DepthNetVerifier {
    fn inputs(&self) -> Inputs {
        Inputs::NONE.accept(Input::Depth)
    }

    fn log_odds(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        if frame.depth().is_err() {
            return Ok(0.0);
        }
        let (views, passes) = self.model.look(frame, Source::Depth)?;
        let (Some((_, map)), Some(pass)) = (views.maps.first(), passes.first()) else {
            return Ok(0.0);
        };
        let side = FloorMap::CELLS;
        let near = (0..side * side).filter(|cell| map.in_view[*cell]).filter_map(|cell| {
            let row = cell / side;
            let column = cell % side;
            let off = FloorMap::centre(row, column) - candidate.position.xy();
            (off.norm() < self.radius_m).then(|| f64::from(pass.logit(row, column)))
        });
        // Outside of the map and of the view the network says nothing.
        Ok(near
            .reduce(f64::max)
            .map_or(0.0, |logit| self.calibration.calibrate(self.model.log_odds(logit))))
    }
}
