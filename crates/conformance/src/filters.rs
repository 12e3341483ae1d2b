//! Checks of filters.
//!
//! A filter receives detections of people at known positions, while the robot is at rest or drives.
//! Filters that weight scenes get a likelihood that knows the true positions.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Isometry2, Matrix3, Point2, Point3, Vector2};
use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, Frame, Images, Likelihood, Matched, Person,
    TrackId, Update,
};
use tagalong_geometry::Camera;
use tagalong_math::SplitMix64;

use crate::scenes::{DT_S, level, moving_frame, odd_frames, sighting};
use crate::subject::{From, Subject};
use crate::verdict::{Check, Verdict, demand};

pub(crate) const CHECKS: &[Check] = &[
    ("never panics on odd frames", odd_frames_are_survived),
    ("same seed, same output", repeatable),
    ("covariance stays positive", covariance_stays_positive),
    ("uncertainty grows without evidence", uncertainty_grows),
    ("a standing person stands still in the world", standing_person_stands),
    ("a walking person is kept up with", walking_person),
    ("stop forgets", stop_forgets),
    ("ids never mix", ids_never_mix),
];

/// Standard deviation of the detections, m.
const SIGMA_M: f64 = 0.03;

/// Likelihood that knows the true positions; constant without people.
struct Oracle(Vec<Point3<f64>>);

impl Likelihood for Oracle {
    fn log_likelihood(&self, _: &Frame, scene: &[Person]) -> tagalong_core::Result<f64> {
        Ok(if self.0.is_empty() {
            0.0
        } else {
            scene
                .iter()
                .map(|person| {
                    let nearest =
                        self.0.iter().map(|truth| (person.position - truth).norm_squared());
                    // Beyond 1 m the likelihood is constant, like that of an image.
                    let d2 = nearest.fold(1.0, f64::min);
                    (1.0 - d2) / (2.0 * 0.1 * 0.1)
                })
                .sum()
        })
    }
}

/// Simulated people, a driving robot, and the filter under test.
struct Run {
    filter: Box<dyn Filter>,
    camera: Arc<Camera>,
    world_from_robot: Isometry2<f64>,
    motion: EgoMotion,
    random: SplitMix64,
    index: u64,
    stopped: Vec<TrackId>,
}

impl Run {
    fn new(subject: &Subject<'_>, from: From<'_>, motion: EgoMotion) -> Result<Self, String> {
        Ok(Self {
            filter: subject.filter(from)?,
            camera: level(),
            world_from_robot: Isometry2::identity(),
            motion,
            random: SplitMix64::new(11),
            index: 0,
            stopped: Vec::new(),
        })
    }

    fn in_robot(&self, place: &Point3<f64>) -> Point3<f64> {
        let floor = self.world_from_robot.inverse_transform_point(&place.xy());
        Point3::new(floor.x, floor.y, place.z)
    }

    fn sight(&mut self, place: &Point3<f64>) -> Detection {
        let head = self.in_robot(place);
        sighting(&head, &self.camera, SIGMA_M, &mut self.random)
    }

    /// Starts one track per position, with the IDs 1, 2, ...
    fn start(&mut self, places: &[Point3<f64>]) {
        for (id, place) in (1..).zip(places) {
            let detection = self.sight(place);
            self.filter.start(TrackId(id), &detection, &self.camera);
        }
    }

    /// Simulates one frame: the robot moves, and the given people are detected.
    fn step(&mut self, seen: &[(u32, Point3<f64>)]) -> Result<BTreeMap<TrackId, Update>, String> {
        self.index += 1;
        self.world_from_robot *= self.motion.isometry();
        self.filter.predict(&self.motion, &self.camera);
        let sightings: Vec<_> =
            seen.iter().map(|(id, place)| (TrackId(*id), self.sight(place))).collect();
        let matched: Vec<_> =
            sightings.iter().map(|(id, detection)| Matched::certain(*id, detection)).collect();
        let oracle = Oracle(seen.iter().map(|(_, place)| self.in_robot(place)).collect());
        let frame = moving_frame(self.index, &self.camera, Images::default(), self.motion);
        let evidence = Evidence::new(&frame, &matched).with_likelihood(
            self.filter.requirements().likelihood.then_some(&oracle as &dyn Likelihood),
        );
        let supported = self.filter.update(&evidence).map_err(|e| format!("update fails: {e}"))?;
        self.only_known_ids(&supported)?;
        Ok(supported)
    }

