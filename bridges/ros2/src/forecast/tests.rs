use std::sync::Arc;

use nalgebra::{Isometry2, Point3, SMatrix, Vector2};
use tagalong::core::{DepthImage, EgoMotion, Estimate, Frame, Images, Person, TrackId};
use tagalong::geometry::{Camera, Pinhole, Rect};

use super::*;

const SETTINGS: ForecastSettings = ForecastSettings {
    frame: ForecastFrame::Odom,
    resolution_m: 0.1,
    size_m: 12.0,
    horizon_s: 4.0,
};

/// Returns a confirmed person whose position and velocity are known up to these deviations, m and m/s.
fn person(at: [f64; 2], velocity: [f64; 2], deviations: [f64; 2]) -> Track {
    let [place, speed] = deviations.map(|deviation| deviation * deviation);
    let covariance = SMatrix::<f64, 5, 5>::from_diagonal(&[place, place, 0.0, speed, speed].into());
    let person =
        Person { position: Point3::new(at[0], at[1], 1.6), velocity: Vector2::from(velocity) };
    Track::new(TrackId(1), Estimate::new(person, covariance, Rect::default()), 3.0).with_age(10)
}

/// Makes two entries of the state of a person vary together.
fn couple(track: &mut Track, [first, second]: [usize; 2], covariance: f64) {
    track.estimate.covariance[(first, second)] = covariance;
    track.estimate.covariance[(second, first)] = covariance;
}

/// Returns a frame of a camera that is 90 degrees wide, at the height of a table.
pub(super) fn frame_at(stamp_s: f64, depth: Option<DepthImage>) -> Frame {
    let lens = Pinhole::centred(80.0, 160, 120);
    let camera = Camera::mounted(lens, 160, 120, 1.0, 0.0, 0.0);
    let stamp = Stamp::from_nanos((stamp_s * 1e9) as u64);
    let images = Images { depth: depth.map(Arc::new), ..Images::default() };
    Frame::new(1, stamp, Arc::new(camera), EgoMotion::at_rest(0.1), images)
}

fn now<'a>(frame: &'a Frame, tracks: &'a [Track], robot: &'a Isometry2<f64>) -> Now<'a> {
    Now { frame, tracks, odom_from_robot: robot, base_frame: "base_link", world: "odom" }
}

fn made(settings: &ForecastSettings, tracks: &[Track], robot: Isometry2<f64>) -> OccupancyGrid {
    // The robot sees what is ahead of it.
    grid(settings, now(&frame_at(7.0, None), tracks, &robot), |at| at.x > 0.0)
}

/// Returns the value of the cell at a place in the frame of the grid.
fn value(grid: &OccupancyGrid, x: f64, y: f64) -> i8 {
    let cell_m = f64::from(grid.info.resolution);
    let column = ((x - grid.info.origin.position.x) / cell_m).floor() as usize;
    let row = ((y - grid.info.origin.position.y) / cell_m).floor() as usize;
    grid.data[row * grid.info.width as usize + column]
}

#[test]
fn a_person_is_occupied_the_rest_of_the_view_free_and_what_is_outside_unknown() {
    let tracks = [person([3.0, 1.0], [0.0, 0.0], [0.05, 0.0])];
    let grid = made(&SETTINGS, &tracks, Isometry2::identity());
    assert_eq!((grid.info.width, grid.info.height, grid.data.len()), (120, 120, 14_400));
    assert_eq!((grid.header.frame_id.as_str(), grid.header.stamp.sec), ("odom", 7));
    assert_eq!(value(&grid, 3.05, 1.05), 100);
    assert!((20..100).contains(&value(&grid, 3.45, 1.05)), "{}", value(&grid, 3.45, 1.05));
    assert_eq!(value(&grid, 3.05, -1.05), 0);
    assert_eq!(value(&grid, -3.05, 1.05), UNKNOWN);
    // A person on the way out of the view is known there.
    let leaving = [person([0.5, 0.0], [-1.0, 0.0], [0.05, 0.1])];
    assert!(value(&made(&SETTINGS, &leaving, Isometry2::identity()), -1.05, 0.05) > 10);
    assert!((-1..=100).contains(&grid.data.iter().copied().min().unwrap()));
    let tentative = tracks[0].clone().with_confirmed(false);
    let empty = made(&SETTINGS, &[tentative], Isometry2::identity());
    assert_eq!(value(&empty, 3.05, 1.05), 0);
}

#[test]
fn a_walk_is_forecast_along_its_direction_the_later_the_less_until_the_horizon() {
    let tracks = [person([1.0, 0.0], [1.0, 0.0], [0.02, 0.0])];
    let settings = ForecastSettings { horizon_s: 3.0, ..SETTINGS };
    let grid = made(&settings, &tracks, Isometry2::identity());
    // A certain walk loses by its time alone: half each two seconds, from the moment a step before, in
    // which the person comes near.
    for (seconds, percent) in [(0.0, 100), (1.0, 76), (2.0, 54), (3.0, 38)] {
        let after = value(&grid, 1.05 + seconds, 0.05);
        assert!((after - percent).abs() <= 1, "{seconds} s: {after}");
    }
    assert_eq!(value(&grid, 1.05 + 4.0, 0.05), 0, "after the horizon");
    assert_eq!(value(&grid, 0.05, 0.05), 0, "behind");
}

