use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use nalgebra::Point3;
use tagalong_core::{
    Command, Detection, Estimate, Evidence, Filter, Frame, Funnel, Inputs, Likelihood, Matched,
    Motion, Reason, Search, Stamp, Track, TrackId, Verifier,
};
use tagalong_odometry::VisualOdometry;
use tagalong_stereo::StereoDepth;

use crate::boundary::{contain, guard};
use crate::clock::{Clock, Tick};
use crate::control::{Steered, Steering};
use crate::doubts::Doubts;
use crate::lifecycle::{Lifecycle, Sight};
use crate::memo::{self, Identities};
use crate::now::Now;
use crate::occlusion::{
    Cover, Visibility, aside, cover, cover_seen, part_shown, range_m, visibility,
};
use crate::sightings::{Rules, Sighting};
use crate::slots::{DetectorSlot, Slot, likelihood};
use crate::weighing::Metered;
use crate::{Fate, FrameReport, Orders, Outcome, PipelineSettings, Role, StepError};

/// Plugins and the rules by which they work together.
pub struct Pipeline {
    pub(crate) settings: PipelineSettings,
    pub(crate) inputs: Inputs,
    pub(crate) stereo: Option<StereoDepth>,
    pub(crate) odometry: Option<VisualOdometry>,
    pub(crate) detectors: Vec<DetectorSlot>,
    pub(crate) verifiers: Vec<Slot<dyn Verifier>>,
    pub(crate) filter: Slot<dyn Filter>,
    pub(crate) steering: Option<Steering>,
    pub(crate) resolved: String,
    pub(crate) clock: Clock,
    pub(crate) lifecycle: Lifecycle,
    pub(crate) doubts: Doubts,
    /// Processed frames.
    pub(crate) frames: u64,
    pub(crate) failed: Option<u64>,
    pub(crate) sketches: bool,
    /// Where relative paths of the config start.
    pub(crate) base_dir: PathBuf,
    /// Set where answers are shared with other pipelines.
    pub(crate) shared: Option<Identities>,
}

/// Log-odds that stand for certainty. Larger ones would drown all others.
const CERTAIN: f64 = 100.0;

const STAGES: [&str; 10] = [
    "stereo",
    "odometry",
    "predict",
    "follow",
    "discover",
    "associate",
    "update",
    "life cycle",
    "learn",
    "control",
];

impl Pipeline {
    /// Takes one frame through the pipeline. What the frame holds beside
    /// [`Pipeline::inputs`] is not looked at.
    ///
    /// # Errors
    /// [`StepError`] if a plugin fails or panics. The pipeline is stopped then:
    /// each further call fails.
    pub fn step(&mut self, frame: &Frame) -> Result<FrameReport, StepError> {
        if let Some(failed) = self.failed {
            return Err(StepError::Stopped { frame: failed });
        }
        let restricted = frame.restricted_to(&self.inputs);
        let report = self
            .process(restricted.as_ref().unwrap_or(frame))
            .map_err(|error| error.blame_declaration(frame));
        if report.is_err() {
            self.failed = Some(frame.index);
            self.disarm("a plugin failed");
        }
        report
    }

    /// Returns the inputs that the plugins and the stages declare, but those that the
    /// config does without: the program that makes frames need not read others.
    pub fn inputs(&self) -> Inputs {
        self.inputs
    }

    /// What the wheels may do at a time, by the clock of the frames' stamps: the
    /// last command until it expires, zero after that, after a fault and before
    /// the first frame. A control loop asks at its own rate. `None` without a
    /// controller.
    pub fn command_at(&self, now: Stamp) -> Option<Command> {
        Some(self.orders()?.at(now))
    }

    /// A copy of what [`Pipeline::command_at`] answers from, for a thread of its own.
    pub fn orders(&self) -> Option<Orders> {
        Some(self.steering.as_ref()?.governor().orders())
    }

    /// Follows the person of this track from the next frame on, and forgets whom
    /// it followed before.
    pub fn choose_target(&mut self, track: TrackId) {
        if let Some(steering) = &mut self.steering {
            steering.follow(track);
        }
    }

    /// True if the config has a controller: frames lead to commands.
    pub fn has_controller(&self) -> bool {
        self.steering.is_some()
    }

    /// The distance that the controller keeps from the person, m, if there is a
    /// controller and it keeps one.
    pub fn stand_off_m(&self) -> Option<f64> {
        self.steering.as_ref()?.stand_off_m()
    }

