//! Judgement of the unit of depth, which several checks need.

use tagalong_vision::ground::{Ground, PLAUSIBLE_FACTORS};
use tagalong_vision::quality::DepthQuality;

use super::finding::Severity;

/// Quality of the depth images, and the judgement of their unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JudgedDepth {
    /// Statistics of the readings.
    pub quality: DepthQuality,
    /// Factor by which depth has to be multiplied for the floor to lie where the mount of the camera says;
    /// `None` where it cannot be measured.
    pub measured_factor: Option<f64>,
    /// Evidence on the unit.
    pub unit: Unit,
}

/// Evidence on the unit of depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// Nothing speaks against it.
    Plausible,
    /// The floor lies where the height of the camera, which is known, says with readings times this.
    Measured(f64),
    /// The floor lies as far below a camera of unknown height as below no robot's.
    OffFloor(Ground),
    /// The floor lies as far below a camera of unknown height as below that of a robot, and what is
    /// seen is nearer or farther than usual.
    NearFloor(Ground),
    /// No floor is seen, and the readings are those of no room.
    OffMedian,
    /// No floor is seen, and the readings are nearer or farther than usual.
    Unusual,
}

impl Unit {
    /// Returns the judgement of a factor by which readings have to be multiplied.
    pub fn by_factor(factor: f64) -> Self {
        if PLAUSIBLE_FACTORS.contains(&factor) { Self::Plausible } else { Self::Measured(factor) }
    }

    /// Returns how serious it is.
    pub fn severity(self) -> Severity {
        match self {
            Self::Plausible | Self::NearFloor(_) => Severity::Ok,
            Self::Unusual => Severity::Warn,
            Self::Measured(_) | Self::OffFloor(_) | Self::OffMedian => Severity::Bad,
        }
    }
}
