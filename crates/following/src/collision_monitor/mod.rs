//! Collision monitor: limits of the motion by the sensors of obstacles.
//!
//! It gathers obstacles and people, from the depth image, the laser scan and
//! further sources, checks that these sensors see anything, and that they are not frozen, and returns
//! the largest speed on a path that the robot is about to take.
//!
//! | module | content |
//! |---|---|
//! | `footprint` | outline of the robot, and the paths that it takes |
//! | `obstacle_memory` | things in the depth image, and those that left it |
//! | `space` | places that were seen free: a thing that appears there moves |
//! | `sweep` | speed on a path before things and beside people |
//! | `coverage` | share of valid readings in the swept region: unknown is not free |
//! | `watchdog` | sensors that repeat themselves or contradict the odometry |

mod binned;
mod coverage;
mod footprint;
mod ground;
mod obstacle_memory;
mod settings;
mod source_state;
mod sources;
mod space;
mod sweep;
mod watchdog;

use std::collections::BTreeMap;
use std::sync::Arc;

use binned::BinnedHazards;
use coverage::Coverage;
pub(crate) use footprint::{Footprint, Path};
use nalgebra::{Point2, Point3};
use obstacle_memory::{CARRIED_M, ObstacleMemory};
pub use settings::{CollisionMonitorSettings, NoReturn, ObstacleSource};
use source_state::{RangeState, ScanState, Silence};
pub use sources::{SourceKind, SourceSettings};
use space::{Presence, SpaceGrid};
pub(crate) use sweep::{Allowance, Braking, reach_m};
use sweep::{Hazard, HazardKind, allowance};
use tagalong_core::{
    EgoMotion, Frame, ObstacleData, ObstacleReading, ObstacleReadings, Reason, Track, TrackId,
};
use watchdog::{DepthReference, Watch};

use crate::RobotSettings;

/// Least length of the way of which the sensors must see enough, m.
const LOOKED_AT_M: f64 = 1.0;
/// Distance from a person within which points belong to them, m.
const PERSON_M: f64 = 0.4;
/// Radius of the body of a person, m.
const BODY_M: f64 = 0.2;
/// Time without a detection after which a track no longer says where its points are, s.
const FRESH_S: f64 = 0.3;
/// Time without a detection after which a track is no hazard of its own, s; its last place is
/// remembered.
const PREDICTED_S: f64 = 1.0;
/// Speed that is added to the measured one of a person, m/s: it is that uncertain.
const UNSURE_MPS: f64 = 0.2;

/// Collision monitor; see the [module](self).
pub(crate) struct CollisionMonitor {
    settings: CollisionMonitorSettings,
    footprint: Footprint,
    memory: ObstacleMemory,
    depth_space: SpaceGrid,
    depth_watch: Watch<DepthReference>,
    depth_silence: Silence,
    laser: ScanState,
    /// Further sources, by name.
    scans: BTreeMap<Arc<str>, ScanState>,
    depths: BTreeMap<Arc<str>, FurtherDepth>,
    ranges: BTreeMap<Arc<str>, RangeState>,
    /// Age of the newest reading of each further source, s.
    ages_s: BTreeMap<Arc<str>, f64>,
    is_touched: bool,
    hazards: BinnedHazards,
    coverages: Vec<Coverage>,
}

/// Depth camera beside that of the frames.
struct FurtherDepth {
    memory: ObstacleMemory,
    space: SpaceGrid,
    watch: Watch<DepthReference>,
}

impl CollisionMonitor {
    pub(crate) fn new(settings: CollisionMonitorSettings, robot: &RobotSettings) -> Self {
        let footprint = Footprint::new(&robot.footprint);
        Self {
            memory: ObstacleMemory::new(footprint.clone()),
            footprint,
            depth_space: SpaceGrid::default(),
            depth_watch: Watch::default(),
            depth_silence: Silence::default(),
            laser: ScanState::default(),
            scans: BTreeMap::new(),
            depths: BTreeMap::new(),
            ranges: BTreeMap::new(),
            ages_s: BTreeMap::new(),
            is_touched: false,
            hazards: BinnedHazards::default(),
            coverages: Vec::new(),
            settings,
        }
    }

