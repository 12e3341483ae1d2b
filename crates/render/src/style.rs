//! Colours and amount of detail of pictures.

use tagalong_core::{Track, TrackId};
use tagalong_geometry::Rect;
use tagalong_log::write::{BoxedPart, track_colour};

use super::canvas::Ink;
use super::data::OverlayData;

/// Content of the pictures of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OverlayStyle {
    /// Amount of detail beside people and their trails.
    pub detail: Detail,
    /// Part of a person that boxes enclose.
    pub boxes: BoxedPart,
    /// Reach of the plan ahead of the robot, m; at least 8.
    pub reach_m: u16,
}

/// Least reach of the plan ahead of the robot, m.
pub(crate) const LEAST_REACH_M: u16 = 8;

/// Largest reach of the plan, m: beyond it, people would be only a few pixels apart.
const MOST_REACH_M: u16 = 30;

/// Parts that a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detail {
    /// Only confirmed people: box, ID, distance, trail, silhouette.
    #[default]
    People,
    /// Also dropped candidates with their tests, tentative tracks and the state of the filter.
    Debug,
}

impl OverlayStyle {
    /// Returns the style that shows dropped candidates and the state of the filter.
    pub fn debug(boxes: BoxedPart) -> Self {
        Self { detail: Detail::Debug, boxes, ..Self::default() }
    }

    /// Returns the style with a plan that reaches as far as a pipeline detects people.
    #[must_use]
    pub fn reaching(self, metres: f64) -> Self {
        // Every second line of the plan has a number.
        let reach_m = 2.0 * (metres / 2.0).ceil();
        let reach_m = (reach_m as u16).clamp(LEAST_REACH_M, MOST_REACH_M);
        Self { reach_m, ..self }
    }

    pub(super) fn is_debug(self) -> bool {
        self.detail == Detail::Debug
    }

    /// Returns the tracks that the style shows, nearest first.
    pub(super) fn tracks(self, scene: &OverlayData) -> impl DoubleEndedIterator<Item = &Track> {
        scene.report.tracks.iter().filter(move |track| track.confirmed || self.is_debug())
    }

    /// Returns the box of a track in the image, pixels.
    pub(super) fn region(self, scene: &OverlayData, track: &Track) -> Rect {
        match self.boxes {
            BoxedPart::Upper => track.estimate.region,
            BoxedPart::Full => {
                scene.camera.whole_body(&track.estimate.region, &track.estimate.person.position)
            }
        }
    }
}

/// Colour of everything that is not a confirmed track.
pub(crate) const TENTATIVE: Ink = Ink::solid([190, 190, 190]);

/// Returns the colour of a track: grey until it is confirmed, and in a frozen image.
pub(crate) fn colour(scene: &OverlayData, track: &Track) -> Ink {
    if track.confirmed && !scene.shows_past() { colour_of(track.id) } else { TENTATIVE }
}

/// Returns the colour of the tracks of an ID.
pub(crate) fn colour_of(id: TrackId) -> Ink {
    Ink::solid(track_colour(id))
}
