use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::{Point2, Vector2};
use tagalong_core::{EgoMotion, Frame, Joints, Person, Result, Track, TrackId};
use tagalong_vision::{Appearance, Describer};

use super::chooser::Chooser;
use super::memory::{AppearanceMemory, Differences, logit, probability};
use super::settings::TargetSettings;

/// Bound of the log-odds: no single look is certain.
const CERTAIN: f64 = 6.0;
/// Time out of sight after which a track may return as another person, s.
const UNSEEN_S: f64 = 0.25;
/// Decay of a candidate's log-odds per frame, and weight of a new frame: in the long run evidence
/// counts five times that of a frame.
const KEPT: f64 = 0.9;
const NEW: f64 = 0.5;
/// Speed below which a person stands, m/s.
const STANDS_MPS: f64 = 0.3;
/// Distance from the place of a standing person within which a detection is of the same one, m, ...
const SAME_PLACE_M: f64 = 0.4;
/// ... for this time, s.
const STANDING_S: f64 = 60.0;
/// Probability of the lock from which on every other track is another person.
const SURE: f64 = 0.95;
/// Distance beyond the largest speed that a person may have moved, m.
const REACH_M: f64 = 0.6;

/// State of the target lock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum LockState {
    /// No target was chosen yet.
    Initial,
    /// The target is followed, and its appearance is learned.
    Training,
    /// The target is followed.
    Locked,
    /// A track is followed slowly that may not be the person.
    Suspect,
    /// No track is followed; the person is searched for.
    Lost,
    /// A track that seems to be the person is followed slowly.
    Refound,
    /// The followed track is kept, but a sensor is frozen: whether the person is there is not known.
    /// Reports alone have this state.
    NotKnown,
}

impl LockState {
    /// Returns its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Initial => "initial",
            Self::Training => "training",
            Self::Locked => "locked",
            Self::Suspect => "suspect",
            Self::Lost => "lost",
            Self::Refound => "re-found",
            Self::NotKnown => "not known",
        }
    }

    /// Returns one sentence for an operator of the robot.
    pub fn about(self) -> &'static str {
        match self {
            Self::Initial => "no person was chosen yet",
            Self::Training => "the person is followed, and the appearance is learned",
            Self::Locked => "the person is followed",
            Self::Suspect => "a track is followed slowly that may not be the person",
            Self::Lost => "no track is followed; the person is searched for",
            Self::Refound => "a track that seems to be the person is followed slowly",
            Self::NotKnown => "whether the person is there is not known: a sensor is frozen",
        }
    }

    /// Returns true if a track is followed.
    pub fn follows(self) -> bool {
        matches!(
            self,
            Self::Training | Self::Locked | Self::Suspect | Self::Refound | Self::NotKnown
        )
    }

    /// Returns true if the followed track may be another person.
    pub fn doubts(self) -> bool {
        matches!(self, Self::Suspect | Self::Refound)
    }
}

/// Report of the target lock for one frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LockReport {
    /// State of the lock.
    pub state: LockState,
    /// Cause of the last change of state.
    pub why: &'static str,
    /// Time since that change, s.
    pub since_s: f64,
    /// Probability that the followed track is the person, by all detections.
    pub belief: Option<f64>,
    /// Similarity of each seen track to the person.
    pub likeness: Vec<Likeness>,
}

impl LockReport {
    /// Returns the report while a sensor is frozen, for so many seconds: what it shows of the person is
    /// old, however well that fits.
    pub(crate) fn of_frozen_sensor(self, needs_reset: bool, since_s: f64) -> Self {
        if !self.state.follows() {
            return self;
        }
        let why = if needs_reset {
            "a sensor is frozen: check it, then reset"
        } else {
            "a sensor repeats itself"
        };
        Self { state: LockState::NotKnown, why, since_s, belief: None, ..self }
    }
}

/// Similarity of a track to the person in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Likeness {
    /// The track.
    pub track: TrackId,
    /// Probability that it is the person, by its appearance in this frame alone, calibrated.
    pub probability: f64,
    /// Log-odds of that before the calibration.
    pub log_odds: f64,
    /// Differences from the remembered appearance that led to it.
    pub differences: Differences,
}

