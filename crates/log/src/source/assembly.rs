//! Assembly of frames from the messages of any source.

use std::sync::Arc;

use tagalong_core::Input;
use tagalong_geometry::Camera;

use super::assemble::Assembler;
use super::intake::Intake;
use super::mount::robot_frame;
use super::plan::Plan;
use super::{LogFacts, LogFrame};
use crate::camera_info::CalibrationError;
use crate::scan::Type;
use crate::tally::{Tally, is_unusual};
use crate::topics::{slower_words, unpaired};
use crate::walk::{Channel, Message};

/// Sequence of messages.
pub(super) trait Messages {
    /// Returns the next message; `None` at the end.
    fn next_message(&mut self) -> Option<Message<'_>>;
}

/// Converter from messages to frames.
pub(super) struct Assembly {
    pub(super) plan: Plan,
    pub(super) tally: Tally,
    intake: Intake,
    assembler: Assembler,
    ended: bool,
    /// True once the messages without a frame were counted.
    is_closed: bool,
}

impl Assembly {
    pub(super) fn new(plan: Plan, tally: Tally) -> Self {
        Self {
            intake: Intake::new(&plan),
            assembler: Assembler::default(),
            plan,
            tally,
            ended: false,
            is_closed: false,
        }
    }

    /// Returns the topic of the first calibration that changed.
    pub(super) fn changed_calibration(&self) -> Option<&str> {
        self.intake.watch.changed_info()
    }

    /// Returns true for topics with messages that are used.
    pub(super) fn reads(&self, channel: &Channel) -> bool {
        Type::of(&channel.schema_name) == Type::Tf || self.plan.reads(&channel.topic)
    }

    pub(super) fn take(&mut self, message: &Message<'_>) {
        self.intake.take(message, &mut self.tally);
    }

    /// Reads messages up to the next frame; `None` at the end of the messages.
    pub(super) fn read(&mut self, messages: &mut dyn Messages) -> Option<LogFrame> {
        loop {
            let frame = self.next_frame();
            if frame.is_some() || self.ended {
                return frame;
            }
            match messages.next_message() {
                Some(message) => self.take(&message),
                None => self.end(),
            }
        }
    }

    /// Returns the next frame, which no later message can change.
    fn next_frame(&mut self) -> Option<LogFrame> {
        // No frame of the new time may take the messages of the time before a jump of the clock.
        self.intake.settle();
        while let Some((image, next)) = self.intake.frames.pop(self.ended) {
            let plan = &self.plan;
            let intake = &mut self.intake;
            let frame = self.assembler.assemble(plan, &image, next, intake, &mut self.tally);
            self.intake.settle();
            if frame.is_some() {
                return frame;
            }
        }
        // Images that still wait at the end have no partner.
        if self.ended && !self.is_closed {
            self.is_closed = true;
            self.intake.close(&mut self.tally);
            self.tell_unpaired();
        }
        None
    }

    /// Reports why many frames have no image of a second topic, as a loss if they are useless
    /// without it.
    fn tell_unpaired(&mut self) {
        let plan = &self.plan;
        let chosen = &plan.chosen;
        let frames = self.assembler.count();
        let depth = chosen.depth.as_ref().filter(|_| plan.has_second_depth());
        for (input, topic, counter) in [
            (Input::Depth, depth, "colour_without_depth"),
            (Input::Right, chosen.right.as_ref(), "left_without_right"),
        ] {
            let without = self.tally.counters.get(counter).copied().unwrap_or(0);
            let Some(topic) = topic.filter(|_| is_unusual(without, frames)) else { continue };
            let tolerance_s = plan.input.pair_tolerance_s;
            let Some(problem) = unpaired(&plan.scan, plan.primary(), topic, tolerance_s) else {
                if plan.inputs.requires(input)
                    && let Some(words) = slower_words(&plan.scan, plan.primary(), topic)
                {
                    let name = input.name();
                    self.tally.tell_frameless(format!(
                        "{without} of {frames} images make no frame, because no image of {topic} \
                         belongs to them: {words}; record that topic at their rate, or take a \
                         pipeline without {name}"
                    ));
                }
                continue;
            };
            let note = format!(
                "{without} of {frames} frames got no image of {topic} within {:.0} ms: {}; {}",
                1e3 * tolerance_s,
                problem.why,
                problem.remedy
            );
            if plan.inputs.requires(input) {
                self.tally.lose_counted(note);
            } else if plan.inputs.uses(input) && chosen.depth_problem.is_none() {
                self.tally.note(note);
            }
        }
    }

    /// Returns the newest frame with all its images; older ones are skipped and counted.
    pub(super) fn newest_frame(&mut self) -> Option<LogFrame> {
        loop {
            let plan = &self.plan;
            let intake = &mut self.intake;
            let (popped, skipped) = intake.pop_newest(plan);
            self.tally.add("frames_skipped", skipped);
            let (image, next) = popped?;
            intake.settle();
            let frame = self.assembler.assemble(plan, &image, next, intake, &mut self.tally);
            self.intake.settle();
            if frame.is_some() {
                return frame;
            }
        }
    }

    fn end(&mut self) {
        self.ended = true;
        if self.intake.frames.drop_suspect() {
            self.tally.count("late_frames");
        }
    }

    /// Returns true if there are no more messages.
    pub(super) fn has_ended(&self) -> bool {
        self.ended
    }

    /// Returns the first calibration that did not fit its images.
    pub(super) fn misfit(&self) -> Option<&CalibrationError> {
        self.assembler.misfit.as_ref()
    }

    /// Returns the properties of the source, which are complete after the first frame.
    pub(super) fn facts(&self) -> LogFacts {
        let scan = &self.plan.scan;
        let chosen = &self.plan.chosen;
        let camera = self.assembler.camera().map(Arc::as_ref);
        LogFacts {
            path: scan.path.clone(),
            bytes: scan.bytes,
            sha256: scan.sha256.clone(),
            colour_topic: chosen.colour.clone(),
            depth_topic: chosen.depth.clone(),
            right_topic: chosen.right.clone(),
            odometry_topic: chosen.odometry.clone(),
            laser_topic: chosen.sensor(Input::Laser).map(str::to_owned),
            sensor_topics: chosen.named_sensors(),
            obstacle_topics: self.plan.obstacle_topics(),
            calibration_topic: self.plan.calibration_topic().cloned(),
            camera_frame: scan.frame_of(self.plan.primary()).map(str::to_owned),
            robot_frame: robot_frame(scan, &self.plan.input).to_owned(),
            width: camera.map_or(0, |camera| camera.width),
            height: camera.map_or(0, |camera| camera.height),
            focal_px: camera.map_or(0.0, Camera::focal_px),
            baseline_m: self.plan.baseline_m,
            camera_height_m: camera.map_or(0.0, Camera::height_m),
            camera_pitch_down_deg: camera.map_or(0.0, Camera::pitch_down_rad).to_degrees(),
            camera_roll_deg: camera.map_or(0.0, Camera::roll_rad).to_degrees(),
            camera_source: self.plan.mount.source(),
        }
    }
}
