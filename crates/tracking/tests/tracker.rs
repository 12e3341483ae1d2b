//! The tracker with scripted plugins: what it makes of their answers, right and wrong.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use nalgebra::{Matrix3, Point3, SMatrix, Vector2};
use tagalong_associators::hungarian::Hungarian;
use tagalong_core::{
    Association, Associations, Associator, Capabilities, DepthImage, Detection, Detector,
    EgoMotion, Estimate, Evidence, Filter, FilterRequirements, Frame, Funnel, Gate, Images, Input,
    Inputs, Likelihood, PerPerson, Person, Query, Result, Stamp, Track, TrackId, Update, Verifier,
    Visualisation,
};
use tagalong_filters::last_seen::LastSeen;
use tagalong_geometry::{Camera, Pinhole};
use tagalong_track_managers::m_of_n::MOfN;
use tagalong_tracking::{
    DetectorSettings, DetectorSlot, Guarded, Identities, Outcome, Parts, Preprocessed,
    Preprocessor, Role, STAGES, Tracker, TrackerSettings, TrackingReport,
};
use tagalong_vision::Describer;

fn camera() -> Camera {
    Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0)
}

/// Returns a frame at a time, s, of a robot that drove so far ahead, m.
fn taken(index: u64, t_s: f64, forward: f64) -> Frame {
    let stamp = Stamp::from_nanos(1_000_000_000_000).plus_seconds(t_s);
    let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
    Frame::new(index, stamp, Arc::new(camera()), motion, Images::default())
}

/// Returns the frame of this index, a tenth of a second after the one before.
fn driven(index: u64, forward: f64) -> Frame {
    taken(index, 0.1 * index as f64, forward)
}

fn frame(index: u64) -> Frame {
    driven(index, 0.0)
}

fn person(x: f64, y: f64) -> Detection {
    Detection::new("script", Point3::new(x, y, 1.6), Matrix3::identity() * 0.01, 1.0)
}

/// A query: the frame, and the track that was searched for, if it was one.
type Asked = (u64, Option<u32>);

/// Finds the same people in each frame, and near a track those within half a metre.
#[derive(Clone, Default)]
struct Script {
    people: Arc<Mutex<Vec<Detection>>>,
    asked: Arc<Mutex<Vec<Asked>>>,
    learned: Arc<Mutex<Vec<usize>>>,
    /// True if it needs the detections of another program.
    awaits_message: bool,
}

impl Script {
    fn of(people: impl IntoIterator<Item = Detection>) -> Self {
        let script = Self::default();
        script.show(people);
        script
    }

    /// Changes the people that are found from now on.
    fn show(&self, people: impl IntoIterator<Item = Detection>) {
        *self.people.lock().unwrap() = people.into_iter().collect();
    }

    fn asked(&self) -> Vec<Asked> {
        self.asked.lock().unwrap().clone()
    }

    fn slot(&self, roles: &[Role]) -> DetectorSlot {
        let settings = DetectorSettings { roles: roles.to_vec(), ..DetectorSettings::default() };
        DetectorSlot { settings, plugin: Guarded::new("script", Box::new(self.clone())) }
    }
}

impl Detector for Script {
    fn capabilities(&self) -> Capabilities {
        let awaited = Inputs::NONE.require(Input::Detections);
        let inputs = if self.awaits_message { awaited } else { Inputs::NONE };
        Capabilities::new(inputs).discovering().tracking().weighing()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        _: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let track = match query {
            Query::Track(track) => Some(*track),
            Query::Discover { .. } => None,
        };
        self.asked.lock().unwrap().push((frame.index, track.map(|track| track.id.0)));
        let mut found = self.people.lock().unwrap().clone();
        if let Some(track) = track {
            found.retain(|one| (one.position - track.estimate.person.position).norm() < 0.5);
        }
        Ok(found)
    }

    fn learn(&mut self, _: &Frame, tracks: &[Track]) -> Result<()> {
        self.learned.lock().unwrap().push(tracks.len());
        Ok(())
    }

    fn likelihood(&self) -> Option<&dyn Likelihood> {
        Some(self)
    }
}