    fn only_known_ids(&self, supported: &BTreeMap<TrackId, Update>) -> Verdict {
        let alive = self.estimates();
        let stray = supported.keys().find(|id| !alive.contains_key(id));
        demand(stray.is_none(), || format!("it supports {stray:?}, in whom it does not believe"))?;
        let ghost = self.stopped.iter().find(|id| alive.contains_key(id));
        demand(ghost.is_none(), || format!("it still believes in {ghost:?}, who was stopped"))
    }

    fn estimates(&self) -> BTreeMap<TrackId, Estimate> {
        self.filter.estimates(&self.camera)
    }

    fn estimate(&self, id: u32) -> Result<Estimate, String> {
        let found = self.estimates().remove(&TrackId(id));
        found.ok_or_else(|| format!("it lost track {id} without being told to stop"))
    }

    /// Returns the estimated position of a track in the world, and its velocity there.
    fn in_world(&self, id: u32) -> Result<(Point2<f64>, Vector2<f64>), String> {
        let person = self.estimate(id)?.person;
        Ok((self.world_from_robot * person.position.xy(), self.world_from_robot * person.velocity))
    }
}

/// Returns a motion of half a metre per second, turning at 0.2 rad/s, with realistic odometry
/// noise.
fn driving() -> EgoMotion {
    let turn = 0.2 * DT_S;
    let covariance = Matrix3::from_diagonal(&nalgebra::Vector3::new(1e-6, 1e-6, 1e-7));
    EgoMotion { dt: DT_S, forward: 0.5 * DT_S, left: 0.0, turn, covariance }
}

const COUPLE: [Point3<f64>; 2] = [Point3::new(4.0, 1.2, 1.6), Point3::new(4.5, -0.8, 1.7)];

fn odd_frames_are_survived(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing, EgoMotion::at_rest(0.0))?;
    run.start(&COUPLE);
    for (name, frame) in odd_frames() {
        run.filter.predict(&EgoMotion::at_rest(0.0), &frame.camera);
        let oracle = Oracle(Vec::new());
        let evidence = Evidence::new(&frame, &[]).with_likelihood(
            run.filter.requirements().likelihood.then_some(&oracle as &dyn Likelihood),
        );
        run.filter.update(&evidence).map_err(|e| format!("the {name} frame is an error: {e}"))?;
        for (id, estimate) in run.filter.estimates(&frame.camera) {
            demand(estimate.is_sane(), || format!("track {id} on the {name} frame: {estimate:?}"))?;
        }
    }
    Ok(())
}

fn repeatable(subject: &Subject<'_>) -> Verdict {
    let defaults = subject.info.defaults();
    let first = couple_watched(subject, From::Nothing)?;
    let second = couple_watched(subject, From::Text(&defaults))?;
    demand(first == second, || format!("two runs differ: {first:?} and {second:?}"))
}

/// Returns the estimates after two people were observed from a driving robot.
fn couple_watched(
    subject: &Subject<'_>,
    from: From<'_>,
) -> Result<BTreeMap<TrackId, Estimate>, String> {
    let mut run = Run::new(subject, from, driving())?;
    run.start(&COUPLE);
    for _ in 0..15 {
        run.step(&[(1, COUPLE[0]), (2, COUPLE[1])])?;
    }
    Ok(run.estimates())
}

fn covariance_stays_positive(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing, driving())?;
    run.start(&COUPLE);
    for i in 0..60 {
        let seen = [(1, COUPLE[0]), (2, COUPLE[1])];
        // 12 frames with detections, then 8 without, in which the covariance grows.
        run.step(if i % 20 < 12 { &seen } else { &[] })?;
        for (id, estimate) in run.estimates() {
            let p = estimate.covariance;
            let skew = (p - p.transpose()).abs().max();
            // A covariance may be singular, and the decomposition could then fail because of
            // rounding.
            let ridge = nalgebra::SMatrix::identity() * (1e-9 * p.norm().max(1e-6));
            let positive = skew <= 1e-9 * p.norm() && (p + ridge).cholesky().is_some();
            demand(positive && estimate.is_sane(), || {
                format!("frame {i}, track {id}: {estimate:?}")
            })?;
        }
    }
    Ok(())
}

fn uncertainty_grows(subject: &Subject<'_>) -> Verdict {
    fn variance(run: &Run) -> Result<f64, String> {
        let p = run.estimate(1)?.covariance;
        Ok(p[(0, 0)] + p[(1, 1)])
    }

    let mut run = Run::new(subject, From::Nothing, EgoMotion::at_rest(DT_S))?;
    run.start(&COUPLE[..1]);
    for _ in 0..10 {
        run.step(&[(1, COUPLE[0])])?;
    }
    let mut before = variance(&run)?;
    for half_seconds in 1..=4 {
        for _ in 0..5 {
            run.step(&[])?;
        }
        let after = variance(&run)?;
        demand(after > before, || {
            let s = 0.5 * f64::from(half_seconds);
            format!("unseen for {s} s, the variance goes from {before:.5} to {after:.5} m2")
        })?;
        before = after;
    }
    Ok(())
}

