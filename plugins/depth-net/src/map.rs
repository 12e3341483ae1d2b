use multiversion::multiversion;
use nalgebra::{Point2, Point3};
use tagalong_core::{DepthImage, Derived, Frame, Result};
use tagalong_geometry::{Camera, Lens};
use tagalong_learn::conv::Map;

use crate::lanes::{LANES, NONE, PixelRays, Projector, readings, whole};
use crate::{Beams, Quarter};

/// Columns of a depth image beyond which it is thinned out.
const COLUMNS: usize = 320;
/// Nearest edge of the map in front of the robot, m ...
const FIRST_X_M: f64 = 0.2;
/// ... and its right edge, m.
const FIRST_Y_M: f64 = -3.2;
/// Side of a fine cell, m.
const FINE_M: f64 = 0.05;
/// Height of the lowest slab, m, and height of each, m.
const FLOOR_M: f64 = 0.1;
const SLAB_M: f64 = 0.2;
/// Surfaces that are as large as the front of a cell, per m².
const PER_CELL: f64 = 1.0 / (FINE_M * SLAB_M);
/// Points above this height are ceilings and lamps, m.
const CEILING_M: f64 = 2.3;
/// Nearest depth that counts, m.
const NEAREST_M: f32 = 0.1;
/// Depth beside a voxel's by which it is in front of or behind the surface, m.
const MARGIN_M: f64 = 0.12;
/// Heights of the voxels, m.
const HEIGHTS_M: [f64; FloorMap::VOXELS] = [0.3, 0.7, 1.1, 1.5, 1.9];
/// Cells beside the camera's view in which a partly visible person may stand.
const BESIDE: usize = 3;

/// Plan view of a depth image in the robot frame. Rows of both grids run forwards from 0.2 m to
/// 6.6 m, columns from 3.2 m at the right to 3.2 m at the left.
#[derive(Clone, Debug, PartialEq)]
pub struct FloorMap {
    /// Cells of 5 cm: for each of ten slabs of 20 cm, from 0.1 m upwards, the root of the surface
    /// that the camera sees in it, relative to that of its front, at most 1; and half the greatest
    /// height, m.
    pub fine: Map<{ Self::FINE }>,
    /// Cells of 10 cm: for each of five heights, 1 if the voxel there is seen to be empty, and 1
    /// if it is hidden behind something. Neither holds for a surface and outside of the image.
    pub coarse: Map<{ Self::COARSE }>,
    /// True for cells of 10 cm that the camera has in its view, or that are near to it.
    pub in_view: Vec<bool>,
}

impl FloorMap {
    /// Slabs of height.
    const SLABS: usize = 10;
    /// Heights of voxels.
    const VOXELS: usize = 5;
    /// Channels of the fine cells ...
    pub const FINE: usize = Self::SLABS + 1;
    /// ... and of the coarse ones.
    pub const COARSE: usize = 2 * Self::VOXELS;
    /// Coarse cells per side of the map; there are twice as many fine ones.
    pub const CELLS: usize = 64;
    /// Side of a coarse cell, m.
    pub const CELL_M: f64 = 2.0 * FINE_M;

    /// Computes the map of a depth image.
    pub fn new(camera: &Camera, depth: &DepthImage) -> Self {
        let mut map = Self::empty();
        add_points(&mut map, &PixelRays::new(camera), depth);
        map.flatten_surface();
        match Projector::new(camera, [depth.width(), depth.height()]) {
            Some(projector) => add_voxels(&mut map, &projector, depth),
            None => map.add_voxels(|voxel| {
                let pixel = camera.project(voxel)?;
                let seen_m = depth.get(pixel.x.round() as i64, pixel.y.round() as i64)?;
                Some([seen_m.into(), camera.depth_of(voxel)])
            }),
        }
        map.in_view = widened(&map.in_view);
        map
    }

    /// Computes the map of what a lidar sees in a quarter of the directions around the robot; `None`
    /// if nothing of it is in the map.
    pub fn of_beams(beams: &Beams, quarter: Quarter) -> Option<Self> {
        let mut map = Self::empty();
        for (point, area_m2) in &beams.points {
            map.add_point(&quarter.view_of(*point), *area_m2);
        }
        if map.fine.values.iter().all(|value| *value == 0.0) {
            return None;
        }
        map.flatten_surface();
        map.add_voxels(|voxel| {
            let voxel = quarter.robot_of(*voxel);
            let seen_m = beams.range_m(&voxel)?;
            Some([seen_m.into(), (voxel - beams.scanner()).norm()])
        });
        map.in_view = widened(&map.in_view);
        Some(map)
    }

