//! A verifier that judges people by the contrast of their image: a person has some, a blank wall
//! has none. Beside it stand a detector, and an associator and a track manager, the two kinds of
//! plugin that decide which tracks there are.

pub mod band;
pub mod nearest;
pub mod patient;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::Registry;
use tagalong_core::{Detection, Frame, Input, Inputs, Result, Verifier};

/// Name of this plugin in configs.
pub const NAME: &str = "own-contrast";

/// Registers the plugins.
pub fn register(registry: &mut Registry) {
    registry
        .detector("own-band", "things as wide as a person", |config, _| Ok(band::OwnBand(config)));
    registry.associator("own-nearest", "nearest pairs first", |config, _| {
        Ok(nearest::OwnNearest(config))
    });
    registry.manager("own-patient", "ends what was unseen for long", |config, _| {
        Ok(patient::OwnPatient(config))
    });
    let summary = "people have more contrast than walls";
    registry.verifier(NAME, summary, |config: Config, _| Ok(OwnContrast { config }));
}

/// Settings of `own-contrast`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Standard deviation of the grey values at which a person and no person
    /// are equally likely.
    pub even_contrast: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { even_contrast: 25.0 }
    }
}

/// Verifier by the contrast inside of the region.
pub struct OwnContrast {
    config: Config,
}

impl Verifier for OwnContrast {
    fn inputs(&self) -> Inputs {
        Inputs::NONE.require(Input::Colour)
    }

    fn log_odds(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64> {
        let grey = frame.grey()?;
        let inside = candidate.rect_in(&frame.camera).clipped(grey.width(), grey.height());
        let left = inside.x as usize;
        let right = inside.right() as usize;
        let top = inside.y as usize;
        let bottom = inside.bottom() as usize;
        // A region outside of the image is no evidence.
        if right <= left || bottom <= top {
            return Ok(0.0);
        }
        let values = (top..bottom).flat_map(|y| &grey.row(y)[left..right]).map(|v| f64::from(*v));
        let count = ((right - left) * (bottom - top)) as f64;
        let mean = values.clone().sum::<f64>() / count;
        let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / count;
        // One image must not decide alone; the clamp also bounds the logarithm of zero contrast.
        Ok((variance.sqrt() / self.config.even_contrast).ln().clamp(-3.0, 3.0))
    }
}
