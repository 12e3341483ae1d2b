use std::collections::{BTreeMap, BTreeSet};

use crate::{Guarded, StepError};
use nalgebra::Point2;
use tagalong_core::{
    Associations, Associator, Detection, EgoMotion, Estimate, Evidence, Filter, Frame, Gate,
    Initiation, Inputs, Likelihood, Observation, ObservedTrack, Query, Track, TrackId,
    TrackManager, Unassociated, Update, Verifier,
};
use tagalong_vision::Describer;

use crate::births::{is_at_place, remove_births, veto_births};
use crate::clock::{Clock, Tick};
use crate::detections::{DetectionSet, PendingDetection};
use crate::duplicates::DuplicateFinder;
use crate::frozen::held;
use crate::half_hidden::inflate_half_hidden;
use crate::memo::Identities;
use crate::needs::Needs;
use crate::occlusion::{
    Occluder, Visibility, occluder_of_detection, occluder_of_estimate, visibility,
};
use crate::preprocess::{cleaned, preprocess};
use crate::reidentification::Reidentifier;
use crate::search::SearchStage;
use crate::silhouette::move_boxes;
use crate::stage::StageLog;
use crate::table::TrackTable;
use crate::weighing::Metered;
use crate::{
    DetectorSlot, Fate, MergeSettings, Outcome, Preprocessor, Role, TrackerSettings, TrackingReport,
};

/// Stages that [`TrackingReport::timings`] names, in their order.
pub const STAGES: [&str; 8] =
    ["preprocess", "predict", "track", "discover", "associate", "update", "manage", "learn"];

/// Components of a tracker.
pub struct Parts {
    /// Preprocessors, in their order.
    pub preprocessors: Vec<Guarded<dyn Preprocessor>>,
    /// Detectors with their roles.
    pub detectors: Vec<DetectorSlot>,
    /// Verifiers; their log-odds add up.
    pub verifiers: Vec<Guarded<dyn Verifier>>,
    /// The associator.
    pub associator: Guarded<dyn Associator>,
    /// The filter.
    pub filter: Guarded<dyn Filter>,
    /// The track manager.
    pub manager: Guarded<dyn TrackManager>,
    /// Description of people by their appearance.
    pub describer: Describer,
}

/// Tracker: the plugins, and their tracks.
pub struct Tracker {
    settings: TrackerSettings,
    preprocessors: Vec<Guarded<dyn Preprocessor>>,
    search: SearchStage,
    associator: Guarded<dyn Associator>,
    filter: Guarded<dyn Filter>,
    manager: Guarded<dyn TrackManager>,
    needs: Needs,
    clock: Clock,
    table: TrackTable,
    duplicates: DuplicateFinder,
    reidentifier: Reidentifier,
    /// The tracks after the last processed frame, in the robot frame of that time.
    last: Vec<Track>,
    /// The same as they were reported: under the numbers of the people.
    reported: Vec<Track>,
    /// True since a frame whose calibration changed: the tracks stay where they were.
    frozen: bool,
    /// Processed frames.
    frames: u64,
    visualises: bool,
}

/// Result of one frame.
pub struct Tracked {
    /// The report.
    pub report: TrackingReport,
    /// The frame as the preprocessors completed it; `None` if it was used unchanged.
    pub completed: Option<Frame>,
}

/// State of the tracks after the update of one frame.
struct Posterior {
    supports: BTreeMap<TrackId, Update>,
    estimates: BTreeMap<TrackId, Estimate>,
}