impl Likelihood for Script {
    fn log_likelihood(&self, _: &Frame, scene: &[Person]) -> Result<f64> {
        Ok(scene.len() as f64)
    }
}

/// Parts without a detector: nearest pairs, people where they were seen last, two sightings.
fn parts() -> Parts {
    let hungarian = Hungarian::new(Default::default()).unwrap();
    let last_seen = PerPerson::new(LastSeen::new(Default::default()).unwrap());
    let manager = MOfN::new(Default::default()).unwrap();
    Parts {
        preprocessors: Vec::new(),
        detectors: Vec::new(),
        verifiers: Vec::new(),
        associator: Guarded::new("hungarian", Box::new(hungarian)),
        filter: Guarded::new("last-seen", Box::new(last_seen)),
        manager: Guarded::new("m-of-n", Box::new(manager)),
        describer: Describer::default(),
    }
}

/// Returns a tracker with one detector that discovers people.
fn discovers(script: &Script, settings: TrackerSettings) -> Tracker {
    let detectors = vec![script.slot(&[Role::Discover])];
    Tracker::new(Parts { detectors, ..parts() }, settings)
}

/// Takes the tracker through some frames, and returns the report of the last one.
fn run(tracker: &mut Tracker, frames: std::ops::RangeInclusive<u64>) -> TrackingReport {
    let reports = frames.map(|index| tracker.step(&frame(index)).unwrap().report);
    reports.last().unwrap()
}

fn ids(tracks: &[Track]) -> Vec<u32> {
    tracks.iter().map(|track| track.id.0).collect()
}

#[test]
fn a_person_keeps_the_number_and_the_place_on_the_floor_while_the_robot_drives() {
    let script = Script::default();
    let mut tracker = discovers(&script, TrackerSettings::default());
    for index in 1..=4 {
        script.show([person(5.0 - 0.1 * index as f64, 0.5)]);
        let report = tracker.step(&driven(index, 0.1)).unwrap().report;
        let [track] = &report.tracks[..] else { panic!("{:?}", report.tracks) };
        assert_eq!((track.id.0, track.seen, track.unseen_s), (1, true, 0.0));
        assert_eq!((track.confirmed, track.age), (index >= 2, index as u32 - 1));
        assert_eq!(report.candidates[0].track(), Some(TrackId(1)));
    }
    script.show([]);
    let report = tracker.step(&driven(5, 0.1)).unwrap().report;
    let [track] = &report.tracks[..] else { panic!("{:?}", report.tracks) };
    assert!(!track.seen && (track.unseen_s - 0.1).abs() < 1e-9, "{track:?}");
    assert!((track.estimate.person.position.x - 4.5).abs() < 1e-9, "{track:?}");
    assert_eq!(*script.learned.lock().unwrap(), [1; 5]);
}

#[test]
fn a_person_who_is_gone_is_forgotten_and_the_next_one_has_another_number() {
    let script = Script::of([person(3.0, 0.0)]);
    let mut tracker = discovers(&script, TrackerSettings::default());
    run(&mut tracker, 1..=3);
    script.show([]);
    assert_eq!(ids(&run(&mut tracker, 4..=13).tracks), [1], "a second long");
    let report = run(&mut tracker, 14..=14);
    assert_eq!((ids(&report.tracks), report.ended), (vec![], vec![TrackId(1)]));
    script.show([person(3.0, 0.0)]);
    assert_eq!(ids(&run(&mut tracker, 15..=16).tracks), [2]);
}

/// A new track ends after two misses.
#[test]
fn a_frame_on_which_the_detector_does_not_run_is_no_miss() {
    let script = Script::of([person(3.0, 0.0)]);
    let mut slot = script.slot(&[Role::Discover]);
    slot.settings.every = 4;
    slot.settings.offset = 1;
    let parts = Parts { detectors: vec![slot], ..parts() };
    let mut tracker = Tracker::new(parts, TrackerSettings::default());
    let report = run(&mut tracker, 1..=5);
    assert_eq!((ids(&report.tracks), report.tracks[0].seen), (vec![1], false));
    assert!(run(&mut tracker, 6..=6).tracks[0].confirmed);
    assert_eq!(script.asked(), [(2, None), (6, None)]);
}