    /// Why nothing moves until [`Pipeline::arm`], if so.
    pub fn fault(&self) -> Option<&'static str> {
        self.steering.as_ref()?.governor().fault()
    }

    /// Stops the robot until [`Pipeline::arm`]: somebody pressed a button, or
    /// whoever makes the frames found a fault that no frame shows.
    pub fn disarm(&mut self, why: &'static str) {
        if let Some(steering) = &mut self.steering {
            steering.governor_mut().latch(why);
        }
    }

    /// Lets the robot move again after a fault, once a person has looked. A
    /// plugin that failed stays stopped, and with it the pipeline.
    pub fn arm(&mut self) {
        if let Some(steering) = self.steering.as_mut().filter(|_| self.failed.is_none()) {
            steering.governor_mut().arm();
        }
    }

    /// Lets the filter show its work in [`FrameReport::sketch`]. That takes time,
    /// which counts as that of the stage `update`, and changes nothing else.
    pub fn sketch(&mut self, wanted: bool) {
        self.sketches = wanted;
    }

    /// Shares what detectors and verifiers say of a frame with other pipelines that are
    /// shown the very same frame and share, too: what was answered once is not worked out
    /// again. The reports are the same; a search for settings takes less time.
    pub fn share_findings(&mut self) {
        let resolved: toml::Table = toml::from_str(&self.resolved).unwrap_or_default();
        let around = format!(
            "{} {} {:?}",
            self.base_dir.display(),
            self.settings.seed,
            resolved.get("robot")
        );
        let identity = |kind: &str, at: usize| {
            let section = resolved.get(kind).and_then(|sections| sections.get(at));
            let part = |name: &str| section.and_then(|section| section.get(name));
            format!("{kind} {at} {around} {:?} {:?}", part("plugin"), part("config"))
        };
        let detectors = self.detectors.iter().enumerate().map(|(at, slot)| {
            let forgets = !slot.plugin.remembers();
            forgets.then(|| identity("detectors", at))
        });
        self.shared = Some(Identities {
            detectors: detectors.collect(),
            verifiers: (0..self.verifiers.len()).map(|at| identity("verifiers", at)).collect(),
        });
    }

    /// The stages that [`FrameReport::timings`] names, in their order.
    pub fn stage_names(&self) -> &'static [&'static str] {
        &STAGES
    }

    /// The config with every default filled in, as TOML.
    pub fn resolved(&self) -> String {
        self.resolved.clone()
    }

    fn process(&mut self, frame: &Frame) -> Result<FrameReport, StepError> {
        let mut now = Now::new(frame);
        let motion = match self.clock.tick(frame, &mut now.report.funnel) {
            Tick::Skip(outcome) => return Ok(FrameReport { outcome, ..now.report }),
            Tick::Go(outcome, motion) => {
                now.report.outcome = outcome;
                motion
            }
        };
        let with_depth = self.see_depth(&mut now)?;
        now.frame = with_depth.as_ref().unwrap_or(frame);
        now.lap(STAGES[0]);
        let motion = self.see_motion(&mut now, motion)?;
        now.lap(STAGES[1]);
        self.break_off(&mut now)?;
        self.predict(&mut now, motion)?;
        now.lap(STAGES[2]);
        self.follow(&mut now)?;
        now.lap(STAGES[3]);
        self.discover(&mut now)?;
        now.lap(STAGES[4]);
        self.associate(&mut now);
        now.lap(STAGES[5]);
        self.update(&mut now)?;
        now.lap(STAGES[6]);
        self.live(&mut now)?;
        now.lap(STAGES[7]);
        self.learn(&mut now)?;
        now.lap(STAGES[8]);
        self.steer(&mut now)?;
        now.lap(STAGES[9]);
        self.frames += 1;
        Ok(now.finish())
    }

    /// The frame with depth from its stereo pair, where it has none and the
    /// config wants it.
    fn see_depth(&mut self, now: &mut Now<'_>) -> Result<Option<Frame>, StepError> {
        let Some(stereo) = self.stereo.as_mut().filter(|_| now.frame.depth().is_err()) else {
            return Ok(None);
        };
        let (frame, funnel) = (now.frame, &mut now.report.funnel);
        let depth = guard(STAGES[0], frame.index, || stereo.depth(frame, funnel))?;
        Ok(Some(frame.with_depth(depth)))
    }

    /// The robot's motion, as far as the images show it; without one, nothing that was
    /// seen before is of use.
    fn see_motion(
        &mut self,
        now: &mut Now<'_>,
        by_wheels: Option<Motion>,
    ) -> Result<Option<Motion>, StepError> {
        if self.odometry.is_none() {
            return Ok(by_wheels);
        }
        let people: Vec<_> =
            self.believed(now)?.values().map(|person| person.person.position.xy()).collect();
        let Some(odometry) = &mut self.odometry else { return Ok(by_wheels) };
        let (frame, funnel) = (now.frame, &mut now.report.funnel);
        guard(STAGES[1], frame.index, || Ok(odometry.see(frame, by_wheels, &people, funnel)))
    }

    /// Ends the tracks that a jump of the clock cuts off.
    fn break_off(&mut self, now: &mut Now<'_>) -> Result<(), StepError> {
        let (ids, test) = match now.report.outcome {
            Outcome::ResetBackward { .. } => (self.lifecycle.ids(), "track: clock set back"),
            Outcome::ResetForward { .. } => (self.lifecycle.ids(), "track: clock jumped ahead"),
            Outcome::Gap { .. } => (self.lifecycle.tentative_ids(), "track: gap in the log"),
            _ => return Ok(()),
        };
        if !matches!(now.report.outcome, Outcome::Gap { .. })
            && let Some(steering) = &mut self.steering
        {
            steering.reset();
        }
        self.doubts.clear();
        ids.into_iter().try_for_each(|id| self.end(now, id, test))
    }

    /// Every belief, into the robot's new frame; then whom to expect where.
    fn predict(&mut self, now: &mut Now<'_>, motion: Option<Motion>) -> Result<(), StepError> {
        if let Some(motion) = motion {
            now.report.motion = motion;
            let Slot { name, plugin: filter } = &mut self.filter;
            contain(name, now.frame.index, || filter.predict(&motion))?;
            self.lifecycle.grow_older(motion.dt);
            self.doubts.predict(&motion, self.lifecycle.settings());
        }
        now.due = self.due();
        let estimates = self.estimates(now)?;
        now.expected = self.tracks(now.frame, estimates);
        Ok(())
    }

    /// Where is each expected person now? Near to far; whoever a found, nearer
    /// person hides is not looked for.
    fn follow(&mut self, now: &mut Now<'_>) -> Result<(), StepError> {
        let followers = self.due_with(now, Role::Follow);
        if followers.is_empty() {
            return Ok(());
        }
        let mut covers: Vec<Cover> = Vec::new();
        for track in now.expected.clone() {
            if self.visibility(now.frame, &track, &covers) != Visibility::Visible {
                continue;
            }
            let Some(found) = self.find(now, &followers, &track)? else { continue };
            covers.push(cover_seen(&found.detection, &track.estimate, now.frame));
            now.sightings.add(found);
        }
        Ok(())
    }

    /// The best sighting of one track.
    fn find(
        &mut self,
        now: &mut Now<'_>,
        followers: &[usize],
        track: &Track,
    ) -> Result<Option<Sighting>, StepError> {
        let mut best: Option<Sighting> = None;
        for &index in followers {
            for sighting in self.detect(now, index, &Search::Near(track))? {
                let test = self.rules(now).misfit(track, &sighting).or_else(|| {
                    let better = |b: &Sighting| b.detection.score >= sighting.detection.score;
                    best.as_ref().is_some_and(better).then_some("not the best sighting")
                });
                let dropped = match test {
                    Some(test) => Some((sighting, test)),
                    None => best.replace(sighting).map(|worse| (worse, "not the best sighting")),
                };
                if let Some((sighting, test)) = dropped {
                    now.sightings.add(Sighting { fate: Some(Fate::Dropped(test)), ..sighting });
                }
            }
        }
        Ok(best)
    }

    /// Who is here that was not found yet?
    fn discover(&mut self, now: &mut Now<'_>) -> Result<(), StepError> {
        let occupied: Vec<Detection> = now.sightings.undecided_detections();
        for index in self.due_with(now, Role::Discover) {
            let search = Search::Everywhere { occupied: &occupied };
            for sighting in self.detect(now, index, &search)? {
                now.sightings.add(sighting);
            }
        }
        now.sightings.limit(self.settings.association.max_detections);
        Ok(())
    }

    fn associate(&mut self, now: &mut Now<'_>) {
        let rules = self.rules(now);
        now.sightings.merge(rules.association);
        now.sightings.associate(&now.expected, &rules);
        self.widen(now);
    }

    /// Lets sightings of who is half hidden say less of the place.
    fn widen(&self, now: &mut Now<'_>) {
        let settings = &self.settings.occlusion;
        if settings.body_width_m == 0.0 {
            return;
        }
        let camera = &now.frame.camera;
        let mut covers: Vec<Cover> = Vec::new();
        for track in &now.expected {
            let Estimate { region, person, .. } = &track.estimate;
            let Some(seen) = now.sightings.of_track_mut(track.id) else {
                covers.extend(track.confirmed.then(|| cover(&track.estimate, now.frame)));
                continue;
            };
            let part = part_shown(region, &person.position, &covers, camera, settings);
            seen.covariance += aside(part, &seen.position, camera, settings);
            covers.push(cover_seen(seen, &track.estimate, now.frame));
        }
    }

    /// Hands the evidence to the filter.
    fn update(&mut self, now: &mut Now<'_>) -> Result<(), StepError> {
        let matched: Vec<Matched<'_>> = now
            .sightings
            .matched()
            .map(|(id, s)| Matched { id, detection: &s.detection })
            .collect();
        let unmatched = now.sightings.undecided_detections();
        let metered = likelihood(&self.detectors).map(Metered::new);
        let likelihood = metered.as_ref().map(|metered| metered as &dyn Likelihood);
        let evidence =
            Evidence { frame: now.frame, matched: &matched, unmatched: &unmatched, likelihood };
        let Slot { name, plugin: filter } = &mut self.filter;
        now.supports = guard(name, now.frame.index, || filter.update(&evidence))?;
        now.report.weighing = metered.as_ref().map(Metered::weighing).unwrap_or_default();
        if self.sketches {
            now.report.sketch = guard(name, now.frame.index, || filter.sketch(&evidence))?;
        }
        self.check_supports(now);
        Ok(())
    }

    /// A filter may support only tracks that live, by finite numbers.
    fn check_supports(&self, now: &mut Now<'_>) {
        let before = now.supports.len();
        now.supports.retain(|id, _| self.lifecycle.get(*id).is_some());
        let unknown = before - now.supports.len();
        now.report.funnel.drop_many("support of an unknown track", unknown as u64);
        now.sightings.reject(|id| now.supports.contains_key(&id), "filter");
        for (id, support) in &now.supports {
            match support.nis {
                Some((nis, dof)) if nis.is_finite() => now.report.nis.push((*id, nis, dof)),
                Some(_) => now.report.funnel.drop_many("nis not finite", 1),
                None => {}
            }
        }
    }

    /// Newcomers start; who was not seen for too long ends.
    fn live(&mut self, now: &mut Now<'_>) -> Result<(), StepError> {
        let newcomers = self.start_newcomers(now)?;
        let estimates = self.estimates(now)?;
        let covers: Vec<Cover> = now
            .supports
            .keys()
            .chain(&newcomers)
            .filter_map(|id| estimates.get(id))
            .map(|e| cover(e, now.frame))
            .collect();
        for track in self.tracks(now.frame, estimates.clone()) {
            if newcomers.contains(&track.id) {
                continue;
            }
            let sight = self.sight(now, &track, &covers);
            if let Some(test) = self.lifecycle.advance(track.id, sight) {
                self.end(now, track.id, test)?;
            }
        }
        self.thin_out(now, &estimates)?;
        now.report.tracks = self.tracks(now.frame, estimates);
        Ok(())
    }

    /// Detections that belong to nobody start tracks.
    fn start_newcomers(&mut self, now: &mut Now<'_>) -> Result<BTreeSet<TrackId>, StepError> {
        let mut started = BTreeSet::new();
        let start_score = self.settings.lifecycle.start_score;
        let undecided = now.sightings.undecided();
        if undecided.is_empty() {
            return Ok(started);
        }
        let known = self.supported_places(now)?;
        for index in undecided {
            let sighting = now.sightings.get(index).clone();
            if self.is_known(&known, &sighting.detection) {
                now.sightings.settle(index, Fate::Dropped("tracked already"));
                continue;
            }
            let log_odds = self.log_odds(&sighting);
            if log_odds < start_score {
                let alone = sighting.detection.score < start_score;
                let test = if alone { sighting.score_test(start_score) } else { "doubt" };
                now.sightings.settle(index, Fate::Dropped(test));
                continue;
            }
            if !sighting.is_discovery {
                now.sightings.settle(index, Fate::Dropped("no track fits"));
                continue;
            }
            let Some(id) = self.lifecycle.start(log_odds, sighting.detector) else {
                now.sightings.settle(index, Fate::Dropped("no track numbers left"));
                continue;
            };
            let Slot { name, plugin: filter } = &mut self.filter;
            contain(name, now.frame.index, || filter.start(id, &sighting.detection))?;
            now.sightings.settle(index, Fate::Started(id));
            started.insert(id);
        }
        Ok(started)
    }

    /// That a newcomer is a person. Doubts are of places that were searched for newcomers.
    fn log_odds(&mut self, sighting: &Sighting) -> f64 {
        match sighting.is_discovery {
            true => self.doubts.hear(&sighting.detection, self.lifecycle.settings()),
            false => sighting.detection.score,
        }
    }

    /// Where the people are whom this frame supports.
    fn supported_places(&mut self, now: &Now<'_>) -> Result<Vec<Point3<f64>>, StepError> {
        let mut estimates = self.believed(now)?;
        estimates.retain(|id, _| now.supports.contains_key(id));
        Ok(estimates.values().map(|estimate| estimate.person.position).collect())
    }

    /// True for a sighting at the place of somebody who is seen there: what it
    /// started would be a duplicate.
    fn is_known(&self, known: &[Point3<f64>], detection: &Detection) -> bool {
        let away = |place: &Point3<f64>| (place - detection.position).xy().norm();
        known.iter().any(|place| away(place) < self.settings.lifecycle.duplicate_m)
    }

    /// What this frame says of a track.
    fn sight(&self, now: &Now<'_>, track: &Track, covers: &[Cover]) -> Sight {
        if now.supports.contains_key(&track.id) {
            let sighting = now.sightings.of_track(track.id);
            return Sight::Seen(sighting.map(|s| (s.detection.score, s.detector)));
        }
        match self.visibility(now.frame, track, covers) {
            Visibility::Hidden => Sight::Hidden,
            Visibility::Outside => Sight::Outside,
            Visibility::Visible if self.was_asked(now, track.id) => Sight::Missed,
            Visibility::Visible => Sight::NotAsked,
        }
    }

    /// True if who saw the track last had a look at this frame. The silence of
    /// a detector on a frame that is another's turn is no miss.
    fn was_asked(&self, now: &Now<'_>, id: TrackId) -> bool {
        let detector = self.lifecycle.get(id).and_then(|life| life.detector);
        self.filter.plugin.weighs_scenes() || detector.is_none_or(|d| now.due.contains(&d))
    }

    /// Ends duplicates and what exceeds the limit.
    fn thin_out(
        &mut self,
        now: &mut Now<'_>,
        estimates: &BTreeMap<TrackId, Estimate>,
    ) -> Result<(), StepError> {
        let mut alive = estimates.clone();
        alive.retain(|id, _| self.lifecycle.get(*id).is_some());
        for id in self.lifecycle.duplicates(&alive) {
            self.end(now, id, "track: duplicate")?;
        }
        for id in self.lifecycle.too_many() {
            self.end(now, id, "track: too many")?;
        }
        Ok(())
    }

    /// Appearance models adapt.
    fn learn(&mut self, now: &mut Now<'_>) -> Result<(), StepError> {
        for slot in &mut self.detectors {
            let (frame, tracks) = (now.frame, &now.report.tracks);
            guard(&slot.settings.plugin, frame.index, || slot.plugin.learn(frame, tracks))?;
        }
        Ok(())
    }

    /// Steers after the target; stops without one.
    fn steer(&mut self, now: &mut Now<'_>) -> Result<(), StepError> {
        let Some(steering) = &mut self.steering else { return Ok(()) };
        let Steered { command, target, lock } =
            steering.steer(now.frame, &now.report.motion, &now.report.tracks)?;
        now.report
            .funnel
            .drop_many("command not finite", u64::from(command.reason == Reason::NotFinite));
        now.report.target = target;
        now.report.lock = Some(lock);
        now.report.command = Some(command);
        Ok(())
    }

    /// Asks a detector, and the verifiers about its answers.
    fn detect(
        &mut self,
        now: &mut Now<'_>,
        index: usize,
        search: &Search<'_>,
    ) -> Result<Vec<Sighting>, StepError> {
        let (frame, slot) = (now.frame, &mut self.detectors[index]);
        let funnel = &mut now.report.funnel;
        let identity = self.shared.as_ref().and_then(|shared| shared.detectors[index].as_deref());
        let found = guard(&slot.settings.plugin, frame.index, || match identity {
            Some(identity) => memo::found(identity, frame, search, funnel, |funnel| {
                slot.plugin.detect(frame, search, funnel)
            }),
            None => slot.plugin.detect(frame, search, funnel),
        })?;
        let is_discovery = matches!(search, Search::Everywhere { .. });
        let mut sightings = Vec::new();
        for detection in found {
            if !detection.is_sane() {
                funnel.drop_many("detection not finite", 1);
                continue;
            }
            let sighting = Sighting::new(detection, index, is_discovery);
            if self.detectors[index].settings.verify {
                sightings.extend(self.verify(frame, sighting, funnel)?);
            } else {
                sightings.push(sighting);
            }
        }
        Ok(sightings)
    }

    /// Adds the verifiers' log-odds to the score.
    fn verify(
        &mut self,
        frame: &Frame,
        mut sighting: Sighting,
        funnel: &mut Funnel,
    ) -> Result<Option<Sighting>, StepError> {
        let mut sum = 0.0;
        for (at, Slot { name, plugin: verifier }) in self.verifiers.iter_mut().enumerate() {
            let candidate = &sighting.detection;
            sum += guard(name, frame.index, || match &self.shared {
                Some(shared) => memo::margin(&shared.verifiers[at], frame, candidate, || {
                    verifier.margin(frame, candidate)
                }),
                None => verifier.margin(frame, candidate),
            })?;
        }
        if !sum.is_finite() {
            funnel.drop_at("verifier not finite", sighting.detection.region);
            return Ok(None);
        }
        sighting.detection.score = (sighting.detection.score + sum).clamp(-CERTAIN, CERTAIN);
        Ok(Some(sighting))
    }

    /// The beliefs of all tracks. One that is missing or not finite ends its
    /// track: no such number leaves the pipeline.
    fn estimates(&mut self, now: &mut Now<'_>) -> Result<BTreeMap<TrackId, Estimate>, StepError> {
        let mut all = self.believed(now)?;
        let before = all.len();
        all.retain(|id, _| self.lifecycle.get(*id).is_some());
        now.report.funnel.drop_many("estimate of an unknown track", (before - all.len()) as u64);
        for id in self.lifecycle.ids() {
            if !all.get(&id).is_some_and(Estimate::is_sane) {
                all.remove(&id);
                self.end(now, id, "track: estimate not finite")?;
            }
        }
        Ok(all)
    }

    /// What the filter says of the people, as it says it.
    fn believed(&mut self, now: &Now<'_>) -> Result<BTreeMap<TrackId, Estimate>, StepError> {
        let Slot { name, plugin: filter } = &mut self.filter;
        contain(name, now.frame.index, || filter.estimates(&now.frame.camera))
    }

    fn end(&mut self, now: &mut Now<'_>, id: TrackId, test: &'static str) -> Result<(), StepError> {
        let Slot { name, plugin: filter } = &mut self.filter;
        contain(name, now.frame.index, || filter.stop(id))?;
        self.lifecycle.end(id);
        now.supports.remove(&id);
        now.report.nis.retain(|(track, _, _)| *track != id);
        now.report.funnel.drop_many(test, 1);
        now.report.ended.push(id);
        Ok(())
    }

    /// Living tracks, near to far.
    fn tracks(&self, frame: &Frame, estimates: BTreeMap<TrackId, Estimate>) -> Vec<Track> {
        let mut tracks: Vec<Track> = estimates
            .into_iter()
            .filter_map(|(id, estimate)| self.lifecycle.track(id, estimate))
            .collect();
        let range = |t: &Track| range_m(&t.estimate.person.position, &frame.camera);
        tracks.sort_by(|a, b| range(a).total_cmp(&range(b)).then(a.id.cmp(&b.id)));
        tracks
    }

    fn visibility(&self, frame: &Frame, track: &Track, covers: &[Cover]) -> Visibility {
        let Estimate { region, person, .. } = &track.estimate;
        visibility(region, &person.position, covers, &frame.camera, &self.settings.occlusion)
    }

    fn rules(&self, now: &Now<'_>) -> Rules<'_> {
        Rules {
            association: &self.settings.association,
            start_score: self.lifecycle.settings().start_score,
            dt_s: now.report.motion.dt,
        }
    }

    fn due(&self) -> Vec<usize> {
        (0..self.detectors.len()).filter(|i| self.detectors[*i].is_due(self.frames)).collect()
    }

    fn due_with(&self, now: &Now<'_>, role: Role) -> Vec<usize> {
        now.due.iter().copied().filter(|i| self.detectors[*i].has(role)).collect()
    }
}
