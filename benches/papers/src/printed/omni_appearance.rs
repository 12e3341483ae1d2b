//! `omni-appearance-as-printed`: the detector of P5 averages columns as if the panorama ended at its
//! seam, so that a person behind the robot appears in front of it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::{Context, Registry, TrainingData, TrainingOffer};
use tagalong_core::Result;
use tagalong_omni_appearance::train::DistanceTrainer;
use tagalong_omni_appearance::{AfterMeasuring, Blob, OmniAppearance};

/// Name of the detector in configs.
pub const NAME: &str = "omni-appearance-as-printed";

/// Name of the distance model of the printed detector in `tagalong-papers train`.
const TRAINER: &str = "omni-distance-as-printed";

/// Settings of the detector `omni-appearance-as-printed`: those of `omni-appearance`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Settings of `omni-appearance`.
    #[serde(flatten)]
    pub base: tagalong_omni_appearance::Config,
}

impl Config {
    /// Returns the settings of `omni-appearance`, with the misprint.
    pub fn printed(self) -> tagalong_omni_appearance::Config {
        let step = AfterMeasuring { name: "the seam forgotten", correct: forget_the_seam };
        tagalong_omni_appearance::Config { after_measuring: Some(step), ..self.base }
    }
}

/// Computes mean and extent of column numbers as if the image did not close on itself.
fn forget_the_seam(blob: &mut Blob, columns: &[u16]) {
    let width = columns.len();
    if blob.run.first + blob.run.length <= width {
        return;
    }
    let total: f64 = blob.run.columns(width).map(|column| f64::from(columns[column])).sum();
    let sum: f64 =
        blob.run.columns(width).map(|column| column as f64 * f64::from(columns[column])).sum();
    blob.column = sum / total.max(1.0);
    blob.features.width = width as f64;
}

/// Builds the detector.
pub fn detector(config: Config, context: &Context) -> Result<OmniAppearance> {
    OmniAppearance::new(config.printed(), context)
}

/// Registers the detector, and the trainer of its distances.
pub fn register(registry: &mut Registry) {
    registry.detector(
        NAME,
        "people in the panorama of a conical mirror, as if it ended at its seam (P5)",
        detector,
    );
    let data = TrainingData::Panoramas;
    registry.training(TRAINER, TrainingOffer::new(data, ""));
    registry.trainer(TRAINER, |config: Config, context| {
        DistanceTrainer::new(config.printed(), context.seed)
    });
}

#[cfg(test)]
mod tests {
    use tagalong_omni_appearance::Features;
    use tagalong_omni_appearance::circular::{Run, mean};

    use super::*;

    fn blob(first: usize, columns: &[u16]) -> Blob {
        let width = columns.len();
        let run = Run { first, length: 4 };
        let zero = 0.0;
        Blob {
            run,
            column: mean(&run, width, |column| f64::from(columns[column])),
            features: Features {
                width: 4.0,
                bottom: zero,
                pixels: zero,
                top: zero,
                middle: zero,
                core: zero,
                low: zero,
            },
            colour: [zero; 3],
            visible: 1.0,
        }
    }

    #[test]
    fn a_person_on_the_seam_appears_on_the_other_side_and_as_wide_as_the_image() {
        let mut columns = [0; 100];
        [98, 99, 0, 1].into_iter().for_each(|column: usize| columns[column] = 10);
        let measured = blob(98, &columns);
        let from_seam = measured.column.min(100.0 - measured.column);
        assert!(from_seam < 1.0, "{}", measured.column);
        let mut printed = measured;
        forget_the_seam(&mut printed, &columns);
        assert!((printed.column - 49.5).abs() < 1e-9, "{}", printed.column);
        assert_eq!(printed.features.width, 100.0);
    }

    #[test]
    fn a_person_elsewhere_stays_as_measured() {
        let mut columns = [0; 100];
        [40, 41, 42, 43].into_iter().for_each(|column: usize| columns[column] = 10);
        let measured = blob(40, &columns);
        let mut printed = measured;
        forget_the_seam(&mut printed, &columns);
        assert_eq!(printed, measured);
    }
}