    /// Forgets all places, after a jump of the clock, but not which sensors there are.
    pub(crate) fn clear(&mut self) {
        self.memory.clear();
        self.depth_space = SpaceGrid::default();
        self.depth_watch = Watch::default();
        self.laser.clear();
        self.scans.values_mut().for_each(ScanState::clear);
        self.depths.clear();
        self.ranges.clear();
        self.hazards.clear();
    }

    /// Forgets that a sensor was frozen, after a person has checked the robot.
    pub(crate) fn arm(&mut self) {
        self.depth_watch = Watch::default();
        self.laser.arm();
        self.scans.values_mut().for_each(ScanState::arm);
        self.depths.values_mut().for_each(|depth| depth.watch = Watch::default());
    }

    /// Takes in a frame, `motion` after the one before, in which `followed` is the target.
    pub(crate) fn update(
        &mut self,
        frame: &Frame,
        motion: &EgoMotion,
        tracks: &[Track],
        followed: Option<TrackId>,
    ) {
        let target = tracks.iter().find(|track| Some(track.id) == followed);
        self.hazards.begin(&self.settings, &self.footprint);
        self.coverages.clear();
        self.update_depth(frame, motion, tracks, target);
        let people = People { settings: &self.settings, tracks, target };
        let hazards = &mut self.hazards;
        add_depth_hazards(&self.settings, &self.memory, &self.depth_space, &people, hazards);
        if frame.depth().is_ok() {
            self.coverages.push(self.memory.coverage(self.settings.min_share));
        }
        self.laser.update(&self.settings, frame.laser(), motion, tracks);
        self.laser.add_to(&self.settings, &people, hazards);
        self.coverages.extend(self.laser.coverage(self.settings.min_share));
        let further = frame.sensor::<ObstacleReadings>().ok();
        self.update_sources(further, motion, tracks, target);
        let people = People { settings: &self.settings, tracks, target };
        people.add_to(&mut self.hazards);
    }

    fn update_depth(
        &mut self,
        frame: &Frame,
        motion: &EgoMotion,
        tracks: &[Track],
        target: Option<&Track>,
    ) {
        let depth = frame.depth().ok();
        let camera = &frame.camera;
        let person = target.map(|track| &track.estimate.person);
        self.depth_silence.update(depth.is_some(), motion.dt);
        self.memory.update(&self.settings, camera, depth, motion, person);
        if let (Ok(left), true) = (frame.grey(), frame.right().is_ok()) {
            self.memory.excuse_smooth(left);
        }
        self.depth_space.advance(motion);
        if let Some(depth) = depth {
            add_free_space(&self.memory, &mut self.depth_space);
            self.depth_watch.add_depth(camera, depth, motion, tracks);
        }
        self.memory.add_tracks(tracks, target.map(|track| track.id));
    }