/// The other detector runs on each frame and finds no person.
#[test]
fn the_silence_of_a_detector_is_no_miss_of_the_tracks_of_another() {
    let script = Script::of([person(3.0, 0.0)]);
    let mut slot = script.slot(&[Role::Discover]);
    slot.settings.every = 4;
    let detectors = vec![Script::default().slot(&[Role::Discover]), slot];
    let mut tracker = Tracker::new(Parts { detectors, ..parts() }, TrackerSettings::default());
    assert_eq!(ids(&run(&mut tracker, 1..=4).tracks), [1]);
    assert!(run(&mut tracker, 5..=5).tracks[0].confirmed);
}

#[test]
fn a_person_behind_another_is_not_searched_for_and_not_missed() {
    let script = Script::of([person(2.0, 0.0), person(4.0, 1.0)]);
    let detectors = vec![script.slot(&[Role::Discover, Role::Track])];
    let mut tracker = Tracker::new(Parts { detectors, ..parts() }, TrackerSettings::default());
    assert_eq!(ids(&run(&mut tracker, 1..=3).tracks), [1, 2]);
    for index in 4..=8 {
        // The near one steps aside, before the other one.
        script.show([person(2.0, 0.1 * (index - 3) as f64), person(4.0, 1.0)]);
        run(&mut tracker, index..=index);
    }
    script.asked.lock().unwrap().clear();
    script.show([person(2.0, 0.5)]);
    let report = run(&mut tracker, 9..=25);
    assert_eq!(ids(&report.tracks), [1, 2], "kept for longer than a second");
    assert!(report.tracks[1].occluded && !report.tracks[0].occluded);
    let asked = script.asked();
    assert!(asked.contains(&(25, Some(1))) && !asked.contains(&(25, Some(2))), "{asked:?}");
}

#[test]
fn a_detection_that_a_search_found_must_fit_its_track() {
    let sharp = person(3.0, 0.0).with_covariance(Matrix3::identity() * 1e-4);
    let script = Script::of([sharp.clone()]);
    let follower = Script::default();
    let detectors = vec![script.slot(&[Role::Discover]), follower.slot(&[Role::Track])];
    let mut tracker = Tracker::new(Parts { detectors, ..parts() }, TrackerSettings::default());
    run(&mut tracker, 1..=2);
    script.show([]);
    let unlikely = sharp.clone().with_score(-9.0);
    let grown = sharp.with_position(Point3::new(3.0, 0.3, 1.9));
    follower.show([unlikely, grown, person(3.0, 0.05)]);
    let report = run(&mut tracker, 3..=3);
    assert_eq!([report.funnel.count("score"), report.funnel.count("gate")], [1, 1]);
    assert_eq!(report.tracks[0].estimate.person.position.y, 0.05);
}

#[test]
fn a_jump_of_the_clock_ends_all_tracks_and_a_gap_the_tentative_ones() {
    fn after(seconds: f64) -> (Outcome, Vec<u32>, Vec<&'static str>) {
        let script = Script::of([person(3.0, 0.0)]);
        let mut tracker = discovers(&script, TrackerSettings::default());
        run(&mut tracker, 1..=4);
        script.show([person(3.0, 0.0), person(4.0, 1.5)]);
        run(&mut tracker, 5..=5);
        let report = tracker.step(&taken(6, 0.5 + seconds, 0.0)).unwrap().report;
        let tests = report.funnel.entries().iter().map(|dropped| dropped.test);
        (report.outcome, ids(&report.tracks), tests.collect())
    }

    let (outcome, tracks, tests) = after(-7.0);
    assert!(matches!(outcome, Outcome::ResetBackward { .. }), "{outcome:?}");
    assert_eq!((tracks, tests), (vec![3, 4], vec!["track: clock set back"]));
    let (_, tracks, tests) = after(7.0);
    assert_eq!((tracks, tests), (vec![3, 4], vec!["track: long gap in the log"]));
    let (_, tracks, tests) = after(0.6);
    assert_eq!((tracks, tests), (vec![1, 3], vec!["track: gap in the log"]));
    let (_, tracks, tests) = after(0.1);
    assert_eq!((tracks, tests), (vec![1, 2], vec![]));
}

