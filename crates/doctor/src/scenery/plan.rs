//! Plan view of one frame, with the share of points in each cell that have come or gone.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point2, Point3};

use super::view::View;

/// Side of a cell, m.
pub const CELL_M: f64 = 0.1;

/// Least number of changed points in a cell that counts as changed.
const MIN_CHANGED: u32 = 3;

/// Cell of a plan, by column and row.
type Key = [i32; 2];

/// Counts of points in a cell.
#[derive(Clone, Copy, Debug)]
struct Cell {
    points: u32,
    changed: u32,
    /// Heights of the lowest and the highest changed point, m.
    low: f64,
    high: f64,
}

/// Plan view of the points of a frame, in the odometry frame.
#[derive(Default)]
pub struct Plan {
    cells: BTreeMap<Key, Cell>,
}

/// Person-sized group of changed points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blob {
    /// Centre, odometry frame, m.
    pub place: Point2<f64>,
    /// Larger side on the floor, m.
    pub width_m: f64,
    /// Height of its highest point, m.
    pub top_m: f64,
}

/// Range of the width of people, m, in whole cells, so that it is one cell wider than the person.
const WIDTH_M: std::ops::RangeInclusive<f64> = 0.25..=0.95;

/// Least height from the lowest to the highest point of a person, m.
const MIN_SPAN_M: f64 = 0.5;

/// Least visible surface of a person, square metres: a part of the trunk.
const MIN_AREA_M2: f64 = 0.08;

impl Plan {
    /// Adds a point of the odometry frame.
    pub fn add(&mut self, point: &Point3<f64>, is_changed: bool) {
        let nothing = Cell { points: 0, changed: 0, low: f64::INFINITY, high: f64::NEG_INFINITY };
        let cell = self.cells.entry(key(point.xy())).or_insert(nothing);
        cell.points += 1;
        if is_changed {
            cell.changed += 1;
            cell.low = cell.low.min(point.z);
            cell.high = cell.high.max(point.z);
        }
    }

    /// Returns the share of changed points within a distance of a position; `None` if the view
    /// shows nothing there.
    pub fn changed_share(&self, place: Point2<f64>, within_m: f64) -> Option<f64> {
        let near = self.cells.iter().filter(|(key, _)| (centre(key) - place).norm() <= within_m);
        let [points, changed] =
            near.fold([0, 0], |sum, (_, cell)| [sum[0] + cell.points, sum[1] + cell.changed]);
        (points >= MIN_POINTS).then(|| f64::from(changed) / f64::from(points))
    }

    /// Returns the person-sized groups of changed points.
    pub fn blobs(&self, view: &View) -> Vec<Blob> {
        let changed = self.cells.iter().filter(|(_, cell)| cell.changed >= MIN_CHANGED);
        let mut left: BTreeSet<Key> = changed.map(|(key, _)| *key).collect();
        let mut blobs = Vec::new();
        while let Some(first) = left.pop_first() {
            blobs.extend(self.person(&group(first, &mut left), view));
        }
        blobs
    }

    /// Returns the group of cells as a blob, if it has the size of a person.
    fn person(&self, group: &[Key], view: &View) -> Option<Blob> {
        let cells: Vec<&Cell> = group.iter().filter_map(|key| self.cells.get(key)).collect();
        let changed: u32 = cells.iter().map(|cell| cell.changed).sum();
        let weighted = group
            .iter()
            .zip(&cells)
            .map(|(key, cell)| centre(key).coords * f64::from(cell.changed));
        let place = Point2::from(weighted.sum::<nalgebra::Vector2<f64>>() / f64::from(changed));
        let (low, high) =
            cells.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), cell| {
                (low.min(cell.low), high.max(cell.high))
            });
        let width_m = extent(group, 0).max(extent(group, 1));
        let area = f64::from(changed) / view.pixels_per_square_metre((place - view.eye()).norm());
        let is_person =
            WIDTH_M.contains(&width_m) && high - low >= MIN_SPAN_M && area >= MIN_AREA_M2;
        is_person.then_some(Blob { place, width_m, top_m: high })
    }
}

/// Least number of points around a position for a statement about it.
const MIN_POINTS: u32 = 10;

fn key(place: Point2<f64>) -> Key {
    [place.x, place.y].map(|v| (v / CELL_M).floor() as i32)
}

fn centre(key: &Key) -> Point2<f64> {
    Point2::new((f64::from(key[0]) + 0.5) * CELL_M, (f64::from(key[1]) + 0.5) * CELL_M)
}

/// Removes the cells that are connected with one, including diagonally, from those that are left,
/// and returns them.
fn group(first: Key, left: &mut BTreeSet<Key>) -> Vec<Key> {
    let mut found = vec![first];
    let mut next = 0;
    while let Some([x, y]) = found.get(next).copied() {
        next += 1;
        let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| [x + dx, y + dy]));
        found.extend(around.filter(|key| left.remove(key)));
    }
    found
}

/// Returns the extent of cells along an axis, m.
fn extent(group: &[Key], axis: usize) -> f64 {
    let low = group.iter().map(|key| key[axis]).min().unwrap_or(0);
    let high = group.iter().map(|key| key[axis]).max().unwrap_or(0);
    f64::from(high - low + 1) * CELL_M
}
