//! Effect of a verifier on rooms and logs that it was not trained on.

use std::collections::BTreeSet;

use nalgebra::Point2;
use serde::Serialize;
use tagalong_app::outcome::Failure;
use tagalong_config::Registry;
use tagalong_core::{Detection, Track, Verifier};
use tagalong_eval::{CONFIDENCE, wilson};
use tagalong_pipeline::{Candidate, Fate, FrameReport, Pipeline};

use super::in_use::pipeline;
use super::seen::{AnnotatedFrame, Known, Label, label};

/// Distance on the floor within which a track belongs to a person, m.
const TRACKED_M: f64 = 0.5;
/// Distance on the floor to all people above which a track is false, m.
const FALSE_M: f64 = 0.9;

/// Fraction with its 95 % interval (Wilson), which assumes independent trials: for detections,
/// which are correlated, it is too narrow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Share {
    /// Number of successes.
    pub count: u64,
    /// Number of trials.
    pub of: u64,
    /// Lower end of the interval.
    pub lower: f64,
    /// Upper end of the interval.
    pub upper: f64,
}

impl Share {
    fn new(count: u64, of: u64) -> Self {
        fn rounded(v: f64) -> f64 {
            (v * 1e5).round() / 1e5
        }

        let (lower, upper) = wilson(count, of, CONFIDENCE)
            .map_or((0.0, 1.0), |i| (rounded(i.lower), rounded(i.upper)));
        Self { count, of, lower, upper }
    }
}

/// Effect of a verifier: on proposals of the detector with low thresholds, by the sign of its
/// log-odds only; on detections that the pipeline without it accepted; and on the confirmed tracks
/// of both pipelines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Effect {
    /// Rejected proposals without a person.
    pub false_proposals_rejected: Share,
    /// Rejected proposals of people.
    pub people_proposals_rejected: Share,
    /// Rejected ones of the accepted detections without a person.
    pub false_sightings_removed: Share,
    /// Rejected ones of the accepted detections of people.
    pub people_sightings_lost: Share,
    /// Rejected ones of the accepted detections of a part of a person, such as a backpack.
    pub part_sightings_removed: Share,
    /// Frames with a false confirmed track, summed over tracks: number removed, of those without
    /// the verifier.
    pub false_track_frames_removed: Share,
    /// False confirmed tracks: number removed, of those without the verifier.
    pub false_tracks_removed: Share,
    /// Frames of people with a confirmed track, summed over people: number lost, of those without
    /// the verifier.
    pub tracked_people_lost: Share,
    /// People with a confirmed track at any time: number lost.
    pub people_never_tracked: Share,
}

/// Pipelines that are compared, side by side.
pub struct Comparison {
    proposer: Pipeline,
    plain: Pipeline,
    verified: Pipeline,
    verifier: Box<dyn Verifier>,
    start_score: f64,
}

/// Counts over all frames.
#[derive(Default)]
pub struct Tally {
    /// Rejected and all detections of people, of nothing, and of parts.
    sightings: [(u64, u64); 3],
    /// The same of proposals.
    proposals: [(u64, u64); 3],
    /// Counts of the pipeline without the verifier, and with it.
    tracks: [Tracks; 2],
    both: u64,
    scenes: u64,
}

#[derive(Default)]
struct Tracks {
    false_frames: u64,
    false_tracks: BTreeSet<(u64, u32)>,
    person_frames: u64,
    people: BTreeSet<(u64, i64)>,
}

impl Comparison {
    /// Builds the pipelines: one that proposes candidates, one without the verifier, and one with
    /// it.
    ///
    /// # Errors
    /// A wrong config.
    pub fn new(
        [proposer, plain, verified]: [&str; 3],
        verifier: Box<dyn Verifier>,
        registry: &Registry,
    ) -> Result<Self, Failure> {
        Ok(Self {
            proposer: pipeline(proposer, registry)?,
            plain: pipeline(plain, registry)?,
            verified: pipeline(verified, registry)?,
            verifier,
            start_score: 0.0,
        })
    }

