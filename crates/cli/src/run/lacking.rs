//! Frames that lack an input which a plugin requires: left out and counted.

use serde::Serialize;
use tagalong_core::Input;
use tagalong_math::counted;
use tagalong_pipeline::StepError;

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
    pub fn warning(&self, read: u64) -> String {
        let Self { plugin, first_frame, frames, kind, .. } = self;
        format!(
            "{frames} of {} left out, the first is frame {first_frame}: they lack {kind}, which `{plugin}` \
             needs",
            counted(read, "frame")
        )
    }
}

/// Counts of a run.
#[derive(Default)]
pub struct Lacking {
    groups: Vec<LackingFrames>,
    first: Option<StepError>,
}

impl Lacking {
    /// Counts a frame. Gives back an error that is not about a missing input.
    pub fn count(&mut self, error: StepError) -> Result<(), StepError> {
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

    /// Returns the error of the first of these frames.
    pub fn first_error(&self) -> Option<StepError> {
        self.first.clone()
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
        assert_eq!(lacking.first_error(), Some(lacks(3, Input::Laser)));
        let warnings: Vec<String> =
            lacking.into_groups().iter().map(|group| group.warning(20)).collect();
        assert_eq!(
            warnings,
            [
                "2 of 20 frames left out, the first is frame 3: they lack laser scans, which `legs` needs",
                "1 of 20 frames left out, the first is frame 5: they lack depth images, which `legs` needs",
            ]
        );
    }
}