#[test]
fn a_late_frame_changes_nothing() {
    let script = Script::of([person(3.0, 0.0)]);
    let mut tracker = discovers(&script, TrackerSettings::default());
    run(&mut tracker, 1..=2);
    let late = tracker.step(&frame(2)).unwrap().report;
    assert_eq!((late.outcome, late.tracks.len()), (Outcome::Duplicate, 0));
    assert!(!late.outcome.is_processed());
    let next = run(&mut tracker, 3..=3);
    assert!(next.outcome.is_processed());
    assert_eq!((ids(&next.tracks), next.tracks[0].age), (vec![1], 2));
}

#[test]
fn two_tracks_of_one_person_become_the_older_one() {
    let mut settings = TrackerSettings::default();
    settings.merge.same_person_m = 0.01;
    let script = Script::of([person(3.0, 0.0), person(3.0, 0.5)]);
    let mut tracker = discovers(&script, settings);
    run(&mut tracker, 1..=3);
    script.show([person(3.0, 0.0), person(3.0, 0.3)]);
    run(&mut tracker, 4..=4);
    script.show([person(3.0, 0.0), person(3.0, 0.15)]);
    assert_eq!(ids(&run(&mut tracker, 5..=6).tracks), [1, 2]);
    let report = run(&mut tracker, 7..=7);
    assert_eq!((ids(&report.tracks), report.ended), (vec![1], vec![TrackId(2)]));
    assert_eq!(report.funnel.count("track: duplicate"), 1);
}

#[test]
fn a_detection_beside_a_supported_track_starts_none() {
    let mut settings = TrackerSettings::default();
    settings.merge.same_person_m = 0.01;
    let script = Script::of([person(3.0, 0.0)]);
    let mut tracker = discovers(&script, settings);
    run(&mut tracker, 1..=2);
    script.show([person(3.0, 0.0), person(3.0, 0.19), person(3.0, -0.21)]);
    let report = run(&mut tracker, 3..=3);
    assert_eq!((ids(&report.tracks), report.funnel.count("tracked already")), (vec![1, 2], 1));
}

/// The detection is too low for the track, as that of a trunk without its head. Two frames confirm a
/// track.
#[test]
fn a_detection_where_a_lost_track_is_for_sure_starts_none() {
    for (inside_per_m2, frames, numbers) in
        [(0.05, 2, vec![1]), (0.05, 1, vec![1, 2]), (0.0, 2, vec![1, 2])]
    {
        let mut settings = TrackerSettings::default();
        settings.births.inside_per_m2 = inside_per_m2;
        let script = Script::of([person(3.0, 0.0)]);
        let mut tracker = discovers(&script, settings);
        run(&mut tracker, 1..=frames);
        let low = Point3::new(3.0, 0.1, 0.6);
        script.show([Detection::new("script", low, Matrix3::identity() * 0.01, 1.0)]);
        let report = run(&mut tracker, frames + 1..=frames + 1);
        assert_eq!(ids(&report.tracks), numbers, "{inside_per_m2} per m², {frames} frames");
        assert!(!report.tracks.iter().any(|track| track.id.0 == 1 && track.seen), "it took it");
    }
}

#[test]
fn no_more_tracks_than_the_settings_say_are_kept() {
    let mut settings = TrackerSettings::default();
    settings.merge.max_tracks = 2;
    let script = Script::of([person(3.0, 0.0), person(3.0, 1.0), person(3.0, -1.0)]);
    let report = run(&mut discovers(&script, settings), 1..=1);
    assert_eq!((report.tracks.len(), report.funnel.count("track: too many")), (2, 1));
}

/// Adds this to the score of each candidate.
struct Says(f64);

impl Verifier for Says {
    fn inputs(&self) -> Inputs {
        Inputs::NONE
    }