    /// Passes one frame to all pipelines.
    ///
    /// # Errors
    /// A plugin that fails.
    pub fn step(&mut self, seen: &AnnotatedFrame, tally: &mut Tally) -> Result<(), Failure> {
        let proposed = self.proposer.step(&seen.frame).map_err(Failure::failed)?;
        for Candidate { detection, .. } in &proposed.candidates {
            tally.proposal(label(detection, &seen.people), self.log_odds(seen, detection)? < 0.0);
        }
        let plain = self.plain.step(&seen.frame).map_err(Failure::failed)?;
        let verified = self.verified.step(&seen.frame).map_err(Failure::failed)?;
        for candidate in &plain.candidates {
            if matches!(candidate.fate, Fate::Dropped(_)) {
                continue;
            }
            let score = candidate.detection.score + self.log_odds(seen, &candidate.detection)?;
            tally.sighting(label(&candidate.detection, &seen.people), score < self.start_score);
        }
        tally.frame(&[&plain, &verified], &seen.people);
        Ok(())
    }

    fn log_odds(&mut self, seen: &AnnotatedFrame, candidate: &Detection) -> Result<f64, Failure> {
        self.verifier.log_odds(&seen.frame, candidate).map_err(Failure::failed)
    }
}

impl Tally {
    /// Starts a new scene, in which the IDs of people and tracks start again.
    pub fn next_scene(&mut self) {
        self.scenes += 1;
    }

    fn sighting(&mut self, label: Label, rejected: bool) {
        count(&mut self.sightings, label, rejected);
    }

    fn proposal(&mut self, label: Label, rejected: bool) {
        count(&mut self.proposals, label, rejected);
    }

    fn frame(&mut self, reports: &[&FrameReport; 2], people: &[Known]) {
        let mut covered: [BTreeSet<i64>; 2] = Default::default();
        for (which, report) in reports.iter().enumerate() {
            let tracks: Vec<&Track> = report.tracks.iter().filter(|t| t.confirmed).collect();
            covered[which] = covered_by(&tracks, people);
            let of = &mut self.tracks[which];
            of.person_frames += covered[which].len() as u64;
            of.people.extend(covered[which].iter().map(|id| (self.scenes, *id)));
            for track in tracks.iter().filter(|t| is_false(t, people)) {
                of.false_frames += 1;
                of.false_tracks.insert((self.scenes, track.id.0));
            }
        }
        self.both += covered[0].intersection(&covered[1]).count() as u64;
    }

    /// Returns the figures.
    pub fn effect(&self) -> Effect {
        fn share((count, of): (u64, u64)) -> Share {
            Share::new(count, of)
        }

        // A verifier may also cause false tracks; more of them count as none removed.
        fn fewer(before: u64, after: u64) -> Share {
            Share::new(before.saturating_sub(after), before)
        }

        let [plain, verified] = &self.tracks;
        let people = plain.people.len() as u64;
        let kept = plain.people.intersection(&verified.people).count() as u64;
        Effect {
            people_proposals_rejected: share(self.proposals[0]),
            false_proposals_rejected: share(self.proposals[1]),
            people_sightings_lost: share(self.sightings[0]),
            false_sightings_removed: share(self.sightings[1]),
            part_sightings_removed: share(self.sightings[2]),
            false_track_frames_removed: fewer(plain.false_frames, verified.false_frames),
            false_tracks_removed: fewer(
                plain.false_tracks.len() as u64,
                verified.false_tracks.len() as u64,
            ),
            tracked_people_lost: fewer(plain.person_frames, self.both),
            people_never_tracked: fewer(people, kept),
        }
    }
}

fn count(rows: &mut [(u64, u64); 3], label: Label, rejected: bool) {
    let row = match label {
        Label::Person(_) => &mut rows[0],
        Label::Nobody => &mut rows[1],
        Label::Part => &mut rows[2],
        Label::Unclear => return,
    };
    row.0 += u64::from(rejected);
    row.1 += 1;
}

/// Returns the people that count and have a track.
fn covered_by(tracks: &[&Track], people: &[Known]) -> BTreeSet<i64> {
    people
        .iter()
        .filter(|known| {
            !known.ignore && tracks.iter().any(|t| (floor(t) - known.floor).norm() <= TRACKED_M)
        })
        .map(|known| known.id)
        .collect()
}

/// Returns true for a track without a person nearby.
fn is_false(track: &Track, people: &[Known]) -> bool {
    people.iter().all(|known| (floor(track) - known.floor).norm() > FALSE_M)
}

fn floor(track: &Track) -> Point2<f64> {
    track.estimate.person.position.xy()
}
