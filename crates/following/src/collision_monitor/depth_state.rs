//! State of a depth camera: the camera of the frames, or a further source.

use std::sync::Arc;

use nalgebra::Point3;
use tagalong_core::{DepthImage, EgoMotion, GreyImage, Track, TrackId};
use tagalong_geometry::Camera;

use super::binned::BinnedHazards;
use super::coverage::Coverage;
use super::footprint::Footprint;
use super::obstacle_memory::ObstacleMemory;
use super::space::SpaceGrid;
use super::sweep::{Hazard, HazardKind};
use super::watchdog::{DepthReference, Watch};
use super::{CollisionMonitorSettings, People};

/// Depth camera: between two images the last one holds, and moves with the robot.
pub(super) struct DepthState {
    memory: ObstacleMemory,
    space: SpaceGrid,
    watch: Watch<DepthReference>,
}

impl DepthState {
    /// Creates the state of a camera that has not delivered yet.
    pub(super) fn new(footprint: Footprint) -> Self {
        Self {
            memory: ObstacleMemory::new(footprint),
            space: SpaceGrid::default(),
            watch: Watch::default(),
        }
    }

    /// Forgets all places, but not that the camera was frozen.
    pub(super) fn clear(&mut self) {
        self.memory.clear();
        self.space = SpaceGrid::default();
        self.watch.clear();
    }

    /// Forgets that the camera was frozen.
    pub(super) fn arm(&mut self) {
        self.watch = Watch::default();
    }

    /// Takes in a new image, if there is one, `motion` after the frame before. Points near the
    /// followed person are not remembered while the person is there.
    pub(super) fn update(
        &mut self,
        settings: &CollisionMonitorSettings,
        image: Option<(&Camera, &Arc<DepthImage>)>,
        motion: &EgoMotion,
        tracks: &[Track],
        target: Option<&Track>,
    ) {
        self.space.advance(motion);
        self.watch.advance(motion);
        let Some((camera, depth)) = image else {
            self.memory.hold(settings, motion);
            return;
        };
        let person = target.map(|track| &track.estimate.person);
        self.memory.update(settings, camera, depth, motion, person);
        self.add_free_space();
        self.watch.add_depth(camera, depth, tracks);
    }

    /// Adds the places that the image shows to be free.
    fn add_free_space(&mut self) {
        let (eye, free_to) = self.memory.free_to();
        let near = self.memory.seen().iter().filter(|point| point.z > 0.0).map(Point3::xy);
        self.space.add(eye, near.chain(self.memory.nearest()), free_to);
    }

    /// Takes in the left image of a stereo pair, whose depth the last image is.
    pub(super) fn excuse_smooth(&mut self, left: &GreyImage) {
        self.memory.excuse_smooth(left);
    }

    /// Remembers other people than the followed one where they were seen last.
    pub(super) fn add_tracks(&mut self, tracks: &[Track], followed: Option<TrackId>) {
        self.memory.add_tracks(tracks, followed);
    }

    /// Adds what the image shows, and what is remembered.
    pub(super) fn add_to(
        &self,
        settings: &CollisionMonitorSettings,
        people: &People<'_>,
        hazards: &mut BinnedHazards,
    ) {
        add_hazards(settings, &self.memory, &self.space, people, hazards);
    }

    /// Returns the directions in which the camera has depth, if it ever delivered.
    pub(super) fn coverage(&self, min_share: f64) -> Option<Coverage> {
        self.memory.coverage(min_share)
    }

    /// Returns true if the last image has too few readings.
    pub(super) fn is_blind(&self, settings: &CollisionMonitorSettings) -> bool {
        self.memory.is_blind(settings)
    }

    /// Returns true if the camera repeats itself, or contradicted the odometry.
    pub(super) fn is_frozen(&self, identical_readings: u32) -> bool {
        self.watch.is_frozen(identical_readings)
    }

    /// Returns true if the frozen camera shows an earlier time now.
    pub(super) fn shows_past(&self, identical_readings: u32) -> bool {
        self.watch.shows_past(identical_readings)
    }
}

/// Adds the things in a depth image, those that are remembered, and those that hide a part of it.
pub(super) fn add_hazards(
    settings: &CollisionMonitorSettings,
    memory: &ObstacleMemory,
    space: &SpaceGrid,
    people: &People<'_>,
    hazards: &mut BinnedHazards,
) {
    let first = hazards.len();
    for point in memory.seen() {
        hazards.add(point.xy(), 1, point.z <= 0.0);
    }
    // Judged by cell, because an image has thousands of points in a few hundred cells.
    hazards.judge_since(first, |at| people.kind(at, space.presence(at)));
    for thing in memory.remembered() {
        // A remembered obstacle was confirmed by many points, so alone it is enough to stop.
        let kind = if thing.is_person { HazardKind::Moves(0.0) } else { HazardKind::Still };
        hazards.push(Hazard { at: thing.at, points: settings.min_points, kind }, thing.is_drop);
    }
    for at in memory.hidden() {
        hazards.push(Hazard { at, points: 1, kind: HazardKind::Still }, false);
    }
}