impl Tracker {
    /// Creates a tracker without tracks.
    pub fn new(parts: Parts, settings: TrackerSettings) -> Self {
        let Parts { preprocessors, detectors, verifiers, associator, filter, manager, describer } =
            parts;
        let requires_box = filter.plugin().requirements().image_box;
        let mut needs = Needs::default();
        needs.add(filter.name(), filter.plugin().requirements().inputs);
        Self {
            needs,
            clock: Clock::new(settings.clock.clone()),
            reidentifier: Reidentifier::new(settings.reidentification.clone(), describer),
            settings,
            preprocessors,
            search: SearchStage { detectors, verifiers, requires_box, shared: None },
            associator,
            filter,
            manager,
            table: TrackTable::default(),
            duplicates: DuplicateFinder::default(),
            last: Vec::new(),
            reported: Vec::new(),
            frozen: false,
            frames: 0,
            visualises: false,
        }
    }

    /// Takes one frame through all stages. From a frame with another calibration on, no plugin gets
    /// any: the tracks stay where they were on the floor, unseen, until the clock jumps.
    ///
    /// # Errors
    /// [`StepError::Lacks`] for a frame without a required input: the tracker goes on with the next.
    /// Another [`StepError`] if a plugin fails or panics: the tracker cannot be used afterwards.
    pub fn step(&mut self, frame: &Frame) -> Result<Tracked, StepError> {
        let mut log = StageLog::new();
        // No plugin sees a frame after the calibration changed.
        if !(self.frozen || frame.calibration_changed) {
            let checked = self.needs.check(frame, &self.preprocessors, &self.search, self.frames);
            checked.inspect_err(|_| self.clock.pass(frame))?;
        }
        let mut report = TrackingReport::new(frame.index, frame.stamp);
        let (outcome, motion) = match self.clock.tick(frame, &mut log.funnel) {
            Tick::Skip(outcome) => {
                let report = TrackingReport { outcome, funnel: log.funnel, ..report };
                return Ok(Tracked { report, completed: None });
            }
            Tick::Go(outcome, motion) => (outcome, motion),
        };
        self.frozen |= frame.calibration_changed;
        if self.frozen {
            return Ok(self.hold(frame, motion, TrackingReport { outcome, ..report }, log));
        }
        let (completed, motion) = self.preprocess(frame, motion, &mut log)?;
        let frame = completed.as_ref().unwrap_or(frame);
        let cleaned = cleaned(frame, &mut log)?;
        let frame = log.timed(STAGES[0], cleaned.frame().unwrap_or(frame));
        self.reset_after(outcome, frame, &mut log)?;
        let predicted = self.predict(frame, motion, &mut log)?;
        let predicted = log.timed(STAGES[1], predicted);
        let due = self.search.due(frame, self.frames);
        let gate = self.gate(motion);
        let mut detections = self.search_tracks(frame, &due, &predicted, &gate, &mut log)?;
        log.timed(STAGES[2], ());
        self.search_image(frame, &due, &mut detections, &mut log)?;
        log.timed(STAGES[3], ());
        self.associate(frame, &predicted, &gate, &mut detections, &mut log)?;
        inflate_half_hidden(frame, &predicted, &mut detections, &self.settings.occlusion);
        log.timed(STAGES[4], ());
        let posterior = self.update(frame, &mut detections, &mut report, &mut log)?;
        let posterior = log.timed(STAGES[5], posterior);
        let tracks = self.manage(frame, &due, posterior, &mut detections, &mut log)?;
        report.tracks = log.timed(STAGES[6], tracks);
        self.learn(frame, &report.tracks)?;
        report.motion = motion.unwrap_or(report.motion);
        let people = self.reidentifier.update(frame, &report.motion, &report.tracks);
        let people = people.map_err(|error| StepError::of_stage("[appearance]", frame, error))?;
        log.timed(STAGES[7], ());
        self.frames += 1;
        self.last.clone_from(&report.tracks);
        report.outcome = outcome;
        let mut report = self.finish(report, detections, log);
        people.renumber(&mut report);
        // Last, so that no stage of the next frame depends on it.
        move_boxes(frame, &mut report.tracks, &self.settings.silhouette);
        self.reported.clone_from(&report.tracks);
        Ok(Tracked { report, completed })
    }

    /// Requires inputs of each frame for a stage that the tracker does not know.
    pub fn require(&mut self, stage: &str, inputs: Inputs) {
        self.needs.add(stage, inputs);
    }

