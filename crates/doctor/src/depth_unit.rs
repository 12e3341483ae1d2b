//! Assessment of the unit of depth, which several checks need.

use tagalong_vision::ground::{Ground, PLAUSIBLE_FACTORS};
use tagalong_vision::quality::DepthQuality;

use super::finding::Severity;

/// Quality of the depth images, and the assessment of their unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JudgedDepth {
    /// Statistics of the readings.
    pub quality: DepthQuality,
    /// Factor by which depth has to be multiplied so that the height of the floor agrees with the
    /// mount of the camera; `None` if it cannot be measured.
    pub measured_factor: Option<f64>,
    /// Evidence on the unit.
    pub unit: Unit,
}

/// Evidence on the unit of depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// There is no evidence against the unit.
    Plausible,
    /// The height of the floor agrees with the known height of the camera if readings are
    /// multiplied by this.
    Measured(f64),
    /// The height of the camera is unknown, and the distance of the floor below it is implausible
    /// for a robot.
    OffFloor(Ground),
    /// The height of the camera is unknown; the floor is at a plausible distance below it, but
    /// readings are smaller or larger than usual.
    NearFloor(Ground),
    /// No floor is visible, and the readings are implausible for any room.
    OffMedian,
    /// No floor is visible, and the readings are smaller or larger than usual.
    Unusual,
}

impl Unit {
    /// Returns the assessment for a factor by which readings have to be multiplied.
    pub fn by_factor(factor: f64) -> Self {
        if PLAUSIBLE_FACTORS.contains(&factor) { Self::Plausible } else { Self::Measured(factor) }
    }

    /// Returns the severity.
    pub fn severity(self) -> Severity {
        match self {
            Self::Plausible | Self::NearFloor(_) => Severity::Ok,
            Self::Unusual => Severity::Warn,
            Self::Measured(_) | Self::OffFloor(_) | Self::OffMedian => Severity::Bad,
        }
    }
}