/// Last seen state of the person, moved along with the robot frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LastSeen {
    /// Position in the robot frame, m.
    pub(crate) place: Point2<f64>,
    /// Velocity over ground, in robot axes, m/s.
    pub(crate) velocity: Vector2<f64>,
    /// Time since then, s.
    pub(crate) ago_s: f64,
}

/// Target lock; see the [module](super).
pub(crate) struct TargetLock {
    settings: TargetSettings,
    describer: Describer,
    state: LockState,
    why: &'static str,
    since_s: f64,
    track: Option<TrackId>,
    memory: AppearanceMemory,
    /// Log-odds that the followed track is the person.
    belief: f64,
    chooser: Chooser,
    /// True after another track came near or the track was out of sight: it may have changed over.
    doubtful: bool,
    sightings: u32,
    last: Option<LastSeen>,
    /// Candidates while the person is lost: accumulated log-odds, and number of frames in a row in
    /// which they sufficed.
    candidates: BTreeMap<TrackId, (f64, u32)>,
    /// Tracks that are not the person: both were seen at once.
    others: BTreeSet<TrackId>,
    /// Places of the standing ones among those, robot frame, m, and their age, s.
    standing: Vec<(Point2<f64>, f64)>,
}

impl TargetLock {
    pub(crate) fn new(settings: TargetSettings, describer: Describer) -> Self {
        Self {
            state: LockState::Initial,
            why: "nobody was chosen yet",
            since_s: 0.0,
            track: None,
            memory: AppearanceMemory::default(),
            belief: 0.0,
            chooser: Chooser::default(),
            doubtful: false,
            sightings: 0,
            last: None,
            candidates: BTreeMap::new(),
            others: BTreeSet::new(),
            standing: Vec::new(),
            settings,
            describer,
        }
    }

    /// Forgets the previous target, and chooses one by these settings from the next frame on.
    pub(crate) fn restart(&mut self, settings: TargetSettings, why: &'static str) {
        *self = Self { why, ..Self::new(settings, self.describer.clone()) };
    }

    /// Discards all positions after a jump of the clock: a remembered person is lost, otherwise a
    /// target is chosen anew.
    pub(crate) fn reset(&mut self) {
        if !self.settings.remember {
            *self = Self::new(self.settings.clone(), self.describer.clone());
        } else if self.state.follows() {
            self.lose("the stamps jumped");
        }
        self.last = None;
        self.candidates.clear();
        self.others.clear();
        self.standing.clear();
    }

    pub(crate) fn state(&self) -> LockState {
        self.state
    }

    /// Returns the time since the last change of state, s.
    pub(crate) fn since_s(&self) -> f64 {
        self.since_s
    }

    /// Returns the last seen state of the person.
    pub(crate) fn last_seen(&self) -> Option<&LastSeen> {
        self.last.as_ref()
    }

    /// Returns the position of the best candidate for the lost person, robot frame, m.
    pub(crate) fn candidate(&self, tracks: &[Track]) -> Option<Point2<f64>> {
        let hopeful = self.candidates.iter().filter(|(_, (belief, _))| *belief > 0.0);
        let (id, _) = hopeful.max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
        let track = tracks.iter().find(|track| track.id == *id)?;
        Some(track.estimate.person.position.xy())
    }

    /// Returns the track that is followed now.
    pub(crate) fn followed(&self) -> Option<TrackId> {
        self.track.filter(|_| self.state.follows())
    }