    fn empty() -> Self {
        Self {
            fine: Map::new(2 * Self::CELLS, 2 * Self::CELLS),
            coarse: Map::new(Self::CELLS, Self::CELLS),
            in_view: vec![false; Self::CELLS * Self::CELLS],
        }
    }

    /// Returns the centre of a coarse cell on the floor, m.
    pub fn centre(row: usize, column: usize) -> Point2<f64> {
        let [x, y] = [(FIRST_X_M, row), (FIRST_Y_M, column)]
            .map(|(first_m, cell)| first_m + Self::CELL_M * (cell as f64 + 0.5));
        Point2::new(x, y)
    }

    /// Returns the map with left and right exchanged.
    #[cfg(feature = "train")]
    pub(crate) fn mirrored(mut self) -> Self {
        let side = Self::CELLS;
        for row in self.fine.values.chunks_mut(2 * side * Self::FINE) {
            row.as_chunks_mut::<{ Self::FINE }>().0.reverse();
        }
        for row in self.coarse.values.chunks_mut(side * Self::COARSE) {
            row.as_chunks_mut::<{ Self::COARSE }>().0.reverse();
        }
        self.in_view.chunks_mut(side).for_each(<[bool]>::reverse);
        self
    }

    /// Adds a point with the area that it stands for, m².
    fn add_point(&mut self, point: &Point3<f64>, area_m2: f64) {
        let row = ((point.x - FIRST_X_M) / FINE_M).floor();
        let column = ((point.y - FIRST_Y_M) / FINE_M).floor();
        let cells = 0.0..2.0 * Self::CELLS as f64;
        if !cells.contains(&row) || !cells.contains(&column) || point.z >= CEILING_M {
            return;
        }
        let cell = self.fine.at_mut(row as usize, column as usize);
        cell[Self::SLABS] = cell[Self::SLABS].max(0.5 * point.z as f32);
        let slab = ((point.z - FLOOR_M) / SLAB_M).floor();
        if (0.0..Self::SLABS as f64).contains(&slab) {
            cell[slab as usize] += (area_m2 * PER_CELL) as f32;
        }
    }

    /// Takes the root of the surfaces, which are still sums of areas.
    fn flatten_surface(&mut self) {
        for cell in self.fine.values.as_chunks_mut::<{ Self::FINE }>().0 {
            cell[..Self::SLABS].iter_mut().for_each(|surface| *surface = surface.sqrt().min(1.0));
        }
    }

    /// Compares voxels with the surfaces in their directions. `look` returns how far away the
    /// surface is, NaN without a reading, and how far the voxel, m; `None` outside of the view.
    fn add_voxels(&mut self, look: impl Fn(&Point3<f64>) -> Option<[f64; 2]>) {
        for cell in 0..Self::CELLS * Self::CELLS {
            let row = cell / Self::CELLS;
            let column = cell % Self::CELLS;
            let floor = Self::centre(row, column);
            for (k, height_m) in HEIGHTS_M.into_iter().enumerate() {
                let Some([seen_m, voxel_m]) = look(&Point3::new(floor.x, floor.y, height_m)) else {
                    continue;
                };
                self.see_voxel(cell, k, [seen_m, voxel_m]);
            }
        }
    }

    /// Compares a voxel of a coarse cell with the surface in its direction: how far away the surface
    /// and the voxel are, m.
    #[inline(always)]
    fn see_voxel(&mut self, cell: usize, k: usize, [seen_m, voxel_m]: [f64; 2]) {
        self.in_view[cell] = true;
        let behind_m = seen_m - voxel_m;
        let voxel = &mut self.coarse.values.as_chunks_mut::<{ Self::COARSE }>().0[cell];
        // Neither comparison holds for a pixel without a reading.
        voxel[2 * k] = f32::from(behind_m > MARGIN_M);
        voxel[2 * k + 1] = f32::from(behind_m < -MARGIN_M && seen_m > f64::from(NEAREST_M));
    }
}