    fn log_odds(&mut self, _: &Frame, _: &Detection) -> Result<f64> {
        Ok(self.0)
    }
}

/// Returns the report on one person with a score of 1 and one that is no number.
fn verified(says: &[f64], verify: bool) -> TrackingReport {
    let nowhere = person(f64::NAN, 0.0);
    let script = Script::of([person(3.0, 0.0), nowhere]);
    let mut slot = script.slot(&[Role::Discover]);
    slot.settings.verify = verify;
    let mut verifiers: Vec<Guarded<dyn Verifier>> = Vec::new();
    for log_odds in says {
        verifiers.push(Guarded::new("says", Box::new(Says(*log_odds))));
    }
    let parts = Parts { detectors: vec![slot], verifiers, ..parts() };
    let mut tracker = Tracker::new(parts, TrackerSettings::default());
    assert_eq!(tracker.verifier_count(), says.len());
    run(&mut tracker, 1..=1)
}

#[test]
fn the_log_odds_of_verifiers_add_up_and_none_is_certain() {
    fn score(says: &[f64], verify: bool) -> f64 {
        let report = verified(says, verify);
        assert_eq!(report.funnel.count("detection not finite"), 1);
        report.candidates[0].detection.score
    }

    assert_eq!(score(&[], true), 1.0);
    assert_eq!(score(&[1.5, -0.25, 0.5], true), 2.75);
    assert_eq!(score(&[1.5, -0.25, 0.5], false), 1.0);
    assert_eq!([score(&[1e6], true), score(&[-1e6], true)], [100.0, -100.0]);
    let odd = verified(&[f64::NAN], true);
    assert_eq!((odd.candidates.len(), odd.funnel.count("verifier not finite")), (0, 1));
}

/// Log-odds are the least depth of the image, m.
struct LeastDepth;

impl Verifier for LeastDepth {
    fn inputs(&self) -> Inputs {
        Inputs::NONE
    }

    fn log_odds(&mut self, frame: &Frame, _: &Detection) -> Result<f64> {
        Ok(frame.depth()?.pixels().iter().fold(9.0, |least, m| least.min(f64::from(*m))))
    }
}

#[test]
fn plugins_see_no_wrong_pixels_and_the_controller_does() {
    let depth = DepthImage::from_fn(640, 480, |x, y| if x % 9 + y % 9 == 16 { 0.5 } else { 2.0 });
    let noisy = frame(1).with_depth(Arc::new(depth));
    let mut parts = parts();
    parts.detectors = vec![Script::of([person(3.0, 0.0)]).slot(&[Role::Discover])];
    parts.verifiers.push(Guarded::new("depth", Box::new(LeastDepth)));
    let seen = Tracker::new(parts, TrackerSettings::default()).step(&noisy).unwrap();
    assert_eq!(seen.report.tracks[0].score, 3.0, "1 of the detector, and 2 m");
    assert!(seen.report.funnel.count("frame: wrong pixels") == 1 && seen.completed.is_none());
}

/// Returns these pairs.
struct Pairs(Vec<(usize, usize, f64)>);

impl Associator for Pairs {
    fn fits(&self, _: &Track, _: &Detection, _: &Gate<'_>) -> bool {
        true
    }

    fn associate(&mut self, tracks: &[Track], found: &[Detection], _: &Gate<'_>) -> Associations {
        if tracks.is_empty() || found.is_empty() {
            return Associations::default();
        }
        let pairs = self.0.iter();
        let pairs =
            pairs.map(|(track, detection, weight)| Association::new(*track, *detection, *weight));
        Associations::new(pairs.collect())
    }
}

/// Returns the second report on a person whose detection an associator gives to tracks like this.
fn associated(pairs: &[(usize, usize, f64)]) -> TrackingReport {
    let script = Script::of([person(3.0, 0.0)]);
    let parts = Parts {
        detectors: vec![script.slot(&[Role::Discover])],
        associator: Guarded::new("pairs", Box::new(Pairs(pairs.to_vec()))),
        ..parts()
    };
    run(&mut Tracker::new(parts, TrackerSettings::default()), 1..=2)
}

