//! Frames of the cameras in a log.

use std::collections::BTreeSet;

use crate::tf::plain;

/// Frames of the cameras in a log, by which detections identify their images.
#[derive(Clone, Debug, Default)]
pub(crate) struct CameraFrames {
    /// Frame of the images from which the frames of the log are made; empty without one.
    pub(crate) own: String,
    /// Frames of that camera and of those mounted beside it.
    beside: BTreeSet<String>,
    /// Frames of cameras at other positions.
    others: BTreeSet<String>,
}

impl CameraFrames {
    /// Sorts the frames of cameras into those beside the own one and those at other positions.
    pub(crate) fn new(own: &str, beside: BTreeSet<String>, mut others: BTreeSet<String>) -> Self {
        others.retain(|frame| !beside.contains(frame));
        Self { own: own.to_owned(), beside, others }
    }

    /// Returns true for the frame of a camera that is not known in the log.
    pub(crate) fn is_unknown(&self, frame: &str) -> bool {
        let is_camera = frame.contains("optical") && !self.own.is_empty();
        is_camera && !self.beside.contains(plain(frame)) && !self.is_other(frame)
    }

    /// Returns true for the frame of a camera at another position.
    pub(crate) fn is_other(&self, frame: &str) -> bool {
        self.others.contains(plain(frame))
    }
}