impl Derived for FloorMap {
    fn derive(frame: &Frame) -> Result<Self> {
        let depth = frame.depth()?;
        Ok(match reduced(&frame.camera, depth) {
            Some((camera, depth)) => Self::new(&camera, &depth),
            None => Self::new(&frame.camera, depth),
        })
    }
}

/// Adds the points of a depth image, as [`FloorMap::add_point`] does one by one.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_points(map: &mut FloorMap, rays: &PixelRays<'_>, depth: &DepthImage) {
    let side = 2.0 * FloorMap::CELLS as f64;
    let cells = map.fine.values.as_chunks_mut::<{ FloorMap::FINE }>().0;
    for y in 0..depth.height() {
        for (number, part) in depth.row(y).chunks(LANES).enumerate() {
            let points = rays.points([number * LANES, y], &readings(part, NEAREST_M));
            let mut cell = [NONE; LANES];
            let mut slab = [NONE; LANES];
            for lane in 0..LANES {
                let row = ((points.x[lane] - FIRST_X_M) / FINE_M).floor();
                let column = ((points.y[lane] - FIRST_Y_M) / FINE_M).floor();
                // No comparison holds without a reading.
                let is_inside = (row >= 0.0)
                    & (row < side)
                    & (column >= 0.0)
                    & (column < side)
                    & (points.z[lane] < CEILING_M);
                let number = whole(row * side + column);
                cell[lane] = if is_inside { number } else { NONE };
                let above = ((points.z[lane] - FLOOR_M) / SLAB_M).floor();
                let has_slab = (above >= 0.0) & (above < FloorMap::SLABS as f64);
                slab[lane] = if has_slab { whole(above) } else { NONE };
            }
            for lane in 0..LANES {
                let Some(cell) = cells.get_mut(cell[lane] as usize) else { continue };
                cell[FloorMap::SLABS] = cell[FloorMap::SLABS].max(0.5 * points.z[lane] as f32);
                if slab[lane] != NONE {
                    cell[slab[lane] as usize] += (points.area_m2[lane] * PER_CELL) as f32;
                }
            }
        }
    }
}

/// Compares voxels with the surfaces in their directions, as [`FloorMap::add_voxels`] does one by one.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_voxels(map: &mut FloorMap, projector: &Projector, depth: &DepthImage) {
    for row in 0..FloorMap::CELLS {
        for first in (0..FloorMap::CELLS).step_by(LANES) {
            let x = FloorMap::centre(row, first).x;
            let mut y = [0.0; LANES];
            for (lane, y) in y.iter_mut().enumerate() {
                *y = FloorMap::centre(row, first + lane).y;
            }
            for (k, height_m) in HEIGHTS_M.into_iter().enumerate() {
                let voxels = projector.pixels(x, &y, height_m);
                for lane in 0..LANES {
                    let pixel = voxels.pixel[lane] as usize;
                    let Some(seen_m) = depth.pixels().get(pixel) else { continue };
                    let cell = row * FloorMap::CELLS + first + lane;
                    map.see_voxel(cell, k, [f64::from(*seen_m), voxels.depth_m[lane]]);
                }
            }
        }
    }
}

/// Calls `see` with each point of a depth image in the robot frame, and with the area that its
/// pixel covers, m².
#[cfg(any(test, feature = "train"))]
pub(crate) fn for_each_point(
    camera: &Camera,
    depth: &DepthImage,
    mut see: impl FnMut(Point3<f64>, f64),
) {
    let rays = PixelRays::new(camera);
    for y in 0..depth.height() {
        for (number, part) in depth.row(y).chunks(LANES).enumerate() {
            let depth_m = readings(part, NEAREST_M);
            let points = rays.points([number * LANES, y], &depth_m);
            for lane in (0..LANES).filter(|lane| !depth_m[*lane].is_nan()) {
                let point = Point3::new(points.x[lane], points.y[lane], points.z[lane]);
                see(point, points.area_m2[lane]);
            }
        }
    }
}