    /// Takes in the further sources. One that delivers nothing with this frame keeps its last reading.
    fn update_sources(
        &mut self,
        readings: Option<&ObstacleReadings>,
        motion: &EgoMotion,
        tracks: &[Track],
        target: Option<&Track>,
    ) {
        for age_s in self.ages_s.values_mut() {
            *age_s += motion.dt.max(0.0);
        }
        let readings = readings.map_or(&[][..], |readings| &readings.0);
        let find = |name: &str| readings.iter().find(|reading| &*reading.source == name);
        let people = People { settings: &self.settings, tracks, target };
        let person = target.map(|track| &track.estimate.person);
        self.is_touched = false;
        for source in &self.settings.sources {
            let reading = find(&source.name);
            let name: Arc<str> = source.name.as_str().into();
            if let Some(ObstacleReading { age_s, .. }) = reading {
                self.ages_s.insert(Arc::clone(&name), *age_s);
            }
            let data = reading.map(|reading| &reading.data);
            match source.kind {
                SourceKind::Scan => {
                    let scan = match data {
                        Some(ObstacleData::Scan(scan)) => Some(scan),
                        _ => None,
                    };
                    let state = self.scans.entry(name).or_default();
                    state.update(&self.settings, scan, motion, tracks);
                    state.add_to(&self.settings, &people, &mut self.hazards);
                    self.coverages.extend(state.coverage(source.min_share));
                }
                SourceKind::Depth => {
                    let footprint = &self.footprint;
                    let state = self.depths.entry(name).or_insert_with(|| FurtherDepth {
                        memory: ObstacleMemory::new(footprint.clone()),
                        space: SpaceGrid::default(),
                        watch: Watch::default(),
                    });
                    state.space.advance(motion);
                    if let Some(ObstacleData::Depth { image, camera }) = data {
                        state.memory.update(&self.settings, camera, Some(image), motion, person);
                        add_free_space(&state.memory, &mut state.space);
                        state.watch.add_depth(camera, image, motion, tracks);
                        self.coverages.push(state.memory.coverage(source.min_share));
                    }
                    let hazards = &mut self.hazards;
                    let FurtherDepth { memory, space, .. } = state;
                    add_depth_hazards(&self.settings, memory, space, &people, hazards);
                }
                SourceKind::Range => {
                    let reading = match data {
                        Some(ObstacleData::Range(reading)) => Some(reading),
                        _ => None,
                    };
                    let state = self.ranges.entry(name).or_default();
                    state.update(reading, motion);
                    state.add_to(&self.settings, &mut self.hazards);
                    self.coverages.extend(state.coverage(source.min_share));
                }
                SourceKind::Bumper => {
                    self.is_touched |= matches!(data, Some(ObstacleData::Bumper(true)));
                }
            }
        }
    }

    /// Returns the reason for which the robot must stand, if there is one; no sensor may be silent for
    /// longer than `patience_s`.
    pub(crate) fn stop_reason(&self, patience_s: f64) -> Option<Reason> {
        if self.is_touched {
            return Some(Reason::Contact);
        }
        if self.settings.obstacles == ObstacleSource::None {
            return None;
        }
        if !self.is_sighted(patience_s) || self.memory.is_blind(&self.settings) {
            return Some(Reason::Blind);
        }
        let most = if self.settings.noiseless { 0 } else { self.settings.identical_frames };
        let depth_watches = self.depths.values().map(|depth| &depth.watch);
        let scans = self.scans.values().chain([&self.laser]);
        let is_frozen = self.depth_watch.is_frozen(most)
            || depth_watches.into_iter().any(|watch| watch.is_frozen(most))
            || scans.into_iter().any(|scan| scan.is_frozen(most));
        is_frozen.then_some(Reason::Frozen)
    }

    /// Returns true if one of the sensors delivered with this frame, none that ever did has been
    /// silent for too long, and each configured source delivers.
    fn is_sighted(&self, patience_s: f64) -> bool {
        let silences = [self.depth_silence, self.laser.silence()];
        let depth_or_laser = silences.iter().any(|silence| silence.delivers());
        let in_time = silences.iter().all(|silence| silence.is_within(patience_s));
        let mut eyes = depth_or_laser;
        for source in &self.settings.sources {
            let age_s = self.ages_s.get(source.name.as_str()).copied().unwrap_or(f64::INFINITY);
            // Positive comparison, so that an age that is no number counts as silence.
            let delivers = age_s <= source.source_timeout_s;
            if !delivers {
                return false;
            }
            eyes |= matches!(source.kind, SourceKind::Scan | SourceKind::Depth);
        }
        eyes && in_time
    }

    /// Returns the largest speeds, up to `speed`, on a path.
    pub(crate) fn allowance(&self, path: Path, speed: f64, braking: &Braking) -> Allowance {
        if self.settings.obstacles == ObstacleSource::None {
            return Allowance::FREE;
        }
        let hazards = self.hazards.all();
        let by_hazards = allowance(&self.settings, &self.footprint, hazards, path, speed, braking);
        by_hazards.and(self.by_coverage(path, speed, braking))
    }