    /// Takes in a frame; `tracks` are near to far, `joints` those of them in this frame, and `may_choose`
    /// allows the choice of a target.
    ///
    /// # Errors
    /// The network that describes people fails.
    pub(crate) fn update(
        &mut self,
        frame: &Frame,
        motion: &EgoMotion,
        tracks: &[Track],
        joints: &[(TrackId, Arc<Joints>)],
        may_choose: bool,
    ) -> Result<LockReport> {
        self.move_along(motion);
        let looks = self.looks(frame, tracks)?;
        let likeness = self.likeness(&looks);
        let log_odds = likeness.iter().map(|like| (like.track, like.log_odds)).collect();
        match self.state {
            LockState::Initial if !may_choose => {}
            LockState::Initial => self.start(tracks, joints, motion.dt),
            LockState::Lost => self.look_for(tracks, &log_odds),
            _ => self.hold(tracks, &log_odds, motion.dt),
        }
        // Others are noted before the appearance is learned, with the state of this frame.
        self.tell_apart(tracks);
        self.learn(tracks, looks);
        Ok(LockReport {
            state: self.state,
            why: self.why,
            since_s: self.since_s,
            belief: self.followed().map(|_| probability(self.belief)),
            likeness,
        })
    }

    fn move_along(&mut self, motion: &EgoMotion) {
        self.since_s += motion.dt;
        if let Some(last) = &mut self.last {
            last.place = motion.apply_to_point(last.place);
            last.velocity = motion.apply_to_velocity(last.velocity);
            last.ago_s += motion.dt;
        }
        for (place, ago_s) in &mut self.standing {
            *place = motion.apply_to_point(*place);
            *ago_s += motion.dt;
        }
        self.standing.retain(|(_, ago_s)| *ago_s < STANDING_S);
    }

    /// Returns the appearance of all tracks that are seen whole.
    fn looks(&self, frame: &Frame, tracks: &[Track]) -> Result<BTreeMap<TrackId, Appearance>> {
        fn whole(track: &&Track) -> bool {
            track.confirmed && track.seen && !track.occluded
        }

        let all = tracks.iter().filter(|track| self.settings.remember && whole(track));
        all.map(|track| Ok((track.id, self.describer.of(&track.estimate, frame)?))).collect()
    }

    /// Returns the similarity of all tracks to the person.
    fn likeness(&self, looks: &BTreeMap<TrackId, Appearance>) -> Vec<Likeness> {
        looks
            .iter()
            .filter_map(|(track, looks)| {
                let differences = self.memory.differences(looks)?;
                // The clamp keeps one frame of unusual light from outweighing all others.
                let log_odds = differences.log_odds(&self.settings.looks).clamp(-CERTAIN, CERTAIN);
                let probability = self.settings.looks.calibrated(probability(log_odds));
                Some(Likeness { track: *track, probability, log_odds, differences })
            })
            .collect()
    }

    /// Follows the track that the chooser picks, if it picks one.
    fn start(&mut self, tracks: &[Track], joints: &[(TrackId, Arc<Joints>)], dt_s: f64) {
        if let Some(track) = self.chooser.choose(&self.settings, tracks, joints, dt_s) {
            self.begin(track, "chosen");
        }
    }

    /// Follows this track from now on.
    fn begin(&mut self, track: &Track, why: &'static str) {
        self.track = Some(track.id);
        // The chosen track is the person by definition.
        self.belief = CERTAIN;
        self.see(track);
        let remembers = self.settings.remember;
        self.go(if remembers { LockState::Training } else { LockState::Locked }, why);
    }

    /// Stays with the track, or has doubts.
    fn hold(&mut self, tracks: &[Track], log_odds: &BTreeMap<TrackId, f64>, dt_s: f64) {
        let Some(track) = tracks.iter().find(|track| Some(track.id) == self.track) else {
            return self.lose("the track ended");
        };
        if let Some(nearer) = self.chooser.reconsider(&self.settings, track, tracks, dt_s) {
            let chooser = std::mem::take(&mut self.chooser);
            *self = Self { chooser, ..Self::new(self.settings.clone(), self.describer.clone()) };
            return self.begin(nearer, "nearer than the one chosen before");
        }
        if !track.seen {
            return self.miss();
        }
        self.see(track);
        self.weigh(log_odds.get(&track.id).copied(), self.is_alone(track, tracks));
        self.judge();
    }

