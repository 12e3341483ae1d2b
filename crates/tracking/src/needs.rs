use tagalong_core::{Frame, Input, Inputs, Usage};

use crate::search::SearchStage;
use crate::{Guarded, Preprocessor, StepError};

/// Inputs that the stages of a pipeline require of each frame, beside those of its detectors, which
/// do not all run on each frame.
#[derive(Default)]
pub(crate) struct Needs(Vec<(String, Inputs)>);

impl Needs {
    /// Adds the inputs of a stage.
    pub(crate) fn add(&mut self, stage: &str, inputs: Inputs) {
        self.0.push((stage.to_owned(), inputs));
    }

    /// Refuses a frame without an input that a preprocessor, a detector that runs on it or another stage
    /// requires, before any of them sees it. `count` is the number of frames before it.
    ///
    /// # Errors
    /// [`StepError::Lacks`].
    pub(crate) fn check(
        &self,
        frame: &Frame,
        preprocessors: &[Guarded<dyn Preprocessor>],
        search: &SearchStage,
        count: u64,
    ) -> Result<(), StepError> {
        let mut added = Inputs::NONE;
        for preprocessor in preprocessors {
            if let Some(input) = preprocessor.plugin().lacks(frame) {
                return Err(StepError::lacks(preprocessor.name(), frame, input));
            }
            added = added.union(preprocessor.plugin().adds());
        }
        for slot in search.detectors.iter().filter(|slot| slot.is_due(frame, count)) {
            let inputs = slot.plugin.plugin().capabilities().inputs;
            require(slot.plugin.name(), inputs, frame, added)?;
        }
        for verifier in &search.verifiers {
            require(verifier.name(), verifier.plugin().inputs(), frame, added)?;
        }
        self.0.iter().try_for_each(|(stage, inputs)| require(stage, *inputs, frame, added))
    }
}

/// Refuses a frame without a required input, unless a preprocessor adds it.
fn require(stage: &str, inputs: Inputs, frame: &Frame, added: Inputs) -> Result<(), StepError> {
    for input in inputs.of(Usage::Required) {
        if !frame.holds(input) && !added.uses(input) {
            return Err(StepError::lacks(stage, frame, input));
        }
    }
    Ok(())
}

impl StepError {
    fn lacks(stage: &str, frame: &Frame, input: Input) -> Self {
        Self::Lacks { plugin: stage.to_owned(), frame: frame.index, input }
    }
}