    fn by_coverage(&self, path: Path, speed: f64, braking: &Braking) -> Allowance {
        let way = match path {
            // Also before a robot that creeps: things right before it lie in all directions.
            Path::Arc { .. } => (braking.farthest(speed) + self.settings.stop_m).max(LOOKED_AT_M),
            Path::Turn { .. } => 0.0,
        };
        let part = coverage::allowed_part(&self.coverages, &self.footprint, path, way);
        if part >= 1.0 {
            return Allowance::FREE;
        }
        let most = part * speed;
        Allowance { gentle: most, most, slower: Reason::Unclear, stops: Reason::Unknown }
    }
}

/// Adds the places that a depth image shows to be free.
fn add_free_space(memory: &ObstacleMemory, space: &mut SpaceGrid) {
    let (eye, free_to) = memory.free_to();
    let near = memory.seen().iter().filter(|point| point.z > 0.0).map(Point3::xy);
    space.add(eye, near.chain(memory.nearest()), free_to);
}

/// Adds the things in a depth image, those that are remembered, and those that hide a part of it.
fn add_depth_hazards(
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

/// People around the robot, to judge the motion of a point.
struct People<'a> {
    settings: &'a CollisionMonitorSettings,
    tracks: &'a [Track],
    target: Option<&'a Track>,
}

impl People<'_> {
    /// Returns the motion to expect of a thing at a place.
    fn kind(&self, at: &Point2<f64>, presence: Presence) -> HazardKind {
        if let Some(target) = self.target.filter(|target| target.unseen_s <= FRESH_S) {
            let away_m = (place(target) - at).norm();
            if away_m < self.settings.target_radius_m {
                return HazardKind::Followed(closing_mps(target));
            }
            // A thing that moves beside the followed person is carried, pulled or pushed.
            if away_m < CARRIED_M && matches!(presence, Presence::Appeared | Presence::New) {
                return HazardKind::Followed(closing_mps(target) + UNSURE_MPS);
            }
        }
        if !self.settings.separation {
            return HazardKind::Still;
        }
        let others = self.tracks.iter().filter(|track| track.unseen_s <= FRESH_S);
        for track in others {
            let is_target = self.target.is_some_and(|target| target.id == track.id);
            if !is_target && track.confirmed && (place(track) - at).norm() < PERSON_M {
                return HazardKind::Moves(closing_mps(track) + UNSURE_MPS);
            }
        }
        match presence {
            Presence::Stands => HazardKind::Still,
            // A person in a new place is seen to move in the next frame.
            Presence::New => HazardKind::Still,
            // A person that came and stands, for example, may walk on.
            Presence::Parked => HazardKind::Moves(0.0),
            Presence::Appeared => HazardKind::Moves(self.settings.people_mps),
        }
    }

    /// Adds the people themselves, also where no point of theirs is in view.
    fn add_to(&self, hazards: &mut BinnedHazards) {
        let points = self.settings.min_points;
        for track in self.tracks.iter().filter(|track| track.confirmed) {
            let is_target = self.target.is_some_and(|target| target.id == track.id);
            if track.unseen_s > PREDICTED_S && !is_target {
                continue;
            }
            let kind = if is_target {
                HazardKind::Followed(closing_mps(track))
            } else if self.settings.separation {
                HazardKind::Moves(closing_mps(track) + UNSURE_MPS)
            } else {
                continue;
            };
            let middle = place(track);
            let away_m = middle.coords.norm();
            let part = if away_m > BODY_M { 1.0 - BODY_M / away_m } else { 1.0 };
            hazards.push(Hazard { at: middle * part, points, kind }, false);
        }
    }
}

fn place(track: &Track) -> Point2<f64> {
    track.estimate.person.position.xy()
}

/// Returns the speed at which a person comes nearer to the robot, m/s.
fn closing_mps(track: &Track) -> f64 {
    let at = place(track).coords;
    let distance_m = at.norm();
    if distance_m > 0.01 { -track.estimate.person.velocity.dot(&at) / distance_m } else { 0.0 }
}

#[cfg(test)]
mod tests;
