//! Frames of the cameras of a log.

use std::collections::BTreeSet;

use crate::tf::plain;

/// Frames of the cameras of a log, by which detections tell their images.
#[derive(Clone, Debug, Default)]
pub(crate) struct CameraFrames {
    /// Frame of the images that make the frames; empty without one.
    pub(crate) own: String,
    /// Frames of that camera and of those beside it.
    beside: BTreeSet<String>,
    /// Frames of cameras in other places.
    others: BTreeSet<String>,
}

impl CameraFrames {
    /// Returns the frames of cameras beside the own one, and in other places.
    pub(crate) fn new(own: &str, beside: BTreeSet<String>, mut others: BTreeSet<String>) -> Self {
        others.retain(|frame| !beside.contains(frame));
        Self { own: own.to_owned(), beside, others }
    }

    /// Returns true for the frame of a camera of which the log knows nothing.
    pub(crate) fn is_unknown(&self, frame: &str) -> bool {
        let is_camera = frame.contains("optical") && !self.own.is_empty();
        is_camera && !self.beside.contains(plain(frame)) && !self.is_other(frame)
    }

    /// Returns true for the frame of a camera in another place.
    pub(crate) fn is_other(&self, frame: &str) -> bool {
        self.others.contains(plain(frame))
    }
}
