//! Collision monitor: limits the motion of the robot by what the obstacle sensors see.
//!
//! It collects obstacles and people from the depth image, the laser scan and further sources,
//! checks that these sensors deliver readings and are not frozen, and returns the largest speed on
//! a path that the robot is about to take.
//!
//! | module | content |
//! |---|---|
//! | `footprint` | outline of the robot, and the paths that it takes |
//! | `depth_state`, `source_state` | state of a depth camera, a scanner and a range sensor |
//! | `further_source` | a source of the settings, by its kind |
//! | `freshness` | which reading is new, and how old the newest one is |
//! | `obstacle_memory` | obstacles in the depth image, and those that have left it |
//! | `pixel_rays` | viewing rays of the pixels of a depth camera |
//! | `space` | space that was seen free: an object that appears there is moving |
//! | `sweep` | speed on a path, limited by obstacles and people |
//! | `coverage` | share of valid readings in the swept region: unknown is not free |
//! | `zones` | stop and slowdown polygons |
//! | `watchdog` | sensors that repeat their data or contradict the odometry |

mod binned;
mod coverage;
mod depth_state;
mod footprint;
mod freshness;
mod further_source;
mod ground;
mod obstacle_memory;
mod pixel_rays;
mod settings;
mod source_state;
mod sources;
mod space;
mod sweep;
mod watchdog;
mod zones;

use binned::BinnedHazards;
use coverage::Coverage;
use depth_state::DepthState;
pub(crate) use footprint::{Footprint, Path};
use freshness::Freshness;
use further_source::FurtherSource;
use nalgebra::Point2;
use obstacle_memory::CARRIED_M;
pub use settings::{CollisionMonitorSettings, NoReturn, ObstacleSource};
use source_state::ScanState;
pub use sources::{SourceKind, SourceSettings};
use space::Presence;
pub(crate) use sweep::{Allowance, Braking, reach_m};
use sweep::{Hazard, HazardKind, allowance};
use tagalong_core::{
    CameraImage, DepthImage, EgoMotion, Frame, Input, ObstacleReadings, Reason, Track, TrackId,
};
use watchdog::{NoReference, Watch};
use zones::Zones;

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

/// Place of a thing or a person that the collision monitor counts in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObstaclePoint {
    /// Place in the robot frame, m.
    pub at: Point2<f64>,
    /// True for a person, or for a thing that moves.
    pub moves: bool,
}

/// Collision monitor; see the [module](self).
pub(crate) struct CollisionMonitor {
    settings: CollisionMonitorSettings,
    footprint: Footprint,
    /// Camera of the frames.
    depth: DepthState,
    depth_age: Freshness,
    /// Watch over the colour or grey image, by which people are detected and known again.
    picture: Watch<NoReference>,
    /// Scanner of the frames.
    laser: ScanState,
    laser_age: Freshness,
    /// Further scanners of the frames, in the order of the frames.
    further_lasers: Vec<(ScanState, Freshness)>,
    sources: Vec<FurtherSource>,
    hazards: BinnedHazards,
    zones: Zones,
    coverages: Vec<Coverage>,
}

impl CollisionMonitor {
    pub(crate) fn new(settings: CollisionMonitorSettings, robot: &RobotSettings) -> Self {
        let footprint = Footprint::new(&robot.footprint);
        let sources = settings.sources.iter().cloned();
        Self {
            depth: DepthState::new(footprint.clone()),
            depth_age: Freshness::default(),
            picture: Watch::default(),
            laser: ScanState::default(),
            laser_age: Freshness::default(),
            further_lasers: Vec::new(),
            sources: sources.map(|source| FurtherSource::new(source, &footprint)).collect(),
            hazards: BinnedHazards::default(),
            zones: Zones::new(&settings),
            coverages: Vec::new(),
            footprint,
            settings,
        }
    }

    /// Forgets all positions after a jump of the clock: each sensor counts as silent until its next new
    /// reading. Which sensors there are, and that one was frozen, is not forgotten.
    pub(crate) fn clear(&mut self) {
        self.depth.clear();
        self.depth_age.clear();
        self.laser.clear();
        self.laser_age.clear();
        for (laser, age) in &mut self.further_lasers {
            laser.clear();
            age.clear();
        }
        for source in &mut self.sources {
            source.clear();
        }
        self.hazards.clear();
    }

