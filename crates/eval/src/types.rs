//! Sequences of frames with people and reports, the input of all metrics.

use serde::{Deserialize, Serialize};

/// An upright rectangle in an image, in pixels; `x`, `y` is the upper left corner.
///
/// It differs from the `Rect` of `tagalong-geometry`: its overlaps agree with the arithmetic of the
/// reference evaluators to the last bit, and a size read from a file may be negative.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Region {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Region {
    /// Creates a rectangle from its upper left corner and its size.
    pub const fn new(x: f64, y: f64, width: f64, height: f64) -> Self {
        Self { x, y, width, height }
    }

    /// Returns the area in square pixels, computed from the edges as the reference evaluators do.
    pub fn area(&self) -> f64 {
        (self.x + self.width - self.x) * (self.y + self.height - self.y)
    }

    /// Returns the area of the intersection in square pixels.
    pub fn intersection(&self, other: &Self) -> f64 {
        let right = (self.x + self.width).min(other.x + other.width);
        let bottom = (self.y + self.height).min(other.y + other.height);
        (right - self.x.max(other.x)).max(0.0) * (bottom - self.y.max(other.y)).max(0.0)
    }

    /// Returns the intersection over union, 0 to 1; 0 where either has no area.
    pub fn iou(&self, other: &Self) -> f64 {
        let common = self.intersection(other);
        if common <= 0.0 {
            return 0.0;
        }
        let own = self.area();
        let others = other.area();
        let union = own + others - common;
        if own > f64::EPSILON && others > f64::EPSILON { common / union } else { 0.0 }
    }

    /// Returns the fraction of this rectangle that `other` covers, 0 to 1.
    pub fn covered_by(&self, other: &Self) -> f64 {
        let area = self.area();
        if area > f64::EPSILON { self.intersection(other) / area } else { 0.0 }
    }

    /// Returns true if all four numbers are finite.
    pub fn is_finite(&self) -> bool {
        [self.x, self.y, self.width, self.height].iter().all(|v| v.is_finite())
    }

    /// Returns true if width and height are above 0; a rectangle without an area has no overlap
    /// with any other.
    pub fn has_area(&self) -> bool {
        self.width > 0.0 && self.height > 0.0
    }
}

/// Role of an annotated object in the scoring.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Has to be found.
    #[default]
    Counts,
    /// Neither a miss nor, when reported, a false positive (too far, too hidden, a reflection, a
    /// person on a poster).
    Ignored,
    /// Can be mistaken for a person, but excuses no report: reporting it is a false positive (a car
    /// in MOT17).
    Bystander,
}

/// An annotated person in one frame.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Truth {
    /// Id, the same in all frames of a sequence.
    pub id: i64,
    /// Region in the image, in pixels; absent if only positions on the floor are annotated.
    pub region: Option<Region>,
    /// Position on the floor, in metres, in any frame that the tracks share.
    pub floor_m: Option<[f64; 2]>,
    /// Role in the scoring.
    pub role: Role,
    /// Visibility of the person from the camera, if it is annotated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<View>,
}

/// Visibility of a person from the camera.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct View {
    /// Visible fraction, 0 to 1.
    pub visible: f64,
    /// Distance from the camera to the head, m.
    pub distance_m: f64,
}

/// A reported person in one frame.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// ID of the track, the same in all frames of a sequence.
    pub id: i64,
    /// Region in the image, in pixels.
    pub region: Option<Region>,
    /// Position on the floor, in metres, in the frame of the truth.
    pub floor_m: Option<[f64; 2]>,
    /// Confidence of the tracker; only the order matters.
    pub score: f64,
}

/// Truth and reports of one moment.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Frame {
    /// Time, in nanoseconds.
    pub stamp_ns: i64,
    /// All annotated people.
    pub truths: Vec<Truth>,
    /// All reported people.
    pub reports: Vec<Report>,
    /// Parts of the image that are not annotated (KITTI's `DontCare`): reports that match no truth
    /// and lie mostly inside are left out.
    pub ignore_regions: Vec<Region>,
}

/// A recording: frames in chronological order.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Sequence {
    /// Name, for messages and tables.
    pub name: String,
    /// All frames, including those without people.
    pub frames: Vec<Frame>,
}

/// Measure for the similarity of a truth and a report: a number from 0 to 1.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Similarity {
    /// Intersection over union of the image regions.
    #[default]
    Iou,
    /// `max(0, 1 - distance / 1 m)` on the floor; a similarity of one half is a distance of half a
    /// metre.
    Metres,
}

impl Similarity {
    /// Returns the similarity of a truth and a report; 0 if either lacks the region or position.
    pub fn between(self, truth: &Truth, report: &Report) -> f64 {
        match self {
            Self::Iou => match (&truth.region, &report.region) {
                (Some(a), Some(b)) => a.iou(b),
                _ => 0.0,
            },
            Self::Metres => match (truth.floor_m, report.floor_m) {
                (Some(a), Some(b)) => (1.0 - distance_m(a, b)).max(0.0),
                _ => 0.0,
            },
        }
    }
}

/// Returns the Euclidean distance of two positions on the floor, in metres.
pub(crate) fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}
