use std::sync::Arc;

use tagalong_core::{EgoMotion, Estimate, Frame, Funnel, Input, Inputs};
use tagalong_vision::Cleaned;

use crate::stage::StageLog;
use crate::{Guarded, StepError};

/// Output of a preprocessor.
#[derive(Default)]
pub struct Preprocessed {
    /// The completed frame; `None` if it is used unchanged.
    pub frame: Option<Frame>,
    /// A better estimate of the robot's motion since the last processed frame; `None` if there
    /// is none.
    pub motion: Option<EgoMotion>,
}

/// Completes frames before detection: depth from a stereo pair, or egomotion from the images.
pub trait Preprocessor: Send {
    /// Completes a frame. `motion` is the robot's motion since the last processed frame, `None`
    /// after a jump of the clock; `people` are the estimates of all tracks before that motion,
    /// sorted by track number.
    ///
    /// # Errors
    /// [`tagalong_core::Error::MissingImage`] if the frame lacks a required input.
    fn process(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        people: &[Estimate],
        funnel: &mut Funnel,
    ) -> tagalong_core::Result<Preprocessed>;

    /// Returns an input that it needs of this very frame and that the frame does not have, if there
    /// is one: the frame is refused.
    fn lacks(&self, _: &Frame) -> Option<Input> {
        None
    }

    /// Returns the inputs that it adds to frames without them.
    fn adds(&self) -> Inputs {
        Inputs::NONE
    }
}

/// Takes a frame through all preprocessors; each receives the output of those before it.
pub(crate) fn preprocess(
    preprocessors: &mut [Guarded<dyn Preprocessor>],
    frame: &Frame,
    mut motion: Option<EgoMotion>,
    people: &[Estimate],
    log: &mut StageLog,
) -> Result<(Option<Frame>, Option<EgoMotion>), StepError> {
    let mut completed: Option<Frame> = None;
    for preprocessor in preprocessors {
        let input = completed.as_ref().unwrap_or(frame);
        let funnel = &mut log.funnel;
        let output = preprocessor
            .call(frame.index, |plugin| plugin.process(input, motion, people, funnel))?;
        motion = output.motion.or(motion);
        completed = output.frame.or(completed);
    }
    Ok((completed, motion))
}

/// Returns the frame without wrong pixels, if its images have many.
pub(crate) fn cleaned(frame: &Frame, log: &mut StageLog) -> Result<Arc<Cleaned>, StepError> {
    let cleaned = frame.derived::<Cleaned>();
    let cleaned = cleaned.map_err(|error| StepError::of_stage("[preprocess]", frame, error))?;
    log.funnel.drop_many("frame: wrong pixels", u64::from(cleaned.frame().is_some()));
    Ok(cleaned)
}