    /// Returns true once a frame had another calibration.
    pub fn is_frozen(&self) -> bool {
        self.frozen
    }

    /// Reports the tracks where they were; without a known motion they end.
    fn hold(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        report: TrackingReport,
        mut log: StageLog,
    ) -> Tracked {
        log.funnel.drop_many("frame: calibration changed", 1);
        let before = std::mem::take(&mut self.reported);
        match motion {
            Some(motion) => {
                let held = before.iter().map(|track| held(track, &motion, &frame.camera));
                self.reported = held.collect();
            }
            None => log.ended = before.iter().map(|track| track.id).collect(),
        }
        let (tracks, StageLog { funnel, ended, .. }) = (self.reported.clone(), log);
        let motion = motion.unwrap_or(report.motion);
        Tracked {
            report: TrackingReport { motion, tracks, funnel, ended, ..report },
            completed: None,
        }
    }

    /// Switches [`TrackingReport::visualisation`] on or off. Its time counts as that of the stage
    /// `update`; it changes no other result.
    pub fn visualise(&mut self, wanted: bool) {
        self.visualises = wanted;
    }

    /// Shares the results of detectors and verifiers with other trackers that process the very same
    /// frame and share theirs.
    pub fn share_answers(&mut self, identities: Identities) {
        self.search.shared = Some(identities);
    }

    /// Returns the detectors with their roles.
    pub fn detectors(&self) -> &[DetectorSlot] {
        &self.search.detectors
    }

    /// Returns the number of verifiers.
    pub fn verifier_count(&self) -> usize {
        self.search.verifiers.len()
    }

    fn preprocess(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        log: &mut StageLog,
    ) -> Result<(Option<Frame>, Option<EgoMotion>), StepError> {
        let mut people: Vec<&Track> = self.last.iter().collect();
        // The tracks are sorted by range, but preprocessors receive them by number.
        people.sort_by_key(|track| track.id);
        let people: Vec<Estimate> =
            people.into_iter().map(|track| track.estimate.clone()).collect();
        preprocess(&mut self.preprocessors, frame, motion, &people, log)
    }

    /// Ends the tracks that a jump of the clock interrupts.
    fn reset_after(
        &mut self,
        outcome: Outcome,
        frame: &Frame,
        log: &mut StageLog,
    ) -> Result<(), StepError> {
        let (ids, test) = match outcome {
            Outcome::ResetBackward { .. } => {
                self.reidentifier.reset(0.0);
                (self.table.ids(), "track: clock set back")
            }
            Outcome::ResetForward { by_s } => {
                self.reidentifier.reset(by_s);
                (self.table.ids(), "track: long gap in the log")
            }
            Outcome::Gap { .. } => (self.table.tentative_ids(), "track: gap in the log"),
            Outcome::Tracked | Outcome::Duplicate | Outcome::OutOfOrder => return Ok(()),
        };
        // The positions that a manager remembers are relative to the robot. Its motion over the gap
        // is uncertain.
        self.manager.ask(frame.index, |manager| manager.reset())?;
        ids.into_iter().try_for_each(|id| self.end(frame, id, test, log))
    }

    /// Returns all tracks, predicted into the robot's new frame, from near to far.
    fn predict(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        log: &mut StageLog,
    ) -> Result<Vec<Track>, StepError> {
        if let Some(motion) = motion {
            let camera = &frame.camera;
            self.filter.ask(frame.index, |filter| filter.predict(&motion, camera))?;
            self.table.age(motion.dt);
            self.manager.ask(frame.index, |manager| manager.predict(&motion))?;
        }
        let estimates = self.estimates(frame, log)?;
        Ok(self.table.tracks(estimates, &frame.camera))
    }