    /// Updates the belief. A track that no other came near and that was always in sight is the same
    /// person, whatever it looks like from this side. Otherwise its appearance decides.
    fn weigh(&mut self, odds: Option<f64>, alone: bool) {
        self.doubtful |= !alone;
        let evidence = if self.doubtful { odds } else { Some(CERTAIN) };
        if let Some(odds) = evidence {
            self.belief += self.settings.belief_weight * (odds - self.belief);
        }
        let sure = self.belief > 0.0 && self.sightings >= self.settings.again_sightings;
        self.doubtful &= !(alone && sure && !self.state.doubts());
    }

    /// Returns true if no other track is near a track.
    fn is_alone(&self, track: &Track, tracks: &[Track]) -> bool {
        tracks.iter().all(|other| other.id == track.id || self.are_apart(other, track))
    }

    /// Returns true for tracks so far apart that neither is taken for the other.
    fn are_apart(&self, a: &Track, b: &Track) -> bool {
        let [a, b] = [a, b].map(|track| track.estimate.person.position.xy());
        nalgebra::distance(&a, &b) >= self.settings.alone_m
    }

    /// Handles a frame in which the track is not seen.
    fn miss(&mut self) {
        let ago_s = self.last.map_or(f64::INFINITY, |last| last.ago_s);
        if !self.settings.remember {
            return;
        }
        self.sightings = 0;
        self.doubtful |= ago_s > UNSEEN_S;
        if ago_s > self.settings.lose_after_s {
            self.lose("out of sight");
        } else if ago_s > self.settings.doubt_after_s && self.state != LockState::Suspect {
            // A track that returns has to look like the person first.
            self.belief = self.belief.min(logit(self.settings.doubt_below));
            self.go(LockState::Suspect, "out of sight");
        }
    }

    /// Changes the state by the belief about a seen track.
    fn judge(&mut self) {
        let TargetSettings { refuse_below, doubt_below, training_sightings, .. } = self.settings;
        let sure = self.sightings >= self.settings.again_sightings;
        match self.state {
            _ if self.belief < logit(refuse_below) => self.lose("looks like somebody else"),
            LockState::Refound if self.belief < 0.0 => self.lose("was somebody else after all"),
            // Two seconds: a track that was found again is followed slowly until it proved itself.
            LockState::Refound if self.since_s > 2.0 && sure => {
                self.go(LockState::Locked, "looks right for long enough");
            }
            LockState::Suspect if self.belief > 0.0 && sure => {
                self.go(LockState::Locked, "looks right");
            }
            LockState::Training if self.sightings >= training_sightings => {
                self.go(LockState::Locked, "known well");
            }
            LockState::Locked if self.belief < logit(doubt_below) => {
                self.go(LockState::Suspect, "looks different");
            }
            _ => {}
        }
    }

    /// Searches for the person among the seen tracks.
    fn look_for(&mut self, tracks: &[Track], log_odds: &BTreeMap<TrackId, f64>) {
        if !self.settings.remember {
            return;
        }
        let enough = logit(self.settings.again_from);
        let mut seen = BTreeMap::new();
        for track in tracks {
            if self.is_other(track) || !self.is_in_reach(track) {
                continue;
            }
            let Some(odds) = log_odds.get(&track.id) else { continue };
            let (before, times) = self.candidates.get(&track.id).copied().unwrap_or_default();
            // Evidence adds up, but consecutive frames are correlated.
            let belief = (KEPT * before + NEW * odds).clamp(-CERTAIN, CERTAIN);
            seen.insert(track.id, (belief, if belief >= enough { times + 1 } else { 0 }));
        }
        self.candidates = seen;
        let best = self.candidates.iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let Some((&id, &(belief, times))) = best else { return };
        let Some(track) = tracks.iter().find(|track| track.id == id) else { return };
        if times >= self.settings.again_sightings {
            self.track = Some(id);
            self.belief = belief;
            // A found track counts as doubtful, so that its appearance goes on being compared.
            self.doubtful = true;
            self.sightings = 0;
            self.candidates.clear();
            self.see(track);
            self.go(LockState::Refound, "somebody looks like the person");
        }
    }

