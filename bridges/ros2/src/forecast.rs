//! Forecast of people's positions, as a grid for social layers of costmaps.
//!
//! Each confirmed person is assumed to continue at the estimated velocity, and the uncertainty of
//! position and velocity grows with time. The value of a cell is the probability that a person
//! comes near it within the next seconds; later times have less weight.

use nalgebra::{Isometry2, Matrix2, Point2, Vector2};
use serde::{Deserialize, Serialize};
use tagalong::core::{Frame, Stamp, Track};
use tagalong::log::msgs::{Header, Point, Pose, Quaternion, Time};
use tagalong::nalgebra;

mod sight;

use sight::Sight;

/// Distance within which a person occupies a cell, m: the width of a shoulder and a step aside.
const NEAR_M: f64 = 0.5;
/// Time between two positions of a forecast, s: a fast walker, at 2 m/s, moves less than `NEAR_M`
/// in that time.
const STEP_S: f64 = 0.2;
/// Time after which the weight of a forecast is halved, s.
const HALF_LIFE_S: f64 = 2.0;
/// Minimum time between two grids, s: costmaps are updated five times a second, and a grid is as
/// large as a small image.
const EACH_S: f64 = 0.2;
/// Value of cells that no sensor observes.
const UNKNOWN: i8 = -1;

/// Frame of the grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ForecastFrame {
    /// The odometry frame, in which costmaps are: the grid moves with the robot by whole cells.
    #[default]
    Odom,
    /// The robot frame, with X forward.
    Robot,
}

/// Settings of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ForecastSettings {
    pub(crate) frame: ForecastFrame,
    /// Side of a cell, m.
    pub(crate) resolution_m: f64,
    /// Side of the grid, m; the robot is in its middle.
    pub(crate) size_m: f64,
    /// Time horizon of the forecast, s.
    pub(crate) horizon_s: f64,
}

/// `nav_msgs/MapMetaData`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct MapMetaData {
    map_load_time: Time,
    /// Side of a cell, m.
    resolution: f32,
    width: u32,
    height: u32,
    /// Outer corner of the first cell.
    origin: Pose,
}

/// `nav_msgs/OccupancyGrid`: rows along X, starting at the lowest Y.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct OccupancyGrid {
    header: Header,
    info: MapMetaData,
    /// Probability in per cent, or -1 for unknown.
    data: Vec<i8>,
}

/// Moment for which a forecast is made.
#[derive(Clone, Copy)]
pub(crate) struct Now<'a> {
    pub(crate) frame: &'a Frame,
    pub(crate) tracks: &'a [Track],
    /// Pose of the robot in the odometry frame.
    pub(crate) odom_from_robot: &'a Isometry2<f64>,
    /// Name of the robot frame.
    pub(crate) base_frame: &'a str,
    /// Name of the odometry frame; that of the robot frame without odometry.
    pub(crate) world: &'a str,
}

/// Generator of the grids of a run.
pub(crate) struct Forecast {
    settings: ForecastSettings,
    /// Stamp of the last grid.
    last: Option<Stamp>,
}

impl Forecast {
    /// Creates a generator.
    pub(crate) fn new(settings: ForecastSettings) -> Self {
        Self { settings, last: None }
    }

    /// Returns the grid for a frame; `None` if the last one is too recent.
    pub(crate) fn grid(&mut self, now: Now<'_>) -> Option<OccupancyGrid> {
        let stamp = now.frame.stamp;
        let is_soon = self.last.is_some_and(|last| {
            let since_s = stamp.seconds_since(last);
            (0.0..EACH_S).contains(&since_s)
        });
        if is_soon {
            return None;
        }
        self.last = Some(stamp);
        let sight = Sight::new(now.frame);
        Some(grid(&self.settings, now, |at| sight.sees(at)))
    }
}

/// Returns the grid for a moment; `sees` returns true if the sensors would see a standing person at
/// a position on the floor, in the robot frame.
fn grid(
    settings: &ForecastSettings,
    now: Now<'_>,
    sees: impl Fn(&Point2<f64>) -> bool,
) -> OccupancyGrid {
    let grid_from_robot = match settings.frame {
        ForecastFrame::Odom => *now.odom_from_robot,
        ForecastFrame::Robot => Isometry2::identity(),
    };
    let side = (settings.size_m / settings.resolution_m).round().max(1.0) as usize;
    let layout = Layout::around(grid_from_robot.translation.vector, side, settings.resolution_m);
    let mut chances = vec![0.0_f64; side * side];
    for track in now.tracks.iter().filter(|track| track.confirmed) {
        let walk = Walk::new(track, &grid_from_robot);
        let mut step = 0.0;
        while step * STEP_S <= settings.horizon_s + 1e-9 {
            walk.add(step * STEP_S, &layout, &mut chances);
            step += 1.0;
        }
    }
    let robot_from_grid = grid_from_robot.inverse();
    let mut data = Vec::with_capacity(chances.len());
    for (number, chance) in chances.iter().enumerate() {
        let percent = (100.0 * chance).round() as i8;
        let is_known = percent > 0 || sees(&(robot_from_grid * layout.middle(number)));
        data.push(if is_known { percent } else { UNKNOWN });
    }
    let frame = match settings.frame {
        ForecastFrame::Odom => now.world,
        ForecastFrame::Robot => now.base_frame,
    };
    OccupancyGrid {
        header: Header::new(now.frame.stamp, frame),
        info: MapMetaData {
            map_load_time: now.frame.stamp.into(),
            resolution: settings.resolution_m as f32,
            width: side as u32,
            height: side as u32,
            origin: Pose {
                position: Point { x: layout.corner.x, y: layout.corner.y, z: 0.0 },
                orientation: Quaternion::default(),
            },
        },
        data,
    }
}

