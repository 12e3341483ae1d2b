//! Checks of track managers.

use std::collections::BTreeMap;

use nalgebra::{Point3, SMatrix, Vector2};
use tagalong_core::{
    Detection, EgoMotion, Estimate, Initiation, Observation, ObservedTrack, Person, Track, TrackId,
    TrackManager, Unassociated,
};
use tagalong_math::SplitMix64;

use crate::scenes::{DT_S, level, sighting};
use crate::subject::{From, Subject};
use crate::verdict::{Check, Verdict, demand};

pub(crate) const CHECKS: &[Check] = &[
    ("same input, same output", repeatable),
    ("a person detected again and again is confirmed", detected_is_confirmed),
    ("a track that is missed ends", missed_ends),
    ("an occlusion of half a second is survived", occlusion_is_survived),
    ("an unlikely candidate starts no track", unlikely_starts_nothing),
    ("ends are of tracks that live", ends_are_of_the_living),
];

/// A manager, with the bookkeeping that the tracker normally does for it.
struct Run {
    manager: Box<dyn TrackManager>,
    tracks: BTreeMap<TrackId, Track>,
    started: u32,
    ended: Vec<(TrackId, &'static str)>,
}

/// Log-odds of a nearly certain detection.
const SURE: f64 = 3.0;
const DETECTED: Observation = Observation::Detected { log_odds: SURE };

fn person(y: f64, log_odds: f64) -> Detection {
    let place = Point3::new(3.0, y, 1.6);
    sighting(&place, &level(), 0.02, &mut SplitMix64::new(4)).with_score(log_odds)
}

impl Run {
    fn new(subject: &Subject<'_>, from: From<'_>) -> Result<Self, String> {
        let manager = subject.manager(from)?;
        Ok(Self { manager, tracks: BTreeMap::new(), started: 0, ended: Vec::new() })
    }

    /// Offers a candidate; returns its track if it starts one.
    fn offer(&mut self, detection: &Detection) -> Option<TrackId> {
        let id = TrackId(self.started + 1);
        let log_odds = detection.score;
        let new = Unassociated::new(detection, log_odds, true);
        let Initiation::Start(health) = self.manager.initiate(id, &new) else { return None };
        self.started += 1;
        let person = Person { position: detection.position, velocity: Vector2::zeros() };
        let covariance = SMatrix::<f64, 5, 5>::identity() * 0.01;
        let track = Track::new(
            id,
            Estimate::new(person, covariance, detection.rect_in(&level())),
            health.log_odds,
        )
        .with_confirmed(health.confirmed);
        self.tracks.insert(id, track);
        Some(id)
    }

    /// Offers the same candidate in successive frames until it starts a track: a manager may
    /// require several detections.
    fn start(&mut self, y: f64) -> Result<TrackId, String> {
        for _ in 0..30 {
            if let Some(id) = self.offer(&person(y, SURE)) {
                return Ok(id);
            }
            self.step(&[])?;
        }
        Err("a detection that is hardly in doubt starts no track within 3 s".into())
    }

    /// Simulates one frame; tracks that are not named are occluded.
    fn step(&mut self, observed: &[(TrackId, Observation)]) -> Verdict {
        self.manager.predict(&EgoMotion::at_rest(DT_S));
        let observed: BTreeMap<TrackId, Observation> = observed.iter().copied().collect();
        for (id, track) in &mut self.tracks {
            let seen = observed.get(id).is_some_and(|observation| observation.is_supported());
            track.age += 1;
            track.seen = seen;
            track.unseen_s = if seen { 0.0 } else { track.unseen_s + DT_S };
        }
        let list: Vec<ObservedTrack<'_>> = self
            .tracks
            .values()
            .map(|track| {
                let observation = observed.get(&track.id).copied();
                ObservedTrack::new(track, observation.unwrap_or(Observation::Occluded))
            })
            .collect();
        let changes = self.manager.manage(&list);
        for (id, health) in changes.health {
            demand(health.log_odds.is_finite(), || format!("track {id} has {health:?}"))?;
            if let Some(track) = self.tracks.get_mut(&id) {
                (track.confirmed, track.score) = (health.confirmed, health.log_odds);
            }
        }
        for (id, test) in changes.ends {
            self.manager.stop(id);
            let lived = self.tracks.remove(&id).is_some();
            demand(lived, || format!("it ends track {id}, which does not live ({test})"))?;
            self.ended.push((id, test));
        }
        Ok(())
    }
}

fn repeatable(subject: &Subject<'_>) -> Verdict {
    let defaults = subject.info.defaults();
    let first = Watched::of(subject, From::Nothing)?;
    let second = Watched::of(subject, From::Text(&defaults))?;
    demand(first == second, || format!("two runs differ: {first:?} and {second:?}"))
}

/// Tracks of two people; one person is missed from time to time.
#[derive(Debug, PartialEq)]
struct Watched {
    health: Vec<(bool, f64)>,
    ended: Vec<(TrackId, &'static str)>,
}

impl Watched {
    fn of(subject: &Subject<'_>, from: From<'_>) -> Result<Self, String> {
        let mut run = Run::new(subject, from)?;
        let a = run.start(0.0)?;
        let b = run.start(1.0)?;
        let mut health = Vec::new();
        for i in 0..25 {
            let missed = if i % 3 == 0 { Observation::Missed } else { DETECTED };
            run.step(&[(a, DETECTED), (b, missed)])?;
            health.extend(run.tracks.values().map(|track| (track.confirmed, track.score)));
        }
        Ok(Self { health, ended: run.ended })
    }
}

fn detected_is_confirmed(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing)?;
    let id = run.start(0.0)?;
    for _ in 0..50 {
        run.step(&[(id, DETECTED)])?;
    }
    let confirmed = run.tracks.get(&id).is_some_and(|track| track.confirmed);
    demand(confirmed, || format!("after 5 s of detections: {:?}, {:?}", run.tracks, run.ended))
}

fn missed_ends(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing)?;
    let id = run.start(0.0)?;
    for i in 0..120 {
        // The first 20 detections confirm the track.
        run.step(&[(id, if i < 20 { DETECTED } else { Observation::Missed })])?;
    }
    demand(run.tracks.is_empty(), || "missed for 10 s, the track lives on".into())
}

fn occlusion_is_survived(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing)?;
    let id = run.start(0.0)?;
    for i in 0..40 {
        run.step(&[(id, if (20..25).contains(&i) { Observation::Occluded } else { DETECTED })])?;
    }
    demand(run.tracks.contains_key(&id), || format!("the track ended: {:?}", run.ended))
}

fn unlikely_starts_nothing(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing)?;
    for i in 0..20 {
        let started = run.offer(&person(0.0, -5.0));
        demand(started.is_none(), || format!("log-odds of -5 start a track in frame {i}"))?;
        run.step(&[])?;
    }
    Ok(())
}

fn ends_are_of_the_living(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing)?;
    let ids = [run.start(-1.0)?, run.start(0.0)?, run.start(1.0)?];
    run.manager.stop(ids[1]);
    run.tracks.remove(&ids[1]);
    run.manager.reset();
    // Stopping an unknown track must do no harm.
    run.manager.stop(TrackId(99));
    for _ in 0..120 {
        run.step(&[(ids[0], DETECTED), (ids[2], Observation::Missed)])?;
    }
    let left: Vec<TrackId> = run.tracks.keys().copied().collect();
    demand(left == [ids[0]], || format!("of {ids:?}, one stopped and one missed: {left:?}"))
}