    /// Returns true if the person can have got to where a track is.
    fn is_in_reach(&self, track: &Track) -> bool {
        let Some(last) = &self.last else { return true };
        let covariance = &track.estimate.covariance;
        let sigma = (covariance[(0, 0)] + covariance[(1, 1)]).max(0.0).sqrt();
        let reach_m = REACH_M + self.settings.reach_mps * last.ago_s + 3.0 * sigma;
        nalgebra::distance(&track.estimate.person.position.xy(), &last.place) <= reach_m
    }

    /// Records that the person was seen here.
    fn see(&mut self, track: &Track) {
        let person = &track.estimate.person;
        let place = person.position.xy();
        self.last = Some(LastSeen { place, velocity: person.velocity, ago_s: 0.0 });
        self.sightings = self.sightings.saturating_add(1);
    }

    /// Records that a track is not the person, nor a track seen later where it stood: a static
    /// object that was taken for a person stays where it is, but its track does not live on while
    /// the robot looks elsewhere.
    fn note_other(&mut self, track: &Track) {
        let Person { position, velocity, .. } = &track.estimate.person;
        self.others.insert(track.id);
        if velocity.norm() < STANDS_MPS {
            let place = position.xy();
            self.standing.retain(|(other, _)| nalgebra::distance(other, &place) > SAME_PLACE_M);
            self.standing.push((place, 0.0));
        }
    }

    fn is_other(&self, track: &Track) -> bool {
        let place = track.estimate.person.position.xy();
        let mut standing = self.standing.iter().map(|(other, _)| nalgebra::distance(other, &place));
        self.others.contains(&track.id) || standing.any(|off_m| off_m <= SAME_PLACE_M)
    }

    fn lose(&mut self, why: &'static str) {
        self.candidates.clear();
        self.go(LockState::Lost, why);
    }

    fn go(&mut self, state: LockState, why: &'static str) {
        self.state = state;
        self.why = why;
        self.since_s = 0.0;
        // The count starts anew: a suspect has to convince by later detections alone.
        if state == LockState::Suspect {
            self.sightings = 0;
        }
    }

    /// Notes each track seen beside the person as another person, until that track is out of sight,
    /// or comes so near to the person's or to a new one that it may change over.
    fn tell_apart(&mut self, tracks: &[Track]) {
        let is_sure = self.state.follows() && !self.state.doubts() && self.belief >= logit(SURE);
        let own = tracks.iter().find(|t| Some(t.id) == self.track && t.seen && is_sure);
        let known = tracks.iter().filter(|t| self.others.contains(&t.id));
        let stay = known
            .filter(|track| track.unseen_s <= UNSEEN_S && !self.may_be_taken(track, tracks))
            .map(|track| track.id)
            .collect();
        self.others = stay;
        let Some(own) = own else { return };
        for track in tracks {
            if Some(track.id) != self.track && track.seen && self.are_apart(own, track) {
                self.note_other(track);
            }
        }
    }

    /// Says whether the track of another may have become that of somebody beside it: of the person,
    /// or of somebody new.
    fn may_be_taken(&self, track: &Track, tracks: &[Track]) -> bool {
        tracks.iter().any(|other| {
            let is_known = self.others.contains(&other.id);
            (Some(other.id) == self.track || other.seen && !is_known)
                && other.id != track.id
                && !self.are_apart(other, track)
        })
    }

    /// Learns the appearance of the person, and of others, while that is certain.
    fn learn(&mut self, tracks: &[Track], mut looks: BTreeMap<TrackId, Appearance>) {
        let certain = matches!(self.state, LockState::Training | LockState::Locked);
        if !certain || self.doubtful {
            return;
        }
        let alone: Vec<&Track> = tracks.iter().filter(|t| self.is_alone(t, tracks)).collect();
        for track in alone {
            match looks.remove(&track.id) {
                Some(looks) if Some(track.id) == self.track => self.memory.learn(looks),
                Some(looks) => self.memory.learn_other(looks),
                None => {}
            }
        }
    }
}

#[cfg(test)]
mod tests;