/// Cells of a square grid.
struct Layout {
    /// Outer corner of the first cell, m.
    corner: Point2<f64>,
    /// Number of cells along a side.
    side: usize,
    cell_m: f64,
}

impl Layout {
    /// Returns the grid around a position. Its corner is an integer number of cells from the
    /// origin, so that cells do not shift while the robot drives.
    fn around(middle: Vector2<f64>, side: usize, cell_m: f64) -> Self {
        let half = (side / 2) as f64;
        let corner = middle.map(|along| ((along / cell_m).round() - half) * cell_m);
        Self { corner: corner.into(), side, cell_m }
    }

    /// Returns the centre of a cell.
    fn middle(&self, number: usize) -> Point2<f64> {
        let column = (number % self.side) as f64 + 0.5;
        let row = (number / self.side) as f64 + 0.5;
        self.corner + Vector2::new(column, row) * self.cell_m
    }

    /// Returns the columns, or rows, of cells within `reach_m` of a coordinate; `corner_m` is the
    /// coordinate of the corner.
    fn span(&self, at_m: f64, reach_m: f64, corner_m: f64) -> std::ops::Range<usize> {
        let side = self.side as f64;
        let first = ((at_m - reach_m - corner_m) / self.cell_m).floor().clamp(0.0, side);
        let last = ((at_m + reach_m - corner_m) / self.cell_m).ceil().clamp(0.0, side);
        first as usize..last as usize
    }
}

/// Motion of one person at constant velocity, in the frame of the grid.
struct Walk {
    at: Point2<f64>,
    velocity: Vector2<f64>,
    /// Covariance of the position, m².
    place: Matrix2<f64>,
    /// Covariance of position and velocity, plus its transpose, m²/s.
    cross: Matrix2<f64>,
    /// Covariance of the velocity, m²/s².
    speed: Matrix2<f64>,
}

impl Walk {
    fn new(track: &Track, grid_from_robot: &Isometry2<f64>) -> Self {
        let estimate = &track.estimate;
        let turn = grid_from_robot.rotation.to_rotation_matrix().into_inner();
        let covariance = &estimate.covariance;
        // The state is (x, y, z, vx, vy).
        let place = covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let cross = covariance.fixed_view::<2, 2>(0, 3).into_owned();
        let speed = covariance.fixed_view::<2, 2>(3, 3).into_owned();
        Self {
            at: grid_from_robot * estimate.person.position.xy(),
            velocity: turn * estimate.person.velocity,
            place: turn * place * turn.transpose(),
            cross: turn * (cross + cross.transpose()) * turn.transpose(),
            speed: turn * speed * turn.transpose(),
        }
    }

    /// Adds the person after `ahead_s` to the cells.
    fn add(&self, ahead_s: f64, layout: &Layout, chances: &mut [f64]) {
        let middle = self.at + self.velocity * ahead_s;
        let spread = self.place + self.cross * ahead_s + self.speed * (ahead_s * ahead_s);
        // A disc of this radius has this variance along each axis; the sum is the covariance of
        // person and disc together.
        let disc = Matrix2::identity() * (0.25 * NEAR_M * NEAR_M);
        // A filter may report an invalid covariance, but the person is somewhere nevertheless.
        let is_proper = spread.diagonal().min() >= 0.0 && (spread + disc).determinant() > 0.0;
        let sum = if is_proper { spread + disc } else { disc };
        let Some(inverse) = sum.try_inverse() else { return };
        let weight = 0.5_f64.powf(ahead_s / HALF_LIFE_S);
        let peak = 0.5 * NEAR_M * NEAR_M / sum.determinant().sqrt();
        let reach = sum.diagonal().map(|variance| 4.0 * variance.sqrt());
        for row in layout.span(middle.y, reach.y, layout.corner.y) {
            for column in layout.span(middle.x, reach.x, layout.corner.x) {
                let number = row * layout.side + column;
                let away = layout.middle(number) - middle;
                let density = peak * (-0.5 * away.dot(&(inverse * away))).exp();
                chances[number] = chances[number].max(weight * density.min(1.0));
            }
        }
    }
}

#[cfg(test)]
mod tests;
