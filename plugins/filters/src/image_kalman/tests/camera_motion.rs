//! A camera whose pose on the robot, or lens, changes between frames.

use std::sync::Arc;

use nalgebra::Point3;
use tagalong_core::{EgoMotion, Evidence, Filter, Frame, Images, Matched, Stamp, TrackId};
use tagalong_geometry::{Camera, Lens, Pinhole};

use super::{DT_S, camera, person};
use crate::image_kalman::{Config, ImageKalman, State};

/// The same lens and place, looking down by more.
fn nodding(by_rad: f64) -> Arc<Camera> {
    let Lens::Pinhole(lens) = camera().lens else { unreachable!() };
    Arc::new(Camera::mounted(lens, 640, 480, 1.3, 0.15 + by_rad, 0.05))
}

/// A camera on a robot that brakes, or on a head that tilts: the pose of its mount changes.
#[test]
fn the_box_moves_with_a_camera_that_nods() {
    let config = Config::default();
    let seen = person(Point3::new(4.0, 0.3, 1.5));
    let before = State::start(&config, &seen, &camera());
    let mut state = before.clone();
    let nodding = nodding(0.05);
    state.predict(&config, &EgoMotion::at_rest(DT_S), &nodding);
    let expected = nodding.upper_body(&seen.position).centre();
    let centre = state.estimate(&nodding).region.centre();
    assert!((centre - expected).norm() < 1.5, "{centre} {expected}");
    let rise = before.estimate(&camera()).region.centre().y - centre.y;
    assert!(rise > 20.0, "{rise}");
    let place = state.estimate(&nodding).person;
    assert!((place.position - seen.position).norm() < 0.02, "{:?}", place.position);
    assert!(place.velocity.norm() < 0.05, "{:?}", place.velocity);
}

#[test]
fn the_box_grows_with_the_focal_length() {
    let config = Config::default();
    let seen = person(Point3::new(4.0, 0.3, 1.5));
    let mut state = State::start(&config, &seen, &camera());
    let Lens::Pinhole(lens) = camera().lens else { unreachable!() };
    let lens = Lens::Pinhole(Pinhole { fx: 1.2 * lens.fx, fy: 1.2 * lens.fy, ..lens });
    let near = Camera { lens, ..(*camera()).clone() };
    let width = state.estimate(&camera()).region.width;
    state.predict(&config, &EgoMotion::at_rest(DT_S), &near);
    assert!((state.estimate(&near).region.width / width - 1.2).abs() < 1e-9);
    let expected = near.upper_body(&seen.position).centre();
    assert!((state.estimate(&near).region.centre() - expected).norm() < 1.5);
}

/// In the gap the camera nods and returns: a state that is filtered anew has seen both.
#[test]
fn a_gap_is_filtered_anew_with_the_cameras_of_its_frames() {
    let config = Config { reupdate: true, ..Config::default() };
    let seen = person(Point3::new(4.0, 0.3, 1.5));
    let [nods, still] = [0.05, 0.0].map(|nod_rad| {
        let mut filter = ImageKalman::new(config.clone()).unwrap();
        filter.start(TrackId(1), &seen, &camera());
        for frame in 0..6 {
            let camera = if frame == 2 { nodding(nod_rad) } else { camera() };
            filter.predict(&EgoMotion::at_rest(DT_S), &camera);
        }
        let motion = EgoMotion::at_rest(DT_S);
        let frame = Frame::new(7, Stamp::default(), camera(), motion, Images::default());
        let matched = [Matched::certain(TrackId(1), &seen)];
        let evidence = Evidence::new(&frame, &matched);
        filter.update(&evidence).unwrap();
        filter.estimates(&camera())[&TrackId(1)].person.velocity.norm()
    });
    assert!(nods < still + 0.05, "{nods} {still}");
}