/// Returns every second, third ... pixel of a depth image that has more than 320 columns, and the
/// camera of these; `None` for smaller ones and for cameras without a pinhole.
pub fn reduced(camera: &Camera, depth: &DepthImage) -> Option<(Camera, DepthImage)> {
    let step = (depth.width() as f64 / COLUMNS as f64).round() as usize;
    let Lens::Pinhole(lens) = &camera.lens else { return None };
    if step < 2 {
        return None;
    }
    let first = step / 2;
    let by = step as f64;
    let [width, height] = [depth.width(), depth.height()].map(|size| (size - first).div_ceil(step));
    let mut image = DepthImage::filled(width, height, f32::NAN);
    for (y, row) in image.pixels_mut().chunks_exact_mut(width.max(1)).enumerate() {
        let from = depth.row(first + y * step)[first..].iter().step_by(step);
        row.iter_mut().zip(from).for_each(|(to, depth_m)| *to = *depth_m);
    }
    let mut lens = *lens;
    (lens.fx, lens.fy) = (lens.fx / by, lens.fy / by);
    (lens.cx, lens.cy) = ((lens.cx - first as f64) / by, (lens.cy - first as f64) / by);
    Some((Camera { lens: Lens::Pinhole(lens), width, height, ..camera.clone() }, image))
}

/// Returns the cells that are true or at most [`BESIDE`] cells away from one that is.
fn widened(cells: &[bool]) -> Vec<bool> {
    // Each pass turns rows into columns.
    widened_along(&widened_along(cells))
}