#[test]
fn pairs_that_no_associator_may_return_are_counted() {
    let fine = associated(&[(0, 0, 1.0)]);
    assert_eq!(fine.funnel.count("association not possible"), 0);
    assert!(fine.tracks[0].seen);
    let wrong = [(0, 0, 0.0), (0, 0, 1.1), (0, 0, f64::NAN), (1, 0, 1.0), (0, 1, 1.0)];
    let odd = associated(&wrong);
    assert_eq!(odd.funnel.count("association not possible"), 5);
    assert!(!odd.tracks[0].seen);
}

#[test]
fn a_track_that_is_rather_missed_than_seen_is_missed() {
    assert!(associated(&[(0, 0, 0.5)]).tracks[0].seen);
    assert!(!associated(&[(0, 0, 0.49)]).tracks[0].seen);
}

/// A filter that answers for a track that never was, and whose later estimates are none.
#[derive(Default)]
struct Odd {
    wants_boxes: bool,
    tracks: Vec<TrackId>,
    stopped: Arc<Mutex<Vec<u32>>>,
}

impl Filter for Odd {
    fn requirements(&self) -> FilterRequirements {
        let mut requirements = FilterRequirements::new(Inputs::NONE).with_search();
        requirements.image_box = self.wants_boxes;
        requirements
    }

    fn start(&mut self, id: TrackId, _: &Detection, _: &Camera) {
        self.tracks.push(id);
    }

    fn predict(&mut self, _: &EgoMotion, _: &Camera) {}

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        if let Some(likelihood) = evidence.likelihood {
            likelihood.log_likelihood(evidence.frame, &[])?;
        }
        let mut answer: BTreeMap<TrackId, Update> = BTreeMap::new();
        for (at, id) in self.tracks.iter().enumerate() {
            let nis = if at == 0 { 2.5 } else { f64::NAN };
            answer.insert(*id, Update::new(Some((nis, 3))));
        }
        answer.insert(TrackId(99), Update::new(Some((1.0, 3))));
        if evidence.frame.index == 3 {
            answer.clear();
        }
        Ok(answer)
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        let mut all = BTreeMap::new();
        for id in self.tracks.iter().chain([&TrackId(98)]) {
            let x = if self.tracks.len() > 2 && id.0 == 2 { f64::NAN } else { 3.0 };
            let position = Point3::new(x, f64::from(id.0) - 1.0, 1.6);
            let person = Person { position, velocity: Vector2::zeros() };
            let region = camera.upper_body(&position);
            all.insert(*id, Estimate::new(person, SMatrix::identity() * 0.01, region));
        }
        all
    }

    fn stop(&mut self, id: TrackId) {
        self.stopped.lock().unwrap().push(id.0);
        self.tracks.retain(|track| *track != id);
    }

    fn visualise(&self, _: &Evidence<'_>) -> Result<Option<Visualisation>> {
        Ok(Some(Arc::new(self.tracks.len())))
    }
}

/// Returns a tracker with this filter and one detector.
fn filtered(odd: Odd, slot: DetectorSlot) -> Tracker {
    let filter: Guarded<dyn Filter> = Guarded::new("odd", Box::new(odd));
    Tracker::new(Parts { detectors: vec![slot], filter, ..parts() }, TrackerSettings::default())
}

