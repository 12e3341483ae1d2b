//! Checks of controllers.

use nalgebra::{Point3, Vector2};
use tagalong_core::{Controller, Frame, Images, Scene, Track, Twist, WheelSpeeds};

use crate::figure::{Figure, World};
use crate::scenes::{bare_frame, frame, level, mirrored, odd_frames, track};
use crate::subject::{From, Subject, WHEELS};
use crate::verdict::{Check, Verdict, demand};

pub(crate) const CHECKS: &[Check] = &[
    ("never panics on odd frames", odd_frames_are_survived),
    ("same seed, same output", repeatable),
    ("no target means stop", no_target_means_stop),
    ("speeds are finite and bounded", speeds_are_bounded),
    ("a mirrored target gives mirrored wheels", mirrored_target),
];

const MAX_SPEED_MPS: f64 = 0.9;

fn command(controller: &mut dyn Controller, frame: &Frame, target: Option<&Track>) -> Twist {
    let tracks = target.map_or(&[][..], std::slice::from_ref);
    let scene = Scene::new(frame, tracks, WHEELS, MAX_SPEED_MPS).with_target(target);
    controller.command(&scene)
}

fn bounded(twist: Twist, scene: &str) -> Verdict {
    fn fits(speed: f64) -> bool {
        speed.is_finite() && speed.abs() <= MAX_SPEED_MPS * (1.0 + 1e-9)
    }

    let rim = twist.angular_rps * WHEELS.half_separation_m;
    demand(fits(twist.linear_mps) && fits(twist.lateral_mps) && fits(rim), || {
        format!("{twist:?} with a limit of {MAX_SPEED_MPS} m/s, {scene}")
    })
}

/// Returns a target whose head is at a position in the robot frame, m, 1.6 m above the floor, with
/// a velocity, m/s.
pub fn target(x: f64, y: f64, velocity: Vector2<f64>) -> Track {
    let mut target = track(1, Point3::new(x, y, 1.6), 0.1, &level());
    target.estimate.person.velocity = velocity;
    target
}

fn odd_frames_are_survived(subject: &Subject<'_>) -> Verdict {
    let controller = &mut *subject.controller(From::Nothing)?;
    let ahead = target(2.0, 0.3, Vector2::zeros());
    let mut frames = odd_frames();
    frames.push(("image-less", bare_frame()));
    for (name, frame) in &frames {
        bounded(command(controller, frame, Some(&ahead)), name)?;
        bounded(command(controller, frame, None), name)?;
    }
    Ok(())
}

fn open_space(index: u64, people: &[Figure]) -> Frame {
    let images = World { people: people.to_vec(), ..World::default() }.draw(&level());
    frame(index, &level(), images)
}

fn repeatable(subject: &Subject<'_>) -> Verdict {
    let defaults = subject.info.defaults();
    let first = drive_after(subject, From::Nothing)?;
    let second = drive_after(subject, From::Text(&defaults))?;
    demand(first == second, || format!("two runs differ: {first:?} and {second:?}"))
}

/// Returns the commands while following a target that walks away.
fn drive_after(subject: &Subject<'_>, from: From<'_>) -> Result<Vec<Twist>, String> {
    let frame = open_space(1, &[Figure::at(2.0, 0.4)]);
    let controller = &mut *subject.controller(from)?;
    let steps = (0..10).map(|i| target(2.0 + 0.1 * f64::from(i), 0.4, Vector2::new(1.0, 0.0)));
    Ok(steps.map(|t| command(controller, &frame, Some(&t))).collect())
}

/// Checks the stop, also immediately after a target was followed at speed.
fn no_target_means_stop(subject: &Subject<'_>) -> Verdict {
    let controller = &mut *subject.controller(From::Nothing)?;
    let frame = open_space(1, &[]);
    let fast = target(4.0, 0.0, Vector2::new(1.0, 0.0));
    for lead in [None, Some(&fast), Some(&fast)] {
        if lead.is_some() {
            command(controller, &frame, lead);
        }
        let twist = command(controller, &frame, None);
        demand(twist == Twist::STOP, || format!("without a target it drives {twist:?}"))?;
    }
    Ok(())
}

fn speeds_are_bounded(subject: &Subject<'_>) -> Verdict {
    let controller = &mut *subject.controller(From::Nothing)?;
    let frame = open_space(1, &[]);
    // At the robot, beside and behind it, and farther away than the range of any camera.
    let places = [0.0, 1e-9, -1e-9, 0.3, -0.3, 1.5, -1.5, 6.0, -6.0, 500.0, -500.0];
    for x in places {
        for y in places {
            for velocity in [Vector2::zeros(), Vector2::new(3.0, -2.0)] {
                let ahead = target(x, y, velocity);
                bounded(command(controller, &frame, Some(&ahead)), &format!("target ({x}, {y})"))?;
            }
        }
    }
    let nowhere = target(f64::NAN, 0.0, Vector2::new(0.0, f64::INFINITY));
    bounded(command(controller, &frame, Some(&nowhere)), "target at NaN")
}

fn mirrored_target(subject: &Subject<'_>) -> Verdict {
    for (x, y) in [(1.0, 0.2), (2.0, 0.4), (3.5, -1.0), (0.8, 1.5), (-1.0, 0.5), (2.0, 0.0)] {
        let drawn = open_space(1, &[Figure::at(x, y)]);
        let there = steady(subject, drawn.images(), (x, y), 0.3)?;
        let mirror = steady(subject, mirrored(&drawn.images()), (x, -y), -0.3)?;
        let error = (there.left - mirror.right).abs().max((there.right - mirror.left).abs());
        demand(error < 1e-6, || {
            format!("target ({x}, {y}): {there:?}, its mirror image: {mirror:?}")
        })?;
    }
    Ok(())
}

/// Returns the last of five commands of a new controller for the same scene.
fn steady(
    subject: &Subject<'_>,
    images: Images,
    (x, y): (f64, f64),
    sideways_mps: f64,
) -> Result<WheelSpeeds, String> {
    let controller = &mut *subject.controller(From::Nothing)?;
    let ahead = target(x, y, Vector2::new(0.5, sideways_mps));
    let mut speeds = WheelSpeeds::STOP;
    for index in 1..=5 {
        let frame = frame(index, &level(), images.clone());
        let twist = command(controller, &frame, Some(&ahead));
        speeds = WHEELS.wheels_within(twist, MAX_SPEED_MPS);
    }
    Ok(speeds)
}