/// Returns, column by column, the cells that are true or have one near in their row.
fn widened_along(cells: &[bool]) -> Vec<bool> {
    let side = FloorMap::CELLS;
    let mut widened = vec![false; side * side];
    for (row, cells) in cells.chunks_exact(side).enumerate() {
        for column in 0..side {
            let near = column.saturating_sub(BESIDE)..(column + BESIDE + 1).min(side);
            widened[column * side + row] = cells[near].contains(&true);
        }
    }
    widened
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    fn camera(height_m: f64) -> Camera {
        Camera::mounted(Pinhole::centred(60.0, 80, 60), 80, 60, height_m, 0.0, 0.0)
    }

    /// The coarse cell of a place.
    fn cell(x: f64, y: f64) -> [usize; 2] {
        [((x - 0.2) / 0.1) as usize, ((y + 3.2) / 0.1) as usize]
    }

    #[test]
    fn a_wall_is_a_surface_hides_what_is_behind_and_leaves_what_is_before_empty() {
        let map = FloorMap::new(&camera(1.1), &DepthImage::filled(80, 60, 3.02));
        let [row, column] = cell(3.02, 0.05);
        let fine = [0, 1].map(|k| map.fine.at(2 * row, 2 * column + k));
        // Slab 5 is from 1.1 to 1.3 m, before the camera.
        assert!(fine[0][5] > 0.9 && fine[1][5] > 0.9, "{fine:?}");
        assert!((fine[0][10] - 1.1).abs() < 0.06, "half the ceiling of 2.3 m: {}", fine[0][10]);
        for (x, voxel, expected, what) in [
            (2.05, 2, [1.0, 0.0], "empty"),
            (3.02, 2, [0.0, 0.0], "a surface"),
            (4.05, 2, [0.0, 1.0], "hidden"),
            (0.45, 4, [0.0, 0.0], "above the image"),
        ] {
            let [row, column] = cell(x, 0.05);
            assert_eq!(map.coarse.at(row, column)[2 * voxel..2 * voxel + 2], expected, "{what}");
        }
    }

    #[test]
    fn cells_beside_the_view_are_not_in_it_but_for_those_near() {
        let map = FloorMap::new(&camera(1.1), &DepthImage::filled(80, 60, f32::NAN));
        // At 3 m the view ends 2 m at each side.
        for (y, is_in) in [(1.95, true), (2.15, true), (-2.15, true), (2.65, false), (-2.65, false)]
        {
            let [row, column] = cell(3.05, y);
            assert_eq!(map.in_view[row * 64 + column], is_in, "{y}");
        }
        assert!(map.fine.values.iter().chain(&map.coarse.values).all(|value| *value == 0.0));
    }

    #[test]
    fn a_larger_image_of_the_same_scene_gives_nearly_the_same_map() {
        let small = camera(1.0);
        let lens = Pinhole::centred(480.0, 640, 480);
        let large = Camera::mounted(lens, 640, 480, 1.0, 0.0, 0.0);
        let (camera, image) = reduced(&large, &DepthImage::filled(640, 480, 2.53)).unwrap();
        assert_eq!((image.width(), image.height(), camera.width), (320, 240, 320));
        assert!(reduced(&small, &DepthImage::filled(80, 60, 1.0)).is_none());
        let ray = camera.ray(Point2::new(10.0, 20.0)) - large.ray(Point2::new(21.0, 41.0));
        assert!(ray.norm() < 1e-12);
        let huge = Camera::mounted(Pinhole::centred(960.0, 1280, 960), 1280, 960, 1.0, 0.0, 0.0);
        let depth = DepthImage::from_fn(1280, 960, |x, y| (x + 2000 * y) as f32);
        let (fourth, thinned) = reduced(&huge, &depth).unwrap();
        assert_eq!((thinned.width(), thinned.height(), fourth.height), (320, 240, 240));
        assert_eq!(thinned.row(20)[10], (42 + 2000 * 82) as f32, "every fourth from the third on");
        let ray = fourth.ray(Point2::new(10.0, 20.0)) - huge.ray(Point2::new(42.0, 82.0));
        assert!(ray.norm() < 1e-12);
        let [a, b] = [
            FloorMap::new(&small, &DepthImage::filled(80, 60, 2.53)),
            FloorMap::new(&camera, &image),
        ];
        let [a, b] = [&a, &b].map(|map| map.fine.at(46, 64)[4]);
        assert!((a - b).abs() < 0.2, "{a} {b}");
    }

    /// A map of a scene with people, walls and holes, point by point and voxel by voxel.
    #[test]
    fn a_map_is_that_of_its_points_one_by_one() {
        for distortion in [Distortion::None, Distortion::PlumbBob([0.05, 0.0, 0.001, 0.0, 0.0])] {
            let lens = Pinhole { fx: 61.3, fy: 60.7, cx: 39.2, cy: 29.9, distortion };
            let camera = Camera::mounted(lens, 83, 60, 1.15, 0.1, 0.03);
            let depth = DepthImage::from_fn(83, 60, |x, y| match (x * 7 + y * 5) % 11 {
                0 => f32::NAN,
                1 => 0.05,
                part => 0.4 + 0.5 * part as f32 + 0.01 * x as f32,
            });
            let mut slow = FloorMap::empty();
            for_each_point(&camera, &depth, |point, area_m2| slow.add_point(&point, area_m2));
            slow.flatten_surface();
            slow.add_voxels(|voxel| {
                let pixel = camera.project(voxel)?;
                let seen_m = depth.get(pixel.x.round() as i64, pixel.y.round() as i64)?;
                Some([seen_m.into(), camera.depth_of(voxel)])
            });
            slow.in_view = widened(&slow.in_view);
            let map = FloorMap::new(&camera, &depth);
            assert!(map == slow, "{distortion:?}");
            assert!(map.coarse.values.iter().any(|value| *value > 0.0));
        }
    }

    #[cfg(feature = "train")]
    #[test]
    fn a_mirrored_map_has_left_and_right_exchanged() {
        let depth = DepthImage::from_fn(80, 60, |x, _| if x < 25 { 2.0 } else { 4.0 });
        let map = FloorMap::new(&camera(1.1), &depth);
        let mirrored = FloorMap::new(&camera(1.1), &depth).mirrored();
        let mut differ = 0;
        let side = FloorMap::CELLS;
        for row in 0..side {
            for column in 0..side {
                let other = side - 1 - column;
                assert_eq!(mirrored.coarse.at(row, column), map.coarse.at(row, other));
                assert_eq!(mirrored.in_view[row * side + column], map.in_view[row * side + other]);
                let fine = [2 * row, 2 * row + 1];
                for row in fine {
                    let other = 2 * side - 1 - 2 * column;
                    assert_eq!(mirrored.fine.at(row, 2 * column), map.fine.at(row, other));
                }
                differ += usize::from(map.coarse.at(row, column) != map.coarse.at(row, other));
            }
        }
        assert!(differ > 50, "the map itself is not symmetric: {differ}");
    }
}