#[test]
fn what_a_filter_says_of_no_track_or_no_number_is_counted() {
    let odd = Odd::default();
    let stopped = Arc::clone(&odd.stopped);
    let script = Script::of([person(3.0, 0.0), person(3.0, 1.0)]);
    let mut tracker = filtered(odd, script.slot(&[Role::Discover]));
    assert_eq!(ids(&run(&mut tracker, 1..=1).tracks), [1, 2]);
    script.show([]);
    let report = run(&mut tracker, 2..=2);
    assert_eq!(report.funnel.count("support of an unknown track"), 1);
    assert_eq!(report.funnel.count("estimate of an unknown track"), 2, "predicted and updated");
    assert_eq!(
        (report.nis, report.funnel.count("nis not finite")),
        (vec![(TrackId(1), 2.5, 3)], 1)
    );
    assert!(report.tracks.iter().all(|track| track.seen), "by the filter itself");
    assert!(report.visualisation.is_none());
    tracker.visualise(true);
    let report = run(&mut tracker, 3..=3);
    assert_eq!(report.visualisation.unwrap().downcast_ref(), Some(&2_usize));
    assert!(report.tracks.iter().all(|track| !track.seen));
    script.show([person(3.0, 2.0)]);
    let report = run(&mut tracker, 4..=4);
    assert_eq!(report.funnel.count("track: estimate not finite"), 1);
    assert_eq!((ids(&report.tracks), report.ended), (vec![1, 3], vec![TrackId(2)]));
    assert_eq!(*stopped.lock().unwrap(), [2]);
}

#[test]
fn a_filter_of_boxes_gets_no_detection_without_one() {
    let odd = Odd { wants_boxes: true, ..Odd::default() };
    let script = Script::of([person(3.0, 0.0)]);
    let mut tracker = filtered(odd, script.slot(&[Role::Discover]));
    let report = run(&mut tracker, 1..=1);
    assert_eq!((report.tracks.len(), report.funnel.count("no image box")), (0, 1));
}

#[test]
fn the_filter_gets_the_likelihood_of_the_detector_that_weighs() {
    fn scenes(roles: &[Role]) -> u64 {
        let script = Script::of([person(3.0, 0.0)]);
        run(&mut filtered(Odd::default(), script.slot(roles)), 1..=2).weighing.scenes
    }

    assert_eq!((scenes(&[Role::Discover]), scenes(&[Role::Discover, Role::Weigh])), (0, 1));
}

#[test]
fn a_detector_of_another_programs_messages_looks_at_frames_that_hold_one() {
    let script = Script { awaits_message: true, ..Script::of([person(3.0, 0.0)]) };
    let mut tracker = discovers(&script, TrackerSettings::default());
    run(&mut tracker, 1..=1);
    tracker.step(&frame(2).with_recorded(Some(Vec::new()))).unwrap();
    run(&mut tracker, 3..=3);
    assert_eq!(script.asked(), [(2, None)]);
}

#[test]
fn a_half_hidden_person_may_stand_aside() {
    /// Returns the variances of the far person across the line of sight; `near` is found or not.
    fn across(body_width_m: f64, finds_near: bool) -> f64 {
        let mut settings = TrackerSettings::default();
        settings.occlusion.body_width_m = body_width_m;
        let both = [person(2.0, 0.0), person(4.0, 0.6)];
        let script = Script::of(both.clone());
        let mut tracker = discovers(&script, settings);
        run(&mut tracker, 1..=3);
        script.show(both.into_iter().skip(usize::from(!finds_near)));
        let report = run(&mut tracker, 4..=4);
        assert_eq!(ids(&report.tracks), [1, 2]);
        report.tracks[1].estimate.covariance[(1, 1)]
    }

    assert_eq!(across(0.0, true), 0.01);
    let behind = across(0.8, true);
    assert!(behind > 0.012 && behind < 0.17, "{behind}");
    assert_eq!(across(0.8, false), behind, "who was missed hides others all the same");
}

/// Two misses end a new track; the filter finds no person in a frame 3.
#[test]
fn a_filter_that_searches_misses_tracks_where_no_detector_ran() {
    let script = Script::of([person(3.0, 0.0)]);
    let mut slot = script.slot(&[Role::Discover]);
    slot.settings.every = 9;
    let mut tracker = filtered(Odd::default(), slot);
    tracker.step(&taken(1, 0.0, 0.0)).unwrap();
    assert_eq!(ids(&tracker.step(&taken(3, 0.1, 0.0)).unwrap().report.tracks), [1]);
    let report = tracker.step(&taken(3, 0.2, 0.0)).unwrap().report;
    assert_eq!((ids(&report.tracks), report.ended), (vec![], vec![TrackId(1)]));
}

