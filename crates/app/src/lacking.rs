//! Frames that lack an input which a plugin requires: left out and counted.

use serde::Serialize;
use tagalong_core::{Frame, Input};
use tagalong_math::counted;
use tagalong_pipeline::{FrameReport, Pipeline, StepError};

/// Frames without an input that a plugin or a stage requires.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LackingFrames {
    /// Plugin or stage.
    pub plugin: String,
    /// The input.
    pub input: &'static str,
    /// Index of the first of these frames.
    pub first_frame: u64,
    /// Number of these frames.
    pub frames: u64,
    #[serde(skip)]
    kind: Input,
}

impl LackingFrames {
    /// Returns the warning about them, with the number of all frames that were read.
    fn warning(&self, read: u64) -> String {
        let Self { plugin, first_frame, frames, kind, .. } = self;
        format!(
            "{frames} of {} left out, the first is frame {first_frame}: they lack {kind}, which `{plugin}` \
             needs",
            counted(read, "frame")
        )
    }
}

/// Counts of the frames that one pipeline was given.
#[derive(Default)]
pub struct Lacking {
    groups: Vec<LackingFrames>,
    first: Option<StepError>,
    given: u64,
    taken: u64,
}

impl Lacking {
    /// Passes a frame of a log to the pipeline. `None` for a frame that lacks an input: it is left out
    /// and counted.
    ///
    /// # Errors
    /// A [`StepError`] that stops the pipeline.
    pub fn step(
        &mut self,
        pipeline: &mut Pipeline,
        frame: &Frame,
    ) -> Result<Option<FrameReport>, StepError> {
        self.given += 1;
        match pipeline.step(frame) {
            Ok(report) => {
                self.taken += 1;
                Ok(Some(report))
            }
            Err(error) => self.count(error).map(|()| None),
        }
    }

    /// Counts a frame. Gives back an error that is not about a missing input.
    fn count(&mut self, error: StepError) -> Result<(), StepError> {
        let StepError::Lacks { plugin, frame, input } = &error else { return Err(error) };
        let known = self.groups.iter_mut().find(|it| it.plugin == *plugin && it.kind == *input);
        match known {
            Some(group) => group.frames += 1,
            None => self.groups.push(LackingFrames {
                plugin: plugin.clone(),
                input: input.name(),
                first_frame: *frame,
                frames: 1,
                kind: *input,
            }),
        }
        self.first.get_or_insert(error);
        Ok(())
    }

    /// Returns the error of the first frame if every frame lacked an input: the pipeline cannot run on
    /// this log.
    pub fn failure(&self) -> Option<&StepError> {
        self.first.as_ref().filter(|_| self.taken == 0)
    }

    /// Returns the warnings about frames that were left out; none if all were.
    pub fn warnings(&self) -> Vec<String> {
        if self.taken == 0 {
            return Vec::new();
        }
        self.groups.iter().map(|group| group.warning(self.given)).collect()
    }

    /// Returns the frames by plugin and input, in the order of their first ones.
    pub fn into_groups(self) -> Vec<LackingFrames> {
        self.groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lacks(frame: u64, input: Input) -> StepError {
        StepError::Lacks { plugin: "legs".into(), frame, input }
    }

    #[test]
    fn frames_are_counted_by_what_they_lack_and_another_error_is_none_of_them() {
        let mut lacking = Lacking::default();
        for (frame, input) in [(3, Input::Laser), (5, Input::Depth), (8, Input::Laser)] {
            assert_eq!(lacking.count(lacks(frame, input)), Ok(()));
        }
        let stopped = StepError::Stopped { frame: 9 };
        assert_eq!(lacking.count(stopped.clone()), Err(stopped));
        assert_eq!(lacking.failure(), Some(&lacks(3, Input::Laser)), "no frame was taken");
        assert_eq!(lacking.warnings(), [""; 0]);
        lacking.given = 20;
        lacking.taken = 17;
        assert_eq!(lacking.failure(), None);
        assert_eq!(
            lacking.warnings(),
            [
                "2 of 20 frames left out, the first is frame 3: they lack laser scans, which `legs` needs",
                "1 of 20 frames left out, the first is frame 5: they lack depth images, which `legs` needs",
            ]
        );
    }
}
