//! Further sources of the collision monitor: `[[collision_monitor.sources]]`.

use tagalong_core::{EgoMotion, ObstacleData, ObstacleReading, Track};

use super::binned::BinnedHazards;
use super::coverage::Coverage;
use super::depth_state::DepthState;
use super::footprint::Footprint;
use super::freshness::Freshness;
use super::source_state::{RangeState, ScanState};
use super::{CollisionMonitorSettings, People, SourceKind, SourceSettings};

/// Further source with its newest reading.
pub(super) struct FurtherSource {
    settings: SourceSettings,
    freshness: Freshness,
    state: SourceState,
}

/// State of a source by its kind.
enum SourceState {
    Scan(Box<ScanState>),
    Depth(Box<DepthState>),
    Range(RangeState),
    /// True while it is pressed.
    Bumper(bool),
}

impl FurtherSource {
    /// Creates a source that has not delivered yet.
    pub(super) fn new(settings: SourceSettings, footprint: &Footprint) -> Self {
        let state = match settings.kind {
            SourceKind::Scan => SourceState::Scan(Box::default()),
            SourceKind::Depth => SourceState::Depth(Box::new(DepthState::new(footprint.clone()))),
            SourceKind::Range => SourceState::Range(RangeState::default()),
            SourceKind::Bumper => SourceState::Bumper(false),
        };
        Self { settings, freshness: Freshness::default(), state }
    }

    /// Returns its name in reports.
    pub(super) fn name(&self) -> &str {
        &self.settings.name
    }

    /// Forgets all places, but neither that the source once delivered nor that it was frozen.
    pub(super) fn clear(&mut self) {
        self.freshness.clear();
        match &mut self.state {
            SourceState::Scan(scan) => scan.clear(),
            SourceState::Depth(depth) => depth.clear(),
            SourceState::Range(range) => *range = RangeState::default(),
            SourceState::Bumper(_) => {}
        }
    }

    /// Forgets that the source was frozen.
    pub(super) fn arm(&mut self) {
        match &mut self.state {
            SourceState::Scan(scan) => scan.arm(),
            SourceState::Depth(depth) => depth.arm(),
            SourceState::Range(_) | SourceState::Bumper(_) => {}
        }
    }

    /// Takes in the reading of a frame, if there is one, `motion` after the frame before. One of
    /// another kind than the settings say is none.
    pub(super) fn update(
        &mut self,
        settings: &CollisionMonitorSettings,
        readings: &[ObstacleReading],
        motion: &EgoMotion,
        tracks: &[Track],
        target: Option<&Track>,
    ) {
        let named = readings.iter().find(|reading| *reading.source == *self.settings.name);
        let reading = named.filter(|reading| self.reads(&reading.data));
        let stamped = reading.map(|reading| (reading.stamp, reading.age_s));
        let is_new = self.freshness.update(stamped, motion.dt);
        let data = reading.map(|reading| &reading.data);
        let fresh = data.filter(|_| is_new);
        match (&mut self.state, fresh) {
            (SourceState::Scan(state), Some(ObstacleData::Scan(scan))) => {
                state.update(settings, Some(scan), motion, tracks);
            }
            (SourceState::Scan(state), _) => state.update(settings, None, motion, tracks),
            (SourceState::Depth(state), Some(ObstacleData::Depth { image, camera })) => {
                state.update(settings, Some((camera, image)), motion, tracks, target);
            }
            (SourceState::Depth(state), _) => state.update(settings, None, motion, tracks, target),
            (SourceState::Range(state), Some(ObstacleData::Range(range))) => {
                state.update(Some(range), motion);
            }
            (SourceState::Range(state), _) => state.update(None, motion),
            // A press between two frames is told once, by a reading that need not be new.
            (SourceState::Bumper(is_pressed), _) => {
                *is_pressed = matches!(data, Some(ObstacleData::Bumper(true)));
            }
        }
    }

    /// Returns true for data of the kind of this source.
    fn reads(&self, data: &ObstacleData) -> bool {
        matches!(
            (self.settings.kind, data),
            (SourceKind::Scan, ObstacleData::Scan(_))
                | (SourceKind::Depth, ObstacleData::Depth { .. })
                | (SourceKind::Range, ObstacleData::Range(_))
                | (SourceKind::Bumper, ObstacleData::Bumper(_))
        )
    }

    /// Adds what the source met.
    pub(super) fn add_to(
        &self,
        settings: &CollisionMonitorSettings,
        people: &People<'_>,
        hazards: &mut BinnedHazards,
    ) {
        match &self.state {
            SourceState::Scan(scan) => scan.add_to(settings, people, hazards),
            SourceState::Depth(depth) => depth.add_to(settings, people, hazards),
            SourceState::Range(range) => range.add_to(settings, hazards),
            SourceState::Bumper(_) => {}
        }
    }

    /// Returns the directions in which the source sees something, if it looks and ever delivered.
    pub(super) fn coverage(&self) -> Option<Coverage> {
        let min_share = self.settings.min_share;
        match &self.state {
            SourceState::Scan(scan) => scan.coverage(min_share),
            SourceState::Depth(depth) => depth.coverage(min_share),
            SourceState::Range(range) => range.coverage(min_share),
            SourceState::Bumper(_) => None,
        }
    }

    /// Returns true if the source never delivered, or nothing new for longer than its timeout.
    pub(super) fn is_silent(&self) -> bool {
        self.freshness.is_unknown() || self.freshness.is_silent(self.settings.source_timeout_s)
    }

    /// Returns true for a scanner that sees the way, or a camera: they see a region and not one
    /// direction.
    pub(super) fn is_eye(&self) -> bool {
        match &self.state {
            SourceState::Scan(scan) => scan.is_eye(),
            SourceState::Depth(_) => true,
            SourceState::Range(_) | SourceState::Bumper(_) => false,
        }
    }

    /// Returns true for a bumper that is pressed.
    pub(super) fn is_touched(&self) -> bool {
        matches!(self.state, SourceState::Bumper(true))
    }

    /// Returns true for a depth camera with too few readings.
    pub(super) fn is_blind(&self, settings: &CollisionMonitorSettings) -> bool {
        matches!(&self.state, SourceState::Depth(depth) if depth.is_blind(settings))
    }

    /// Returns true if the source repeats itself, or contradicted the odometry.
    pub(super) fn is_frozen(&self, identical_readings: u32) -> bool {
        match &self.state {
            SourceState::Scan(scan) => scan.is_frozen(identical_readings),
            SourceState::Depth(depth) => depth.is_frozen(identical_readings),
            SourceState::Range(_) | SourceState::Bumper(_) => false,
        }
    }
}