fn standing_person_stands(subject: &Subject<'_>) -> Verdict {
    let place = Point3::new(6.0, 0.8, 1.6);
    for motion in [driving(), EgoMotion { turn: 0.0, ..driving() }] {
        let mut run = Run::new(subject, From::Nothing, motion)?;
        run.start(&[place]);
        let mut offset = Vector2::zeros();
        let mut drift = Vector2::zeros();
        for i in 0..60 {
            run.step(&[(1, place)])?;
            // The first half of the run lets the velocity converge.
            if i >= 30 {
                let (position, velocity) = run.in_world(1)?;
                offset += (position - place.xy()) / 30.0;
                drift += velocity / 30.0;
            }
        }
        demand(offset.norm() < 0.1 && drift.norm() < 0.25, || {
            format!("it is {:.2} m off and seems to walk at {:.2} m/s", offset.norm(), drift.norm())
        })?;
        coasts(&mut run, &place)?;
    }
    Ok(())
}

/// Checks that a second without evidence does not carry a standing person away.
fn coasts(run: &mut Run, place: &Point3<f64>) -> Verdict {
    for _ in 0..10 {
        run.step(&[])?;
    }
    let away = (run.in_world(1)?.0 - place.xy()).norm();
    demand(away < 0.7, || format!("hidden for 1 s, the standing person is {away:.2} m off"))
}

fn walking_person(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing, EgoMotion::at_rest(DT_S))?;
    let velocity = Vector2::new(0.3, 0.7);
    let mut place = Point3::new(2.5, -1.5, 1.6);
    run.start(&[place]);
    for i in 1..=40 {
        let floor = Vector2::new(2.5, -1.5) + velocity * (DT_S * f64::from(i));
        place = Point3::new(floor.x, floor.y, 1.6);
        run.step(&[(1, place)])?;
    }
    let (position, seen_velocity) = run.in_world(1)?;
    let away = (position - place.xy()).norm();
    let wrong = (seen_velocity - velocity).norm();
    demand(away < 0.25 && wrong < 0.4, || {
        format!("after 4 s it is {away:.2} m off and {wrong:.2} m/s wrong")
    })
}

fn stop_forgets(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing, EgoMotion::at_rest(DT_S))?;
    run.start(&COUPLE);
    run.step(&[(1, COUPLE[0]), (2, COUPLE[1])])?;
    run.filter.stop(TrackId(1));
    run.stopped.push(TrackId(1));
    // Stopping an unknown track must do no harm.
    run.filter.stop(TrackId(99));
    let supported = run.step(&[(1, COUPLE[0]), (2, COUPLE[1])])?;
    demand(!supported.contains_key(&TrackId(1)), || "a stopped track is supported".into())?;
    let left: Vec<TrackId> = run.estimates().into_keys().collect();
    demand(left == [TrackId(2)], || format!("of tracks 1 and 2, stopping 1 leaves {left:?}"))
}

/// Changes the order of the evidence, and misses each of the two people from time to time.
fn ids_never_mix(subject: &Subject<'_>) -> Verdict {
    let mut run = Run::new(subject, From::Nothing, driving())?;
    run.start(&COUPLE);
    let a = (1, COUPLE[0]);
    let b = (2, COUPLE[1]);
    let orders = [vec![a, b], vec![b, a], vec![b], vec![a]];
    for seen in orders.iter().cycle().take(24) {
        let supported = run.step(seen)?;
        let missing = seen.iter().find(|(id, _)| !supported.contains_key(&TrackId(*id)));
        // A filter that weights scenes finds its evidence in the image, not in the detections.
        demand(missing.is_none() || run.filter.requirements().likelihood, || {
            format!("its own sighting does not support track {:?}", missing.map(|(id, _)| id))
        })?;
        let ids: Vec<TrackId> = run.estimates().into_keys().collect();
        demand(ids == [TrackId(1), TrackId(2)], || format!("tracks 1 and 2 became {ids:?}"))?;
    }
    for (id, place) in [a, b] {
        let away = (run.in_world(id)?.0 - place.xy()).norm();
        demand(away < 0.4, || format!("track {id} is {away:.2} m away from its person"))?;
    }
    Ok(())
}