#[test]
fn uncertain_velocity_spreads_with_time() {
    let certain =
        made(&SETTINGS, &[person([0.5, 0.0], [1.0, 0.0], [0.1, 0.0])], Isometry2::identity());
    let uncertain =
        made(&SETTINGS, &[person([0.5, 0.0], [1.0, 0.0], [0.1, 0.4])], Isometry2::identity());
    let beside = [&certain, &uncertain].map(|grid| value(grid, 3.55, 1.05));
    assert!(beside[0] == 0 && beside[1] >= 2, "{beside:?}");
    assert!(value(&uncertain, 3.55, 0.05) + 20 < value(&certain, 3.55, 0.05));
    // A person on the left that walks to the left is farther to the left later: more spread.
    let coupled = [-0.1, 0.0, 0.1].map(|covariance| {
        let mut track = person([0.5, 0.0], [1.0, 0.0], [0.3, 0.4]);
        couple(&mut track, [1, 4], covariance);
        value(&made(&SETTINGS, &[track], Isometry2::identity()), 1.55, 0.05)
    });
    assert!(coupled[0] > coupled[1] && coupled[1] > coupled[2], "{coupled:?}");
}

/// The sum over all cells is the area of the disc around the person, whatever the uncertainty.
#[test]
fn the_chance_of_all_cells_is_the_area_near_a_person() {
    let mut tracks = [person([3.0, 0.0], [0.0, 0.0], [0.0, 0.0])];
    tracks[0].estimate.covariance[(0, 0)] = 0.3;
    tracks[0].estimate.covariance[(1, 1)] = 0.7;
    couple(&mut tracks[0], [0, 1], 0.2);
    let grid = made(&SETTINGS, &tracks, Isometry2::identity());
    let sum: f64 = grid.data.iter().map(|percent| f64::from((*percent).max(0))).sum();
    let area = sum / 100.0 * 0.1 * 0.1;
    let disc = std::f64::consts::PI * NEAR_M * NEAR_M;
    assert!((area / disc - 1.0).abs() < 0.05, "{area} of {disc} m²");
}

#[test]
fn the_grid_stands_in_its_frame_around_the_robot() {
    // The robot looks along Y of the odometry; the person walks to its left.
    let robot = Isometry2::new(Vector2::new(10.03, -4.0), std::f64::consts::FRAC_PI_2);
    let tracks = [person([2.0, 0.0], [0.0, 1.0], [0.05, 0.0])];
    let odom = made(&SETTINGS, &tracks, robot);
    assert_eq!(value(&odom, 10.05, -1.95), 100);
    assert!(value(&odom, 9.05, -1.95) > 60, "a second later, to the left");
    assert_eq!(value(&odom, 11.05, -1.95), 0, "not to the right");
    assert_eq!(value(&odom, 10.05, -5.05), UNKNOWN, "behind the robot");
    // Cells stay where they are while the robot drives.
    let cells = odom.info.origin.position.x / 0.1;
    assert!((cells - cells.round()).abs() < 1e-6, "{cells}");
    let settings = ForecastSettings {
        frame: ForecastFrame::Robot,
        resolution_m: 0.25,
        size_m: 8.0,
        ..SETTINGS
    };
    let grid = made(&settings, &tracks, robot);
    assert_eq!((grid.header.frame_id.as_str(), grid.info.width), ("base_link", 32));
    assert!(value(&grid, 2.1, 0.1) > 80 && value(&grid, 2.1, 1.1) > 50);
    assert_eq!(grid.info.origin.position.x, -4.0);
}

#[test]
fn a_person_with_a_covariance_that_is_none_stays_where_the_filter_says() {
    let mut broken = person([3.0, 0.0], [0.0, 0.0], [0.0, 0.0]);
    couple(&mut broken, [0, 1], 9.0);
    let grid = made(&SETTINGS, &[broken], Isometry2::identity());
    assert_eq!((value(&grid, 3.05, 0.05), value(&grid, 3.05, 2.05)), (100, 0));
}

#[test]
fn a_grid_comes_at_most_five_times_a_second() {
    let robot = Isometry2::identity();
    let mut forecast = Forecast::new(SETTINGS);
    let mut count = 0;
    for tenth in 0..20 {
        let frame = frame_at(5.0 + 0.1 * f64::from(tenth) + 1e-4, None);
        count += usize::from(forecast.grid(now(&frame, &[], &robot)).is_some());
    }
    // By rounding of stamps one in three frames, or two.
    assert!((7..=10).contains(&count), "{count}");
    // A clock that goes back ends no forecast.
    assert!(forecast.grid(now(&frame_at(1.0, None), &[], &robot)).is_some());
}
