//! Trials written by hand, for tests.

use nalgebra::{Isometry2, Point3, SMatrix, Vector2};
use tagalong_core::{Estimate, Person, Stamp, Track, TrackId};
use tagalong_geometry::{Camera, Pinhole};
use tagalong_pipeline::FrameReport;
use tagalong_sim::Truth;

use crate::{Moment, Run, Trial};

/// Frames per second.
pub const RATE_HZ: f64 = 10.0;

/// Position of a person, and the visible fraction.
pub type HeadSample = (f64, f64, f64);

/// Position of a track on the floor in a frame, m; `None` if it is absent.
pub type FloorPosition = Option<(f64, f64)>;

/// ID of a track, and its position in every frame.
pub type Path<'a> = (u32, &'a [FloorPosition]);

fn camera() -> Camera {
    Camera::mounted(Pinhole::centred(300.0, 320, 240), 320, 240, 1.2, 0.0, 0.0)
}

/// Returns a trial with a robot at rest, and with a position in every frame for each person and
/// each track.
pub fn trial(people: &[&[HeadSample]], tracks: &[Path<'_>]) -> Trial {
    let frames = people[0].len();
    let camera = camera();
    let moments = (0..frames).map(|at| moment(at, people, &camera)).collect();
    let reports = (0..frames).map(|at| report(at, tracks, &camera)).collect();
    let runs = vec![Run { pipeline: "hand".into(), reports, worked_ms: 0.0 }];
    Trial { seed: 1, camera, furniture: Vec::new(), moments, runs }
}

fn stamp(at: usize) -> Stamp {
    Stamp::default().plus_seconds(at as f64 / RATE_HZ)
}

fn moment(at: usize, people: &[&[HeadSample]], camera: &Camera) -> Moment {
    let truth = (1..).zip(people).map(|(id, places)| {
        let (x, y, visible_fraction) = places[at];
        let head = Point3::new(x, y, 1.6);
        Truth {
            id,
            head_in_robot: head,
            torso_in_robot: head,
            upper_body: Some(camera.upper_body(&head)),
            visible: None,
            visible_fraction,
            occluder: (visible_fraction < 1.0).then_some(if id == 1 { 2 } else { 1 }),
            ignore: visible_fraction < 0.2,
            joints: Vec::new(),
        }
    });
    Moment {
        stamp: stamp(at),
        truth: truth.collect(),
        odom_from_robot: Isometry2::identity(),
        world_from_robot: Isometry2::identity(),
    }
}

fn report(at: usize, tracks: &[Path<'_>], camera: &Camera) -> FrameReport {
    let tracks = tracks.iter().filter_map(|(id, places)| {
        let (x, y) = places[at]?;
        let position = Point3::new(x, y, 1.6);
        let person = Person { position, velocity: Vector2::zeros() };
        let region = camera.upper_body(&position);
        Some(
            Track::new(TrackId(*id), Estimate::new(person, SMatrix::identity(), region), 1.0)
                .with_age(9),
        )
    });
    let mut report = FrameReport::new(at as u64 + 1, stamp(at));
    report.tracks = tracks.collect();
    report
}