    /// Forgets that a sensor was frozen, after a person has checked the robot.
    pub(crate) fn arm(&mut self) {
        self.depth.arm();
        self.picture = Watch::default();
        self.laser.arm();
        for (laser, _) in &mut self.further_lasers {
            laser.arm();
        }
        for source in &mut self.sources {
            source.arm();
        }
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
        self.update_depth(frame, motion, tracks, target);
        self.picture.add_picture(&frame.images());
        self.update_laser(frame, motion, tracks);
        let readings = frame.sensor::<ObstacleReadings>();
        let readings = readings.map_or(&[][..], |readings| &readings.0);
        for source in &mut self.sources {
            source.update(&self.settings, readings, motion, tracks, target);
        }
        let people = People { settings: &self.settings, tracks, target };
        let hazards = &mut self.hazards;
        hazards.begin(&self.settings, &self.footprint);
        self.coverages.clear();
        self.depth.add_to(&self.settings, &people, hazards);
        self.coverages.extend(self.depth.coverage(self.settings.min_share));
        self.laser.add_to(&self.settings, &people, hazards);
        self.coverages.extend(self.laser.coverage(self.settings.min_share));
        for (laser, _) in &self.further_lasers {
            laser.add_to(&self.settings, &people, hazards);
            self.coverages.extend(laser.coverage(self.settings.min_share));
        }
        for source in &self.sources {
            source.add_to(&self.settings, &people, hazards);
            self.coverages.extend(source.coverage());
        }
        people.add_to(hazards);
        self.zones.update(hazards.all());
    }

    fn update_depth(
        &mut self,
        frame: &Frame,
        motion: &EgoMotion,
        tracks: &[Track],
        target: Option<&Track>,
    ) {
        let taken = frame.sensor::<CameraImage<DepthImage>>().ok();
        // A frame is made of its images, so that each of them is new with it.
        self.depth_age.update(taken.map(|_| (frame.stamp, 0.0)), motion.dt);
        if frame.expected.uses(Input::Depth) {
            self.depth_age.expect();
        }
        let image = taken.map(|taken| (&*frame.camera, &taken.image));
        self.depth.update(&self.settings, image, motion, tracks, target);
        if taken.is_some()
            && frame.right().is_ok()
            && let Ok(left) = frame.grey()
        {
            self.depth.excuse_smooth(left);
        }
        self.depth.add_tracks(tracks, target.map(|track| track.id));
    }

    fn update_laser(&mut self, frame: &Frame, motion: &EgoMotion, tracks: &[Track]) {
        let scan = frame.laser();
        let stamp = scan.map(|scan| scan.stamp.unwrap_or(frame.stamp));
        // A scan of after its frame is as new as it can be.
        let stamped = stamp.map(|stamp| (stamp, frame.stamp.seconds_since(stamp).max(0.0)));
        let is_new = self.laser_age.update(stamped, motion.dt);
        if frame.expected.uses(Input::Laser) {
            self.laser_age.expect();
        }
        self.laser.update(&self.settings, scan.filter(|_| is_new), motion, tracks);
        self.update_further_lasers(frame, motion, tracks);
    }

    /// Takes in the scans of further scanners, each of which has a memory of its own. One that no
    /// frame mentions any more grows old like one that is silent.
    fn update_further_lasers(&mut self, frame: &Frame, motion: &EgoMotion, tracks: &[Track]) {
        let scans = frame.further_scans();
        let known = self.further_lasers.len().max(scans.len());
        self.further_lasers.resize_with(known, Default::default);
        for (place, (laser, age)) in self.further_lasers.iter_mut().enumerate() {
            let scan = scans.get(place).and_then(Option::as_ref);
            let stamp = scan.map(|scan| scan.stamp.unwrap_or(frame.stamp));
            let stamped = stamp.map(|stamp| (stamp, frame.stamp.seconds_since(stamp).max(0.0)));
            let is_new = age.update(stamped, motion.dt);
            // The source of the frames names each scanner that it reads.
            age.expect();
            laser.update(&self.settings, scan.filter(|_| is_new), motion, tracks);
        }
    }

    /// Returns the places that count in the last frame, but for those of the followed person.
    pub(crate) fn obstacles(&self) -> Vec<ObstaclePoint> {
        let mut obstacles = Vec::new();
        for hazard in self.hazards.all() {
            let moves = match hazard.kind {
                HazardKind::Still => false,
                HazardKind::Moves(_) => true,
                HazardKind::Followed(_) => continue,
            };
            obstacles.push(ObstaclePoint { at: hazard.at, moves });
        }
        obstacles
    }