    fn gate(&self, motion: Option<EgoMotion>) -> Gate<'static> {
        let start_log_odds = self.manager.plugin().start_log_odds();
        let dt_s = motion.map_or(0.0, |motion| motion.dt);
        Gate::new(dt_s, start_log_odds)
    }

    /// Searches for each track, from near to far, except for those that a nearer, detected person
    /// hides.
    fn search_tracks(
        &mut self,
        frame: &Frame,
        due: &[usize],
        predicted: &[Track],
        gate: &Gate,
        log: &mut StageLog,
    ) -> Result<DetectionSet, StepError> {
        let mut detections = DetectionSet::default();
        let detectors = self.search.with_role(due, Role::Track);
        if detectors.is_empty() {
            return Ok(detections);
        }
        let mut occluders: Vec<Occluder> = Vec::new();
        let associator = &mut self.associator;
        // From near to far, so that an occluder is found before the tracks behind it.
        for track in predicted {
            let settings = &self.settings.occlusion;
            let Estimate { region, person, .. } = &track.estimate;
            let seen = visibility(region, &person.position, &occluders, &frame.camera, settings);
            if seen != Visibility::Visible {
                continue;
            }
            let funnel = &mut log.funnel;
            let (found, dropped) = self.search.find_track(
                frame,
                &detectors,
                track,
                |found| {
                    if !gate.admits(track, &found.detection) {
                        return Ok(Some(found.score_test(gate.start_log_odds)));
                    }
                    let fits = associator.ask(frame.index, |associator| {
                        associator.fits(track, &found.detection, gate)
                    })?;
                    Ok((!fits).then_some("gate"))
                },
                funnel,
            )?;
            detections.add(dropped);
            let Some(found) = found else { continue };
            occluders.push(occluder_of_detection(&found.detection, &track.estimate, frame));
            detections.add([found]);
        }
        Ok(detections)
    }

    /// Searches the image for new people.
    fn search_image(
        &mut self,
        frame: &Frame,
        due: &[usize],
        detections: &mut DetectionSet,
        log: &mut StageLog,
    ) -> Result<(), StepError> {
        let occupied = detections.undecided_detections();
        for index in self.search.with_role(due, Role::Discover) {
            let search = Query::Discover { occupied: &occupied };
            detections.add(self.search.detect(frame, index, &search, &mut log.funnel)?);
        }
        detections.limit(self.settings.merge.max_detections);
        Ok(())
    }

    /// Associates all detections with tracks at once: a search near one track that found another
    /// person must not take that person's detection from another track.
    fn associate(
        &mut self,
        frame: &Frame,
        predicted: &[Track],
        gate: &Gate<'_>,
        detections: &mut DetectionSet,
        log: &mut StageLog,
    ) -> Result<(), StepError> {
        detections.merge(&self.settings.merge);
        let open = detections.undecided();
        let found = detections.undecided_detections();
        let births = &self.settings.births;
        let appearance = self.reidentifier.compare(frame, predicted, &found, !births.are_off());
        let mut appearance =
            appearance.map_err(|error| StepError::of_stage("[appearance]", frame, error))?;
        let camera = &frame.camera;
        veto_births(&mut appearance, predicted, &found, camera, births);
        let gate = &gate.with_appearance(&appearance);
        let mut answer = self
            .associator
            .ask(frame.index, |associator| associator.associate(predicted, &found, gate))?;
        // The associator is a plugin; pairs outside of the gate must not reach the filter.
        let impossible = remove_impossible(&mut answer, predicted, &found, gate);
        log.funnel.drop_many("association not possible", impossible);
        let removed = remove_births(&mut answer, predicted, &found, &appearance, camera, births);
        log.funnel.drop_many("rather a new person", removed);
        detections.take_over(&answer, predicted, &open);
        Ok(())
    }

    /// Updates the filter with the evidence of the frame.
    fn update(
        &mut self,
        frame: &Frame,
        detections: &mut DetectionSet,
        report: &mut TrackingReport,
        log: &mut StageLog,
    ) -> Result<Posterior, StepError> {
        let matched = detections.matched();
        let unmatched = detections.undecided_detections();
        let metered = self.search.likelihood().map(Metered::new);
        let likelihood = metered.as_ref().map(|metered| metered as &dyn Likelihood);
        let evidence =
            Evidence::new(frame, &matched).with_unmatched(&unmatched).with_likelihood(likelihood);
        let mut supports = self.filter.call(frame.index, |filter| filter.update(&evidence))?;
        log.weighing = metered.as_ref().map(Metered::weighing).unwrap_or_default();
        if self.visualises {
            let shown = self.filter.call(frame.index, |filter| filter.visualise(&evidence))?;
            report.visualisation = shown;
        }
        // The filter is a plugin; it may report tracks that have ended or never existed.
        let before = supports.len();
        supports.retain(|id, _| self.table.contains(*id));
        log.funnel.drop_many("support of an unknown track", (before - supports.len()) as u64);
        detections.reject(|id| supports.contains_key(&id), "filter");
        for (id, support) in &supports {
            match support.nis {
                Some((nis, dof)) if nis.is_finite() => log.nis.push((*id, nis, dof)),
                Some(_) => log.funnel.drop_many("nis not finite", 1),
                None => {}
            }
        }
        Ok(Posterior { supports, estimates: self.estimates(frame, log)? })
    }

    /// Starts, confirms and ends tracks, and returns the remaining ones.
    fn manage(
        &mut self,
        frame: &Frame,
        due: &[usize],
        mut posterior: Posterior,
        detections: &mut DetectionSet,
        log: &mut StageLog,
    ) -> Result<Vec<Track>, StepError> {
        let started = self.start_tracks(frame, &posterior, detections)?;
        // The first report of a new track includes its estimate.
        if !started.is_empty() {
            posterior.estimates = self.estimates(frame, log)?;
        }
        self.observe_tracks(frame, due, &posterior, &started, detections);
        let tracks = self.table.tracks(posterior.estimates.clone(), &frame.camera);
        let observed: Vec<ObservedTrack<'_>> = tracks
            .iter()
            .filter_map(|track| {
                let observation = self.table.observation(track.id)?;
                Some(ObservedTrack::new(track, observation))
            })
            .collect();
        let changes = self.manager.ask(frame.index, |manager| manager.manage(&observed))?;
        for (id, health) in changes.health {
            self.table.set_health(id, health);
        }
        for (id, test) in changes.ends {
            self.end(frame, id, test, log)?;
        }
        self.prune(frame, &posterior.estimates, log)?;
        Ok(self.table.tracks(posterior.estimates, &frame.camera))
    }

    /// Ends duplicates and tracks in excess of the limit.
    fn prune(
        &mut self,
        frame: &Frame,
        estimates: &BTreeMap<TrackId, Estimate>,
        log: &mut StageLog,
    ) -> Result<(), StepError> {
        let MergeSettings { duplicate_m, max_tracks, .. } = self.settings.merge;
        // The manager has just ended some of the tracks in `estimates`.
        let alive = estimates.iter().filter(|(id, _)| self.table.contains(**id));
        let places: BTreeMap<TrackId, Point2<f64>> =
            alive.map(|(id, estimate)| (*id, estimate.person.position.xy())).collect();
        let table = &self.table;
        let duplicates = self
            .duplicates
            .find(&places, duplicate_m, |id| table.observation(id) == Some(Observation::Occluded));
        for (kept, ended) in duplicates {
            if let Some(health) = self.manager.ask(frame.index, |m| m.merge(kept, ended))? {
                self.table.set_health(kept, health);
            }
            self.end(frame, ended, "track: duplicate", log)?;
        }
        for id in self.table.too_many(max_tracks) {
            self.end(frame, id, "track: too many", log)?;
        }
        Ok(())
    }

    /// Offers detections without a track to the manager.
    fn start_tracks(
        &mut self,
        frame: &Frame,
        posterior: &Posterior,
        detections: &mut DetectionSet,
    ) -> Result<BTreeSet<TrackId>, StepError> {
        let mut started = BTreeSet::new();
        for index in detections.undecided() {
            let pending = detections.get(index);
            let is_tracked = self.is_tracked(frame, posterior, &pending.detection);
            let fate = match self.table.next_id() {
                _ if is_tracked => Fate::Dropped("tracked already"),
                Some(id) => self.initiate(frame, id, pending)?,
                None => Fate::Dropped("no track numbers left"),
            };
            started.extend(match fate {
                Fate::Started(id) => Some(id),
                _ => None,
            });
            detections.settle(index, fate);
        }
        Ok(started)
    }

    /// Returns true if a detection is where a track is, also one that is predicted there for sure: the
    /// trunk of a person whose head has left the image fits no track, and is nobody else.
    fn is_tracked(&self, frame: &Frame, posterior: &Posterior, detection: &Detection) -> bool {
        let MergeSettings { duplicate_m, .. } = self.settings.merge;
        for (id, estimate) in &posterior.estimates {
            let away_m = (estimate.person.position - detection.position).xy().norm();
            let is_supported = posterior.supports.contains_key(id);
            let is_there = is_supported
                || self.table.is_confirmed(*id)
                    && is_at_place(estimate, detection, &frame.camera, &self.settings.births);
            if is_there && away_m < duplicate_m {
                return true;
            }
        }
        false
    }

    /// Starts a track from a detection, if the manager agrees.
    fn initiate(
        &mut self,
        frame: &Frame,
        id: TrackId,
        pending: &PendingDetection,
    ) -> Result<Fate, StepError> {
        let PendingDetection { detection, detector_log_odds, discovered, .. } = pending;
        let candidate = Unassociated::new(detection, *detector_log_odds, *discovered);
        let answer = self.manager.ask(frame.index, |manager| manager.initiate(id, &candidate))?;
        let health = match answer {
            Initiation::Start(health) => health,
            Initiation::Drop(test) => return Ok(Fate::Dropped(test)),
        };
        let camera = &frame.camera;
        self.filter.ask(frame.index, |filter| filter.start(id, detection, camera))?;
        self.table.start(id, health, pending.detector);
        Ok(Fate::Started(id))
    }

    /// Records the observation of each track.
    fn observe_tracks(
        &mut self,
        frame: &Frame,
        due: &[usize],
        posterior: &Posterior,
        started: &BTreeSet<TrackId>,
        detections: &DetectionSet,
    ) {
        let Posterior { supports, estimates } = posterior;
        let supported = supports.keys().chain(started).filter_map(|id| estimates.get(id));
        // Only people found in this frame hide others: a coasting track may be at another place.
        let occluders: Vec<Occluder> =
            supported.map(|estimate| occluder_of_estimate(estimate, frame)).collect();
        for (id, estimate) in estimates.iter().filter(|(id, _)| !started.contains(id)) {
            let found = detections.of_track(*id);
            let (observation, by) = match (supports.contains_key(id), found) {
                // An associator that weighs alternatives may give a miss the higher probability.
                (true, Some(found)) if detections.weight_of_track(*id) >= 0.5 => {
                    let log_odds = found.detection.score;
                    (Observation::Detected { log_odds }, Some(found.detector))
                }
                (true, None) => (Observation::Updated, None),
                _ => (self.unsupported(frame, due, *id, estimate, &occluders), None),
            };
            self.table.observe(*id, observation, by);
        }
    }

    /// Returns the reason for which a track has no evidence.
    fn unsupported(
        &self,
        frame: &Frame,
        due: &[usize],
        id: TrackId,
        estimate: &Estimate,
        occluders: &[Occluder],
    ) -> Observation {
        let Estimate { region, person, .. } = estimate;
        let settings = &self.settings.occlusion;
        match visibility(region, &person.position, occluders, &frame.camera, settings) {
            Visibility::Hidden => Observation::Occluded,
            Visibility::Outside => Observation::OutOfView,
            Visibility::Visible if self.was_searched(due, id) => Observation::Missed,
            Visibility::Visible => Observation::NotSearched,
        }
    }

    /// Returns true if the detector that found the track last, or the filter itself, processed this
    /// frame. A frame on which a detector does not run is no miss for its tracks.
    fn was_searched(&self, due: &[usize], id: TrackId) -> bool {
        let by_filter = self.filter.plugin().requirements().searches;
        by_filter || self.table.detector(id).is_none_or(|detector| due.contains(&detector))
    }

    /// Adapts the appearance models.
    fn learn(&mut self, frame: &Frame, tracks: &[Track]) -> Result<(), StepError> {
        for slot in &mut self.search.detectors {
            slot.plugin.call(frame.index, |detector| detector.learn(frame, tracks))?;
        }
        Ok(())
    }

    /// Returns the filter's estimates of all tracks. A missing estimate or one that is not finite
    /// ends its track, so that no such number leaves the tracker.
    fn estimates(
        &mut self,
        frame: &Frame,
        log: &mut StageLog,
    ) -> Result<BTreeMap<TrackId, Estimate>, StepError> {
        let camera = &frame.camera;
        let mut all = self.filter.ask(frame.index, |filter| filter.estimates(camera))?;
        let before = all.len();
        all.retain(|id, _| self.table.contains(*id));
        log.funnel.drop_many("estimate of an unknown track", (before - all.len()) as u64);
        for id in self.table.ids() {
            if !all.get(&id).is_some_and(Estimate::is_sane) {
                all.remove(&id);
                self.end(frame, id, "track: estimate not finite", log)?;
            }
        }
        Ok(all)
    }

    fn end(
        &mut self,
        frame: &Frame,
        id: TrackId,
        test: &'static str,
        log: &mut StageLog,
    ) -> Result<(), StepError> {
        self.filter.ask(frame.index, |filter| filter.stop(id))?;
        self.manager.ask(frame.index, |manager| manager.stop(id))?;
        self.table.end(id);
        // The consistency figures of the report cover the remaining tracks only.
        log.nis.retain(|(track, ..)| *track != id);
        log.funnel.drop_many(test, 1);
        log.ended.push(id);
        Ok(())
    }

    fn finish(
        &mut self,
        mut report: TrackingReport,
        detections: DetectionSet,
        mut log: StageLog,
    ) -> TrackingReport {
        report.candidates = detections.into_candidates(&mut log.funnel);
        report.plugin_timings = self.plugin_timings();
        let StageLog { funnel, nis, ended, weighing, timings, .. } = log;
        TrackingReport { funnel, nis, ended, weighing, timings, ..report }
    }

    fn plugin_timings(&mut self) -> Vec<(String, f64)> {
        fn spent<P: ?Sized>(guarded: &mut Guarded<P>) -> (String, f64) {
            (guarded.name().to_owned(), guarded.take_ms())
        }
        let mut all: Vec<_> = self.preprocessors.iter_mut().map(spent).collect();
        all.extend(self.search.detectors.iter_mut().map(|slot| spent(&mut slot.plugin)));
        all.extend(self.search.verifiers.iter_mut().map(spent));
        all.push(spent(&mut self.associator));
        all.push(spent(&mut self.filter));
        all.push(spent(&mut self.manager));
        all
    }
}

/// Removes pairs that no associator may return, and returns their number.
fn remove_impossible(
    answer: &mut Associations,
    tracks: &[Track],
    detections: &[Detection],
    gate: &Gate,
) -> u64 {
    let before = answer.pairs.len();
    answer.pairs.retain(|pair| {
        let known = tracks.get(pair.track).zip(detections.get(pair.detection));
        let admitted = known.is_some_and(|(track, detection)| gate.admits(track, detection));
        admitted && pair.weight > 0.0 && pair.weight <= 1.0
    });
    (before - answer.pairs.len()) as u64
}