#[test]
fn after_a_change_of_the_calibration_the_tracks_stay_where_they_were() {
    let script = Script::of([person(3.0, 0.0)]);
    let mut tracker = discovers(&script, TrackerSettings::default());
    run(&mut tracker, 1..=3);
    assert!(!tracker.is_frozen());
    let asked = script.asked().len();
    let changed = driven(4, 0.5).with_changed_calibration(true);
    for (frame, place) in [(changed, 2.5), (driven(5, 0.5), 2.0)] {
        let report = tracker.step(&frame).unwrap().report;
        let [track] = &report.tracks[..] else { panic!("{:?}", report.tracks) };
        assert_eq!((track.seen, track.estimate.person.position.x), (false, place));
        assert_eq!(report.funnel.count("frame: calibration changed"), 1);
    }
    assert!(tracker.is_frozen());
    assert_eq!(script.asked().len(), asked, "no plugin gets such a frame");
    let report = tracker.step(&taken(6, 60.0, 0.0)).unwrap().report;
    assert_eq!((report.tracks.len(), report.ended), (0, vec![TrackId(1)]));
}

#[test]
fn trackers_that_share_answers_ask_a_detector_once() {
    let script = Script::of([person(3.0, 0.0)]);
    let identities = Identities { detectors: vec![Some("script".into())], verifiers: Vec::new() };
    let mut trackers = [(); 2].map(|()| discovers(&script, TrackerSettings::default()));
    trackers.iter_mut().for_each(|tracker| tracker.share_answers(identities.clone()));
    for index in 1..=2 {
        let frame = frame(index);
        let reports = trackers.each_mut().map(|tracker| tracker.step(&frame).unwrap().report);
        let [first, second] = reports.each_ref().map(|report| format!("{:?}", report.tracks));
        assert_eq!(first, second);
        assert_eq!(ids(&reports[1].tracks), [1]);
    }
    assert_eq!(script.asked(), [(1, None), (2, None)]);
}

#[test]
fn stages_and_plugins_are_timed_under_their_names() {
    let script = Script::of([person(3.0, 0.0)]);
    let report = run(&mut discovers(&script, TrackerSettings::default()), 1..=1);
    let stages: Vec<&str> = report.timings.iter().map(|(stage, _)| *stage).collect();
    assert_eq!(stages, STAGES);
    assert!(report.timings.iter().all(|(_, ms)| (0.0..1e4).contains(ms)), "{:?}", report.timings);
    let plugins: Vec<&str> = report.plugin_timings.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(plugins, ["script", "hungarian", "last-seen", "m-of-n"]);
}

/// Says that the robot drove twice as far, and counts the people that it is told of.
struct Twice(Arc<Mutex<Vec<usize>>>);

impl Preprocessor for Twice {
    fn process(
        &mut self,
        _: &Frame,
        motion: Option<EgoMotion>,
        people: &[Estimate],
        _: &mut Funnel,
    ) -> Result<Preprocessed> {
        self.0.lock().unwrap().push(people.len());
        let motion = motion.map(|motion| EgoMotion { forward: 2.0 * motion.forward, ..motion });
        Ok(Preprocessed { frame: None, motion })
    }
}

#[test]
fn preprocessors_correct_the_motion_one_after_the_other() {
    let told = Arc::new(Mutex::new(Vec::new()));
    let script = Script::of([person(3.0, 0.0)]);
    let mut parts = Parts { detectors: vec![script.slot(&[Role::Discover])], ..parts() };
    for _ in 0..2 {
        parts.preprocessors.push(Guarded::new("twice", Box::new(Twice(Arc::clone(&told)))));
    }
    let mut tracker = Tracker::new(parts, TrackerSettings::default());
    tracker.step(&driven(1, 0.1)).unwrap();
    script.show([]);
    let report = tracker.step(&driven(2, 0.1)).unwrap().report;
    assert!((report.motion.forward - 0.4).abs() < 1e-12, "{:?}", report.motion);
    assert!((report.tracks[0].estimate.person.position.x - 2.6).abs() < 1e-9);
    assert_eq!(*told.lock().unwrap(), [0, 0, 1, 1]);
}