    /// Returns the reason for which the robot must stand, if there is one; no sensor may be silent for
    /// longer than `patience_s`.
    pub(crate) fn stop_reason(&self, patience_s: f64) -> Option<Reason> {
        if self.sources.iter().any(FurtherSource::is_touched) {
            return Some(Reason::Contact);
        }
        if self.settings.obstacles == ObstacleSource::None {
            return None;
        }
        if self.is_silent(patience_s) {
            return Some(Reason::Silent);
        }
        if !self.has_eyes() || self.is_blind() {
            return Some(Reason::Blind);
        }
        if self.frozen_sensor().is_some() {
            return Some(Reason::Frozen);
        }
        self.zones.stop_reason()
    }

    /// Returns the sensor that is frozen, by name, and true if that lasts until the robot is armed
    /// again.
    pub(crate) fn frozen_sensor(&self) -> Option<(String, bool)> {
        // One that only repeats itself is free again with the next reading, and hides no other.
        if let Some(name) = self.first_frozen(0) {
            return Some((name, true));
        }
        self.first_frozen(self.most_identical()).map(|name| (name, false))
    }

    /// Returns true if the images are frozen and show an earlier time now.
    pub(crate) fn shows_past(&self) -> bool {
        let most = self.most_identical();
        self.depth.shows_past(most) || self.picture.shows_past(most)
    }

    /// Returns the number of identical readings from which on a sensor is frozen; 0 for none.
    fn most_identical(&self) -> u32 {
        if self.settings.noiseless { 0 } else { self.settings.identical_frames }
    }

    /// Returns the name of the first sensor that contradicted the odometry or, where `most` is not 0,
    /// repeated itself so many times.
    fn first_frozen(&self, most: u32) -> Option<String> {
        if self.depth.is_frozen(most) {
            return Some("the depth image".to_owned());
        }
        if self.picture.is_frozen(most) {
            return Some("the colour image".to_owned());
        }
        if self.laser.is_frozen(most) {
            return Some("the laser scanner".to_owned());
        }
        for (place, (laser, _)) in self.further_lasers.iter().enumerate() {
            if laser.is_frozen(most) {
                return Some(format!("laser scanner {}", place + 2));
            }
        }
        let source = self.sources.iter().find(|source| source.is_frozen(most))?;
        Some(format!("the source `{}`", source.name()))
    }

    /// Returns the nearest place inside the polygon that this reason comes from, with its distance from
    /// the robot, m.
    pub(crate) fn place_in_zone(&self, reason: Reason) -> Option<(Point2<f64>, f64)> {
        let inside = self.zones.places_inside(reason, self.hazards.all());
        let distances = inside.into_iter().map(|at| (at, self.footprint.distance_m(&at)));
        distances.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Returns the factor of the speed, and its reason, if something is in the slowdown polygon.
    pub(crate) fn slowdown(&self) -> Option<(f64, Reason)> {
        if self.settings.obstacles == ObstacleSource::None {
            return None;
        }
        Some((self.settings.slowdown_ratio, self.zones.slowdown_reason()?))
    }

    /// Returns true if a sensor that once delivered or is expected to, or a configured source, is
    /// silent.
    fn is_silent(&self, patience_s: f64) -> bool {
        self.depth_age.is_silent(patience_s)
            || self.laser_age.is_silent(patience_s)
            || self.further_lasers.iter().any(|(_, age)| age.is_silent(patience_s))
            || self.sources.iter().any(FurtherSource::is_silent)
    }

    /// Returns true if the frame has depth or a scan, or a source sees obstacles.
    fn has_eyes(&self) -> bool {
        self.depth_age.delivers()
            || self.laser_age.delivers() && self.laser.is_eye()
            || self.further_lasers.iter().any(|(laser, age)| age.delivers() && laser.is_eye())
            || self.sources.iter().any(FurtherSource::is_eye)
    }

    fn is_blind(&self) -> bool {
        self.depth.is_blind(&self.settings)
            || self.sources.iter().any(|source| source.is_blind(&self.settings))
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
        Allowance { by: None, gentle: most, most, slower: Reason::Unclear, stops: Reason::Unknown }
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
